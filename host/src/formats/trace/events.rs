//! The timeline in words: events in the order in which they were reported.
//!
//! Faults, crashes and refusals have their own weight, because an operator must not overlook them. They are
//! printed before the tables and again behind the verdict.

use scarab::trace::{GRAMMAR, Line, LineError};

use crate::formats::trace::fields::{Board, Boot, State, hex, list, text, value};

/// Severity of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// Information only.
    Note,
    /// Something was refused, lost or out of order.
    Warning,
    /// The drive stopped, or must not be enabled.
    Fault,
}

/// One event of the timeline.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Time since the start, s; unknown for records without a tick.
    pub time_s: Option<f64>,
    /// Severity.
    pub weight: Weight,
    /// Description.
    pub words: String,
}

impl Event {
    /// One line of the timeline.
    #[must_use]
    pub fn line(&self) -> String {
        let time = self.time_s.map_or_else(|| format!("{:>10}", ""), |time| format!("{time:10.3}"));
        let mark = match self.weight {
            Weight::Note => "  ",
            Weight::Warning => "! ",
            Weight::Fault => "!!",
        };
        format!("{time} s {mark} {}", self.words).replacen(
            &format!("{:>10} s", ""),
            &format!("{:>12}", ""),
            1,
        )
    }
}

type Read<T> = Result<T, LineError<'static>>;

/// Event of a record; `None` for kinds that do not belong to the timeline.
///
/// # Errors
/// A key is missing or a value is invalid.
pub fn of(line: &Line<'_>, servo_hz: f64) -> Read<Option<Event>> {
    let tick = || -> Read<Option<f64>> { Ok(Some(f64::from(value::<u32>(line, "tick")?) / servo_hz)) };
    let event = |time_s, weight, words| Ok(Some(Event { time_s, weight, words }));
    match line.kind() {
        "boot" => boot(line),
        "board" => event(None, Weight::Note, board(&Board::read(line)?)),
        "crash" => event(None, Weight::Fault, crash(line)?),
        "refused" => {
            let words = format!(
                "the drive may not be enabled: {} ({:#x})",
                spaced(&text(line, "why")?),
                hex(line, "value")?
            );
            event(None, Weight::Fault, words)
        }
        "gate_driver" => {
            let status: u32 = hex(line, "status")?;
            event(None, Weight::Fault, format!("gate driver of {}: status {status:#010x}", joint(line)?))
        }
        "state" => {
            let state = State::read(line)?;
            let stopped = ["fault", "fault_reaction_active"].contains(&state.drive.as_str());
            let weight = if stopped { Weight::Warning } else { Weight::Note };
            event(tick()?, weight, doing(&state))
        }
        "request" => {
            let (name, accepted) = (text(line, "name")?, value::<bool>(line, "accepted")?);
            let weight = if accepted { Weight::Note } else { Weight::Warning };
            let answer = if accepted { "accepted" } else { "REFUSED" };
            event(tick()?, weight, format!("the operator asks: {}, {answer}", spaced(&name)))
        }
        "not_enabled" => {
            let words =
                format!("the drive is NOT enabled: {}, {}", joint(line)?, spaced(&text(line, "why")?));
            event(tick()?, Weight::Warning, words)
        }
        "fault" => {
            let (name, code) = (text(line, "name")?, hex(line, "code")?);
            event(tick()?, Weight::Fault, format!("FAULT {code:#06x} {}: {}", spaced(&name), joint(line)?))
        }
        "limit" => {
            let words = format!("LIMIT {}: {}", spaced(&text(line, "name")?), joint(line)?);
            event(tick()?, Weight::Note, words)
        }
        "axis_fault" => {
            let words = format!("FAULT of the axis, {}: {}", spaced(&text(line, "name")?), joint(line)?);
            event(tick()?, Weight::Fault, words)
        }
        "calibration" => calibration(line),
        "change" => change(line),
        "update" => update(line),
        _ => Ok(None),
    }
}

fn boot(line: &Line<'_>) -> Read<Option<Event>> {
    let boot = Boot::read(line)?;
    let newer = if boot.grammar > GRAMMAR {
        format!("; its records are of version {}, this program knows {GRAMMAR}", boot.grammar)
    } else {
        String::new()
    };
    let words = format!(
        "start ({}): scarab {}, leg {}, {} joints, {} base parameters{newer}",
        spaced(&boot.reset),
        boot.version,
        boot.leg,
        boot.joints,
        boot.base
    );
    let weight = if newer.is_empty() { Weight::Note } else { Weight::Warning };
    Ok(Some(Event { time_s: None, weight, words }))
}

