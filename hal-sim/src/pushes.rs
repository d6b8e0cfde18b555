//! The wearer's pushes: torque pulses that no sensor measures.
//!
//! ```text
//! torque(t) = peak sin(pi (t - start) / duration)    while start <= t <= start + duration, on one joint
//! ```
//!
//! Pauses between pushes are exponential with the mean 1 / rate, and peaks uniform in -torque..=torque.
//! Durations are uniform in half to one and a half of the mean, joints equally likely. The generator is their
//! own, so sensor noise does not change with the pushes.
//! Known limits: no body, no stiffness, one joint at a time.

use crate::description::PushDescription;
use crate::maths::{ln, sin_cos};
use core::f64::consts::PI;
use rand_distr::{Distribution, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;

#[derive(Clone, Debug, PartialEq)]
struct Push {
    start: f64,
    duration: f64,
    peak: f64,
    joint: usize,
}

/// Pushes of a wearer, past and planned.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pushes {
    habits: Option<PushDescription>,
    next: Option<Push>,
    generator: Xoshiro256PlusPlus,
}

impl Pushes {
    /// Pushes from time 0 on, with a random generator of their own; none without habits.
    pub fn new(habits: Option<PushDescription>, joints: usize, generator: Xoshiro256PlusPlus) -> Self {
        let mut pushes = Self { habits, next: None, generator };
        pushes.plan(0.0, joints);
        pushes
    }

    /// Changes rate and strength of the pushes from this time (s) on; a push in progress ends.
    pub(crate) fn change_habits(&mut self, habits: Option<PushDescription>, now: f64, joints: usize) {
        (self.habits, self.next) = (habits, None);
        self.plan(now, joints);
    }

    /// Pushes once from `now` (s) on, replacing the next planned push.
    pub fn push(&mut self, joint: usize, peak: f64, now: f64, duration: f64) {
        self.next = Some(Push { start: now, duration, peak, joint });
    }

    /// Torque on each joint, N m, at a time in s that never decreases from call to call.
    pub fn torque<const N: usize>(&mut self, time: f64) -> [f64; N] {
        let mut torque = [0.0; N];
        if self.next.as_ref().is_some_and(|push| time > push.start + push.duration) {
            self.plan(time, N);
        }
        if let Some(push) = &self.next
            && time >= push.start
            && let Some(joint) = torque.get_mut(push.joint)
        {
            *joint = push.peak * sin_cos(PI * (time - push.start) / push.duration).0;
        }
        torque
    }

    fn plan(&mut self, now: f64, joints: usize) {
        let Some(habits) = self.habits else {
            self.next = None;
            return;
        };
        let [pause, duration, peak, joint]: [f64; 4] =
            core::array::from_fn(|_| StandardUniform.sample(&mut self.generator));
        let pause = -ln(1.0 - pause) / habits.rate;
        let duration = habits.duration * (0.5 + duration);
        let peak = habits.torque * (2.0 * peak - 1.0);
        let joint = (joint * joints as f64) as usize;
        self.next = Some(Push { start: now + pause, duration, peak, joint });
    }
}
