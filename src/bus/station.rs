//! A board on the bus: the nodes and axes of one leg, what stands between them and the leg, and what a restart of a node brings back.
//!
//! Why here: a simulated leg behind a port and the board's task put the same parts together in the same order. That order is decided by
//! values only, so it exists once; who calls has the frames, the clock, the leg and the flash.
//!
//! ```text
//! a frame came            hear(frame, now, who sent it)        a node that was reset begins anew with what was kept of it
//! a mailbox is free       poll(joint, now) -> frame            again until there is none
//! the leg has ticked      told(LegTold), then order() -> LegOrder: commands, at most one request, faults of a lost host
//! a host wrote 1010/1011  take_store(into) -> Keeping; storing(Busy) tells the hosts meanwhile, stored(done, objects) how it ended
//! ```
//!
//! **Who has the drive.** Until a host has sent a controlword that says something, the leg is its operator's: nothing is commanded
//! or asked, statuswords tell what the leg does. From then on it is the host's, until every node was reset and the drive is off. The enabling
//! switch stays in the operator's hand: while it is open, or something blocks, no step towards enabled is passed on, and a host that
//! asked is told as by a leg that refused.
//!
//! **Why not.** A step towards enabled that is refused, here or by the leg, is an error of both nodes (FF0E, with joint, reason and causes) from the
//! first word that asks for it until the reason is gone or the leg is enabled: reported once, however often a host asks. The leg's side makes a record of it.
//!
//! Cost: two polls of a node and one copy of the leg's values; docs/bus.md. Memory: docs/bus.md.

use super::communication::Identity;
use super::drive::{Axis, AxisConstants, Coupling};
use super::emergency::ErrorReport;
use super::identification::{Ask, JointObjects, LegObjects, Results};
use super::kept::KeptNode;
use super::nmt::Reset;
use super::node::{Heard, Node, Storing};
use super::node_id::NodeId;
use crate::hal::{Controller, Frame};
use crate::leg::{
    Activity, DriveState, FaultCode, JointCommand, JointStatus, LoggedSample, NoticeCode, Permission, Plan,
    PowerRequest, RETURN_SPEED, Refusal, RefusalReason,
};

mod keeping;

/// A board that has not looked at its bus for so long stood still.
const STOOD_US: u64 = 2_000;

/// What a leg tells of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegTold<const N: usize> {
    /// Of each joint; its inputs are set here.
    pub joints: [JointStatus; N],
    /// What the leg is doing.
    pub activity: Activity,
    /// The model no longer fits; an update is offered.
    pub change: [bool; 2],
    /// Why the last request for power was refused.
    pub refused: Option<Refusal>,
    /// The operator holds the enabling switch.
    pub held: bool,
    /// Something forbids to enable.
    pub blocked: bool,
    /// Bits of what does.
    pub causes: u32,
    /// Every axis is calibrated.
    pub calibrated: bool,
    /// The leg is not calibrated or has no reference: it does not tick.
    pub rests: bool,
}

impl<const N: usize> LegTold<N> {
    /// A leg that does not tick yet.
    pub const NONE: Self = Self {
        joints: [JointStatus::NONE; N],
        activity: Activity::Idle,
        change: [false; 2],
        refused: None,
        held: false,
        blocked: true,
        causes: 0,
        calibrated: false,
        rests: true,
    };

    /// Whether a reason stands against the leg as a whole.
    const fn has(&self, reason: RefusalReason) -> bool {
        match reason {
            RefusalReason::SwitchOpen => !self.held,
            RefusalReason::Blocked => self.blocked,
            RefusalReason::NoReference => self.rests,
            RefusalReason::NotCalibrated => self.rests && !self.calibrated,
            _ => false,
        }
    }

    /// The first of them.
    fn stands_against(&self) -> Option<RefusalReason> {
        use RefusalReason::{Blocked, NoReference, NotCalibrated, SwitchOpen};
        [NotCalibrated, NoReference, Blocked, SwitchOpen].into_iter().find(|reason| self.has(*reason))
    }
}

