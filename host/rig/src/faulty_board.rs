//! The whole firmware with the whole plant, one PWM period at a time, with faults on the registers between
//! them.
//!
//! The firmware is the board's own composition of levels (`Levels`); only the registers differ. Order of
//! the levels in one period:
//!
//! ```text
//! every 48th period   housekeeping: contacts -> requests; calibration, reference, resets; registers and
//!                    temperatures when due
//! when it is due      servo: samples, request -> leg -> targets; then the identification
//! every period        plant -> samples -> faults -> current loops -> bridges
//! ```
//!
//! The watchdog is simulated at the end of each period (`watchdog.rs`).

use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, Contacts, Sample};
use scarab::leg::{ControlOutput, Following, axis_code};
use scarab::operation::{AxisState, Outcome, Slice};
use scarab::safety::{FaultCode, InhibitReason};

mod view;
mod watchdog;

use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use self::watchdog::Watchdog;
use crate::board::levels::{Conditions, Levels};
use crate::board::registers::WARM_CODE;
use crate::pair::{Context, DeviceLeg, EVALUATIONS_PER_TICK, Pair};
use hal_sim::faults::{Channel, Injector};
use hal_sim::world::World;

/// PWM periods per second.
pub const PERIODS_PER_S: u64 = CURRENT_RATE_HZ as u64;
/// Duration of a PWM period, ms.
pub(crate) const PERIOD_MS: f64 = 1e3 / PERIODS_PER_S as f64;

/// Actions of the operator that may lead to an enabled drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Edges {
    /// Period of the last requested reset.
    pub(crate) reset: Option<u64>,
    /// Period of the last closing of the enabling switch.
    pub(crate) closed: Option<u64>,
}

/// Firmware, plant and the faults between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig<const N: usize, const B: usize> {
    /// The leg, both halves.
    pub leg: Box<DeviceLeg<N, B>>,
    /// The plant.
    pub(crate) world: World<N>,
    /// The injected faults.
    pub injector: Injector,
    /// The operator's contacts.
    pub hand: Contacts,
    /// Output of the last servo tick.
    pub(crate) output: Option<ControlOutput<N>>,
    /// Slice of the identification after the last servo tick.
    pub(crate) slice: Slice<N>,
    /// PWM periods since the start.
    pub period: u64,
    /// Hash of everything that has crossed the registers.
    pub(crate) hash: u64,
    /// Faults whose detectors are disabled, to prove that the campaign detects their absence.
    pub(crate) blind: &'static [FaultCode],
    /// All levels of the board.
    pub board: Box<Levels<N>>,
    /// Leg in its state after power-on.
    cold: Box<DeviceLeg<N, B>>,
    watchdog: Watchdog,
    /// The watchdog has reset the board.
    restarted: bool,
    edges: Edges,
    bus_code: u16,
    /// First fault that an axis reported since the last reset.
    axis_fault: Option<FaultCode>,
    gravity: [f32; 3],
}

impl<const N: usize, const B: usize> Rig<N, B> {
    /// A ready board with its leg at rest, drive off, contacts open.
    pub fn new(leg: &LegFile, context: &Context<N, B>, seed: u64) -> Result<Self, ToolError> {
        let pair = Pair::new(leg, context, seed)?;
        let board = pair.board.ok_or_else(|| ToolError::input("faults need complete drives"))?;
        Ok(Self {
            world: pair.world,
            injector: Injector::new(seed),
            hand: Contacts::default(),
            output: None,
            slice: Slice::Idle,
            period: 0,
            hash: FNV_BASIS,
            blind: &[],
            board,
            cold: pair.leg.clone(),
            watchdog: Watchdog::new(),
            restarted: false,
            edges: Edges::default(),
            bus_code: 0,
            axis_fault: None,
            gravity: context.gravity,
            leg: pair.leg,
        })
    }

    /// A board as made by [`Self::new`], on a bus.
    pub(crate) fn on_a_bus(leg: &LegFile, context: &Context<N, B>, seed: u64) -> Result<Self, ToolError> {
        let mut rig = Self::new(leg, context, seed)?;
        rig.board.join_bus(&rig.leg, Following::new(&context.configuration));
        Ok(rig)
    }

    /// Runs one PWM period.
    pub fn advance(&mut self) {
        self.hide();
        if self.board.registers.contacts.enabling != self.hand.enabling && self.hand.enabling {
            self.edges.closed = Some(self.period);
        }
        self.board.registers.contacts = self.hand;
        if Levels::<N>::is_round_due(self.period) {
            self.housekeeping();
        }
        if core::mem::take(&mut self.board.registers.servo_due) {
            self.servo();
        }
        self.current();
        self.period += 1;
        if self.board.registers.servo_due
            && let Some(mut joints) = self.board.samples()
        {
            for (joint, sample) in joints.iter_mut().enumerate() {
                self.injector.joint(joint, self.period, sample);
            }
            let observed = self.world.observe(&Sample { joints });
            self.board.queues().set_samples(&observed.joints);
        }
        self.watch();
    }

    fn is_blind(&self, code: Option<FaultCode>) -> bool {
        code.is_some_and(|code| self.blind.contains(&code))
    }

    /// Hides the inhibit reasons whose detectors are disabled.
    fn hide(&mut self) {
        let hidden = InhibitReason::ALL.into_iter().filter(|cause| self.is_blind(cause.code()));
        let bits = hidden.fold(0, |bits, cause| bits | cause.bit());
        self.board.signals.inhibit.hide(bits);
    }

