//! The whole firmware against the whole plant, one PWM period at a time, with faults on the ports between.
//!
//! What runs is the board's: operator, leg, current loops, and what looks after them (`scarab::safety`), put together as the
//! board's tasks do it (`scarab::task`, which only the microcontroller builds). Level by level in one period:
//!
//! ```text
//! every 48th period   operator's contacts -> requests; a reset forgets what no longer holds; registers and temperatures when due
//! every 6th           servo: sample, request -> leg -> target currents
//! every period        plant -> samples -> faults -> interlock -> axis -> command; anything that forbids releases all
//! ```
//!
//! The watchdog looks on at the end of each period (`watchdog.rs`).

use scarab::board::odrive_v3_6::settings::analog::{HOTTEST_C, temperature_c};
use scarab::board::odrive_v3_6::settings::drives;
use scarab::checksum::Checksum;
use scarab::hal::{AxisCommand, DriveCommand, JointSample, Sample};
use scarab::leg::{ControlOutput, ControlRequest, DriveState, axis_code, permitted};
use scarab::motor::{Axis, AxisRequest, Chopper, SenseScale};
use scarab::operator::{Ask, Operator, RATE_HZ, Situation};
use scarab::safety::{
    Bridges, Cause, DeratingRamps, Fault, FaultCode, PowerRequest, ServoWatch, SupplyWatch, TickState,
    TickWatch, UpkeepClock, of_gate_driver, of_temperature,
};

mod view;
mod watchdog;

use self::watchdog::Watchdog;
use crate::faults::{Channel, Injector};
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::{Context, DeviceLeg, EVALUATIONS_PER_TICK, Pair};
use crate::world::World;
use crate::world::periods::PERIODS_PER_TICK;

/// PWM periods per second.
pub const PERIODS_PER_S: u64 = scarab::hal::CURRENT_RATE_HZ as u64;
/// One of them, ms.
pub const PERIOD_MS: f64 = 1e3 / PERIODS_PER_S as f64;
const PERIODS_PER_ROUND: u64 = PERIODS_PER_S / RATE_HZ as u64;

/// Missed ticks of an axis that the other one does not wait for.
const LATE: u8 = 3;
/// Of the thermistor of a bridge at 41 degrees Celsius.
const WARM_CODE: u16 = 1500;

/// What the operator's hand does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hand {
    /// Holds the enabling switch.
    pub enabling: bool,
    /// Presses the start button.
    pub start: bool,
}

/// What an operator did that may lead to an enabled drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Period of the last reset that was asked for.
    pub reset: Option<u64>,
    /// Period of the last closing of the enabling switch.
    pub closed: Option<u64>,
}

/// Firmware, plant and what is spoilt between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig<const N: usize, const B: usize> {
    /// The firmware above the current loops.
    pub leg: Box<DeviceLeg<N, B>>,
    /// The plant.
    pub world: World<N>,
    /// What is spoilt.
    pub injector: Injector,
    /// The operator's.
    pub hand: Hand,
    /// The same, as far as enabling goes.
    pub edges: Edges,
    /// Commands of the period that is over.
    pub commands: [AxisCommand; N],
    /// What the last servo tick gave.
    pub output: Option<ControlOutput<N>>,
    /// PWM periods since the beginning.
    pub period: u64,
    /// Of everything that crossed the ports so far.
    pub hash: u64,
    /// What the firmware must not see: its detectors are switched off, for the test of the tests.
    pub blind: &'static [FaultCode],
    axes: [Axis; N],
    missed: [u8; N],
    watches: [TickWatch; N],
    servo: ServoWatch,
    servo_ticks: u32,
    targets: DriveCommand<N>,
    chopper: Chopper,
    supply: SupplyWatch,
    ramps: DeratingRamps,
    watchdog: Watchdog<N>,
    /// By the watchdog.
    restarted: bool,
    /// Of the servo's gains and limits as they were made.
    checksum: Checksum,
    bus_code: u16,
    hottest_c: f32,
    brake: f32,
    causes: u32,
    axis_fault: Option<FaultCode>,
    operator: Operator,
    clock: UpkeepClock,
    request: Option<ControlRequest<N>>,
    sample: Sample<N>,
    gravity: [f32; 3],
}

impl<const N: usize, const B: usize> Rig<N, B> {
    /// A board that is ready, its leg at rest, drive off, nobody at the contacts.
    pub fn new(leg: &LegFile, context: &Context<N, B>, seed: u64) -> Result<Self, ToolError> {
        let pair = Pair::new(leg, context, seed)?;
        let board = pair.board.ok_or_else(|| ToolError::input("faults need complete drives"))?;
        let (axes, chopper) = board.into_parts();
        Ok(Self {
            world: pair.world,
            injector: Injector::new(seed),
            hand: Hand::default(),
            edges: Edges::default(),
            commands: [AxisCommand::RELEASED; N],
            output: None,
            period: 0,
            hash: FNV_BASIS,
            blind: &[],
            axes,
            missed: [0; N],
            watches: [TickWatch::default(); N],
            servo: ServoWatch::default(),
            servo_ticks: 0,
            targets: DriveCommand::RELEASED,
            chopper,
            supply: SupplyWatch::default(),
            ramps: drives::derating(19.0),
            watchdog: Watchdog::new(),
            restarted: false,
            checksum: pair.leg.control().checksum(),
            // 48 V, until it is read.
            bus_code: 3136,
            hottest_c: 0.0,
            brake: 0.0,
            causes: 0,
            axis_fault: None,
            operator: Operator::default(),
            clock: UpkeepClock::new(RATE_HZ),
            request: None,
            sample: pair.sample,
            gravity: context.gravity,
            leg: pair.leg,
        })
    }

