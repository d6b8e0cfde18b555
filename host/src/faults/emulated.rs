//! Rows that require a processor, run on the emulated one: K2, K4, M1.
//!
//! | row | run | requirement |
//! | --- | --- | --- |
//! | K2 | whole identification, the search at the lowest priority | no missed tick, no lost sample |
//! | K4 | identification that ends in a panic, a hard fault, an unhandled interrupt | [`CrashReport`] |
//! | M1 | identification that ends in a stack overflow | [`CrashReport`] |
//!
//! One crash run takes three starts and some seconds, the whole identification about a minute. So the number
//! of runs is limited ([`MOST`]). The seed selects the tick of the crash. Times count instructions, 8 ns
//! each.

use std::path::{Path, PathBuf};

use crate::base::error::{FileError, ToolError};
use crate::base::random::Random;
use crate::faults::run::Outcome;
use crate::faults::scenario::Head;
use crate::formats::leg_file::LegFile;
use crate::image::emulate::crash::{CrashKind, CrashReport};
use crate::image::emulate::run::{build, crash, is_there, run};
use crate::leg::setup::DEFAULT_SEED;
use crate::run::trace::run as reading;

/// Largest number of runs of K2, K4 and M1.
pub const MOST: [u64; 3] = [1, 6, 2];

/// Range of servo ticks at which an image crashes: the approach, and the excitation after it. Later crashes
/// only take longer.
const TICKS: [u64; 2] = [1_000, 9_000];
const MS_PER_INSTRUCTION: f64 = 8e-6;

const SEARCH: Head = Head {
    id: "K2",
    fault: "search and log beside control, emulated",
    detector: "ticks and samples counted",
    state: "-",
    deadline_ms: f64::INFINITY,
    unit: "",
    codes: &[],
    lacking: Some("the processor's own time: the emulator counts instructions"),
};

const CRASH: Head = Head {
    id: "K4",
    fault: "panic, hard fault, unhandled interrupt, emulated",
    detector: "crash handler",
    state: "Off, reset",
    deadline_ms: 0.01,
    unit: "",
    codes: &[],
    lacking: Some("effect of the register writes on the bridges: the emulator only logs them"),
};

const OVERFLOW: Head = Head {
    id: "M1",
    fault: "stack overflow, emulated",
    detector: "layout that faults; crash handler",
    state: "Off, reset",
    ..CRASH
};

/// Descriptions of the rows, in the catalogue's order.
pub static HEADS: [Head; 3] = [SEARCH, CRASH, OVERFLOW];

/// Seeds of a row, up to its largest number.
#[must_use]
pub fn emulated_seeds<'a>(head: &Head, seeds: &'a [u64]) -> &'a [u64] {
    let most = HEADS.iter().position(|other| other.id == head.id).map_or(0, |place| MOST[place]);
    &seeds[..seeds.len().min(most as usize)]
}

/// Runs one row for these seeds; `None` without an emulator.
pub fn emulated(head: &Head, leg: &LegFile, seeds: &[u64]) -> Result<Option<Vec<Outcome>>, ToolError> {
    if !is_there() {
        return Ok(None);
    }
    if seeds.is_empty() {
        return Ok(Some(Vec::new()));
    }
    let image = build(leg, DEFAULT_SEED, false)?;
    let one = |seed: &u64| match head.id {
        "K2" => identified(head, &image, *seed),
        _ => crashed(head, &image, *seed),
    };
    seeds.iter().map(one).collect::<Result<_, _>>().map(Some)
}

fn beside(image: &Path, what: &str) -> PathBuf {
    image.with_extension(format!("faults.{what}"))
}

fn identified(head: &Head, image: &Path, seed: u64) -> Result<Outcome, ToolError> {
    let path = beside(image, "trace");
    run(image, &path)?;
    let trace = reading::read(&path, Some(image), None)?;
    let loops = trace.statistics.loops();
    let held = loops
        .as_ref()
        .is_some_and(|loops| loops.current_missed + loops.servo_missed == 0 && loops.samples_lost == 0);
    Ok(outcome(head, seed, held.then_some("-")))
}

fn crashed(head: &Head, image: &Path, seed: u64) -> Result<Outcome, ToolError> {
    let mut random = Random::new(head.id, seed);
    let kind = match (head.id, seed % 3) {
        ("M1", _) => CrashKind::StackOverflow,
        (_, 0) => CrashKind::Interrupt,
        (_, 1) => CrashKind::Panic,
        _ => CrashKind::HardFault,
    };
    let [first, last] = TICKS;
    let tick = first + random.below(last - first);
    let [trace, log, lines] = ["trace", "log", "txt"].map(|what| beside(image, what));
    let begun = crash(image, &trace, &log, kind, tick as u32)?;
    reading::read(&trace, Some(image), Some(&lines))?;
    let text = |path: &Path| {
        let bytes = std::fs::read(path);
        let bytes = bytes.map_err(|error| FileError::unreadable(path, &error))?;
        Ok::<_, ToolError>(String::from_utf8_lossy(&bytes).into_owned())
    };
    let report = CrashReport::new(kind, &text(&lines)?, &text(&log)?, begun, image)?;
    for file in [trace, log, lines] {
        let _ = std::fs::remove_file(file);
    }
    let mut found = outcome(head, seed, report.complaints.is_empty().then_some("Off"));
    found.period = 6 * tick;
    found.after_ms = Some(f64::from(report.released_after) * MS_PER_INSTRUCTION);
    found.broken = report.complaints;
    Ok(found)
}

fn outcome(head: &Head, seed: u64, state: Option<&'static str>) -> Outcome {
    crate::faults::bench::outcome(head, seed, state)
}
