//! Report of a campaign: table, notes and JSON.

use scarab::safety::FaultCode;
use scarab_base::number::Number;
use scarab_base::table::{Cell, Table, cells};
use serde::Serialize;

use crate::faults::catalogue::Fault;
use crate::faults::detectors::{DetectorReport, detectors};
use crate::faults::entry::Entry;
use crate::faults::hours::HoursReport;
use crate::faults::results::Campaign;
use crate::faults::run::Outcome;
use crate::faults::trial::KINDS;

/// Largest number of failures in the JSON.
const MOST_FAILURES: usize = 100;
/// Rows whose runs can show a false alarm: a harmless event or a mere push, or a host whose time is not over
/// yet. All others test only the reaction to a fault.
const JUDGED: [&str; 10] = ["E2", "E4", "E6", "E7", "T4", "J1", "J2", "H1", "B1", "B5"];

/// Results of one row of the catalogue. Field names are part of the JSON interface.
#[derive(Clone, Debug, Serialize)]
pub struct RowReport {
    /// Id in the catalogue.
    pub fault: &'static str,
    /// Seeded runs.
    pub(crate) runs: usize,
    /// Runs that were detected in time and made safe.
    pub(crate) detected: usize,
    /// Those of them detected by this row's own detectors; detection by others says nothing about these.
    pub(crate) seen_by_own: usize,
    /// Runs neither detected nor undetectable by design.
    pub missed: usize,
    /// Runs in which a fault was reported although nothing was wrong.
    pub false_alarms: usize,
    /// Whether there are runs that could show a false alarm.
    pub(crate) judges_false_alarms: bool,
    /// Longest time from a lasting fault to the safe state's first command, ms.
    pub(crate) worst_ms: Number,
    /// Deadline, ms.
    pub(crate) deadline_ms: Number,
    /// Longest time from the first reading of an intermittent fault, ms.
    pub(crate) worst_intermittent_ms: Number,
    /// Deadline of intermittent faults, ms; the longest of all runs.
    pub(crate) intermittent_deadline_ms: Number,
    /// Safe state: the catalogue's last column.
    pub(crate) state: &'static str,
    /// Safe state that the firmware uses instead, by design; docs/safety.md gives the reason.
    pub(crate) state_instead: Option<&'static str>,
    /// Runs in which either state was reached.
    pub(crate) state_reached: usize,
    /// Runs in which nothing detectable happened.
    pub(crate) undetectable_by_design: usize,
    /// Description of the fault.
    pub(crate) what: &'static str,
    /// Detector of the fault.
    pub(crate) detector: &'static str,
    /// Codes that the firmware reported.
    pub(crate) codes: Vec<&'static str>,
    /// Smallest detected magnitude.
    pub(crate) smallest_seen: Number,
    /// Largest magnitude that was not detected.
    pub(crate) largest_unseen: Number,
    /// Unit of both magnitudes.
    pub(crate) unit: &'static str,
    /// Cases that the detector does not cover yet.
    pub(crate) lacking: Option<&'static str>,
    /// Detected over detected and missed of these runs; unknown where nothing was detectable. Not the
    /// diagnostic coverage of ISO 13849-1, which weighs dangerous faults and counts undetectable ones.
    pub(crate) detected_of_detectable: Number,
}

/// Runs without a required detection in which no invariant may break. Field names are part of the JSON
/// interface.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct TrialsReport {
    /// `sweep` or `pairs`.
    pub(crate) kind: &'static str,
    /// Seeded runs.
    pub(crate) runs: usize,
    /// Runs in which a fault was reported.
    pub(crate) raised: usize,
    /// Broken invariants.
    pub(crate) invariants_broken: usize,
}

