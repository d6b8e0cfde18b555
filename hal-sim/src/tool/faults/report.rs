//! A campaign as table, JSON and lines for a document.

use scarab::safety::FaultCode;
use serde::Serialize;

use super::campaign::Campaign;
use super::detectors::{DetectorReport, detectors};
use super::entry::{Entry, Head, instead};
use super::hours::HoursReport;
use super::run::Outcome;
use super::trial::KINDS;
use crate::tool::report::Number;
use crate::tool::tables::headed;

/// Failures that are written out.
const MOST_FAILURES: usize = 100;
/// Rows with runs in which a false alarm can be told: something harmless or a mere push happens, or a host's own time is not over yet. All
/// others only ask what follows a fault.
const JUDGED: [&str; 7] = ["E2", "E4", "J1", "J2", "H1", "B1", "B5"];

/// One row of the catalogue as it was run. The names are an interface.
#[derive(Clone, Debug, Serialize)]
pub struct RowReport {
    /// The catalogue's id.
    pub fault: &'static str,
    /// Seeded runs.
    pub runs: usize,
    /// Seen in time, and made safe.
    pub detected: usize,
    /// Of those, by this row's own detectors; what another one saw shows nothing about them.
    pub seen_by_own: usize,
    /// Neither that nor undetectable by design.
    pub missed: usize,
    /// Runs in which something was raised although nothing was wrong.
    pub false_alarms: usize,
    /// Whether there are runs in which that could have been.
    pub judges_false_alarms: bool,
    /// Longest time from a lasting fault to the safe state's first command, ms.
    pub worst_ms: Number,
    /// What it may take, ms.
    pub deadline_ms: Number,
    /// Longest time from the first of the readings of an intermittent fault, ms.
    pub worst_intermittent_ms: Number,
    /// What it may take, ms; the longest of all runs.
    pub intermittent_deadline_ms: Number,
    /// Where it leads: the catalogue's last column.
    pub state: &'static str,
    /// What the firmware does instead, by design: docs/safety.md says why.
    pub state_instead: Option<&'static str>,
    /// Runs in which either of them was reached.
    pub state_reached: usize,
    /// Runs in which there was nothing that could be seen.
    pub undetectable_by_design: usize,
    /// What goes wrong.
    pub what: &'static str,
    /// What sees it.
    pub detector: &'static str,
    /// Codes that the firmware raised.
    pub codes: Vec<&'static str>,
    /// Smallest magnitude that was seen, and the largest that was not.
    pub smallest_seen: Number,
    /// The same that was not seen.
    pub largest_unseen: Number,
    /// Of both.
    pub unit: &'static str,
    /// What the detector does not see yet.
    pub lacking: Option<&'static str>,
    /// Seen over seen and missed, of these runs; unknown where nothing could be seen. Not the diagnostic coverage of ISO 13849-1, which
    /// weighs dangerous faults and counts those that cannot be detected.
    pub detected_of_detectable: Number,
}

/// Runs in which nothing has to be seen and nothing may be broken. The names are an interface.
#[derive(Clone, Debug, Serialize)]
pub struct TrialsReport {
    /// `sweep` or `pairs`.
    pub kind: &'static str,
    /// Seeded runs.
    pub runs: usize,
    /// Runs in which something was raised.
    pub raised: usize,
    /// Invariants that did not hold.
    pub invariants_broken: usize,
}

/// A campaign. The names are an interface.
#[derive(Clone, Debug, Serialize)]
pub struct CampaignReport {
    /// Version of the JSON.
    pub schema: u32,
    /// Rows that were run.
    pub rows: Vec<RowReport>,
    /// Invariants that did not hold, over all runs.
    pub invariants_broken: usize,
    /// Runs that were missed, broke an invariant, or raised a false alarm; a hundred at most.
    pub failures: Vec<Outcome>,
    /// Seen over seen and missed, over all rows.
    pub detected_of_detectable: Number,
    /// Runs of all rows.
    pub runs: usize,
    /// Of those, runs in which there was nothing that could be seen.
    pub undetectable_by_design: usize,
    /// Runs with the emergency stop at every tick, which are among those of X1.
    pub every_tick: usize,
    /// Each code of the firmware by itself, in a campaign that is blind.
    pub detectors: Vec<DetectorReport>,
    /// The sweep, and two faults at once.
    pub trials: Vec<TrialsReport>,
    /// Hours of normal motion, where they were asked for.
    pub hours: Option<HoursReport>,
    /// Motion without a fault, s.
    pub undisturbed_s: f64,
    /// What was raised in it, in words: none in a campaign that is good.
    pub base_alarms: Vec<String>,
    /// Of all runs, in their order.
    pub trace_hash: String,
}

