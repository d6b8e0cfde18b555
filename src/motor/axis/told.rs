//! Accessors of `Axis`, clearing a fault, and resuming after a pause.

use super::{Axis, AxisFault, IndexWatch, Rotating, SpeedTracker, Window};
use crate::hal::AxisSample;
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

    /// The fault that stopped the axis, if any.
    #[must_use]
    pub fn fault(&self) -> Option<AxisFault> {
        self.fault
    }

    /// Rotor position or parameters are lost and require a new calibration.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.lost
    }

    /// Clears a fault, so that a request may enable again. Returns `false` where the axis is lost.
    pub fn clear_fault(&mut self) -> bool {
        if !self.lost {
            self.fault = None;
        }
        !self.lost
    }

    /// Resumes after a time without ticks, in which the outputs were off while the counter ran on. The
    /// present count is accepted with any step.
    ///
    /// Set `long` where the counter may have wrapped. The position within a turn then stays valid only where
    /// the counter's range is a multiple of the turn, as 65,536 of 8,192; otherwise it is lost. Counts may be
    /// off by multiples of the range; the caller has to correct them.
    pub fn resume(&mut self, sample: &AxisSample, long: bool) {
        let constants = &self.constants;
        let step = i32::from(sample.encoder_count.wrapping_sub(self.counter).cast_signed());
        self.place = constants.scale.within_turn(self.place + constants.counter_sign * step);
        self.counts = self.counts.wrapping_add(constants.flexion_sign * step);
        (self.counter, self.step) = (sample.encoder_count, 0);
        self.index = IndexWatch::at(self.counts);
        self.speed = SpeedTracker::at(self.angle());
        self.window = Window::EMPTY;
        (self.doubtful, self.doubts, self.disbelieved) = (false, 0, false);
        if long && constants.scale.within_turn(1 << 16) != 0 {
            self.found(AxisFault::Encoder);
        }
    }
}
