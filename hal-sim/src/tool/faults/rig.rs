//! The whole firmware against the whole plant, one PWM period at a time, with faults on the ports between.
//!
//! What runs is the board's: current loops, housekeeping and what stands around the servo (`scarab::operation`), the leg, and who waits
//! for the watchdog. Only registers and queues are others (`ports.rs`). Level by level in one period:
//!
//! ```text
//! every 48th period   housekeeper: contacts -> requests; calibration, reference, resets; registers and temperatures when due
//! when it is due      servo: samples, request -> leg -> target currents; due after the last axis' sixth tick
//! every period        plant -> samples -> faults -> current loops -> bridges
//! ```
//!
//! The watchdog looks on at the end of each period (`watchdog.rs`).

use core::num::NonZeroU32;
use std::sync::Arc;

use scarab::board::odrive_v3_6::settings::analog::HOTTEST_C;
use scarab::board::odrive_v3_6::settings::drives;
use scarab::hal::{AxisCommand, CURRENT_RATE_HZ, Sample};
use scarab::leg::{ControlOutput, DriveState, axis_code, permitted};
use scarab::motor::SenseScale;
use scarab::operation::{
    CurrentLoops, Gate, Housekeeper, HousekeepingSettings, RATE_HZ, ServoRound, Stage, Tick,
};
use scarab::safety::{Fault, FaultCode};
use scarab::trace::words;

mod ports;
#[cfg(test)]
mod tests;
mod view;
mod watchdog;

use self::ports::{Ports, WARM_CODE};
use self::watchdog::Watchdog;
use crate::faults::{Channel, Injector};
use crate::tool::board::{axis_configuration, calibration_settings};
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::{Context, DeviceLeg, EVALUATIONS_PER_TICK, Pair};
use crate::world::World;

/// PWM periods per second.
pub const PERIODS_PER_S: u64 = CURRENT_RATE_HZ as u64;
/// One of them, ms.
pub const PERIOD_MS: f64 = 1e3 / PERIODS_PER_S as f64;
const PERIODS_PER_ROUND: u64 = PERIODS_PER_S / RATE_HZ as u64;

/// Processor cycles of one period; the second axis is half of it later.
const CYCLES: NonZeroU32 = NonZeroU32::new(7000).expect("more than one");
/// Of the bus voltage, on the board of 56 V.
const DIVIDER: f32 = 19.0;

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
    /// What the last servo tick gave.
    pub output: Option<ControlOutput<N>>,
    /// PWM periods since the beginning.
    pub period: u64,
    /// Of everything that crossed the ports so far.
    pub hash: u64,
    /// What the firmware must not see: its detectors are switched off, for the test of the tests.
    pub blind: &'static [FaultCode],
    loops: CurrentLoops<N>,
    keeper: Housekeeper<N>,
    round: ServoRound,
    ports: Ports<N>,
    cold: Arc<Cold<N, B>>,
    watchdog: Watchdog<N>,
    /// By the watchdog.
    restarted: bool,
    bus_code: u16,
    /// What the housekeeper was told of last.
    told: Option<DriveState>,
    sample: Sample<N>,
    gravity: [f32; 3],
}

/// The firmware as it starts.
#[derive(Debug, PartialEq)]
struct Cold<const N: usize, const B: usize> {
    leg: Box<DeviceLeg<N, B>>,
    loops: CurrentLoops<N>,
    keeper: Housekeeper<N>,
    round: ServoRound,
}

impl<const N: usize, const B: usize> Rig<N, B> {
    /// A board that is ready, its leg at rest, drive off, nobody at the contacts.
    pub fn new(leg: &LegFile, context: &Context<N, B>, seed: u64) -> Result<Self, ToolError> {
        let pair = Pair::new(leg, context, seed)?;
        let unfit = || ToolError::input("faults need complete drives");
        let (axes, chopper) = pair.board.ok_or_else(unfit)?.into_parts();
        let settings = settings(context.complete.as_deref().unwrap_or(leg))?;
        let volt_per_code = SenseScale::ODRIVE_3_6.volt_per_code;
        let loops = |stages| CurrentLoops::new(stages, CYCLES, Some(chopper), volt_per_code);
        let cold = Cold {
            leg: pair.leg.clone(),
            loops: loops([Stage::OFF; N]),
            keeper: Housekeeper::new(settings),
            round: ServoRound::new(pair.leg.control().checksum(), drives::derating(DIVIDER)),
        };
        let mut ports = Ports::new(pair.sample.joints);
        (ports.begun, ports.servo_due) = (true, true);
        Ok(Self {
            world: pair.world,
            injector: Injector::new(seed),
            hand: Hand::default(),
            output: None,
            period: 0,
            hash: FNV_BASIS,
            blind: &[],
            loops: loops(axes.map(Stage::running)),
            keeper: Housekeeper::ready(settings),
            round: cold.round.clone(),
            cold: Arc::new(cold),
            ports,
            watchdog: Watchdog::new(),
            restarted: false,
            // 48 V, until it is read.
            bus_code: 3136,
            told: None,
            sample: pair.sample,
            gravity: context.gravity,
            leg: pair.leg,
        })
    }