impl CampaignReport {
    /// Of what was run.
    #[must_use]
    pub fn new(entries: &[Entry], campaign: &Campaign, hours: Option<HoursReport>) -> Self {
        let mut heads: Vec<Head> = entries.iter().map(Entry::head).collect();
        // One that is run in two ways is told as its forks are.
        heads.dedup_by_key(|head| head.id);
        heads.retain(|head| !campaign.left_out.contains(&head.id));
        let outcomes = &campaign.outcomes;
        let failed = |outcome: &&Outcome| {
            !outcome.detected && !outcome.undetectable || outcome.false_alarm || !outcome.broken.is_empty()
        };
        let all = || outcomes.iter().chain(&campaign.trials);
        let hash = all().flat_map(|outcome| outcome.hash.bytes()).fold(0_u64, |hash, byte| {
            hash.rotate_left(5).wrapping_mul(0x0000_0100_0000_01b3) ^ u64::from(byte)
        });
        Self {
            schema: crate::tool::report::SCHEMA,
            detected_of_detectable: detected_of(
                outcomes.iter().filter(|outcome| outcome.detected).count(),
                outcomes.iter().filter(|outcome| !outcome.detected && !outcome.undetectable).count(),
            ),
            runs: outcomes.len(),
            undetectable_by_design: outcomes.iter().filter(|outcome| outcome.undetectable).count(),
            rows: heads.iter().map(|head| row_report(head, outcomes)).collect(),
            invariants_broken: all().map(|outcome| outcome.broken.len()).sum(),
            failures: all().filter(failed).take(MOST_FAILURES).cloned().collect(),
            every_tick: campaign.every_tick,
            detectors: detectors(entries, campaign),
            trials: KINDS.iter().filter_map(|kind| trials_report(kind, &campaign.trials)).collect(),
            hours,
            undisturbed_s: campaign.undisturbed_s,
            base_alarms: campaign.base_alarms.clone(),
            trace_hash: format!("{hash:016x}"),
        }
    }

    /// Nothing was missed, or seen by others than its own detectors alone; no invariant broken, nothing raised for nothing.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let calm = self.hours.as_ref().is_none_or(|hours| hours.false_alarms.is_empty());
        calm && self.base_alarms.is_empty()
            && self.invariants_broken == 0
            && self.rows.iter().all(|row| !row.is_noticed() && row.false_alarms == 0)
    }

    /// Names of the table's columns.
    #[must_use]
    pub const fn head(&self) -> [&'static str; 11] {
        HEAD
    }

    /// As a table for a terminal.
    #[must_use]
    pub fn table(&self) -> String {
        let mut table = headed(&HEAD);
        for row in &self.rows {
            table.add_row(row.cells().to_vec());
        }
        format!("{table}\n")
    }

    /// As a table for a document.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("| {} |\n|{}\n", HEAD.join(" | "), " --- |".repeat(HEAD.len()));
        for row in &self.rows {
            text.push_str(&format!("| {} |\n", row.cells().join(" | ")));
        }
        text
    }
}

const HEAD: [&str; 11] = [
    "fault",
    "what",
    "runs",
    "seen",
    "worst / deadline, ms",
    "state (reached)",
    "missed",
    "not to be seen",
    "smallest seen",
    "false alarms",
    "detected of detectable (not detectable)",
];

fn number(value: Number, digits: usize) -> String {
    value.known().map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
}

impl RowReport {
    /// Whether a campaign with this row fails: something was missed, or its own detectors never spoke.
    #[must_use]
    pub fn is_noticed(&self) -> bool {
        self.missed > 0 || self.detected > 0 && self.seen_by_own == 0
    }

    /// Share of the runs in which there was nothing that could be seen.
    fn not_detectable(&self) -> Number {
        (self.undetectable_by_design as f64 / self.runs as f64).into()
    }

    /// Worst time and deadline, of lasting faults and of intermittent ones.
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

