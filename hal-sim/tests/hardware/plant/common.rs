//! Legs and a person shared by the tests.
#![expect(clippy::disallowed_methods, reason = "expected values by another library than the plant's")]

use core::f64::consts::FRAC_PI_2;
use hal_sim::description::{
    BodyDescription, CurrentSensorDescription, DenavitHartenberg, DriveDescription, EncoderDescription,
    FrictionDescription, JointDescription, LegDescription,
};
use hal_sim::wearer::description::SegmentDescription;

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
        encoder: EncoderDescription { counts: 16384.0, ratio: 1.0 },
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

/// The leg described otherwise: the knee's axis is reversed (its frame turned by half a turn about x), and
/// the hip's angle counted from another zero (the base turned about the hip's axis).
pub fn turned(plain: &LegDescription<2>) -> LegDescription<2> {
    let mut turned = *plain;
    let (sine, cosine) = 0.3_f64.sin_cos();
    turned.gravity = [9.81 * cosine, 9.81 * sine, 0.0];
    turned.joints[0].zero_offset = 0.3;
    let knee = &mut turned.joints[1];
    knee.direction = -knee.direction;
    knee.frame.alpha = core::f64::consts::PI;
    knee.friction.offset = -knee.friction.offset;
    let [x, y, z] = knee.body.com;
    knee.body.com = [x, -y, -z];
    let [xx, xy, xz, yy, yz, zz] = knee.body.inertia_com;
    knee.body.inertia_com = [xx, -xy, -xz, yy, yz, zz];
    turned
}

/// Lengths of thigh, shank and foot, m, to which the exoskeleton's telescopes are set.
pub type Lengths = [f64; 3];
const BODY_KG: f64 = 75.0;
/// Rotor inertia, Coulomb and viscous friction of hip and knee of the default exoskeleton.
pub const DRIVES: [[f64; 3]; 2] = [[1.9, 4.58, 5.01], [1.9, 4.67, 3.26]];

/// A solid of revolution in the sagittal plane: mass, centre of mass along and forward, sagittal inertia,
/// radius; and whether its long axis points forward.
type Solid = (f64, [f64; 2], f64, f64, bool);

/// Both bodies as one, in their common frame.
pub fn joined(one: &BodyDescription, other: &BodyDescription) -> BodyDescription {
    let mut whole = one.with_point_mass(other.mass, other.com);
    whole.inertia_com.iter_mut().zip(other.inertia_com).for_each(|(element, own)| *element += own);
    whole
}

/// Joins solids to one rigid body in a frame with x along the segment, y forward, z along the joint's axis.
fn rigid(solids: &[Solid]) -> BodyDescription {
    solids.iter().fold(BodyDescription::default(), |whole, &(mass, [x, y], sagittal, radius, is_forward)| {
        let axial = 0.5 * mass * radius * radius;
        let [xx, yy] = if is_forward { [sagittal, axial] } else { [axial, sagittal] };
        let inertia_com = [xx, 0.0, 0.0, yy, 0.0, sagittal];
        joined(&whole, &BodyDescription { mass, com: [x, y, 0.0], inertia_com })
    })
}

/// Thigh, and shank with foot, of a person of 75 kg by Winter's fractions.
pub fn limb([thigh_m, shank_m, foot_m]: Lengths) -> [BodyDescription; 2] {
    let segment = |mass: f64, length: f64, gyration: f64| {
        (mass, [0.433 * length, 0.0], mass * (gyration * length).powi(2), 0.05, false)
    };
    let foot_kg = 0.0145 * BODY_KG;
    let foot = (foot_kg, [shank_m, 0.307 * foot_m], foot_kg * (0.475 * foot_m).powi(2), 0.04, true);
    [
        rigid(&[segment(0.100 * BODY_KG, thigh_m, 0.323)]),
        rigid(&[segment(0.0465 * BODY_KG, shank_m, 0.302), foot]),
    ]
}

/// [`limb`] for a wearer.
pub fn limb_segments(lengths: Lengths) -> [SegmentDescription; 2] {
    limb(lengths).map(|BodyDescription { mass, com: [x, y, _], inertia_com }| SegmentDescription {
        mass,
        com: [x, y],
        inertia_com: inertia_com[5],
    })
}

/// Links of the default exoskeleton without wearer; no friction, no rotors.
pub fn bare_exoskeleton([thigh_m, shank_m, _]: Lengths) -> LegDescription<2> {
    let thigh = rigid(&[
        (0.70, [0.0811, 0.0], 0.002_197, 0.05, false),
        (2.14, [thigh_m - 0.055_64, 0.0], 0.005_901, 0.05, false),
    ]);
    let shank = rigid(&[
        (0.64, [0.0908, 0.0], 0.002_346, 0.05, false),
        (0.47, [shank_m - 0.0562, 0.0], 0.000_794_1, 0.04, false),
        (1.25, [shank_m, 0.088_34], 0.004_441, 0.05, true),
    ]);
    let hip = joint([0.0; 3], thigh.mass, thigh.com, thigh.inertia_com);
    let mut knee = joint([0.0, thigh_m, 0.0], shank.mass, shank.com, shank.inertia_com);
    knee.direction = -1.0;
    leg([9.81, 0.0, 0.0], [hip, knee])
}

/// Default exoskeleton with rotors and friction.
pub fn exoskeleton(lengths: Lengths) -> LegDescription<2> {
    let mut description = bare_exoskeleton(lengths);
    for (joint, [rotor_inertia, coulomb, viscous]) in description.joints.iter_mut().zip(DRIVES) {
        joint.rotor_inertia = rotor_inertia;
        joint.friction = FrictionDescription { coulomb, viscous, offset: 0.0, stribeck: None };
    }
    description
}
