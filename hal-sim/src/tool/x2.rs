//! The default leg, derived: a Fourier X2 exoskeleton leg with a wearer of a given mass.
//!
//! Why derived: the leg file's numbers are sums over seven bodies; here they can be checked against their
//! sources and made for another wearer.
//!
//! - Exoskeleton: masses, sagittal inertias, centres of mass, friction and rotor inertia after the parameter
//!   file of CANOpenRobotController (University of Melbourne, Apache-2.0, `config/x2_params.yaml`); some are marked
//!   there as not yet investigated. "From hip" and "from knee" of the lower parts are read as in the constants
//!   below.
//! - Wearer: segment masses, centres of mass and radii of gyration as fractions after Winter, Biomechanics and
//!   Motor Control of Human Movement. Segments as long as the exoskeleton's, ankle held at a right angle, so shank
//!   and foot are one body.
//! - Only sagittal inertias are given, so each segment is completed as a solid of revolution: about its long axis
//!   it has mass * radius^2 / 2 with the radii stated below (ours).
//!
//! Frames: x down the segment, y forward, z along the joint's axis; everything lies in the plane z = 0. For
//! 75 kg: M1 10.34 kg, HX1 2.039 kg m, ZZ1 0.585 kg m^2 about the hip; M2 6.94, HX2 1.759, HY2 0.201, ZZ2
//! 0.633 about the knee.

use super::leg_file::{DhFile, EncoderFile, JointFile, LegFile, LinkParameters, Side};

const THIGH_M: f64 = 0.39;
const SHANK_M: f64 = 0.40;
const WEARER_FOOT_M: f64 = 0.27;

/// Body mass of the default wearer, kg.
pub const DEFAULT_WEARER_KG: f64 = 75.0;
/// Body mass of the standard wearer a designer would have assumed, kg.
const STANDARD_WEARER_KG: f64 = 70.0;

/// Long axis of a solid of revolution.
#[derive(Clone, Copy)]
enum Along {
    X,
    Y,
}

/// A solid of revolution in the plane of motion.
#[derive(Clone, Copy)]
struct Segment {
    mass: f64,
    /// Centre of mass, m.
    x: f64,
    y: f64,
    /// About the joint's axis through the centre of mass, kg m^2.
    sagittal: f64,
    /// m.
    radius: f64,
    along: Along,
}

/// Exoskeleton: upper and lower thigh.
const EXOSKELETON_THIGH: [Segment; 2] = [
    Segment { mass: 0.70, x: 0.0811, y: 0.0, sagittal: 0.002_197, radius: 0.05, along: Along::X },
    Segment { mass: 2.14, x: THIGH_M - 0.055_64, y: 0.0, sagittal: 0.005_901, radius: 0.05, along: Along::X },
];

/// Exoskeleton: upper and lower shank, foot.
const EXOSKELETON_SHANK: [Segment; 3] = [
    Segment { mass: 0.64, x: 0.0908, y: 0.0, sagittal: 0.002_346, radius: 0.05, along: Along::X },
    Segment { mass: 0.47, x: SHANK_M - 0.0562, y: 0.0, sagittal: 0.000_794_1, radius: 0.04, along: Along::X },
    Segment { mass: 1.25, x: SHANK_M, y: 0.088_34, sagittal: 0.004_441, radius: 0.05, along: Along::Y },
];

fn wearer_thigh(body_mass: f64) -> Segment {
    limb(0.100 * body_mass, THIGH_M, 0.323, 0.08)
}

fn wearer_shank(body_mass: f64) -> [Segment; 2] {
    let mass = 0.0145 * body_mass;
    let gyration = 0.475 * WEARER_FOOT_M;
    let foot = Segment {
        mass,
        x: SHANK_M,
        y: 0.083,
        sagittal: mass * gyration * gyration,
        radius: 0.04,
        along: Along::Y,
    };
    [limb(0.0465 * body_mass, SHANK_M, 0.302, 0.055), foot]
}

/// Thigh or shank: centre of mass at 0.433 of the length from the upper joint.
fn limb(mass: f64, length: f64, gyration: f64, radius: f64) -> Segment {
    let gyration = gyration * length;
    Segment { mass, x: 0.433 * length, y: 0.0, sagittal: mass * gyration * gyration, radius, along: Along::X }
}

