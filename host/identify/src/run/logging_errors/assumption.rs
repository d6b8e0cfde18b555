//! Assumptions of the model that a recording may contradict as a whole: its clock, its weight, and what an
//! angle is measured against.
//!
//! ```text
//! clock             Y(q, qd / f, qdd / f^2)      a second of the time column lasts f seconds
//! no_gravity        Y without gravity            the torque holds no weight
//! absolute_angle j  Y(q_j - sum_(i < j) (q_i - zero_i))    angle j against the base, not the link before it
//! ```
//!
//! Each is fitted with the parameters eliminated. They run only after a refusal: a clock or a missing weight
//! makes another leg, which fits, so most of it shows only beside the other tests. Cost: some thirty fits.

use nalgebra::Vector3;

use crate::report::doubt::CauseReport;
use crate::run::logging_errors::Refitted;
use crate::run::logging_errors::lag::least;
use crate::run::logging_errors::regressor::Instant;
use crate::run::logging_errors::rows::Equations;
use crate::run::logging_errors::table::Table;

/// Rates of a clock that are tried first.
const RATES: [f64; 12] = [0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.25, 1.5, 2.0, 2.5, 3.3, 5.0];
/// Rates closer to one than this are no other rate: drift of a clock, which stamps show.
const SAME_RATE: f64 = 0.02;

/// All assumptions, each replaced alone.
pub(crate) fn all(equations: &Equations, zero: &[f64]) -> Vec<Refitted> {
    let weightless = equations.regressor.with_gravity(&|_| Vector3::zeros());
    let no_gravity = CauseReport {
        name: "no_gravity",
        words:
            "the torque holds no weight: was gravity compensation subtracted? Log the torque of the motors"
                .into(),
        ..CauseReport::default()
    };
    let mut found = vec![replaced(equations, no_gravity, equations.columns_of(&*weightless, &|_| {}))];
    found.extend((1..equations.joints()).map(|joint| {
        let cause = CauseReport {
            name: "absolute_angle",
            joint: Some(joint + 1),
            words: format!(
                "angle of joint {} is absolute, not against the link before it: subtract the angles before it",
                joint + 1
            ),
            ..CauseReport::default()
        };
        replaced(equations, cause, equations.columns_of(&*equations.regressor, &|instant| relative(instant, joint, zero)))
    }));
    found.extend(clock(equations));
    found
}

/// Makes the absolute angle of a joint relative to the link before it, for parallel axes.
fn relative(instant: &mut Instant, joint: usize, zero: &[f64]) {
    for before in 0..joint {
        instant.position[joint] -= instant.position[before] - zero[before];
        instant.velocity[joint] -= instant.velocity[before];
        instant.acceleration[joint] -= instant.acceleration[before];
    }
}

/// The rate of the clock that fits best, unless it is the stated one.
fn clock(equations: &Equations) -> Option<Refitted> {
    let columns = |rate: f64| {
        equations.columns_of(&*equations.regressor, &|instant| {
            instant.velocity.iter_mut().for_each(|speed| *speed /= rate);
            instant.acceleration.iter_mut().for_each(|acceleration| *acceleration /= rate * rate);
        })
    };
    let cost = |rate: f64| equations.fit(&columns(rate), &equations.torque, false).cost;
    let costs = RATES.map(cost);
    let best = (0..costs.len()).min_by(|&one, &other| costs[one].total_cmp(&costs[other]))?;
    let low = best.checked_sub(1).map(|before| RATES[before])?;
    let rate = least(low, RATES.get(best + 1).copied()?, cost);
    let cause = CauseReport {
        name: "clock",
        value: rate.into(),
        words: format!(
            "a second of the time column lasts {rate:.2} s: is its unit or the sample rate right?"
        ),
        ..CauseReport::default()
    };
    ((rate - 1.0).abs() > SAME_RATE).then(|| replaced(equations, cause, columns(rate)))
}

fn replaced(equations: &Equations, cause: CauseReport, columns: Table) -> Refitted {
    let torque = equations.torque.clone();
    let plain = equations.fit(&equations.columns, &torque, false).cost;
    let fit = equations.fit(&columns, &torque, false);
    let remaining = (fit.cost / plain.max(1e-300)).max(0.0);
    let words =
        format!("{}; fitted, it explains {:.0} % of the misfit", cause.words, 100.0 * (1.0 - remaining));
    Refitted { cause: CauseReport { words, ..cause }, remaining, values: fit.values, columns, torque }
}
