//! Motion of a scan's field: constant speed, with gradual run-in and run-out.
//!
//! Field and rotor form a spring and a mass with hardly any damping, at sqrt(pole pairs * holding torque /
//! inertia), some 20 Hz. A field that jumps to its speed leaves the rotor swinging by a tenth of an
//! electrical turn or more during the whole scan. So the speed rises and falls linearly within a run-in at
//! either end, in which nothing is measured.
//!
//! ```text
//! t_a = 2 run-in / v;     field = v t^2 / (2 t_a),  v (t - t_a / 2),  way - v (t_end - t)^2 / (2 t_a)
//! ```

use crate::real::{clamp, min};

/// One pass of the field in one direction; electrical turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FieldWay {
    length: f32,
    run_in: f32,
    turns_per_s: f32,
}

impl FieldWay {
    /// A pass of so many turns, of which run-in and run-out take `run_in` each.
    pub(super) fn over(length: f32, run_in: f32, turns_per_s: f32) -> Self {
        Self { length, run_in, turns_per_s }
    }

    /// Travel of the field after a time in seconds.
    pub(super) fn travelled(&self, seconds: f32) -> f32 {
        let half_rise_s = self.run_in / self.turns_per_s;
        let end_s = self.length / self.turns_per_s + 2.0 * half_rise_s;
        let curved = |seconds: f32| 0.25 * self.turns_per_s / half_rise_s * seconds * seconds;
        if seconds < 2.0 * half_rise_s {
            curved(seconds)
        } else if seconds < end_s - 2.0 * half_rise_s {
            self.turns_per_s * (seconds - half_rise_s)
        } else if seconds < end_s {
            self.length - curved(end_s - seconds)
        } else {
            self.length
        }
    }

    /// Travel at constant speed so far; `None` during run-in and run-out.
    pub(super) fn steady(&self, travelled: f32) -> Option<f32> {
        let steadily = travelled > self.run_in && travelled <= self.length - self.run_in;
        steadily.then_some(travelled - self.run_in)
    }

    /// Speed after a time in seconds, turns per second.
    pub(super) fn speed(&self, seconds: f32) -> f32 {
        let half_rise_s = self.run_in / self.turns_per_s;
        let left_s = self.length / self.turns_per_s + 2.0 * half_rise_s - seconds;
        self.turns_per_s * clamp(0.5 * min(seconds, left_s) / half_rise_s, 0.0, 1.0)
    }

    /// Whether the pass is complete.
    pub(super) fn ended(&self, travelled: f32) -> bool {
        travelled >= self.length
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hal::CURRENT_RATE_HZ;

    #[test]
    fn the_field_begins_and_ends_at_rest_and_never_jumps() {
        let way = FieldWay::over(9.0, 1.0, 8.0);
        let (mut position, mut speed) = (0.0, 0.0);
        for tick in 1..=36_000 {
            let travelled = way.travelled(tick as f32 / CURRENT_RATE_HZ as f32);
            let step = travelled - position;
            // 8 turns per second are 3.3e-4 of a turn per tick, reached in a quarter of a second: 5.6e-8 more
            // in each. Nine turns are rounded to half a millionth.
            assert!((0.0..3.4e-4).contains(&step), "{tick}: {step}");
            assert!((step - speed).abs() < 2e-6, "{tick}: {step} after {speed}");
            assert_eq!(way.steady(travelled).is_some(), travelled > 1.0 && travelled <= 8.0);
            (position, speed) = (travelled, step);
        }
        assert!(way.ended(position) && position == 9.0);
    }
}
