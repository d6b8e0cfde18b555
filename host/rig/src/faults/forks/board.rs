//! Gate drivers' registers and bridge temperatures, checked by the housekeeping.

use hal_sim::faults::{Channel, Form, Timing};
use scarab::board::odrive_v3_6::settings::analog::{HOTTEST_C, temperature_c};
use scarab_base::random::Random;

use crate::faults::draw::{at, one};
use crate::faults::scenario::{Bounds, Expected, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// P2: changed registers.
pub(super) fn registers(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    one(at(Channel::GateRegisters, joint, Form::Off, Timing::from(0)), Expected::Off)
}

/// T1: an open or shorted wire, or a bridge temperature.
pub(super) fn temperature(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let code = match random.below(3) {
        0 => [0.0, 4095.0][random.below(2) as usize],
        _ => random.uniform(2500.0, 3700.0).round(),
    };
    let degrees = temperature_c(code as u16);
    let spoilt = at(Channel::Thermistor, joint, Form::Rail(code), Timing::from(0));
    Scenario {
        magnitude: degrees.map(f64::from),
        by_design: degrees.is_some_and(|degrees| degrees < HOTTEST_C),
        // Twice the time between two checks.
        patience: PERIODS_PER_S / 8,
        ..one(spoilt, Expected::Damp)
    }
}
