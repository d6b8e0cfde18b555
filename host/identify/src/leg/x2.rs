//! Derivation of the default leg: a Fourier X2 exoskeleton leg with a wearer of a given mass.
//!
//! Why derived: the leg file's numbers are sums over seven bodies. This code checks them against their
//! sources and computes them for another wearer.
//!
//! - Exoskeleton: masses, sagittal inertias, centres of mass, friction and rotor inertia after the parameter
//!   file of CANOpenRobotController (University of Melbourne, Apache-2.0, `config/x2_params.yaml`); some are
//!   marked there as not yet investigated. "From hip" and "from knee" of the lower parts are read as in the
//!   constants below.
//! - Wearer: anthropometry after Winter ([`crate::formats::anthropometry`]), segments as long as the
//!   exoskeleton's.
//! - Motors: `MotorFile::D5065_CLASS`, whose 0.03 N m/A times the gear's 50 are the leg's 1.5 N m/A.
//! - Only sagittal inertias are given. Each segment is completed as a solid of revolution with
//!   mass * radius^2 / 2 about its long axis; the radii are stated below (ours).
//!
//! Frames: x down the segment, y forward, z along the joint's axis; everything lies in the plane z = 0. For
//! 75 kg: M1 10.34 kg, HX1 2.039 kg m, ZZ1 0.585 kg m^2 about the hip; M2 6.94, HX2 1.759, HY2 0.201, ZZ2
//! 0.633 about the knee.

use crate::formats::anthropometry::{Along, Segment, Wearer, joined};
use crate::formats::leg_file::{
    DhFile, EncoderFile, JointFile, LegFile, LinkParameters, MotorFile, SegmentsFile, Side,
};

const THIGH_M: f64 = 0.39;
const SHANK_M: f64 = 0.40;
const WEARER_FOOT_M: f64 = 0.27;

/// Body mass of the default wearer, kg.
pub const DEFAULT_WEARER_KG: f64 = 75.0;
/// Body mass of a standard wearer, which a designer would have assumed, kg.
const STANDARD_WEARER_KG: f64 = 70.0;

/// Part along its segment's axis.
fn tube(mass: f64, x: f64, sagittal: f64, radius: f64) -> Segment {
    Segment { mass, x, y: 0.0, sagittal, radius, along: Along::X }
}

/// Rotor inertia, Coulomb and viscous friction of a joint.
type Drive = [f64; 3];

/// Link of several segments, rounded to six decimals as in the file.
fn link(segments: &[Segment], [rotor_inertia, coulomb, viscous]: Drive) -> LinkParameters {
    let (mass, com, inertia_com) = joined(segments);
    let rounded = |value: f64| (value * 1e6).round() / 1e6;
    LinkParameters {
        mass: rounded(mass),
        com: com.map(rounded),
        // Adding 0 turns -0 into 0.
        inertia_com: inertia_com.map(|element| rounded(element) + 0.0),
        rotor_inertia,
        coulomb,
        viscous,
        offset: 0.0,
        asymmetry: 0.0,
    }
}

/// Thighs of exoskeleton and wearer. The exoskeleton's is a telescope: its upper part keeps its position
/// below the hip, its lower one above the knee.
fn thigh(wearer: &Wearer, drive: Drive) -> LinkParameters {
    let upper = tube(0.70, 0.0811, 0.002_197, 0.05);
    link(&[upper, tube(2.14, wearer.thigh - 0.055_64, 0.005_901, 0.05), wearer.thigh()], drive)
}

/// Shanks and feet of exoskeleton and wearer; the exoskeleton's shank is a telescope too.
fn shank(wearer: &Wearer, drive: Drive) -> LinkParameters {
    let (length, [calf, wearer_foot]) = (wearer.shank, wearer.shank());
    let upper = tube(0.64, 0.0908, 0.002_346, 0.05);
    let lower = tube(0.47, length - 0.0562, 0.000_794_1, 0.04);
    let foot =
        Segment { mass: 1.25, x: length, y: 0.088_34, sagittal: 0.004_441, radius: 0.05, along: Along::Y };
    link(&[upper, lower, foot, calf, wearer_foot], drive)
}

/// Hip and knee worn by a person of `body_mass` kg. The prior is a designer's: the same exoskeleton on a
/// standard wearer of 70 kg, round figures for rotor inertia and friction. Torque is limited to 85 N m. The
/// 100 N m of the exoskeleton would be 66.7 A, and the board measures up to 60.75 A at its finer gain.
pub fn leg_file(body_mass: f64) -> LegFile {
    let wearer = Wearer { mass: body_mass, thigh: THIGH_M, shank: SHANK_M, foot: WEARER_FOOT_M };
    leg_file_of(&wearer, STANDARD_WEARER_KG)
}

/// Default leg with a wearer's lengths, and a prior that assumes another body mass.
pub(crate) fn leg_file_of(wearer: &Wearer, prior_mass: f64) -> LegFile {
    let standard = Wearer { mass: prior_mass, ..*wearer };
    let drive = |joint: &mut JointFile| {
        joint.speed_limit_deg_s = 257.8;
        joint.torque_limit_nm = 85.0;
        joint.torque_per_ampere = 1.5;
        joint.encoder = EncoderFile { side: Side::Motor, counts: 8192, ratio: 50.0 };
        joint.motor = Some(MotorFile::D5065_CLASS);
    };
    let mut hip = JointFile::new("hip", DhFile { alpha: 0.0, a: 0.0, d: 0.0 });
    drive(&mut hip);
    hip.range_deg = [2.17, 50.18];
    hip.truth = Some(thigh(wearer, [1.9, 4.58, 5.01]));
    hip.prior = Some(thigh(&standard, [1.7, 4.0, 4.0]));
    let mut knee = JointFile::new("knee", DhFile { alpha: 0.0, a: wearer.thigh, d: 0.0 });
    drive(&mut knee);
    knee.direction = -1;
    knee.range_deg = [6.85, 95.53];
    knee.truth = Some(shank(wearer, [1.9, 4.67, 3.26]));
    knee.prior = Some(shank(&standard, [1.7, 4.0, 4.0]));
    let name = format!("x2-wearer-{}kg", wearer.mass);
    LegFile {
        torque_noise_percent: 7.0,
        bandwidth_hz: 16.0,
        segments: Some(SegmentsFile {
            shank_m: wearer.shank,
            foot_m: wearer.foot,
            wearer_kg: wearer.mass,
            prior_wearer_kg: prior_mass,
        }),
        ..LegFile::plain(&name, [9.81, 0.0, 0.0], vec![hip, knee])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_bodies_have_the_check_sums_of_their_sources() {
        let leg = leg_file(DEFAULT_WEARER_KG);
        let expected = [[10.34, 2.039, 0.0, 0.585], [6.94, 1.759, 0.201, 0.633]];
        for (joint, expected) in leg.joints.iter().zip(expected) {
            let truth = joint.truth.expect("derived");
            for (sum, expected) in truth.sums().iter().zip(expected) {
                // The reference sums have three decimals, masses two.
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
