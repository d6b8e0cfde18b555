//! Torque ripple at constant speed and current.
//!
//! Uses the torque of each PWM period over whole turns of the rotor, without cogging. Reported are its rms
//! about the mean, and its sixth harmonic per electrical turn, which dead time causes. The measurement is
//! made with the board's noise and with noise-free sensors.

use core::f64::consts::TAU;

use crate::report::motor::RippleReport;
use scarab::motor::DeadTime;
use scarab_base::error::ToolError;

use crate::motor::{Bench, PERIOD_S};

/// Current, A.
const CURRENT: f64 = 20.0;
/// Rotor speeds, rad/s, at most the top speed: a joint of the default leg at 0.2 rad/s, and at a
/// third of its top speed.
const SPEEDS: [f64; 2] = [10.0, 75.0];
/// Settling time, s.
const SETTLE_S: f64 = 0.1;
/// Measured turns of the rotor.
const TURNS: f64 = 1.0;
const HARMONIC: f64 = 6.0;

/// Measures all kinds of loop at all speeds.
pub fn measure(bench: &Bench) -> Result<Vec<RippleReport>, ToolError> {
    let mut reports = Vec::new();
    for speed in SPEEDS.map(|speed| speed.min(bench.top_speed)) {
        for noise in [false, true] {
            for compensated in [true, false] {
                reports.push(one(bench, speed, compensated, noise)?);
            }
        }
    }
    Ok(reports)
}

fn one(bench: &Bench, speed: f64, compensated: bool, noise: bool) -> Result<RippleReport, ToolError> {
    let mut bench = bench.clone();
    bench.axis.motor.cogging = 0.0;
    if !compensated {
        bench.configuration.dead_time = DeadTime::Uncompensated;
    }
    if !noise {
        bench.axis.shunts.noise_codes = 0.0;
    }
    let current = bench.within_limit(CURRENT);
    let mut rig = bench.rig(speed, 0.0)?;
    rig.hold(current, SETTLE_S);
    let motor = &bench.axis.motor;
    let (pairs, periods) = (f64::from(motor.pole_pairs), (TURNS * TAU / speed / PERIOD_S) as u32);
    let (mut sum, mut squares, mut harmonic, mut direct, mut count) = (0.0, 0.0, [0.0; 2], [0.0; 2], 0.0);
    for _ in 0..periods {
        let middle = rig.stand.rotor().angle + 0.5 * speed * PERIOD_S;
        let [d, _] = rig.period(current);
        let (torque, phase) = (rig.stand.torque(), HARMONIC * pairs * middle);
        sum += torque;
        squares += torque * torque;
        harmonic = [harmonic[0] + torque * phase.cos(), harmonic[1] + torque * phase.sin()];
        direct = [direct[0] + d, direct[1] + d * d];
        count += 1.0;
    }
    let mean = sum / count;
    let spread = |sum: f64, squares: f64| (squares / count - (sum / count) * (sum / count)).max(0.0).sqrt();
    let expected = 1.5 * pairs * motor.flux * current;
    bench.must_hold(&rig, "torque ripple", speed)?;
    Ok(RippleReport {
        speed_rad_s: speed,
        current_a: current,
        compensated,
        noise,
        torque_percent: 100.0 * spread(sum, squares) / mean,
        sixth_percent: 100.0 * 2.0 * harmonic[0].hypot(harmonic[1]) / count / mean,
        mean_error_percent: 100.0 * (mean / expected - 1.0),
        direct_a: spread(direct[0], direct[1]),
    })
}
