//! K1, K2: a current tick that is missing, and work of the lowest priority beside control.

use std::rc::Rc;

use scarab::bus::Frame;
use scarab_base::error::ToolError;
use scarab_base::random::Random;

use crate::chip::LostTriggers;
use crate::faults::{Machines, PERIOD_S, Verdict, begin, jitter};
use crate::machine::Snapshot;
use crate::rtt::field;
use crate::situations::OTHER;
use crate::time::ticks;

/// Longest time from the start of an identification to its search, s.
const LONGEST_S: f64 = 60.0;
/// Time that is watched, s; the search begins within it or ends in it.
const WATCHED_S: f64 = 0.3;

impl Machines<'_> {
    /// An identification's search has begun.
    fn searching(&mut self) -> Result<Rc<Snapshot>, ToolError> {
        if let Some(searching) = &self.searching {
            return Ok(Rc::clone(searching));
        }
        let moving = self.moving()?;
        self.session.machine.restore(&moving)?;
        self.session.wait("state", &["phase=solve"], LONGEST_S)?;
        Ok(Rc::clone(self.searching.insert(Rc::new(self.session.machine.save()?))))
    }
}

/// The thread never yields (a search without slices), or no probe reads the records while the wire is full,
/// or both at once. Bridges stay on, no conversion is lost; the verdict is the longest delay of a current
/// tick.
pub fn starves(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let searching = machines.searching()?;
    let mut random = Random::new("K2", seed);
    let session = &mut *machines.session;
    let begun = begin(session, &searching, random.below(ticks(50e-3)))?;
    let [hangs, is_full] = [[true, false], [false, true], [true, true]][seed as usize % 3];
    if hangs {
        session.machine.hang(Some(0));
    }
    while session.now() < begun + ticks(WATCHED_S) {
        while is_full && session.chip().can.partner.len() < 3 {
            session.chip_mut().send_frame(Frame::new(OTHER, &[0x55; 8]));
        }
        let next = session.now() + ticks(125e-6);
        if is_full {
            // Past the probe.
            session.machine.run(next)?;
        } else {
            session.run_until(next)?;
        }
    }
    let plant = &session.chip().plant;
    if !plant.switchings.is_empty()
        || plant.axes.iter().any(|axis| session.now() > axis.last_high + ticks(1e-4))
    {
        return Ok(Err("reacted without need".into()));
    }
    Ok(jitter(session))
}

/// K1: one trigger is lost. The image counts it in its next record and does nothing else.
pub fn counted(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let moving = machines.moving()?;
    let mut random = Random::new("K1", seed);
    let session = &mut *machines.session;
    begin(session, &moving, random.below(ticks(0.5)))?;
    let axis = random.below(2) as usize;
    let lost = LostTriggers::new(1, 0, 1);
    session.chip_mut().lost_triggers[axis] = lost;
    let missed = |line: &str| field(line, "current_missed").and_then(|count| count.parse::<u32>().ok());
    session.run(PERIOD_S)?;
    let line = session.wait("loops", &[], 1.1)?;
    let switched = session.chip().plant.switchings.len();
    Ok(match missed(&line) {
        Some(1) if switched == 0 => Ok(0.0),
        count => Err(format!("{count:?} missed ticks counted, {switched} switchings")),
    })
}
