//! Evaluates a crash of the emulated board (`cargo emulate --crash`).
//!
//! Two sources: the records of three starts (before the crash, after it, after one more reset), and the
//! emulator's log. The log contains every exception, reset, and write to a timer that the emulator does not
//! model (the bridges' timers), in order.
//!
//! Requirements:
//!
//! - Before the crash the drive was enabled and the leg identifying.
//! - Between the first write that switches a bridge off and the reset no exception was taken, so no current
//!   loop could switch it on again.
//! - The bridges were off within 10 us of emulated time.
//! - The next start reports this crash and refuses to enable until the operator resets.
//! - The start after that no longer reports it.

use std::fmt::Write;
use std::path::Path;

use object::{Object, ObjectSymbol};
use scarab::trace::Line;

use crate::base::error::{FileError, ToolError};
use crate::formats::trace::records::{Crash, Kind, Received};

/// Kind of crash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum CrashKind {
    /// Index out of range at thread level.
    Panic,
    /// Read of unmapped memory in the servo's interrupt.
    HardFault,
    /// Endless recursion at thread level.
    StackOverflow,
    /// Interrupt without a handler.
    Interrupt,
}

impl CrashKind {
    /// Word on the command line and in records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::HardFault => "hard_fault",
            Self::StackOverflow => "stack_overflow",
            Self::Interrupt => "interrupt",
        }
    }
}

/// Registers of the main outputs, as named in the emulator's log.
const RELEASES: [&str; 2] = ["timer[1]: unimplemented device write", "timer[8]: unimplemented device write"];
const RESET: &str = "CPU Reset";
const EXCEPTION: &str = "Taking exception";
/// Limit between exception and outputs off, as a fraction of a second.
const LIMIT_PER_S: u32 = 100_000;

/// Crash as seen by the emulator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Witness {
    /// Whether both bridges were switched off.
    pub released: bool,
    /// Exceptions between the first switch-off and the reset.
    pub exceptions: u32,
    /// Resets after that, including the crash's own.
    pub resets: u32,
}

impl Witness {
    /// Reads the emulator's log.
    #[must_use]
    pub fn of(log: &str) -> Self {
        let mut seen = [false; 2];
        let mut witness = Self::default();
        for line in log.lines() {
            for (seen, release) in seen.iter_mut().zip(RELEASES) {
                *seen |= line.starts_with(release);
            }
            witness.resets += u32::from(seen[0] && line.starts_with(RESET));
            witness.exceptions += u32::from(seen[0] && witness.resets == 0 && line.starts_with(EXCEPTION));
        }
        witness.released = seen == [true; 2];
        witness
    }
}

/// Result of a crash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CrashReport {
    /// Reported cause.
    pub cause: String,
    /// File and line, function, or number of the interrupt.
    pub place: String,
    /// Instructions from just before the crash until both bridges are off.
    pub released_after: u32,
    /// Instructions until the record is complete.
    pub kept_after: u32,
    /// Violated requirements.
    pub complaints: Vec<String>,
}

impl CrashReport {
    /// Evaluates the records as lines, the emulator's log, and the clock at the start of the crash.
    pub fn new(
        kind: CrashKind,
        records: &str,
        log: &str,
        begun: u32,
        image: &Path,
    ) -> Result<Self, ToolError> {
        let starts = starts(records);
        let [before, after, again] = starts.as_slice() else {
            return Err(ToolError::input(format!(
                "the image started {} times; expected are 3: before the crash, after it, and after one more reset",
                starts.len()
            )));
        };
        let [crash] = crashes(after)[..] else {
            return Err(ToolError::input("the start after the crash reports no crash, or more than one"));
        };
        let (Some(released), Some(kept)) = (crash.released, crash.kept) else {
            return Err(ToolError::input("the record of the crash lacks `released` or `kept`"));
        };
        let mut report = Self {
            cause: crash.cause.clone(),
            place: place(kind, crash, image)?,
            released_after: released.wrapping_sub(begun),
            kept_after: kept.wrapping_sub(begun),
            complaints: Vec::new(),
        };
        let clock_hz = after.iter().find_map(|record| match record {
            Received::Board(board) => Some(board.clock_hz),
            _ => None,
        });
        let clock_hz = clock_hz.unwrap_or(0);
        let witness = Witness::of(log);
        let expected = [
            (report.cause == kind.name(), "the reported cause is another"),
            (is_identifying(before), "the leg was not identifying when it crashed"),
            (crashes(before).is_empty(), "a crash is reported before it happened"),
            (witness.released, "the emulator did not log both bridges turning off"),
            (witness.exceptions == 0, "the emulator logged exceptions between bridges off and reset"),
            (witness.resets == 2, "the emulator did not log exactly two resets"),
            (report.released_after < clock_hz / LIMIT_PER_S, "the bridges turned off later than after 10 us"),
            (released < kept, "the bridges turned off after the record"),
            (is_refused(after), "the drive was not refused before the fault was reset"),
            (is_identifying(after), "the drive was not enabled after the fault was reset"),
            (crashes(again).is_empty(), "the crash is reported a second time"),
            (is_identifying(again) && !is_refused(again), "the drive is refused without a crash"),
        ];
        let missed = expected.iter().filter(|(held, _)| !held);
        report.complaints = missed.map(|(_, complaint)| (*complaint).to_owned()).collect();
        Ok(report)
    }