    fn housekeeping(&mut self) {
        let (now, injector) = (self.period, &mut self.injector);
        if injector.happens(Channel::Housekeeping, 0, now) {
            return;
        }
        for joint in 0..N {
            let registers = &mut self.board.registers;
            registers.gates[joint] = !injector.happens(Channel::GateRegisters, joint, now);
            registers.thermistors[joint] = injector.thermistor(joint, now, WARM_CODE);
        }
        self.board.registers.sense(&self.world, injector, now);
        self.board.housekeeping();
        if core::mem::take(&mut self.board.registers.configured) {
            self.axis_fault = None;
            self.edges.reset = Some(now);
        }
    }

    fn servo(&mut self) {
        if self.injector.happens(Channel::Servo, 0, self.period) {
            return;
        }
        // A disabled detector must have no effect: leg and levels continue from their previous state.
        let before = (!self.blind.is_empty()).then(|| (self.leg.clone(), self.board.clone()));
        let output = self.board.servo(self.leg.halves().0, self.gravity);
        self.board.assist();
        if let Some((leg, board)) = before
            && self.is_blind(self.leg.control().state().fault().map(|fault| fault.code))
        {
            let ticks = self.board.signals.statistics.servo_ticks.get();
            (self.leg, self.board) = (leg, board);
            self.board.signals.statistics.servo_ticks.set(ticks);
            return;
        }
        self.slice = self.board.identify(&mut self.leg, EVALUATIONS_PER_TICK);
        self.output = output;
        if let Some(output) = &output {
            let mut targets = *output.servo.drive();
            for (joint, target) in targets.currents.iter_mut().enumerate() {
                *target = self.injector.target(joint, self.period, *target);
            }
            self.board.signals.set_targets(&targets);
        }
    }

    /// Level 0, both axes.
    fn current(&mut self) {
        let now = self.period;
        let registers = &self.board.registers;
        let brake = self.injector.brake(now, registers.brake);
        // Without their supply the gate drivers open every switch, independent of the timers.
        let commands = if registers.gates_on { registers.commands } else { [AxisCommand::OFF; N] };
        let mut samples = self.world.period(&commands, brake);
        let emergency_stop = self.injector.happens(Channel::EmergencyStop, 0, now);
        let gate_fault = self.injector.happens(Channel::GateFault, 0, now);
        for (joint, sample) in samples.iter_mut().enumerate() {
            self.injector.sample(joint, now, sample);
            if self.injector.happens(Channel::Tick, joint, now) {
                continue;
            }
            let supply = !self.injector.happens(Channel::SupplyConversion, 0, now);
            if !supply {
                sample.bus_code = self.bus_code;
            }
            self.bus_code = sample.bus_code;
            let complete = !self.injector.happens(Channel::Conversion, joint, now);
            let conditions = Conditions { emergency_stop, gate_fault, complete, supply };
            self.tick(joint, sample, conditions);
        }
        let commands = &self.board.registers.commands;
        self.hash = samples.iter().zip(commands).fold(self.hash, |hash, (sample, command)| {
            let [b, c] = sample.shunt_codes.map(u64::from);
            let seen = u64::from(sample.encoder_count) << 48 | b << 32 | c << 16 | u64::from(sample.bus_code);
            let duties = command
                .duty
                .iter()
                .fold(mixed(hash, seen), |hash, duty| mixed(hash, u64::from(duty.to_bits())));
            mixed(duties, u64::from(command.enabled))
        });
        self.hash = mixed(self.hash, u64::from(self.causes()));
    }

    /// Runs one tick of one axis. A fault of a disabled detector and its consequences are undone.
    fn tick(&mut self, joint: usize, sample: &AxisSample, conditions: Conditions) {
        let reported = self.board.queues().outcomes(joint).count();
        let before = (!self.blind.is_empty()).then(|| self.board.clone());
        self.board.current(joint, self.period, sample, conditions);
        let fault = self.board.loops.axis_state(joint).and_then(AxisState::fault).map(axis_code);
        if let Some(before) = before
            && self.is_blind(fault)
        {
            let mut board = before;
            core::mem::swap(&mut board.loops, &mut self.board.loops);
            if let (Some(now), Some(old)) =
                (board.loops.axis_state_mut(joint), self.board.loops.axis_state(joint))
            {
                *now = *old;
            }
            board.signals.statistics = self.board.signals.statistics.clone();
            board.registers.servo_due |= self.board.registers.servo_due;
            if let Some(samples) = self.board.samples() {
                board.queues().set_samples(&samples);
            }
            self.board = board;
            return;
        }
        let newest = self.board.queues().outcomes(joint).skip(reported).last();
        if let Some(Outcome::Fault { fault, .. }) = newest {
            self.axis_fault = self.axis_fault.or(Some(axis_code(*fault)));
        }
    }

    /// Flips a bit in an axis' constants (`Axis::flip_bit`) or in those of the servo's joint.
    pub(crate) fn upset(&mut self, of_axis: bool, joint: usize, number: u8, bit: u8) {
        if of_axis {
            if let Some(axis) = self.board.loops.axis_state_mut(joint).and_then(AxisState::axis_mut) {
                axis.flip_bit(number, bit);
            }
        } else {
            self.leg.flip_bit(joint, number, bit);
        }
    }

    /// Sets the values of an axis' modulation to NaN.
    pub(crate) fn spoil_modulation(&mut self, joint: usize) {
        if let Some(axis) = self.board.loops.axis_state_mut(joint).and_then(AxisState::axis_mut) {
            axis.invalidate_modulation();
        }
    }
}

const fn mixed(hash: u64, word: u64) -> u64 {
    (hash ^ word).wrapping_mul(FNV_PRIME)
}

/// Basis and prime of FNV-1a (Fowler, Noll, Vo), applied to words.
const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;
