//! Crashes of the image: both bridges are off before the record is written, then a reset, then a refusal.
//!
//! Each crash starts from a saved machine that is enabled: holding its pose, or in the motion of an
//! identification. Its instant is the worst that the kind allows: a current tick falls due while the crash is
//! handled, or comes just before an overflow, which it would otherwise begin. The processor then runs block
//! by block, so that every store to the crash record has its time.
//!
//! | crash | injected |
//! | --- | --- |
//! | panic | the thread continues at one of the image's own branches to a panic |
//! | hard fault | the servo continues at a load, with an address without memory |
//! | stack overflow | the used part of the stack moves to its end |
//! | interrupt | number 49 (SDIO, RM0090 table 62), for which the image has no handler |

use std::ops::Range;

use scarab_base::error::ToolError;
use scarab_boot::Region;
use scarab_rig::image::panics::Panics;
use serde::Serialize;

use crate::load::{CURRENT_INTERRUPT, SERVO};
use crate::machine::{End, RAM};
use crate::peripherals::rcc::ResetReason;
use crate::plant::{Reaction, STEP};
use crate::rtt::field;
use crate::session::Session;
use crate::system::fault;
use crate::time::{FULL_SPEED, Ticks, microseconds, ticks};

/// Kinds, as the records name them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrashKind {
    /// Rust panic at thread level.
    Panic,
    /// Load from an address without memory, in the servo's interrupt.
    HardFault,
    /// The stack leaves its memory; so many bytes are left before.
    StackOverflow(u32),
    /// Interrupt without a handler.
    Interrupt,
}

impl CrashKind {
    const fn name(self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::HardFault => "hard_fault",
            Self::StackOverflow(_) => "stack_overflow",
            Self::Interrupt => "interrupt",
        }
    }

    /// Time from the crash to the next current tick.
    fn before_tick(self) -> Range<Ticks> {
        match self {
            Self::StackOverflow(_) => ticks(10e-6)..ticks(19e-6),
            _ => ticks(0.1e-6)..ticks(0.6e-6),
        }
    }
}

const KINDS: [CrashKind; 4] =
    [CrashKind::Panic, CrashKind::HardFault, CrashKind::StackOverflow(0), CrashKind::Interrupt];
/// Crash record of the image.
const RECORD: &str = "board::crash::RECORD";
/// The instruction `ldr r0, [r0]`, and an address without memory.
const LOAD: u16 = 0x6800;
const NOWHERE: u32 = 0x3000_0000;
const UNHANDLED: u32 = 49;
/// Offsets of the registers that enable and request interrupts 32 to 63.
const ENABLES: u32 = 0xE104;
const REQUESTS: u32 = 0xE204;
/// Bytes below the stack that the call or entry beyond its end may touch.
const BEYOND: u32 = 0x800;
/// Longest time until both bridges are off, us (docs/safety.md, K4 and M1).
const LONGEST_US: f64 = 10.0;
/// Longest search for an instant, and longest time from a crash to its reset, s.
const SEARCHED_S: f64 = 1.0;
const RESET_S: f64 = 2e-3;

/// What a crash shows; times in ticks.
#[derive(Clone, Debug, Default)]
struct Seen {
    begun: Ticks,
    /// Processor cycles at the beginning, as the image counts them.
    cycles: u32,
    /// The next current tick.
    tick: Ticks,
    released: Option<Ticks>,
    on_again: bool,
    /// First and last store to the crash record.
    stored: Option<[Ticks; 2]>,
    reset: Option<(Ticks, ResetReason)>,
    /// Crash as the next start reports it, and place that is expected in it.
    record: String,
    expected: Vec<String>,
}

/// Result of a crash.
#[derive(Clone, Debug, Serialize)]
pub struct CrashReport {
    pub kind: &'static str,
    pub situation: &'static str,
    /// Time until both bridges were off, us; `None` if they stayed on.
    pub released_us: Option<f64>,
    /// Times of the first and the last store to the record, us.
    pub stored_us: Option<[f64; 2]>,
    pub reset_us: Option<f64>,
    /// Crash as the next start reports it.
    pub record: String,
    /// Violated requirements.
    pub complaints: Vec<String>,
}