    /// One PWM period.
    pub fn advance(&mut self) {
        (self.ports.period, self.ports.blind) = (self.period, self.blind);
        if self.ports.hand.enabling != self.hand.enabling && self.hand.enabling {
            self.ports.edges.closed = Some(self.period);
        }
        self.ports.hand = self.hand;
        if self.period.is_multiple_of(PERIODS_PER_ROUND) {
            self.housekeeping();
        }
        if core::mem::take(&mut self.ports.servo_due) {
            self.servo();
        }
        self.current();
        self.period += 1;
        if self.ports.servo_due {
            for (joint, sample) in self.ports.samples.iter_mut().enumerate() {
                self.injector.joint(joint, self.period, sample);
            }
            self.sample = self.world.observe(&Sample { joints: self.ports.samples });
        }
        self.watch();
    }

    fn housekeeping(&mut self) {
        let (now, injector) = (self.period, &mut self.injector);
        if injector.happens(Channel::Housekeeping, 0, now) {
            return;
        }
        self.watchdog.rounds = self.watchdog.rounds.wrapping_add(1);
        for joint in 0..N {
            self.ports.gates[joint] = !injector.happens(Channel::GateRegisters, joint, now);
            self.ports.thermistors[joint] = injector.thermistor(joint, now, WARM_CODE);
        }
        self.keeper.round(&mut self.ports);
    }

    fn servo(&mut self) {
        if self.injector.happens(Channel::Servo, 0, self.period) {
            return;
        }
        self.ports.servo_ticks = self.ports.servo_ticks.wrapping_add(1);
        self.ports.counts = self.sample.joints.map(|sample| sample.encoder_counts);
        match self.round.gate(self.ports.begun) {
            Gate::Closed => {
                self.ports.targets.enabled = false;
                self.output = None;
                self.ports.requests.pop_front();
                return;
            }
            Gate::Anew => {
                self.leg.restart();
                self.told = None;
            }
            Gate::Open => {}
        }
        for (code, joint) in core::mem::take(&mut self.ports.reported) {
            self.leg.report(Fault { code, joint: joint as u8 });
        }
        let bus = SenseScale::ODRIVE_3_6.bus(self.bus_code);
        let control = self.leg.control();
        let found = self.round.look(|| control.checksum(), bus, self.ports.hottest_c);
        for code in [found.parameters, found.supply].into_iter().flatten() {
            if !self.ports.is_blind(Some(code)) {
                self.leg.report(Fault { code, joint: 0 });
            }
        }
        self.leg.derate(&found.derating);
        let state = self.leg.control().state();
        let request = permitted(self.ports.requests.pop_front(), self.ports.causes == 0, state);
        let seeing = (!self.blind.is_empty()).then(|| self.leg.clone());
        let output = self.leg.tick(&self.sample, request, self.gravity, EVALUATIONS_PER_TICK);
        if let Some(before) = seeing
            && self.ports.is_blind(self.leg.control().state().fault().map(|fault| fault.code))
        {
            // As if it had not been seen: the leg goes on with what it was told before.
            self.leg = before;
            return;
        }
        self.ports.targets = *output.servo.drive();
        for (joint, target) in self.ports.targets.currents.iter_mut().enumerate() {
            *target = self.injector.target(joint, self.period, *target);
        }
        let state = output.servo.decision.state;
        if self.told.is_none_or(|told| words::drive(told) != words::drive(state)) {
            self.ports.drive.push_back(state);
        }
        self.told = Some(state);
        self.output = Some(output);
    }

