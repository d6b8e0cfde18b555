use super::*;
use crate::ident::judge::alignment::DIRECTIONS;
use crate::ident::record::choice::Choice;
use crate::ident::solve::testing::{dropped, leg, model, record, solved};

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
