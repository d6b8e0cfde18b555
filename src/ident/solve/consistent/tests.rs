//! Claims about completion and full search, on factors made from random states and on adversarial ones.

use nalgebra::{Matrix3, Vector3};

use super::pseudo_inertia::Factored;
use super::*;
use crate::ident::record::motion_record::Record;
use crate::ident::record::recorder::Recorder;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::bounds::{LinkPrior, prior_parameters};
use crate::ident::solve::completion::{complete_within, prior_deviations};
use crate::ident::solve::estimate::{Estimate, Plan, Problem};
use crate::ident::solve::testing::{ALL, B, planar};
use crate::model::{ColumnMask, JointState, LegParameters, Parameter, RigidBody, regressor};
use crate::real::Real;
use crate::swarm::{BsoSettings, Objective};
use crate::testing::TestRandom;

fn link(mass: f64, centre: [f64; 3], inertia: [f64; 3], drive: [f64; 4]) -> LinkPrior<f64> {
    LinkPrior {
        body: RigidBody {
            mass,
            centre_of_mass: Vector3::from(centre),
            inertia: Matrix3::from_diagonal(&Vector3::from(inertia)),
        },
        rotor_inertia: drive[0],
        coulomb_friction: drive[1],
        viscous_friction: drive[2],
        offset: drive[3],
    }
}

fn truth() -> [LinkPrior<f64>; 2] {
    [
        link(8.5, [0.2, 0.012, 0.0], [0.02, 0.16, 0.165], [0.12, 3.0, 1.2, 0.4]),
        link(4.8, [0.18, -0.015, 0.0], [0.01, 0.095, 0.098], [0.08, 2.0, 0.8, -0.3]),
    ]
}

/// Wrong by up to `share` in every number, still physically consistent.
fn wrong(random: &mut TestRandom, share: f64) -> [LinkPrior<f64>; 2] {
    truth().map(|link| LinkPrior {
        body: RigidBody {
            mass: link.body.mass * (1.0 + random.within(share)),
            centre_of_mass: link.body.centre_of_mass * (1.0 + random.within(share)),
            inertia: link.body.inertia * (1.0 + random.within(share)),
        },
        rotor_inertia: link.rotor_inertia * (1.0 + random.within(share)),
        coulomb_friction: link.coulomb_friction * (1.0 + random.within(share)),
        viscous_friction: link.viscous_friction * (1.0 + random.within(share)),
        offset: 0.0,
    })
}

fn model<T: Real, const N: usize>(mask: &ColumnMask<N>) -> RowModel<T, N, B> {
    planar(0.45, mask)
}

/// Torque of these base values on random states, with noise of 0.3 N m.
fn record<const N: usize>(
    random: &mut TestRandom,
    model: &RowModel<f64, N, B>,
    values: &[f64; B],
) -> Record<f64, N, B> {
    let mut record = Recorder::<f64, N, B, 256, 26>::new(8.0).unwrap().finish();
    let mut squares = [0.0; N];
    for _ in 0..400 {
        let state = JointState {
            q: core::array::from_fn(|_| random.within(1.0)),
            qd: core::array::from_fn(|_| random.within(2.0)),
            qdd: core::array::from_fn(|_| random.within(6.0)),
        };
        for (joint, full) in regressor(&model.chain, &state, &model.gravity).iter().enumerate() {
            let mut row = [0.0; B];
            model.base.select(full, &mut row);
            let exact: f64 = row.iter().zip(values).map(|(element, value)| element * value).sum();
            let torque = exact + (0..12).map(|_| random.within(0.15)).sum::<f64>();
            record.factors[joint].insert(&row, torque);
            squares[joint] += torque * torque;
        }
    }
    for (joint, size) in record.torque.iter_mut().enumerate() {
        (size.root_mean_square, size.speed) = (crate::real::sqrt(squares[joint] / 400.0), 1.2);
    }
    (record.rows, record.row_information) = ([400; N], 1.0);
    record
}

