//! A leg on the bus: the whole firmware and plant behind two nodes, put together by the board's own `Station`.
//!
//! ```text
//! each servo tick   leg --LegTold--> station,  station --LegOrder--> leg,  six PWM periods
//! any time          frame -> nodes; nodes -> mailboxes of three frames, as the controller of the STM32 has them
//! each millisecond  a step of what hosts want kept (`operation::Storing`)
//! ```
//!
//! While its flash is written the processor stands ([`super::storing`]): the plant goes on, nobody ticks, and of what hosts send the controller
//! keeps three frames.
//!
//! The enabling switch stays a contact in the operator's hand, on the bus as without it: here a simulated operator holds it from the
//! start, and what the hand asks for by closing it is over before the nodes say that they are there.

use scarab::bus::drive::{AxisConstants, Mode};
use scarab::bus::station::{LegRequest, LegTold, Station};
use scarab::bus::{Controller, Frame, Identity, KeptNode, Node, NodeId, Storing};
use scarab::leg::{ControlRequest, Fault, JointStatus};
use scarab::safety::PowerRequest;
use scarab::servo::SERVO_RATE_HZ;
use scarab::store::KeptModel;

use super::memory::Memory;
use super::storing::{Asked, Flashing};
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

/// Nodes and axes of which nothing was kept.
fn station<const N: usize, const B: usize>(context: &Context<N, B>, first: u8) -> Station<N, LOG> {
    let configuration = &context.configuration;
    let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
    let constants = configuration.joints.each_ref().map(|joint| AxisConstants {
        rated_torque: joint.limits().torque_cap(),
        rated_current: joint.current,
        modes,
    });
    Station::new(
        core::array::from_fn(|joint| own_number(first, joint)),
        Identity::scarab(u32::from(first), "simulated"),
        constants,
        configuration.plan,
        configuration.swarm_seed,
    )
}