    /// Summary in a few lines.
    #[must_use]
    pub fn lines(&self) -> String {
        let Self { cause, place, released_after, kept_after, complaints } = self;
        let mut text = format!(
            "\n{cause}: {place}\nbridges off {released_after} instructions after it was begun, record complete {kept_after}; no \
             exception was taken between bridges off and reset\n"
        );
        if complaints.is_empty() {
            text += "the next start reported it and refused to enable until the fault was reset; the start after that had no record of it\n";
        } else {
            text.truncate(text.find("; no exception").unwrap_or(text.len()));
            text.push('\n');
        }
        for complaint in complaints {
            let _ = writeln!(text, "FAILED: {complaint}");
        }
        text
    }
}

/// Records of each start.
fn starts(records: &str) -> Vec<Vec<Received>> {
    let mut starts: Vec<Vec<Received>> = Vec::new();
    for line in records.lines().filter_map(|line| Line::parse(line).ok()) {
        let record = Kind::of(line.kind()).and_then(|kind| Received::read(kind, &line).ok());
        if matches!(record, Some(Received::Boot(_))) {
            starts.push(Vec::new());
        }
        if let Some(start) = starts.last_mut() {
            start.extend(record);
        }
    }
    starts
}

fn crashes(start: &[Received]) -> Vec<&Crash> {
    let crashes = start.iter().filter_map(|record| match record {
        Received::Crash(crash) => Some(crash),
        _ => None,
    });
    crashes.collect()
}

/// Whether the drive was enabled and identifying at the end.
fn is_identifying(start: &[Received]) -> bool {
    let state = start.iter().rev().find_map(|record| match record {
        Received::State(state) => Some(state),
        _ => None,
    });
    state.is_some_and(|state| state.drive == "operation_enabled" && state.activity == "identify")
}

/// Whether the inhibit reason was reported before any enabling, and the request refused.
fn is_refused(start: &[Received]) -> bool {
    let reports = |record: &Received| matches!(record, Received::Refused(refused) if refused.why == "crash");
    let enabled =
        |record: &Received| matches!(record, Received::State(state) if state.drive == "operation_enabled");
    let refuses = |record: &Received| matches!(record, Received::Request(request) if !request.accepted);
    start.iter().any(reports) && start.iter().take_while(|record| !enabled(record)).any(refuses)
}

/// Location of the crash.
fn place(kind: CrashKind, crash: &Crash, image: &Path) -> Result<String, ToolError> {
    let Crash { pc, lr, status, address, .. } = crash;
    Ok(match kind {
        CrashKind::Panic => format!("{} line {}", crash.file, crash.line),
        CrashKind::HardFault => format!("in {}, address {address:#x}", function(*pc, image)?),
        CrashKind::StackOverflow => format!("called from {}, address {address:#x}", function(*lr, image)?),
        CrashKind::Interrupt => format!("number {status}"),
    })
}

/// Function that contains an address.
fn function(address: u32, image: &Path) -> Result<String, ToolError> {
    let wrong = |error: &dyn std::fmt::Display| FileError::new(image.display(), error);
    let bytes = std::fs::read(image).map_err(|error| wrong(&error))?;
    let file = object::File::parse(&*bytes).map_err(|error| wrong(&error))?;
    // The lowest bit is set in addresses of Thumb functions and in return addresses.
    let address = u64::from(address & !1);
    let found = file.symbols().find(|symbol| {
        symbol.kind() == object::SymbolKind::Text
            && (symbol.address() & !1..(symbol.address() & !1) + symbol.size()).contains(&address)
    });
    Ok(found.map_or_else(
        || format!("no function ({address:#010x})"),
        |symbol| format!("{:#}", rustc_demangle::demangle(symbol.name().unwrap_or("?"))),
    ))
}
