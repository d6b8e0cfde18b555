//! Rows that are not forks of an identification with complete drives: parts alone, motors on their stand, identifications of ideal
//! drives.
//!
//! A run is judged by what became of it, and repeated by its row and its seed like any other.

mod calibration;
mod command;
mod cut;
mod disturbed;
mod hosted;
mod hostile;
mod kept;
mod lost;
pub mod offsets;
mod outside;
mod parts;
mod search;
mod silent;
mod stall;
mod start;
mod stopped;

use scarab::safety::FaultCode;

use super::entry::Head;
use super::run::Outcome;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;

/// What a bench makes of its row for some seeds; blind, what sees the fault is switched off, as each bench says.
pub type Runs = fn(&Head, &LegFile, &[u64], bool) -> Result<Vec<Outcome>, ToolError>;

/// A row with a bench of its own.
#[derive(Clone, Copy, Debug)]
pub struct Bench {
    /// What is told of it.
    pub head: Head,
    /// Runs it for these seeds.
    pub run: Runs,
}

/// All of them.
pub static BENCHES: [Bench; 20] = [
    offsets::BENCH,
    calibration::BENCH,
    start::ZEROS,
    stopped::BENCH,
    parts::BENCH,
    command::BENCH,
    disturbed::WEARER,
    disturbed::CONTACT,
    disturbed::OTHER_LEG,
    search::BENCH,
    lost::HOST_LOST,
    lost::BUS_LOST,
    silent::BENCH,
    outside::BENCH,
    hostile::FRAMES_BENCH,
    hostile::BABBLE,
    cut::BENCH,
    kept::CUT,
    kept::ROT,
    kept::ARMED,
];

/// What came of a run: `state` where it was made safe, and nothing where it was not.
pub(super) fn outcome(head: &Head, seed: u64, state: Option<&'static str>) -> Outcome {
    Outcome {
        fault: head.id,
        seed,
        period: 0,
        detected: state.is_some(),
        undetectable: false,
        false_alarm: false,
        after_ms: None,
        intermittent_ms: None,
        state,
        alarm: None::<FaultCode>.map(FaultCode::name),
        magnitude: None,
        broken: Vec::new(),
        hash: String::new(),
        recording: None,
    }
}
