//! Assumptions of the model that a recording may contradict: its clocks, its weight, what an angle is
//! measured against, which torques a drive holds, and how friction grows.
//!
//! ```text
//! clock             Y(q, qd / f, qdd / f^2)      a second of the time column lasts f seconds
//! no_gravity        Y without gravity            the torque holds no weight
//! absolute_angle j  Y(q_j - sum_(i < j) (q_i - zero_i))    angle j against the base, not the link before it
//! link_length j     Y of a leg whose link before joint j is longer than the file states
//! torque_clock      torque(t + d + r t) = Y p    the torque falls behind the angle by the share r of time
//! crosstalk i, j    torque_i = Y_i p + c torque_j      c near one: the drive of joint j sits elsewhere
//! load_friction     torque_j = Y_j p + c_j sign(qd_j) |load_j|   (`additional_torque`)
//! changed_midway j  torque_j = Y_j p + c after a time      the best of a grid; a gain: midway.rs
//! ```
//!
//! Each is fitted with the parameters eliminated. They run after a refusal and for an accepted misfit: a
//! clock or a missing weight makes another leg, which fits, so most of it shows only beside the other tests.
//! Cost: some fifty fits.

use nalgebra::Vector3;
use scarab::real::dot;

use crate::report::additional_torque::AdditionalKind;
use crate::report::doubt::CauseReport;
use crate::run::logging_errors::beside::{Beside, LISTED, additional, beside, significance};
use crate::run::logging_errors::fit::Score;
use crate::run::logging_errors::lag::least;
use crate::run::logging_errors::midway::{POINTS, is_after};
use crate::run::logging_errors::regressor::Instant;
use crate::run::logging_errors::rows::{Equations, RowSource};
use crate::run::logging_errors::table::Table;
use crate::run::logging_errors::{NO_GRAVITY, Question, Refitted, no_gravity_words, recording_words};

/// Rates of a clock that are tried first.
const RATES: [f64; 12] = [0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.25, 1.5, 2.0, 2.5, 3.3, 5.0];
/// Rates closer to one than this are no other rate: drift of a clock, which stamps show.
const SAME_RATE: f64 = 0.02;

/// Steps of a search from the stated value.
const STEPS: usize = 5;
/// Step of a difference quotient.
const DIFFERENCE: f64 = 1e-4;
/// Largest error of a length that is searched, as share.
const LARGEST_LENGTH: f64 = 0.35;
/// Share of another joint's torque, apart from one, up to which a whole torque is added.
const WHOLE: f64 = 0.1;

/// All assumptions, each replaced alone.
pub(crate) fn all(question: &Question, equations: &Equations) -> Vec<Refitted> {
    let zero = question.zero();
    let joints = equations.joints();
    let weightless = equations.regressor.with_gravity(&|_| Vector3::zeros());
    let no_gravity = CauseReport { name: NO_GRAVITY, words: no_gravity_words(), ..CauseReport::default() };
    let mut found = vec![replaced(equations, no_gravity, equations.columns_of(&*weightless, &|_| {}))];
    found.extend((1..joints).map(|joint| {
        let cause = CauseReport {
            name: "absolute_angle",
            joint: Some(joint + 1),
            words: format!(
                "angle of joint {} is absolute, not against the link before it: subtract the angles before it",
                joint + 1
            ),
            ..CauseReport::default()
        };
        replaced(
            equations,
            cause,
            equations.columns_of(&*equations.regressor, &|instant| relative(instant, joint, &zero)),
        )
    }));
    // Before the clock: a leg of longer links moves like one of a slower clock, and is likelier.
    found.extend((1..joints).filter_map(|joint| link_length(equations, joint)));
    found.extend(clock(equations));
    found.extend((0..joints).flat_map(|one| {
        (0..joints)
            .filter(move |&other| other != one)
            .map(move |other| crosstalk(question, equations, one, other))
    }));
    found.push(load_friction(question, equations));
    found.extend(torque_clock(equations));
    found.extend((0..joints).filter_map(|joint| offset_step(question, equations, joint)));
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
    let here = columns(rate);
    let sigma = slope(equations, &here, &columns(rate + DIFFERENCE)).sigma();
    let cause = CauseReport {
        name: "clock",
        value: rate.into(),
        sigma: sigma.into(),
        words: format!(
            "a second of the time column lasts {rate:.2} +- {sigma:.2} s: is its unit or the sample rate right?"
        ),
        ..CauseReport::default()
    };
    let refitted = replaced(equations, cause, here);
    let significance = significance((rate - 1.0, sigma));
    ((rate - 1.0).abs() > SAME_RATE).then_some(Refitted { significance, ..refitted })
}

