//! The firmware's levels composed as on the board, over simulated registers.
//!
//! Fault campaign, `serve` and complete drives run this one composition. It makes no decisions: each method
//! runs one level of `scarab::operation`, and the owner of the plant calls them in this order:
//!
//! ```text
//! every 48th period   housekeeping
//! when requested      servo, then thread level; the servo is requested after the last axis' sixth tick
//! every period        current tick of each axis
//! when requested      assistance, after the servo
//! every 12th period   watch
//! when requested      bus (`tool::bus::board`)
//! ```
//!
//! Limits: on the board a higher level interrupts a lower one. Here a called level runs to its end between
//! two current ticks. Not simulated: a servo tick in the middle of a housekeeping round or of a slice of the
//! search, an emergency stop between two instructions (see the unit tests of `operation::current`), and the
//! delay before the watchdog takes a new reload value (see those of `operation::storing`).

use core::num::NonZeroU32;

use hal_sim::drive::counter::steps;
use hal_sim::drive::description::{AxisDescription, CompleteDescription};
use hal_sim::world::World;
use scarab::board::odrive_v3_6::settings::drives;
use scarab::bus::device::Device;
use scarab::bus::identification::Results;
use scarab::hal::{AxisSample, CURRENT_RATE_HZ, Frame, JointSample};
use scarab::leg::{
    AbsoluteAngle, AxisFault, Control, ControlOutput, ControlRequest, Following, JointZero, Wearing,
};
use scarab::motor::{Chopper, SenseScale};
use scarab::operation::{
    AssistLevel, AssistQueues, AxisState, BusQueues, BusRound, CurrentLoops, EventQueue, Handover,
    Housekeeper, HousekeepingSettings, IdentificationLevel, Queues, RATE_HZ, ServoLevel, Signals, Slice,
    StoreJob, Tick, Watch,
};
use scarab::safety::{BrakeDelays, GUARD_RATE_HZ, SupplyLimits};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::board::locked::Locked;
use crate::board::registers::Registers;
use crate::board::{housekeeping_settings, ready};
use crate::pair::DeviceLeg;

/// PWM periods between two rounds of the housekeeping, and between two checks of the watch.
const PERIODS_PER_ROUND: u64 = (CURRENT_RATE_HZ / RATE_HZ) as u64;
const PERIODS_PER_LOOK: u64 = (CURRENT_RATE_HZ / GUARD_RATE_HZ) as u64;
/// Processor cycles of one period; the second axis is delayed by half of it.
const CYCLES: NonZeroU32 = NonZeroU32::new(7000).expect("more than one");
/// Converter code of a 48 V bus, until the first reading.
const BUS_CODE: u16 = 3136;

/// Bus level without its registers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BusLevel<const N: usize> {
    queues: Locked<BusQueues<N>>,
    round: BusRound,
    /// Request of a host to store data.
    pub(crate) storage: Handover<StoreJob<N>>,
}

/// Contacts of the board and conversions in one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    /// Emergency-stop contact is open.
    pub(crate) emergency_stop: bool,
    /// A gate driver reports a fault.
    pub(crate) gate_fault: bool,
    /// Both shunt currents of the axis were converted.
    pub(crate) complete: bool,
    /// The bus voltage was converted.
    pub(crate) supply: bool,
}

impl Conditions {
    /// Conditions without any fault.
    pub(crate) const SOUND: Self =
        Self { emergency_stop: false, gate_fault: false, complete: true, supply: true };
}

/// Levels of a board of `N` axes, except the leg on which they work.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels<const N: usize> {
    /// Registers, contacts and pins.
    pub registers: Registers<N>,
    /// Signals shared by all levels.
    pub(crate) signals: Signals<N>,
    queues: Locked<Queues<N>>,
    /// Current loops, level 0.
    pub(crate) loops: CurrentLoops<N>,
    /// Bus level, if the board is on a bus.
    pub(crate) bus: Option<Box<BusLevel<N>>>,
    events: Locked<EventQueue<N>>,
    assist_queues: Locked<AssistQueues<N>>,
    servo: ServoLevel<N>,
    housekeeper: Housekeeper<N>,
    identification: IdentificationLevel,
    assist: AssistLevel<N>,
    watch: Watch<N>,
    settings: HousekeepingSettings<N>,
    chopper: Chopper,
    supply: SupplyLimits,
    holding_brake: Option<BrakeDelays>,
    following: Option<Following<N>>,
}

