//! Steps of the quadrature current.
//!
//! Steps from 5 to 25 A, or the same shares of a smaller current limit, at constant speed. The mean
//! over eight rotor angles averages ripple and timer steps; the rest is the loop.
//!
//! The designed response is `i[k+1] = i[k] + w T (target - i[k-1])` with w = 2 pi f. The
//! controller's zero cancels the motor's pole, and an integrator remains, delayed by one period and
//! held for one. The step comes with the sample of index 0.

use crate::report::motor::{Shape, StepReport};
use core::f64::consts::TAU;
use scarab_base::error::ToolError;

use crate::motor::{Bench, PERIOD_S};

/// Currents before and after the step, A.
const FROM: f64 = 5.0;
const TO: f64 = 25.0;
/// Recorded PWM periods after the step: 2.5 ms.
const PERIODS: usize = 60;
/// Settling time before the step, s.
const SETTLE_S: f64 = 0.03;
/// Number of rotor angles.
const ANGLES: u32 = 8;
/// Shares of the joint's top speed.
const SPEEDS: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];

/// Shape of a normalised response, sampled at the ends of periods.
fn shape(values: &[f64]) -> Shape {
    let crossing = |level: f64| -> Option<f64> {
        let after = values.iter().position(|value| *value >= level)?;
        let before = after.checked_sub(1)?;
        let (low, high) = (values[before], values[after]);
        Some((before as f64 + (level - low) / (high - low)) * PERIOD_S)
    };
    let highest = values.iter().copied().fold(0.0, f64::max);
    Shape {
        rise_ms: crossing(0.9).zip(crossing(0.1)).map(|(late, early)| 1e3 * (late - early)),
        overshoot_percent: 100.0 * (highest - 1.0).max(0.0),
    }
}

/// Response of the designed bandwidth.
pub(crate) fn response(bandwidth_hz: f64) -> Vec<f64> {
    let gain = TAU * bandwidth_hz * PERIOD_S;
    let mut values = vec![0.0, 0.0];
    while let (true, &[.., before, now]) = (values.len() <= PERIODS, values.as_slice()) {
        values.push(now + gain * (1.0 - before));
    }
    values
}

/// Shape of the designed response.
pub(crate) fn designed(bandwidth_hz: f64) -> Shape {
    shape(&response(bandwidth_hz))
}

/// Measures all speeds, with and without feedforward.
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
    let to = bench.within_limit(TO);
    let from = FROM / TO * to;
    for number in 0..ANGLES {
        let angle = f64::from(number) / f64::from(ANGLES) * TAU / f64::from(bench.axis.motor.pole_pairs);
        let mut rig = bench.rig(speed, angle)?;
        rig.hold(from, SETTLE_S);
        let [d, q] = rig.period(from);
        let weight = 1.0 / f64::from(ANGLES);
        direct[0] += weight * d;
        quadrature[0] += weight * q;
        for (direct, quadrature) in direct.iter_mut().zip(&mut quadrature).skip(1) {
            let [d, q] = rig.period(to);
            *direct += weight * d;
            *quadrature += weight * q;
        }
        let what = if feedforward { "steps" } else { "steps without feedforward" };
        bench.must_hold(&rig, what, speed)?;
    }
    for value in &direct {
        largest_direct = largest_direct.max(value.abs());
    }
    let normal: Vec<_> = quadrature.iter().map(|current| (current - from) / (to - from)).collect();
    let last = &quadrature[PERIODS - PERIODS / 5..];
    Ok(StepReport {
        speed_rad_s: speed,
        feedforward,
        from_a: from,
        to_a: to,
        shape: shape(&normal),
        coupling_percent: 100.0 * largest_direct / (to - from),
        error_a: last.iter().sum::<f64>() / last.len() as f64 - to,
        time_ms: (0..=PERIODS).map(|period| 1e3 * period as f64 * PERIOD_S).collect(),
        quadrature_a: quadrature,
        direct_a: direct,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_response_below_its_target_has_no_rise_time() {
        assert_eq!(shape(&[0.0, 0.05, 0.3, 0.6]).rise_ms, None);
        assert_eq!(shape(&[0.0; 8]).rise_ms, None);
        // Crossings: 0.1 at 0.5 periods, 0.9 at 4.5.
        let line: Vec<_> = (0..8).map(|period| 0.2 * f64::from(period)).collect();
        let rise = shape(&line).rise_ms.expect("the response reaches its target");
        assert!((rise - 4e3 * PERIOD_S).abs() < 1e-12, "{rise}");
    }
}