fn replaced(equations: &Equations, cause: CauseReport, columns: Table) -> Refitted {
    let torque = equations.torque.clone();
    let values = equations.fit(&columns, &torque, false).values;
    Refitted { cause, values, columns, torque, significance: f64::INFINITY }
}

/// A torque that contains part of another joint's, or all of it.
fn crosstalk(question: &Question, equations: &Equations, one: usize, other: usize) -> Refitted {
    let torques = equations.torques_of(&|instant| instant.torque[one] = instant.torque[other]);
    let pairs = torques.iter().zip(&equations.sources);
    let column = pairs.map(|(torque, source)| if source.joint == one { *torque } else { 0.0 }).collect();
    let Beside { refitted, found, .. } = beside(equations, equations.torque.clone(), &[column]);
    // Torques of the file, which a reversed joint counts the other way.
    let sign = [one, other].map(|joint| question.anatomy[joint].from_chain(1.0).signum());
    let (value, sigma) = (found[0].0 * sign[0] * sign[1], found[0].1);
    let contains = format!(
        "torque of joint {} contains {:.1} +- {:.1} % of that of joint {}",
        one + 1,
        100.0 * value,
        100.0 * sigma,
        other + 1
    );
    let (name, joint, words) = if (value.abs() - 1.0).abs() < WHOLE {
        let sits = format!("{contains}: does the drive of joint {} sit before joint {}?", other + 1, one + 1);
        ("coupled_drive", other, sits)
    } else {
        ("crosstalk", one, contains)
    };
    let [value, sigma] = [value, sigma].map(|share| (100.0 * share).into());
    let cause = CauseReport { name, joint: Some(joint + 1), value, sigma, words, ..CauseReport::default() };
    Refitted { cause, ..refitted }
}

/// Step to the best value of what changes the columns, and its standard deviation, from the columns at a
/// value and a little beside it.
fn slope(equations: &Equations, here: &Table, beside: &Table) -> Score {
    let fit = equations.fit(here, &equations.torque, false);
    let (beside, predicted) = (fit.predictions(beside), fit.predictions(here));
    let slope: Vec<f64> =
        beside.iter().zip(&predicted).map(|(beside, here)| (beside - here) / DIFFERENCE).collect();
    equations.score(&fit, here, &equations.torque, &slope)
}

/// Another length of the link before a joint, searched from the stated one by Gauss-Newton; `None` beyond the
/// range.
fn link_length(equations: &Equations, joint: usize) -> Option<Refitted> {
    let columns = |value: f64| {
        let other = equations.regressor.with_length(joint, 1.0 + value)?;
        Some(equations.columns_of(&*other, &|_| {}))
    };
    let (mut value, mut sigma) = (0.0_f64, 0.0);
    for _ in 0..STEPS {
        let score = slope(equations, &columns(value)?, &columns(value + DIFFERENCE)?);
        (value, sigma) = (value + score.delta, score.sigma());
        if value.abs() > LARGEST_LENGTH {
            return None;
        }
    }
    let [percent, sigma_percent] = [value, sigma].map(|share| 100.0 * share);
    let cause = CauseReport {
        name: "link_length",
        joint: Some(joint + 1),
        value: percent.into(),
        sigma: sigma_percent.into(),
        words: format!(
            "the link before joint {} is {:.1} +- {sigma_percent:.1} % {} than the leg file states",
            joint + 1,
            percent.abs(),
            if value < 0.0 { "shorter" } else { "longer" }
        ),
        ..CauseReport::default()
    };
    let refitted = replaced(equations, cause, columns(value)?);
    Some(Refitted { significance: significance((value, sigma)), ..refitted })
}

/// Friction that grows with the torque that the gear transmits, of all joints.
pub(crate) fn load_friction(question: &Question, equations: &Equations) -> Refitted {
    let joints = (0..equations.joints()).map(|joint| (joint, AdditionalKind::LoadFriction));
    let Beside { refitted, found, .. } = additional(question, equations, &joints.collect::<Vec<_>>());
    let listed: Vec<usize> = (0..found.len()).filter(|&joint| significance(found[joint]) > LISTED).collect();
    let words: Vec<String> = listed
        .iter()
        .map(|&joint| {
            let [value, sigma] = [found[joint].0, found[joint].1].map(|share| 100.0 * share);
            format!("that of joint {} by {value:.1} +- {sigma:.1} %", joint + 1)
        })
        .collect();
    let only = (listed.len() == 1).then(|| listed[0]);
    let cause = CauseReport {
        name: AdditionalKind::LoadFriction.name(),
        joint: only.map(|joint| joint + 1),
        value: only.map(|joint| 100.0 * found[joint].0).into(),
        sigma: only.map(|joint| 100.0 * found[joint].1).into(),
        words: format!(
            "friction grows with the torque: {}",
            if words.is_empty() { "hardly".into() } else { words.join(", ") }
        ),
        ..CauseReport::default()
    };
    // Friction that falls with the load is none.
    let is_friction = listed.iter().all(|&joint| found[joint].0 > 0.0);
    Refitted { cause, significance: if is_friction { refitted.significance } else { 0.0 }, ..refitted }
}

