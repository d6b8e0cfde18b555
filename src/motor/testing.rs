//! A small motor for unit tests: averaged over the PWM period, in the rotor's frame, double precision.
//!
//! Tests against the simulated hardware, which resolves every edge and shares no code with this crate,
//! are in `hal-sim/tests/`.

use super::{AxisConfiguration, BridgeTiming, DeadTime, Direction, MotorConstants, SenseScale};
use crate::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ};
use crate::real::{sin_cos, sqrt};
use crate::testing::TestRandom;
use crate::units::{Ampere, Henry, Hertz, Ohm, RadianPerSecond, Volt, Weber};

/// Constants of the motor.
pub(crate) const MOTOR: MotorConstants = MotorConstants {
    resistance: Ohm(0.05),
    direct_inductance: Henry(24e-6),
    quadrature_inductance: Henry(27e-6),
    flux: Weber(2.9e-3),
};

pub(crate) const CONFIGURATION: AxisConfiguration = AxisConfiguration {
    sense: SenseScale::ODRIVE_3_6,
    timing: BridgeTiming::ODRIVE_3_6,
    dead_time: DeadTime::Compensated { band: Ampere(0.5) },
    pole_pairs: 7,
    flux: Weber(2.9e-3),
    counts_per_turn: 8192,
    index: true,
    absolute: false,
    counter: Direction::Up,
    flexion: Direction::Up,
    bandwidth: Hertz(1000.0),
    feedforward: true,
    current_limit: Ampere(40.0),
    overcurrent: Ampere(55.0),
    bus: [Volt(20.0), Volt(58.0)],
    greatest_speed: RadianPerSecond(600.0),
};

const SUBSTEPS: usize = 10;
const STEP_S: f64 = 1.0 / CURRENT_RATE_HZ as f64 / SUBSTEPS as f64;

#[derive(Clone, Debug)]
pub(crate) struct TestMotor {
    pub(crate) resistance: f64,
    pub(crate) inductance: [f64; 2],
    pub(crate) flux: f64,
    pub(crate) pole_pairs: f64,
    pub(crate) counts_per_turn: f64,
    /// Inertia, kg m^2; viscous friction, N m s; Coulomb friction, N m.
    pub(crate) inertia: f64,
    pub(crate) viscous: f64,
    pub(crate) coulomb: f64,
    pub(crate) load: f64,
    pub(crate) bus: f64,
    /// Dead time as a fraction of a period: the current's sign then sets the voltage.
    pub(crate) dead: f64,
    pub(crate) current_offsets: [f64; 2],
    pub(crate) noise_codes: f64,
    /// Encoder position at zero flux angle, mechanical turns; `encoder_sign` is -1 where it counts backwards.
    pub(crate) encoder_zero: f64,
    pub(crate) encoder_sign: f64,
    pub(crate) encoder_dead: bool,
    /// The wire of phase A is broken.
    pub(crate) open: bool,
    /// Width of the index pulse, counts; backwards its other edge is captured.
    pub(crate) index_width: i64,
    /// Converts the true currents of B and C to the measured ones.
    pub(crate) shunts: fn([f64; 2]) -> [f64; 2],
    /// Currents d and q, A.
    pub(crate) current: [f64; 2],
    pub(crate) angle: f64,
    pub(crate) speed: f64,
    /// The speed is held by an external machine.
    pub(crate) driven: bool,
    pub(crate) pending: AxisCommand,
    pub(crate) random: TestRandom,
    pub(crate) turn: Option<i64>,
}

impl Default for TestMotor {
    fn default() -> Self {
        Self {
            resistance: 0.05,
            inductance: [24e-6, 27e-6],
            flux: 2.9e-3,
            pole_pairs: 7.0,
            counts_per_turn: 8192.0,
            inertia: 2e-4,
            viscous: 2e-4,
            coulomb: 0.01,
            load: 0.0,
            bus: 48.0,
            dead: 119e-9 * f64::from(CURRENT_RATE_HZ),
            current_offsets: [12.3, -20.6],
            noise_codes: 1.5,
            encoder_zero: 0.137,
            encoder_sign: 1.0,
            encoder_dead: false,
            open: false,
            index_width: 0,
            shunts: |currents| currents,
            current: [0.0; 2],
            angle: 0.3,
            speed: 0.0,
            driven: false,
            pending: AxisCommand::OFF,
            random: TestRandom::new(1),
            turn: None,
        }
    }
}

