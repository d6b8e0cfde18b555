//! Outcome of a run, and the options of a run.

use scarab::safety::FaultCode;
use scarab_base::words::{Word, optional_word, word};
use serde::{Deserialize, Serialize};

use crate::faults::recording::FaultCurves;

/// Outcome of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Id of the row.
    #[serde(deserialize_with = "word")]
    pub fault: Word,
    /// Seed of the run; 0 for one with the emergency stop at every tick, which its period identifies.
    pub seed: u64,
    /// Period of the injection.
    pub(crate) period: u64,
    /// The fault was detected in time, and the machine is safe.
    pub(crate) detected: bool,
    /// Nothing detectable happened.
    pub(crate) undetectable: bool,
    /// A fault was reported although nothing was wrong.
    pub(crate) false_alarm: bool,
    /// Time from the fault to the safe state's first command, ms.
    pub(crate) after_ms: Option<f64>,
    /// Deadline of this run where it is longer than the row's, ms: an intermittent fault.
    pub(crate) intermittent_ms: Option<f64>,
    /// `Off`, `Damp`, `Limit`; `None` where the motion continued.
    #[serde(deserialize_with = "optional_word")]
    pub(crate) state: Option<Word>,
    /// Fault reported by the firmware.
    #[serde(deserialize_with = "optional_word")]
    pub(crate) alarm: Option<Word>,
    /// Size of the fault in the row's unit.
    pub(crate) magnitude: Option<f64>,
    /// Broken invariants.
    pub(crate) broken: Vec<String>,
    /// Hash of everything that crossed the ports.
    pub(crate) hash: String,
    /// Curves of the run, where requested.
    #[serde(skip)]
    pub recording: Option<FaultCurves>,
}

/// Disabled detectors of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blind {
    /// No detector is disabled.
    #[default]
    None,
    /// All detectors of the row.
    Row,
    /// Detectors of this code.
    Code(FaultCode),
}

/// Options of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Manner {
    /// Disabled detectors.
    pub blind: Blind,
    /// Curves are recorded.
    pub recorded: bool,
    /// A safe machine is observed for a tenth of the usual time only, 2 ms.
    pub brief: bool,
}

impl Manner {
    /// Returns whether detectors are disabled.
    pub(crate) fn is_blind(&self) -> bool {
        self.blind != Blind::None
    }
}
