use hal_sim::wearer::description::PassiveDescription;
use scarab::hal::DriveCommand;
use scarab::units::Ampere;
use scarab_base::stats::rms;
use scarab_identify::formats::leg_file::DEFAULT_LEG;
use scarab_identify::leg::two_bodies::{MuscleTone, TwoBodies};

use super::*;

/// Exoskeleton without Coulomb friction, and a wearer whose tissue holds the limb off the end stops.
fn bodies() -> (LegFile, WearerDescription) {
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let bodies = TwoBodies::from_leg(&leg).expect("a worn leg");
    let mut exoskeleton = bodies.exoskeleton.clone();
    for joint in &mut exoskeleton.joints {
        joint.truth.as_mut().expect("simulated").coulomb = 0.0;
    }
    let mut wearer = bodies.wearer(MuscleTone::Relaxed);
    wearer.passive = [
        PassiveDescription { stiffness: 60.0, damping: 6.0, rest: 0.6 },
        PassiveDescription { stiffness: 30.0, damping: 3.0, rest: 1.2 },
    ];
    (exoskeleton, wearer)
}

/// Acceleration as a biquad: s^2 H with s = (2 / T) (1 - 1/z) / (1 + 1/z), prewarped.
struct Biquad {
    input: [f64; 2],
    output: [f64; 2],
    jerk: f64,
}

impl Biquad {
    fn at(angle: f64) -> Self {
        Self { input: [angle; 2], output: [0.0; 2], jerk: 0.0 }
    }
}

impl Biquad {
    fn push(&mut self, sample: f64) -> f64 {
        let double_rate = 2.0 * 4000.0;
        let corner = double_rate * (PI * 50.0 / 4000.0).tan();
        let cross = 2.0 * 0.7 * corner * double_rate;
        let (k, w) = (double_rate * double_rate, corner * corner);
        let [one, two] = self.input;
        let forward = w * k * (sample - 2.0 * one + two);
        let back = (2.0 * w - 2.0 * k) * self.output[0] + (k - cross + w) * self.output[1];
        let output = (forward - back) / (k + cross + w);
        (self.input, self.output) = ([sample, one], [output, self.output[0]]);
        output
    }

    /// Acceleration led by 3 ms of its change, which is low-passed at 60 Hz, for the newest sample.
    fn led(&mut self, sample: f64) -> f64 {
        let before = self.output[0];
        let now = self.push(sample);
        self.jerk += (1.0 - (-TAU * 60.0 / 4000.0).exp()) * (4000.0 * (now - before) - self.jerk);
        now + 0.003 * self.jerk
    }
}

/// The compensation acting on the simulated hardware, written without matrices of the loop.
struct Compensation {
    world: World<2>,
    exoskeleton: World<2>,
    viscous: [f64; 2],
    torque_per_ampere: f64,
    compensated: Compensated,
    observed: [[f64; 2]; 2],
    filters: [Biquad; 2],
    last_weight: [f64; 2],
    torque: [f64; 2],
    slope: [f64; 2],
}

impl Compensation {
    fn new(exoskeleton: &LegFile, wearer: &WearerDescription, compensated: Compensated) -> Self {
        let description = exoskeleton.description::<2>().expect("simulated");
        let mut world = World::new(&description, 1);
        let posture = [0.4, 0.7];
        world.move_to(&posture);
        world.wear(wearer).expect("a hip and a knee");
        let exoskeleton = World::new(&description, 1);
        let weight = exoskeleton.inverse_dynamics(&posture, &[0.0; 2], &[0.0; 2]);
        Self {
            world,
            exoskeleton,
            viscous: description.joints.map(|joint| joint.friction.viscous),
            torque_per_ampere: description.joints[0].drive.torque_per_ampere,
            compensated,
            observed: posture.map(|angle| [angle, 0.0]),
            filters: posture.map(Biquad::at),
            last_weight: weight,
            torque: weight,
            slope: [0.0; 2],
        }
    }

    /// Runs a sample and returns the mean angles.
    fn sample(&mut self) -> [f64; 2] {
        let beta = (-TAU * 100.0 * TICK_S).exp();
        let mut mean = [0.0; 2];
        for tick in 0..8 {
            let angle = self.world.anatomical_position();
            let second = [0, 1].map(|joint| self.filters[joint].led(self.observed[joint][0]));
            let zero = [0.0; 2];
            let weight = self.exoskeleton.inverse_dynamics(&angle, &zero, &zero);
            let whole = self.exoskeleton.inverse_dynamics(&angle, &zero, &second);
            let mut command = [0.0; 2];
            for joint in 0..2 {
                let [position, rate] = &mut self.observed[joint];
                self.torque[joint] += self.slope[joint];
                let inertia = self.compensated.inertia * (whole[joint] - weight[joint]);
                let friction = self.compensated.friction * self.viscous[joint] * *rate;
                command[joint] = self.torque[joint] + friction + inertia;
                let error = angle[joint] - (*position + TICK_S * *rate);
                *position += TICK_S * *rate + (1.0 - beta * beta) * error;
                *rate += (1.0 - beta).powi(2) / TICK_S * error;
                mean[joint] += angle[joint] / 8.0;
            }
            if tick == 7 {
                let weight = self.exoskeleton.inverse_dynamics(&mean, &zero, &zero);
                for joint in 0..2 {
                    let wanted = 2.5 * weight[joint] - 1.5 * self.last_weight[joint];
                    self.slope[joint] = (wanted - self.torque[joint]) / 8.0;
                }
                self.last_weight = weight;
            }
            let currents = command.map(|torque| Ampere((torque / self.torque_per_ampere) as f32));
            self.world.tick(&DriveCommand { enabled: true, currents });
        }
        mean
    }
}

