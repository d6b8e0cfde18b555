//! Geometry of a leg file in the firmware's types, and its fingerprint.

use scarab::model::{AnatomicalJoint, Chain, DenavitHartenberg, Fingerprint};
use scarab_base::error::FileError;

use super::{BodySide, JointFile, LegFile};

/// Kinematic chain of a leg.
pub fn chain<const N: usize>(leg: &LegFile) -> Result<Chain<f64, N>, FileError> {
    let geometry: Vec<_> = leg
        .joints
        .iter()
        .map(|joint| DenavitHartenberg { alpha: joint.dh.twist(), a: joint.dh.a, d: joint.dh.d })
        .collect();
    let count = geometry.len();
    let geometry: [_; N] =
        geometry.try_into().map_err(|_| leg.error(format!("{count} joints, expected {N}")))?;
    Chain::new(&geometry).map_err(|_| leg.error("a D-H number is not finite"))
}

/// Anatomical to D-H angles of every joint.
pub fn anatomical_joints(leg: &LegFile) -> Result<Vec<AnatomicalJoint<f64>>, FileError> {
    let joint = |joint: &JointFile| {
        let direction = if joint.direction < 0 { -1 } else { 1 };
        AnatomicalJoint::new(direction, joint.zero_offset_deg.to_radians()).map_err(|_| {
            leg.error(format!("joint {}: `direction` or `zero_offset_deg` is invalid", joint.name))
        })
    };
    leg.joints.iter().map(joint).collect()
}

/// [`anatomical_joints`] of a leg of this size.
pub fn anatomy<const N: usize>(leg: &LegFile) -> Result<[AnatomicalJoint<f64>; N], FileError> {
    let mut joints = [AnatomicalJoint::identity(); N];
    joints.iter_mut().zip(anatomical_joints(leg)?).for_each(|(slot, joint)| *slot = joint);
    Ok(joints)
}

/// Fingerprint of a leg as the board computes it, sixteen hexadecimal digits.
pub fn fingerprint(leg: &LegFile) -> Result<String, FileError> {
    fn with_joints<const N: usize>(leg: &LegFile) -> Result<Fingerprint, FileError> {
        let mounting = if leg.side == BodySide::Left { -1.0 } else { 1.0 };
        let constants = core::array::from_fn(|joint| mounting * leg.joints[joint].torque_per_ampere as f32);
        let anatomy = anatomy::<N>(leg)?.map(|joint| joint.convert());
        Ok(Fingerprint::new(&chain::<N>(leg)?.convert(), &anatomy, &constants))
    }
    let fingerprint = match leg.joints.len() {
        1 => with_joints::<1>(leg),
        2 => with_joints::<2>(leg),
        _ => with_joints::<3>(leg),
    }?;
    Ok(format!("{:016x}", fingerprint.0))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use crate::formats::leg_file::DhFile;

    #[test]
    fn a_rounded_right_angle_is_taken_as_one() {
        let twist = |alpha| DhFile { alpha, a: 0.0, d: 0.0 }.twist();
        let rounded =
            |angle: f64, decimals: i32| (angle * 10_f64.powi(decimals)).round() / 10_f64.powi(decimals);
        for (angle, decimals) in [(FRAC_PI_2, 4), (-FRAC_PI_2, 3), (FRAC_PI_2, 2), (PI, 4), (PI, 9)] {
            assert_eq!(twist(rounded(angle, decimals)), angle);
        }
        for kept in [0.0, 1e-5, -0.3, 1.56, FRAC_PI_2 + 2e-3, rounded(PI, 2)] {
            assert_eq!(twist(kept), kept);
        }
    }
}
