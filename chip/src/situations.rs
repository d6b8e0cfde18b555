//! The processor's load in each situation of operation, from start to a host that moves the leg.

use std::collections::BTreeMap;
use std::ops::Range;

use scarab::bus::Frame;
use scarab_base::error::ToolError;
use scarab_rig::bus::host::{TARGETS, compact_mapping};
use serde::Serialize;

use crate::load::{CURRENT, SERVO_NAME};
use crate::report::{InterruptReport, LoadReport, interrupts, load};
use crate::session::{Session, Step};
use crate::time::ticks;

/// Goals: instructions of one current interrupt while both bridges switch, mean and worst.
const MOST_MEAN: f64 = 850.0;
const MOST_WORST: u64 = 1250;
/// Goal: share of the processor's time while the leg holds its pose.
const MOST_HOLDING: f64 = 0.5;
/// Goals: mean and most instructions of a servo interrupt: the leg's tick with its side of the bus. The most
/// contains ticks that begin a motion or take a verdict, and twice each block that an interrupt preempts.
const MOST_SERVO: [(&str, f64, u64); 3] =
    [(HOLDING, 4000.0, 4000), (IDENTIFYING, 4000.0, 5500), (FOLLOWING, 4400.0, 5500)];
/// Goals: instructions of a sample's identification; duration of the search at 8 ns an instruction, s.
const MOST_SAMPLE: u64 = 30_000;
const MOST_SEARCH_S: f64 = 0.5;
const INSTRUCTION_S: f64 = 8e-9;
/// Functions whose calls are counted: what takes a sample of the log, and a slice of the search.
const CALLED: [(&str, &str, &str); 2] =
    [(SAMPLE, "record::recorder::Recorder", "::push"), (SEARCH, "solve::solver::Solver", "::advance")];
const SAMPLE: &str = "sample";
const SEARCH: &str = "search";
/// Situations in which both bridges switch.
const SWITCHING: [&str; 3] = [HOLDING, IDENTIFYING, FOLLOWING];
const HOLDING: &str = "holding";
const IDENTIFYING: &str = "identifying";
const FOLLOWING: &str = "following";
/// Duration of a situation that does not end by itself, s.
const MEASURED_S: f64 = 1.0;
/// Cycle of the host, s.
pub(crate) const CYCLE_S: f64 = 1e-3;
/// Cycles before the measurement.
const LEAD: u32 = 100;
/// Times per cycle at which the wire is filled.
const FILLINGS: i32 = 8;
/// Amplitude of the targets, increments of 6064, and frequency, Hz.
const WAY: f64 = 20_000.0;
const MOTION_HZ: f64 = 0.5;
/// COB-ID of frames that no node of this board uses.
pub(crate) const OTHER: u16 = 0x5FF;

/// Load in one situation.
#[derive(Clone, Debug, Serialize)]
pub struct Situation {
    pub name: &'static str,
    pub load: LoadReport,
    pub interrupts: BTreeMap<&'static str, InterruptReport>,
    /// Calls of the identification's functions.
    pub calls: BTreeMap<&'static str, CallReport>,
    /// Instructions by exception and function, most first, if counted.
    #[serde(skip)]
    pub profile: Vec<(u8, String, u64)>,
}

/// Calls of one function, with the functions that it calls.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CallReport {
    pub count: u64,
    pub mean_instructions: f64,
    pub worst_instructions: u64,
    /// Instructions of all calls at 8 ns each, s.
    pub seconds: f64,
}

/// Measures idle, calibrating, holding, identifying and following, from a session that has just started.
///
/// # Errors
/// The image does not reach a situation.
pub fn run(session: &mut Session, profiled: bool) -> Result<Vec<Situation>, ToolError> {
    let image = session.machine.image();
    let entry = |(_, within, name)| {
        let missing = || ToolError::input(format!("the image has no function {within}..{name}"));
        image.function_in(within, name).ok_or_else(missing)
    };
    let entries = CALLED.into_iter().map(entry).collect::<Result<Vec<_>, _>>()?;
    let mut found = Vec::new();
    let mut measure = |session: &mut Session, name, act: &dyn Fn(&mut Session) -> Result<(), ToolError>| {
        session.begin_measurement();
        session.machine.watch(&entries);
        if profiled {
            session.machine.begin_profile();
        }
        act(session)?;
        let (load, interrupts) = (load(session), interrupts(session));
        let profile = session.machine.profile();
        found.push(Situation { name, load, interrupts, calls: calls(session), profile });
        Ok::<_, ToolError>(())
    };
    measure(session, "idle", &|session| session.run(MEASURED_S))?;
    measure(session, "calibrating", &|session| session.step(Step::Calibrate))?;
    session.step(Step::Reference)?;
    session.step(Step::Enable)?;
    measure(session, HOLDING, &|session| session.run(MEASURED_S))?;
    measure(session, IDENTIFYING, &|session| session.step(Step::Identify))?;
    let start = take_over(session)?;
    // The first cycles bring the leg into the motion.
    follow(session, start, 0..LEAD)?;
    let cycles = LEAD..LEAD + (MEASURED_S / CYCLE_S) as u32;
    measure(session, FOLLOWING, &|session| follow(session, start, cycles.clone()))?;
    Ok(found)
}

