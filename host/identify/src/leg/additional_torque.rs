//! Torque of a joint that the rigid-body model lacks: a spring, and friction that grows with the load.
//!
//! ```text
//! torque = L + c sign(qd) |L| + k q + F
//! L = (torque - k q - F) / (1 + c sign(qd (torque - k q - F)))
//! ```
//!
//! L is the torque of the bodies, gravity and rotor, which the gear transmits; F the friction and offset of
//! the model; q the anatomical angle. The constant part of a spring, -k times its angle at rest (`REST1`), is
//! measured in a sum with the offset. Friction by load is that of gears (Hamon, Gautier and Garrec 2010).

use scarab::real::sign;

use crate::formats::recording::{JointSeries, Recording};
use crate::report::additional_torque::{AdditionalKind, AdditionalTorque};

/// Time before and after a sample over which its speed is measured, s.
const REACH_S: f64 = 0.05;
/// Largest friction by load that is subtracted: at one nothing is left of a load that drives the gear.
const LARGEST_SHARE: f64 = 0.9;

/// Stiffness, N m/rad, and friction by load of a joint, from 0.
fn of_joint(torques: &[AdditionalTorque], joint: usize) -> [f64; 2] {
    AdditionalKind::ALL.map(|kind| {
        let of = torques.iter().filter(|torque| torque.joint == joint + 1 && torque.kind == kind);
        of.map(|torque| torque.value).sum()
    })
}

/// Additional torques of all joints, with the friction that is not transmitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Additional {
    /// Each torque.
    pub(crate) torques: Vec<AdditionalTorque>,
    /// Coulomb friction, N m, viscous friction, N m s/rad, and offset, N m, of each joint.
    pub(crate) friction: Vec<[f64; 3]>,
}

impl Additional {
    /// Joints with a spring, from 0.
    pub(crate) fn springs(&self) -> impl Iterator<Item = usize> + '_ {
        let springs = self.torques.iter().filter(|torque| torque.kind == AdditionalKind::Spring);
        springs.map(|torque| torque.joint - 1)
    }

    /// Subtracts the torques from those of a recording.
    pub(crate) fn subtract(&self, recording: &mut Recording) {
        let reach = (REACH_S / recording.median_step_s()).round().max(1.0) as usize;
        let time_s = &recording.time_s;
        for (joint, series) in recording.joints.iter_mut().enumerate() {
            let [stiffness, share] = of_joint(&self.torques, joint);
            let share = share.clamp(-LARGEST_SHARE, LARGEST_SHARE);
            let [coulomb, viscous, offset] = self.friction.get(joint).copied().unwrap_or_default();
            let JointSeries { position_rad, torque_nm } = series;
            let last = position_rad.len().saturating_sub(1);
            for (sample, torque) in torque_nm.iter_mut().enumerate() {
                let (before, after) = (sample.saturating_sub(reach), (sample + reach).min(last));
                let passed_s = (time_s[after] - time_s[before]).max(f64::MIN_POSITIVE);
                let speed = (position_rad[after] - position_rad[before]) / passed_s;
                let friction = coulomb * sign(speed) + viscous * speed + offset;
                let loaded = *torque - stiffness * position_rad[sample] - friction;
                *torque = loaded / (1.0 + share * sign(speed * loaded)) + friction;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subtracted_torque_is_the_one_that_was_added() {
        let torques = [(AdditionalKind::Spring, 7.0), (AdditionalKind::LoadFriction, 0.12)]
            .map(|(kind, value)| AdditionalTorque { joint: 1, kind, value, sigma: 0.0, shift: Vec::new() });
        let time_s: Vec<f64> = (0..200).map(|sample| 0.01 * f64::from(sample)).collect();
        let position_rad: Vec<f64> = time_s.iter().map(|time| 0.4 + (3.0 * time).sin()).collect();
        let samples = time_s.iter().zip(&position_rad).map(|(time, angle)| {
            let (load, speed) = (20.0 * (2.0 * time).cos(), 3.0 * (3.0 * time).cos());
            let friction = 2.0 * speed.signum() + 0.5 * speed - 0.3;
            let more: f64 =
                torques.iter().map(|torque| torque.value * torque.slope(load, *angle, speed)).sum();
            (load + friction, load + friction + more)
        });
        let (model, torque_nm): (Vec<f64>, Vec<f64>) = samples.unzip();
        let joints = vec![JointSeries { position_rad, torque_nm }];
        let mut recording = Recording { file: "test".into(), time_s, joints, joints_in_file: 1 };
        Additional { torques: torques.into(), friction: vec![[2.0, 0.5, -0.3]] }.subtract(&mut recording);
        let wrong = recording.joints[0]
            .torque_nm
            .iter()
            .zip(&model)
            .filter(|(one, other)| (*one - *other).abs() > 0.01);
        // The speed is a difference quotient, which reverses a sample early or late.
        assert!(wrong.count() <= 4);
    }
}
