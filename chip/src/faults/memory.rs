//! K4, M1, M2: crashes, a stack that grows beyond its memory, and bits that flip in gains and limits.
//!
//! Where the constants lie is known from two sides: the ELF names the variable of a level, and the host
//! computes the same constants from the leg file, or reads them in the calibration's record. A word is
//! flipped only if the variable holds its value exactly as often as the leg has joints with it.

use std::collections::BTreeMap;
use std::rc::Rc;

use scarab::safety::RANGE_TOLERANCE;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_rig::board::axis_configuration;
use scarab_rig::options::SimulationOptions;
use scarab_rig::pair::Context;

use crate::crashes::{self, CrashKind};
use crate::faults::{Expected, Machines, Verdict, begin, judge, watch};
use crate::plant::JOINTS;
use crate::rtt::field;
use crate::session::Session;
use crate::time::ticks;

/// Variables of the current loops and of the servo.
const LOOPS: &str = "composition::hand_out::LOOPS";
const SERVO: &str = "composition::hand_out::SERVO";
/// Number of base parameters.
const BASE: usize = 13;
/// Factor of the overspeed bound (docs/safety.md, J2).
const OVERSPEED: f32 = 1.1;
/// Fewest words that must be found.
const FEWEST: usize = 16;
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
        Ok(Rc::clone(self.constants.insert(Rc::new(constants))))
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
    let context = Context::<JOINTS, BASE>::new(&session.leg, &SimulationOptions::with_seed(1))?;
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
    let (address, size) = session.machine.image().variable(variable)?;
    let mut bytes = vec![0; size as usize];
    session.machine.memory(address, &mut bytes);
    let mut expected: BTreeMap<u32, (usize, &'static str)> = BTreeMap::new();
    for (name, value) in values {
        expected.entry(value.to_bits()).or_insert((0, name)).0 += 1;
    }
    let mut found = Vec::new();
    for (bits, (times, name)) in expected {
        let words = (0..).step_by(4).zip(bytes.chunks_exact(4));
        let addresses: Vec<u32> = words
            .filter(|(_, word)| *word == bits.to_le_bytes())
            .map(|(offset, _)| address + offset)
            .collect();
        if addresses.len() == times {
            found.extend(addresses.into_iter().map(|address| Constant { name, address }));
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

/// K4: a panic, a hard fault or an unhandled interrupt in the motion.
pub fn crash(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let kinds = [CrashKind::Interrupt, CrashKind::Panic, CrashKind::HardFault];
    crashed(machines, kinds[seed as usize % 3], &mut Random::new("K4", seed))
}

/// M1: the stack is used up in the motion.
pub fn overflow(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let mut random = Random::new("M1", seed);
    let left = random.below(LEFT) as u32;
    crashed(machines, CrashKind::StackOverflow(left), &mut random)
}

/// Time from a crash in the motion until both bridges are off, if nothing else is wrong.
fn crashed(machines: &mut Machines<'_>, kind: CrashKind, random: &mut Random) -> Result<Verdict, ToolError> {
    let moving = machines.moving()?;
    let session = &mut *machines.session;
    begin(session, &moving, random.below(ticks(0.5)))?;
    let report = crashes::crash(session, kind)?;
    Ok(match (report.complaints.first(), report.released_us) {
        (None, Some(time)) => Ok(1e-6 * time),
        (complaint, _) => Err(format!("{}: {complaint:?}", report.kind)),
    })
}
