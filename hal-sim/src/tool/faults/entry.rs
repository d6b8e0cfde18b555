//! A row of the table, whichever way it is run.

use scarab::safety::FaultCode;

use super::bench::{BENCHES, Bench};
use super::catalogue::{Row, rows};
use super::emulated::HEADS;

/// What is told of a row.
#[derive(Clone, Copy, Debug)]
pub struct Head {
    /// The catalogue's id.
    pub id: &'static str,
    /// What goes wrong.
    pub fault: &'static str,
    /// What sees it.
    pub detector: &'static str,
    /// Where it leads: the catalogue's last column.
    pub state: &'static str,
    /// From the fault to the safe state's first command, ms; infinite where it is no time.
    pub deadline_ms: f64,
    /// Unit of the magnitude.
    pub unit: &'static str,
    /// What the firmware says then; none of a bench.
    pub codes: &'static [FaultCode],
    /// What is not seen yet.
    pub lacking: Option<&'static str>,
}

/// One way to run a row.
#[derive(Clone, Copy, Debug)]
pub enum Entry {
    /// Forks of an identification with complete drives.
    Forked(&'static Row),
    /// A bench of its own.
    Bench(&'static Bench),
    /// The emulated processor.
    Emulated(&'static Head),
}

/// The catalogue's order; what is not here comes last.
const ORDER: [&str; 41] = [
    "E1", "E2", "E3", "E4", "E5", "C1", "C2", "C3", "C4", "P1", "P2", "V1", "V2", "V3", "T1", "N1", "B1",
    "B2", "B3", "B4", "B5", "X1", "X2", "X3", "K1", "K2", "K3", "K4", "M1", "M2", "F1", "F2", "F3", "J1",
    "J2", "J3", "H1", "H2", "H4", "H3", "I1",
];

impl Entry {
    /// What is told of it.
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
            Self::Emulated(head) => **head,
        }
    }
}

impl Entry {
    /// Whether what sees it is switched off in a campaign that is blind: the codes of a fork, the caps of H1, what each bench says. The
    /// range of J1 is widened on its bench, and not in its forks.
    #[must_use]
    pub fn can_be_blind(&self) -> bool {
        match self {
            Self::Forked(row) => row.id != "J1",
            Self::Bench(_) => true,
            Self::Emulated(_) => false,
        }
    }
}

/// Where the firmware leads a row beside the state of the catalogue, or instead of it: what the catalogue wants takes something that
/// the fault itself took away.
#[must_use]
pub fn instead(id: &str) -> Option<&'static str> {
    match id {
        // A host that others' frames keep from being heard is lost.
        "B4" => Some("Damp"),
        // A motor that is too fast to be shorted is released.
        "E1" => Some("Off"),
        // A push or a foot that cannot be set aside has the result refused; a foot that can be is set aside.
        "H2" => Some("refused"),
        "H4" => Some("Limit, refused"),
        // A kick that holds the other joint while its torque grows looks like a counter that stands still.
        "J2" => Some("Short, Off"),
        // Damping needs the rotor's angle; the rest as E1.
        "E4" => Some("Short, Off"),
        // While a joint hardly moves, a current that is wrong or does not flow looks like a counter that stands still: the motors are
        // shorted, with the bound of speed that any short has.
        "C1" | "C3" | "P1" => Some("Short"),
        // A servo that does not answer cannot damp.
        "K1" => Some("Off"),
        // An axis whose gains are not what they were cannot damp.
        "M2" => Some("Off"),
        _ => None,
    }
}

/// All rows, in the catalogue's order.
#[must_use]
pub fn entries() -> Vec<Entry> {
    let mut all: Vec<Entry> = rows().map(Entry::Forked).chain(BENCHES.iter().map(Entry::Bench)).collect();
    all.extend(HEADS.iter().map(Entry::Emulated));
    let place = |entry: &Entry| ORDER.iter().position(|id| *id == entry.head().id).unwrap_or(ORDER.len());
    all.sort_by_key(place);
    all
}