/// What a leg is asked for beside its joints' targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LegRequest {
    /// A step of the drive's power states.
    Power(PowerRequest),
    /// An identification.
    Identify {
        /// One-time or sequential.
        plan: Plan,
        /// Of the swarm's random numbers.
        seed: u64,
    },
    /// Give the identification up.
    Cancel,
    /// Take the update that is offered into use.
    TakeUpdate,
}

/// What a leg is to do from its next tick on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegOrder<const N: usize> {
    /// Of each joint; none while no host has the drive.
    pub commands: Option<[JointCommand; N]>,
    /// Once.
    pub request: Option<LegRequest>,
    /// What it has to react to, by joint: once.
    pub faults: [Option<FaultCode>; N],
    /// Joints that may be enabled outside their range.
    pub may_return: [bool; N],
    /// What the bus refused by itself: once, for a record.
    pub refused: Option<Refusal>,
}

/// What a host wants kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// All objects, and the model where one was accepted since.
    All,
    /// Nothing: everything is to be forgotten.
    Defaults,
}

/// See the module; a log of `LOG` samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Station<const N: usize, const LOG: usize> {
    nodes: [Node; N],
    axes: [Axis; N],
    leg: LegObjects<N, LOG>,
    coupling: Coupling,
    own: [NodeId; N],
    identity: Identity,
    /// What a node that is reset begins with: what the store has taken.
    kept: [KeptNode; N],
    /// A host has the drive.
    hosted: bool,
    /// A request that could only be refused was not passed on.
    refused: bool,
    /// What was refused last, as long as that lasts.
    refusal: Option<Refusal>,
    /// The same, for a record of the leg's side.
    noted: Option<Refusal>,
    request: Option<LegRequest>,
    /// What the controller told last that goes on.
    controller: Controller,
    /// Where the store stands.
    storing: Storing,
    /// When the bus was looked at last.
    looked_us: u64,
    /// Of each node: what of it was reset; what was kept of that is to be recalled.
    anew: [Option<Reset>; N],
}

impl<const N: usize, const LOG: usize> Station<N, LOG> {
    /// Nodes with these numbers, of which nothing was kept, before their boot-up messages.
    #[must_use]
    pub fn new(
        own: [NodeId; N],
        identity: Identity,
        constants: [AxisConstants; N],
        plan: Plan,
        seed: u64,
    ) -> Self {
        Self {
            nodes: own.map(|number| Node::new(number, identity)),
            axes: constants.map(Axis::new),
            leg: LegObjects::new(plan, seed, 0),
            coupling: Coupling::default(),
            own,
            identity,
            kept: [KeptNode::NOTHING; N],
            hosted: false,
            refused: false,
            refusal: None,
            noted: None,
            request: None,
            controller: Controller::Active,
            storing: Storing::Done,
            looked_us: 0,
            anew: [None; N],
        }
    }

    /// A frame on the bus, for every node but the one that sent it. What was kept of one that it resets
    /// comes back with what is asked next, once for any number of frames. Whether a node may have something to say or to do.
    pub fn hear<R: Results>(
        &mut self,
        frame: &Frame,
        now_us: u64,
        sender: Option<usize>,
        results: &R,
    ) -> bool {
        self.look_back(now_us);
        let mut concerns = false;
        for joint in (0..N).filter(|joint| Some(*joint) != sender) {
            let heard = self.with(joint, results, |node, objects| node.on_frame(frame, now_us, objects));
            match heard.unwrap_or(Heard::Nothing) {
                Heard::Nothing => continue,
                Heard::Something => {}
                Heard::Reset(reset) => {
                    if let Some(anew) = self.anew.get_mut(joint) {
                        *anew = Some(reset).max(*anew);
                    }
                    concerns = true;
                    continue;
                }
            }
            concerns = true;
            self.share_bit_rate(joint);
        }
        concerns
    }

