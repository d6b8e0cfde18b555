//! Test of each detector: a fault's runs with one code of the firmware disabled, compared with all codes
//! enabled.
//!
//! Why in addition to the rows: a fault with several detectors is still detected when one of them breaks.
//! Here each code must be the reporting one in some run. The result of these runs without that code is
//! listed.

use scarab::safety::FaultCode;
use serde::Serialize;

use crate::faults::entry::Entry;
use crate::faults::results::Campaign;
use crate::faults::run::{Blind, Outcome};
use crate::faults::scenario::Row;

/// One fault code of the firmware. Field names are part of the JSON interface.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DetectorReport {
    /// Word used in records.
    pub code: &'static str,
    /// Rows in whose runs the code was reported.
    pub(crate) faults: Vec<&'static str>,
    /// Runs in which the code was reported in time.
    pub(crate) seen: usize,
    /// Runs of these that are missed without the code.
    pub(crate) missed_without: usize,
    /// Runs of these in which another code reports in time without it.
    pub(crate) seen_by_others: usize,
    /// Runs of these that cannot be judged without it: the fault did not last, or the joint no longer moved.
    pub(crate) unjudged_without: usize,
}

fn forked(rows: &[Entry]) -> impl Iterator<Item = &'static Row> {
    rows.iter().filter_map(|entry| match entry {
        Entry::Forked(row) if row.fault.id != crate::faults::campaign::CAPPED => Some(*row),
        _ => None,
    })
}

/// Codes whose own row of the catalogue is among the forked ones.
fn codes(rows: &[Entry]) -> impl Iterator<Item = FaultCode> {
    let has = |code: &FaultCode| {
        forked(rows).any(|row| row.fault.id == code.catalogue() && row.fault.codes.contains(code))
    };
    FaultCode::ALL.into_iter().filter(has)
}

/// Additional views of a row's runs: with all detectors enabled, and with each of several codes disabled
/// alone. The main run disables all of the row's detectors; for a row with one code that is the same.
pub(super) fn views(row: &'static Row, rows: &[Entry]) -> Vec<Blind> {
    if row.fault.id == crate::faults::campaign::CAPPED {
        return Vec::new();
    }
    let alone = row.fault.codes.len() == 1;
    let codes = codes(rows).filter(|code| !alone && row.fault.codes.contains(code)).map(Blind::Code);
    [Blind::None].into_iter().chain(codes).collect()
}

/// Detector reports of a blind campaign; empty for another.
pub(crate) fn detectors(rows: &[Entry], campaign: &Campaign) -> Vec<DetectorReport> {
    if campaign.singly.is_empty() {
        return Vec::new();
    }
    codes(rows).map(|code| detector(code, rows, campaign)).collect()
}

fn detector(code: FaultCode, rows: &[Entry], campaign: &Campaign) -> DetectorReport {
    let mut report = DetectorReport { code: code.name(), ..DetectorReport::default() };
    for row in forked(rows).filter(|row| row.fault.codes.contains(&code)) {
        let of = |blind: Blind| {
            let singly = campaign.singly.iter().filter(move |(how, _)| *how == blind);
            singly.map(|(_, outcome)| outcome).filter(|outcome| outcome.fault == row.fault.id)
        };
        let reported = |outcome: &&Outcome| outcome.detected && outcome.alarm == Some(code.name());
        for seen in of(Blind::None).filter(reported) {
            let same = |outcome: &&Outcome| outcome.fault == row.fault.id && outcome.seed == seen.seed;
            let without = if row.fault.codes.len() == 1 {
                campaign.outcomes.iter().find(same)
            } else {
                of(Blind::Code(code)).find(same)
            };
            let Some(without) = without else { continue };
            if !report.faults.contains(&row.fault.id) {
                report.faults.push(row.fault.id);
            }
            report.seen += 1;
            match (without.detected, without.undetectable) {
                (true, _) => report.seen_by_others += 1,
                (_, true) => report.unjudged_without += 1,
                _ => report.missed_without += 1,
            }
        }
    }
    report
}

impl DetectorReport {
    /// Returns whether a campaign would change if the code broke: without it, some runs are missed or
    /// reported by another code.
    pub const fn is_noticed(&self) -> bool {
        self.missed_without + self.seen_by_others > 0
    }

    /// Summary in one line.
    pub fn line(&self) -> String {
        let Self { code, seen, missed_without, seen_by_others, unjudged_without, .. } = self;
        format!(
            "{code} ({}): reported in {seen} runs; without it {missed_without} missed, {seen_by_others} detected by others, {unjudged_without} not judged\n",
            self.faults.join(", ")
        )
    }
}