/// Completes the least squares of a record and checks every step on the way.
fn complete<T: Real, const N: usize>(
    mask: &ColumnMask<N>,
    record: &Record<f64, N, B>,
    prior: Option<&[LinkPrior<f64>; N]>,
    effort: Effort<T>,
) -> (Completion<T, N>, Estimate<T, B>) {
    let (model, record) = (model::<T, N>(mask), record.convert::<T>());
    let prior = prior.map(|prior| prior.map(|link| link.convert()));
    let problem = Problem::new(&record, &model);
    let estimate = problem.least_squares(Plan::OneTime);
    let mut completion = Completion::new(&model, &record, prior.as_ref(), effort);
    completion.start(&model, &problem.whole(), &estimate.values, &estimate.values);
    let mut is_complete = false;
    while !is_complete {
        assert!(completion.limits().allow(&completion.parameters()), "{:?}", completion.parameters());
        is_complete = completion.step();
    }
    assert!(completion.limits().allow(&completion.parameters()));
    (completion, estimate)
}

/// Cost of the data above least squares, chi-square units.
fn excess<T: Real, const N: usize>(
    mask: &ColumnMask<N>,
    record: &Record<f64, N, B>,
    found: &LegParameters<T, N>,
) -> f64 {
    let model = model::<f64, N>(mask);
    let found = found.map(|joint| joint.map(Real::to_double));
    Problem::new(record, &model).weighted().excess(&model.base.project(&found))
}

/// Base values of no possible leg: some inertia or friction of the true leg is negative.
fn impossible(random: &mut TestRandom, model: &RowModel<f64, 2, B>) -> [f64; B] {
    let mut parameters = prior_parameters(&truth());
    for _ in 0..2 {
        let joint = usize::from(random.within(1.0) > 0.0);
        let which = [Parameter::ZZ, Parameter::IA, Parameter::FC, Parameter::FV, Parameter::HX];
        let parameter = which[((random.within(0.5) + 0.5) * 4.99) as usize];
        parameters[joint][parameter.index()] *= -1.0 + random.within(0.8);
    }
    model.base.project(&parameters)
}

#[test]
fn no_impossible_leg_is_ever_visited_whatever_the_data_and_the_precision() {
    let mut random = TestRandom::new(1);
    let (mut forced, mut free) = (0, 0);
    for index in 0..40 {
        let model = model::<f64, 2>(&ALL);
        let honest = model.base.project(&prior_parameters(&truth()));
        let values = if index % 2 == 0 { impossible(&mut random, &model) } else { honest };
        let record = record(&mut random, &model, &values);
        let prior = (index % 3 != 0).then(|| wrong(&mut random, 0.4));
        let (reference, _) = complete::<f64, 2>(&ALL, &record, prior.as_ref(), Effort::reference());
        let effort = Effort::device(prior.is_some());
        let (single, estimate) = complete::<f32, 2>(&ALL, &record, prior.as_ref(), effort);
        let least = excess(&ALL, &record, &reference.parameters());
        let found = excess(&ALL, &record, &single.parameters());
        let double = Effort { pull: f64::from(effort.pull), last_barrier: f64::from(effort.last_barrier) };
        let (double, _) = complete::<f64, 2>(&ALL, &record, prior.as_ref(), double);
        let same = excess(&ALL, &record, &double.parameters());
        // Single precision ends where double does: barriers leave 42 x 1e-4, rounding 1e-3 of large costs.
        assert!((found - same).abs() < 0.01 + 0.01 * same, "{found} {same}");
        // Where data contradict every leg, the pull on hidden directions has an effect: less than the cost
        // itself, which any such figure refuses. Consistent data pay nothing.
        assert!(found > least - 1e-3 - 1e-5 * least && found < 0.05 + 2.0 * least, "{found} {least}");
        // The true leg is allowed and costs no more than the noise of 13 degrees of freedom.
        if index % 2 == 1 {
            assert!(least < 20.0, "{least}");
            free += 1;
        } else {
            // In a sum a negative inertia of one link may belong to another, more so without a prior.
            forced += u32::from(least > 20.0);
        }
        assert_eq!(estimate.rank(), 13);
    }
    assert!(forced >= 15 && free == 20, "{forced} {free}");
}

#[test]
fn the_prior_has_no_say_in_what_is_measured() {
    let mut random = TestRandom::new(2);
    let mut moved = 0;
    for _ in 0..20 {
        let model = model::<f64, 2>(&ALL);
        let record = record(&mut random, &model, &model.base.project(&prior_parameters(&truth())));
        let prior = wrong(&mut random, 0.4);
        let (completion, estimate) = complete::<f32, 2>(&ALL, &record, Some(&prior), Effort::device(true));
        moved += u32::from(completion.steps() > 0);
        let found = model.base.project(&completion.parameters().map(|joint| joint.map(f64::from)));
        for (base, found) in found.iter().enumerate() {
            let sigma = f64::from(estimate.sigma(base).unwrap());
            // A twentieth of a standard deviation is negligible. A prior term of one unit per standard
            // deviation of the prior would move the offsets by a third.
            assert!((found - f64::from(estimate.values[base])).abs() < 0.05 * sigma, "{base}");
        }
    }
    assert!(moved > 5, "the closed form must fail sometimes: {moved}");
}

