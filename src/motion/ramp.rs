//! Motion from a pose to a pose, at rest at both ends, as fast as the given speeds and accelerations allow.
//!
//! The path of least jerk between two rests (T. Flash, N. Hogan, "The coordination of arm movements", Journal
//! of Neuroscience 5, 1985, equation 3), all joints together:
//!
//! ```text
//! q(x) = from + (to - from) (10 x^3 - 15 x^4 + 6 x^5),   x = t / T in 0..=1
//! max |qd|  = 15/8 |to - from| / T            at x = 1/2
//! max |qdd| = 10/sqrt(3) |to - from| / T^2    at x = 1/2 -+ 1/sqrt(12)
//! T = max over joints of  15/8 d / speed,  sqrt(10/sqrt(3) d / acceleration)
//! ```
//!
//! `T` is rounded up to whole ticks. Velocity and acceleration are zero and continuous at both ends.
//! Cost of one evaluation: 10 multiplications and 3 per joint.

use super::{JointEnvelope, MOST_EXACT_TICKS, MotionError, MotionState};
use crate::real::{abs, is_finite, max, min, sqrt};
use crate::units::{Radian, RadianPerSecond, RadianPerSecondSquared};

/// Peak speed of the unit path, 15/8.
const PEAK_SPEED: f32 = 1.875;
/// Peak acceleration of the unit path, 10/sqrt(3).
const PEAK_ACCELERATION: f32 = 5.773_503;

/// A motion from a pose to a pose; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp<const N: usize> {
    from_rad: [f32; N],
    to_rad: [f32; N],
    duration_ticks: u32,
    per_tick: f32,
    per_second: f32,
}

impl<const N: usize> Ramp<N> {
    /// Builds the fastest ramp within the joints' speeds and accelerations, at `rate_hz` ticks per second.
    pub fn between(
        from_rad: [f32; N],
        to_rad: [f32; N],
        speed: [RadianPerSecond; N],
        acceleration: [RadianPerSecondSquared; N],
        rate_hz: u32,
    ) -> Result<Self, MotionError> {
        let mut seconds = 0.0_f32;
        for joint in 0..N {
            if !(is_finite(from_rad[joint]) && is_finite(to_rad[joint])) {
                return Err(MotionError::NotFinite { joint });
            }
            if !(speed[joint].0 > 0.0 && acceleration[joint].0 > 0.0) {
                return Err(MotionError::Rate { joint });
            }
            let distance = abs(to_rad[joint] - from_rad[joint]);
            seconds = max(seconds, PEAK_SPEED * distance / speed[joint].0);
            seconds = max(seconds, sqrt(PEAK_ACCELERATION * distance / acceleration[joint].0));
        }
        // One extra tick makes up for the cast, which rounds down.
        let ticks = seconds * rate_hz as f32;
        let fits = ticks < (MOST_EXACT_TICKS - 1) as f32;
        if !fits || rate_hz == 0 {
            return Err(MotionError::Period);
        }
        let duration_ticks = ticks as u32 + 1;
        let per_tick = 1.0 / duration_ticks as f32;
        Ok(Self { from_rad, to_rad, duration_ticks, per_tick, per_second: per_tick * rate_hz as f32 })
    }

    /// Ticks until the joints are at rest at their goal.
    pub fn duration_ticks(&self) -> u32 {
        self.duration_ticks
    }

    /// State `tick` ticks after the start; at rest in the goal from the last tick on.
    pub fn state_at(&self, tick: u32) -> MotionState<N> {
        if tick >= self.duration_ticks {
            return MotionState::at_rest(self.to_rad);
        }
        let x = tick as f32 * self.per_tick;
        let rest = (self.duration_ticks - tick) as f32 * self.per_tick;
        let speed = 30.0 * (x * rest) * (x * rest) * self.per_second;
        let acceleration = 60.0 * x * rest * (rest - x) * (self.per_second * self.per_second);
        // The path is its own mirror image: measured from the nearer end it keeps its digits.
        let (near_rad, sign, u) =
            if x < rest { (&self.from_rad, 1.0, x) } else { (&self.to_rad, -1.0, rest) };
        let path = sign * u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let span = |joint: usize| self.to_rad[joint] - self.from_rad[joint];
        MotionState {
            position_rad: core::array::from_fn(|joint| near_rad[joint] + span(joint) * path),
            velocity_rad_per_s: core::array::from_fn(|joint| span(joint) * speed),
            acceleration_rad_per_s2: core::array::from_fn(|joint| span(joint) * acceleration),
        }
    }

