//! The joint's zero, found at an end stop or from a pose that the operator states.
//!
//! The encoder at the motor measures the position within a turn of the motor, but not the number of turns
//! behind the gear. So the joint's zero must be referenced once after every power-up. Both state machines run
//! at the servo's rate on the joint's samples and return a current. Both end with the count at the pose, from
//! which [`super::Axis::set_counts`] follows.
//!
//! **End stop.** A target runs ahead of the joint at constant speed, never further than `lead`, and pulls it
//! like a spring:
//!
//! ```text
//! i = limit * clamp((target - count) / lead, -1, 1) - damping * d count / dt
//! ```
//!
//! A joint that has not moved for 0.25 s at full spring deflection has met an obstacle. The search backs off
//! by `back_off` and approaches again. Both positions must agree to `tolerance`; otherwise it was friction, a
//! knee in the way, or a cable. Current, travel and time are limited.
//!
//! **Stated pose.** The pose is accepted where the joint stood still for half a second without current.

use crate::hal::JointSample;
use crate::real::clamp;
use crate::units::{Ampere, Hertz};

/// Limits of an end-stop search, in the joint's sense; with positive speed it searches the stop in flexion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndStopSettings {
    /// Call rate of the state machine.
    pub rate: Hertz,
    /// Speed of the approach, counts per second, signed.
    pub counts_per_s: f32,
    /// Greatest current.
    pub current: Ampere,
    /// Lag of the joint at which the current is greatest, counts.
    pub lead: f32,
    /// Damping: current per speed, A s per count.
    pub damping: f32,
    /// Longest travel to the stop, counts, up to 2^24.
    pub way: i32,
    /// Counts by which the search backs off.
    pub back_off: i32,
    /// Greatest difference of the two positions, counts.
    pub tolerance: i32,
}

/// Reason for which there is no reference; no current flows any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceRefusal {
    /// A setting is invalid.
    Settings,
    /// No stop within the allowed travel.
    NoStop,
    /// The joint does not come away from its stop.
    Stuck,
    /// Two approaches stopped at different positions.
    Unrepeatable,
    /// The search took too long.
    TimeOut,
    /// The joint moved although it should stand still.
    Moved,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReferenceStep {
    /// Still running, with this current.
    Running(Ampere),
    /// Found: the count at the stop or pose.
    Found(i32),
    /// Refused: no reference.
    Refused(ReferenceRefusal),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Approach {
    First,
    Away { stop: i32 },
    Second { stop: i32 },
    Ended(Result<i32, ReferenceRefusal>),
}

/// Search for an end stop; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndStopSearch {
    settings: EndStopSettings,
    approach: Approach,
    begin: Option<i32>,
    target: f32,
    ticks: u32,
    count: i32,
    /// Counts per tick, smoothed.
    speed: f32,
    /// Count where the joint last moved, and ticks since then.
    resting_at: i32,
    resting: u32,
}

/// Greatest travel and tolerance, counts: exact in single precision, and no sum of them overflows.
const GREATEST_WAY: i32 = 1 << 24;
/// Counts within which a joint counts as resting.
const REST_COUNTS: i32 = 4;

impl EndStopSearch {
    /// Starts a search.
    ///
    /// # Errors [`ReferenceRefusal::Settings`] for invalid settings.
    pub fn new(settings: EndStopSettings) -> Result<Self, ReferenceRefusal> {
        let sensible = (100.0..=100_000.0).contains(&settings.rate.0)
            && (1.0..=1e6).contains(&settings.counts_per_s.abs())
            && settings.current.0 > 0.0
            && settings.current.is_finite()
            && (1.0..=1e6).contains(&settings.lead)
            && (0.0..=1e3).contains(&settings.damping)
            && (1..=GREATEST_WAY).contains(&settings.tolerance)
            && settings.way <= GREATEST_WAY
            && settings.back_off < settings.way
            && settings.back_off > settings.tolerance + 4 * REST_COUNTS;
        if !sensible {
            return Err(ReferenceRefusal::Settings);
        }
        Ok(Self {
            settings,
            approach: Approach::First,
            begin: None,
            target: 0.0,
            ticks: 0,
            count: 0,
            speed: 0.0,
            resting_at: 0,
            resting: 0,
        })
    }

