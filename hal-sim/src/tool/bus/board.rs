//! A leg on the bus: the whole firmware and plant behind two nodes, level by level as on the board.
//!
//! ```text
//! each servo tick   six PWM periods of the rig; a round of the bus (`operation::BusRound`) whenever the servo requests one
//! any time          frame -> queue of the bus -> round; a mailbox of the controller is empty -> round
//! each millisecond  a step of what hosts want stored (`operation::Storing`)
//! ```
//!
//! While its flash is written the processor stands still ([`super::storing`]): the plant goes on, no level runs, and of what hosts send the
//! controller holds three frames.
//!
//! The enabling switch stays a contact in the operator's hand, on the bus as without it: here a simulated operator holds it from the
//! start, and what closing it requests is over before the nodes send their boot-up messages.

use scarab::bus::drive::{AxisConstants, Mode};
use scarab::bus::station::Station;
use scarab::bus::{Frame, Identity, Node, NodeId, Storing};
use scarab::hal::{Contacts, Controller};
use scarab::leg::ControlRequest;
use scarab::operation::Slice;
use scarab::safety::PowerRequest;
use scarab::servo::SERVO_RATE_HZ;
use scarab::store::KeptModel;

use super::memory::Memory;
use super::storing::Flashing;
use super::wire::Mailbox;
use crate::tool::error::ToolError;
use crate::tool::faults::rig::Rig;
use crate::tool::leg_file::{EncoderFile, LegFile};
use crate::tool::pair::Context;
use crate::world::periods::PERIODS_PER_TICK;

/// Length of a servo tick.
pub const TICK_NS: u64 = 1_000_000_000 / SERVO_RATE_HZ as u64;
/// Samples of the log that wait for a host: 4 s, 48 KB; what a board has room for is another matter.
pub const LOG: usize = 2000;
/// Length of a PWM period.
const PERIOD_NS: u64 = TICK_NS / PERIODS_PER_TICK as u64;
/// A contact counts after 20 ms, and each of the three steps takes one of the operator's rounds.
const CONTACT_TICKS: u32 = SERVO_RATE_HZ / 10;
const HOLDS: Contacts = Contacts { enabling: true, start: false };

