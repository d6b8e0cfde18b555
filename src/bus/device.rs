//! One board on the bus: the nodes and axes of one leg, their coupling to the leg, and the stored parameters
//! that a reset recalls.
//!
//! Why here: the board's task and the simulated leg connect the same parts in the same order. That order
//! depends on values only, so it exists once. The caller provides frames, clock, leg and flash.
//!
//! ```text
//! frame received           receive(frame, now, sender)          a reset node recalls its stored parameters
//! mailbox free             poll(joint, now) -> frame            repeat until there is none
//! leg has ticked           update(LegStatus), order() -> LegOrder   commands, one request, faults of a host
//! host wrote 2160:1        take_step()                          once
//! host wrote 1F51, 1F50    take_program_command(), take_program_byte()
//! host wrote 1010 or 1011  take_store(into) -> Keeping          then storing(Busy), stored(done, objects)
//! ```
//!
//! **Control source.** The operator controls the leg until a host has sent a controlword other than 0. Until
//! then the bus sends no commands or requests, and the statuswords show the leg's state. Afterwards the host
//! controls it, until every node was reset and the drive is off. The enabling switch always stays with the
//! operator. While it is open, or an inhibit reason is active, no step towards enabled is passed on. The host
//! sees a refused request.
//!
//! **Refusals.** A refused step towards enabled is an error of both nodes (FF0E, with joint, reason and
//! inhibit reasons). The error begins with the first request and ends when the reason is gone or the leg is
//! enabled. It is reported once, however often the host asks, and a next one a second after it at the
//! earliest. The leg's side writes the record. A refused session of assistance is reported in the same way.
//!
//! Cost per tick: two polls of a node and one copy of the leg's values. Measured: docs/results/bus.md.

use super::commissioning::{BoardStatus, CommissioningStep};
use super::communication::Identity;
use super::drive::{Axis, AxisConstants, Coupling, LoopBandwidths};
use super::emergency::ErrorReport;
use super::identification::{JointObjects, LegCommand, LegObjects, Results};
use super::nmt::Reset;
use super::node::{FrameEffect, Node, Storing};
use super::node_id::NodeId;
use super::program::{ProgramCommand, ProgramStatus};
use super::stored_parameters::StoredNode;
use crate::hal::{Controller, Frame};
use crate::leg::{
    Activity, AssistShares, DriveState, FaultCode, JointCommand, JointStatus, LoggedSample, NoticeCode,
    Permission, Plan, PowerRequest, RETURN_SPEED, Refusal, RefusalReason, Wearing,
};

mod storage;

/// Gap between two calls, us, beyond which the board cannot have received frames.
const STOOD_US: u64 = 2_000;
/// Least time between the begins of two reported refusals.
const REFUSAL_US: u64 = 1_000_000;

/// State of the leg after one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LegStatus<const N: usize> {
    /// Status of each joint. The inputs are replaced here.
    pub(crate) joints: [JointStatus; N],
    /// Activity of the leg.
    pub(crate) activity: Activity,
    /// Model monitor: the model no longer fits; an update is offered.
    pub(crate) change: [bool; 2],
    /// Why the last power request was refused.
    pub(crate) refused: Option<Refusal>,
    /// Whether the operator holds the enabling switch.
    pub(crate) held: bool,
    /// Whether an inhibit reason is active.
    pub(crate) blocked: bool,
    /// Inhibit reasons, one bit each.
    pub(crate) causes: u32,
    /// Whether every axis is calibrated.
    pub(crate) calibrated: bool,
    /// Whether the leg does not tick, because calibration or reference is missing.
    pub(crate) rests: bool,
}

impl<const N: usize> LegStatus<N> {
    /// State of a leg that does not tick yet.
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

    /// Whether a reason applies to the leg as a whole.
    const fn has(&self, reason: RefusalReason) -> bool {
        match reason {
            RefusalReason::SwitchOpen => !self.held,
            RefusalReason::Blocked => self.blocked,
            RefusalReason::NoReference => self.rests,
            RefusalReason::NotCalibrated => self.rests && !self.calibrated,
            _ => false,
        }
    }

