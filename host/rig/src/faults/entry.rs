//! Rows of the fault table, independent of the way they are run.

use crate::faults::bench::{BENCHES, Bench};
use crate::faults::catalogue::{Fault, index_of};
use crate::faults::forks::ROWS;
use crate::faults::scenario::Row;

/// One way to run a row.
#[derive(Clone, Copy, Debug)]
pub enum Entry {
    /// Forks of an identification with complete drives.
    Forked(&'static Row),
    /// A separate test bench.
    Bench(&'static Bench),
}

impl Entry {
    /// The row's fault.
    pub const fn fault(&self) -> &'static Fault {
        match self {
            Self::Forked(row) => row.fault,
            Self::Bench(bench) => bench.fault,
        }
    }

    /// Returns whether the row's detector is disabled in a blind campaign: the codes of a fork, the caps of
    /// H1, the switch of each bench. The range of J1 is widened on its bench only, not in its forks. B7 has
    /// no single detector.
    pub fn can_be_blind(&self) -> bool {
        match self {
            Self::Forked(row) => row.fault.id != "J1",
            Self::Bench(bench) => bench.fault.id != "B7",
        }
    }
}

/// All rows, in the catalogue's order.
pub fn entries() -> Vec<Entry> {
    let mut all: Vec<Entry> =
        ROWS.iter().map(Entry::Forked).chain(BENCHES.iter().map(Entry::Bench)).collect();
    all.sort_by_key(|entry| index_of(entry.fault().id));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::catalogue::{ALL, ON_THE_CHIP};

    #[test]
    fn each_fault_runs_in_the_campaign_or_on_the_chip() {
        let entries = entries();
        for &fault in ALL {
            let forked = entries.iter().filter(|entry| core::ptr::eq(entry.fault(), fault)).count();
            let on_the_chip = ON_THE_CHIP.iter().filter(|other| core::ptr::eq(**other, fault)).count();
            assert_eq!(forked + on_the_chip, 1, "{}", fault.id);
        }
    }
}
