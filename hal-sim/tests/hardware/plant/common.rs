//! Legs shared by the plant's tests.

use core::f64::consts::FRAC_PI_2;
use hal_sim::description::{
    BodyDescription, CurrentSensorDescription, DenavitHartenberg, DriveDescription, EncoderDescription,
    EncoderSide, FrictionDescription, JointDescription, LegDescription,
};

/// A joint with an ideal drive (1 N m/A, no lag), a fine encoder, and without rotor, friction or noise.
pub fn joint(frame: [f64; 3], mass: f64, com: [f64; 3], inertia_com: [f64; 6]) -> JointDescription {
    let [alpha, a, d] = frame;
    JointDescription {
        stops: None,
        frame: DenavitHartenberg { alpha, a, d },
        direction: 1.0,
        zero_offset: 0.0,
        body: BodyDescription { mass, com, inertia_com },
        rotor_inertia: 0.0,
        friction: FrictionDescription::default(),
        drive: DriveDescription { torque_per_ampere: 1.0, current_limit: 500.0, lag: 0.0 },
        encoder: EncoderDescription { side: EncoderSide::Joint, counts: 16384.0, ratio: 1.0 },
        current_sensor: CurrentSensorDescription::default(),
    }
}

pub fn leg<const N: usize>(gravity: [f64; 3], joints: [JointDescription; N]) -> LegDescription<N> {
    LegDescription { gravity, joints, mirrored: false, pushes: None }
}

/// Two links of the reference torque vectors (about the centres of mass), without friction.
pub fn planar_leg() -> LegDescription<2> {
    leg(
        [9.81, 0.0, 0.0],
        [
            joint([0.0, 0.0, 0.0], 8.5, [0.2, 0.012, 0.03], [0.02, 0.004, -0.006, 0.16, 0.001, 0.165]),
            joint([0.0, 0.45, 0.0], 4.8, [0.18, -0.015, 0.02], [0.01, -0.002, 0.003, 0.095, 0.0005, 0.098]),
        ],
    )
}

/// Hip and knee with the friction and rotors of an exoskeleton in use.
pub fn worn_leg() -> LegDescription<2> {
    let mut worn = planar_leg();
    for (joint, (coulomb, viscous)) in worn.joints.iter_mut().zip([(4.58, 5.01), (4.67, 3.26)]) {
        joint.rotor_inertia = 1.9;
        joint.friction = FrictionDescription { coulomb, viscous, offset: 0.3, stribeck: None };
        joint.drive.lag = 5e-4;
    }
    worn
}

/// Three joints, none parallel to its neighbour, with twists, lengths and offsets.
pub fn spatial_chain() -> LegDescription<3> {
    let mut chain = leg(
        [1.2, -3.4, 9.0],
        [
            joint([0.3, 0.1, 0.2], 6.0, [0.05, -0.03, 0.1], [0.05, 0.004, -0.006, 0.04, 0.003, 0.06]),
            joint([FRAC_PI_2, 0.15, -0.1], 5.0, [0.2, 0.02, 0.01], [0.02, 0.002, 0.001, 0.05, -0.004, 0.06]),
            joint([-0.7, 0.4, 0.05], 3.0, [0.15, -0.04, 0.02], [0.01, 0.001, -0.002, 0.03, 0.002, 0.03]),
        ],
    );
    chain.joints[1].rotor_inertia = 0.2;
    chain
}

/// A solid of revolution in the sagittal plane: mass, centre of mass along and forward, sagittal inertia,
/// radius; and whether its long axis points forward.
type Solid = (f64, [f64; 2], f64, f64, bool);

/// Joins solids to one rigid body in a frame with x along the segment, y forward, z along the joint's axis.
pub fn joined(solids: &[Solid]) -> BodyDescription {
    let mut whole = BodyDescription::default();
    for &(mass, [x, y], sagittal, radius, is_forward) in solids {
        whole = whole.with_point_mass(mass, [x, y, 0.0]);
        let axial = 0.5 * mass * radius * radius;
        let [xx, yy] = if is_forward { [sagittal, axial] } else { [axial, sagittal] };
        for (element, own) in [(0, xx), (3, yy), (5, sagittal)] {
            whole.inertia_com[element] += own;
        }
    }
    whole
}
