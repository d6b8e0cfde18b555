//! Reads lines into a [`Trace`]: records in order, with the losses between them.
//!
//! The board never waits for a listener, so a trace may begin late, have gaps and end anywhere. Gaps in the
//! records' numbers show losses. Unreadable records are reported with their line; unknown kinds are skipped.
//!
//! Cost: the records of a result, the log (60 bytes per sample) and the timeline are stored;
//! everything else is counted.

use scarab::trace::{Line, LineError};

use crate::trace::events::{self, Event, Weight};
use crate::trace::loops::Statistics;
use crate::trace::records::{Board, Boot, Kind, Log, Progress, Received, State, words};
use crate::trace::result_records::ResultRecords;
use crate::trace::text;

/// Servo rate, Hz, unless the board reports another.
const SERVO_HZ: f64 = scarab::servo::SERVO_RATE_HZ as f64;
/// Most joints of a leg.
const JOINTS: usize = 3;
/// Limit of stored messages about unreadable lines; further lines are only counted.
const MOST_PROBLEMS: usize = 20;

/// Range of lost records, by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// First missing record.
    pub first: u32,
    /// Last missing record.
    pub last: u32,
}

impl Gap {
    /// Number of missing records.
    pub(crate) fn count(&self) -> u64 {
        u64::from(self.last - self.first) + 1
    }
}

/// Contents of a trace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Record of the last start.
    pub boot: Option<Boot>,
    /// Last board that was reported.
    pub(crate) board: Option<Board>,
    /// Number of reported starts.
    pub starts: u32,
    /// Timeline, in order.
    pub events: Vec<Event>,
    /// Complete results, in order.
    pub results: Vec<ResultRecords>,
    /// Reasons why other results are incomplete, in order.
    pub(crate) incomplete: Vec<String>,
    /// Last reported state of the leg.
    pub state: Option<State>,
    /// Progress of a running search.
    pub(crate) progress: Option<Progress>,
    /// Statistics of loops, stack and supply.
    pub statistics: Statistics,
    /// 500 Hz log in order; each sample with the number of results before it.
    pub log: Vec<(usize, Log)>,
    /// Gaps in the numbering of the records.
    pub gaps: Vec<Gap>,
    /// Records sent before the first that was received.
    pub unheard: u32,
    /// Unreadable records, and why; up to a limit.
    pub problems: Vec<String>,
    /// Number of unreadable records.
    pub(crate) problem_count: u64,
    /// Lines read.
    pub lines: u64,
    /// Records read.
    pub records: u64,
    /// Records of unknown kinds.
    pub unknown: u64,
    pending: Option<ResultRecords>,
    next: Option<u32>,
}

impl Trace {
    /// Takes any line, with or without a record.
    pub fn push(&mut self, line: &str) {
        self.lines += 1;
        let Some(record) = text::record(line) else { return };
        match Line::parse(&record) {
            Ok(line) => self.take(&line),
            Err(error) => {
                let kind = record.split(' ').next().unwrap_or_default();
                self.complain(words(kind, error));
            }
        }
    }

    /// Ends the trace: a result that is still open is incomplete.
    pub fn finish(&mut self) {
        self.abandon();
    }

    /// Number of lost records.
    pub fn lost(&self) -> u64 {
        self.gaps.iter().map(Gap::count).sum()
    }

    /// Servo ticks per second.
    pub(crate) fn servo_hz(&self) -> f64 {
        let announced = self.boot.as_ref().map(|boot| f64::from(boot.servo_hz)).filter(|rate| *rate > 0.0);
        announced.unwrap_or(SERVO_HZ)
    }