    /// Its line of the table.
    #[must_use]
    pub fn cells(&self) -> [String; 11] {
        let smallest = match self.smallest_seen.known() {
            Some(value) if !self.unit.is_empty() => format!("{value:.1} {}", self.unit),
            _ => "-".into(),
        };
        [
            self.fault.into(),
            self.what.into(),
            self.runs.to_string(),
            self.detected.to_string(),
            self.times(),
            match self.state_instead {
                None => format!("{} ({})", self.state, self.state_reached),
                Some(instead) => format!("{}; here {instead} ({})", self.state, self.state_reached),
            },
            self.missed.to_string(),
            self.undetectable_by_design.to_string(),
            smallest,
            if self.judges_false_alarms { self.false_alarms.to_string() } else { "-".into() },
            format!("{} ({})", percent(self.detected_of_detectable), percent(self.not_detectable())),
        ]
    }
}

fn percent(share: Number) -> String {
    // Down, so that no miss is rounded away.
    let digits = |share: f64| format!("{:.2} %", (1e4 * share).floor() / 1e2);
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

/// Whether a state is among these; `refused: contact` is another one than `refused`.
fn names(states: &str, state: &str) -> bool {
    states.match_indices(state).any(|(at, _)| !states[at + state.len()..].starts_with(':'))
}

fn row_report(row: &Head, outcomes: &[Outcome]) -> RowReport {
    let of: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.fault == row.id).collect();
    let count = |holds: &dyn Fn(&Outcome) -> bool| of.iter().filter(|outcome| holds(outcome)).count();
    let magnitudes = |seen: bool| {
        of.iter().filter(move |outcome| outcome.detected == seen).filter_map(|outcome| outcome.magnitude)
    };
    // What could not be seen may be noticed late by something else.
    let dangerous = of.iter().filter(|outcome| !outcome.undetectable);
    let worst = |intermittent: bool| {
        let of = dangerous.clone().filter(|outcome| outcome.intermittent_ms.is_some() == intermittent);
        of.filter_map(|outcome| outcome.after_ms).fold(f64::NEG_INFINITY, f64::max)
    };
    let longest = of.iter().filter_map(|outcome| outcome.intermittent_ms).fold(f64::NEG_INFINITY, f64::max);
    let codes = FaultCode::ALL.iter().map(|code| code.name());
    let raised = |name: &&str| of.iter().any(|outcome| outcome.alarm == Some(*name));
    RowReport {
        fault: row.id,
        runs: of.len(),
        detected: count(&|outcome| outcome.detected),
        seen_by_own: count(&|outcome| {
            let own = |alarm: &str| row.codes.iter().any(|code| code.name() == alarm);
            outcome.detected && outcome.alarm.is_none_or(own)
        }),
        missed: count(&|outcome| !outcome.detected && !outcome.undetectable),
        false_alarms: count(&|outcome| outcome.false_alarm),
        judges_false_alarms: JUDGED.contains(&row.id),
        worst_ms: worst(false).into(),
        deadline_ms: row.deadline_ms.into(),
        worst_intermittent_ms: worst(true).into(),
        intermittent_deadline_ms: longest.into(),
        state: row.state,
        state_instead: instead(row.id),
        state_reached: count(&|outcome| {
            let leads =
                |state: &str| names(row.state, state) || instead(row.id).is_some_and(|to| names(to, state));
            outcome.state.is_some_and(leads)
        }),
        undetectable_by_design: count(&|outcome| outcome.undetectable),
        what: row.fault,
        detector: row.detector,
        codes: codes.filter(raised).collect(),
        smallest_seen: magnitudes(true).fold(f64::INFINITY, f64::min).into(),
        largest_unseen: magnitudes(false).fold(f64::NEG_INFINITY, f64::max).into(),
        unit: row.unit,
        lacking: row.lacking,
        detected_of_detectable: detected_of(
            count(&|outcome| outcome.detected),
            count(&|outcome| !outcome.detected && !outcome.undetectable),
        ),
    }
}

impl CampaignReport {
    /// What stands below the table: what is lacking, what failed, and the hash.
    #[must_use]
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
        // Pooled it is that of the row with the most runs.
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
            text.push_str(&format!("failed: {}\n", told(failure)));
        }
        text
    }
}

/// A run in a line.
#[must_use]
pub fn told(outcome: &Outcome) -> String {
    let verdict = match outcome {
        Outcome { detected: true, .. } => "seen",
        Outcome { undetectable: true, .. } => "not to be seen",
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
