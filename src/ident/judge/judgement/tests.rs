use super::*;
use crate::ident::judge::alignment::DIRECTIONS;
use crate::ident::record::choice::Choice;
use crate::ident::solve::estimate::Plan;
use crate::ident::solve::search::SearchState;
use crate::ident::solve::testing::{dropped, leg, model, record, solved};
use crate::swarm::{AdaptiveSettings, BsoSettings, Part};

#[test]
fn a_column_that_was_dropped_is_not_missing() {
    let auto = model::<f64>(Choice::Auto, &[]);
    let chosen = solved(&auto, record(&auto, &leg(0.0, [0.0; 2]), 1), 20);
    assert_eq!(dropped(&auto, chosen.record()), [true; 3]);
    let verdict =
        chosen.judge(&auto, &Thresholds::default(), core::iter::empty(), &[None; DIRECTIONS], &mut |_| {});
    assert_eq!(verdict, Verdict::ACCEPTED);
}

#[test]
fn a_rotor_inertia_that_is_negative_beyond_noise_is_kept_and_refused() {
    let model = model::<f64>(Choice::Auto, &[]);
    let solver = solved(&model, record(&model, &leg(-0.3, [0.0; 2]), 2), 20);
    assert_eq!(dropped(&model, solver.record()), [false, true, true]);
    let mut unheard = |_: &Evidence<f64>| {};
    let mut builder = VerdictBuilder::new(&mut unheard);
    Thresholds::default().judge_physics(&model, solver.record(), solver.least_squares(), &mut builder);
    assert!(builder.verdict().has(Reason::Unphysical));
}

/// Verdict on a right record after a search with these settings, and the search's excess in it.
fn judged(settings: BsoSettings<f32>) -> (Verdict, f32) {
    let model = model::<f32>(Choice::On, &[]);
    let record = record(&model, &leg(0.1, [0.5; 2]), 1);
    let mut solver = Solver::new(&model, record, Plan::OneTime, None, 1).with_settings(settings);
    while solver.advance(&model, 100) == SearchState::Running {}
    let mut excess = f32::NAN;
    let mut hear = |evidence: &Evidence<f32>| {
        if evidence.test == Test::Search {
            excess = evidence.value;
        }
    };
    let verdict =
        solver.judge(&model, &Thresholds::default(), core::iter::empty(), &[None; DIRECTIONS], &mut hear);
    (verdict, excess)
}

#[test]
fn a_search_that_stopped_short_of_least_squares_is_refused() {
    let (verdict, excess) = judged(BsoSettings::default());
    assert_eq!(verdict, Verdict::ACCEPTED);
    assert!((0.0..0.02).contains(&excess), "{excess}");
    // Without its learned metric the swarm ends some units above least squares.
    let crippled =
        AdaptiveSettings { without: Some(Part::Metric), pair_directions: 0, ..AdaptiveSettings::default() };
    let (verdict, excess) = judged(BsoSettings::Adaptive(crippled));
    assert!(verdict.has(Reason::Input));
    assert!((1.0..1e3).contains(&excess), "{excess}");
}
