//! Hand that holds a joint at its position.
//!
//! ```text
//! torque = -(STIFFNESS (angle - held) + DAMPING rate), clamped to the hand's strength, during the grip
//! ```
//!
//! Why: a resisting wearer is a spring-damper, not a fixed torque pulse: the reaction depends on the drive.
//! The held position is the joint's at the start of the grip; a hand that is too weak is moved and continues
//! to pull. Stiffness and damping are assumptions about a firm grip. N m, rad, s, anatomical. Cost: a few
//! operations per step during the grip.

/// Stiffness, N m/rad: a degree at 35 N m.
const STIFFNESS: f64 = 2000.0;
/// Damping, N m s/rad: critical for some 1 kg m^2.
const DAMPING: f64 = 90.0;

/// Grip of a hand on one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grip {
    joint: usize,
    strength: f64,
    start: f64,
    duration: f64,
    held: Option<f64>,
}

impl Grip {
    /// A grip from `start` on, for `duration`, with at most `strength`.
    pub fn new(joint: usize, strength: f64, start: f64, duration: f64) -> Self {
        Self { joint, strength, start, duration, held: None }
    }

    /// Torque on each joint at the joints' positions and velocities.
    pub fn torque<const N: usize>(
        &mut self,
        position: &[f64; N],
        velocity: &[f64; N],
        time: f64,
    ) -> [f64; N] {
        let mut torque = [0.0; N];
        let since = time - self.start;
        if let (Some(angle), Some(rate), Some(torque)) =
            (position.get(self.joint), velocity.get(self.joint), torque.get_mut(self.joint))
            && (0.0..self.duration).contains(&since)
        {
            let held = *self.held.get_or_insert(*angle);
            let wanted = -(STIFFNESS * (angle - held) + DAMPING * rate);
            *torque = wanted.clamp(-self.strength, self.strength);
        }
        torque
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_opposes_motion_of_its_joint_up_to_its_strength() {
        let mut grip = Grip::new(1, 50.0, 1.0, 2.0);
        assert_eq!(grip.torque(&[0.3, 0.5], &[1.0, 1.0], 0.9), [0.0; 2]);
        assert_eq!(grip.torque(&[0.3, 0.5], &[0.0, 0.0], 1.0), [0.0; 2]);
        let [hip, knee] = grip.torque(&[0.4, 0.51], &[0.0, 0.0], 1.5);
        // Tolerance: rounding of the angle's difference.
        assert!(hip == 0.0 && (knee + 0.01 * STIFFNESS).abs() < 1e-9, "{knee}");
        assert_eq!(grip.torque(&[0.4, 0.4], &[0.0, 0.0], 1.5), [0.0, 50.0]);
        assert_eq!(grip.torque(&[0.4, 0.4], &[0.0, 0.0], 3.0), [0.0; 2]);
    }
}