/// Description of the board.
#[must_use]
pub fn board(board: &Board) -> String {
    if is_emulated(board) {
        return format!("emulated board, {} MHz", f64::from(board.clock_hz) / 1e6);
    }
    let version = if board.version == u8::MAX {
        "version not burnt in".into()
    } else {
        format!("v{}.{}-{}V", board.version, board.version_minor, board.version_volt)
    };
    format!(
        "board {:08x}{:08x}{:08x}, {version}, {} MHz",
        board.uid2,
        board.uid1,
        board.uid0,
        f64::from(board.clock_hz) / 1e6
    )
}

/// Returns whether the board is emulated; then its plant is that of the leg file and the truth is known.
#[must_use]
pub fn is_emulated(board: &Board) -> bool {
    (board.uid0, board.uid1, board.uid2) == (0, 0, 0)
}

fn crash(line: &Line<'_>) -> Read<String> {
    let (file, source) = (text(line, "file")?, value::<u32>(line, "line")?);
    let place = if file == "-" { String::new() } else { format!(" in {file} line {source}") };
    let address = match hex(line, "address")? {
        u32::MAX => String::new(),
        address => format!(", address {address:#010x}"),
    };
    // Older images do not send these keys.
    let clock = |key| value::<u32>(line, key);
    let kept = match (clock("released"), clock("kept")) {
        (Ok(released), Ok(kept)) => {
            format!("; bridges off {} cycles before the record was complete", kept.wrapping_sub(released))
        }
        _ => String::new(),
    };
    // Zero means unknown; a panic has its file and line instead.
    let known = |words: &str, key| match hex(line, key)? {
        0 => Read::Ok(String::new()),
        known => Ok(format!(", {words} {known:#010x}")),
    };
    Ok(format!(
        "the image CRASHED before this start: {}{place}{}{}{}{address}{kept}",
        spaced(&text(line, "cause")?),
        known("at", "pc")?,
        known("called from", "lr")?,
        known("status", "status")?
    ))
}

/// Description of the leg's activity.
#[must_use]
pub fn doing(state: &State) -> String {
    let phase = if state.phase == "-" { String::new() } else { format!(", {}", spaced(&state.phase)) };
    let motion = if state.motion == 0 { String::new() } else { format!(" {}", state.motion) };
    format!("drive {}; {}{phase}{motion}", spaced(&state.drive), spaced(&state.activity))
}

fn calibration(line: &Line<'_>) -> Read<Option<Event>> {
    let (result, number) = (text(line, "result")?, value::<u32>(line, "number")?);
    let joint = value::<usize>(line, "joint")?;
    if result != "done" {
        let number = if number == 0 { String::new() } else { format!(" ({number})") };
        let words = format!("calibration of joint {joint} REFUSED: {}{number}", spaced(&result));
        return Ok(Some(Event { time_s: None, weight: Weight::Warning, words }));
    }
    let number = |key| value::<f64>(line, key);
    let words = format!(
        "calibration of joint {joint} done: R {:.4} ohm, L {:.1} and {:.1} uH, offset {:.4} turns, shunts at {:.1} and {:.1}",
        number("resistance_ohm")?,
        1e6 * number("direct_h")?,
        1e6 * number("quadrature_h")?,
        number("offset_turns")?,
        number("zero_b")?,
        number("zero_c")?
    );
    Ok(Some(Event { time_s: None, weight: Weight::Note, words }))
}

fn change(line: &Line<'_>) -> Read<Option<Event>> {
    let joints: Vec<bool> = list(line, "joints")?;
    let named = joints.iter().enumerate().filter(|(_, shows)| **shows);
    let named: Vec<String> = named.map(|(joint, _)| (joint + 1).to_string()).collect();
    let words = format!(
        "the model no longer fits since {:.1} s, joints {}",
        value::<f64>(line, "since_s")?,
        named.join(", ")
    );
    Ok(Some(Event { time_s: None, weight: Weight::Warning, words }))
}

fn update(line: &Line<'_>) -> Read<Option<Event>> {
    let (cause, verdict) = (text(line, "cause")?, text(line, "verdict")?);
    let place = match value::<u8>(line, "link")? {
        0 => String::new(),
        link => format!(" on link {link}"),
    };
    let offered =
        if value::<bool>(line, "offered")? { ", a new model is offered" } else { ", the old model stays" };
    let words = format!("the change was taken for: {}{place}; {verdict}{offered}", spaced(&cause));
    Ok(Some(Event { time_s: None, weight: Weight::Note, words }))
}

fn joint(line: &Line<'_>) -> Read<String> {
    Ok(match value::<usize>(line, "joint")? {
        0 => "the board".into(),
        joint => format!("joint {joint}"),
    })
}

/// Replaces the underscores of a word by spaces.
fn spaced(word: &str) -> String {
    word.replace('_', " ")
}
