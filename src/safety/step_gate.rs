//! Encoder readings that no joint can have made.
//!
//! A joint below its greatest speed moves a known number of counts per tick. A reading farther from the last good one
//! is rejected, and the observer runs on without it; the third in a row is believed after all, as the new place from
//! which to measure, because a counter that has jumped for good must not blind the damping that follows. Three
//! rejected readings within 10 ms are a fault ([`super::FaultCode::EncoderStep`]), so nobody moves on such a place
//! without a reset. Counts wrap; differences are taken modulo 2^32.

/// What to do with a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// A step the joint can make.
    Good,
    /// Not possible; to be ignored.
    Rejected,
    /// Not possible, but the third in a row: the count jumped, and is counted from here.
    Jumped,
}

/// Judges the readings of one joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepGate {
    largest_step: u32,
    last: Option<i32>,
    rejected: u32,
}

impl StepGate {
    /// The greatest step between two ticks is `largest_step` counts.
    #[must_use]
    pub const fn new(largest_step: u32) -> Self {
        Self { largest_step, last: None, rejected: 0 }
    }

    /// Nothing was read yet.
    pub const fn restart(&mut self) {
        (self.last, self.rejected) = (None, 0);
    }

    /// The same place has another count now.
    pub const fn shift(&mut self, counts: i32) {
        if let Some(last) = self.last {
            self.last = Some(last.wrapping_add(counts));
        }
    }

    /// Judges one reading; the first is good.
    #[must_use]
    pub fn judge(&mut self, counts: i32) -> Reading {
        let step = counts.wrapping_sub(self.last.unwrap_or(counts)).unsigned_abs();
        let reading = if step <= self.largest_step.saturating_mul(self.rejected + 1) {
            Reading::Good
        } else if self.rejected >= 2 {
            Reading::Jumped
        } else {
            Reading::Rejected
        };
        if reading == Reading::Rejected {
            self.rejected += 1;
        } else {
            (self.last, self.rejected) = (Some(counts), 0);
        }
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_glitch_of_any_size_is_rejected_and_the_motion_goes_on() {
        for glitch in [101, 5000, i32::MAX, -101, i32::MIN] {
            let mut gate = StepGate::new(100);
            assert_eq!(gate.judge(0), Reading::Good);
            assert_eq!(gate.judge(100), Reading::Good);
            assert_eq!(gate.judge(100_i32.wrapping_add(glitch)), Reading::Rejected, "{glitch}");
            assert_eq!(gate.judge(300), Reading::Good);
        }
    }

    #[test]
    fn wrapping_counts_are_no_glitch() {
        for offset in (i32::MAX - 500..=i32::MAX).step_by(7) {
            let mut gate = StepGate::new(100);
            for tick in 0..20 {
                assert_eq!(gate.judge(offset.wrapping_add(tick * 93)), Reading::Good);
            }
        }
    }

    #[test]
    fn a_jump_that_stays_is_taken_as_the_new_place_at_its_third_reading() {
        let mut gate = StepGate::new(100);
        let readings = [0, 9000, 9001, 9002, 9003].map(|counts| gate.judge(counts));
        use Reading::{Good, Jumped, Rejected};
        assert_eq!(readings, [Good, Rejected, Rejected, Jumped, Good]);
    }

    #[test]
    fn a_new_zero_of_the_counts_is_no_step() {
        for shift in [1_000_000, -1_000_000, i32::MIN] {
            let mut gate = StepGate::new(100);
            assert_eq!(gate.judge(50), Reading::Good);
            gate.shift(shift);
            assert_eq!(gate.judge(120_i32.wrapping_add(shift)), Reading::Good);
            assert_eq!(gate.judge(120), Reading::Rejected);
        }
    }
}
