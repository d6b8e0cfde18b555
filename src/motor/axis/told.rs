//! What an axis tells of itself, and forgets when it is told to.

use super::{Axis, AxisFault, Rotating};
use crate::units::{Ampere, RadianPerSecond};

impl Axis {
    /// Currents of the last tick, in the electrical sense.
    #[must_use]
    pub fn measured(&self) -> Rotating<Ampere> {
        self.measured
    }

    /// Electrical speed, rad/s.
    #[must_use]
    pub fn electrical_speed(&self) -> RadianPerSecond {
        RadianPerSecond(self.speed.rad_per_s())
    }

    /// Why the bridge is released, if the axis did it.
    #[must_use]
    pub fn fault(&self) -> Option<AxisFault> {
        self.fault
    }

    /// Place or parameters are lost: only a new calibration helps.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.lost
    }

    /// Forgets a fault, so that a request may enable again; `false` where the place was lost.
    pub fn clear_fault(&mut self) -> bool {
        if !self.lost {
            self.fault = None;
        }
        !self.lost
    }
}
