//! M1, M2: a stack that grows beyond its memory, and bits that flip in gains and limits.
//!
//! Where the constants lie is known from two sides: the ELF names the variable of a level, and the host
//! computes the same constants from the leg file, or reads them in the calibration's record. A word is
//! flipped only if the variable holds its value exactly as often as the leg has joints with it.

use std::collections::BTreeMap;
use std::rc::Rc;

use scarab::safety::RANGE_TOLERANCE;
use scarab_host::base::error::ToolError;
use scarab_host::base::random::Random;
use scarab_host::rig::board::axis_configuration;
use scarab_host::rig::options::SimulationOptions;
use scarab_host::rig::pair::Context;

use crate::faults::{Expected, Machines, Verdict, begin, judge, watch};
use crate::plant::JOINTS;
use crate::rtt::field;
use crate::session::Session;
use crate::time::{seconds, ticks};

/// Variables of the current loops and of the servo.
const LOOPS: &str = "composition::hand_out::LOOPS";
const SERVO: &str = "composition::hand_out::SERVO";
/// Number of base parameters.
const BASE: usize = 13;
/// Factor of the overspeed bound (docs/safety.md, J2).
const OVERSPEED: f32 = 1.1;
/// Fewest words that must be found.
const FEWEST: usize = 16;
/// Longest time until the stack's end is passed, s: some PWM periods.
const OVERFLOW_S: f64 = 1e-3;
/// Bytes that are left of the stack at most.
const LEFT: u64 = 320;

/// Word of the memory that holds a constant.
pub struct Constant {
    name: &'static str,
    address: u32,
}

impl Machines<'_> {
    /// Places of gains, limits and offsets in the memory of an enabled drive.
    fn constants(&mut self) -> Result<Rc<Vec<Constant>>, ToolError> {
        if let Some(constants) = &self.constants {
            return Ok(Rc::clone(constants));
        }
        let resting = self.resting()?;
        self.session.machine.restore(&resting)?;
        let mut constants = Vec::new();
        for (variable, values) in [(LOOPS, of_axes(self)?), (SERVO, of_servo(self.session)?)] {
            constants.extend(find(self.session, variable, &values)?);
        }
        if constants.len() < FEWEST {
            let names: Vec<_> = constants.iter().map(|constant| constant.name).collect();
            return Err(ToolError::input(format!("only these constants were found in memory: {names:?}")));
        }
        let constants = Rc::new(constants);
        self.constants = Some(Rc::clone(&constants));
        Ok(constants)
    }
}

/// Constants of the axes: limits from the leg file, offsets from the calibration's record.
fn of_axes(machines: &Machines<'_>) -> Result<Vec<(&'static str, f32)>, ToolError> {
    let mut values = Vec::new();
    for joint in &machines.session.leg.joints {
        let motor = joint.motor.as_ref().ok_or_else(|| ToolError::input("a joint without a motor"))?;
        let configuration = axis_configuration(joint, motor);
        values.push(("current limit", configuration.current_limit.0));
        values.push(("square of the overcurrent bound", configuration.overcurrent.0.powi(2)));
    }
    for line in &machines.calibrations {
        for key in ["zero_b", "zero_c"] {
            let value = field(line, key).and_then(|value| value.parse().ok());
            values.push((
                "offset of a shunt",
                value.ok_or_else(|| ToolError::input(format!("{key}: {line}")))?,
            ));
        }
    }
    Ok(values)
}

/// Constants of the servo: scales, gains and limits of each joint.
fn of_servo(session: &Session) -> Result<Vec<(&'static str, f32)>, ToolError> {
    let context = Context::<JOINTS, BASE>::new(&session.leg, &SimulationOptions::of_seed(1))?;
    let mut values = Vec::new();
    for joint in &context.configuration.joints {
        let limits = joint.limits();
        values.extend([
            ("counts per radian", 1.0 / joint.scale.signed_radian_per_count()),
            ("largest acceleration", limits.torque_cap().0 / limits.inertia.0),
            ("current per torque", 1.0 / limits.torque_per_ampere.0),
            ("overspeed bound", OVERSPEED * limits.speed.0),
            ("lower end of the range", (limits.low - RANGE_TOLERANCE).0),
            ("upper end of the range", (limits.high + RANGE_TOLERANCE).0),
        ]);
    }
    Ok(values)
}

