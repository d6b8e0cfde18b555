//! What came of a run, and how it is done.

use scarab::safety::FaultCode;
use serde::Serialize;

use super::recording::Recording;

/// What came of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// The row.
    pub fault: &'static str,
    /// The run's; 0 of one with the emergency stop at every tick, which its period names.
    pub seed: u64,
    /// Period of the injection.
    pub period: u64,
    /// It was seen, in time, and made safe.
    pub detected: bool,
    /// There was nothing that could have been seen.
    pub undetectable: bool,
    /// Something was raised although nothing was wrong.
    pub false_alarm: bool,
    /// From the fault to the safe state's first command, ms.
    pub after_ms: Option<f64>,
    /// Deadline of this run where it is longer than the row's, ms: a fault that comes and goes.
    pub intermittent_ms: Option<f64>,
    /// `Off`, `Damp`, `Limit`; nothing where the motion simply went on.
    pub state: Option<&'static str>,
    /// What the firmware says is wrong.
    pub alarm: Option<&'static str>,
    /// How large the fault was, in the row's unit.
    pub magnitude: Option<f64>,
    /// Invariants that did not hold.
    pub broken: Vec<String>,
    /// Of everything that crossed the ports.
    pub hash: String,
    /// Its curves, where they were asked for.
    #[serde(skip)]
    pub recording: Option<Recording>,
}

/// Whose detectors are switched off in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blind {
    /// Nobody's.
    #[default]
    Nobody,
    /// Those of its row, all.
    Row,
    /// Those that tell this code.
    Code(FaultCode),
}

/// How a run is done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Manner {
    /// Which detectors are switched off.
    pub blind: Blind,
    /// Its curves are kept.
    pub recorded: bool,
    /// A machine that is safe is watched for a tenth of the usual time only: 2 ms.
    pub brief: bool,
}

impl Manner {
    /// Detectors are switched off.
    #[must_use]
    pub fn is_blind(&self) -> bool {
        self.blind != Blind::Nobody
    }
}
