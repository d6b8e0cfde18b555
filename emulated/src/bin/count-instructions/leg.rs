//! The default leg (`host/legs/x2-wearer-75kg.toml`) in the device's precision, and its designed motion.

use nalgebra::{Matrix3, Vector3};
use scarab::ident::{
    Choice, Estimator, LinkPrior, MonitorSettings, Plan, RowModel, Thresholds, prior_parameters,
};
use scarab::leg::LegConfiguration;
use scarab::model::{
    AnatomicalJoint, BaseParameters, Chain, DenavitHartenberg, LegParameters, PARAMETERS_PER_JOINT, RigidBody,
};
use scarab::motion::{ExcitationTable, Periodic};
use scarab::servo::{JointConfiguration, JointScale, SERVO_RATE_HZ};
use scarab::units::{
    Ampere, Hertz, KilogramMetreSquared, NewtonMetre, NewtonMetrePerAmpere, Radian, RadianPerSecond,
    RadianPerSecondSquared,
};

pub use scarab::model::planar::{BASE, JOINTS};

/// Bandwidth stated in the leg file.
pub const BANDWIDTH_HZ: f32 = 16.0;
pub const GRAVITY: [f32; 3] = [9.81, 0.0, 0.0];
const TORQUE_PER_AMPERE: f32 = 1.5;

pub type Model = RowModel<f32, JOINTS, BASE>;

/// Created by `cargo sim excite --const`: 22.0 s, blends included.
#[rustfmt::skip]
const EXCITATION: ExcitationTable<2, 6> = ExcitationTable {
    period_s: 3.333,
    blend_s: 1.0,
    cycles: 6,
    centre_rad: [0.559239, -0.994625],
    sine_rad: [
        [0.271927, 0.062213, -0.017331, -0.05739, -0.01749, -0.047559],
        [0.282618, -0.208842, 0.035044, -0.104564, 0.054492, 0.008378],
    ],
    cosine_rad: [
        [-0.091811, 0.089492, 0.085448, -0.021941, 0.041228, 0.034555],
        [-0.243743, -0.096576, 0.22616, -0.011679, -0.041375, -0.123618],
    ],
};

pub fn excitation() -> Option<Periodic<JOINTS>> {
    EXCITATION.motion(SERVO_RATE_HZ).ok()
}

/// Row model of the default leg: rotor and offset estimated, Stribeck friction searched.
#[inline(never)]
pub fn model() -> Option<Model> {
    let joint = |a| DenavitHartenberg { alpha: 0.0, a, d: 0.0 };
    let chain = Chain::new(&[joint(0.0), joint(0.39)]).ok()?;
    let gravity = Vector3::from(GRAVITY);
    let base = BaseParameters::analyse(&chain, &gravity, &[[true; PARAMETERS_PER_JOINT]; JOINTS]).ok()?;
    Some(RowModel { stribeck_choice: [Choice::Auto; JOINTS], ..RowModel::new(chain, gravity, base) })
}

fn link(
    mass: f32,
    com: [f32; 3],
    inertia: [f32; 6],
    rotor_inertia: f32,
    coulomb: f32,
    viscous: f32,
) -> LinkPrior<f32> {
    let [xx, xy, xz, yy, yz, zz] = inertia;
    LinkPrior {
        body: RigidBody {
            mass,
            centre_of_mass: Vector3::from(com),
            inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        },
        rotor_inertia,
        coulomb_friction: coulomb,
        viscous_friction: viscous,
        offset: 0.0,
    }
}

/// Parameters that generate the torques.
pub fn truth() -> LegParameters<f32, JOINTS> {
    let hip = [0.02755, 0.0, 0.0, 0.182826, 0.0, 0.182826];
    let knee = [0.040218, -0.02938, 0.0, 0.149894, 0.0, 0.181229];
    prior_parameters(&[
        link(10.34, [0.197178, 0.0, 0.0], hip, 1.9, 4.58, 5.01),
        link(6.935, [0.253602, 0.028938, 0.0], knee, 1.9, 4.67, 3.26),
    ])
}

/// Prior of the links.
pub fn prior() -> [LinkPrior<f32>; JOINTS] {
    let hip = [0.02595, 0.0, 0.0, 0.17447, 0.0, 0.17447];
    let knee = [0.038266, -0.028262, 0.0, 0.143377, 0.0, 0.173169];
    [
        link(9.84, [0.198617, 0.0, 0.0], hip, 1.7, 4.0, 4.0),
        link(6.63, [0.254821, 0.029362, 0.0], knee, 1.7, 4.0, 4.0),
    ]
}

pub fn scales() -> [JointScale; JOINTS] {
    [AnatomicalJoint::SAME, AnatomicalJoint::OPPOSITE].map(|anatomy| JointScale {
        radian_per_count: Radian(core::f32::consts::TAU / 409_600.0),
        anatomy,
        mirrored: false,
        torque_per_ampere: NewtonMetrePerAmpere(TORQUE_PER_AMPERE),
    })
}

/// Complete configuration, with the exciting motion in place of every motion.
#[inline(never)]
pub fn configuration(model: Model, motion: Periodic<JOINTS>) -> LegConfiguration<JOINTS, BASE> {
    let ranges = [[2.17_f32, 50.18], [-95.53, -6.85]].map(|range| range.map(f32::to_radians));
    let [hip, knee] = scales();
    let joint = |scale: JointScale, [low, high]: [f32; 2], inertia: f32| JointConfiguration {
        scale,
        low: Radian(low),
        high: Radian(high),
        speed: RadianPerSecond(257.8_f32.to_radians()),
        torque: NewtonMetre(85.0),
        current: Ampere(85.0 / TORQUE_PER_AMPERE),
        inertia: KilogramMetreSquared(inertia),
        bandwidth: Hertz(6.0),
    };
    LegConfiguration {
        // Inertia of the prior's stretched leg, rotors included.
        joints: [joint(hip, ranges[0], 5.2), joint(knee, ranges[1], 2.3)],
        acceleration: [RadianPerSecondSquared(2000.0_f32.to_radians()); JOINTS],
        model,
        prior: Some(prior()),
        plan: Plan::default(),
        swarm_seed: 1,
        thresholds: Thresholds::default(),
        monitor: MonitorSettings::default(),
        estimator: Estimator::default(),
        bandwidth_hz: BANDWIDTH_HZ,
        excitation: motion,
        validation: [motion; scarab::leg::VALIDATION_MOTIONS],
    }
}
