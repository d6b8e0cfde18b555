//! The joint's zero: by running gently against an end stop, or by a pose that somebody states.
//!
//! The encoder at the motor knows its place within a turn of the motor, not which of the gear's turns it is: the joint's zero
//! has to be shown once after every power-up. Both machines are ticked at the servo's rate with the joint's samples and
//! answer with a current; both end with the count at the pose, from which [`super::Axis::set_counts`] follows.
//!
//! **End stop.** A target runs ahead of the joint at constant speed, never further than `lead`, and pulls it like a spring:
//!
//! ```text
//! i = limit * clamp((target - count) / lead, -1, 1) - damping * d count / dt
//! ```
//!
//! Where the joint has not moved for 0.25 s although the spring is at its end, there is something. It backs off by `back_off`
//! and comes again; both places must agree to `tolerance`, or it was friction, a knee in the way, a cable. Limits: current,
//! way, time.
//!
//! **Stated pose.** The joint has stood still for half a second without current: where it stands is what was stated.

use crate::hal::JointSample;
use crate::real::clamp;
use crate::units::{Ampere, Hertz};

/// What an end-stop search may do, in the joint's sense; positive speed searches the stop in flexion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndStopSettings {
    /// Ticks per second with which the machine is called.
    pub rate: Hertz,
    /// Speed of the approach, counts per second, of either sign.
    pub counts_per_s: f32,
    /// Largest current.
    pub current: Ampere,
    /// Counts of lag at which the current is largest.
    pub lead: f32,
    /// Current per speed, A s per count.
    pub damping: f32,
    /// Furthest way to the stop, counts, up to 2^24.
    pub way: i32,
    /// Counts by which it backs off.
    pub back_off: i32,
    /// Counts by which the two places may differ.
    pub tolerance: i32,
}

/// Why there is no reference; no current flows any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceRefusal {
    /// A setting makes no sense.
    Settings,
    /// No stop on the way allowed.
    NoStop,
    /// The joint does not come away from where it stopped.
    Stuck,
    /// Two approaches stopped at different places.
    Unrepeatable,
    /// It took too long.
    TimeOut,
    /// The joint moved although it was said to stand.
    Moved,
}

/// What a tick answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReferenceStep {
    /// Goes on with this current.
    Running(Ampere),
    /// The count at the stop or pose.
    Found(i32),
    /// No reference.
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
    /// Where the joint was when it last moved, and for how many ticks it has not.
    resting_at: i32,
    resting: u32,
}

/// Counts of way and tolerance: exact in single precision, and no sum of them overflows.
const GREATEST_WAY: i32 = 1 << 24;
/// Counts within which a joint rests.
const REST_COUNTS: i32 = 4;

impl EndStopSearch {
    /// # Errors
    /// [`ReferenceRefusal::Settings`].
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

    /// One servo tick.
    pub fn tick(&mut self, sample: &JointSample) -> ReferenceStep {
        let begin = *self.begin.get_or_insert(sample.encoder_counts);
        // Relative to the beginning, so that single precision is enough.
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
        // Double pole is not needed: this damps, it does not measure. Time constant of 32 ticks.
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
        // Twice what the way takes, and five seconds to stand.
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

/// A pose that somebody states; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedPose {
    stand_ticks: u32,
    first: Option<i32>,
    ticks: u32,
}

impl StatedPose {
    /// To be called `rate` times per second; `None` for a rate outside 100 Hz..100 kHz.
    #[must_use]
    pub fn new(rate: Hertz) -> Option<Self> {
        let stand_ticks = (0.5 * rate.0) as u32;
        (100.0..=100_000.0).contains(&rate.0).then_some(Self { stand_ticks, first: None, ticks: 0 })
    }

    /// One servo tick, without current.
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