/// Lets the image crash in every way, from a session that is enabled.
///
/// # Errors
/// The image lacks a symbol, or does not come to an instant that is searched.
pub fn run(session: &mut Session) -> Result<Vec<CrashReport>, ToolError> {
    let enabled = session.machine.save()?;
    session.press_start()?;
    session.run(6.0)?;
    let moving = session.machine.save()?;
    let mut reports = Vec::new();
    for (situation, saved) in [("holding", &enabled), ("identifying", &moving)] {
        for kind in KINDS {
            session.machine.restore(saved)?;
            let mut report = crash(session, kind)?;
            report.situation = situation;
            if report.reset_us.is_some() {
                report.complaints.extend(refusal(session)?);
            }
            reports.push(report);
        }
    }
    Ok(reports)
}

/// Lets an enabled image crash and runs until the next start has reported it.
///
/// # Errors
/// The image lacks a symbol, or does not come to an instant that is searched.
pub fn crash(session: &mut Session, kind: CrashKind) -> Result<CrashReport, ToolError> {
    let record = session.machine.image().variable(RECORD)?;
    let mut seen = Seen { tick: reach(session, kind)?, begun: session.now(), ..Seen::default() };
    let chip = session.chip_mut();
    let mut reaction = Reaction::new(&chip.plant);
    seen.cycles = chip.debug.cycles(chip.now);
    chip.plant.switchings.clear();
    chip.hard_fault = None;
    seen.expected = inject(session, kind)?;
    let injected = seen.begun;
    let end = injected + ticks(RESET_S);
    run_to_reset(session, record, end, &mut seen)?;
    if matches!(kind, CrashKind::StackOverflow(_)) {
        let fault = session.chip().hard_fault;
        seen.begun = fault.ok_or_else(|| ToolError::input("the stack did not overflow"))?;
        seen.cycles += ((seen.begun - injected) / FULL_SPEED) as u32;
    }
    let reset = seen.reset.map_or(end, |(at, _)| at);
    let switchings = core::mem::take(&mut session.chip_mut().plant.switchings);
    reaction.follow(switchings.iter().filter(|switching| switching.at < reset));
    (seen.released, seen.on_again) = (reaction.released, reaction.on_again);
    session.hold_switch(false);
    let records = session.probe.lines.len();
    if seen.reset.is_some() {
        session.boot()?;
    }
    seen.record = session.probe.find(records, "crash", &[]).unwrap_or_default().to_owned();
    let mut complaints = judge(kind, &seen);
    if session.probe.find(records, "refused", &["why=crash"]).is_none() {
        complaints.push("the next start does not name the crash as a reason to refuse".into());
    }
    if session.chip().plant.switchings.iter().any(|switching| switching.on) {
        complaints.push("a bridge was on after the next start".into());
    }
    let since = |at: Ticks| microseconds(at.saturating_sub(seen.begun));
    Ok(CrashReport {
        kind: kind.name(),
        situation: "",
        released_us: seen.released.map(since),
        stored_us: seen.stored.map(|stored| stored.map(since)),
        reset_us: seen.reset.map(|(at, _)| since(at)),
        record: seen.record,
        complaints,
    })
}

/// Runs to the reset, or until `end`, and notes the stores to the crash record, at an address and of a size.
fn run_to_reset(
    session: &mut Session,
    (address, size): (u32, u32),
    end: Ticks,
    seen: &mut Seen,
) -> Result<(), ToolError> {
    let mut before = vec![0; size as usize];
    session.machine.memory(address, &mut before);
    let mut content = before.clone();
    while seen.reset.is_none() && session.now() < end {
        // To the end of a block.
        let ended = session.machine.run(session.now() + 1)?;
        let now = session.now();
        session.machine.memory(address, &mut content);
        if content != before {
            seen.stored = Some([seen.stored.map_or(now, |[first, _]| first), now]);
            before.clone_from(&content);
        }
        if let End::Reset(reason) = ended {
            seen.reset = Some((now, reason));
            session.resets.push(reason);
        }
    }
    Ok(())
}

/// Runs to an instant of the kind's level before a current tick; returns the tick's time.
fn reach(session: &mut Session, kind: CrashKind) -> Result<Ticks, ToolError> {
    let end = session.now() + ticks(SEARCHED_S);
    let level = if kind == CrashKind::HardFault { SERVO } else { 0 };
    while session.now() < end {
        // Ticks of both axes come half a period apart.
        let last = session.chip().nvic.pended[usize::from(CURRENT_INTERRUPT)];
        let due = last + STEP / 2;
        let Range { start, end } = kind.before_tick();
        session.run_until(due.saturating_sub(end).max(session.now()))?;
        while session.now() + start < due {
            let chip = session.chip();
            let awake = kind == CrashKind::Interrupt || !session.machine.is_asleep();
            let is_armed = chip.plant.axes.iter().all(|axis| axis.is_armed);
            if chip.nvic.current() == level && awake && session.now() + end >= due && is_armed {
                return Ok(due);
            }
            session.machine.run(session.now() + 1)?;
        }
        let after = (due + ticks(0.3e-6)).max(session.now() + 1);
        session.machine.run(after)?;
    }
    Err(ToolError::input(format!("no instant for the crash `{}` within {SEARCHED_S} s", kind.name())))
}