    /// One PWM period.
    pub fn advance(&mut self) {
        if self.period.is_multiple_of(PERIODS_PER_ROUND) {
            self.round();
        }
        if self.period.is_multiple_of(u64::from(PERIODS_PER_TICK)) {
            self.servo();
        }
        self.current();
        self.period += 1;
        if self.period.is_multiple_of(u64::from(PERIODS_PER_TICK)) {
            let mut joints = [JointSample::default(); N];
            for (joint, (sample, axis)) in joints.iter_mut().zip(&mut self.axes).enumerate() {
                let before = *axis;
                *sample = axis.joint_sample();
                if axis.fault().map(axis_code).is_some_and(|code| self.blind.contains(&code)) {
                    *axis = before;
                }
                self.injector.joint(joint, self.period, sample);
            }
            let measured = Sample { joints };
            self.sample = self.world.observe(&measured);
            let (_, forbids) = self.servo.look(self.servo_ticks);
            self.causes |= forbids & !self.blind_bits();
        }
        self.watch();
    }

    /// The operator's contacts.
    fn round(&mut self) {
        if self.injector.happens(Channel::Housekeeping, 0, self.period) {
            return;
        }
        self.watchdog.rounds = self.watchdog.rounds.wrapping_add(1);
        self.upkeep();
        let drive = self.state();
        let situation = Situation {
            enabling: self.hand.enabling,
            start: self.hand.start,
            blocked: self.causes != 0 || matches!(drive, DriveState::Fault { .. }),
            calibrated: !self.restarted,
            calibrating: false,
            referenced: !self.restarted,
            drive: self.output.is_some().then_some(drive),
        };
        match self.operator.tick(&situation) {
            Some(Ask::Power(power)) => self.request = Some(ControlRequest::Power(power)),
            Some(Ask::Identify) => self.request = Some(ControlRequest::Identify),
            Some(Ask::Reset) => self.reset(),
            Some(Ask::Calibrate | Ask::EndCalibration | Ask::Reference) | None => {}
        }
    }

    /// Gate drivers' registers and temperatures, as the housekeeping looks at them.
    fn upkeep(&mut self) {
        let due = self.clock.next();
        let mut hottest_c = f32::MIN;
        for joint in 0..N {
            let holds = !self.injector.happens(Channel::GateRegisters, joint, self.period);
            let code = self.injector.thermistor(joint, self.period, WARM_CODE);
            if let Some(cause) = of_gate_driver(holds).filter(|_| due.gates) {
                self.causes |= cause.bit() & !self.blind_bits();
            }
            let degrees = temperature_c(code);
            hottest_c = hottest_c.max(degrees.unwrap_or(HOTTEST_C));
            if let Some(code) = of_temperature(degrees, HOTTEST_C).filter(|_| due.temperatures)
                && !self.is_blind(Some(code))
            {
                self.leg.report(Fault { code, joint: joint as u8 });
            }
        }
        if due.temperatures {
            self.hottest_c = hottest_c;
        }
    }

    fn reset(&mut self) {
        self.causes &= Cause::for_ever();
        self.axis_fault = None;
        for (joint, axis) in self.axes.iter_mut().enumerate() {
            if !axis.clear_fault() {
                // Off, and to be calibrated; a motor that braked is let go.
                self.causes |= Cause::of_axis(joint, FaultCode::EncoderPlace, false).bit();
            }
        }
        self.edges.reset = Some(self.period);
        self.request = Some(ControlRequest::Power(PowerRequest::ResetFault));
    }

    fn servo(&mut self) {
        if self.injector.happens(Channel::Servo, 0, self.period) {
            return;
        }
        self.servo_ticks = self.servo_ticks.wrapping_add(1);
        if self.restarted {
            return;
        }
        // Every 64 ms, as `task::servo` does.
        if self.servo_ticks & 0xFF == 0
            && self.leg.control().checksum() != self.checksum
            && !self.is_blind(Some(FaultCode::Parameters))
        {
            self.leg.report(Fault { code: FaultCode::Parameters, joint: 0 });
        }
        let state = self.leg.control().state();
        let request = permitted(self.request.take(), self.causes == 0, state);
        let bus = SenseScale::ODRIVE_3_6.bus(self.bus_code);
        if self.supply.look(bus) && !self.is_blind(Some(FaultCode::SupplyLost)) {
            self.leg.report(Fault { code: FaultCode::SupplyLost, joint: 0 });
        }
        self.leg.derate(&self.ramps.at(self.hottest_c, bus));
        let seeing = (!self.blind.is_empty()).then(|| self.leg.clone());
        let output = self.leg.tick(&self.sample, request, self.gravity, EVALUATIONS_PER_TICK);
        if let Some(before) = seeing
            && self.is_blind(self.leg.control().state().fault().map(|fault| fault.code))
        {
            // As if it had not been seen: the leg goes on with what it was told before.
            self.leg = before;
            return;
        }
        self.targets = *output.servo.drive();
        for (joint, target) in self.targets.currents.iter_mut().enumerate() {
            *target = self.injector.target(joint, self.period, *target);
        }
        self.output = Some(output);
    }

