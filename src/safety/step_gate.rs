//! Rejection of encoder readings that no joint can have made.
//!
//! A joint below its speed limit moves a known number of counts per tick. A reading farther from the last
//! good one is rejected, and the observer runs on without it. The third in a row is accepted as the new
//! reference, because a permanent jump must not disable the damping that follows. Three rejected readings
//! within 10 ms are a fault ([`super::FaultCode::EncoderStep`]), so no motion continues on such a count
//! without a reset. Counts wrap; differences are taken modulo 2^32.

/// Verdict on a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reading {
    /// The joint can make this step.
    Good,
    /// Impossible step; ignore the reading.
    Rejected,
    /// Impossible, but the third in a row: the counter jumped, and counting continues from here.
    Jumped,
}

/// Judges the readings of one joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StepGate {
    largest_step: u32,
    last: Option<i32>,
    rejected: u32,
}

impl StepGate {
    /// A gate that accepts up to `largest_step` counts between two ticks.
    pub const fn new(largest_step: u32) -> Self {
        Self { largest_step, last: None, rejected: 0 }
    }

    /// Forgets all readings.
    pub(crate) const fn restart(&mut self) {
        (self.last, self.rejected) = (None, 0);
    }

    /// Checks one reading; the first is always good.
    #[must_use]
    pub(crate) fn judge(&mut self, counts: i32) -> Reading {
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
    fn a_single_glitch_of_any_size_is_rejected_and_motion_continues() {
        for glitch in [101, 5000, i32::MAX, -101, i32::MIN] {
            let mut gate = StepGate::new(100);
            assert_eq!(gate.judge(0), Reading::Good);
            assert_eq!(gate.judge(100), Reading::Good);
            assert_eq!(gate.judge(100_i32.wrapping_add(glitch)), Reading::Rejected, "{glitch}");
            assert_eq!(gate.judge(300), Reading::Good);
        }
    }

    #[test]
    fn wrapping_counts_are_not_rejected() {
        for offset in (i32::MAX - 500..=i32::MAX).step_by(7) {
            let mut gate = StepGate::new(100);
            for tick in 0..20 {
                assert_eq!(gate.judge(offset.wrapping_add(tick * 93)), Reading::Good);
            }
        }
    }

    #[test]
    fn a_lasting_jump_is_accepted_at_its_third_reading() {
        let mut gate = StepGate::new(100);
        let readings = [0, 9000, 9001, 9002, 9003].map(|counts| gate.judge(counts));
        use Reading::{Good, Jumped, Rejected};
        assert_eq!(readings, [Good, Rejected, Rejected, Jumped, Good]);
    }
}