/// Report of a campaign. Field names are part of the JSON interface.
#[derive(Clone, Debug, Serialize)]
pub struct CampaignReport {
    /// Version of the JSON.
    pub(crate) schema: u32,
    /// Rows that were run.
    pub rows: Vec<RowReport>,
    /// Broken invariants over all runs.
    pub invariants_broken: usize,
    /// Runs that were missed, broke an invariant or raised a false alarm; at most a hundred.
    pub(crate) failures: Vec<Outcome>,
    /// Detected over detected and missed, over all rows.
    pub(crate) detected_of_detectable: Number,
    /// Runs of all rows.
    pub runs: usize,
    /// Those of them in which nothing detectable happened.
    pub(crate) undetectable_by_design: usize,
    /// Runs with the emergency stop at every tick; included in X1.
    pub(crate) every_tick: usize,
    /// Each code of the firmware disabled separately, in a blind campaign.
    pub detectors: Vec<DetectorReport>,
    /// Results of the sweep and of two faults at once.
    pub(crate) trials: Vec<TrialsReport>,
    /// Result of the hours of normal motion, where requested.
    pub(crate) hours: Option<HoursReport>,
    /// Motion without a fault, s.
    pub(crate) undisturbed_s: f64,
    /// Faults reported during it, in words; empty in a good campaign.
    pub base_alarms: Vec<String>,
    /// Hash of all runs, in order.
    pub(crate) trace_hash: String,
}

impl CampaignReport {
    /// Creates the report of a campaign.
    pub fn new(entries: &[Entry], campaign: &Campaign) -> Self {
        let mut faults: Vec<&Fault> = entries.iter().map(Entry::fault).collect();
        // A row that is run in two ways is described as its forks are.
        faults.dedup_by_key(|fault| fault.id);
        let outcomes = &campaign.outcomes;
        let failed = |outcome: &&Outcome| {
            !outcome.detected && !outcome.undetectable || outcome.false_alarm || !outcome.broken.is_empty()
        };
        let all = || outcomes.iter().chain(&campaign.trials);
        let hash = all().flat_map(|outcome| outcome.hash.bytes()).fold(0_u64, |hash, byte| {
            hash.rotate_left(5).wrapping_mul(0x0000_0100_0000_01b3) ^ u64::from(byte)
        });
        Self {
            schema: scarab_identify::report::SCHEMA,
            detected_of_detectable: detected_of(
                outcomes.iter().filter(|outcome| outcome.detected).count(),
                outcomes.iter().filter(|outcome| !outcome.detected && !outcome.undetectable).count(),
            ),
            runs: outcomes.len(),
            undetectable_by_design: outcomes.iter().filter(|outcome| outcome.undetectable).count(),
            rows: faults.iter().map(|fault| row_report(fault, outcomes)).collect(),
            invariants_broken: all().map(|outcome| outcome.broken.len()).sum(),
            failures: all().filter(failed).take(MOST_FAILURES).cloned().collect(),
            every_tick: campaign.every_tick,
            detectors: detectors(entries, campaign),
            trials: KINDS.iter().filter_map(|kind| trials_report(kind, &campaign.trials)).collect(),
            hours: campaign.hours.as_deref().map(HoursReport::new),
            undisturbed_s: campaign.undisturbed_s(),
            base_alarms: campaign.base_alarms(),
            trace_hash: format!("{hash:016x}"),
        }
    }

    /// Returns whether the campaign passed: nothing missed or detected only by other detectors, no broken
    /// invariant, no false alarm.
    pub fn is_good(&self) -> bool {
        let calm = self.hours.as_ref().is_none_or(|hours| hours.false_alarms.is_empty());
        calm && self.base_alarms.is_empty()
            && self.invariants_broken == 0
            && self.rows.iter().all(|row| !row.is_noticed() && row.false_alarms == 0)
    }

    /// Table of the rows.
    pub fn table(&self) -> Table {
        let mut table = Table::with_class("any")
            .text(["fault", "what"])
            .numbers(["runs", "seen"])
            .text(["worst / deadline, ms"])
            .styled("words")
            .text(["state (reached)"])
            .numbers([
                "missed",
                "undetectable",
                "smallest seen",
                "false alarms",
                "detected of detectable (not detectable)",
            ]);
        self.rows.iter().for_each(|row| table.row(row.cells()));
        table
    }
}

fn number(value: Number, digits: usize) -> String {
    value.known().map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
}

impl RowReport {
    /// Returns whether a campaign with this row fails: a run was missed, or its own detectors never reported.
    pub fn is_noticed(&self) -> bool {
        self.missed > 0 || self.detected > 0 && self.seen_by_own == 0
    }