/// Growth per sample of small vibrations of the simulated leg after a push (N m), over four windows.
fn simulated_growth(compensation: &mut Compensation, rest: [f64; 2], push: f64, window: u32) -> f64 {
    compensation.world.push(0, push, 0.02);
    let mut amplitude = || {
        rms((0..window).flat_map(|_| {
            let angle = compensation.sample();
            [angle[0] - rest[0], angle[1] - rest[1]]
        }))
    };
    // Other vibrations decay in the first windows.
    let _ = (amplitude(), amplitude());
    let (early, late) = (amplitude(), amplitude());
    (late / early).powf(1.0 / f64::from(window))
}

#[test]
fn simulated_vibrations_grow_and_decay_as_the_eigenvalues_say() {
    let (exoskeleton, wearer) = bodies();
    for friction in [0.0, 1.0] {
        let calm = Compensated { inertia: 0.0, friction: 0.0 };
        let mut settled = Compensation::new(&exoskeleton, &wearer, calm);
        let mut rest = [0.0; 2];
        (0..15_000).for_each(|_| rest = settled.sample());
        let found = CompensationLoop::new(&exoskeleton, &wearer, Limb::Limp, rest).expect("simulated");
        let limit = found.largest_inertia(friction);
        println!("posture {rest:.3?}, friction {friction}: limit {limit:.3}");
        assert!((0.05..0.95).contains(&limit), "{limit}");
        for factor in [0.96, 1.02] {
            let compensated = Compensated { inertia: factor * limit, friction };
            let expected = found.growth(compensated).ln();
            settled.compensated = compensated;
            // Both compensations share the state of the settled leg.
            let mut copy = Compensation {
                world: settled.world.clone(),
                exoskeleton: settled.exoskeleton.clone(),
                filters: rest.map(Biquad::at),
                ..Compensation::new(&exoskeleton, &wearer, compensated)
            };
            (copy.observed, copy.last_weight) = (settled.observed, settled.last_weight);
            (copy.torque, copy.slope) = (settled.torque, settled.slope);
            // Growth by e^10 or decay to e^-10 stays within the drives' torque and above rounding.
            let window = (2.5 / expected.abs()).min(1500.0) as u32;
            let push = if expected < 0.0 { 3.0 } else { 1e-3 };
            let simulated = simulated_growth(&mut copy, rest, push, window).ln();
            println!(
                "  share {:.3}: {simulated:.2e} per sample, expected {expected:.2e}",
                compensated.inertia
            );
            assert!((simulated < 0.0) == (factor < 1.0), "{factor}: {simulated}");
            // The posture of rest moves a little with the deflections of the cuffs.
            assert!((simulated - expected).abs() < 0.1 * expected.abs() + 2e-4);
        }
    }
}

#[test]
fn spectral_radius_is_that_of_the_eigenvalues() {
    let (exoskeleton, wearer) = bodies();
    for limb in [Limb::Limp, Limb::Held] {
        let found = CompensationLoop::new(&exoskeleton, &wearer, limb, [0.3, 0.6]).expect("simulated");
        for inertia in [0.0, 0.3, 0.8] {
            let compensated = Compensated { inertia, friction: 0.5 };
            let eigenvalues = found.map(compensated).complex_eigenvalues();
            let largest = eigenvalues.iter().map(|value| value.norm()).fold(0.0, f64::max);
            assert!((found.growth(compensated) - largest).abs() < 1e-6, "{limb:?} {inertia}");
        }
    }
}

#[test]
fn limit_falls_with_the_stiffness_of_the_cuffs_and_without_damping() {
    let (exoskeleton, wearer) = bodies();
    let limit = |stiffness, damping| {
        let wearer = Cuffs { stiffness, damping }.on(&wearer);
        largest_inertia(&exoskeleton, &wearer, Limb::Held, 1.0).expect("simulated")
    };
    let [soft, usual, stiff, undamped] =
        [limit(4e3, 80.0), limit(8e3, 80.0), limit(16e3, 80.0), limit(8e3, 10.0)];
    println!("4 kN/m {soft:.3}, 8 kN/m {usual:.3}, 16 kN/m {stiff:.3}, an eighth of damping {undamped:.3}");
    assert!(stiff < usual && usual < soft && undamped < usual);
}

#[test]
fn acceleration_is_that_of_the_firmware() {
    use scarab::assist::differentiator::LedAcceleration;

    let (mut firmware, mut state) = (LedAcceleration::at(0.0), LoopState::zeros());
    for tick in 0..400 {
        let angle = (0.02 * f64::from(tick)).sin();
        Pair::Position.set(&mut state, Vector2::new(angle, 0.0));
        let expected = f64::from(firmware.push(angle as f32));
        let found = led_acceleration(&mut state)[0];
        // Accelerations reach 5000 rad/s^2; angles of 1 rad are rounded to 6e-8 rad.
        assert!((found - expected).abs() < 1.0, "{tick}: {found} {expected}");
    }
}
