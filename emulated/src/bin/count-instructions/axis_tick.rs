//! One axis' tick, calibrated, with noise, at four speeds up to the voltage limit.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::hal::{AxisCommand, AxisSample};
use scarab::motor::{
    Axis, AxisConfiguration, AxisRequest, Calibration, CalibrationSettings, CalibrationStep, Calibrator,
};
use scarab::units::{Ampere, KilogramMetreSquared, Volt};

use crate::axis_parts;
use crate::counter::{Tally, count, heading};
use crate::motor::{CONFIGURATION, Motor};

/// Design bound of one axis' tick.
const MOST_INSTRUCTIONS: u32 = 700;

/// Mechanical speeds and target currents: nearly at rest, a joint's largest speed behind 50:1, and near the
/// voltage limit. Not fully at rest, because a rotor that does not move under a current of either sign counts
/// as a frozen encoder.
pub const SPEEDS: [(f32, f32); 4] = [(1.0, 10.0), (225.0, 30.0), (-225.0, 30.0), (820.0, 40.0)];
/// Ticks counted at each speed; an electrical turn at the slowest moving speed takes 96.
const TICKS: u32 = 1200;

#[inline(never)]
fn tick(axis: &mut Axis, sample: &AxisSample, request: AxisRequest) -> AxisCommand {
    axis.tick(sample, request)
}

/// Prints the tables; returns whether the bounds are met.
pub fn report() -> bool {
    let mut motor = Motor::at_rest();
    hprintln!("\nOne axis, 24 kHz");
    heading("instructions");
    let mut tally = Tally::default();
    let Some(calibration) = calibrated(&mut motor, &CONFIGURATION, &mut tally) else { return false };
    tally.print("calibration, a tick");
    let Some(all) = ticks(&mut motor, &CONFIGURATION, &calibration) else { return false };
    let is_within = all.print_against("axis tick, all of them", MOST_INSTRUCTIONS);
    axis_parts::report(&all);
    is_within
}

/// Calibrates a motor and counts the ticks' instructions; `None` if the calibration is refused.
pub fn calibrated(
    motor: &mut Motor,
    configuration: &AxisConfiguration,
    tally: &mut Tally,
) -> Option<Calibration> {
    let settings = CalibrationSettings {
        current: Ampere(20.0),
        voltage: Volt(4.0),
        turns_per_s: 16.0,
        travel_turns: 1.25,
        inertia: KilogramMetreSquared(2e-4),
    };
    let mut calibrator = Calibrator::new(configuration, settings).ok()?;
    let mut sample = motor.sample(None);
    loop {
        let (instructions, step) = count(|| calibrator.tick(&sample));
        tally.push(instructions);
        match step {
            CalibrationStep::Running(command) => sample = motor.period(command),
            CalibrationStep::Done(found) => return Some(found),
            CalibrationStep::Refused(reason) => {
                hprintln!("calibration refused: {:?}", reason);
                return None;
            }
        }
    }
}

/// Counts the ticks at every speed; `None` where the axis faulted.
fn ticks(motor: &mut Motor, configuration: &AxisConfiguration, calibration: &Calibration) -> Option<Tally> {
    let (mut all, mut check, mut joint) = (Tally::default(), Tally::default(), Tally::default());
    motor.driven = true;
    for (speed, current) in SPEEDS {
        motor.speed_rad_per_s = speed;
        let mut sample = motor.sample(None);
        let mut axis = Axis::new(configuration, calibration, &sample).ok()?;
        for _ in 0..240 {
            sample = motor.period(tick(&mut axis, &sample, AxisRequest::OFF));
        }
        let mut tally = Tally::default();
        for step in 0..TICKS {
            let current = if step % 400 < 200 { current } else { -current };
            let request = AxisRequest { enabled: true, current: Ampere(current) };
            let (instructions, command) = count(|| tick(&mut axis, black_box(&sample), black_box(request)));
            tally.push(instructions);
            sample = motor.period(command);
            if step % 6 == 0 {
                axis.check_constants();
            }
            if step % 6 == 2 {
                check.push(count(|| black_box(&mut axis).check()).0);
            }
            if step % 6 == 5 {
                joint.push(count(|| black_box(&mut axis).joint_sample()).0);
            }
        }
        if let Some(fault) = axis.fault() {
            hprintln!("axis turned off at {} rad/s: {:?}", speed as i32, fault);
            return None;
        }
        hprintln!("{:<41} {:>6} {:>8} {:>8}", "axis tick at rad/s", speed as i32, tally.mean(), tally.most());
        all.add(&tally);
    }
    check.print("checks of voltages and index, once per 4 kHz tick");
    joint.print("joint sample, once per 4 kHz tick");
    Some(all)
}
