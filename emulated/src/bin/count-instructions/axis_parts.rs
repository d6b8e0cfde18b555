//! Costs of the parts of one axis' tick: each part called by itself, over the angles of an electrical turn.
//!
//! A part called by itself passes its arguments and its result through memory, which the tick avoids. So the
//! parts appear somewhat more expensive than they are, and the remainder somewhat cheaper.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::motor::{
    CountScale, CurrentGains, CurrentLoop, ElectricalAngle, Modulator, MotorConstants, Rotating, SenseScale,
    SpeedTracker, Stationary,
};
use scarab::units::{Ampere, Henry, Ohm, Volt};

use crate::counter::{Tally, count, heading};
use crate::motor::CONFIGURATION;

/// Parts of a tick, and their number in a tick.
const PARTS: [(&str, u32); 11] = [
    ("encoder step to place and angle", 1),
    ("speed tracking", 1),
    ("two shunt codes to current vector", 1),
    ("sine and cosine", 1),
    ("rotation ahead", 1),
    ("Park", 1),
    ("PI in d and q, feedforward, anti-windup", 1),
    ("Park back; voltage and target", 2),
    ("space vectors, zero vector, dead time", 1),
    ("  not in the sum: the same, dead time not given back", 0),
    ("  not in the sum: PI at the voltage limit", 0),
];

/// Prints the parts, and the remainder of the whole.
pub fn report(whole: &Tally) {
    let Some(tallies) = parts() else { return };
    heading("what costs what");
    let mut sum = 0;
    for ((name, times), tally) in PARTS.iter().zip(&tallies) {
        tally.print(name);
        sum += times * tally.mean();
    }
    let rest = whole.mean().saturating_sub(sum);
    hprintln!("{:<48} {:>8}", "the rest: borders, stuck codes, window, states", rest);
}

fn parts() -> Option<[Tally; PARTS.len()]> {
    let sense = black_box(SenseScale::ODRIVE_3_6);
    let scale = CountScale::new(CONFIGURATION.counts_per_turn, CONFIGURATION.pole_pairs)?;
    let compensating = Modulator::new(CONFIGURATION.timing, CONFIGURATION.dead_time)?;
    let plain = Modulator::new(CONFIGURATION.timing, scarab::motor::DeadTime::Uncompensated)?;
    let constants = MotorConstants {
        resistance: Ohm(0.05),
        direct_inductance: Henry(25e-6),
        quadrature_inductance: Henry(25e-6),
        flux: CONFIGURATION.flux,
    };
    let gains = CurrentGains::new(&constants, CONFIGURATION.bandwidth, true)?;
    let mut current_loop = CurrentLoop::default();
    let mut tracker = SpeedTracker::at(ElectricalAngle::ZERO);
    let mut tallies = [Tally::default(); PARTS.len()];
    for place in (0..1170).step_by(13) {
        let mut row = tallies.iter_mut();
        let mut push = |instructions| {
            if let Some(tally) = row.next() {
                tally.push(instructions);
            }
        };
        let (instructions, angle) = count(|| scale.angle(scale.moved(black_box(place), black_box(13))));
        push(instructions);
        push(count(|| black_box(&mut tracker).track(black_box(angle))).0);
        let rotor = angle.rotation();
        let currents = Rotating { d: Ampere(0.5), q: Ampere(20.0) }.to_stationary(rotor);
        let phases = currents.to_phases();
        let codes = [phases.b, phases.c].map(|current| (2048.0 + current.0 / 0.0403) as u16);
        let (instructions, vector) = count(|| sense.currents(black_box(codes), black_box([2048.0; 2])));
        push(instructions);
        let vector = vector.unwrap_or_default();
        push(count(|| black_box(angle).rotation()).0);
        push(count(|| black_box(&tracker).ahead(black_box(rotor), black_box(1.5))).0);
        let (instructions, measured) = count(|| black_box(vector).to_rotating(black_box(rotor)));
        push(instructions);
        let mut voltage = |target: f32, limit: f32| {
            let (target, limit) = (black_box(Ampere(target)), black_box(Volt(limit)));
            let measured = black_box(measured);
            count(|| current_loop.voltage(&gains, target, measured, black_box(1500.0), limit))
        };
        let (instructions, wanted) = voltage(20.0, 25.0);
        push(instructions);
        let (instructions, given): (u32, Stationary<Volt>) =
            count(|| black_box(wanted).to_stationary(black_box(rotor)));
        push(instructions);
        for modulator in [&compensating, &plain] {
            push(count(|| modulator.duties(black_box(given), black_box(1.0 / 48.0), black_box(currents))).0);
        }
        push(voltage(40.0, 3.0).0);
    }
    Some(tallies)
}
