//! Rows of the fault table, independent of the way they are run.

use crate::faults::bench::{BENCHES, Bench};
use crate::faults::catalogue::rows;
use crate::faults::scenario::{Head, Row};

/// One way to run a row.
#[derive(Clone, Copy, Debug)]
pub enum Entry {
    /// Forks of an identification with complete drives.
    Forked(&'static Row),
    /// A separate test bench.
    Bench(&'static Bench),
}

/// Rows that need the processor: the flash image on the model of its microcontroller runs them
/// (`cargo chip faults`), and `cargo chip crashes` with all that a crash must do.
pub const ON_THE_CHIP: [(&str, &str); 3] = [
    ("K2", "search and log beside control"),
    ("K4", "panic, hard fault, unhandled interrupt"),
    ("M1", "stack overflow"),
];

/// Order of the catalogue; other ids come last.
const ORDER: [&str; 44] = [
    "E1", "E2", "E3", "E4", "E5", "C1", "C2", "C3", "C4", "P1", "P2", "V1", "V2", "V3", "V4", "V5", "T1",
    "T2", "T3", "T4", "N1", "B1", "B2", "B3", "B4", "B5", "B7", "X1", "X2", "X3", "K1", "K3", "M2", "F1",
    "F2", "F3", "J1", "J2", "J3", "H1", "H2", "H4", "H3", "I1",
];

impl Entry {
    /// Description of the row.
    #[must_use]
    pub fn head(&self) -> Head {
        match self {
            Self::Forked(row) => Head {
                id: row.id,
                fault: row.fault,
                detector: row.detector,
                state: row.state,
                deadline_ms: row.deadline_ms,
                unit: row.unit,
                codes: row.codes,
                lacking: row.lacking,
            },
            Self::Bench(bench) => bench.head,
        }
    }
}

impl Entry {
    /// Returns whether the row's detector is disabled in a blind campaign: the codes of a fork, the caps of
    /// H1, the switch of each bench. The range of J1 is widened on its bench only, not in its forks. B7 has
    /// no single detector.
    #[must_use]
    pub fn can_be_blind(&self) -> bool {
        match self {
            Self::Forked(row) => row.id != "J1",
            Self::Bench(bench) => bench.head.id != "B7",
        }
    }
}

/// Safe state that the firmware uses besides or instead of the catalogue's, where the fault removes a
/// precondition of the catalogue's state.
#[must_use]
pub fn instead(id: &str) -> Option<&'static str> {
    match id {
        // A host whose frames are blocked by others counts as lost.
        "B4" => Some("Damp"),
        // A motor too fast for a short circuit is turned off.
        "E1" => Some("Off"),
        // Push and foot contact: the result is refused if the disturbed rows cannot be excluded.
        "H2" => Some("refused"),
        "H4" => Some("Limit, refused"),
        // A kick may also drive current or bus voltage beyond their bounds.
        "J2" => Some("Off"),
        // Damping requires the rotor angle; otherwise as E1.
        "E4" => Some("Short, Off"),
        // While a joint hardly moves, a wrong or missing current looks like a frozen counter. The motors are
        // then shorted, with the speed bound of every short circuit.
        "C1" | "C3" | "P1" => Some("Short"),
        // Without an answering servo, damping is impossible.
        "K1" => Some("Off"),
        // An axis with changed gains cannot damp.
        "M2" => Some("Off"),
        _ => None,
    }
}

/// All rows, in the catalogue's order.
#[must_use]
pub fn entries() -> Vec<Entry> {
    let mut all: Vec<Entry> = rows().map(Entry::Forked).chain(BENCHES.iter().map(Entry::Bench)).collect();
    let place = |entry: &Entry| ORDER.iter().position(|id| *id == entry.head().id).unwrap_or(ORDER.len());
    all.sort_by_key(place);
    all
}