    /// Faults, crashes and refusals to be enabled, in order.
    pub fn faults(&self) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(|event| event.weight == Weight::Fault)
    }

    /// Warnings, in order.
    pub fn warnings(&self) -> Vec<String> {
        let events = self.events.iter().filter(|event| event.weight == Weight::Warning);
        let mut words: Vec<String> = events.map(|event| event.words.clone()).collect();
        words.extend(self.statistics.complaints());
        words.extend(self.loss());
        words
    }

    /// Explains why a trace has no complete result, and how far it went.
    pub(crate) fn without_result(&self) -> String {
        if self.records == 0 {
            return "contains no trace record".into();
        }
        if let Some(why) = self.incomplete.last() {
            return format!("holds no complete result: the last one {why}");
        }
        match (&self.progress, &self.state) {
            (Some(progress), _) => format!(
                "ends while searching at iteration {} ({} evaluations); nothing was judged",
                progress.iterations, progress.evaluations
            ),
            (_, Some(state)) => {
                format!("holds no result; it ends with: {}", events::doing(state))
            }
            _ => format!("holds no result among its {} records", self.records),
        }
    }

    fn take(&mut self, line: &Line<'_>) {
        self.records += 1;
        match line.number() {
            Ok(number) => self.number(number, line.kind() == "boot"),
            Err(error) => self.complain(words(line.kind(), error)),
        }
        if let Err(error) = self.record(line) {
            self.complain(words(line.kind(), error));
        }
    }

    /// Checks the numbering of the records.
    fn number(&mut self, number: u32, starts: bool) {
        match self.next {
            None => self.unheard = number,
            Some(next) if number > next && !(starts && number == 0) => {
                self.gaps.push(Gap { first: next, last: number - 1 });
            }
            Some(next) if number < next && !starts => {
                self.restart();
                self.event(Weight::Warning, format!("the numbers of the records begin again at {number}"));
            }
            Some(_) => {}
        }
        self.next = Some(number.saturating_add(1));
    }

    /// Ends the running result when the image restarted.
    fn restart(&mut self) {
        self.abandon();
        self.statistics.restart();
        (self.state, self.progress) = (None, None);
    }

    fn abandon(&mut self) {
        if let Some(records) = self.pending.take() {
            self.lacks(records.lacks().unwrap_or_else(|| "breaks off before its end".into()));
        }
    }

    fn lacks(&mut self, why: String) {
        self.event(Weight::Warning, format!("a result is not complete: it {why}"));
        self.incomplete.push(why);
    }

    fn record(&mut self, line: &Line<'_>) -> Result<(), LineError<'static>> {
        let Some(kind) = Kind::from_name(line.kind()) else {
            self.unknown += 1;
            return Ok(());
        };
        let received = Received::read(kind, line);
        if kind.is_of_result() {
            return self.result(kind, received);
        }
        let received = received?;
        let event = events::from_record(&received, self.servo_hz());
        if kind == Kind::Boot {
            self.restart();
            self.starts += 1;
        }
        self.events.extend(event);
        match received {
            Received::Boot(boot) => self.boot = Some(boot),
            Received::Board(board) => self.board = Some(board),
            Received::State(state) => {
                // The search runs while the leg settles and until the search is done.
                if !["settle", "solve"].contains(&state.phase.as_str()) {
                    self.progress = None;
                }
                self.state = Some(state);
            }
            Received::Progress(progress) => self.progress = Some(progress),
            Received::Loops(loops) => self.statistics.take(&loops),
            Received::Supply(supply) => self.statistics.take_supply(&supply),
            Received::Log(sample) => self.sample(sample)?,
            _ => {}
        }
        Ok(())
    }

    fn sample(&mut self, sample: Log) -> Result<(), LineError<'static>> {
        let joints = sample.position_rad.len();
        if !(1..=JOINTS).contains(&joints) {
            return Err(LineError::Value("position_rad"));
        }
        if (sample.torque_nm.len(), sample.counts.len()) != (joints, joints) {
            return Err(LineError::Value("counts"));
        }
        self.log.push((self.results.len(), sample));
        Ok(())
    }

    /// Takes a record of a result: `solver` begins one, `end` ends it, readable or not.
    fn result(
        &mut self,
        kind: Kind,
        received: Result<Received, LineError<'static>>,
    ) -> Result<(), LineError<'static>> {
        if kind == Kind::Solver {
            self.abandon();
        }
        let records = self.pending.get_or_insert_default();
        let taken = received.map(|received| records.take(received));
        if kind == Kind::End {
            let records = self.pending.take().unwrap_or_default();
            match records.lacks() {
                Some(why) => self.lacks(why),
                None => self.complete(records),
            }
        }
        taken
    }

    fn complete(&mut self, records: ResultRecords) {
        let reasons: Vec<&str> = records.reasons.iter().map(|found| found.reason.as_str()).collect();
        let words = match reasons.as_slice() {
            [] => "identification ACCEPTED".to_owned(),
            _ => format!("identification REFUSED: {}", reasons.join(", ")),
        };
        self.event(Weight::Note, words);
        self.results.push(records);
        self.progress = None;
    }

    fn event(&mut self, weight: Weight, words: String) {
        self.events.push(Event { time_s: None, weight, words });
    }

    fn complain(&mut self, words: String) {
        self.problem_count += 1;
        if self.problems.len() < MOST_PROBLEMS {
            self.problems.push(format!("line {}: {words}", self.lines));
        }
    }

    /// Describes the losses.
    fn loss(&self) -> Vec<String> {
        let mut words = Vec::new();
        if self.unheard > 0 {
            words.push(format!("the listener joined late: the first {} records are missing", self.unheard));
        }
        if !self.gaps.is_empty() {
            const SHOWN: usize = 8;
            let shown = self.gaps.iter().take(SHOWN).map(|gap| match gap.count() {
                1 => gap.first.to_string(),
                _ => format!("{}-{}", gap.first, gap.last),
            });
            let shown: Vec<String> = shown.collect();
            let more = if self.gaps.len() > SHOWN { ", ..." } else { "" };
            words.push(format!(
                "{} records are LOST (n = {}{more}): their content, possibly a fault, is not known",
                self.lost(),
                shown.join(", ")
            ));
        }
        words.extend(self.problems.iter().cloned());
        let more = self.problem_count - self.problems.len() as u64;
        if more > 0 {
            words.push(format!("{more} more lines cannot be read"));
        }
        words
    }
}