/// Goals that a measurement misses, in words.
pub fn missed_goals(found: &[Situation]) -> Vec<String> {
    let mut missed = Vec::new();
    for Situation { name, load, interrupts, calls, .. } in
        found.iter().filter(|one| SWITCHING.contains(&one.name))
    {
        let goal = MOST_SERVO.into_iter().find(|(situation, ..)| situation == name);
        let (_, mean_of_servo, most_of_servo) = goal.unwrap_or_default();
        let goals = [
            ("current interrupt", CURRENT, MOST_MEAN, MOST_WORST),
            ("servo", SERVO_NAME, mean_of_servo, most_of_servo),
        ];
        for (what, interrupt, most_mean, most) in goals {
            let InterruptReport { mean_instructions: mean, worst_instructions: worst, .. } =
                interrupts[interrupt];
            if mean > most_mean || worst > most {
                missed.push(format!(
                    "{name}: the {what} takes {mean:.1} instructions in the mean and {worst} at worst; goals {most_mean} and {most}"
                ));
            }
        }
        if *name == IDENTIFYING {
            missed.extend(missed_calls(calls));
        }
        if *name == HOLDING && load.total > MOST_HOLDING {
            let [total, most] = [load.total, MOST_HOLDING].map(|share| 100.0 * share);
            missed.push(format!("{name}: {total:.2} % of the processor is used; goal {most} %"));
        }
    }
    missed
}

/// Goals that the identification's functions miss, in words. A function that never ran misses its goal.
fn missed_calls(calls: &BTreeMap<&'static str, CallReport>) -> Vec<String> {
    type Goal = (&'static str, &'static str, fn(&CallReport) -> f64, f64);
    let goals: [Goal; 2] = [
        (SAMPLE, "instructions at worst", |call| call.worst_instructions as f64, MOST_SAMPLE as f64),
        (SEARCH, "s at 8 ns an instruction", |call| call.seconds, MOST_SEARCH_S),
    ];
    let missed = goals.into_iter().filter_map(|(name, unit, value, goal)| {
        match calls.get(name).filter(|call| call.count > 0).map(value) {
            Some(found) if found <= goal => None,
            Some(found) => Some(format!("{IDENTIFYING}: {name}: {found} {unit}; goal {goal}")),
            None => Some(format!("{IDENTIFYING}: {name}: never ran")),
        }
    });
    missed.collect()
}

/// Calls of the watched functions.
fn calls(session: &Session) -> BTreeMap<&'static str, CallReport> {
    let calls = session.machine.calls();
    let named = CALLED.into_iter().zip(calls).map(|((name, ..), calls)| {
        let report = CallReport {
            count: calls.count,
            mean_instructions: calls.instructions as f64 / calls.count.max(1) as f64,
            worst_instructions: calls.worst,
            seconds: calls.instructions as f64 * INSTRUCTION_S,
        };
        (name, report)
    });
    named.collect()
}

/// A host with the compact mapping (docs/bus.md) enables both joints; returns their positions.
pub(crate) fn take_over(session: &mut Session) -> Result<[i32; 2], ToolError> {
    session.chip_mut().send_frame(Frame::new(0, &[1, 0]));
    session.run(0.1)?;
    for node in [1_u16, 2] {
        let mut write = |index, sub, value, bytes| session.write_sized(node, index, sub, value, bytes);
        for (index, sub, value, bytes) in compact_mapping(usize::from(node) - 1) {
            write(index, sub, value, bytes)?;
        }
        write(0x60C2, 1, 1, 1)?;
    }
    for (word, state) in [(0x6, 0x21), (0x7, 0x23), (0xF, 0x27)] {
        for node in [1, 2] {
            session.write_sized(node, 0x6040, 0, word, 2)?;
        }
        for node in [1, 2] {
            reach(session, node, state)?;
        }
    }
    let mut positions = [0; 2];
    for (node, position) in (1..).zip(&mut positions) {
        let value = session.read_object(node, 0x6064, 0)?;
        session.write_sized(node, 0x607A, 0, value, 4)?;
        session.write_sized(node, 0x6060, 0, 8, 1)?;
        *position = value.cast_signed();
    }
    Ok(positions)
}

/// Waits until a node's statusword shows a state.
fn reach(session: &mut Session, node: u16, state: u32) -> Result<(), ToolError> {
    let until = session.now() + ticks(2.0);
    while session.now() < until {
        if session.read_object(node, 0x6041, 0)? & 0x6F == state {
            return Ok(());
        }
        session.run(5e-3)?;
    }
    Err(ToolError::Refused(format!("node {node} does not reach state {state:#04x}")))
}