    /// Runs one servo tick.
    pub fn tick(&mut self, sample: &JointSample) -> ReferenceStep {
        let begin = *self.begin.get_or_insert(sample.encoder_counts);
        // Relative to the start, so that single precision is enough.
        let count = sample.encoder_counts.wrapping_sub(begin);
        self.observe(count);
        if let Approach::Ended(end) = self.approach {
            return end.map_or_else(ReferenceStep::Refused, ReferenceStep::Found);
        }
        if let Some(end) = self.decide(count) {
            let end = end.map(|stop| stop.wrapping_add(begin));
            self.approach = Approach::Ended(end);
            return end.map_or_else(ReferenceStep::Refused, ReferenceStep::Found);
        }
        let away = matches!(self.approach, Approach::Away { .. });
        let step = self.settings.counts_per_s / self.settings.rate.0;
        let lead = self.settings.lead;
        self.target += if away { -step } else { step };
        self.target = clamp(self.target, count as f32 - lead, count as f32 + lead);
        let limit = self.settings.current.0;
        let pull = limit * (self.target - count as f32) / lead;
        let current = pull - self.settings.damping * self.speed * self.settings.rate.0;
        ReferenceStep::Running(Ampere(clamp(current, -limit, limit)))
    }

    fn observe(&mut self, count: i32) {
        // First order is enough: this speed only damps. Time constant of 32 ticks.
        self.speed += (count.wrapping_sub(self.count) as f32 - self.speed) * (1.0 / 32.0);
        self.count = count;
        self.ticks = self.ticks.saturating_add(1);
        self.resting = self.resting.saturating_add(1);
        if count.wrapping_sub(self.resting_at).wrapping_abs() > REST_COUNTS {
            (self.resting_at, self.resting) = (count, 0);
        }
    }

    fn decide(&mut self, count: i32) -> Option<Result<i32, ReferenceRefusal>> {
        let EndStopSettings { rate, counts_per_s, lead, way, back_off, tolerance, .. } = self.settings;
        // Twice the time of the travel, and five seconds to rest.
        if self.ticks as f32 > rate.0 * (2.0 * way as f32 / counts_per_s.abs() + 5.0) {
            return Some(Err(ReferenceRefusal::TimeOut));
        }
        let pulling = (self.target - count as f32).abs() >= 0.99 * lead;
        let stopped = pulling && self.resting as f32 > 0.25 * rate.0;
        match self.approach {
            Approach::First if stopped => self.go(Approach::Away { stop: count }),
            Approach::First if count.wrapping_abs() > way => return Some(Err(ReferenceRefusal::NoStop)),
            Approach::Away { stop } if count.wrapping_sub(stop).wrapping_abs() >= back_off => {
                self.go(Approach::Second { stop });
            }
            Approach::Away { .. } if stopped => return Some(Err(ReferenceRefusal::Stuck)),
            Approach::Second { stop } if stopped => {
                let apart = count.wrapping_sub(stop).wrapping_abs();
                return Some(if apart <= tolerance {
                    Ok(count)
                } else {
                    Err(ReferenceRefusal::Unrepeatable)
                });
            }
            Approach::Second { stop } if count.wrapping_sub(stop).wrapping_abs() > back_off + way => {
                return Some(Err(ReferenceRefusal::Unrepeatable));
            }
            _ => {}
        }
        None
    }

    fn go(&mut self, approach: Approach) {
        self.approach = approach;
        self.ticks = 0;
        self.resting = 0;
    }
}

/// Reference by a pose that the operator states; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedPose {
    stand_ticks: u32,
    first: Option<i32>,
    ticks: u32,
}

impl StatedPose {
    /// Creates a reference called `rate` times per second; `None` for a rate outside 100 Hz..100 kHz.
    #[must_use]
    pub fn new(rate: Hertz) -> Option<Self> {
        let stand_ticks = (0.5 * rate.0) as u32;
        (100.0..=100_000.0).contains(&rate.0).then_some(Self { stand_ticks, first: None, ticks: 0 })
    }

    /// Runs one servo tick, without current.
    pub fn tick(&mut self, sample: &JointSample) -> ReferenceStep {
        let first = *self.first.get_or_insert(sample.encoder_counts);
        if sample.encoder_counts.wrapping_sub(first).wrapping_abs() > REST_COUNTS {
            return ReferenceStep::Refused(ReferenceRefusal::Moved);
        }
        self.ticks = self.ticks.saturating_add(1);
        if self.ticks < self.stand_ticks {
            return ReferenceStep::Running(Ampere::ZERO);
        }
        ReferenceStep::Found(sample.encoder_counts)
    }
}

#[cfg(test)]
mod tests;
