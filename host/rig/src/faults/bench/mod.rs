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
pub mod offsets;
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

use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;

/// Runs a bench for some seeds. If blind, the fault's detector is disabled as stated by each bench.
pub type Runs = fn(&Fault, &LegFile, &[u64], bool) -> Result<Vec<Outcome>, ToolError>;

/// A row with its own bench.
#[derive(Clone, Copy, Debug)]
pub struct Bench {
    /// The fault.
    pub fault: &'static Fault,
    /// Runs the row for these seeds.
    pub run: Runs,
}

/// All benches.
pub static BENCHES: [Bench; 28] = [
    absolute::SILENT,
    absolute::CONTRADICTION,
    offsets::BENCH,
    calibration::BENCH,
    start::ZEROS,
    hot::CURRENT,
    hot::COOLING,
    hot::THERMISTOR,
    supply::DRAW,
    supply::CHARGE,
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
    random_sessions::BENCH,
    cut::BENCH,
    stored_data::CUT,
    stored_data::CORRUPTION,
    stored_data::ARMED,
];

/// Outcome of a run: `state` if it was made safe, `None` otherwise.
pub(super) fn outcome(fault: &Fault, seed: u64, state: Option<&'static str>) -> Outcome {
    Outcome {
        fault: fault.id,
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
