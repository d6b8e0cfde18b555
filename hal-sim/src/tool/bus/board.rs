//! A leg on the bus: the whole firmware and plant behind two nodes, as a board will put them together.
//!
//! ```text
//! each servo tick   leg --JointStatus--> axes,  axes --JointCommand, PowerRequest, faults--> leg,  six PWM periods
//! any time          frame -> nodes; nodes -> mailboxes of three frames, as the controller of the STM32 has them
//! ```
//!
//! The enabling switch stays a contact in the operator's hand, on the bus as without it: here a simulated operator holds it from the
//! start, and what the hand asks for by closing it is over before the nodes say that they are there.

use scarab::bus::drive::{Axis, AxisConstants, Coupling, Mode};
use scarab::bus::identification::{Ask, JointObjects, LegObjects};
use scarab::bus::{Frame, Identity, LONGEST, NmtState, Node, NodeId, kept_node_id};
use scarab::leg::{ControlRequest, Fault, JointStatus};
use scarab::safety::PowerRequest;
use scarab::servo::SERVO_RATE_HZ;

use super::memory::Memory;
use super::wire::Mailbox;
use crate::tool::error::ToolError;
use crate::tool::faults::rig::{Hand, Rig};
use crate::tool::leg_file::LegFile;
use crate::tool::pair::Context;
use crate::world::periods::PERIODS_PER_TICK;

/// Length of a servo tick.
pub const TICK_NS: u64 = 1_000_000_000 / SERVO_RATE_HZ as u64;
/// Samples of the log that wait for a host: 4 s, 48 KB; what a board has room for is another matter.
pub const LOG: usize = 2000;
/// Transmit mailboxes of the STM32's controller.
const MAILBOXES: usize = 3;
/// A contact counts after 20 ms, and each of the three steps takes one of the operator's rounds.
const CONTACT_TICKS: u32 = SERVO_RATE_HZ / 10;
const HOLDS: Hand = Hand { enabling: true, start: false };
/// Digital inputs beyond CiA 402's: the enabling switch is held; something forbids to enable.
const ENABLING: u32 = 1 << 16;
const BLOCKED: u32 = 1 << 17;

/// Both contacts open, then the enabling switch held. What closing it asks for, once, is to enable the leg: it holds its pose for some
/// milliseconds and is taken off again, so that from then on only the bus asks.
fn hold_the_switch<const N: usize, const B: usize>(rig: &mut Rig<N, B>) {
    let mut run = |hand: Hand, ask: Option<PowerRequest>| {
        rig.hand = hand;
        if let Some(power) = ask {
            rig.ask(ControlRequest::Power(power));
        }
        for _ in 0..CONTACT_TICKS {
            for _ in 0..PERIODS_PER_TICK {
                rig.advance();
            }
        }
    };
    run(Hand::default(), None);
    run(HOLDS, None);
    run(HOLDS, Some(PowerRequest::DisableVoltage));
}

/// The number of a node whose memory does not say otherwise.
fn own_number(first: u8, joint: usize) -> NodeId {
    const FIRST: NodeId = NodeId::new(1).expect("a number");
    NodeId::new(first.saturating_add(joint as u8)).unwrap_or(FIRST)
}

/// Firmware, plant and nodes of a leg of `N` joints.
pub struct Board<const N: usize, const B: usize> {
    /// Firmware and plant.
    pub rig: Rig<N, B>,
    /// What of each node's waits for the wire.
    pub mailboxes: [Mailbox; N],
    nodes: [Node; N],
    axes: [Axis; N],
    leg: LegObjects<N, LOG>,
    coupling: Coupling,
    refused: bool,
    memory: Memory,
    identity: Identity,
    first: u8,
    context: Context<N, B>,
    has_kept: bool,
    /// The accepted model is in the memory.
    model_kept: bool,
}

impl<const N: usize, const B: usize> Board<N, B> {
    /// A board whose nodes have the numbers from `first` on unless its memory says otherwise; the operator holds the switch.
    pub fn new(
        leg: &LegFile,
        context: Context<N, B>,
        seed: u64,
        first: u8,
        memory: Memory,
    ) -> Result<Self, ToolError> {
        let mut rig = Rig::new(leg, &context, seed)?;
        hold_the_switch(&mut rig);
        let joints = &context.configuration.joints;
        let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
        let axes = core::array::from_fn(|joint| {
            Axis::new(AxisConstants {
                rated_torque: joints[joint].limits().torque_cap(),
                rated_current: joints[joint].current,
                modes,
            })
        });
        let identity = Identity::scarab(u32::from(first), "simulated");
        let mut board = Self {
            rig,
            mailboxes: core::array::from_fn(|_| Mailbox::default()),
            nodes: core::array::from_fn(|joint| Node::new(own_number(first, joint), identity)),
            axes,
            leg: LegObjects::new(context.configuration.plan, context.configuration.swarm_seed, 0),
            coupling: Coupling::default(),
            refused: false,
            memory,
            identity,
            first,
            context,
            has_kept: false,
            model_kept: false,
        };
        board.recall();
        Ok(board)
    }

    /// What the memory holds, as after the start; what it holds of another leg, or damaged, is said and left.
    fn recall(&mut self) {
        match self.memory.model(&self.context.configuration) {
            Ok(Some((model, generation))) if self.rig.leg.adopt(model) => self.leg.generation = generation,
            Ok(_) => {}
            Err(why) => eprintln!("warning: {why}"),
        }
        (0..N).for_each(|joint| self.restart(joint));
    }

