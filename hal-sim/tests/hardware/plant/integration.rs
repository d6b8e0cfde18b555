//! Time steps: energy, reversibility, order, and their effect on identified parameters.

use crate::plant::common::{planar_leg, worn_leg};
use hal_sim::description::LegDescription;
use hal_sim::leg::{Leg, LegState};
use hal_sim::world::{TICK_S, World};
use nalgebra::{SMatrix, SVector};
use scarab::hal::DriveCommand;
use scarab::units::Ampere;

const START: LegState<2> = LegState { angles: [1.2, -0.8], rates: [0.0, 1.0] };
const NO_TORQUE: [f64; 2] = [0.0; 2];

/// Largest deviation of the energy over 10 s of free swinging, and the mean one of the last second, J.
fn energy_deviation(step: f64) -> (f64, f64) {
    let leg = Leg::new(&planar_leg());
    let energy = |state: &LegState<2>| {
        leg.mechanism().kinetic_energy(&state.angles, &state.rates)
            + leg.mechanism().potential_energy(&state.angles)
    };
    let mut state = START;
    let initial = energy(&state);
    let steps = (10.0 / step) as usize;
    let last = (1.0 / step) as usize;
    let (mut largest, mut late) = (0.0_f64, 0.0);
    for number in 0..steps {
        leg.advance(&mut state, &NO_TORQUE, &NO_TORQUE, step);
        let deviation = energy(&state) - initial;
        largest = largest.max(deviation.abs());
        if number >= steps - last {
            late += deviation / last as f64;
        }
    }
    (largest, late)
}

#[test]
fn energy_of_a_frictionless_leg_is_conserved_to_second_order() {
    let (largest, late) = energy_deviation(TICK_S);
    let (largest_at_half, _) = energy_deviation(0.5 * TICK_S);
    println!("energy deviation: largest {largest:e} J, mean of the last second {late:e} J");
    // Rates of change reach about 10/s and 30 J are exchanged: (10/s * 250 us)^2 * 30 J = 2e-4 J.
    assert!(largest < 2e-4 && late.abs() < 2e-5, "{largest:e} {late:e}");
    let ratio = largest / largest_at_half;
    assert!((3.8..4.2).contains(&ratio), "half the step must leave a quarter of the error, not 1/{ratio}");
}

#[test]
fn a_frictionless_leg_returns_to_its_start_in_reversed_time() {
    let leg = Leg::new(&planar_leg());
    let mut state = START;
    for _ in 0..8000 {
        leg.advance(&mut state, &NO_TORQUE, &NO_TORQUE, TICK_S);
    }
    state.rates = state.rates.map(|rate| -rate);
    for _ in 0..8000 {
        leg.advance(&mut state, &NO_TORQUE, &NO_TORQUE, TICK_S);
    }
    for joint in 0..2 {
        // Rounding of 16,000 steps, amplified by the double pendulum.
        assert!((state.angles[joint] - START.angles[joint]).abs() < 1e-9, "{state:?}");
        assert!((state.rates[joint] + START.rates[joint]).abs() < 1e-8, "{state:?}");
    }
}

/// Position, true rate and motor torque of each tick.
type Record = Vec<([f64; 2], [f64; 2], [f64; 2])>;

/// Drives three sines per joint for 20 s, by feedforward and stiffness.
fn driven_motion(description: &LegDescription<2>) -> Record {
    let mut world = World::new(description, 1);
    let reference = |time: f64| -> ([f64; 2], [f64; 2], [f64; 2]) {
        let waves = [
            [(0.25, 1.3, 0.0), (0.15, 3.1, 1.0), (0.05, 7.3, 2.0)],
            [(0.4, 1.7, 2.0), (0.2, 4.3, 0.5), (0.06, 8.9, 1.0)],
        ];
        let sum = |joint: usize, term: fn(f64, f64, f64) -> f64| {
            waves[joint]
                .iter()
                .map(|&(amplitude, speed, phase)| term(amplitude, speed, speed * time + phase))
                .sum::<f64>()
        };
        (
            [0, 1]
                .map(|joint| [0.5, -0.9][joint] + sum(joint, |amplitude, _, angle| amplitude * sine(angle))),
            [0, 1].map(|joint| {
                sum(joint, |amplitude, speed, angle| {
                    amplitude * speed * sine(angle + core::f64::consts::FRAC_PI_2)
                })
            }),
            [0, 1]
                .map(|joint| sum(joint, |amplitude, speed, angle| -amplitude * speed * speed * sine(angle))),
        )
    };
    world.move_to(&reference(0.0).0);
    (0..80_000)
        .map(|tick| {
            let truth = world.truth();
            let (angle, rate, acceleration) = reference(f64::from(tick) * TICK_S);
            let feedforward = world.inverse_dynamics(&angle, &rate, &acceleration);
            let currents = core::array::from_fn(|joint| {
                let stiffness = 400.0 * (angle[joint] - truth.position[joint])
                    + 40.0 * (rate[joint] - truth.velocity[joint]);
                Ampere((feedforward[joint] + stiffness) as f32)
            });
            world.tick(&DriveCommand { enabled: true, currents });
            (truth.position, truth.velocity, truth.motor_torque)
        })
        .collect()
}

