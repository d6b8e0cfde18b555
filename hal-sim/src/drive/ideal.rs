//! Ideal drive: a motor current that follows its target with a first-order lag.
//!
//! ```text
//! current(t + h) = target + (current(t) - target) exp(-h / lag)       exact for a target held over h
//! torque at the joint = torque per ampere * current
//! ```
//!
//! This drive tests servo and identification apart from a current loop. Between servo ticks the current is
//! the straight line between its exact values at the ticks. So the current read at the ticks and the torque
//! on the leg match without a time shift. (The exponential would shift the torque by 4 % of a tick at the
//! default lag.)
//! Known limits: no bus voltage, no back-EMF limit, no saturation.
//! Cost: 4 operations per tick.

use crate::description::DriveDescription;
use crate::maths::exp;

/// One joint's motor and current loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drive {
    torque_per_ampere: f64,
    current_limit: f64,
    /// Share of a deviation that remains after one tick, 0..=1.
    remainder: f64,
    current: f64,
    target: f64,
}

impl Drive {
    /// A drive without current, outputs off, for ticks of `tick` s.
    pub fn new(description: &DriveDescription, tick: f64) -> Self {
        let remainder = if description.lag > 0.0 { exp(-tick / description.lag) } else { 0.0 };
        Self {
            torque_per_ampere: description.torque_per_ampere,
            current_limit: description.current_limit,
            remainder,
            current: 0.0,
            target: 0.0,
        }
    }

    /// Sets the target, A, clamped; NaN counts as 0. With outputs off no current flows, so switching off acts
    /// at once.
    pub fn command(&mut self, enabled: bool, target: f64) {
        let target = if enabled && !target.is_nan() { target } else { 0.0 };
        self.target = target.clamp(-self.current_limit, self.current_limit);
        if !enabled {
            self.current = 0.0;
        }
    }

    /// Advances by one tick.
    pub fn advance(&mut self) {
        self.current = self.target + (self.current - self.target) * self.remainder;
    }

    /// Present motor current, A.
    pub(crate) fn current(&self) -> f64 {
        self.current
    }

    /// Present torque at the joint, N m, anatomical sign.
    pub fn torque(&self) -> f64 {
        self.torque_per_ampere * self.current
    }
}
