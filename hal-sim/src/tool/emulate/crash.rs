//! A crash of the emulated board, and what came of it (`cargo emulate --crash`).
//!
//! Two witnesses: the records of the three starts (before the crash, after it, after one more reset), and the emulator's own log of
//! every exception, every write to a timer it does not model (the bridges' are) and every reset, in their order.
//!
//! What has to hold: the drive was enabled and the leg identifying; between the first write that releases a bridge and the reset no
//! exception was taken, so no current loop could switch it on again; the release came within 10 us of emulated time; the next
//! start tells this crash and refuses to enable until the operator resets; the start after that knows nothing of it.

use std::fmt::Write;
use std::path::Path;

use object::{Object, ObjectSymbol};
use scarab::trace::Line;

use crate::tool::error::ToolError;

/// What is to happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum CrashKind {
    /// An index out of range at thread level.
    Panic,
    /// A read where no memory is, in the servo's interrupt.
    HardFault,
    /// A recursion without end at thread level.
    StackOverflow,
    /// An interrupt that nobody handles.
    Interrupt,
}

impl CrashKind {
    /// The word of command line and records.
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

/// Registers with the main outputs, as the emulator's log names them.
const RELEASES: [&str; 2] = ["timer[1]: unimplemented device write", "timer[8]: unimplemented device write"];
const RESET: &str = "CPU Reset";
const EXCEPTION: &str = "Taking exception";
/// Between exception and release, as a share of a second.
const LIMIT_PER_S: u32 = 100_000;

/// What the emulator saw of the crash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Witness {
    /// Both bridges were released.
    pub released: bool,
    /// Exceptions between the first release and the reset.
    pub exceptions: u32,
    /// Resets after that, the crash's own among them.
    pub resets: u32,
}

impl Witness {
    /// Of the emulator's log.
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

/// What came of a crash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CrashReport {
    /// As it was told.
    pub cause: String,
    /// File and line, function, or number of the interrupt.
    pub place: String,
    /// Instructions from before what crashed to both bridges off.
    pub released_after: u32,
    /// And to the complete record.
    pub kept_after: u32,
    /// What was not as it has to be.
    pub complaints: Vec<String>,
}

impl CrashReport {
    /// Of the records as lines, the emulator's log, and the clock when the crash was begun.
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
                "the image started {} times: before the crash, after it and once more were expected",
                starts.len()
            )));
        };
        let [crash] = all(after, "crash")[..] else {
            return Err(ToolError::input("the start after the crash tells none, or more than one"));
        };
        let lacks = |key: &str| ToolError::input(format!("the record of the crash lacks `{key}`"));
        let clock = |key: &'static str| crash.value::<u32>(key).map_err(|_| lacks(key));
        let (released, kept) = (clock("released")?, clock("kept")?);
        let cause = crash.text("cause").map_err(|_| lacks("cause"))?.to_owned();
        let mut report = Self {
            cause,
            place: place(kind, &crash, image)?,
            released_after: released.wrapping_sub(begun),
            kept_after: kept.wrapping_sub(begun),
            complaints: Vec::new(),
        };
        let clock_hz =
            all(after, "board").first().and_then(|board| board.value("clock_hz").ok()).unwrap_or(0);
        let witness = Witness::of(log);
        let expected = [
            (report.cause == kind.name(), "the cause that is told is another"),
            (is_identifying(before), "the leg was not identifying when it crashed"),
            (all(before, "crash").is_empty(), "a crash is told before there was one"),
            (witness.released, "the emulator saw no release of both bridges"),
            (witness.exceptions == 0, "the emulator saw exceptions between release and reset"),
            (witness.resets == 2, "the emulator saw another number of resets than two"),
            (report.released_after < clock_hz / LIMIT_PER_S, "the release took longer than 10 us"),
            (released < kept, "the release came after the record"),
            (is_refused(after), "the drive was not refused before the fault was reset"),
            (is_identifying(after), "the drive was not enabled after the fault was reset"),
            (all(again, "crash").is_empty(), "the crash is told a second time"),
            (is_identifying(again) && !is_refused(again), "the drive is refused without a crash"),
        ];
        let missed = expected.iter().filter(|(held, _)| !held);
        report.complaints = missed.map(|(_, complaint)| (*complaint).to_owned()).collect();
        Ok(report)
    }

    /// Some lines for people.
    #[must_use]
    pub fn lines(&self) -> String {
        let Self { cause, place, released_after, kept_after, complaints } = self;
        let mut text = format!(
            "\n{cause}: {place}\nbridges off {released_after} instructions after it was begun, record complete {kept_after}; no \
             exception was taken between release and reset\n"
        );
        if complaints.is_empty() {
            text += "the next start told it and refused to enable until the fault was reset; the one after that knew nothing of it\n";
        } else {
            text.truncate(text.find("; no exception").unwrap_or(text.len()));
            text.push('\n');
        }
        for complaint in complaints {
            let _ = writeln!(text, "NOT AS IT HAS TO BE: {complaint}");
        }
        text
    }
}

/// The records of each start.
fn starts(records: &str) -> Vec<Vec<Line<'_>>> {
    let mut starts: Vec<Vec<Line<'_>>> = Vec::new();
    for line in records.lines().filter_map(|line| Line::parse(line).ok()) {
        if line.kind() == "boot" {
            starts.push(Vec::new());
        }
        if let Some(start) = starts.last_mut() {
            start.push(line);
        }
    }
    starts
}

fn all<'a>(start: &[Line<'a>], kind: &str) -> Vec<Line<'a>> {
    start.iter().filter(|line| line.kind() == kind).copied().collect()
}

/// In the end the drive was enabled and identified.
fn is_identifying(start: &[Line<'_>]) -> bool {
    all(start, "state").last().is_some_and(|state| {
        state.text("drive") == Ok("operation_enabled") && state.text("activity") == Ok("identify")
    })
}

/// Before anything was enabled it was said why that may not be, and what was asked for was refused.
fn is_refused(start: &[Line<'_>]) -> bool {
    let told = all(start, "refused").iter().any(|refused| refused.text("why") == Ok("crash"));
    let mut until = start.iter().take_while(|line| line.text("drive") != Ok("operation_enabled"));
    told && until.any(|line| line.kind() == "request" && line.text("accepted") == Ok("false"))
}

/// Where it happened.
fn place(kind: CrashKind, crash: &Line<'_>, image: &Path) -> Result<String, ToolError> {
    let text = |key: &'static str| crash.text(key).unwrap_or("?").to_owned();
    let function = |key: &'static str| function(crash.hex(key).unwrap_or(0), image);
    Ok(match kind {
        CrashKind::Panic => format!("{} line {}", text("file"), text("line")),
        CrashKind::HardFault => format!("in {}, address {}", function("pc")?, text("address")),
        CrashKind::StackOverflow => format!("called from {}, address {}", function("lr")?, text("address")),
        CrashKind::Interrupt => format!("number {}", crash.hex("status").unwrap_or(0)),
    })
}

/// The function that an address lies in.
fn function(address: u32, image: &Path) -> Result<String, ToolError> {
    let wrong = |error: &dyn std::fmt::Display| ToolError::input(format!("{}: {error}", image.display()));
    let bytes = std::fs::read(image).map_err(|error| wrong(&error))?;
    let file = object::File::parse(&*bytes).map_err(|error| wrong(&error))?;
    // Of a Thumb function the lowest bit is set, of a return address as well.
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