/// Words of a variable that hold these values, each as often as it is expected.
fn find(
    session: &Session,
    variable: &str,
    values: &[(&'static str, f32)],
) -> Result<Vec<Constant>, ToolError> {
    let image = session.machine.image();
    let (address, size) = image
        .variable(variable)
        .ok_or_else(|| ToolError::input(format!("the image has no variable {variable}")))?;
    let mut bytes = vec![0; size as usize];
    session.machine.memory(address, &mut bytes);
    let mut expected: BTreeMap<u32, (usize, &'static str)> = BTreeMap::new();
    for (name, value) in values {
        expected.entry(value.to_bits()).or_insert((0, name)).0 += 1;
    }
    let mut found = Vec::new();
    for (bits, (times, name)) in expected {
        let words = (0..).step_by(4).zip(bytes.chunks_exact(4));
        let places: Vec<u32> =
            words.filter(|(_, word)| *word == bits.to_le_bytes()).map(|(place, _)| address + place).collect();
        if places.len() == times {
            found.extend(places.into_iter().map(|address| Constant { name, address }));
        }
    }
    Ok(found)
}

/// M2: any bit of any of these words flips in the motion; both bridges are off in time.
pub fn upset(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let (constants, moving) = (machines.constants()?, machines.moving()?);
    let mut random = Random::new("M2", seed);
    let session = &mut *machines.session;
    let begun = begin(session, &moving, random.below(ticks(0.5)))?;
    let records = session.probe.lines.len();
    let Constant { name, address } = &constants[random.below(constants.len() as u64) as usize];
    let (byte, bit) = (random.below(4) as u32, random.below(8));
    let mut word = [0];
    session.machine.memory(address + byte, &mut word);
    session.machine.set_memory(address + byte, &[word[0] ^ 1 << bit]);
    let seen = watch(session, Expected::Released, None, begun, records)?;
    let verdict = judge(Expected::Released, &seen);
    Ok(verdict.map_err(|complaint| format!("{name}, bit {}: {complaint}", 8 * u64::from(byte) + bit)))
}

/// M1: the stack is used up in the motion; bridges are off in time after the fault, and the next start says
/// why and does not enable.
pub fn overflow(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let moving = machines.moving()?;
    let mut random = Random::new("M1", seed);
    let session = &mut *machines.session;
    begin(session, &moving, random.below(ticks(0.5)))?;
    let (records, resets) = (session.probe.lines.len(), session.resets.len());
    session.machine.chip_mut().hard_fault = None;
    session.machine.use_up_stack(random.below(LEFT) as u32);
    session.run(OVERFLOW_S)?;
    let Some(fault) = session.machine.chip().hard_fault else {
        return Ok(Err(format!("no fault within {OVERFLOW_S} s")));
    };
    session.run(0.5)?;
    let switchings = session.machine.chip_mut().plant.switchings.take().unwrap_or_default();
    let (mut armed, mut released) = ([true; JOINTS], None);
    for switching in &switchings {
        armed[switching.axis] = switching.on;
        released = released.or((armed == [false; JOINTS]).then_some(switching.at));
        if released.is_some() && switching.on {
            return Ok(Err("a bridge was on again".into()));
        }
    }
    if session.resets.len() != resets + 1 {
        return Ok(Err(format!("{} resets", session.resets.len() - resets)));
    }
    if session.probe.find(records, "crash", &["cause=stack_overflow"]).is_none() {
        let crash = session.probe.find(records, "crash", &[]);
        return Ok(Err(format!("the next start does not report the overflow: {crash:?}")));
    }
    Ok(match released {
        Some(at) => Ok(seconds(at.saturating_sub(fault))),
        None => Err("bridges stayed on".into()),
    })
}
