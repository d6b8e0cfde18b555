//! Each detector by itself: a fault's rows with one code of the firmware switched off at a time, against the same runs with all of them on.
//!
//! Why beside the rows: a row that several detectors see goes on being seen when one of them breaks. Here each has to be the one that
//! tells in some run, and what becomes of these runs without it is written down.

use scarab::safety::FaultCode;
use serde::Serialize;

use super::campaign::Campaign;
use super::catalogue::Row;
use super::entry::Entry;
use super::run::{Blind, Outcome};

/// One code of the firmware. The names are an interface.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DetectorReport {
    /// The word in records.
    pub code: &'static str,
    /// Rows in whose runs it told.
    pub faults: Vec<&'static str>,
    /// Runs in which it told what was wrong, in time.
    pub seen: usize,
    /// Of those, runs that are missed without it.
    pub missed_without: usize,
    /// Of those, runs that another code tells in time without it.
    pub seen_by_others: usize,
    /// Of those, runs that cannot be judged without it: the fault did not last, or the joint did not move any more.
    pub unjudged_without: usize,
}

fn forked(rows: &[Entry]) -> impl Iterator<Item = &'static Row> {
    rows.iter().filter_map(|entry| match entry {
        Entry::Forked(row) if row.id != super::campaign::CAPPED => Some(*row),
        _ => None,
    })
}

/// Codes whose own row of the catalogue is among those that are forked.
fn codes(rows: &[Entry]) -> impl Iterator<Item = FaultCode> {
    let has =
        |code: &FaultCode| forked(rows).any(|row| row.id == code.catalogue() && row.codes.contains(code));
    FaultCode::ALL.into_iter().filter(has)
}

/// In what ways a row's runs are done beside the one with all of its detectors off, which is that of its only code where it has one.
pub(super) fn views(row: &'static Row, rows: &[Entry]) -> Vec<Blind> {
    if row.id == super::campaign::CAPPED {
        return Vec::new();
    }
    let alone = row.codes.len() == 1;
    let codes = codes(rows).filter(|code| !alone && row.codes.contains(code)).map(Blind::Code);
    [Blind::Nobody].into_iter().chain(codes).collect()
}

/// Of a campaign that was blind; none of another.
#[must_use]
pub fn detectors(rows: &[Entry], campaign: &Campaign) -> Vec<DetectorReport> {
    if campaign.singly.is_empty() {
        return Vec::new();
    }
    codes(rows).map(|code| detector(code, rows, campaign)).collect()
}

fn detector(code: FaultCode, rows: &[Entry], campaign: &Campaign) -> DetectorReport {
    let mut report = DetectorReport {
        code: code.name(),
        faults: Vec::new(),
        seen: 0,
        missed_without: 0,
        seen_by_others: 0,
        unjudged_without: 0,
    };
    for row in forked(rows).filter(|row| row.codes.contains(&code)) {
        let of = |blind: Blind| {
            let singly = campaign.singly.iter().filter(move |(how, _)| *how == blind);
            singly.map(|(_, outcome)| outcome).filter(|outcome| outcome.fault == row.id)
        };
        let told = |outcome: &&Outcome| outcome.detected && outcome.alarm == Some(code.name());
        for seen in of(Blind::Nobody).filter(told) {
            let same = |outcome: &&Outcome| outcome.fault == row.id && outcome.seed == seen.seed;
            let without = if row.codes.len() == 1 {
                campaign.outcomes.iter().find(same)
            } else {
                of(Blind::Code(code)).find(same)
            };
            let Some(without) = without else { continue };
            if !report.faults.contains(&row.id) {
                report.faults.push(row.id);
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
    /// Whether a campaign would change if it broke: it tells something, which is missed or told by another without it.
    #[must_use]
    pub const fn is_noticed(&self) -> bool {
        self.missed_without + self.seen_by_others > 0
    }

    /// A line of it.
    #[must_use]
    pub fn told(&self) -> String {
        let Self { code, seen, missed_without, seen_by_others, unjudged_without, .. } = self;
        format!(
            "{code} ({}): told in {seen} runs; without it {missed_without} missed, {seen_by_others} seen by others, {unjudged_without} not to be judged\n",
            self.faults.join(", ")
        )
    }
}
