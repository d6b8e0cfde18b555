//! What an axis tells of itself, and forgets when it is told to.

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

    /// After a time without ticks, in which the bridge was released and the counter went on by itself: it is followed from here, and no step
    /// is held against it. `long` where it may have gone round: the place within a turn is then known only of an encoder whose turns
    /// its range is a multiple of, as 65,536 of 8,192; of any other it is lost. Counts are off by multiples of the range, and for
    /// whoever knows better.
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