/// Torques whose clock runs at another rate than that of the angles; `None` where the search leaves its
/// range.
fn torque_clock(equations: &Equations) -> Option<Refitted> {
    let largest_s = equations.largest_delay_s();
    let mut late = [0.0; 2];
    let late_s = |late: [f64; 2], source: &RowSource| {
        (late[0] + late[1] * equations.time_from_middle_s(source)).clamp(-largest_s, largest_s)
    };
    let mut step = 0;
    loop {
        let torque = equations.delayed(|source| Some(late_s(late, source)));
        let fit = equations.fit(&equations.columns, &torque, false);
        let rates = equations.rate_of(&fit.predictions(&equations.columns));
        let slopes: Vec<f64> = rates.iter().map(|rate| -rate).collect();
        let drifting = slopes.iter().zip(&equations.sources);
        let drifting = drifting.map(|(slope, source)| slope * equations.time_from_middle_s(source)).collect();
        let Beside { refitted, found, .. } = beside(equations, torque, &[slopes, drifting]);
        step += 1;
        if step < STEPS {
            late = [late[0] + found[0].0, late[1] + found[1].0];
            continue;
        }
        let latest_s = equations
            .sources
            .iter()
            .map(|source| (late[0] + late[1] * equations.time_from_middle_s(source)).abs());
        if latest_s.fold(0.0, f64::max) >= largest_s {
            return None;
        }
        let [rate, sigma] = [late[1], found[1].1].map(|rate| 1e6 * rate);
        let cause = CauseReport {
            name: "torque_clock",
            value: rate.into(),
            sigma: sigma.into(),
            words: format!(
                "torque {} the angle by {:.0} +- {sigma:.0} ppm of the time: two clocks? Stamp both by one",
                if rate < 0.0 { "runs ahead of" } else { "falls behind" },
                rate.abs()
            ),
            ..CauseReport::default()
        };
        return Some(Refitted { cause, significance: significance((rate, sigma)), ..refitted });
    }
}

/// An offset that changes at once, at the same share of every recording or within one.
fn offset_step(question: &Question, equations: &Equations, joint: usize) -> Option<Refitted> {
    let fit = equations.fit(&equations.columns, &equations.torque, false);
    let motions = equations.sources.iter().map(|source| source.motion).max()? + 1;
    let scopes = std::iter::once(None).chain((0..motions).filter(|_| motions > 1).map(Some));
    let points =
        scopes.flat_map(|scope| (1..=POINTS).map(move |point| (scope, point as f64 / (POINTS + 1) as f64)));
    let column = |(scope, share): (Option<usize>, f64)| -> Vec<f64> {
        let after = equations.sources.iter().map(|source| is_after(source, scope, Some(joint), share));
        after.map(|is_after| if is_after { 1.0 } else { 0.0 }).collect()
    };
    let gain = |point: (Option<usize>, f64)| {
        let score = equations.score(&fit, &equations.columns, &equations.torque, &column(point));
        score.delta * score.delta * dot(&score.column, &score.column)
    };
    let best = points.map(|point| (point, gain(point))).max_by(|one, other| one.1.total_cmp(&other.1))?.0;
    let Beside { refitted, found, .. } = beside(equations, equations.torque.clone(), &[column(best)]);
    let value = question.anatomy[joint].from_chain(found[0].0);
    let sigma = found[0].1;
    let cause = CauseReport {
        name: "changed_midway",
        joint: Some(joint + 1),
        value: value.into(),
        sigma: sigma.into(),
        words: format!(
            "offset of joint {} changes by {value:+.2} +- {sigma:.2} N m after {:.0} % of {}",
            joint + 1,
            100.0 * best.1,
            recording_words(best.0)
        ),
        ..CauseReport::default()
    };
    Some(Refitted { cause, ..refitted })
}