    /// First reason that applies, or `None`.
    fn blocking_reason(&self) -> Option<RefusalReason> {
        use RefusalReason::{Blocked, NoReference, NotCalibrated, SwitchOpen};
        [NotCalibrated, NoReference, Blocked, SwitchOpen].into_iter().find(|reason| self.has(*reason))
    }
}

/// Request to the leg, besides the joints' targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LegRequest {
    /// Step of the drive's power states.
    Power(PowerRequest),
    /// Start an identification.
    Identify {
        /// One-time or sequential identification.
        plan: Plan,
        /// Seed of the swarm's random numbers.
        seed: u64,
        /// Whether the leg is empty or worn, if a host said so.
        wearing: Option<Wearing>,
    },
    /// Cancel the identification.
    Cancel,
    /// Use the offered model update.
    TakeUpdate,
    /// Begin assistance.
    Assist(AssistShares),
    /// Fade the assistance out.
    EndAssist,
}

/// Orders for the leg's next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LegOrder<const N: usize> {
    /// Command of each joint; `None` while no host controls the drive.
    pub(crate) commands: Option<[JointCommand; N]>,
    /// Request, issued once.
    pub(crate) request: Option<LegRequest>,
    /// Fault of each joint that the leg must react to; issued once.
    pub(crate) faults: [Option<FaultCode>; N],
    /// Whether each joint may be enabled outside its range.
    pub(crate) may_return: [bool; N],
    /// Request that the bus refused; issued once, for a record.
    pub(crate) refused: Option<Refusal>,
}

/// Store operation requested by a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreCommand {
    /// Store all objects, and the model if one was accepted since the last store.
    All,
    /// Erase everything; defaults apply after the next start.
    Defaults,
}

/// Nodes, axes and objects of one leg; see the module. The log holds `LOG` samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Device<const N: usize, const LOG: usize> {
    nodes: [Node; N],
    axes: [Axis; N],
    leg: LegObjects<N, LOG>,
    coupling: Coupling,
    own: [NodeId; N],
    identity: Identity,
    /// Stored parameters that a reset recalls: what the store has confirmed.
    stored: [StoredNode; N],
    /// Whether a host controls the drive.
    hosted: bool,
    /// A host that does not control the drive has stopped it.
    stopped: bool,
    /// A request was held back because the leg would refuse it.
    refused: bool,
    /// Last refusal, while its reason lasts.
    refusal: Option<Refusal>,
    /// Error report of that refusal, and the time from which it may begin.
    report: Option<ErrorReport>,
    report_us: u64,
    /// Refusal to be recorded by the leg's side.
    noted: Option<Refusal>,
    request: Option<LegRequest>,
    /// Last reported state of the controller.
    controller: Controller,
    /// State of the store.
    storing: Storing,
    /// Time of the last call.
    last_call_us: u64,
    /// Pending reset of each node, whose stored parameters must be recalled.
    pending_reset: [Option<Reset>; N],
}

impl<const N: usize, const LOG: usize> Device<N, LOG> {
    /// Creates nodes with these node-IDs and without stored parameters. No boot-up message has been sent.
    pub fn new(
        own: [NodeId; N],
        identity: Identity,
        constants: [AxisConstants; N],
        plan: Plan,
        seed: u64,
    ) -> Self {
        let mut joints = 0..N;
        Self {
            nodes: own.map(|number| Node::new(number, identity.for_joint(joints.next().unwrap_or_default()))),
            axes: constants.map(Axis::new),
            leg: LegObjects::new(plan, seed, 0, identity.checksum),
            coupling: Coupling::default(),
            own,
            identity,
            stored: [StoredNode::NOTHING; N],
            hosted: false,
            stopped: false,
            refused: false,
            refusal: None,
            report: None,
            report_us: 0,
            noted: None,
            request: None,
            controller: Controller::Active,
            storing: Storing::Done,
            last_call_us: 0,
            pending_reset: [None; N],
        }
    }

    /// Sets the inhibit time of every node's emergency messages, for tests of their order.
    #[cfg(test)]
    pub(crate) fn with_emergency_inhibit(mut self, inhibit: u16) -> Self {
        self.nodes.iter_mut().for_each(|node| node.communication_mut().emergency.inhibit = inhibit);
        self
    }

