//! The joint's zero, from a pose that the operator states.
//!
//! The encoder at the motor measures the position within a turn of the motor, but not the number of turns
//! behind the gear. So the joint's zero must be referenced once after every power-up. The pose is accepted
//! where the joint stood still for half a second without current.

use crate::hal::JointSample;
use crate::units::Hertz;

/// Counts within which a joint counts as resting.
const REST_COUNTS: i32 = 4;

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReferenceStep {
    /// The joint has not stood long enough.
    Running,
    /// The joint stood at the pose.
    Found,
    /// The joint moved.
    Moved,
}

/// Reference by a pose that the operator states; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StatedPose {
    stand_ticks: u32,
    first: Option<i32>,
    ticks: u32,
}

impl StatedPose {
    /// Creates a reference called `rate` times per second; `None` for a rate outside 100 Hz..100 kHz.
    pub fn new(rate: Hertz) -> Option<Self> {
        let stand_ticks = (0.5 * rate.0) as u32;
        (100.0..=100_000.0).contains(&rate.0).then_some(Self { stand_ticks, first: None, ticks: 0 })
    }

    /// Runs one tick, without current.
    pub fn tick(&mut self, sample: &JointSample) -> ReferenceStep {
        let first = *self.first.get_or_insert(sample.encoder_counts);
        if sample.encoder_counts.wrapping_sub(first).wrapping_abs() > REST_COUNTS {
            return ReferenceStep::Moved;
        }
        self.ticks = self.ticks.saturating_add(1);
        if self.ticks < self.stand_ticks { ReferenceStep::Running } else { ReferenceStep::Found }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hal::SERVO_RATE_HZ;

    #[test]
    fn a_stated_pose_wants_a_joint_that_stands() {
        let sample = |count| JointSample { encoder_counts: count, ..JointSample::default() };
        let mut pose = StatedPose::new(Hertz(SERVO_RATE_HZ as f32)).expect("usual");
        let mut ticks = 1;
        while pose.tick(&sample(-5)) == ReferenceStep::Running {
            ticks += 1;
        }
        assert_eq!((ticks, pose.tick(&sample(-5))), (2000, ReferenceStep::Found));
        let mut pose = StatedPose::new(Hertz(SERVO_RATE_HZ as f32)).expect("usual");
        let _ = pose.tick(&sample(-5));
        assert_eq!(pose.tick(&sample(10)), ReferenceStep::Moved);
        assert!(StatedPose::new(Hertz(f32::NAN)).is_none());
    }
}
