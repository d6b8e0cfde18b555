//! Rows that are not forks of an identification with complete drives: components alone, motors on a test
//! stand, identifications with ideal drives.
//!
//! A run is judged by its outcome, and repeated by its row and its seed.

mod absolute;
mod calibration;
mod command;
mod cut;
mod disturbed;
mod hosted;
pub mod hostile;
mod hot;
mod lost;
pub(crate) mod offsets;
mod outside;
mod parts;
mod random_sessions;
mod search;
mod silent;
mod stall;
mod start;
mod stopped;
pub mod stored_data;
mod supply;

use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::catalogue::{self, Fault};
use crate::faults::run::Outcome;

/// Outcomes of some seeds.
pub(crate) type Outcomes = Result<Vec<Outcome>, ToolError>;

/// Runs a bench for some seeds. If blind, the fault's detector is disabled as stated by each bench.
pub(crate) type Runs = fn(&Fault, &LegFile, &[u64], bool) -> Outcomes;

/// A row with its own bench.
#[derive(Clone, Copy, Debug)]
pub struct Bench {
    /// The fault.
    pub(crate) fault: &'static Fault,
    /// Runs the row for these seeds.
    pub(crate) run: Runs,
}

/// All benches.
pub(crate) static BENCHES: [Bench; 28] = [
    Bench { fault: &catalogue::E6, run: absolute::silent },
    Bench { fault: &catalogue::E7, run: absolute::contradict },
    Bench { fault: &catalogue::E3, run: offsets::shift },
    Bench { fault: &catalogue::E5, run: calibration::calibrate },
    Bench { fault: &catalogue::C1_AT_ENABLING, run: start::arm },
    Bench { fault: &catalogue::T2, run: hot::current },
    Bench { fault: &catalogue::T3, run: hot::cooling },
    Bench { fault: &catalogue::T4, run: hot::thermistor },
    Bench { fault: &catalogue::V4, run: supply::run },
    Bench { fault: &catalogue::V5, run: supply::run },
    Bench { fault: &catalogue::X1_EARLY, run: stopped::stop },
    Bench { fault: &catalogue::V3, run: parts::chop },
    Bench { fault: &catalogue::J1_COMMANDED, run: command::command },
    Bench { fault: &catalogue::H2, run: disturbed::run },
    Bench { fault: &catalogue::H4, run: disturbed::run },
    Bench { fault: &catalogue::H3, run: disturbed::run },
    Bench { fault: &catalogue::I1, run: search::interrupt },
    Bench { fault: &catalogue::B1, run: lost::silence },
    Bench { fault: &catalogue::B2, run: lost::leave },
    Bench { fault: &catalogue::B5, run: silent::run },
    Bench { fault: &catalogue::J3, run: outside::run },
    Bench { fault: &catalogue::B3, run: hostile::flood },
    Bench { fault: &catalogue::B4, run: hostile::babble },
    random_sessions::BENCH,
    Bench { fault: &catalogue::X3, run: cut::cut },
    Bench { fault: &catalogue::F1, run: stored_data::cuts },
    Bench { fault: &catalogue::F2, run: stored_data::corruptions },
    Bench { fault: &catalogue::F3, run: stored_data::armed },
];

/// Outcome of a run: `state` if it was made safe, `None` otherwise.
pub(super) fn outcome(fault: &Fault, seed: u64, state: Option<&'static str>) -> Outcome {
    Outcome { fault: fault.id, seed, detected: state.is_some(), state, ..Outcome::default() }
}