#[test]
fn a_closed_form_that_is_a_leg_is_taken_as_it_is() {
    let mut random = TestRandom::new(3);
    let model = model::<f64, 2>(&ALL);
    let record = record(&mut random, &model, &model.base.project(&prior_parameters(&truth())));
    let (completion, estimate) = complete::<f64, 2>(&ALL, &record, Some(&truth()), Effort::reference());
    assert_eq!(completion.steps(), 0);
    let prior = prior_parameters(&truth());
    let closed = complete_within(&model, &estimate.values, &prior, &prior_deviations(&prior)).unwrap();
    for (found, closed) in completion.parameters().as_flattened().iter().zip(closed.as_flattened()) {
        // Rounding of scaling there and back.
        assert!((found - closed).abs() < 1e-12);
    }
    // The result is also the unconstrained minimum of the cost that steps would lower.
    let point = completion.cost().scaled_point(&closed);
    assert!(completion.cost().excess(&point) < 1e-12);
}

#[test]
fn no_allowed_leg_is_better_than_the_completion() {
    let mut random = TestRandom::new(4);
    for _ in 0..10 {
        let model = model::<f64, 2>(&ALL);
        let values = impossible(&mut random, &model);
        let record = record(&mut random, &model, &values);
        let prior = wrong(&mut random, 0.4);
        let (completion, _) = complete::<f64, 2>(&ALL, &record, Some(&prior), Effort::reference());
        let (cost, best) = (completion.cost(), completion.parameters());
        let (objective, least) =
            (FullObjective::new(completion.limits(), cost), cost.excess(&cost.scaled_point(&best)));
        for _ in 0..200 {
            let position: [f64; 28] = core::array::from_fn(|coordinate| {
                let (low, high) = objective.bounds(coordinate);
                low + (high - low) * (0.5 + random.within(0.5))
            });
            let other = objective.parameters(&position);
            if !completion.limits().allow(&other) {
                continue;
            }
            // Set and cost are convex: with a better leg anywhere, the way there would lead downhill. The
            // barriers leave 42 x 1e-8, rounding 1e-12 of the cost.
            let toward = |share: f64| -> LegParameters<f64, 2> {
                core::array::from_fn(|joint| {
                    core::array::from_fn(|index| {
                        best[joint][index] + share * (other[joint][index] - best[joint][index])
                    })
                })
            };
            let near = cost.excess(&cost.scaled_point(&toward(1e-4)));
            assert!(near > least - 2e-6 - 1e-10 * least, "{near} below {least}");
        }
    }
}

#[test]
fn without_a_prior_a_leg_that_can_exist_costs_nothing() {
    let mut random = TestRandom::new(7);
    let model = model::<f64, 2>(&ALL);
    let parameters = prior_parameters(&truth());
    for _ in 0..10 {
        let mut record = record(&mut random, &model, &model.base.project(&parameters));
        // Every row has a hundredfold weight, as in a long record: a pull toward the neutral leg would show.
        record.row_information = 100.0;
        let (reference, _) = complete::<f64, 2>(&ALL, &record, None, Effort::reference());
        let (single, _) = complete::<f32, 2>(&ALL, &record, None, Effort::device(false));
        assert!(reference.limits().allow(&parameters));
        assert!(reference.converged() && single.converged());
        // No constraint binds: pull and barriers leave less than a unit, against a limit of 13 + 5 sqrt(26).
        for found in [reference.parameters(), single.parameters().map(|joint| joint.map(f64::from))] {
            let excess = excess(&ALL, &record, &found);
            assert!(excess < 1.0, "{excess}");
        }
    }
}

#[test]
fn legs_of_one_joint_without_prior_and_without_some_columns_are_completed() {
    let mut random = TestRandom::new(5);
    let mut mask = [[true; 14]; 1];
    mask[0][Parameter::IA.index()] = false;
    let model = model::<f64, 1>(&mask);
    let single = [truth()[0]];
    let mut parameters = prior_parameters(&single);
    parameters[0][Parameter::IA.index()] = 0.0;
    let record = record(&mut random, &model, &model.base.project(&parameters));
    for prior in [None, Some(&single)] {
        let (completion, _) = complete::<f32, 1>(&mask, &record, prior, Effort::device(prior.is_some()));
        let found = completion.parameters();
        assert!(excess(&mask, &record, &found) < 0.1);
        let believed = completion.limits().origin()[0][Parameter::IA.index()];
        assert_eq!(found[0][Parameter::IA.index()], believed, "a column that is not estimated stays");
    }
}