fn sine(angle: f64) -> f64 {
    nalgebra::ComplexField::sin(angle)
}

/// Least squares of `rows` (columns, right side).
fn fit(rows: impl Iterator<Item = ([f64; 3], f64)>) -> SVector<f64, 3> {
    let (mut normal, mut right) = (SMatrix::<f64, 3, 3>::zeros(), SVector::<f64, 3>::zeros());
    for (columns, value) in rows {
        let columns = SVector::from(columns);
        normal += columns * columns.transpose();
        right += columns * value;
    }
    normal.cholesky().expect("the motion excites all columns").solve(&right)
}

/// Rates and accelerations at a tick by eighth-order differences of the positions: the leg's actual motion.
fn derivatives(record: &Record, tick: usize) -> ([f64; 2], [f64; 2]) {
    const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
    const SECOND: [f64; 5] = [-205.0 / 72.0, 8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
    let at = |offset: isize| record[(tick as isize + offset) as usize].0;
    let mut rate = [0.0; 2];
    let mut acceleration = at(0).map(|position| SECOND[0] * position / (TICK_S * TICK_S));
    for distance in 1..=4 {
        let (before, after) = (at(-distance), at(distance));
        let index = distance as usize;
        for joint in 0..2 {
            rate[joint] += FIRST[index - 1] * (after[joint] - before[joint]) / TICK_S;
            acceleration[joint] += SECOND[index] * (after[joint] + before[joint]) / (TICK_S * TICK_S);
        }
    }
    (rate, acceleration)
}

/// Fits the torque error of a motion against inverse dynamics by inertia, viscous and Coulomb
/// friction of the joint. `smoothing` is the half-width of a Hann window in ticks, with which
/// turning points may stay. Without it, rows near them are excluded.
fn bias(description: &LegDescription<2>, record: &Record, smoothing: usize) -> [SVector<f64, 3>; 2] {
    let mut without_dry_friction = *description;
    for joint in &mut without_dry_friction.joints {
        joint.friction.coulomb = 0.0;
    }
    let world = World::new(&without_dry_friction, 0);
    let settled = 4000;
    let inner = settled..record.len() - 4;
    let rows: Vec<[([f64; 3], f64, bool); 2]> = inner
        .map(|tick| {
            let (rate, acceleration) = derivatives(record, tick);
            let sign = |joint: usize, tick: usize| {
                if record[tick].1[joint] == 0.0 { 0.0 } else { record[tick].1[joint].signum() }
            };
            let smooth = world.inverse_dynamics(&record[tick].0, &rate, &acceleration);
            [0, 1].map(|joint| {
                // Dry friction uses the true direction, not that of the differences.
                let dry = description.joints[joint].friction.coulomb * sign(joint, tick);
                let lacking = record[tick].2[joint] - smooth[joint] - dry;
                let clean = [0, 1].iter().all(|&any| {
                    (tick - 5..tick + 5)
                        .all(|near| sign(any, near) == sign(any, tick) && sign(any, near) != 0.0)
                });
                ([acceleration[joint], rate[joint], sign(joint, tick)], lacking, clean)
            })
        })
        .collect();
    [0, 1].map(|joint| {
        if smoothing == 0 {
            return fit(rows.iter().map(|row| row[joint]).filter(|row| row.2).map(|row| (row.0, row.1)));
        }
        let window: Vec<f64> = (0..smoothing)
            .map(|tick| {
                let half = sine(core::f64::consts::PI * (tick as f64 + 0.5) / smoothing as f64);
                half * half
            })
            .collect();
        fit(rows.windows(smoothing).step_by(8).map(|part| {
            let mut columns = [0.0; 3];
            let mut value = 0.0;
            for (row, weight) in part.iter().zip(&window) {
                for (sum, column) in columns.iter_mut().zip(row[joint].0) {
                    *sum += weight * column;
                }
                value += weight * row[joint].1;
            }
            (columns, value)
        }))
    })
}

#[test]
fn integration_biases_inertia_and_friction_by_less_than_two_parts_in_ten_thousand() {
    let description = worn_leg();
    let record = driven_motion(&description);
    // Inertia of the joint with everything beyond it, rotor included, kg m^2; a scale only.
    let inertias = [4.1, 2.2];
    // Away from turning points, and everywhere with a window of 50 ms on both sides.
    for smoothing in [0, 200] {
        for (joint, lacking) in bias(&description, &record, smoothing).iter().enumerate() {
            let friction = description.joints[joint].friction;
            let shares =
                [lacking[0] / inertias[joint], lacking[1] / friction.viscous, lacking[2] / friction.coulomb];
            println!(
                "smoothing {smoothing}, joint {joint}: inertia {:+.1e}, viscous {:+.1e}, Coulomb {:+.1e}",
                shares[0], shares[1], shares[2]
            );
            assert!(shares.iter().all(|share| share.abs() < 2e-4), "{shares:?}");
        }
    }
}
