//! Rigid bodies against vectors of another library, and against energies and kinematics by hand.

use crate::plant::common::{planar_leg, spatial_chain};
use hal_sim::description::LegDescription;
use hal_sim::mechanism::Mechanism;
use nalgebra::{Matrix4, Rotation3, Translation3, Vector3};

/// Number, q1 q2 qd1 qd2 qdd1 qdd2, and tau1 tau2 of the rigid bodies; computed with Pinocchio 4.1.0.
const REFERENCE: &str = include_str!("../../../../tests/data/planar_hip_knee/torque.csv");

/// States of the reference, and their torques.
fn reference() -> impl Iterator<Item = [f64; 8]> {
    REFERENCE.lines().skip(1).map(|line| {
        let mut numbers = line.split(',').skip(1).map(|number| number.parse().expect("a number"));
        core::array::from_fn(|_| numbers.next().expect("eight columns"))
    })
}

#[test]
fn lagrange_torque_equals_the_reference_vectors() {
    let leg = Mechanism::new(&planar_leg());
    assert_eq!(reference().count(), 50);
    for row in reference() {
        let [q1, q2, v1, v2, a1, a2, tau1, tau2] = row;
        let torque = leg.inverse_dynamics(&[q1, q2], &[v1, v2], &[a1, a2]);
        // The vectors are printed with 15 digits; the largest torque in them is about 70 N m.
        assert!((torque[0] - tau1).abs() < 1e-11 && (torque[1] - tau2).abs() < 1e-11, "{torque:?} {row:?}");
    }
}

/// Orientation and position of each link's frame from products of modified D-H transforms.
fn frames<const N: usize>(description: &LegDescription<N>, angles: &[f64; N]) -> [Matrix4<f64>; N] {
    let mut frame = Matrix4::identity();
    core::array::from_fn(|i| {
        let dh = description.joints[i].frame;
        frame *= Rotation3::from_axis_angle(&Vector3::x_axis(), dh.alpha).to_homogeneous()
            * Translation3::new(dh.a, 0.0, 0.0).to_homogeneous()
            * Rotation3::from_axis_angle(&Vector3::z_axis(), angles[i]).to_homogeneous()
            * Translation3::new(0.0, 0.0, dh.d).to_homogeneous();
        frame
    })
}

const ANGLES: [f64; 3] = [0.7, -1.1, 0.4];
const RATES: [f64; 3] = [1.3, -0.6, 2.1];

#[test]
fn kinetic_and_potential_energy_of_a_spatial_chain_equal_those_of_its_moving_frames() {
    let description = spatial_chain();
    let step = 1e-5;
    let at = |time: f64| frames(&description, &core::array::from_fn(|i| ANGLES[i] + time * RATES[i]));
    let (before, now, after) = (at(-step), at(0.0), at(step));
    let mut kinetic = 0.0;
    let mut potential = 0.0;
    for i in 0..3 {
        let joint = &description.joints[i];
        let body = &joint.body;
        let com = Vector3::from(body.com).push(1.0);
        let velocity = ((after[i] - before[i]) * com).xyz() / (2.0 * step);
        let change = (after[i] - before[i]).fixed_view::<3, 3>(0, 0) / (2.0 * step);
        // Angular velocity in the link frame: R' dR/dt is skew.
        let skew = now[i].fixed_view::<3, 3>(0, 0).transpose() * change;
        let spin = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
        let [xx, xy, xz, yy, yz, zz] = body.inertia_com;
        let inertia = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        kinetic += 0.5 * body.mass * velocity.norm_squared() + 0.5 * spin.dot(&(inertia * spin));
        kinetic += 0.5 * joint.rotor_inertia * RATES[i] * RATES[i];
        potential -= body.mass * Vector3::from(description.gravity).dot(&(now[i] * com).xyz());
    }
    let chain = Mechanism::new(&description);
    // Central differences over 1e-5 s leave 1e-10 of truncation and 1e-11 of rounding.
    assert!((chain.kinetic_energy(&ANGLES, &RATES) - kinetic).abs() < 1e-8 * kinetic);
    assert!((chain.potential_energy(&ANGLES) - potential).abs() < 1e-12 * potential.abs());
}

#[test]
fn coriolis_and_gravity_torque_are_the_derivatives_of_the_energies() {
    let chain = Mechanism::new(&spatial_chain());
    let acceleration = [0.8, -2.0, 1.5];
    let torque = chain.inverse_dynamics(&ANGLES, &RATES, &acceleration);
    let step = 1e-5;
    let moved = |values: &[f64; 3], joint: usize, by: f64| {
        let mut values = *values;
        values[joint] += by;
        values
    };
    let momentum = |time: f64, joint: usize| {
        let angles =
            core::array::from_fn(|i| ANGLES[i] + time * RATES[i] + 0.5 * time * time * acceleration[i]);
        let rates = core::array::from_fn(|i| RATES[i] + time * acceleration[i]);
        // Kinetic energy is quadratic in the rates: a difference over 2 is exact.
        0.5 * (chain.kinetic_energy(&angles, &moved(&rates, joint, 1.0))
            - chain.kinetic_energy(&angles, &moved(&rates, joint, -1.0)))
    };
    let lagrangian =
        |angles: &[f64; 3]| chain.kinetic_energy(angles, &RATES) - chain.potential_energy(angles);
    for joint in 0..3 {
        let rate_of_momentum = (momentum(step, joint) - momentum(-step, joint)) / (2.0 * step);
        let force = (lagrangian(&moved(&ANGLES, joint, step)) - lagrangian(&moved(&ANGLES, joint, -step)))
            / (2.0 * step);
        // Rounding of energies near 50 J over 2e-5.
        assert!((rate_of_momentum - force - torque[joint]).abs() < 2e-8, "joint {joint}");
    }
}