    /// The next frame that a node has to send; again until there is none. None while the controller is off the bus: what it were given
    /// then would leave when it is back, and be old.
    pub fn poll<R: Results>(&mut self, joint: usize, now_us: u64, results: &R) -> Option<Frame> {
        self.recall_reset();
        if self.controller == Controller::Off {
            return None;
        }
        self.with(joint, results, |node, objects| node.poll(now_us, objects))?
    }

    /// Whether a frame is one of a node's that it tells once: an emergency or boot-up message.
    #[must_use]
    pub fn tells_once(&self, frame: &Frame) -> bool {
        self.nodes.iter().any(|node| node.tells_once(frame))
    }

    /// A board that stood still heard nobody meanwhile.
    pub fn look_back(&mut self, now_us: u64) {
        let since_us = now_us.saturating_sub(self.looked_us);
        self.looked_us = self.looked_us.max(now_us);
        if since_us > STOOD_US {
            self.nodes.iter_mut().for_each(|node| node.stood_still(now_us));
        }
    }

    /// Whether a host is missed; however full the bus is. To be asked every millisecond: a time in which it was not is not held
    /// against a host that nobody could hear.
    pub fn watch<R: Results>(&mut self, now_us: u64, results: &R) {
        self.recall_reset();
        self.look_back(now_us);
        for joint in 0..N {
            self.with(joint, results, |node, objects| node.look_around(now_us, objects));
        }
    }

    /// What the controller tells: once on every change.
    pub fn on_controller<R: Results>(&mut self, told: Controller, results: &R) {
        if told != Controller::Overrun {
            self.controller = told;
        }
        for joint in 0..N {
            self.with(joint, results, |node, objects| node.on_controller(told, objects));
        }
    }

