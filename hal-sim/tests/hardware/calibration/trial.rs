//! Motor on its stand with the configuration of its axis.

use core::f64::consts::TAU;

use hal_sim::drive::description::{
    AxisDescription, BridgeDescription, CounterDescription, EncoderWiring, MotorDescription,
    ShuntDescription, SupplyDescription, Wiring,
};
use hal_sim::drive::stand::{Load, Stand};
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::AxisCommand;
use scarab::motor::{
    AxisConfiguration, BridgeTiming, Calibration, CalibrationSettings, CalibrationStep, Calibrator, DeadTime,
    Direction, Refusal, SenseScale, StoredCalibration,
};
use scarab::units::{Ampere, Hertz, KilogramMetreSquared, RadianPerSecond, Volt, Weber};

#[derive(Debug)]
pub struct Trial {
    pub axis: AxisDescription,
    pub load: Load,
    pub angle: f64,
    pub configuration: AxisConfiguration,
    pub settings: CalibrationSettings,
}

pub struct TestRandom(Xoshiro256PlusPlus);

impl TestRandom {
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn one_of<T: Copy, const N: usize>(&mut self, all: [T; N]) -> T {
        all[(self.0.next_u64() >> 33) as usize % N]
    }
}

/// Holding current, A.
const CURRENT: f64 = 20.0;

/// Motor with random constants, and the torque with which the holding current holds its rotor, N m.
fn random_motor(random: &mut TestRandom, pole_pairs: u32) -> (MotorDescription, f64) {
    // Ranges: 30 mOhm to 0.3 Ohm, small and large ones equally often; L/R of 0.3 ms to 1.5 ms; 20 to
    // 100 mN m/A.
    let resistance = random.one_of([0.03, 0.05, 0.08, 0.13, 0.2]) * random.between(1.0, 1.5);
    let inductance_d = resistance * random.between(0.3e-3, 1.5e-3);
    let torque_per_ampere = random.between(0.02, 0.1);
    let holding = torque_per_ampere * CURRENT;
    let flux = torque_per_ampere / (1.5 * f64::from(pole_pairs));
    // If saliency outweighed the magnets, the rotor would not rest along them.
    let inductance_q =
        (inductance_d * random.between(1.0, 1.4)).min(inductance_d + 0.8 * flux / (1.25 * CURRENT));
    // Current along the flux of a salient rotor holds it with less torque: 3/2 p i sin(x)
    // (flux - (Lq - Ld) i cos(x)).
    let held = holding * (1.0 - (inductance_q - inductance_d) * CURRENT / flux).max(0.2);
    let motor = MotorDescription {
        resistance,
        inductance_d,
        inductance_q,
        flux,
        pole_pairs,
        electrical_zero: random.between(0.0, TAU),
        cogging: random.between(0.0, 0.03) * held,
        cogging_periods: 6 * pole_pairs,
        thermal_resistance: 1.0,
        thermal_time: 600.0,
        thermistor: None,
    };
    (motor, held)
}

/// Configuration that fits this motor, and a counter that is `reversed` or not.
fn matching_configuration(motor: &MotorDescription, counts: f64, reversed: bool) -> AxisConfiguration {
    AxisConfiguration {
        sense: SenseScale::ODRIVE_3_6,
        timing: BridgeTiming::ODRIVE_3_6,
        dead_time: DeadTime::Compensated { band: Ampere(0.5) },
        pole_pairs: motor.pole_pairs as u8,
        flux: Weber(motor.flux as f32),
        counts_per_turn: counts as u32,
        index: true,
        absolute: false,
        counter: if reversed { Direction::Down } else { Direction::Up },
        flexion: Direction::Up,
        bandwidth: Hertz(1000.0),
        feedforward: true,
        current_limit: Ampere(40.0),
        overcurrent: Ampere(58.0),
        bus: [Volt(20.0), Volt(58.0)],
        greatest_speed: RadianPerSecond(400.0),
    }
}