/// Begins the crash; returns the fields that its record must have.
fn inject(session: &mut Session, kind: CrashKind) -> Result<Vec<String>, ToolError> {
    let machine = &mut session.machine;
    Ok(match kind {
        CrashKind::Panic => {
            let panics = Panics::parse(&machine.image().elf, &"the image")?;
            let own = panics.all.iter().find(|site| site.file.starts_with("src/"));
            let site = own.ok_or_else(|| ToolError::input("the image has no panic of its own"))?;
            machine.jump(site.address, None);
            vec![
                format!("file={}", &site.file[site.file.len().saturating_sub(40)..]),
                format!("line={}", site.line),
            ]
        }
        CrashKind::HardFault => {
            let image = Region::IMAGE.address..Region::IMAGE.address + Region::IMAGE.bytes();
            let load = machine.image().find(LOAD).into_iter().find(|address| image.contains(address));
            let load = load.ok_or_else(|| ToolError::input("the image has no such load"))?;
            machine.jump(load, Some(NOWHERE));
            vec![format!("pc={load:#x}"), format!("address={NOWHERE:#x}")]
        }
        CrashKind::StackOverflow(left) => {
            machine.use_up_stack(left);
            Vec::new()
        }
        CrashKind::Interrupt => {
            let chip = machine.chip_mut();
            for register in [REQUESTS, ENABLES] {
                chip.write_private(register, 4, 1 << (UNHANDLED - 32));
            }
            vec![format!("status={UNHANDLED:#x}")]
        }
    })
}

/// Violated requirements of a crash, its next start's report included.
fn judge(kind: CrashKind, seen: &Seen) -> Vec<String> {
    let number = |key: &str| {
        let value = field(&seen.record, key)?;
        match value.strip_prefix("0x") {
            Some(digits) => u32::from_str_radix(digits, 16).ok(),
            None => value.parse().ok(),
        }
    };
    let cycles = |key: &str| number(key).map(|count| count.wrapping_sub(seen.cycles));
    let released = seen.released.unwrap_or(Ticks::MAX);
    let reset = seen.reset.map_or(0, |(at, _)| at);
    let [first, last] = seen.stored.unwrap_or([0; 2]);
    let is_due = matches!(kind, CrashKind::StackOverflow(_)) || (seen.begun..reset).contains(&seen.tick);
    let clocks = cycles("released").zip(cycles("kept")).is_some_and(|(released, kept)| {
        released <= kept && Ticks::from(kept) * FULL_SPEED <= reset.saturating_sub(seen.begun)
    });
    let is_beyond = |address: u32| (RAM - BEYOND..RAM).contains(&address);
    // The entry of an interrupt that does not fit leaves no address.
    let is_of_entry = number("status").is_some_and(|status| status & fault::STACKING != 0);
    let is_located = match kind {
        CrashKind::StackOverflow(_) => {
            number("address").is_some_and(|address| is_beyond(address) || address == u32::MAX && is_of_entry)
        }
        _ => seen.expected.iter().all(|word| seen.record.split(' ').any(|field| field == word)),
    };
    let expected = [
        (
            microseconds(released.saturating_sub(seen.begun)) <= LONGEST_US,
            "bridges off later than after 10 us",
        ),
        (!seen.on_again, "a bridge was on again before the reset"),
        (released < first && first < last, "the record was written before the bridges were off"),
        (last <= reset, "no reset after the record"),
        (
            seen.reset.is_some_and(|(_, reason)| reason == ResetReason::Software),
            "the reset is not the crash's",
        ),
        (is_due, "no current tick fell due while it was handled"),
        (field(&seen.record, "cause") == Some(kind.name()), "the next start reports another cause"),
        (is_located, "the next start reports another place"),
        (clocks, "the record's clocks are not those of the crash"),
    ];
    let missed = expected.into_iter().filter(|(held, _)| !held);
    missed.map(|(_, complaint)| format!("{complaint}: {}", seen.record)).collect()
}

