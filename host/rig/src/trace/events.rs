//! The timeline in words: events in the order in which they were reported.
//!
//! Faults, crashes and refusals have their own weight, because an operator must not overlook them. They are
//! printed before the tables and again behind the verdict.

use scarab::trace::GRAMMAR;

use crate::trace::records::{
    Assist, AxisFault, Board, Boot, Calibration, CalibrationFindings, Change, Crash, Fault, GateDriver,
    Limit, NotEnabled, Received, Refused, Request, State, Update,
};

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
    pub(crate) time_s: Option<f64>,
    /// Severity.
    pub weight: Weight,
    /// Description.
    pub words: String,
}

impl Event {
    /// One line of the timeline.
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

/// Event of a record; `None` for kinds that do not belong to the timeline.
pub(crate) fn from_record(record: &Received, servo_hz: f64) -> Option<Event> {
    let at = |tick: u32| Some(f64::from(tick) / servo_hz);
    let (time_s, weight, words) = match record {
        Received::Boot(boot) => {
            let (weight, words) = start(boot);
            (None, weight, words)
        }
        Received::Board(found) => (None, Weight::Note, board(found)),
        Received::Crash(crash) => (None, Weight::Fault, crashed(crash)),
        Received::Refused(Refused { why, value }) => {
            (None, Weight::Fault, format!("the drive may not be enabled: {} ({value:#x})", spaced(why)))
        }
        Received::GateDriver(GateDriver { joint, status, .. }) => {
            (None, Weight::Fault, format!("gate driver of {}: status {status:#010x}", location(*joint)))
        }
        Received::State(state) => {
            let stopped = ["fault", "fault_reaction_active"].contains(&state.drive.as_str());
            let weight = if stopped { Weight::Warning } else { Weight::Note };
            (at(state.tick), weight, doing(state))
        }
        Received::Request(Request { tick, name, accepted }) => {
            let weight = if *accepted { Weight::Note } else { Weight::Warning };
            let answer = if *accepted { "accepted" } else { "REFUSED" };
            (at(*tick), weight, format!("the operator asks: {}, {answer}", spaced(name)))
        }
        Received::Assist(Assist { tick, event, why }) => {
            (at(*tick), Weight::Warning, format!("assistance {event}: {}", spaced(why)))
        }
        Received::NotEnabled(NotEnabled { tick, joint, why }) => {
            let words = format!("the drive is NOT enabled: {}, {}", location(*joint), spaced(why));
            (at(*tick), Weight::Warning, words)
        }
        Received::Fault(Fault { tick, code, name, joint }) => {
            (at(*tick), Weight::Fault, format!("FAULT {code:#06x} {}: {}", spaced(name), location(*joint)))
        }
        Received::Limit(Limit { tick, name, joint, .. }) => {
            (at(*tick), Weight::Note, format!("LIMIT {}: {}", spaced(name), location(*joint)))
        }
        Received::AxisFault(AxisFault { tick, joint, name }) => {
            (at(*tick), Weight::Fault, format!("FAULT of the axis, {}: {}", spaced(name), location(*joint)))
        }
        Received::Calibration(calibration) => {
            let (weight, words) = calibrated(calibration);
            (None, weight, words)
        }
        Received::CalibrationFindings(found) => (None, Weight::Note, findings(found)),
        Received::Change(change) => (None, Weight::Warning, changed(change)),
        Received::Update(update) => (None, Weight::Note, updated(update)),
        _ => return None,
    };
    Some(Event { time_s, weight, words })
}

fn start(boot: &Boot) -> (Weight, String) {
    let newer = if boot.grammar > usize::from(GRAMMAR) {
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
    (if newer.is_empty() { Weight::Note } else { Weight::Warning }, words)
}

/// Description of the board.
pub fn board(board: &Board) -> String {
    let version = if board.version == usize::from(u8::MAX) {
        "version not burnt in".into()
    } else {
        format!("v{}.{}-{}V", board.version, board.version_minor, board.version_volt)
    };
    let brown_out = match board.brown_out {
        None => String::new(),
        Some(0) => ", brown-out reset off".into(),
        Some(level) => format!(", brown-out reset level {level}"),
    };
    format!(
        "board {:08x}{:08x}{:08x}, {version}, {} MHz{brown_out}",
        board.uid2,
        board.uid1,
        board.uid0,
        f64::from(board.clock_hz) / 1e6
    )
}

fn crashed(crash: &Crash) -> String {
    let location =
        if crash.file == "-" { String::new() } else { format!(" in {} line {}", crash.file, crash.line) };
    let address = match crash.address {
        u32::MAX => String::new(),
        address => format!(", address {address:#010x}"),
    };
    let kept = crash.released.zip(crash.kept).map_or_else(String::new, |(released, kept)| {
        format!("; bridges off {} cycles before the record was complete", kept.wrapping_sub(released))
    });
    // Zero means unknown: a panic has its file and line instead.
    let known = |words: &str, value: u32| match value {
        0 => String::new(),
        known => format!(", {words} {known:#010x}"),
    };
    format!(
        "the image CRASHED before this start: {}{location}{}{}{}{address}{kept}",
        spaced(&crash.cause),
        known("at", crash.pc),
        known("called from", crash.lr),
        known("status", crash.status)
    )
}

/// Description of the leg's activity.
pub fn doing(state: &State) -> String {
    let phase = if state.phase == "-" { String::new() } else { format!(", {}", spaced(&state.phase)) };
    let motion = if state.motion == 0 { String::new() } else { format!(" {}", state.motion) };
    format!("drive {}; {}{phase}{motion}", spaced(&state.drive), spaced(&state.activity))
}

fn calibrated(found: &Calibration) -> (Weight, String) {
    let (joint, number) = (found.joint, found.number);
    if !matches!(found.result.as_str(), "done" | "confirmed") {
        let number = if number == 0 { String::new() } else { format!(" ({number})") };
        return (
            Weight::Warning,
            format!(
                "calibration of joint {joint} REFUSED: {}{number}{}",
                spaced(&found.result),
                values(found)
            ),
        );
    }
    let words = format!(
        "calibration of joint {joint} {}: R {:.4} ohm, L {:.1} and {:.1} uH, offset {:.4} turns, shunts at {:.1} and {:.1}",
        if found.result == "done" { "done" } else { "confirmed at standstill" },
        found.resistance_ohm,
        1e6 * f64::from(found.direct_h),
        1e6 * f64::from(found.quadrature_h),
        found.offset_turns,
        found.zero_b,
        found.zero_c
    );
    (Weight::Note, words)
}

/// Both values of a contradiction; empty without one, and for traces of older images.
fn values(refused: &Calibration) -> String {
    match (refused.stated, refused.found) {
        (Some(stated), Some(found)) if found.is_finite() => format!(", stated {stated}, found {found}"),
        _ => String::new(),
    }
}

fn findings(found: &CalibrationFindings) -> String {
    format!(
        "calibration of joint {}: flux {:.4} +- {:.4} mWb, friction {:.2} +- {:.2} A, load {:.2} A; sigma of \
         R {:.1e} ohm, of L {:.1} and {:.1} uH, of the offset {:.1e} turns",
        found.joint,
        1e3 * found.flux_wb,
        1e3 * found.flux_sigma_wb,
        found.friction_a,
        found.friction_sigma_a,
        found.load_a,
        found.resistance_sigma_ohm,
        1e6 * found.direct_sigma_h,
        1e6 * found.quadrature_sigma_h,
        found.offset_sigma_turns
    )
}

fn changed(change: &Change) -> String {
    let named = change.joints.iter().enumerate().filter(|(_, shows)| **shows);
    let named: Vec<String> = named.map(|(joint, _)| (joint + 1).to_string()).collect();
    format!("the model no longer fits since {:.1} s, joints {}", change.since_s, named.join(", "))
}

fn updated(update: &Update) -> String {
    let location = match update.link {
        0 => String::new(),
        link => format!(" on link {link}"),
    };
    let offered = if update.offered { ", a new model is offered" } else { ", the old model stays" };
    format!("the change was taken for: {}{location}; {}{offered}", spaced(&update.cause), update.verdict)
}

fn location(joint: usize) -> String {
    match joint {
        0 => "the board".into(),
        joint => format!("joint {joint}"),
    }
}

/// Replaces the underscores of a word by spaces.
fn spaced(word: &str) -> String {
    word.replace('_', " ")
}
