//! V3: an implausible brake chopper is refused, and an invalid voltage gives no duty.
//!
//! Detection is counted for choppers only. For voltages every run checks that the duty stays within its
//! bounds.

use scarab::hal::GREATEST_BRAKE_DUTY;
use scarab::motor::Chopper;
use scarab::units::Volt;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::board::BRAKE;
use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;

pub(super) fn chop(fault: &Fault, _: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    Ok(seeds.iter().map(|seed| one(fault, *seed, blind)).collect())
}

/// Voltages given to the valid chopper in each run.
const SHOWN: usize = 16;
/// Invalid voltages.
const NONE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

/// Blind: valid settings and a valid voltage are used instead, as if there were no check.
fn one(fault: &Fault, seed: u64, blind: bool) -> Outcome {
    let mut random = Random::new(fault.id, seed);
    let mut found = outcome(fault, seed, judge(&mut random, blind).then_some("Refuse"));
    for _ in 0..SHOWN {
        let volts = random.uniform(-1e3, 1e3) as f32;
        let duty = Chopper::new(BRAKE[0], BRAKE[1]).map(|chopper| chopper.duty(Volt(volts)));
        if !duty.is_some_and(|duty| (0.0..=GREATEST_BRAKE_DUTY).contains(&duty)) {
            found.broken.push(format!("a duty of {duty:?} at {volts} V"));
        }
    }
    found
}

/// Returns whether implausible settings were refused.
fn judge(random: &mut Random, blind: bool) -> bool {
    let [begin, full] = BRAKE;
    let none = NONE[random.below(3) as usize];
    if random.coin() {
        let implausible = match random.below(5) {
            // Ends in the wrong order, or too close together.
            0 => [full.0, full.0 - random.uniform(0.0, 50.0) as f32],
            1 => [begin.0, begin.0 + random.uniform(0.0, 0.49) as f32],
            // Beyond the range of the divider, and a resistor that is always on.
            2 => [begin.0, random.uniform(59.7, 1e3) as f32],
            3 => [random.uniform(-100.0, 4.9) as f32, full.0],
            _ => [none, full.0],
        };
        let shown = if blind { [begin, full] } else { implausible.map(Volt) };
        return Chopper::new(shown[0], shown[1]).is_none();
    }
    // An invalid voltage gives no duty; the axes refuse it.
    let shown = if blind { full } else { Volt(none) };
    Chopper::new(begin, full).is_some_and(|chopper| chopper.duty(shown) == 0.0)
}