/// Targets of both joints, s after the beginning of a motion from these positions.
pub(crate) fn targets(start: [i32; 2], time: f64) -> Frame {
    let offset = WAY * (1.0 - (std::f64::consts::TAU * MOTION_HZ * time).cos());
    let mut targets = [0; 8];
    for (bytes, start) in targets.chunks_exact_mut(4).zip(start) {
        bytes.copy_from_slice(&(start + offset as i32).to_le_bytes());
    }
    Frame::new(TARGETS, &targets)
}

/// Sends SYNC and targets at 1 kHz; frames for others fill the rest of the wire.
fn follow(session: &mut Session, start: [i32; 2], cycles: Range<u32>) -> Result<(), ToolError> {
    session.forget_frames();
    let expected = 2 * cycles.len();
    for cycle in cycles {
        let time = f64::from(cycle) * CYCLE_S;
        let waiting = &mut session.chip_mut().can.partner;
        // The first frame may be on the wire.
        let next = waiting.len().min(1);
        waiting.insert(next, targets(start, time));
        waiting.insert(next, Frame::new(0x80, &[]));
        for _ in 0..FILLINGS {
            while session.chip().can.partner.len() < 3 {
                session.chip_mut().send_frame(Frame::new(OTHER, &[0x55; 8]));
            }
            session.run(CYCLE_S / f64::from(FILLINGS))?;
        }
    }
    let sent = &session.chip().can.sent;
    let feedback = sent.iter().filter(|(_, frame)| frame.id() & !3 == 0x180).count();
    if feedback + 4 < expected {
        return Err(ToolError::Refused(format!("{feedback} of {expected} feedback frames arrived")));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn situation(name: &'static str, mean: f64, worst: u64, total: f64) -> Situation {
        let call = CallReport { count: 2, mean_instructions: 0.0, worst_instructions: 4000, seconds: 0.5 };
        let interrupt = |mean_instructions, worst_instructions| InterruptReport {
            mean_instructions,
            worst_instructions,
            ..InterruptReport::default()
        };
        Situation {
            name,
            load: LoadReport { total, ..LoadReport::default() },
            interrupts: [(CURRENT, interrupt(mean, worst)), (SERVO_NAME, interrupt(800.0, 1200))].into(),
            calls: CALLED.map(|(name, ..)| (name, call)).into(),
            profile: Vec::new(),
        }
    }

    #[test]
    fn a_missed_goal_of_servo_or_identification_is_named() {
        let with = |name, change: fn(&mut Situation)| {
            let mut situation = situation(name, 800.0, 1200, 0.4);
            change(&mut situation);
            missed_goals(&[situation]).join("; ")
        };
        fn call<'a>(situation: &'a mut Situation, name: &str) -> &'a mut CallReport {
            situation.calls.get_mut(name).expect("there")
        }
        fn servo(situation: &mut Situation) -> &mut InterruptReport {
            situation.interrupts.get_mut(SERVO_NAME).expect("there")
        }
        assert_eq!(with(FOLLOWING, |one| servo(one).worst_instructions = 5500), "");
        assert_eq!(
            with(FOLLOWING, |one| servo(one).worst_instructions = 5501),
            "following: the servo takes 800.0 instructions in the mean and 5501 at worst; goals 4400 and 5500"
        );
        assert_eq!(
            with(HOLDING, |one| servo(one).mean_instructions = 4000.5),
            "holding: the servo takes 4000.5 instructions in the mean and 1200 at worst; goals 4000 and 4000"
        );
        assert_eq!(
            with(IDENTIFYING, |one| call(one, SAMPLE).worst_instructions = 30_001),
            "identifying: sample: 30001 instructions at worst; goal 30000"
        );
        assert_eq!(
            with(IDENTIFYING, |one| call(one, SEARCH).seconds = 0.51),
            "identifying: search: 0.51 s at 8 ns an instruction; goal 0.5"
        );
        assert_eq!(with(IDENTIFYING, |one| call(one, SEARCH).count = 0), "identifying: search: never ran");
    }

    #[test]
    fn a_missed_goal_is_named_with_its_situation() {
        // One bridge switches in a calibration, and only a held leg has a goal for the processor.
        let met = [
            situation("calibrating", 715.0, 2352, 0.37),
            situation("holding", 850.0, 1250, 0.5),
            situation("identifying", 824.0, 1235, 0.57),
        ];
        assert_eq!(missed_goals(&met), [""; 0]);
        let missed = [
            situation("holding", 851.0, 1250, 0.501),
            situation("identifying", 824.0, 1251, 0.57),
            situation("following", 824.0, 1200, 0.6),
        ];
        assert_eq!(
            missed_goals(&missed),
            [
                "holding: the current interrupt takes 851.0 instructions in the mean and 1250 at worst; goals 850 and 1250",
                "holding: 50.10 % of the processor is used; goal 50 %",
                "identifying: the current interrupt takes 824.0 instructions in the mean and 1251 at worst; goals 850 and \
                 1250",
            ]
        );
    }
}
