//! The trace of an identification that has not ended yet.

use scarab::trace::{Record, Report};

use super::*;

/// All lines of the report on this leg's identification, as written.
fn told(pair: &Pair) -> Vec<String> {
    let mut report = Report::default();
    let mut lines = Vec::new();
    while let Some(record) = report.advance(pair.leg.identification()) {
        let mut line = String::new();
        Record::<JOINTS>::write(&record, lines.len() as u32, &mut line).expect("a string takes every line");
        lines.push(line);
    }
    lines
}

#[test]
fn no_report_before_there_is_a_result() {
    assert_eq!(told(&during_excitation()), [""; 0]);
    // Before the end of the search there are values but no verdict.
    let lines = told(&before_the_search());
    assert!(lines.iter().any(|line| line.starts_with("solver ") && line.contains(" state=running ")));
    assert!(!lines.iter().any(|line| line.starts_with("verdict ")));
}
