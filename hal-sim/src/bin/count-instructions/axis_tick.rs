//! One axis' tick, whole and in its parts.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::hal::{AxisCommand, AxisSample};
use scarab::motor::{
    Axis, AxisConfiguration, AxisRequest, Calibration, CalibrationSettings, CalibrationStep, Calibrator,
    CountScale, CurrentGains, CurrentLoop, ElectricalAngle, Modulator, MotorConstants, Rotating, SenseScale,
    Sine, SpeedTracker, Stationary,
};
use scarab::units::{Ampere, Henry, Ohm, Volt};

use crate::counter::{Tally, count};
use crate::motor::{CONFIGURATION, Motor};

/// Mechanical speeds: standstill, a joint's greatest behind 50:1, and near the voltage limit.
const SPEEDS: [(f32, f32); 4] = [(0.0, 10.0), (225.0, 30.0), (-225.0, 30.0), (820.0, 40.0)];

#[inline(never)]
fn tick(axis: &mut Axis, sample: &AxisSample, request: AxisRequest) -> AxisCommand {
    axis.tick(sample, request)
}

fn calibrated(motor: &mut Motor, configuration: &AxisConfiguration) -> Option<Calibration> {
    let settings = CalibrationSettings { current: Ampere(20.0), voltage: Volt(4.0), turns_per_s: 16.0 };
    let mut calibrator = Calibrator::new(configuration, settings).ok()?;
    let mut sample = motor.sample(false);
    let mut tally = Tally::default();
    loop {
        let (instructions, step) = count(|| calibrator.tick(&sample));
        tally.push(instructions);
        match step {
            CalibrationStep::Running(command) => sample = motor.period(command),
            CalibrationStep::Done(found) => {
                hprintln!("calibration, a tick          {:>6} {:>6}", tally.mean(), tally.most());
                return Some(found);
            }
            CalibrationStep::Refused(reason) => {
                hprintln!("calibration refused: {:?}", reason);
                return None;
            }
        }
    }
}

/// Prints the table; the largest number of instructions of any tick.
pub fn report() -> u32 {
    crate::counter::start();
    hprintln!("instructions                   mean  worst");
    let worst = [Sine::Fast, Sine::Exact].map(|sine| {
        let configuration = AxisConfiguration { sine, ..CONFIGURATION };
        let mut motor = Motor::at_rest();
        let Some(calibration) = calibrated(&mut motor, &configuration) else { return u32::MAX };
        let name = if sine == Sine::Fast { "fast" } else { "exact" };
        whole(&mut motor, &configuration, &calibration, name)
    });
    parts();
    worst[0]
}

fn whole(motor: &mut Motor, configuration: &AxisConfiguration, calibration: &Calibration, sine: &str) -> u32 {
    let mut all = Tally::default();
    motor.driven = true;
    for (speed, current) in SPEEDS {
        motor.speed_rad_per_s = speed;
        let mut sample = motor.sample(false);
        let Ok(mut axis) = Axis::new(configuration, calibration, &sample) else { return u32::MAX };
        for _ in 0..240 {
            sample = motor.period(tick(&mut axis, &sample, AxisRequest::RELEASED));
        }
        let mut tally = Tally::default();
        // An electrical turn at the slowest moving speed is 96 ticks.
        for step in 0..1200 {
            let current = if step % 400 < 200 { current } else { -current };
            let request = AxisRequest { enabled: true, current: Ampere(current) };
            let (instructions, command) = count(|| tick(&mut axis, black_box(&sample), black_box(request)));
            tally.push(instructions);
            all.push(instructions);
            sample = motor.period(command);
            if step % 6 == 5 {
                let _ = axis.joint_sample();
            }
        }
        if axis.fault().is_some() {
            hprintln!("fault: {:?}", axis.fault());
            return u32::MAX;
        }
        hprintln!(
            "tick, {:<5} sine, {:>5} rad/s  {:>6} {:>6}",
            sine,
            speed as i32,
            tally.mean(),
            tally.most()
        );
    }
    hprintln!("tick, {:<5} sine, all         {:>6} {:>6}", sine, all.mean(), all.most());
    all.most()
}

/// Each part over angles and currents of one electrical turn.
fn parts() {
    let sense = black_box(SenseScale::ODRIVE_3_6);
    let Some(scale) = CountScale::new(8192, 7) else { return };
    let Some(modulator) = Modulator::new(CONFIGURATION.timing, CONFIGURATION.dead_time) else { return };
    let constants = MotorConstants {
        resistance: Ohm(0.05),
        direct_inductance: Henry(25e-6),
        quadrature_inductance: Henry(25e-6),
        flux: CONFIGURATION.flux,
    };
    let Some(gains) = CurrentGains::new(&constants, CONFIGURATION.bandwidth, true) else { return };
    let mut current_loop = CurrentLoop::default();
    let mut tracker = SpeedTracker::at(ElectricalAngle::ZERO);
    let mut tallies: [(&str, Tally); 9] = [
        ("count to angle", Tally::default()),
        ("speed tracking", Tally::default()),
        ("sine and cosine, fast", Tally::default()),
        ("sine and cosine, exact", Tally::default()),
        ("codes to current vector", Tally::default()),
        ("Park", Tally::default()),
        ("current loop", Tally::default()),
        ("current loop at its limit", Tally::default()),
        ("space vectors, dead time", Tally::default()),
    ];
    for place in (0..1170).step_by(13) {
        let mut row = 0;
        let mut push = |instructions| {
            tallies[row].1.push(instructions);
            row += 1;
        };
        let (instructions, angle) = count(|| scale.angle(black_box(place)).plus(ElectricalAngle::ZERO));
        push(instructions);
        push(count(|| tracker.track(black_box(angle))).0);
        let (instructions, rotor) = count(|| black_box(angle).rotation(Sine::Fast));
        push(instructions);
        push(count(|| black_box(angle).rotation(Sine::Exact)).0);
        let currents = Rotating { d: Ampere(0.5), q: Ampere(20.0) }.to_stationary(rotor);
        let phases = currents.to_phases();
        let codes = [phases.b, phases.c].map(|current| (2048.0 + current.0 / 0.0403) as u16);
        let (instructions, vector) = count(|| sense.currents(black_box(codes), black_box([2048.0; 2])));
        push(instructions);
        let vector = vector.unwrap_or_default();
        let (instructions, measured) = count(|| black_box(vector).to_rotating(black_box(rotor)));
        push(instructions);
        let (instructions, voltage) = count(|| {
            let target = black_box(Ampere(20.0));
            current_loop.voltage(
                &gains,
                target,
                black_box(measured),
                black_box(1500.0),
                black_box(Volt(25.0)),
            )
        });
        push(instructions);
        let (instructions, _) = count(|| {
            let target = black_box(Ampere(40.0));
            current_loop.voltage(&gains, target, black_box(measured), black_box(1500.0), black_box(Volt(3.0)))
        });
        push(instructions);
        let voltage: Stationary<Volt> = voltage.to_stationary(rotor);
        let (instructions, _) =
            count(|| modulator.duties(black_box(voltage), black_box(1.0 / 48.0), black_box(currents)));
        push(instructions);
    }
    for (name, tally) in &tallies {
        hprintln!("  {:<27} {:>6} {:>6}", name, tally.mean(), tally.most());
    }
}