    /// Exact bounds of the ramp, with 16 units in the last place for the arithmetic of the tick.
    pub fn envelope(&self) -> [JointEnvelope; N] {
        core::array::from_fn(|joint| {
            let (from, to) = (self.from_rad[joint], self.to_rad[joint]);
            let distance = abs(to - from);
            let rounding = 16.0 * f32::EPSILON;
            let slack = rounding * (abs(from) + abs(to));
            let speed = PEAK_SPEED * distance * self.per_second;
            let acceleration = PEAK_ACCELERATION * distance * (self.per_second * self.per_second);
            JointEnvelope {
                low: Radian(min(from, to) - slack),
                high: Radian(max(from, to) + slack),
                speed: RadianPerSecond(speed * (1.0 + rounding)),
                acceleration: RadianPerSecondSquared(acceleration * (1.0 + rounding)),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: u32 = 4000;

    fn ramp() -> Ramp<2> {
        let speed = [RadianPerSecond(1.0), RadianPerSecond(2.0)];
        let acceleration = [RadianPerSecondSquared(4.0), RadianPerSecondSquared(3.0)];
        Ramp::between([0.2, -1.0], [0.9, -1.3], speed, acceleration, RATE_HZ).expect("limits are positive")
    }

    #[test]
    fn a_ramp_rests_at_both_ends() {
        let ramp = ramp();
        assert_eq!(ramp.state_at(0), MotionState::at_rest([0.2, -1.0]));
        assert_eq!(ramp.state_at(ramp.duration_ticks()), MotionState::at_rest([0.9, -1.3]));
        assert_eq!(ramp.state_at(u32::MAX), MotionState::at_rest([0.9, -1.3]));
        let last = ramp.state_at(ramp.duration_ticks() - 1);
        // One tick before the end: distance (1-x)^3, 30 (1-x)^2, 60 (1-x), with 1-x = 1/5250.
        for joint in 0..2 {
            assert!((last.position_rad[joint] - ramp.to_rad[joint]).abs() < 3e-7);
            assert!(last.velocity_rad_per_s[joint].abs() < 1e-5);
            assert!(last.acceleration_rad_per_s2[joint].abs() < 0.01);
        }
    }

    #[test]
    fn a_ramp_is_as_quick_as_its_limits_allow_and_no_quicker() {
        let ramp = ramp();
        // Joint 1 dominates with 1.875 * 0.7 / 1 s, above sqrt(5.77 * 0.7 / 4) = 1.005 s
        // and joint 2 with 0.76 s.
        let expected = 1.312_5 * RATE_HZ as f32;
        assert!((ramp.duration_ticks() as f32 - expected).abs() <= 1.0);
        let envelope = ramp.envelope();
        let (mut speed, mut acceleration) = ([0.0_f32; 2], [0.0_f32; 2]);
        for tick in 0..=ramp.duration_ticks() {
            let state = ramp.state_at(tick);
            for joint in 0..2 {
                let position = state.position_rad[joint];
                assert!(position >= envelope[joint].low.0 && position <= envelope[joint].high.0);
                speed[joint] = speed[joint].max(state.velocity_rad_per_s[joint].abs());
                acceleration[joint] = acceleration[joint].max(state.acceleration_rad_per_s2[joint].abs());
            }
        }
        for joint in 0..2 {
            // Sampled every tick of some 5,000: the peaks are met within 1e-6.
            let bound = envelope[joint].speed.0;
            assert!(speed[joint] <= bound && speed[joint] > 0.999 * bound);
            let bound = envelope[joint].acceleration.0;
            assert!(acceleration[joint] <= bound && acceleration[joint] > 0.999 * bound);
        }
        assert!(envelope[0].speed.0 <= 1.0);
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_position() {
        let ramp = ramp();
        let duration = f64::from(ramp.duration_ticks()) / f64::from(RATE_HZ);
        let position = |joint: usize, x: f64| {
            let span = f64::from(ramp.to_rad[joint]) - f64::from(ramp.from_rad[joint]);
            span * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        };
        for tick in (1..ramp.duration_ticks()).step_by(37) {
            let state = ramp.state_at(tick);
            let x = f64::from(tick) / f64::from(ramp.duration_ticks());
            let h = 1e-4;
            for joint in 0..2 {
                let (before, here, after) =
                    (position(joint, x - h), position(joint, x), position(joint, x + h));
                let velocity = (after - before) / (2.0 * h * duration);
                let acceleration = (after - 2.0 * here + before) / (h * h * duration * duration);
                // Differences err by h^2/6 of the third derivative (60) and h^2/12 of the fifth's neighbour.
                assert!((f64::from(state.velocity_rad_per_s[joint]) - velocity).abs() < 1e-6);
                assert!((f64::from(state.acceleration_rad_per_s2[joint]) - acceleration).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn a_ramp_to_where_it_stands_ends_at_the_next_tick() {
        let limits = ([RadianPerSecond(1.0)], [RadianPerSecondSquared(1.0)]);
        let ramp = Ramp::between([0.5], [0.5], limits.0, limits.1, RATE_HZ).expect("limits are positive");
        assert_eq!(ramp.duration_ticks(), 1);
    }

    #[test]
    fn absurd_ramps_are_refused_and_the_joint_is_named() {
        let (one, fast) = (RadianPerSecond(1.0), RadianPerSecondSquared(1.0));
        let ramp = |to, speed, acceleration, rate| Ramp::between([0.0; 2], to, speed, acceleration, rate);
        let nowhere = ramp([0.0, f32::NAN], [one; 2], [fast; 2], RATE_HZ);
        assert_eq!(nowhere, Err(MotionError::NotFinite { joint: 1 }));
        let stopped = [one, RadianPerSecond(0.0)];
        assert_eq!(ramp([1.0; 2], stopped, [fast; 2], RATE_HZ), Err(MotionError::Rate { joint: 1 }));
        let crawling = [RadianPerSecond(1e-9); 2];
        assert_eq!(ramp([1.0; 2], crawling, [fast; 2], RATE_HZ), Err(MotionError::Period));
        assert_eq!(ramp([1.0; 2], [one; 2], [fast; 2], 0), Err(MotionError::Period));
    }
}