    /// A node begins anew, with what the memory holds of it.
    fn restart(&mut self, joint: usize) {
        let kept = self.memory.objects(joint);
        let axis = &mut self.axes[joint];
        let own = own_number(self.first, joint);
        let number = kept.as_deref().and_then(kept_node_id).unwrap_or(own);
        self.nodes[joint] = Node::new(number, self.identity);
        if let Some(kept) = kept {
            self.nodes[joint].recall(&kept, axis);
        }
    }

    /// A frame on the bus; the node that sent it does not hear it.
    pub fn hear(&mut self, frame: &Frame, now_ns: u64, sender: Option<usize>) {
        for joint in (0..N).filter(|joint| Some(*joint) != sender) {
            let mut objects = JointObjects {
                axis: &mut self.axes[joint],
                joint,
                leg: &mut self.leg,
                results: self.rig.leg.identification(),
            };
            self.nodes[joint].on_frame(frame, now_ns / 1000, &mut objects);
            if self.nodes[joint].state() == NmtState::Initialising {
                self.restart(joint);
            }
        }
        if let Some(defaults) = self.leg.take_store() {
            self.keep(defaults);
        }
    }

    /// What the nodes have to say goes to their mailboxes.
    pub fn speak(&mut self, now_ns: u64) {
        for joint in 0..N {
            while self.mailboxes[joint].len() < MAILBOXES {
                let mut objects = JointObjects {
                    axis: &mut self.axes[joint],
                    joint,
                    leg: &mut self.leg,
                    results: self.rig.leg.identification(),
                };
                match self.nodes[joint].poll(now_ns / 1000, &mut objects) {
                    Some(frame) => self.mailboxes[joint].push(frame, now_ns),
                    None => break,
                }
            }
        }
    }

    /// One servo tick of the leg.
    pub fn tick(&mut self) {
        self.exchange();
        for _ in 0..PERIODS_PER_TICK {
            self.rig.advance();
        }
        if let Some(output) = &self.rig.output {
            if let Some(logged) = &output.logged {
                self.leg.log.push(logged);
            }
            let control = self.rig.leg.control();
            self.leg.activity = control.activity();
            self.leg.change = [control.change().is_some(), control.is_update_offered()];
        }
    }

    /// What crosses the seam, once per tick.
    fn exchange(&mut self) {
        let drive = self.rig.state();
        let inputs =
            (u32::from(self.rig.hand.enabling) * ENABLING) | (u32::from(self.rig.causes() != 0) * BLOCKED);
        for (joint, axis) in self.axes.iter_mut().enumerate() {
            let status = self.rig.output.as_ref().and_then(|output| self.rig.leg.joint_status(joint, output));
            axis.update(&JointStatus {
                inputs,
                ..status.unwrap_or(JointStatus { drive, ..JointStatus::NONE })
            });
            if let Some(code) = axis.take_fault() {
                self.rig.leg.report(Fault { code, joint: joint as u8 });
            }
        }
        let refused = core::mem::take(&mut self.refused)
            || self.rig.output.as_ref().is_some_and(|output| output.servo.decision.refused.is_some());
        let power = self.coupling.power(self.axes.each_mut(), drive, refused);
        let blocked = self.rig.causes() != 0;
        match (power, self.leg.take_asked()) {
            (Some(power), _) => {
                use PowerRequest::{EnableOperation, Shutdown, SwitchOn};
                self.refused = blocked && matches!(power, Shutdown | SwitchOn | EnableOperation);
                self.rig.ask(ControlRequest::Power(power));
            }
            (None, Some(Ask::Identify)) => {
                self.rig.leg.prepare(self.leg.plan, self.leg.seed);
                self.model_kept = false;
                self.rig.ask(ControlRequest::Identify);
            }
            (None, Some(Ask::Cancel)) => self.rig.leg.cancel(),
            (None, Some(Ask::TakeUpdate)) => self.rig.ask(ControlRequest::TakeUpdate),
            (None, None) => {}
        }
        self.rig.leg.command(&self.axes.each_ref().map(Axis::command));
    }

    /// Keeps all objects and the accepted model, or forgets everything.
    fn keep(&mut self, defaults: bool) {
        let state = self.rig.state();
        self.has_kept = true;
        if defaults {
            self.memory.forget(state);
            return;
        }
        for joint in 0..N {
            let mut bytes = [0; LONGEST];
            if let Ok(length) = self.nodes[joint].keep(&mut self.axes[joint], &mut bytes) {
                self.memory.keep_objects(state, joint, &bytes[..length]);
            }
        }
        let leg = &self.rig.leg;
        let is_accepted = leg.control().verdict().is_some_and(|verdict| verdict.is_accepted());
        let next = self.leg.generation + 1;
        if is_accepted
            && !self.model_kept
            && self.memory.keep_model(state, &self.context.configuration, leg, next, self.leg.seed)
        {
            (self.leg.generation, self.model_kept) = (next, true);
        }
    }

    /// Whether something was kept or forgotten since this was asked.
    pub fn take_kept(&mut self) -> bool {
        core::mem::take(&mut self.has_kept)
    }

    /// The image of the memory.
    pub fn memory(&mut self) -> &mut Memory {
        &mut self.memory
    }

    /// Nodes as they are.
    #[must_use]
    pub fn nodes(&self) -> &[Node; N] {
        &self.nodes
    }
}
