//! Trace of a board as a source of a live picture: records as they arrive, or a file paced by its ticks.
//!
//! The board logs its motion on request only. Without log the picture has states, events and results, but no
//! curves. Shown samples are dropped; events and results stay, as in `trace`.

use std::io::Read;
use std::path::Path;

use scarab::leg::Segment;
use scarab::servo::{SERVO_RATE_HZ, TICKS_PER_LOG};
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::run::progress::{ChainSample, Progress, ProgressOptions, progress};
use scarab_rig::trace::events::{Event, Weight, doing};
use scarab_rig::trace::read::Trace;
use scarab_rig::trace::records::{Log, State};
use scarab_rig::traced::run::StreamReader;
use scarab_rig::traced::run_report;

use crate::live::clock::Clock;
use crate::live::picture::{Picture, scene};
use crate::live::report::{LiveStatus, LiveUpdate, Severity};

/// Bytes taken at a time: a few records, so that a file is paced evenly.
const PIECE: usize = 256;

/// Input of a trace.
pub(crate) struct TraceInput {
    /// Records as text, or `defmt` frames.
    pub(crate) input: Box<dyn Read + Send>,
    /// Reader with the image's decoder, if any.
    pub(crate) reader: StreamReader,
    /// Name for messages.
    pub(crate) name: String,
    /// Seconds of the board per second; `None` for a board that sends now.
    pub(crate) speed: Option<f64>,
}

/// Reports a trace to `out` until its end; returns the report of the last result.
///
/// # Errors
/// The input cannot be read, has no record, or its last result belongs to another leg.
pub(crate) fn follow(
    leg: &LegFile,
    source: TraceInput,
    out: &dyn Fn(LiveUpdate),
) -> Result<Option<RunReport>, ToolError> {
    let TraceInput { mut input, mut reader, name, speed } = source;
    let progress = progress(leg, &ProgressOptions::new(leg.bandwidth_hz))?;
    let shown = Path::new(&name).file_name().unwrap_or_default().display();
    out(LiveUpdate::Scene(scene(leg, format!("trace {shown}"), speed.unwrap_or(1.0))));
    let mut follower = Follower {
        picture: Picture::new(leg, out)?,
        clock: speed.map(Clock::new),
        progress,
        ticks: Ticks::default(),
        events: 0,
        results: 0,
        state: None,
        processor: String::new(),
        last_logged: None,
        report: None,
    };
    let mut piece = [0; PIECE];
    loop {
        match input.read(&mut piece) {
            Ok(0) => break,
            Ok(count) => {
                reader.feed(&piece[..count])?;
                follower.take(reader.trace_mut(), leg)?;
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(ToolError::input(format!("{name}: cannot be read ({error})"))),
        }
    }
    let mut trace = reader.finish(Path::new(&name))?;
    follower.take(&mut trace, leg)?;
    follower.picture.note(Severity::Note, "the source has ended");
    Ok(follower.report)
}

/// Time of a board over its restarts.
#[derive(Clone, Copy, Debug, Default)]
struct Ticks {
    /// Ticks before the last restart, and those that were missed at the beginning.
    before: i64,
    last: Option<u32>,
}

impl Ticks {
    /// Ticks since the first record for a tick of the board, which wraps around after twelve days.
    fn total(&mut self, tick: u32) -> u64 {
        let last = *self.last.get_or_insert_with(|| {
            self.before = -i64::from(tick);
            tick
        });
        if tick < last {
            self.before += i64::from(last) - i64::from(tick);
        }
        self.last = Some(tick);
        (self.before + i64::from(tick)).max(0) as u64
    }
}

struct Follower<'a> {
    picture: Picture<'a>,
    clock: Option<Clock>,
    progress: Box<dyn Progress>,
    ticks: Ticks,
    /// Events and results that were reported.
    events: usize,
    results: usize,
    state: Option<State>,
    /// Load of the board's processor, as last reported.
    processor: String,
    last_logged: Option<u32>,
    report: Option<RunReport>,
}