    /// Handles a frame for every node but its sender. Returns whether a node may have something to send or
    /// do. A reset node recalls its stored parameters at the next call, once for any number of frames.
    pub(crate) fn receive<R: Results>(
        &mut self,
        frame: &Frame,
        now_us: u64,
        sender: Option<usize>,
        results: &R,
    ) -> bool {
        self.check_gap(now_us);
        let mut concerns = false;
        for joint in (0..N).filter(|joint| Some(*joint) != sender) {
            let received = self.with(joint, results, |node, objects| node.on_frame(frame, now_us, objects));
            match received.unwrap_or(FrameEffect::Nothing) {
                FrameEffect::Nothing => continue,
                FrameEffect::Something => {}
                FrameEffect::Reset(reset) => {
                    if let Some(pending_reset) = self.pending_reset.get_mut(joint) {
                        *pending_reset = Some(reset).max(*pending_reset);
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

    /// Returns the next frame that a node has to send; call until `None`. While the controller is bus-off,
    /// nothing is returned: such a frame would be outdated when sent.
    pub(crate) fn poll<R: Results>(&mut self, joint: usize, now_us: u64, results: &R) -> Option<Frame> {
        self.recall_reset();
        if self.controller == Controller::Off {
            return None;
        }
        self.with(joint, results, |node, objects| node.poll(now_us, objects))?
    }

    /// Whether the frame is an emergency or boot-up message of a node, which is sent only once.
    pub fn reports_once(&self, frame: &Frame) -> bool {
        self.nodes.iter().any(|node| node.reports_once(frame))
    }

    /// Restarts all timeouts if the board could not receive since the last call.
    pub(crate) fn check_gap(&mut self, now_us: u64) {
        let since_us = now_us.saturating_sub(self.last_call_us);
        self.last_call_us = self.last_call_us.max(now_us);
        if since_us > STOOD_US {
            self.nodes.iter_mut().for_each(|node| node.stood_still(now_us));
        }
    }

    /// Checks all timeouts, independently of the bus load. Call it every millisecond; a longer gap restarts
    /// the timeouts.
    pub(crate) fn watch<R: Results>(&mut self, now_us: u64, results: &R) {
        self.recall_reset();
        self.check_gap(now_us);
        for joint in 0..N {
            self.with(joint, results, |node, objects| node.check_timeouts(now_us, objects));
        }
    }

    /// Handles a change of the CAN controller's state.
    pub(crate) fn on_controller<R: Results>(&mut self, controller: Controller, results: &R) {
        if controller != Controller::Overrun {
            self.controller = controller;
        }
        for joint in 0..N {
            self.with(joint, results, |node, objects| node.on_controller(controller, objects));
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

    /// Takes over the leg's state after a tick. Fetch the resulting request with [`Self::order`] before the
    /// next tick.
    pub(crate) fn update(&mut self, status: &LegStatus<N>) {
        let drive = status.joints.first().map_or(DriveState::NotReadyToSwitchOn, |joint| joint.drive);
        let inputs = self.inputs(status);
        let is_busy = !matches!(status.activity, Activity::Idle | Activity::Follow);
        self.leg.update(status.activity, status.change);
        let (mut rises, mut stops) = (false, false);
        let joints = self.axes.iter_mut().zip(&mut self.nodes).zip(status.joints.iter().zip(inputs));
        for ((axis, node), (joint, inputs)) in joints {
            if axis.update(&JointStatus { inputs, ..*joint }) {
                node.void_waiting();
            }
            if is_busy {
                axis.void_targets();
            }
            rises |= axis.take_rises();
            stops |= axis.take_stop();
        }
        let commanded = self.axes.iter().any(Axis::is_commanded);
        // A leg that is about to be enabled needs an owner that steps it down.
        let is_rising = matches!(drive, DriveState::ReadyToSwitchOn | DriveState::SwitchedOn);
        let is_up = is_rising || drive.permission() != Permission::Off;
        self.hosted = commanded || self.hosted && is_up;
        let refused = core::mem::take(&mut self.refused) || status.refused.is_some();
        for axis in &mut self.axes {
            axis.hosted = self.hosted && (axis.is_commanded() || axis.hosted);
        }
        if !self.hosted {
            self.coupling.follow_leg(self.axes.each_mut(), drive);
        }
        let power = self.coupling.power(self.axes.each_mut(), drive, refused).filter(|_| self.hosted);
        // A step of the drive goes first; other requests wait for the next tick. An identification requested
        // on the way up is discarded: nothing requested before the leg is enabled starts afterwards.
        let requested = match power {
            None => self.leg.take_request(),
            Some(power) if power.enables() && self.leg.requests_motion() => self.leg.take_request(),
            Some(_) => None,
        };
        self.stopped = !self.hosted && (stops || matches!(requested, Some(LegCommand::Cancel)));
        self.request = match (power, requested) {
            (Some(power), _) if power.enables() && status.blocking_reason().is_some() => {
                self.refused = true;
                None
            }
            (Some(power), _) => Some(LegRequest::Power(power)),
            (None, _) if stops && !self.hosted && is_up => {
                Some(LegRequest::Power(PowerRequest::DisableVoltage))
            }
            // While the operator controls the leg, a host must not start a motion.
            (None, Some(LegCommand::Identify | LegCommand::TakeUpdate | LegCommand::Assist))
                if !self.hosted =>
            {
                None
            }
            (None, Some(LegCommand::Identify)) => {
                let (plan, seed, wearing) = (self.leg.plan, self.leg.seed, self.leg.wearing);
                Some(LegRequest::Identify { plan, seed, wearing })
            }
            (None, Some(LegCommand::Assist)) => Some(LegRequest::Assist(self.leg.shares)),
            (None, Some(LegCommand::EndAssist)) => Some(LegRequest::EndAssist),
            (None, Some(LegCommand::Cancel)) => Some(LegRequest::Cancel),
            (None, Some(LegCommand::TakeUpdate)) => Some(LegRequest::TakeUpdate),
            (None, None) => None,
        };
        self.explain(status, rises || self.refused);
        // Here and not where frames are sent: a refusal of one tick is reported although no mailbox is free.
        for (node, axis) in self.nodes.iter_mut().zip(&self.axes) {
            node.on_drive(axis.error());
        }
    }

    /// Digital inputs of each joint (60FD).
    fn inputs(&self, status: &LegStatus<N>) -> [u32; N] {
        let bit = |is_set: bool, reason: RefusalReason| u32::from(is_set) * reason.bit();
        use RefusalReason::{Blocked, NoReference, NotCalibrated, SwitchOpen};
        let whole = [Blocked, NoReference, NotCalibrated]
            .into_iter()
            .fold(bit(status.held, SwitchOpen), |bits, reason| bits | bit(status.has(reason), reason));
        core::array::from_fn(|joint| {
            let of_joint = self.refusal.filter(|refusal| usize::from(refusal.joint) == joint);
            let status = status.joints.get(joint).map_or(0, |status| status.inputs);
            whole | status | of_joint.map_or(0, |refusal| refusal.reason.bit())
        })
    }

    /// Updates the refusal of a step towards enabled, and its error report.
    fn explain(&mut self, status: &LegStatus<N>, requested: bool) {
        let joint = self.axes.iter().position(Axis::is_out_of_order);
        let order = joint.map(|joint| Refusal { joint: joint as u8, reason: RefusalReason::NoTransition });
        let order = order.filter(|_| self.hosted);
        let lasts = |refusal: &Refusal| Some(*refusal) == order || self.hosted && still(status, *refusal);
        let before = self.refusal.filter(lasts);
        let own = status.blocking_reason().filter(|_| requested && self.hosted);
        let own = own.map(|reason| Refusal { joint: Refusal::LEG, reason });
        self.refusal = status.refused.filter(|_| self.hosted).or(own).or(before).or(order);
        if self.refusal.is_none() || self.refusal != before {
            // The leg records its own refusals.
            let is_own = |refusal: &Refusal| {
                let is_leg = refusal.joint == Refusal::LEG && refusal.reason != RefusalReason::NoAssistance;
                is_leg || Some(*refusal) == order
            };
            self.noted = self.refusal.filter(is_own).or(self.noted);
            self.report = self.refusal.map(|refusal| {
                let [low, middle, high, _] = status.causes.to_le_bytes();
                let information = [refusal.number(), refusal.reason as u8, low, middle, high];
                ErrorReport { code: NoticeCode::NotEnabled.number(), information }
            });
        }
        let reported = self.axes.first().and_then(|axis| axis.refused);
        let is_due = self.report.is_none() || self.last_call_us >= self.report_us;
        if self.report != reported && is_due {
            if self.report.is_some() {
                self.report_us = self.last_call_us.saturating_add(REFUSAL_US);
            }
            self.axes.iter_mut().for_each(|axis| axis.refused = self.report);
        }
    }

    /// Returns the orders for the leg; targets received since [`Self::update`] are included.
    pub(crate) fn order(&mut self) -> LegOrder<N> {
        LegOrder {
            commands: self.hosted.then(|| self.axes.each_ref().map(Axis::command)),
            request: self.request.take(),
            // A lost bus is a fault only if a host controls the drive.
            faults: self.axes.each_mut().map(|axis| axis.take_fault().filter(|_| self.hosted)),
            may_return: self.axes.each_ref().map(Axis::may_return),
            refused: self.noted.take(),
        }
    }

    /// Bandwidths of each joint's loops that a host has set.
    pub(crate) fn bandwidths(&self) -> [LoopBandwidths; N] {
        self.axes.each_ref().map(Axis::bandwidths)
    }

    /// Whether a host controls the drive. The operator's contacts can then only inhibit it.
    pub(crate) const fn is_hosted(&self) -> bool {
        self.hosted
    }

    /// Whether a host that does not control the drive has stopped it since the update before.
    pub(crate) const fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// Takes over the board's state and telemetry.
    pub(crate) fn update_board(&mut self, status: &BoardStatus<N>) {
        self.leg.board.update(status);
    }

    /// Takes the commissioning step that a host asked for.
    pub(crate) fn take_step(&mut self) -> Option<CommissioningStep> {
        self.leg.board.take_step()
    }

    /// Takes over the status of a new image. A change may follow an erase, in which nothing was received and
    /// a board's clock did not advance.
    pub(crate) fn update_program(&mut self, status: ProgramStatus) {
        if self.leg.program.update(status) {
            self.nodes.iter_mut().for_each(|node| node.stood_still(self.last_call_us));
        }
    }

    /// Takes the command for the program that a host wrote.
    pub(crate) fn take_program_command(&mut self) -> Option<ProgramCommand> {
        self.leg.program.take_command()
    }

    /// Takes the next byte of a new image.
    pub(crate) fn take_program_byte(&mut self) -> Option<u8> {
        self.leg.program.take_byte()
    }

    /// Adds a sample to the log.
    pub(crate) fn log(&mut self, logged: &LoggedSample<N>) {
        self.leg.log.push(logged);
    }

    /// Returns the number of models accepted and stored on this board (2100:7).
    pub(crate) const fn generation(&self) -> u32 {
        self.leg.generation
    }

    /// Sets the number of accepted models, after one was stored or recalled.
    pub fn set_generation(&mut self, generation: u32) {
        self.leg.generation = generation;
    }

    /// Returns the seed of the next identification's random numbers (2100:5, 6).
    pub const fn seed(&self) -> u64 {
        self.leg.seed
    }

    /// Returns the nodes.
    pub const fn nodes(&self) -> &[Node; N] {
        &self.nodes
    }
}

/// Whether the reason of a refusal still applies.
fn still<const N: usize>(status: &LegStatus<N>, refusal: Refusal) -> bool {
    let Some(joint) = status.joints.get(usize::from(refusal.joint)) else {
        return status.has(refusal.reason);
    };
    let lasts = match refusal.reason {
        RefusalReason::Moving => joint.velocity.0.abs() > RETURN_SPEED,
        RefusalReason::OutOfRange => joint.inputs & refusal.reason.bit() != 0,
        // The joint's controlword decides, not the leg.
        RefusalReason::NoTransition => false,
        _ => joint.drive == DriveState::SwitchedOn,
    };
    lasts && !joint.drive.is_enabled()
}

#[cfg(test)]
mod tests;