impl Trial {
    /// Trial wired according to its configuration.
    pub fn sound(seed: u64) -> Self {
        let mut random = TestRandom::new(seed);
        let pole_pairs = random.one_of([4, 5, 7, 10, 14, 21]);
        let counts = random.one_of([2400.0, 4000.0, 8192.0, 10_000.0, 16_384.0]);
        let (motor, held) = random_motor(&mut random, pole_pairs);
        let shunts = ShuntDescription {
            offset_codes: [random.between(-80.0, 80.0), random.between(-80.0, 80.0)],
            gain_error: [random.between(-0.003, 0.003), random.between(-0.003, 0.003)],
            noise_codes: random.between(0.5, 2.0),
            ..ShuntDescription::default()
        };
        let reversed = random.one_of([true, false]);
        let wiring = Wiring {
            phases: random.one_of([[0, 1, 2], [1, 2, 0], [2, 0, 1]]),
            encoder: if reversed { EncoderWiring::Reversed } else { EncoderWiring::Forward },
            ..Wiring::default()
        };
        let counter = CounterDescription {
            counts,
            start: random.one_of([0, 1, 40_000, 65_535]),
            index: random.between(0.0, TAU),
            error: 0.0,
            absolute: false,
        };
        let bridge = BridgeDescription::default();
        let inertia = random.between(0.5e-4, 10e-4);
        let load = Load::Free {
            inertia,
            coulomb: random.between(0.0, 0.15) * held,
            viscous: random.between(1e-4, 5e-4),
            torque: 0.0,
        };
        let configuration = matching_configuration(&motor, counts, reversed);
        // Rest positions from cogging.
        let tooth = TAU / f64::from(motor.cogging_periods);
        let angle = (random.between(0.0, 6.0) / tooth).round() * tooth;
        Self {
            axis: AxisDescription {
                motor,
                bridge,
                shunts,
                counter,
                joint_encoder: None,
                wiring,
                ratio: 50.0,
            },
            load,
            angle,
            configuration,
            settings: CalibrationSettings {
                current: Ampere(CURRENT as f32),
                voltage: Volt(9.0),
                turns_per_s: 12.0,
                travel_turns: 2.0,
                inertia: KilogramMetreSquared(inertia as f32),
            },
        }
    }

    /// Torque with which the field holds a rotor without saliency, N m.
    pub fn holding(&self) -> f64 {
        1.5 * f64::from(self.axis.motor.pole_pairs) * self.axis.motor.flux * CURRENT
    }

    /// Runs the calibration to its end; also returns the largest distance of the rotor from its
    /// start, turns.
    pub fn run(&self, seed: u64) -> (Stand, Result<Calibration, Refusal>, f64) {
        self.run_with(seed, Calibrator::new(&self.configuration, self.settings).expect("sensible"))
    }

    /// Runs the calibration after a power-up.
    pub fn run_stored(
        &self,
        seed: u64,
        stored: StoredCalibration,
    ) -> (Stand, Result<Calibration, Refusal>, f64) {
        let calibrator = Calibrator::from_stored(&self.configuration, self.settings, stored);
        self.run_with(seed, calibrator.expect("sensible"))
    }

    fn run_with(&self, seed: u64, mut calibrator: Calibrator) -> (Stand, Result<Calibration, Refusal>, f64) {
        let mut stand = Stand::new(&self.axis, &SupplyDescription::default(), self.load, self.angle, seed);
        let mut sample = stand.period(&AxisCommand::OFF, 0.0);
        let mut furthest = 0.0_f64;
        loop {
            let command = match calibrator.tick(&sample) {
                CalibrationStep::Running(command) => command,
                CalibrationStep::Done(found) => return (stand, Ok(found), furthest),
                CalibrationStep::Refused(reason) => return (stand, Err(reason), furthest),
            };
            sample = stand.period(&command, 0.0);
            furthest = furthest.max((stand.rotor().angle - self.angle).abs() / TAU);
        }
    }
}