impl Follower<'_> {
    /// Reports what the trace has received since the last call.
    fn take(&mut self, trace: &mut Trace, leg: &LegFile) -> Result<(), ToolError> {
        for (_, sample) in core::mem::take(&mut trace.log) {
            self.log(&sample);
        }
        for event in &trace.events[self.events.min(trace.events.len())..] {
            self.event(event);
        }
        self.events = trace.events.len();
        let processor = trace.statistics.lines().into_iter().next().unwrap_or_default();
        let is_new = trace.state != self.state;
        if (is_new || processor != self.processor)
            && let Some(state) = trace.state.clone()
        {
            if is_new {
                self.at(state.tick);
            }
            self.processor = processor;
            self.status(&state, trace);
            self.state = Some(state);
        }
        if trace.results.len() > self.results {
            self.results = trace.results.len();
            let report = run_report(trace, leg)?;
            self.picture.conclude(&report);
            self.report = Some(report);
        }
        Ok(())
    }

    /// Sets the time, and waits for it in a file.
    fn at(&mut self, tick: u32) {
        let ticks = self.ticks.total(tick);
        self.picture.time_s = ticks as f64 / f64::from(SERVO_RATE_HZ);
        if let Some(clock) = &mut self.clock {
            clock.wait(ticks);
        }
    }

    fn log(&mut self, log: &Log) {
        let joints = self.picture.anatomy().len();
        if [log.position_rad.len(), log.torque_nm.len(), log.counts.len()] != [joints; 3] {
            return;
        }
        self.at(log.tick);
        let segment = match (log.segment.as_str(), log.motion) {
            ("training", _) => Some(Segment::Training),
            ("validation", motion) => u8::try_from(motion.saturating_sub(1)).ok().map(Segment::Validation),
            ("tracking", _) => Some(Segment::Tracking),
            _ => None,
        };
        let (position_rad, torque_nm) = (log.position_rad.clone(), log.torque_nm.clone());
        let logged = ChainSample { position_rad, torque_nm, segment };
        if self.last_logged.is_some_and(|last| log.tick.wrapping_sub(last) != TICKS_PER_LOG) {
            self.progress.break_off();
            self.picture.restart();
        }
        self.last_logged = Some(log.tick);
        self.picture.learn(&logged, &mut *self.progress);
    }

    fn event(&mut self, event: &Event) {
        let severity = match event.weight {
            Weight::Note => Severity::Note,
            Weight::Warning => Severity::Warning,
            Weight::Fault => Severity::Fault,
        };
        self.picture.note(severity, event.words.as_str());
    }

    fn status(&mut self, state: &State, trace: &Trace) {
        let is_fault = ["fault", "fault_reaction_active"].contains(&state.drive.as_str());
        let fault = trace.faults().last().filter(|_| is_fault).map(|event| event.words.clone());
        let is_enabled = state.drive == "operation_enabled";
        let refused =
            trace.events.iter().rev().find(|event| event.words.starts_with("the drive is NOT enabled"));
        let why = refused.filter(|_| !is_enabled).map(|event| event.words.clone());
        let status = LiveStatus {
            leg: 0,
            time_s: self.picture.time_s,
            run: (self.results as u32 + u32::from(state.activity == "identify")).max(1),
            drive: state.drive.replace('_', " "),
            doing: doing(state),
            waits_for: "the next record of the board".into(),
            left_s: Number::UNKNOWN,
            not_enabled: why.unwrap_or_default(),
            fault: Some(fault.unwrap_or_default()),
            limits: None,
            speed: self.clock.as_ref().map_or(Number::UNKNOWN, |clock| clock.measured),
            processor: self.processor.clone(),
            bus: String::new(),
        };
        self.picture.send(LiveUpdate::Status(status));
    }
}

#[cfg(test)]
mod tests {
    use super::Ticks;

    #[test]
    fn time_goes_on_over_a_restart_and_begins_with_the_first_record() {
        let mut ticks = Ticks::default();
        let found: Vec<u64> =
            [8000, 8008, 12_000, 4, 12, 100].into_iter().map(|tick| ticks.total(tick)).collect();
        assert_eq!(found, [0, 8, 4000, 4000, 4008, 4096]);
    }
}