impl TestMotor {
    pub(crate) fn electrical(&self) -> f64 {
        self.angle * self.pole_pairs
    }

    /// Position of the encoder, turns.
    pub(crate) fn position(&self) -> f64 {
        self.encoder_sign * self.angle / core::f64::consts::TAU + self.encoder_zero
    }

    fn phases(&self) -> [f64; 3] {
        let (sine, cosine) = sin_cos(self.electrical());
        let alpha = cosine * self.current[0] - sine * self.current[1];
        let beta = sine * self.current[0] + cosine * self.current[1];
        let turned = 0.5 * sqrt(3.0) * beta;
        [alpha, -0.5 * alpha + turned, -0.5 * alpha - turned]
    }

    /// Runs one PWM period; the command acts in the next one.
    pub(crate) fn period(&mut self, command: AxisCommand) -> AxisSample {
        let acting = core::mem::replace(&mut self.pending, command);
        for _ in 0..SUBSTEPS {
            self.substep(&acting);
        }
        self.sample()
    }

    pub(crate) fn sample(&mut self) -> AxisSample {
        let [_, b, c] = self.phases();
        let seen = (self.shunts)([b, c]);
        let mut shunt_codes = [0; 2];
        for (shunt, code) in shunt_codes.iter_mut().enumerate() {
            let exact = 2048.0 + self.current_offsets[shunt] + seen[shunt] / (3.3 / 4096.0 / 40.0 / 0.0005);
            *code = (exact + self.noise_codes * self.random.normal() + 0.5).clamp(0.0, 4095.0) as u16;
        }
        let position = if self.encoder_dead { 0.0 } else { self.position() };
        let counts = (position * self.counts_per_turn).floor() as i64;
        let turn = position.floor() as i64;
        let before = self.turn.replace(turn).unwrap_or(turn);
        let mut at = (turn.max(before) as f64 * self.counts_per_turn) as i64;
        if turn < before {
            at += self.index_width;
        }
        let index_count = (before != turn).then_some(at as u16);
        let bus_code = (self.bus / f64::from(SenseScale::ODRIVE_3_6.volt_per_code.0)) as u16;
        AxisSample { shunt_codes, bus_code, encoder_count: counts as u16, index_count }
    }

    fn substep(&mut self, command: &AxisCommand) {
        let electrical_speed = self.speed * self.pole_pairs;
        let [id, iq] = self.current;
        if command.enabled {
            let phases = self.phases();
            let mut volts = [0.0; 3];
            for (phase, volt) in volts.iter_mut().enumerate() {
                let lost = self.dead * (phases[phase] / 0.2).clamp(-1.0, 1.0);
                *volt = (f64::from(command.duty[phase]) - lost) * self.bus;
            }
            let alpha = (2.0 * volts[0] - volts[1] - volts[2]) / 3.0;
            let beta = (volts[1] - volts[2]) / sqrt(3.0);
            let (sine, cosine) = sin_cos(self.electrical());
            let (vd, vq) = (cosine * alpha + sine * beta, cosine * beta - sine * alpha);
            let [ld, lq] = self.inductance;
            self.current[0] += STEP_S * (vd - self.resistance * id + electrical_speed * lq * iq) / ld;
            self.current[1] +=
                STEP_S * (vq - self.resistance * iq - electrical_speed * (ld * id + self.flux)) / lq;
            if self.open {
                // With phase A open, the current in at B flows out at C.
                let across = sine * self.current[0] + cosine * self.current[1];
                self.current = [sine * across, cosine * across];
            }
        } else {
            self.current = [0.0; 2];
        }
        let torque = 1.5 * self.pole_pairs * self.flux * iq;
        if !self.driven {
            let push = torque - self.load - self.viscous * self.speed;
            let friction = self.coulomb * (self.speed / 0.05).clamp(-1.0, 1.0);
            self.speed += STEP_S * (push - friction) / self.inertia;
        }
        self.angle += STEP_S * self.speed;
    }
}