/// Both contacts open, then the enabling switch held. What closing it asks for, once, is to enable the leg: it holds its pose for some
/// milliseconds and is taken off again, so that from then on only the bus asks.
fn hold_the_switch<const N: usize, const B: usize>(rig: &mut Rig<N, B>) {
    let mut run = |hand: Contacts, ask: Option<PowerRequest>| {
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
    run(Contacts::default(), None);
    run(HOLDS, None);
    run(HOLDS, Some(PowerRequest::DisableVoltage));
}

/// The number of a node whose memory does not say otherwise.
fn own_number(first: u8, joint: usize) -> NodeId {
    const FIRST: NodeId = NodeId::new(1).expect("a number");
    NodeId::new(first.saturating_add(joint as u8)).unwrap_or(FIRST)
}

/// Nodes and axes of which nothing was kept.
fn station<const N: usize, const B: usize>(
    context: &Context<N, B>,
    encoders: &[EncoderFile; N],
    first: u8,
) -> Station<N, LOG> {
    let configuration = &context.configuration;
    let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
    let constants = core::array::from_fn(|joint| {
        let (joint, encoder) = (&configuration.joints[joint], &encoders[joint]);
        AxisConstants {
            rated_torque: joint.limits().torque_cap(),
            rated_current: joint.current,
            modes,
            torque_per_ampere: joint.scale.torque_per_ampere,
            speed: joint.speed,
            counts_per_turn: encoder.counts,
            ratio: encoder.ratio as f32,
        }
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
    station: Station<N, LOG>,
    memory: Memory,
    context: Context<N, B>,
    flashing: Flashing<N>,
    /// Number of the first node, unless the memory says otherwise.
    first: u8,
    encoders: [EncoderFile; N],
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
        let mut rig = Rig::on_a_bus(leg, &context, seed)?;
        hold_the_switch(&mut rig);
        let encoders = core::array::from_fn(|joint| leg.joints[joint].encoder);
        let station = station(&context, &encoders, first);
        let mut board = Self { rig, station, memory, context, flashing: Flashing::new(), first, encoders };
        for why in board.recall() {
            eprintln!("warning: {why}");
        }
        Ok(board)
    }

    /// The power was away and is back: everything is forgotten but what the memory holds.
    pub fn power_on(&mut self) {
        self.rig.power_on();
        self.station = station(&self.context, &self.encoders, self.first);
        self.flashing = Flashing::new();
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

    /// A frame of another controller was on the bus until now.
    pub fn hear(&mut self, frame: &Frame, now_ns: u64) {
        if self.mailbox().is_off || !self.flashing.hear(frame, now_ns) {
            return;
        }
        self.rig.board.receive(frame);
        self.round(now_ns);
    }

    /// A frame of this board has left: its mailbox is empty.
    pub fn sent(&mut self, now_ns: u64) {
        if !self.flashing.stands(now_ns) {
            self.round(now_ns);
        }
    }

    /// Frames of this board that wait for the wire.
    pub fn mailbox(&mut self) -> &mut Mailbox {
        &mut self.rig.board.registers.can.mailbox
    }

    /// Level 5.
    fn round(&mut self, now_ns: u64) {
        let Rig { board, leg, .. } = &mut self.rig;
        board.bus_round(now_ns, &mut self.station, leg.identification());
    }

    /// Who keeps what hosts want kept.
    pub fn flashing(&mut self) -> &mut Flashing<N> {
        &mut self.flashing
    }

    /// State of the controller from now on, and whether the firmware can read it. A controller off the bus neither hears nor sends.
    pub fn set_controller(&mut self, controller: Controller, readable: bool) {
        let can = &mut self.rig.board.registers.can;
        can.mailbox.is_off = controller == Controller::Off;
        can.state = if readable { controller } else { Controller::Active };
    }

    /// Pulls the plug of the bus, or puts it back. Without it no frame passes; the controller is passive, since nobody acknowledges.
    pub fn set_plugged(&mut self, plugged: bool) {
        self.set_controller(if plugged { Controller::Active } else { Controller::Passive }, true);
        self.mailbox().is_off = !plugged;
    }

    /// One servo tick of the leg; each of its PWM periods is shown when it is over.
    pub fn tick(&mut self, now_ns: u64, mut show: impl FnMut(&Rig<N, B>)) {
        if self.flashing.stands(now_ns) {
            return self.rig.stand_still(u64::from(PERIODS_PER_TICK));
        }
        self.wake(now_ns);
        self.keep(now_ns);
        for period in 0..u64::from(PERIODS_PER_TICK) {
            self.rig.advance();
            if let Slice::Judged(Some(model)) = core::mem::replace(&mut self.rig.slice, Slice::Idle) {
                let (identification, seed) = (self.rig.leg.identification(), self.rig.board.seed());
                let model = KeptModel::of(&self.context.configuration, identification, &model, 0, seed);
                self.flashing.accept(model);
            }
            if self.rig.board.registers.bus_due {
                self.round(now_ns + period * PERIOD_NS);
            }
            show(&self.rig);
        }
    }

    /// After the processor stood still: the controller's frames are received, and a loss is seen.
    fn wake(&mut self, now_ns: u64) {
        let (frames, lost) = self.flashing.take_heard();
        self.rig.board.registers.can.overrun |= lost;
        for frame in &frames {
            self.rig.board.receive(frame);
        }
        if lost || !frames.is_empty() {
            self.round(now_ns);
        }
    }

    /// Takes what hosts want stored a step further.
    fn keep(&mut self, now_ns: u64) {
        self.flashing.step(now_ns, &mut self.rig, &mut self.memory);
        self.rig.write_watchdog();
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