    /// Share of the runs in which nothing detectable happened.
    fn not_detectable(&self) -> Number {
        (self.undetectable_by_design as f64 / self.runs as f64).into()
    }

    /// Longest time and deadline, for lasting and intermittent faults.
    fn times(&self) -> String {
        let pair = |worst, deadline| format!("{} / {}", number(worst, 3), number(deadline, 3));
        let lasting = pair(self.worst_ms, self.deadline_ms);
        match self.intermittent_deadline_ms.known() {
            None => lasting,
            Some(_) => {
                let intermittent = pair(self.worst_intermittent_ms, self.intermittent_deadline_ms);
                format!("{lasting}; intermittent {intermittent}")
            }
        }
    }

    /// Cells of the row's line in the table.
    fn cells(&self) -> [Cell; 11] {
        let smallest = match self.smallest_seen.known() {
            Some(value) if !self.unit.is_empty() => format!("{value:.1} {}", self.unit),
            _ => "-".into(),
        };
        cells![
            self.fault,
            self.what,
            self.runs,
            self.detected,
            self.times(),
            match self.state_instead {
                None => format!("{} ({})", self.state, self.state_reached),
                Some(instead) => format!("{}; here {instead} ({})", self.state, self.state_reached),
            },
            self.missed,
            self.undetectable_by_design,
            smallest,
            if self.judges_false_alarms { self.false_alarms.to_string() } else { "-".into() },
            format!("{} ({})", percent(self.detected_of_detectable), percent(self.not_detectable())),
        ]
    }
}

fn percent(share: Number) -> String {
    // Rounded down, so that no miss disappears; a binary share may lie just below its decimal one.
    let digits = |share: f64| format!("{:.2} %", (1e4 * share + 1e-9).floor() / 1e2);
    share.known().map_or_else(|| "-".into(), digits)
}

fn detected_of(detected: usize, missed: usize) -> Number {
    (detected as f64 / (detected + missed) as f64).into()
}

fn trials_report(kind: &'static str, trials: &[Outcome]) -> Option<TrialsReport> {
    let of = || trials.iter().filter(|outcome| outcome.fault == kind);
    (of().count() > 0).then(|| TrialsReport {
        kind,
        runs: of().count(),
        raised: of().filter(|outcome| outcome.detected).count(),
        invariants_broken: of().map(|outcome| outcome.broken.len()).sum(),
    })
}

/// Returns whether a state is among these; `refused: contact` differs from `refused`.
fn names(states: &str, state: &str) -> bool {
    states.match_indices(state).any(|(at, _)| !states[at + state.len()..].starts_with(':'))
}

fn row_report(row: &Fault, outcomes: &[Outcome]) -> RowReport {
    let of: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.fault == row.id).collect();
    let count = |holds: &dyn Fn(&Outcome) -> bool| of.iter().filter(|outcome| holds(outcome)).count();
    let magnitudes = |seen: bool| {
        of.iter().filter(move |outcome| outcome.detected == seen).filter_map(|outcome| outcome.magnitude)
    };
    // An undetectable fault may be noticed late by another detector.
    let dangerous = of.iter().filter(|outcome| !outcome.undetectable);
    let worst = |intermittent: bool| {
        let of = dangerous.clone().filter(|outcome| outcome.intermittent_ms.is_some() == intermittent);
        of.filter_map(|outcome| outcome.after_ms).fold(f64::NEG_INFINITY, f64::max)
    };
    let longest = of.iter().filter_map(|outcome| outcome.intermittent_ms).fold(f64::NEG_INFINITY, f64::max);
    let codes = FaultCode::ALL.iter().map(|code| code.name());
    let raised = |name: &&str| of.iter().any(|outcome| outcome.alarm == Some(*name));
    let detected = count(&|outcome| outcome.detected);
    let missed = count(&|outcome| !outcome.detected && !outcome.undetectable);
    RowReport {
        fault: row.id,
        runs: of.len(),
        detected,
        seen_by_own: count(&|outcome| {
            let own = |alarm: &str| row.codes.iter().any(|code| code.name() == alarm);
            outcome.detected && outcome.alarm.is_none_or(own)
        }),
        missed,
        false_alarms: count(&|outcome| outcome.false_alarm),
        judges_false_alarms: JUDGED.contains(&row.id),
        worst_ms: worst(false).into(),
        deadline_ms: row.deadline_ms.into(),
        worst_intermittent_ms: worst(true).into(),
        intermittent_deadline_ms: longest.into(),
        state: row.state,
        state_instead: row.instead,
        state_reached: count(&|outcome| {
            outcome.state.is_some_and(|state| row.leads_to(|to| names(to, state)))
        }),
        undetectable_by_design: count(&|outcome| outcome.undetectable),
        what: row.fault,
        detector: row.detector,
        codes: codes.filter(raised).collect(),
        smallest_seen: magnitudes(true).fold(f64::INFINITY, f64::min).into(),
        largest_unseen: magnitudes(false).fold(f64::NEG_INFINITY, f64::max).into(),
        unit: row.unit,
        lacking: row.lacking,
        detected_of_detectable: detected_of(detected, missed),
    }
}