impl<const N: usize> Levels<N> {
    /// Ready board: motors calibrated on a stand, counters at the initial pose of the world's leg. `believed`
    /// is the leg assumed by the firmware, `description` the simulated one.
    pub fn ready<const B: usize>(
        believed: &LegFile,
        description: &CompleteDescription<N>,
        leg: &DeviceLeg<N, B>,
        world: &mut World<N>,
        seed: u64,
    ) -> Result<Self, ToolError> {
        let (axes, chopper) = ready(believed, description, world, seed)?;
        let settings = housekeeping_settings(believed)?;
        let mut levels =
            Self::cold(settings, chopper, believed.supply_limits(), believed.brake_delays(), leg, None);
        levels.signals.begin_servo();
        levels.signals.statistics.see_bus(BUS_CODE);
        levels.registers.servo_due = true;
        levels.loops = loops(axes.map(AxisState::running), chopper);
        // A ready joint counts from its zero.
        let zero = |axis: AxisDescription| {
            let joint = AbsoluteAngle::from_steps(steps(axis.joint_encoder?.zero));
            Some(JointZero { rotor: 0, joint, setting: 0 })
        };
        levels.housekeeper = Housekeeper::ready(settings).with_joint_zeros(description.axes.map(zero));
        Ok(levels)
    }

    /// Board at power-up: nothing calibrated or started.
    fn cold<const B: usize>(
        settings: HousekeepingSettings<N>,
        chopper: Chopper,
        supply: SupplyLimits,
        holding_brake: Option<BrakeDelays>,
        leg: &DeviceLeg<N, B>,
        following: Option<Following<N>>,
    ) -> Self {
        let signals = Signals::new();
        let volt_per_code = SenseScale::ODRIVE_3_6.volt_per_code;
        Self {
            registers: Registers::new(),
            watch: Watch::new(&signals),
            signals,
            queues: Locked::new(Queues::new()),
            loops: loops([AxisState::OFF; N], chopper),
            bus: following.is_some().then(Box::default),
            events: Locked::new(EventQueue::new()),
            assist_queues: Locked::new(AssistQueues::new()),
            servo: ServoLevel::new(
                leg.control(),
                drives::derating(SenseScale::DIVIDER),
                volt_per_code,
                following,
            )
            .with_supply(supply)
            .with_holding_brake(holding_brake),
            housekeeper: Housekeeper::new(settings),
            identification: IdentificationLevel::new(leg.identification().swarm_seed()),
            assist: AssistLevel::new(),
            settings,
            chopper,
            supply,
            holding_brake,
            following,
        }
    }

    /// Restarts the image and the bus controller. Contacts and pins stay as they are.
    pub(crate) fn boot<const B: usize>(&mut self, leg: &DeviceLeg<N, B>) {
        let mut registers = Registers::new();
        registers.contacts = self.registers.contacts;
        registers.gates = self.registers.gates;
        registers.thermistors = self.registers.thermistors;
        registers.encoders = self.registers.encoders;
        let following = self.following.take();
        let (supply, holding_brake) = (self.supply, self.holding_brake);
        let cold = Self::cold(self.settings, self.chopper, supply, holding_brake, leg, following);
        *self = Self { registers, ..cold };
    }

    /// Connects the board to a bus, before its first tick.
    pub(crate) fn join_bus<const B: usize>(&mut self, leg: &DeviceLeg<N, B>, following: Following<N>) {
        let volt_per_code = SenseScale::ODRIVE_3_6.volt_per_code;
        let derating = drives::derating(SenseScale::DIVIDER);
        self.servo = ServoLevel::new(leg.control(), derating, volt_per_code, Some(following))
            .with_supply(self.supply)
            .with_holding_brake(self.holding_brake);
        (self.bus, self.following) = (Some(Box::default()), Some(following));
    }

    /// Replaces the limits of the supply current.
    pub(crate) fn limit_supply(&mut self, limits: SupplyLimits) {
        (self.servo, self.supply) = (self.servo.clone().with_supply(limits), limits);
    }

    /// Shares of the torque that the limits of the supply current leave: of one that drives a joint, and of
    /// one that a joint drives.
    pub(crate) fn supply_shares(&self) -> [f32; 2] {
        self.servo.supply_shares()
    }

    /// Exchanges two axes with their calibrations: their motors are on each other's connectors.
    pub(crate) fn exchange(&mut self, one: usize, other: usize) {
        if let (Some(first), Some(second)) =
            (self.loops.axis_state(one).copied(), self.loops.axis_state(other).copied())
        {
            for (axis, stage) in [(one, second), (other, first)] {
                if let Some(slot) = self.loops.axis_state_mut(axis) {
                    *slot = stage;
                }
            }
        }
    }

    /// Queues between the levels.
    pub(crate) fn queues(&mut self) -> &mut Queues<N> {
        self.queues.get()
    }

    /// Housekeeping, level 6, in the periods in which it is due.
    pub(crate) fn housekeeping(&mut self) {
        let mut ends = self.queues.get().split(self.events.get()).housekeeping;
        self.housekeeper.round(&mut ends, &self.signals, &mut self.registers);
    }

    /// Whether a round of the housekeeping is due in this period.
    pub(crate) fn is_round_due(period: u64) -> bool {
        period.is_multiple_of(PERIODS_PER_ROUND)
    }