    /// Level 0, both axes.
    fn current(&mut self) {
        let now = self.period;
        let brake = self.injector.brake(now, self.ports.brake);
        // Without their supply the gate drivers open every switch, whatever the timers do.
        let commands = if self.ports.gates_on { self.ports.commands } else { [AxisCommand::RELEASED; N] };
        let mut samples = self.world.period(&commands, brake);
        let emergency_stop = self.injector.happens(Channel::EmergencyStop, 0, now);
        let gate_fault = self.injector.happens(Channel::GateFault, 0, now);
        for (joint, sample) in samples.iter_mut().enumerate() {
            self.injector.sample(joint, now, sample);
            if self.injector.happens(Channel::Tick, joint, now) {
                continue;
            }
            self.ports.ticks[joint] = self.ports.ticks[joint].wrapping_add(1);
            let supply = !self.injector.happens(Channel::SupplyConversion, 0, now);
            if !supply {
                sample.bus_code = self.bus_code;
            }
            (self.bus_code, self.ports.encoders[joint]) = (sample.bus_code, sample.encoder_count);
            let tick = Tick {
                now: (now as u32).wrapping_mul(CYCLES.get()).wrapping_add(joint as u32 * CYCLES.get() / 2),
                emergency_stop,
                gate_fault,
                complete: !self.injector.happens(Channel::Conversion, joint, now),
                supply,
                sample: *sample,
            };
            self.tick(joint, &tick);
        }
        self.hash = samples.iter().zip(&self.ports.commands).fold(self.hash, |hash, (sample, command)| {
            let [b, c] = sample.shunt_codes.map(u64::from);
            let seen = u64::from(sample.encoder_count) << 48 | b << 32 | c << 16 | u64::from(sample.bus_code);
            let duties = command
                .duty
                .iter()
                .fold(mixed(hash, seen), |hash, duty| mixed(hash, u64::from(duty.to_bits())));
            mixed(duties, u64::from(command.enabled))
        });
        self.hash = mixed(self.hash, u64::from(self.ports.causes));
    }

    /// One tick of one axis; a fault that must not be seen has not been found, and what followed from it did not happen.
    fn tick(&mut self, joint: usize, tick: &Tick) {
        if self.blind.is_empty() {
            return self.loops.tick(joint, tick, &mut self.ports);
        }
        let (stage, ports) = (self.loops.stage_mut(joint).copied(), self.ports.clone());
        self.loops.tick(joint, tick, &mut self.ports);
        if let (Some(now), Some(before)) = (self.loops.stage_mut(joint), stage)
            && self.ports.is_blind(now.fault().map(axis_code))
        {
            *now = before;
            let (samples, servo_due) = (self.ports.samples, self.ports.servo_due);
            self.ports = Ports { samples, servo_due, ..ports };
        }
    }

    /// Flips a bit of an axis' numbers (`Axis::upset`), or of those of the servo's joint.
    pub fn upset(&mut self, of_axis: bool, joint: usize, number: u8, bit: u8) {
        if of_axis {
            if let Some(axis) = self.loops.stage_mut(joint).and_then(Stage::axis_mut) {
                axis.upset(number, bit);
            }
        } else {
            self.leg.upset(joint, number, bit);
        }
    }

    /// What an axis modulates with is no number any more.
    pub fn spoil_modulation(&mut self, joint: usize) {
        if let Some(axis) = self.loops.stage_mut(joint).and_then(Stage::axis_mut) {
            axis.spoil_modulation();
        }
    }
}

/// What the housekeeper of this leg is built from.
fn settings<const N: usize>(leg: &LegFile) -> Result<HousekeepingSettings<N>, ToolError> {
    let unfit = || ToolError::input("a motor for every joint is needed");
    let mut parts = Vec::with_capacity(N);
    for joint in leg.joints.iter().take(N) {
        let motor = joint.motor.as_ref().ok_or_else(unfit)?;
        let configuration = axis_configuration(joint, motor);
        parts.push((configuration, calibration_settings(&configuration, motor)));
    }
    let parts: [_; N] = parts.try_into().map_err(|_| unfit())?;
    Ok(HousekeepingSettings {
        axes: parts.map(|(axis, _)| axis),
        calibration: parts.map(|(_, calibration)| calibration),
        hottest_c: HOTTEST_C,
    })
}

const fn mixed(hash: u64, word: u64) -> u64 {
    (hash ^ word).wrapping_mul(FNV_PRIME)
}

/// Fowler, Noll and Vo's hash 1a, on words.
const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;