impl CampaignReport {
    /// Notes below the table: gaps, failures, and the hash.
    pub fn notes(&self) -> String {
        let mut text = String::new();
        for row in &self.rows {
            if let Some(lacking) = row.lacking {
                text.push_str(&format!("{}: not seen: {lacking}\n", row.fault));
            }
        }
        if self.every_tick > 0 {
            text.push_str(&format!(
                "emergency stop at every tick: {} forks, among X1's runs\n",
                self.every_tick
            ));
        }
        for trials in &self.trials {
            let TrialsReport { kind, runs, raised, invariants_broken } = trials;
            text.push_str(&format!(
                "{kind}: {runs} runs, something raised in {raised}, invariants broken: {invariants_broken}\n"
            ));
        }
        if let Some(hours) = &self.hours {
            text.push_str(&hours.lines());
        }
        // The pooled share is dominated by the row with the most runs.
        let covered =
            self.rows.iter().filter_map(|row| Some((row.detected_of_detectable.known()?, row.fault)));
        let least = covered.min_by(|one, other| one.0.total_cmp(&other.0));
        let least = least.map_or_else(String::new, |(share, row)| {
            format!(", least of a row {} ({row})", percent(share.into()))
        });
        let share = percent((self.undetectable_by_design as f64 / self.runs as f64).into());
        let (unseen, runs) = (self.undetectable_by_design, self.runs);
        text.push_str(&format!(
            "detected of detectable: {}{least}; not detectable: {share} ({unseen} of {runs} runs)\n",
            percent(self.detected_of_detectable)
        ));
        for alarm in &self.base_alarms {
            text.push_str(&format!("false alarm in undisturbed motion: {alarm}\n"));
        }
        text.push_str(&format!(
            "invariants broken: {}; undisturbed motion: {:.0} s, alarms in it: {}; trace hash {}\n",
            self.invariants_broken,
            self.undisturbed_s,
            self.base_alarms.len(),
            self.trace_hash
        ));
        for failure in self.failures.iter().take(10) {
            text.push_str(&format!("failed: {}\n", line(failure)));
        }
        text
    }
}

/// Describes a run in one line.
pub fn line(outcome: &Outcome) -> String {
    let verdict = match outcome {
        Outcome { detected: true, .. } => "seen",
        Outcome { undetectable: true, .. } => "undetectable",
        _ => "MISSED",
    };
    let which = match outcome.seed {
        0 => format!("at period {}, repeated by --every-tick", outcome.period),
        seed => format!("seed {seed}"),
    };
    let after = outcome.after_ms.map_or_else(|| "-".into(), |after| format!("{after:.3} ms"));
    format!(
        "{} {which}: {verdict}, after {after}, state {}, code {}, magnitude {}, injected at period {}, trace hash {}{}",
        outcome.fault,
        outcome.state.unwrap_or("-"),
        outcome.alarm.unwrap_or("-"),
        outcome.magnitude.map_or_else(|| "-".into(), |magnitude| format!("{magnitude:.2}")),
        outcome.period,
        outcome.hash,
        outcome.broken.iter().map(|broken| format!("; {broken}")).collect::<String>(),
    )
}

#[cfg(test)]
mod tests;