    /// Servo, level 1; `None` while the joints' samples are invalid.
    pub(crate) fn servo(&mut self, control: &mut Control<N>, gravity: [f32; 3]) -> Option<ControlOutput<N>> {
        let mut ends = self.queues.get().split(self.events.get()).servo;
        ends.assist = Some(self.assist_queues.get().split().0);
        ends.host = self.bus.as_mut().map(|bus| bus.queues.get().split().1);
        let output = self.servo.tick(control, gravity, &mut ends, &self.signals, &mut self.registers);
        self.signals.statistics.servo_ticks.add();
        output
    }

    /// Assistance, level 5, when it is due.
    pub fn assist(&mut self) {
        if core::mem::take(&mut self.registers.assist_due) {
            let (_, mut ends) = self.assist_queues.get().split();
            self.assist.run(&mut ends);
        }
    }

    /// Thread level: processes the servo's samples, then a slice of the search.
    pub fn identify<const B: usize>(&mut self, leg: &mut DeviceLeg<N, B>, evaluations: u32) -> Slice<N> {
        let mut ends = self.queues.get().split(self.events.get()).identification;
        let (_, identification) = leg.halves();
        self.identification.receive(identification, &mut ends, |_| {}, |_| {});
        while ends.notes.dequeue().is_some() {}
        // Results are read directly, so nothing is published.
        self.identification.published();
        self.identification.work(identification, evaluations, &mut ends, &self.signals, |_| {})
    }

    /// Seed of the search of this identification.
    pub(crate) fn seed(&self) -> u64 {
        self.identification.seed()
    }

    /// Whether the leg of this identification is empty or worn, if known.
    pub(crate) fn wearing(&self) -> Option<Wearing> {
        self.identification.wearing()
    }

    /// Current tick, level 0, of one axis in a period.
    pub(crate) fn current(&mut self, axis: usize, period: u64, sample: &AxisSample, conditions: Conditions) {
        let Conditions { emergency_stop, gate_fault, complete, supply } = conditions;
        let now = (period as u32).wrapping_mul(CYCLES.get()).wrapping_add(axis as u32 * CYCLES.get() / 2);
        let tick = Tick { now, emergency_stop, gate_fault, complete, supply, sample: *sample };
        self.registers.encoders[axis] = sample.encoder_count;
        let mut ends = self.queues.get().current();
        self.loops.tick(axis, &tick, &mut ends, &self.signals, &mut self.registers);
    }

    /// Watch, level 6, at the end of each period: guard of the current ticks, and the watchdog's check.
    pub fn watch(&mut self, period: u64) {
        if period.is_multiple_of(PERIODS_PER_LOOK) {
            self.watch.check(&self.signals, &mut self.registers);
        }
    }

    /// Newest joint samples waiting for the servo.
    pub(crate) fn samples(&self) -> Option<[JointSample; N]> {
        let queues = self.queues.lock();
        let mut samples = [JointSample::default(); N];
        for (joint, sample) in samples.iter_mut().enumerate() {
            *sample = queues.newest_sample(joint)?;
        }
        Some(samples)
    }

    /// Requests an action from the servo that the operator's contacts cannot request.
    pub(crate) fn ask(&mut self, request: ControlRequest) {
        let _ = self.queues().requests().enqueue(request);
    }

    /// First axis that switched itself off, and its fault.
    pub fn fault(&self) -> Option<(usize, AxisFault)> {
        (0..N).find_map(|axis| Some((axis, self.loops.axis_state(axis)?.fault()?)))
    }

    /// Receives a frame, level 4; without free space the frame is lost.
    pub(crate) fn receive(&mut self, frame: &Frame) {
        let Some(bus) = &mut self.bus else { return };
        if bus.queues.get().split().0.enqueue(*frame).is_err() {
            self.registers.can.overrun = true;
        }
        self.registers.bus_due = true;
    }

    /// Round of the bus, level 5, at this time.
    pub(crate) fn bus_round<R: Results, const LOG: usize>(
        &mut self,
        now_ns: u64,
        device: &mut Device<N, LOG>,
        results: &R,
    ) {
        let Some(bus) = &mut self.bus else { return };
        self.registers.bus_due = false;
        self.registers.set_time(now_ns);
        let BusLevel { queues, round, storage } = &mut **bus;
        let (_, _, mut ends, _) = queues.get().split();
        round.round(device, &mut ends, storage, &self.signals, &mut self.registers, results);
    }
}

impl<const N: usize> Default for BusLevel<N> {
    fn default() -> Self {
        Self {
            queues: Locked::new(BusQueues::new()),
            round: BusRound::new(),
            storage: Handover::new(StoreJob::NOTHING),
        }
    }
}

fn loops<const N: usize>(states: [AxisState; N], chopper: Chopper) -> CurrentLoops<N> {
    CurrentLoops::new(states, CYCLES, Some(chopper), SenseScale::ODRIVE_3_6.volt_per_code)
}
