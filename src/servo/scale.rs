//! Conversion of a drive's counts and currents to the model's angles and torques.
//!
//! ```text
//! q   = direction * mounting * radian_per_count * counts + zero_offset
//! tau = direction * mounting * torque_per_ampere * current
//! ```
//!
//! Counts and currents grow with the joint's angle and torque (anatomical, flexion positive). `mounting` is
//! 1, or -1 where the drive is mounted mirrored, as on a left leg, and they fall. `q`, `tau` are the model's
//! (D-H). Counts are exact in `f32` up to 2^24, some 40 turns of a joint with 409,600 counts per turn.

use crate::model::AnatomicalJoint;
use crate::real::{abs, is_finite};
use crate::units::{Ampere, NewtonMetre, NewtonMetrePerAmpere, Radian};

/// Conversion of one joint; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointScale {
    /// Joint angle per encoder count, positive; includes gear ratio and counts per turn.
    pub radian_per_count: Radian,
    /// Sense and zero of the joint's angle in the model.
    pub anatomy: AnatomicalJoint<f32>,
    /// True if motor and encoder turn against the joint, as on a left leg.
    pub mirrored: bool,
    /// Joint torque per motor current, positive.
    pub torque_per_ampere: NewtonMetrePerAmpere,
}

impl JointScale {
    /// Model angle for a position in counts, fractions allowed.
    pub(crate) fn position(&self, counts: f32) -> Radian {
        Radian(self.anatomy.angle_to_chain(self.mounted(self.radian_per_count.0) * counts))
    }

    /// Model torque for a motor current.
    pub(crate) fn torque(&self, current: Ampere) -> NewtonMetre {
        NewtonMetre(self.signed_torque_per_ampere().0 * current.0)
    }

    /// Model angle per count, of either sign.
    pub fn signed_radian_per_count(&self) -> f32 {
        self.anatomy.to_chain(self.mounted(self.radian_per_count.0))
    }

    /// Model torque per motor current, of either sign.
    pub(crate) fn signed_torque_per_ampere(&self) -> NewtonMetrePerAmpere {
        NewtonMetrePerAmpere(self.anatomy.to_chain(self.mounted(self.torque_per_ampere.0)))
    }

    fn mounted(&self, value: f32) -> f32 {
        if self.mirrored { -value } else { value }
    }

    /// Valid range: 1e-7 to 0.1 radian per count, offset within 2 pi, a positive finite torque constant.
    pub(super) fn is_sensible(&self) -> bool {
        let step = self.radian_per_count.0;
        (1e-7..=0.1).contains(&step)
            && abs(self.anatomy.zero_offset()) <= core::f32::consts::TAU
            && self.torque_per_ampere.0 > 0.0
            && is_finite(self.torque_per_ampere.0)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Default leg: 8,192 counts at the motor, 50:1, 1.5 N m/A; the hip's sense is the model's.
    pub(in crate::servo) const HIP: JointScale = JointScale {
        radian_per_count: Radian(core::f32::consts::TAU / 409_600.0),
        anatomy: AnatomicalJoint { direction: 1.0, zero_offset: 0.0 },
        mirrored: false,
        torque_per_ampere: NewtonMetrePerAmpere(1.5),
    };

    /// Joint as [`HIP`], but flexion is negative in the model.
    pub(in crate::servo) const KNEE: JointScale =
        JointScale { anatomy: AnatomicalJoint { direction: -1.0, zero_offset: 0.0 }, ..HIP };

    #[test]
    fn angle_and_torque_change_sign_together_and_power_does_not() {
        let (flexed, current) = (65_190.0, Ampere(10.0));
        // A radian is 65,189.9 counts.
        assert!((HIP.position(flexed).0 - 1.0).abs() < 1e-5 && (KNEE.position(flexed).0 + 1.0).abs() < 1e-5);
        assert_eq!((HIP.torque(current), KNEE.torque(current)), (NewtonMetre(15.0), NewtonMetre(-15.0)));
        let anatomy = AnatomicalJoint::new(-1, 0.5).expect("a direction and a finite offset");
        let offset = JointScale { anatomy, ..KNEE };
        assert_eq!(offset.position(0.0), Radian(0.5));
    }

    #[test]
    fn a_mirrored_drive_turns_counts_and_currents_and_nothing_else() {
        let anatomy = AnatomicalJoint::new(-1, 0.5).expect("a direction and a finite offset");
        let right = JointScale { anatomy, ..HIP };
        let left = JointScale { mirrored: true, ..right };
        assert_eq!(left.position(-1000.0), right.position(1000.0));
        assert_eq!(left.torque(Ampere(-3.0)), right.torque(Ampere(3.0)));
        assert_eq!(left.signed_radian_per_count(), -right.signed_radian_per_count());
        assert_eq!(left.signed_torque_per_ampere().0, -right.signed_torque_per_ampere().0);
        assert!(left.is_sensible());
    }

    #[test]
    fn absurd_scales_are_not_sensible() {
        assert!(HIP.is_sensible() && KNEE.is_sensible());
        for radian_per_count in [0.0, -1e-5, f32::NAN, 1.0] {
            assert!(!JointScale { radian_per_count: Radian(radian_per_count), ..HIP }.is_sensible());
        }
        for constant in [0.0, -1.5, f32::INFINITY, f32::NAN] {
            let torque_per_ampere = NewtonMetrePerAmpere(constant);
            assert!(!JointScale { torque_per_ampere, ..HIP }.is_sensible());
        }
    }
}
