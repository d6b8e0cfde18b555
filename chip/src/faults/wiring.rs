//! E3, E5: encoders that start at another count, and motors that are wired wrongly, from the calibration on.

use std::rc::Rc;

use scarab_base::error::ToolError;

use hal_sim::drive::description::{AxisDescription, EncoderWiring};

use crate::faults::{Machines, Verdict, begin};
use crate::plant::JOINTS;
use crate::rtt::field;
use crate::session::Session;
use crate::time::ticks;

/// Motion after the start, s, and the interval in which positions are compared.
const MOTION_S: f64 = 2.0;
const INTERVAL_S: f64 = 0.05;
/// Counts between the wraps of two seeds.
const APART: u16 = 300;
/// Longest calibration of one motor, s.
const CALIBRATION_S: f64 = 60.0;

/// Session whose encoders start where they always do.
pub struct Unshifted {
    /// Bits of both joints' positions in the motion.
    positions: Vec<[u64; JOINTS]>,
    /// Counts before the calibration and in the held pose.
    booted: [u16; JOINTS],
    resting: [u16; JOINTS],
}

impl Machines<'_> {
    fn unshifted(&mut self) -> Result<Rc<Unshifted>, ToolError> {
        if let Some(unshifted) = &self.unshifted {
            return Ok(Rc::clone(unshifted));
        }
        let session = &mut *self.session;
        session.machine.restore(&self.booted)?;
        let plant = &mut session.chip_mut().plant;
        (0..JOINTS).for_each(|axis| plant.reconnect(axis, |_| {}));
        let counts = |session: &mut Session| {
            let now = session.now();
            [0, 1].map(|axis| session.chip_mut().plant.encoder(axis, now))
        };
        let booted = counts(session);
        session.enable_drive()?;
        let unshifted = Unshifted { booted, resting: counts(session), positions: moved(session)? };
        Ok(Rc::clone(self.unshifted.insert(Rc::new(unshifted))))
    }
}

/// Positions while the leg approaches and begins to excite itself.
fn moved(session: &mut Session) -> Result<Vec<[u64; JOINTS]>, ToolError> {
    session.press_start()?;
    let mut positions = Vec::new();
    for _ in 0..(MOTION_S / INTERVAL_S) as u32 {
        session.run(INTERVAL_S)?;
        positions.push(session.chip().plant.position().map(f64::to_bits));
    }
    Ok(positions)
}

/// E3: both counters wrap within the calibration (even seeds) or the motion. The leg moves bit for bit as
/// without a wrap.
pub fn wraps(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let expected = machines.unshifted()?;
    begin(machines.session, &machines.booted, 0)?;
    let from = if seed.is_multiple_of(2) { expected.booted } else { expected.resting };
    let session = &mut *machines.session;
    for axis in 0..JOINTS {
        // So many counts below the wrap, which a calibration turns towards; in the motion on either side of
        // it.
        let below = (seed as u16 / 2).wrapping_mul(APART) / 2 + 2;
        let below = if seed % 4 < 3 { below } else { below.wrapping_neg() };
        let shift = below.wrapping_neg().wrapping_sub(from[axis]);
        let plant = &mut session.chip_mut().plant;
        plant.reconnect(axis, |axis| axis.counter.start = axis.counter.start.wrapping_add(shift));
    }
    if let Err(error) = session.enable_drive() {
        return Ok(Err(error.to_string()));
    }
    let positions = moved(session)?;
    let wraps = [0, 1].map(|axis| session.chip().plant.axes[axis].wraps);
    if wraps.contains(&0) {
        return Ok(Err(format!("a counter did not wrap: {wraps:?}")));
    }
    let same = positions.iter().zip(&expected.positions).take_while(|(one, other)| one == other).count();
    if same < expected.positions.len() {
        return Ok(Err(format!("moves otherwise after {:.2} s", same as f64 * INTERVAL_S)));
    }
    Ok(Ok(0.0))
}

/// Ways to connect an axis wrongly.
const WAYS: [fn(&mut AxisDescription); 11] = [
    |axis| axis.wiring.phases.swap(0, 1),
    |axis| axis.wiring.phases.swap(1, 2),
    |axis| axis.wiring.phases.swap(0, 2),
    |axis| {
        axis.wiring.encoder = match axis.wiring.encoder {
            EncoderWiring::Reversed => EncoderWiring::Forward,
            _ => EncoderWiring::Reversed,
        };
    },
    |axis| axis.wiring.encoder = EncoderWiring::Missing,
    |axis| axis.wiring.open = Some(0),
    |axis| axis.wiring.open = Some(1),
    |axis| axis.wiring.open = Some(2),
    |axis| axis.wiring.shunts_exchanged = true,
    |axis| axis.wiring.shunts_inverted[0] = true,
    |axis| axis.wiring.shunts_inverted[1] = true,
];

/// E5: a calibration refuses a wrongly connected axis, and the drive is never enabled afterwards.
pub fn wrong(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let (way, axis) = (seed as usize % WAYS.len(), seed as usize / WAYS.len() % JOINTS);
    begin(machines.session, &machines.booted, 0)?;
    let session = &mut *machines.session;
    session.chip_mut().plant.reconnect(axis, WAYS[way]);
    session.hold_switch(true);
    session.run(0.2)?;
    session.press_start()?;
    for joint in 0..=axis {
        let line = session.wait("calibration", &[], CALIBRATION_S)?;
        let done = matches!(field(&line, "result"), Some("done" | "confirmed"));
        if done == (joint == axis) {
            return Ok(Err(format!("way {way} of axis {axis}: {line}")));
        }
    }
    // The operator goes on as if it had passed.
    session.hold_switch(false);
    session.run(0.5)?;
    let now = session.now();
    let plant = &mut session.chip_mut().plant;
    plant.switchings.clear();
    plant.couple(now);
    session.press_start()?;
    session.run(1.0)?;
    session.hold_switch(true);
    session.run_until(session.now() + ticks(0.5))?;
    if session.chip().plant.switchings.iter().any(|switching| switching.on) {
        return Ok(Err(format!("way {way} of axis {axis}: a bridge was on after the refusal")));
    }
    Ok(Ok(0.0))
}