#[test]
fn a_short_body_without_prior_and_length_costs_nothing() {
    let mut random = TestRandom::new(9);
    let mut mask = [[true; 14]; 1];
    mask[0][Parameter::IA.index()] = false;
    let model = model::<f64, 1>(&mask);
    // 7 cm from the axis, 3 cm of gyration: 20 kg for a moment of 1.4 kg m.
    let short = [link(20.0, [0.072, 0.0, 0.0], [0.02, 0.02, 0.02], [0.0, 0.3, 0.1, 0.0])];
    let record = record(&mut random, &model, &model.base.project(&prior_parameters(&short)));
    let (completion, _) = complete::<f32, 1>(&mask, &record, None, Effort::device(false));
    assert!(excess(&mask, &record, &completion.parameters()) < 0.1);
}

#[test]
fn every_point_of_the_full_box_is_a_leg_and_slices_do_not_change_the_search() {
    let mut random = TestRandom::new(6);
    let (model64, model32) = (model::<f64, 2>(&ALL), model::<f32, 2>(&ALL));
    let record = record(&mut random, &model64, &model64.base.project(&prior_parameters(&truth())));
    for prior in [None, Some(wrong(&mut random, 0.4))] {
        let (completion, _) =
            complete::<f32, 2>(&ALL, &record, prior.as_ref(), Effort::device(prior.is_some()));
        let single = record.convert::<f32>();
        let problem = Problem::new(&single, &model32);
        let mut cost = LegCost::new(completion.limits());
        cost.fill(&model32, &problem.whole(), &problem.least_squares(Plan::OneTime).values, 1e-2);
        let objective = FullObjective::new(completion.limits(), &cost);
        assert_eq!(objective.dimension(), 28);
        for index in 0..500 {
            let position: [f32; 28] = core::array::from_fn(|coordinate| {
                let (low, high) = objective.bounds(coordinate);
                // Includes the corners.
                let share =
                    if index % 2 == 0 { 0.5 + random.within(0.5) } else { random.within(1.0).round().abs() };
                low + (high - low) * share as f32
            });
            let leg = objective.parameters(&position);
            assert!(Limits::consistent(&leg), "{leg:?}");
        }
        let run = |slice: u32| {
            let mut search = FullSearch::<f32, 28>::new(&objective, BsoSettings::default(), 3).unwrap();
            while !search.advance(&objective, slice) {}
            let leg = search.parameters(&objective).map(|leg| leg.map(|joint| joint.map(f32::to_bits)));
            (search.iterations(), search.evaluations(), leg)
        };
        assert!(run(1).0 > 50);
        assert_eq!(run(1), run(7));
    }
}

#[test]
fn barrier_rows_are_the_derivatives_of_the_log_determinant() {
    let parameters = prior_parameters(&truth());
    for joint in &parameters {
        let factored = Factored::new(joint).unwrap();
        let rows = factored.rows(&[1.0; 14]);
        for parameter in 0..10 {
            let at = |step: f64| {
                let mut moved = *joint;
                moved[parameter] += step;
                Factored::new(&moved).unwrap().log_determinant
            };
            let step = 1e-4 * 1e-2;
            let slope = (at(step) - at(-step)) / (2.0 * step);
            let trace: f64 = rows[..4].iter().map(|row| row[parameter]).sum();
            // Second-order differences of a function that varies over 1e-3 of a parameter.
            assert!((slope - trace).abs() < 1e-5 * (1.0 + trace.abs()), "{parameter}: {slope} {trace}");
            let curve = (at(step) - 2.0 * at(0.0) + at(-step)) / (step * step);
            let squares: f64 = rows.iter().map(|row| row[parameter] * row[parameter]).sum();
            assert!((curve + squares).abs() < 2e-2 * (1.0 + squares), "{parameter}: {curve} {squares}");
        }
    }
    let mut impossible = parameters[0];
    impossible[Parameter::ZZ.index()] = 10.0;
    assert!(Factored::new(&impossible).is_none());
}