/// After the start that reported a crash: no bridge comes on before the operator's reset, then one does; the
/// start after that knows of no crash.
fn refusal(session: &mut Session) -> Result<Vec<String>, ToolError> {
    let (now, position) = (session.now(), session.chip().plant.position());
    session.chip_mut().plant.move_by_hand(position, now, 0.1);
    let refused = !begins(session)?;
    session.reset_fault()?;
    let reset = begins(session)?;
    let records = session.probe.lines.len();
    session.machine.reset(ResetReason::Software);
    session.boot()?;
    let reported = session.probe.find(records, "crash", &[]).is_some();
    let again = begins(session)?;
    let expected = [
        (refused, "the drive was not refused before the reset of the fault"),
        (reset, "the drive was refused after the reset of the fault"),
        (!reported, "the start after that reports the crash again"),
        (again, "the start after that refuses the drive"),
    ];
    let missed = expected.into_iter().filter(|(held, _)| !held);
    Ok(missed.map(|(_, complaint)| complaint.to_owned()).collect())
}

/// Lets the operator begin a calibration; returns whether a bridge came on.
fn begins(session: &mut Session) -> Result<bool, ToolError> {
    session.chip_mut().plant.switchings.clear();
    session.hold_switch(true);
    session.run(0.1)?;
    session.press_start()?;
    session.run(0.3)?;
    session.hold_switch(false);
    session.run(0.3)?;
    Ok(session.chip().plant.switchings.iter().any(|switching| switching.on))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORD: &str = "crash n=2 cause=panic pc=0x0 lr=0x0 status=0x0 address=0xffffffff line=7 file=src/a.rs \
                          released=150 kept=200";

    fn seen() -> Seen {
        Seen {
            begun: 101_000,
            cycles: 50,
            tick: 101_100,
            released: Some(101_200),
            on_again: false,
            stored: Some([101_400, 101_500]),
            reset: Some((101_600, ResetReason::Software)),
            record: RECORD.into(),
            expected: vec!["line=7".into(), "file=src/a.rs".into()],
        }
    }

    #[test]
    fn every_violated_requirement_of_a_crash_is_reported() {
        assert_eq!(judge(CrashKind::Panic, &seen()), [""; 0]);
        type Change = (fn(&mut Seen), &'static str);
        let changes: [Change; 13] = [
            (|seen| seen.released = None, "bridges off later"),
            (|seen| seen.begun -= ticks(10e-6), "bridges off later"),
            (|seen| seen.on_again = true, "on again"),
            (|seen| seen.stored = Some([101_200, 101_500]), "written before"),
            (|seen| seen.stored = None, "written before"),
            (|seen| seen.reset = Some((101_450, ResetReason::Software)), "no reset after"),
            (|seen| seen.reset = Some((101_600, ResetReason::Watchdog)), "not the crash's"),
            (|seen| seen.tick = 101_700, "no current tick"),
            (|seen| seen.record = seen.record.replace("panic", "hard_fault"), "another cause"),
            (|seen| seen.record = seen.record.replace("line=7", "line=77"), "another place"),
            (|seen| seen.record = seen.record.replace("kept=200", "kept=400"), "clocks"),
            (|seen| seen.record = seen.record.replace("released=150", "released=201"), "clocks"),
            (|seen| seen.record.clear(), "another cause"),
        ];
        for (change, complaint) in changes {
            let mut seen = seen();
            change(&mut seen);
            let complaints = judge(CrashKind::Panic, &seen);
            assert!(complaints.iter().any(|words| words.contains(complaint)), "{complaint}: {complaints:?}");
        }
    }

    #[test]
    fn an_overflow_is_placed_below_the_stack() {
        let judged = |address: &str, status: &str| {
            let record = RECORD.replace("cause=panic", "cause=stack_overflow").replace("0xffffffff", address);
            let record = record.replace("status=0x0", status);
            judge(CrashKind::StackOverflow(0), &Seen { record, expected: Vec::new(), ..seen() })
        };
        assert_eq!(judged("0x1ffffff0", "status=0x8200"), [""; 0]);
        assert_eq!(judged("0xffffffff", "status=0x1000"), [""; 0]);
        for address in ["0x1ffff7fc", "0x20000000", "0xffffffff"] {
            assert!(judged(address, "status=0x8200")[0].contains("another place"), "{address}");
        }
    }
}