/// One rigid body of several segments, about their common centre of mass; rounded to six decimals, as it is
/// printed.
fn joined(segments: &[Segment], rotor_inertia: f64, coulomb: f64, viscous: f64) -> LinkParameters {
    let mass: f64 = segments.iter().map(|segment| segment.mass).sum();
    let x = segments.iter().map(|segment| segment.mass * segment.x).sum::<f64>() / mass;
    let y = segments.iter().map(|segment| segment.mass * segment.y).sum::<f64>() / mass;
    let mut inertia = [0.0; 6];
    for segment in segments {
        let (dx, dy) = (segment.x - x, segment.y - y);
        let axial = 0.5 * segment.mass * segment.radius * segment.radius;
        let (xx, yy) = match segment.along {
            Along::X => (axial, segment.sagittal),
            Along::Y => (segment.sagittal, axial),
        };
        inertia[0] += xx + segment.mass * dy * dy;
        inertia[1] -= segment.mass * dx * dy;
        inertia[3] += yy + segment.mass * dx * dx;
        inertia[5] += segment.sagittal + segment.mass * (dx * dx + dy * dy);
    }
    let rounded = |value: f64| (value * 1e6).round() / 1e6;
    LinkParameters {
        mass: rounded(mass),
        com: [x, y, 0.0].map(rounded),
        // Adding 0 turns -0 into 0.
        inertia_com: inertia.map(|element| rounded(element) + 0.0),
        rotor_inertia,
        coulomb,
        viscous,
        offset: 0.0,
    }
}

fn thigh(body_mass: f64, rotor_inertia: f64, coulomb: f64, viscous: f64) -> LinkParameters {
    let [upper, lower] = EXOSKELETON_THIGH;
    joined(&[upper, lower, wearer_thigh(body_mass)], rotor_inertia, coulomb, viscous)
}

fn shank(body_mass: f64, rotor_inertia: f64, coulomb: f64, viscous: f64) -> LinkParameters {
    let [upper, lower, foot] = EXOSKELETON_SHANK;
    let [wearer, wearer_foot] = wearer_shank(body_mass);
    joined(&[upper, lower, foot, wearer, wearer_foot], rotor_inertia, coulomb, viscous)
}

/// Hip and knee worn by somebody of `body_mass` kg. The prior is what a designer would write down: the same
/// exoskeleton on a standard wearer of 70 kg, round figures for rotor inertia and friction. Torque is capped
/// at 85 N m: the 100 N m of the exoskeleton would be 66.7 A, beyond the 60.75 A that the board measures at
/// its finer gain.
#[must_use]
pub fn leg_file(body_mass: f64) -> LegFile {
    let drive = |joint: &mut JointFile| {
        joint.speed_limit_deg_s = 257.8;
        joint.torque_limit_nm = 85.0;
        joint.torque_per_ampere = 1.5;
        joint.encoder = EncoderFile { side: Side::Motor, counts: 8192, ratio: 50.0 };
    };
    let mut hip = JointFile::new("hip", DhFile { alpha: 0.0, a: 0.0, d: 0.0 });
    drive(&mut hip);
    hip.range_deg = [2.17, 50.18];
    hip.truth = Some(thigh(body_mass, 1.9, 4.58, 5.01));
    hip.prior = Some(thigh(STANDARD_WEARER_KG, 1.7, 4.0, 4.0));
    let mut knee = JointFile::new("knee", DhFile { alpha: 0.0, a: THIGH_M, d: 0.0 });
    drive(&mut knee);
    knee.direction = -1;
    knee.range_deg = [6.85, 95.53];
    knee.truth = Some(shank(body_mass, 1.9, 4.67, 3.26));
    knee.prior = Some(shank(STANDARD_WEARER_KG, 1.7, 4.0, 4.0));
    LegFile {
        name: format!("x2-wearer-{body_mass}kg"),
        gravity: [9.81, 0.0, 0.0],
        torque_noise_percent: 7.0,
        bandwidth_hz: 16.0,
        pushes: None,
        joints: vec![hip, knee],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// M, HX, HY, ZZ about the joint.
    fn sums(link: &LinkParameters) -> [f64; 4] {
        let [x, y, _] = link.com;
        let about_joint = link.inertia_com[5] + link.mass * (x * x + y * y);
        [link.mass, link.mass * x, link.mass * y, about_joint]
    }

    #[test]
    fn derived_bodies_have_the_check_sums_of_their_sources() {
        let leg = leg_file(DEFAULT_WEARER_KG);
        let expected = [[10.34, 2.039, 0.0, 0.585], [6.94, 1.759, 0.201, 0.633]];
        for (joint, expected) in leg.joints.iter().zip(expected) {
            let truth = joint.truth.expect("derived");
            for (sum, expected) in sums(&truth).iter().zip(expected) {
                // The check sums are given with three decimals, masses with two.
                assert!(
                    (sum - expected).abs() < if expected > 5.0 { 6e-3 } else { 6e-4 },
                    "{sum} {expected}"
                );
            }
            assert_eq!(truth.rotor_inertia, 1.9);
        }
    }

    #[test]
    fn any_wearer_gives_a_leg_that_passes_the_checks_of_a_file() {
        for body_mass in [30.0, 52.5, 75.0, 140.0] {
            let leg = leg_file(body_mass);
            assert_eq!(LegFile::parse(&leg.to_toml(), "derived").as_ref(), Ok(&leg));
        }
    }
}