    /// Level 0, both axes.
    fn current(&mut self) {
        let now = self.period;
        let brake = self.injector.brake(now, self.brake);
        let mut samples = self.world.period(&self.commands, brake);
        let emergency_stop = self.injector.happens(Channel::EmergencyStop, 0, now);
        let gate_fault = self.injector.happens(Channel::GateFault, 0, now);
        for (joint, sample) in samples.iter_mut().enumerate() {
            self.injector.sample(joint, now, sample);
            if self.injector.happens(Channel::Tick, joint, now) {
                self.missed[joint] = self.missed[joint].saturating_add(1);
                continue;
            }
            self.watchdog.ticks[joint] = self.watchdog.ticks[joint].wrapping_add(1);
            // As `task::current` looks at the other axis, half a period later or earlier.
            let late =
                self.missed.iter().enumerate().any(|(other, missed)| other != joint && *missed >= LATE);
            if late && !self.is_blind(Some(FaultCode::CurrentTicks)) {
                self.causes |= Cause::CurrentTicks.bit();
            }
            let complete = !self.injector.happens(Channel::Conversion, joint, now);
            let missed = core::mem::take(&mut self.missed[joint]);
            let state = TickState { emergency_stop, gate_fault, complete, missed };
            let (forbids, damp) = self.watches[joint].look(&state);
            self.causes |= forbids & !self.blind_bits();
            if damp && !self.is_blind(Some(FaultCode::CurrentTicks)) {
                self.leg.report(Fault { code: FaultCode::CurrentTicks, joint: joint as u8 });
            }
            if self.restarted {
                // Neither calibrated nor referenced: what runs is released.
                continue;
            }
            let switching = self.is_switching();
            let before = self.axes[joint];
            let current = self.targets.currents[joint];
            let command = match Bridges::of(self.causes) {
                Bridges::Follow if self.targets.enabled => {
                    self.axes[joint].tick(sample, AxisRequest { enabled: true, current })
                }
                Bridges::Brake => self.axes[joint].brake(sample),
                _ => self.axes[joint].tick(sample, AxisRequest::RELEASED),
            };
            if self.is_blind(self.axes[joint].fault().map(axis_code)) {
                self.axes[joint] = before;
                continue;
            }
            self.commands[joint] = command;
            let axis = &self.axes[joint];
            if let Some(fault) = axis.fault() {
                self.causes |= Cause::of_axis(joint, axis_code(fault), switching).bit();
                self.axis_fault = self.axis_fault.or(Some(axis_code(fault)));
            }
            // What one axis finds takes the other in the same period.
            match Bridges::of(self.causes) {
                Bridges::Follow => {}
                Bridges::Brake => self.commands = [AxisCommand::BRAKE; N],
                Bridges::Release => self.commands = [AxisCommand::RELEASED; N],
            }
        }
        let bus = samples.first().map_or(0, |sample| sample.bus_code);
        self.bus_code = bus;
        self.brake = self.chopper.duty(SenseScale::ODRIVE_3_6.bus(bus));
        self.hash = samples.iter().zip(&self.commands).fold(self.hash, |hash, (sample, command)| {
            let [b, c] = sample.shunt_codes.map(u64::from);
            let seen = u64::from(sample.encoder_count) << 48 | b << 32 | c << 16 | u64::from(sample.bus_code);
            let duties = command
                .duty
                .iter()
                .fold(mixed(hash, seen), |hash, duty| mixed(hash, u64::from(duty.to_bits())));
            mixed(duties, u64::from(command.enabled))
        });
        self.hash = mixed(self.hash, u64::from(self.causes));
    }

    /// Flips a bit of an axis' numbers (`Axis::upset`), or of those of the servo's joint.
    pub fn upset(&mut self, of_axis: bool, joint: usize, number: u8, bit: u8) {
        if of_axis {
            self.axes[joint].upset(number, bit);
        } else {
            self.leg.upset(joint, number, bit);
        }
    }

    fn is_blind(&self, code: Option<FaultCode>) -> bool {
        code.is_some_and(|code| self.blind.contains(&code))
    }

    fn blind_bits(&self) -> u32 {
        let blind = |cause: &Cause| self.is_blind(cause.code());
        Cause::ALL.into_iter().filter(blind).fold(0, |bits, cause| bits | cause.bit())
    }
}

const fn mixed(hash: u64, word: u64) -> u64 {
    (hash ^ word).wrapping_mul(FNV_PRIME)
}

/// Fowler, Noll and Vo's hash 1a, on words.
const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;
