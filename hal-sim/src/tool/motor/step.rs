//! Steps of the quadrature current.
//!
//! From 5 to 25 A at constant speed; the mean over eight rotor angles, so that ripple and timer steps average out and what is
//! left is the loop. Designed is `i[k+1] = i[k] + w T (target - i[k-1])`, w = 2 pi f: the integrator that the controller's zero
//! leaves of motor and controller, one period late and held for one. The step comes with the sample of index 0.

use core::f64::consts::TAU;

use serde::Serialize;

use super::super::error::ToolError;
use super::{Bench, PERIOD_S};

/// Before and after, A.
const FROM: f64 = 5.0;
const TO: f64 = 25.0;
/// Looked at after the step, PWM periods: 2.5 ms.
const PERIODS: usize = 60;
/// To rest before the step, s.
const SETTLE_S: f64 = 0.03;
/// Rotor angles.
const ANGLES: u32 = 8;
/// Parts of the joint's top speed.
const SPEEDS: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];

/// What a step response looks like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// From 10 to 90 % of the step, ms.
    pub rise_ms: f64,
    /// Beyond the target, percent of the step.
    pub overshoot_percent: f64,
}

/// One speed, one kind of loop.
#[derive(Clone, Debug, Serialize)]
pub struct StepReport {
    /// Of the rotor, rad/s.
    pub speed_rad_s: f64,
    /// Cross-coupling and back-EMF fed forward.
    pub feedforward: bool,
    /// Of the quadrature current.
    #[serde(flatten)]
    pub shape: Shape,
    /// Largest direct current during the step, percent of the step.
    pub coupling_percent: f64,
    /// Mean error of the quadrature current over the last fifth, A.
    pub error_a: f64,
    /// From the step on, ms.
    pub time_ms: Vec<f64>,
    /// A.
    pub quadrature_a: Vec<f64>,
    /// A.
    pub direct_a: Vec<f64>,
}

/// Of a normalised response at the ends of periods.
fn shape(values: &[f64]) -> Shape {
    let crossing = |level: f64| -> f64 {
        let after = values.iter().position(|value| *value >= level).unwrap_or(values.len() - 1).max(1);
        let (low, high) = (values[after - 1], values[after]);
        (after as f64 - 1.0 + (level - low) / (high - low)) * PERIOD_S
    };
    let highest = values.iter().copied().fold(0.0, f64::max);
    Shape {
        rise_ms: 1e3 * (crossing(0.9) - crossing(0.1)),
        overshoot_percent: 100.0 * (highest - 1.0).max(0.0),
    }
}

/// The response that the bandwidth promises.
#[must_use]
pub fn response(bandwidth_hz: f64) -> Vec<f64> {
    let gain = TAU * bandwidth_hz * PERIOD_S;
    let mut values = vec![0.0, 0.0];
    while let (true, &[.., before, now]) = (values.len() <= PERIODS, values.as_slice()) {
        values.push(now + gain * (1.0 - before));
    }
    values
}

/// Its shape.
#[must_use]
pub fn designed(bandwidth_hz: f64) -> Shape {
    shape(&response(bandwidth_hz))
}

/// All speeds, with and without feedforward.
pub fn measure(bench: &Bench) -> Result<Vec<StepReport>, ToolError> {
    let mut steps = Vec::new();
    for share in SPEEDS {
        for feedforward in [true, false] {
            steps.push(one(bench, share * bench.top_speed, feedforward)?);
        }
    }
    Ok(steps)
}

fn one(bench: &Bench, speed: f64, feedforward: bool) -> Result<StepReport, ToolError> {
    let mut bench = bench.clone();
    bench.configuration.feedforward = feedforward;
    let (mut quadrature, mut direct) = (vec![0.0; PERIODS + 1], vec![0.0; PERIODS + 1]);
    let mut largest_direct = 0.0_f64;
    for number in 0..ANGLES {
        let angle = f64::from(number) / f64::from(ANGLES) * TAU / f64::from(bench.axis.motor.pole_pairs);
        let mut rig = bench.rig(speed, angle)?;
        rig.hold(FROM, SETTLE_S);
        let [d, q] = rig.period(FROM);
        let weight = 1.0 / f64::from(ANGLES);
        direct[0] += weight * d;
        quadrature[0] += weight * q;
        for (direct, quadrature) in direct.iter_mut().zip(&mut quadrature).skip(1) {
            let [d, q] = rig.period(TO);
            *direct += weight * d;
            *quadrature += weight * q;
        }
    }
    for value in &direct {
        largest_direct = largest_direct.max(value.abs());
    }
    let normal: Vec<_> = quadrature.iter().map(|current| (current - FROM) / (TO - FROM)).collect();
    let last = &quadrature[PERIODS - PERIODS / 5..];
    Ok(StepReport {
        speed_rad_s: speed,
        feedforward,
        shape: shape(&normal),
        coupling_percent: 100.0 * largest_direct / (TO - FROM),
        error_a: last.iter().sum::<f64>() / last.len() as f64 - TO,
        time_ms: (0..=PERIODS).map(|period| 1e3 * period as f64 * PERIOD_S).collect(),
        quadrature_a: quadrature,
        direct_a: direct,
    })
}