    fn with<R: Results, T>(
        &mut self,
        joint: usize,
        results: &R,
        ask: impl FnOnce(&mut Node, &mut JointObjects<'_, R, N, LOG>) -> T,
    ) -> Option<T> {
        let (node, axis) = (self.nodes.get_mut(joint)?, self.axes.get_mut(joint)?);
        Some(ask(node, &mut JointObjects { axis, joint, leg: &mut self.leg, results }))
    }

    /// What the leg tells of a tick; what it is asked then has to be taken by [`Self::order`] before the next.
    pub fn told(&mut self, told: &LegTold<N>) {
        let drive = told.joints.first().map_or(DriveState::NotReadyToSwitchOn, |joint| joint.drive);
        let inputs = self.inputs(told);
        for ((axis, status), inputs) in self.axes.iter_mut().zip(&told.joints).zip(inputs) {
            axis.update(&JointStatus { inputs, ..*status });
        }
        let mut rises = false;
        for axis in &mut self.axes {
            rises |= axis.take_rises();
        }
        (self.leg.activity, self.leg.change) = (told.activity, told.change);
        let commanded = self.axes.iter().any(Axis::is_commanded);
        self.hosted = commanded || self.hosted && drive.permission() != Permission::Released;
        let refused = core::mem::take(&mut self.refused) || told.refused.is_some();
        if !self.hosted {
            self.coupling.look_on(self.axes.each_mut(), drive);
        }
        let power = self.coupling.power(self.axes.each_mut(), drive, refused).filter(|_| self.hosted);
        // A step of the drive goes first; what else was asked waits for the next tick. An identification that was asked for on the way up does
        // not: nothing from before the leg was enabled is done afterwards.
        let asked = match power {
            None => self.leg.take_asked(),
            Some(power) if power.enables() && self.leg.has_asked(Ask::Identify) => self.leg.take_asked(),
            Some(_) => None,
        };
        self.request = match (power, asked) {
            (Some(power), _) if power.enables() && told.stands_against().is_some() => {
                self.refused = true;
                None
            }
            (Some(power), _) => Some(LegRequest::Power(power)),
            // A leg that the operator moves is not a host's to move.
            (None, Some(Ask::Identify | Ask::TakeUpdate)) if !self.hosted => None,
            (None, Some(Ask::Identify)) => {
                Some(LegRequest::Identify { plan: self.leg.plan, seed: self.leg.seed })
            }
            (None, Some(Ask::Cancel)) => Some(LegRequest::Cancel),
            (None, Some(Ask::TakeUpdate)) => Some(LegRequest::TakeUpdate),
            (None, None) => None,
        };
        self.explain(told, rises || self.refused);
    }

    /// Digital inputs of each joint.
    fn inputs(&self, told: &LegTold<N>) -> [u32; N] {
        let bit = |is_set: bool, reason: RefusalReason| u32::from(is_set) * reason.bit();
        use RefusalReason::{Blocked, NoReference, NotCalibrated, SwitchOpen};
        let whole = [Blocked, NoReference, NotCalibrated]
            .into_iter()
            .fold(bit(told.held, SwitchOpen), |bits, reason| bits | bit(told.has(reason), reason));
        core::array::from_fn(|joint| {
            let of_joint = self.refusal.filter(|refusal| usize::from(refusal.joint) == joint);
            let status = told.joints.get(joint).map_or(0, |status| status.inputs);
            whole | status | of_joint.map_or(0, |refusal| refusal.reason.bit())
        })
    }

    /// Why a step towards enabled is refused, from when it is until that is over.
    fn explain(&mut self, told: &LegTold<N>, asked: bool) {
        let before = self.refusal.filter(|refusal| self.hosted && still(told, *refusal));
        let own = told.stands_against().filter(|_| asked && self.hosted);
        let own = own.map(|reason| Refusal { joint: Refusal::LEG, reason });
        self.refusal = told.refused.filter(|_| self.hosted).or(own).or(before);
        if self.refusal.is_some() && self.refusal == before {
            return;
        }
        // What the leg refused it records itself.
        self.noted = self.refusal.filter(|refusal| refusal.joint == Refusal::LEG).or(self.noted);
        let report = self.refusal.map(|refusal| {
            let [low, high, ..] = told.causes.to_le_bytes();
            let information = [refusal.number(), refusal.reason as u8, low, high, 0];
            ErrorReport { code: NoticeCode::NotEnabled.number(), information }
        });
        self.axes.iter_mut().for_each(|axis| axis.refused = report);
    }

    /// What the leg is to do now; targets that came since the leg was heard are in it.
    pub fn order(&mut self) -> LegOrder<N> {
        LegOrder {
            commands: self.hosted.then(|| self.axes.each_ref().map(Axis::command)),
            request: self.request.take(),
            // A bus that is lost takes nothing from who does not use it.
            faults: self.axes.each_mut().map(|axis| axis.take_fault().filter(|_| self.hosted)),
            may_return: self.axes.each_ref().map(Axis::may_return),
            refused: self.noted.take(),
        }
    }

    /// A host has the drive: the operator's contacts only hold it off.
    #[must_use]
    pub const fn is_hosted(&self) -> bool {
        self.hosted
    }

    /// A sample of the leg's log.
    pub fn log(&mut self, logged: &LoggedSample<N>) {
        self.leg.log.push(logged);
    }

    /// Models accepted and kept on this board (2100:7).
    #[must_use]
    pub const fn generation(&self) -> u32 {
        self.leg.generation
    }

    /// The same, after one was kept or recalled.
    pub fn set_generation(&mut self, generation: u32) {
        self.leg.generation = generation;
    }

    /// Of the next identification's random numbers (2100:5, 6).
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.leg.seed
    }

    /// Nodes as they are.
    #[must_use]
    pub const fn nodes(&self) -> &[Node; N] {
        &self.nodes
    }
}

/// Whether what was refused would be refused again.
fn still<const N: usize>(told: &LegTold<N>, refusal: Refusal) -> bool {
    let Some(joint) = told.joints.get(usize::from(refusal.joint)) else { return told.has(refusal.reason) };
    let lasts = match refusal.reason {
        RefusalReason::Moving => joint.velocity.0.abs() > RETURN_SPEED,
        RefusalReason::OutOfRange => joint.inputs & refusal.reason.bit() != 0,
        _ => joint.drive == DriveState::SwitchedOn,
    };
    lasts && joint.drive != DriveState::OperationEnabled
}

#[cfg(test)]
mod tests;
