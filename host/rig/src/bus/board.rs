//! Simulated board on the bus: firmware and plant of a leg with two nodes, at the priority levels of the
//! board.
//!
//! ```text
//! servo tick        six PWM periods of the rig; a bus round (`operation::BusRound`) at the servo's request
//! at any time       received frame or empty mailbox -> bus round
//! each millisecond  one step of storing (`operation::Storing`)
//! ```
//!
//! While the flash is written the processor stalls (`crate::bus::storing`). The plant continues, no
//! level runs, and the controller holds three received frames.
//!
//! The operator's enabling switch is a contact, with or without a bus. A simulated operator holds it from the
//! start. The enable request of closing it has ended before the boot-up messages. `Board::forget` and
//! `Board::enable_by_contacts` give other beginnings.

use hal_sim::world::periods::PERIODS_PER_TICK;
use scarab::board::odrive_v3_6::settings::drives;
use scarab::bus::device::Device;
use scarab::bus::drive::AxisConstants;
use scarab::bus::{Frame, Identity, Node, NodeId, Storing};
use scarab::hal::{Contacts, Controller};
use scarab::leg::{ControlRequest, IdentifiedModel, Wearing};
use scarab::operation::Slice;
use scarab::safety::PowerRequest;
use scarab::servo::SERVO_RATE_HZ;
use scarab::store::{Key, ModelRecord};
use scarab_base::error::ToolError;
use scarab_client::wire::Mailbox;
use scarab_identify::formats::leg_file::{EncoderFile, LegFile};

use crate::bus::storing::Flashing;
use crate::faulty_board::Rig;
use crate::operator;
use crate::pair::Context;
use crate::parameter_file::memory::{Memory, model_name};

/// Length of a servo tick, ns.
pub const TICK_NS: u64 = 1_000_000_000 / SERVO_RATE_HZ as u64;
/// Log samples that can wait for a host: 4 s, 48 KB. A real board may have less memory.
pub(crate) const LOG: usize = 2000;
const PERIOD_NS: u64 = TICK_NS / PERIODS_PER_TICK as u64;
/// Duration of each contact step. A contact is debounced for 20 ms, and each step takes one of the operator's
/// rounds.
const CONTACT_TICKS: u32 = SERVO_RATE_HZ / 10;
const HOLDS: Contacts = Contacts { enabling: true, start: false };

/// Opens both contacts, then holds the enabling switch. Closing it requests once to enable the leg. The drive
/// is switched off again some milliseconds later, so that from then on only the bus requests power.
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

/// What distinguishes boards that run the same firmware.
#[derive(Clone, Copy, Debug)]
pub struct Label {
    /// Default node-ID of the first node.
    pub(crate) first: u8,
    /// Serial number.
    pub(crate) serial: u32,
}

impl Label {
    /// A single board.
    pub(crate) const SINGLE: Self = Self { first: 1, serial: 1 };
}

/// Default node-ID of a joint.
fn own_number(first: u8, joint: usize) -> NodeId {
    const FIRST: NodeId = NodeId::new(1).expect("a number");
    NodeId::new(first.saturating_add(joint as u8)).unwrap_or(FIRST)
}

