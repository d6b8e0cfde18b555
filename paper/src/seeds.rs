//! Seeds of the report, separate from those used for tuning.
//!
//! Why a type: results on the seeds with which constants were tuned are biased. A [`ReportSeed`]
//! cannot be made from an arbitrary number. [`CHOOSING`] covers the seeds used while the swarm was
//! designed. These are the tests' first seeds (90,001 in `tests/firmware/swarm_tables.rs`), the examples'
//! (1), and those of the experiments behind the constants (31, 55, 31337, 31338). [`LEAPS`] covers
//! those behind the leaps' constants.

use std::ops::Range;

/// Seeds for experiments, choices and tests.
pub const CHOOSING: Range<u64> = 0..1_000_000;
/// Seeds with which the constants of the leaps were chosen.
pub const LEAPS: Range<u64> = 40_000_001..40_000_101;
/// Seeds of published tables and figures, one for each run.
pub const REPORT: Range<u64> = 6_020_000_000..6_021_000_000;

const _: () = assert!(CHOOSING.end <= REPORT.start && LEAPS.end <= REPORT.start);

/// Seed of one run of a published table or figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReportSeed(u64);

impl ReportSeed {
    /// Seed of run number `run`; runs beyond the range get its last seed.
    pub fn from_run(run: u64) -> Self {
        Self(REPORT.start.saturating_add(run).min(REPORT.end - 1))
    }

    /// Seed of the search.
    pub fn search(self) -> u64 {
        self.0
    }

    /// Seed of the problem: another random sequence than the search's own.
    pub fn problem(self) -> u64 {
        self.0 ^ 0x5eed_0000_0000_0000
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn report_seeds_differ_from_all_tuning_seeds() {
        for run in [0, 1, 99_999, u64::MAX] {
            let seed = ReportSeed::from_run(run);
            assert!(REPORT.contains(&seed.search()) && !CHOOSING.contains(&seed.search()), "{seed:?}");
            assert!(!CHOOSING.contains(&seed.problem()) && !REPORT.contains(&seed.problem()), "{seed:?}");
        }
        // seeds known from tests and experiments
        for used in [1, 31, 55, 31_337, 31_338, 90_001] {
            assert!(CHOOSING.contains(&used));
        }
    }
}