/// Firmware, plant and nodes of a leg of `N` joints.
#[derive(Clone, Debug)]
pub struct Board<const N: usize, const B: usize> {
    /// Firmware and plant.
    pub rig: Rig<N, B>,
    /// What of each node's waits for the wire.
    pub mailboxes: [Mailbox; N],
    station: Station<N, LOG>,
    memory: Memory,
    context: Context<N, B>,
    flashing: Flashing<N>,
    /// How the controller does.
    controller: Controller,
    /// Number of the first node, unless the memory says otherwise.
    first: u8,
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
        let station = station(&context, first);
        let mailboxes = core::array::from_fn(|_| Mailbox::default());
        let mut board = Self {
            rig,
            mailboxes,
            station,
            memory,
            context,
            flashing: Flashing::new(),
            controller: Controller::Active,
            first,
        };
        for why in board.recall() {
            eprintln!("warning: {why}");
        }
        Ok(board)
    }

    /// The power was away and is back: everything is forgotten but what the memory holds.
    pub fn power_on(&mut self) {
        self.rig.power_on();
        self.station = station(&self.context, self.first);
        self.mailboxes.iter_mut().for_each(Mailbox::clear);
        (self.controller, self.flashing) = (Controller::Active, Flashing::new());
        self.recall();
    }

    /// What the memory holds, as after the start; what it holds of another leg, or damaged, is left, and hosts are told. Why, of each.
    fn recall(&mut self) -> Vec<String> {
        let mut lost = Vec::new();
        match self.memory.model(&self.context.configuration) {
            Ok(Some((model, generation))) if self.rig.leg.adopt(model) => {
                self.station.set_generation(generation);
            }
            Ok(Some(_)) => lost.push("the kept model: not taken".into()),
            Ok(None) => {}
            Err(why) => lost.push(why),
        }
        for joint in 0..N {
            match self.memory.objects(joint) {
                Ok(bytes) => self.station.recall(joint, &bytes.unwrap_or_default()),
                Err(why) => lost.push(why),
            }
        }
        if !lost.is_empty() {
            self.station.storing(Storing::Failed);
        }
        lost
    }

    /// A frame on the bus; the node that sent it does not hear it.
    pub fn hear(&mut self, frame: &Frame, now_ns: u64, sender: Option<usize>) {
        if self.controller == Controller::Off {
            return;
        }
        if sender.is_some() || self.flashing.hear(frame, now_ns) {
            self.station.hear(frame, now_ns / 1000, sender, self.rig.leg.identification());
        }
    }

    /// Who keeps what hosts want kept.
    pub fn flashing(&mut self) -> &mut Flashing<N> {
        &mut self.flashing
    }

    /// What the nodes have to say goes to their mailboxes.
    pub fn speak(&mut self, now_ns: u64) {
        if self.controller == Controller::Off || self.flashing.stands(now_ns) {
            return;
        }
        for (joint, mailbox) in self.mailboxes.iter_mut().enumerate() {
            while mailbox.len() < MAILBOXES {
                match self.station.poll(joint, now_ns / 1000, self.rig.leg.identification()) {
                    Some(frame) => mailbox.push(frame, now_ns),
                    None => break,
                }
            }
        }
    }

    /// What the controller does from now on, and whether the nodes are told; one that is off the bus neither hears nor speaks.
    pub fn set_controller(&mut self, controller: Controller, told: bool) {
        self.controller = controller;
        if controller == Controller::Off {
            self.mailboxes.iter_mut().for_each(Mailbox::clear);
        }
        if told {
            self.station.on_controller(controller, self.rig.leg.identification());
        }
    }

    /// One servo tick of the leg; each of its PWM periods is shown when it is over.
    pub fn tick(&mut self, now_ns: u64, mut show: impl FnMut(&Rig<N, B>)) {
        if self.flashing.stands(now_ns) {
            return self.rig.stand_still(u64::from(PERIODS_PER_TICK));
        }
        self.wake(now_ns);
        self.station.watch(now_ns / 1000, self.rig.leg.identification());
        self.keep(now_ns);
        self.exchange();
        for _ in 0..PERIODS_PER_TICK {
            self.rig.advance();
            show(&self.rig);
        }
        if let Some(logged) = self.rig.output.as_ref().and_then(|output| output.logged) {
            self.station.log(&logged);
        }
    }

    /// What crosses the seam, once per tick.
    fn exchange(&mut self) {
        let (drive, control) = (self.rig.state(), self.rig.leg.control());
        let output = self.rig.output.as_ref();
        let status = |joint| output.and_then(|output| self.rig.leg.joint_status(joint, output));
        self.station.told(&LegTold {
            joints: core::array::from_fn(|joint| {
                status(joint).unwrap_or(JointStatus { drive, ..JointStatus::NONE })
            }),
            activity: control.activity(),
            change: [control.change().is_some(), control.is_update_offered()],
            refused: output.is_some_and(|output| output.servo.decision.refused.is_some()),
            held: self.rig.hand.enabling,
            blocked: self.rig.causes() != 0,
            rests: output.is_none(),
        });
        let order = self.station.order();
        for (joint, code) in order.faults.into_iter().enumerate() {
            if let Some(code) = code {
                self.rig.leg.report(Fault { code, joint: joint as u8 });
            }
        }
        match order.request {
            Some(LegRequest::Power(power)) => self.rig.ask(ControlRequest::Power(power)),
            Some(LegRequest::Identify { plan, seed }) => {
                self.rig.leg.prepare(plan, seed);
                self.flashing.model_kept = false;
                self.rig.ask(ControlRequest::Identify);
            }
            Some(LegRequest::Cancel) => self.rig.leg.cancel(),
            Some(LegRequest::TakeUpdate) => self.rig.ask(ControlRequest::TakeUpdate),
            None => {}
        }
        match &order.commands {
            Some(commands) => self.rig.leg.command(commands),
            None => self.rig.leg.let_go(),
        }
    }

    /// What came while the processor stood is heard: the frames that the controller had room for, and that others are lost.
    fn wake(&mut self, now_ns: u64) {
        let results = self.rig.leg.identification();
        if self.flashing.recovers() {
            self.station.on_controller(self.controller, results);
        }
        let (frames, lost) = self.flashing.take_heard();
        if lost {
            self.station.on_controller(Controller::Overrun, results);
        }
        for frame in frames {
            self.station.hear(&frame, now_ns / 1000, None, results);
        }
    }

    /// Takes what hosts want kept a step further.
    fn keep(&mut self, now_ns: u64) {
        let mut objects = [KeptNode::NOTHING; N];
        if !self.flashing.is_under_way()
            && let Some(what) = self.station.take_store(&mut objects)
        {
            self.station.storing(Storing::Busy);
            let (leg, generation) = (&self.rig.leg, self.station.generation() + 1);
            let is_accepted = leg.control().verdict().is_some_and(|verdict| verdict.is_accepted());
            let model =
                leg.control().model().filter(|_| is_accepted && !self.flashing.model_kept).map(|model| {
                    let (leg, seed) = (leg.identification(), self.station.seed());
                    KeptModel::of(&self.context.configuration, leg, model, generation, seed)
                });
            self.flashing.ask(Asked { what, objects, model });
        }
        let Some((done, asked)) = self.flashing.step(now_ns, &mut self.rig, &mut self.memory) else { return };
        if let Some(generation) = asked.generation().filter(|_| done) {
            self.station.set_generation(generation);
        }
        self.station.stored(done, &asked.objects);
    }

    /// The image of the memory.
    pub fn memory(&mut self) -> &mut Memory {
        &mut self.memory
    }

    /// Nodes as they are.
    #[must_use]
    pub fn nodes(&self) -> &[Node; N] {
        self.station.nodes()
    }
}