/// Creates nodes and axes without stored parameters.
fn device<const N: usize, const B: usize>(
    context: &Context<N, B>,
    encoders: &[EncoderFile; N],
    label: Label,
) -> Device<N, LOG> {
    let configuration = &context.configuration;
    let constants = core::array::from_fn(|joint| {
        let encoder = &encoders[joint];
        AxisConstants::new(
            &configuration.joints[joint],
            encoder.counts,
            encoder.ratio as f32,
            drives::BANDWIDTH,
        )
    });
    Device::new(
        core::array::from_fn(|joint| own_number(label.first, joint)),
        Identity::scarab(label.serial, "simulated"),
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
    device: Device<N, LOG>,
    memory: Memory,
    context: Context<N, B>,
    flashing: Flashing<N>,
    label: Label,
    encoders: [EncoderFile; N],
}

impl<const N: usize, const B: usize> Board<N, B> {
    /// Creates a board with the label's default node-IDs; stored ones have precedence. The operator holds the
    /// switch.
    pub fn new(
        leg: &LegFile,
        context: Context<N, B>,
        seed: u64,
        label: Label,
        memory: Memory,
    ) -> Result<Self, ToolError> {
        let mut rig = Rig::on_a_bus(leg, &context, seed)?;
        hold_the_switch(&mut rig);
        let encoders = core::array::from_fn(|joint| leg.joints[joint].encoder);
        let device = device(&context, &encoders, label);
        let mut board = Self { rig, device, memory, context, flashing: Flashing::new(), label, encoders };
        for why in board.recall() {
            eprintln!("warning: {why}");
        }
        Ok(board)
    }

    /// Simulates a power cycle: only the content of the flash remains.
    pub(crate) fn power_on(&mut self) {
        self.rig.power_on();
        self.device = device(&self.context, &self.encoders, self.label);
        self.flashing = Flashing::new();
        self.recall();
    }

    /// Begins as a board that knows neither calibration nor zeros; the operator's contacts are open.
    pub(crate) fn forget(&mut self) {
        self.rig.hand = Contacts::default();
        self.power_on();
    }

    /// Lets the operator's contacts enable the leg; returns whether they do.
    pub(crate) fn enable_by_contacts(&mut self) -> bool {
        operator::enable(&mut self.rig)
    }

    /// Recalls the content of the flash. Invalid or foreign records are skipped and reported to hosts;
    /// returns the reasons.
    fn recall(&mut self) -> Vec<String> {
        let mut lost = Vec::new();
        let mut newest = 0;
        for key in Key::MODELS {
            match self.memory.model(&self.context.configuration, key) {
                Ok(Some((model, provenance))) if self.take_model(key, model, provenance.wearing()) => {
                    newest = newest.max(provenance.generation);
                }
                Ok(Some(_)) => lost.push(format!("{}: not accepted", model_name(key))),
                Ok(None) => {}
                Err(why) => lost.push(why),
            }
        }
        self.device.set_generation(newest);
        for joint in 0..N {
            match self.memory.objects(joint) {
                Ok(bytes) => self.device.recall(joint, &bytes.unwrap_or_default()),
                Err(why) => lost.push(why),
            }
        }
        if !lost.is_empty() {
            self.device.storing(Storing::Failed);
        }
        lost
    }

    /// Takes a restored model into use as the board does; returns whether the leg took it.
    fn take_model(&mut self, key: Key, model: IdentifiedModel<N>, wearing: Option<Wearing>) -> bool {
        let leg = &mut self.rig.leg;
        (key != Key::Model || leg.adopt(model)) && wearing.is_none_or(|wearing| leg.set_model(wearing, model))
    }

    /// Receives a frame of another controller at its end.
    pub(crate) fn receive(&mut self, frame: &Frame, now_ns: u64) {
        if self.mailbox().is_off || !self.flashing.receive(frame, now_ns) {
            return;
        }
        self.rig.board.receive(frame);
        self.round(now_ns);
    }

    /// Continues after a frame of this board was sent and its mailbox is empty.
    pub(crate) fn sent(&mut self, now_ns: u64) {
        if !self.flashing.stands(now_ns) {
            self.round(now_ns);
        }
    }

    /// Frames of this board that wait for the bus.
    pub(crate) fn mailbox(&mut self) -> &mut Mailbox {
        &mut self.rig.board.registers.can.mailbox
    }

    /// Runs a bus round (level 5).
    fn round(&mut self, now_ns: u64) {
        let Rig { board, leg, .. } = &mut self.rig;
        board.bus_round(now_ns, &mut self.device, leg.identification());
    }

    /// Storing of parameters.
    pub(crate) fn flashing(&mut self) -> &mut Flashing<N> {
        &mut self.flashing
    }

    /// Sets the state of the controller, and whether the firmware can read it. A bus-off controller neither
    /// receives nor sends.
    pub(crate) fn set_controller(&mut self, controller: Controller, readable: bool) {
        let can = &mut self.rig.board.registers.can;
        can.mailbox.is_off = controller == Controller::Off;
        can.state = if readable { controller } else { Controller::Active };
    }

    /// Connects or disconnects the bus plug. Without it no frame passes; the controller is error passive, as
    /// no frame is acknowledged.
    pub(crate) fn set_plugged(&mut self, plugged: bool) {
        self.set_controller(if plugged { Controller::Active } else { Controller::Passive }, true);
        self.mailbox().is_off = !plugged;
    }

    /// Simulates one servo tick of the leg; each of its PWM periods is shown at its end.
    pub(crate) fn tick(&mut self, now_ns: u64, mut show: impl FnMut(&Rig<N, B>)) {
        if self.flashing.stands(now_ns) {
            return self.rig.stand_still(u64::from(PERIODS_PER_TICK));
        }
        self.wake(now_ns);
        self.keep(now_ns);
        for period in 0..u64::from(PERIODS_PER_TICK) {
            self.rig.advance();
            if let Slice::Judged(Some(model)) = core::mem::replace(&mut self.rig.slice, Slice::Idle) {
                let (identification, level) = (self.rig.leg.identification(), &self.rig.board);
                let (configuration, seed) = (&self.context.configuration, level.seed());
                let record =
                    ModelRecord::new(configuration, identification, &model, 0, seed, level.wearing());
                self.flashing.accept(record);
            }
            if self.rig.board.registers.bus_due {
                self.round(now_ns + period * PERIOD_NS);
            }
            show(&self.rig);
        }
    }

    /// Resumes after a stall: delivers the controller's frames and signals a loss.
    fn wake(&mut self, now_ns: u64) {
        let (frames, lost) = self.flashing.take_queued();
        self.rig.board.registers.can.overrun |= lost;
        for frame in &frames {
            self.rig.board.receive(frame);
        }
        if lost || !frames.is_empty() {
            self.round(now_ns);
        }
    }

    /// Runs a step of storing and serves the watchdog.
    fn keep(&mut self, now_ns: u64) {
        self.flashing.step(now_ns, &mut self.rig, &mut self.memory);
        self.rig.write_watchdog();
    }

    /// Content of the flash.
    pub fn memory(&mut self) -> &mut Memory {
        &mut self.memory
    }

    /// Whether a frame is an emergency message of this board.
    pub(crate) fn is_emergency(&self, frame: &Frame) -> bool {
        frame.full().is_some() && self.device.reports_once(frame)
    }

    /// Returns the nodes.
    pub fn nodes(&self) -> &[Node; N] {
        self.device.nodes()
    }
}
