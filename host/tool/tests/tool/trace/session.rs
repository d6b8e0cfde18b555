//! Simulated leg that sends records as a board would.

use std::sync::OnceLock;

use scarab::hal::SERVO_RATE_HZ;
use scarab::leg::{Activity, ControlRequest, LoggedSample};
use scarab::model::planar::{BASE, JOINTS};
use scarab::trace::{GRAMMAR, Record, Report, words};
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_rig::options::SimulationOptions;
use scarab_rig::pair;
use scarab_rig::trace::Trace;

type Context = pair::Context<JOINTS, BASE>;
type Pair = pair::Pair<JOINTS, BASE>;

/// Ticks between two records of the search.
const PROGRESS_TICKS: u64 = 100;
/// Limit of an identification, ticks; one takes 53 s.
const LONGEST: u64 = 100 * SERVO_RATE_HZ as u64;

pub fn default_leg() -> LegFile {
    LegFile::load(DEFAULT_LEG).expect("shipped")
}

/// Lines with their record numbers.
#[derive(Default)]
pub struct RecordWriter {
    pub lines: Vec<String>,
}

impl RecordWriter {
    pub fn write(&mut self, record: &Record<JOINTS>) {
        let mut line = String::new();
        record.write(self.lines.len() as u32, &mut line).expect("writing to a string cannot fail");
        self.lines.push(line);
    }

    pub fn boot(&mut self) {
        self.write(&Record::Boot {
            grammar: GRAMMAR,
            version: "0.1.0",
            leg: DEFAULT_LEG,
            joints: JOINTS as u8,
            base: BASE as u8,
            servo_hz: 4000,
            log_hz: 500,
            reset: "power_on",
        });
        self.write(&Record::Board {
            uid0: 0x11,
            uid1: 0x22,
            uid2: 0x33,
            version: 3,
            version_minor: 6,
            version_volt: 56,
            clock_hz: 168_000_000,
            brown_out: 3,
        });
    }

    fn state(&mut self, pair: &Pair) {
        let (activity, phase, motion) = words::activity(pair.leg.control().activity());
        let drive = words::drive(pair.leg.control().state());
        self.write(&Record::State { tick: pair.ticks as u32, drive, activity, phase, motion });
    }

    fn log(&mut self, logged: &LoggedSample<JOINTS>) {
        let (segment, motion) = words::segment(logged.segment);
        let sample = &logged.sample;
        self.write(&Record::Log {
            tick: sample.tick,
            segment,
            motion,
            position_rad: sample.position_rad,
            torque_nm: sample.torque_nm,
            counts: sample.counts_sum,
        });
    }

    fn progress(&mut self, pair: &Pair) {
        if let Some(solver) = pair.leg.identification().solver() {
            self.write(&Record::Progress {
                tick: pair.ticks as u32,
                iterations: solver.search().iterations(),
                evaluations: solver.search().evaluations(),
                excess_chi2: 1.0,
            });
        }
    }

    pub fn loops(&mut self, missed: u32) {
        self.write(&Record::Loops {
            tick: 200_000,
            current_worst: 690,
            servo_worst: 21_000,
            current_missed: 0,
            servo_missed: missed,
            cycles_per_tick: 42_000,
            stack_used: 9_000,
            stack_bytes: 32_768,
            samples_lost: 0,
            records_lost: 0,
        });
    }
}

/// Identifies the leg `simulated`, assumed to be the default one, and returns all records.
fn told_by(simulated: &LegFile, seed: u64) -> Vec<String> {
    let context = Context::new(&default_leg(), &SimulationOptions::with_seed(seed))
        .expect("the default leg is simulated");
    let mut pair = Pair::new(simulated, &context, seed).expect("the firmware accepts the default leg");
    let mut writer = RecordWriter::default();
    writer.boot();
    assert!(pair.enable(context.gravity));
    writer.state(&pair);
    writer.write(&Record::Request { tick: pair.ticks as u32, name: "identify", accepted: true });
    let mut request = Some(ControlRequest::Identify);
    let mut before = Activity::Idle;
    for _ in 0..LONGEST {
        let output = pair.tick(request.take(), context.gravity);
        if let Some(logged) = output.logged.filter(|logged| logged.segment.is_some()) {
            writer.log(&logged);
        }
        let activity = pair.leg.control().activity();
        if activity != before {
            writer.state(&pair);
            before = activity;
            if activity == Activity::Idle {
                break;
            }
        }
        // The search begins while the leg settles.
        let searching = ["settle", "solve"].contains(&words::activity(activity).1);
        if searching && pair.ticks.is_multiple_of(PROGRESS_TICKS) {
            writer.progress(&pair);
        }
    }
    assert!(pair.leg.control().verdict().is_some(), "the identification did not end");
    let mut report = Report::default();
    while let Some(record) = report.advance(pair.leg.identification()) {
        writer.write(&record);
    }
    writer.loops(0);
    writer.lines
}

/// Records of the default leg with seed 1, including the log.
pub fn accepted() -> &'static [String] {
    static LINES: OnceLock<Vec<String>> = OnceLock::new();
    LINES.get_or_init(|| told_by(&default_leg(), 1))
}

/// Records without the log.
pub fn quiet() -> Vec<String> {
    renumbered(accepted().iter().filter(|line| !line.starts_with("log ")))
}

/// Records of a leg whose shank hangs 10 % lower than assumed.
pub fn refused() -> &'static [String] {
    static LINES: OnceLock<Vec<String>> = OnceLock::new();
    LINES.get_or_init(|| {
        let mut leg = default_leg();
        leg.joints[1].dh.a *= 1.1;
        renumbered(told_by(&leg, 1).iter().filter(|line| !line.starts_with("log ")))
    })
}

/// Records renumbered from 0.
pub fn renumbered<'a>(lines: impl Iterator<Item = &'a String>) -> Vec<String> {
    lines.enumerate().map(|(number, line)| with_number(line, number)).collect()
}

fn with_number(line: &str, number: usize) -> String {
    let (kind, rest) = line.split_once(" n=").expect("a record");
    let rest = rest.split_once(' ').map_or("", |(_, rest)| rest);
    format!("{kind} n={number} {rest}")
}

pub fn text(lines: &[String]) -> String {
    lines.join("\n") + "\n"
}

/// Trace read to its end.
pub fn read(lines: &[String]) -> Trace {
    let mut trace = Trace::default();
    lines.iter().for_each(|line| trace.push(line));
    trace.finish();
    trace
}

/// Not a test: `scripts/render-live` draws the page of this trace.
#[test]
#[ignore = "writes the file SCARAB_TRACE_FILE"]
fn trace_for_the_picture() {
    let path = std::env::var("SCARAB_TRACE_FILE").expect("the name of a file");
    std::fs::write(path, text(accepted())).expect("a file");
}
