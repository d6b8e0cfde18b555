//! Judged cases as a table by kind, as lines of misses and as JSON.

use std::ops::RangeInclusive;

use scarab_base::table::Table;
use serde::Serialize;

use crate::battery::judge::{Judged, Named};

/// Shares of errors within one and three sigma for honest sigmas, and the least number that shows them.
const COVERAGE: [RangeInclusive<f64>; 2] = [0.6..=0.8, 0.98..=1.0];
const LEAST_ERRORS: usize = 100;

/// Title, and which cases count.
type Column = (&'static str, fn(&Judged) -> bool);

/// Columns of the table, and the cases that they count.
const COLUMNS: [Column; 12] = [
    ("cases", |_| true),
    ("accepted", |case| case.verdict == "accepted"),
    ("with misfit", |case| case.verdict == "accepted with misfit"),
    ("refused", |case| case.verdict == "refused"),
    ("bad input", |case| case.verdict == "bad input"),
    ("named right", |case| case.named == Named::Right),
    ("listed", |case| case.named == Named::Listed),
    ("unknown", |case| case.named == Named::Unknown),
    ("named wrong", |case| case.named == Named::Wrong),
    ("wrong acceptances", |case| case.wrong_acceptance),
    ("false refusals", |case| case.false_refusal),
    ("misses", |case| case.miss.is_some()),
];

/// Judged cases.
#[derive(Debug, Serialize)]
pub struct Battery {
    cases: Vec<Judged>,
    /// Coverage of sigma in words.
    coverage: Vec<String>,
    /// Whether a case misses, or the coverage of the logs.
    pub misses: bool,
}

impl Battery {
    pub(super) fn new(cases: Vec<Judged>) -> Self {
        let mut misses = cases.iter().any(|case| case.miss.is_some());
        let mut coverage = Vec::new();
        for group in ["logs", "random"] {
            let errors = cases.iter().filter(|case| case.kind == group).flat_map(|case| &case.errors);
            let errors: Vec<f64> = errors.copied().collect();
            let (count, largest) = (errors.len(), errors.iter().copied().fold(0.0, f64::max));
            if count < LEAST_ERRORS {
                continue;
            }
            let within = |limit| errors.iter().filter(|error| **error < limit).count() as f64 / count as f64;
            let within = [within(1.0), within(3.0)];
            // Random legs do not repeat one experiment, so that no share is due.
            let is_honest = COVERAGE.iter().zip(within).all(|(range, share)| range.contains(&share));
            misses |= group == "logs" && !is_honest;
            let [one, three] = within.map(|share| 100.0 * share);
            coverage.push(format!(
                "{group}: errors within one, three sigma: {one:.1} %, {three:.1} % of {count}; largest {largest:.1}"
            ));
        }
        Self { cases, coverage, misses }
    }

    /// Table by kind, and coverage of sigma.
    pub fn matrix(&self) -> String {
        let mut table = Table::default().label("kind").numbers(COLUMNS.map(|(head, _)| head));
        let mut kinds: Vec<&str> = Vec::new();
        for case in &self.cases {
            if !kinds.contains(&case.kind.as_str()) {
                kinds.push(&case.kind);
            }
        }
        for kind in kinds.into_iter().map(Some).chain([None]) {
            let own = || self.cases.iter().filter(|case| kind.is_none_or(|kind| case.kind == kind));
            let counts = COLUMNS.map(|(_, holds)| own().filter(|case| holds(case)).count().to_string());
            table.row(std::iter::once(kind.unwrap_or("all").to_owned()).chain(counts));
        }
        let coverage: String = self.coverage.iter().map(|line| format!("{line}\n")).collect();
        format!("{}\n{coverage}", table.to_markdown())
    }

    /// Every miss in one line, with what repeats it.
    pub fn failures(&self) -> String {
        let line = |case: &Judged| {
            let Judged { name, verdict, note, .. } = case;
            let miss = case.miss.as_ref()?;
            let is_generated = ["logs/", "random/", "faults/"].iter().any(|group| name.starts_with(group));
            let seed = name.rsplit('/').next().filter(|_| is_generated);
            let seed = seed.map_or(String::new(), |seed| format!(" --seed {seed} --count 1"));
            let cause = case.cause.as_ref().map_or(String::new(), |cause| format!("; cause {cause}"));
            let reasons = case.reasons.join(", ");
            Some(format!("battery --kind {name}{seed}: {miss}; {verdict} {reasons}{cause} ({note})\n"))
        };
        self.cases.iter().filter_map(line).collect()
    }
}
