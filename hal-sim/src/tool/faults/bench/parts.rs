//! V3: a brake chopper that makes no sense is refused, and what is no voltage makes no duty.
//!
//! Of voltages there is nothing to be seen: that their duties are within bounds is held in every run, and counts for none.

use scarab::motor::{Chopper, GREATEST_BRAKE_DUTY};
use scarab::units::Volt;

use super::super::dice::Dice;
use super::super::entry::Head;
use super::super::run::Outcome;
use super::{Bench, outcome};
use crate::tool::board::BRAKE;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "V3",
        fault: "brake chopper set to nonsense, or shown a voltage that is none",
        detector: "check when it is made; bounds of the duty",
        state: "Refuse",
        deadline_ms: f64::INFINITY,
        unit: "",
        codes: &[],
        lacking: Some("a resistor that is absent: the bus rises until the axes release (V1)"),
    },
    run: chop,
};

fn chop(head: &Head, _: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    Ok(seeds.iter().map(|seed| one(head, *seed, blind)).collect())
}

/// Voltages that are shown to the sound chopper in each run.
const SHOWN: usize = 16;
/// What no voltage is.
const NONE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

/// Blind, the sound chopper and a sound voltage are shown instead: as if there were no check.
fn one(head: &Head, seed: u64, blind: bool) -> Outcome {
    let mut dice = Dice::new(head.id, seed);
    let mut found = outcome(head, seed, judge(&mut dice, blind).then_some("Refuse"));
    for _ in 0..SHOWN {
        let volts = dice.uniform(-1e3, 1e3) as f32;
        let duty = Chopper::new(BRAKE[0], BRAKE[1]).map(|chopper| chopper.duty(Volt(volts)));
        if !duty.is_some_and(|duty| (0.0..=GREATEST_BRAKE_DUTY).contains(&duty)) {
            found.broken.push(format!("a duty of {duty:?} at {volts} V"));
        }
    }
    found
}

/// Whether nonsense was refused.
fn judge(dice: &mut Dice, blind: bool) -> bool {
    let [begin, full] = BRAKE;
    let none = NONE[dice.below(3) as usize];
    if dice.coin() {
        let absurd = match dice.below(5) {
            // The wrong way round, or no ramp between.
            0 => [full.0, full.0 - dice.uniform(0.0, 50.0) as f32],
            1 => [begin.0, begin.0 + dice.uniform(0.0, 0.49) as f32],
            // Beyond what the divider can tell, and a resistor that is always on.
            2 => [begin.0, dice.uniform(59.7, 1e3) as f32],
            3 => [dice.uniform(-100.0, 4.9) as f32, full.0],
            _ => [none, full.0],
        };
        let shown = if blind { [begin, full] } else { absurd.map(Volt) };
        return Chopper::new(shown[0], shown[1]).is_none();
    }
    // What is no voltage gives no duty, and is for the axes to refuse.
    let shown = if blind { full } else { Volt(none) };
    Chopper::new(begin, full).is_some_and(|chopper| chopper.duty(shown) == 0.0)
}
