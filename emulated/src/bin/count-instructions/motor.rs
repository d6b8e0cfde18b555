//! Motor model for counting instructions, in single precision.
//!
//! The model is accurate enough for a calibration to pass and for realistic currents, speeds and noise. The
//! current loop is verified on the simulated hardware, not here.

use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ};
use scarab::motor::{AxisConfiguration, BridgeTiming, DeadTime, Direction, SenseScale};
use scarab::real::sin_cos;
use scarab::units::{Ampere, Hertz, RadianPerSecond, Volt, Weber};

pub const CONFIGURATION: AxisConfiguration = AxisConfiguration {
    sense: SenseScale::ODRIVE_3_6,
    timing: BridgeTiming::ODRIVE_3_6,
    dead_time: DeadTime::Compensated { band: Ampere(0.5) },
    pole_pairs: PAIRS as u8,
    flux: Weber(FLUX_VS),
    counts_per_turn: COUNTS as u32,
    index: true,
    absolute: false,
    counter: Direction::Up,
    flexion: Direction::Up,
    bandwidth: Hertz(1000.0),
    feedforward: true,
    current_limit: Ampere(40.0),
    overcurrent: Ampere(60.0),
    bus: [Volt(10.0), Volt(58.0)],
    greatest_speed: RadianPerSecond(900.0),
};

const PAIRS: f32 = 7.0;
const COUNTS: f32 = 8192.0;
/// Number of turns after which the 16-bit counter repeats.
const TURNS: f32 = 65_536.0 / COUNTS;
const FLUX_VS: f32 = 2.9e-3;
const RESISTANCE_OHM: f32 = 0.05;
const INDUCTANCE_H: f32 = 25e-6;
const INERTIA: f32 = 2e-4;
const FRICTION_NM: f32 = 0.01;
const STEPS: usize = 4;
const STEP_S: f32 = 1.0 / CURRENT_RATE_HZ as f32 / STEPS as f32;
const AMPERE_PER_CODE: f32 = 3.3 / 4096.0 / 40.0 / 0.0005;

#[derive(Clone, Copy)]
pub struct Motor {
    current: [f32; 2],
    /// Mechanical turns, `0..TURNS`.
    turns: f32,
    pub speed_rad_per_s: f32,
    /// An external machine holds the speed.
    pub driven: bool,
    pub bus: f32,
    pending: AxisCommand,
    seed: u32,
}

impl Motor {
    pub const fn at_rest() -> Self {
        Self {
            current: [0.0; 2],
            turns: 4.03,
            speed_rad_per_s: 0.0,
            driven: false,
            bus: 48.0,
            pending: AxisCommand::OFF,
            seed: 1,
        }
    }

    /// Noise of a code, -2..=2.
    fn noise(&mut self) -> f32 {
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 17;
        self.seed ^= self.seed << 5;
        (self.seed % 5) as f32 - 2.0
    }

    pub fn sample(&mut self, index_count: Option<u16>) -> AxisSample {
        let (sine, cosine) = sin_cos(self.turns * PAIRS * core::f32::consts::TAU);
        let [d, q] = self.current;
        let (alpha, beta) = (d * cosine - q * sine, d * sine + q * cosine);
        let turned = 0.866_025_4 * beta;
        let shunt_codes = [turned - 0.5 * alpha, -turned - 0.5 * alpha]
            .map(|current| (2050.0 + current / AMPERE_PER_CODE + self.noise()) as u16);
        let bus_code = (self.bus / (3.3 * SenseScale::DIVIDER / 4096.0)) as u16;
        let encoder_count = (self.turns * COUNTS) as u32 as u16;
        AxisSample { shunt_codes, bus_code, encoder_count, index_count }
    }

    /// Sensor values for a counter at `count` and a quadrature current `current` (A).
    #[cfg(feature = "emulated")]
    pub fn seen(&mut self, count: u16, current: f32) -> AxisSample {
        let before = (self.turns * COUNTS) as u32 as u16;
        self.turns = f32::from(count) / COUNTS;
        self.current = [0.0, current];
        // Index at position zero of any turn, from either side.
        let [from, to] = [before, count].map(|count| count / COUNTS as u16);
        let forwards = count.wrapping_sub(before).cast_signed() > 0;
        let index = (from != to).then_some(if forwards { to } else { from } * COUNTS as u16);
        self.sample(index)
    }

    /// Runs one PWM period; `command` acts in the next one.
    pub fn period(&mut self, command: AxisCommand) -> AxisSample {
        let acting = core::mem::replace(&mut self.pending, command);
        let before = self.turns;
        for _ in 0..STEPS {
            self.step(&acting);
        }
        // Index at position zero of any turn.
        let passed = self.turns.max(before) as u32;
        let index = (before as u32 != self.turns as u32).then_some((passed * COUNTS as u32) as u16);
        if self.turns >= TURNS {
            self.turns -= TURNS;
        } else if self.turns < 0.0 {
            self.turns += TURNS;
        }
        self.sample(index)
    }

    fn step(&mut self, command: &AxisCommand) {
        let electrical = self.speed_rad_per_s * PAIRS;
        let [d, q] = self.current;
        if command.enabled {
            let [a, b, c] = command.duty.map(|duty| duty * self.bus);
            let (alpha, beta) = ((2.0 * a - b - c) / 3.0, (b - c) * 0.577_350_26);
            let (sine, cosine) = sin_cos(self.turns * PAIRS * core::f32::consts::TAU);
            let (along, across) = (alpha * cosine + beta * sine, beta * cosine - alpha * sine);
            let per_henry = STEP_S / INDUCTANCE_H;
            self.current = [
                d + per_henry * (along - RESISTANCE_OHM * d + electrical * INDUCTANCE_H * q),
                q + per_henry * (across - RESISTANCE_OHM * q - electrical * (INDUCTANCE_H * d + FLUX_VS)),
            ];
        } else {
            self.current = [0.0; 2];
        }
        if !self.driven {
            let torque = 1.5 * PAIRS * FLUX_VS * q;
            let friction = FRICTION_NM * (self.speed_rad_per_s * 20.0).clamp(-1.0, 1.0);
            self.speed_rad_per_s += STEP_S / INERTIA * (torque - friction);
        }
        self.turns += STEP_S / core::f32::consts::TAU * self.speed_rad_per_s;
    }
}
