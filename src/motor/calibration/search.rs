//! Index search by hand: follows counter and index pulses while the bridge is off.
//!
//! Why: a stored offset counts from the index, and after a power-up the counter does not know where that is.
//! The operator turns the joint by hand until the index has passed twice, a motor turn or several apart:
//!
//! ```text
//! certain    |distance of the last two pulses - n turns| <= 4 counts,  n not zero,
//!            no step beyond the axis' greatest plausible one since the first of them
//! ```
//!
//! Any other distance means a glitch or lost counts, and the search goes on from the newest pulse. A
//! repeated pulse at the same position is ignored.
//!
//! The state needs no configuration: the order to calibrate brings it ([`IndexSearch::position`]).
//! Known limit: two glitches a turn apart, within 4 counts, look like an index. With 8,192 counts that is one
//! pair of glitches in 910.

use super::INDEX_WIDTH;
use crate::hal::AxisSample;
use crate::motor::{AxisConfiguration, CountScale};

/// Counter and index pulses of an axis whose bridge is off; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexSearch {
    counter: Option<u16>,
    /// A pulse has come.
    has_pulse: bool,
    /// Counts since the newest pulse, in the counter's direction.
    since: i32,
    /// Counts from the pulse before to the newest one.
    distance: Option<i32>,
    /// Greatest step between both pulses, and since the newest one.
    greatest_steps: [u16; 2],
}

impl IndexSearch {
    /// State before the first sample.
    pub(crate) const EMPTY: Self =
        Self { counter: None, has_pulse: false, since: 0, distance: None, greatest_steps: [0; 2] };

    /// Follows one PWM period. Returns whether an index pulse came.
    #[inline(never)]
    pub(crate) fn follow(&mut self, sample: &AxisSample) -> bool {
        let now = sample.encoder_count;
        let step = now.wrapping_sub(self.counter.unwrap_or(now)).cast_signed();
        self.counter = Some(now);
        self.since = self.since.wrapping_add(i32::from(step));
        let [_, greatest] = &mut self.greatest_steps;
        *greatest = (*greatest).max(step.unsigned_abs());
        if let Some(at) = sample.index_count {
            let late = i32::from(now.wrapping_sub(at).cast_signed());
            self.on_pulse(self.since.wrapping_sub(late));
        }
        sample.index_count.is_some()
    }

    /// Whether the index of this axis is certain.
    pub(crate) fn is_certain(&self, axis: &AxisConfiguration) -> bool {
        let (Ok(scale), Ok(greatest_step)) = (axis.scale(), axis.greatest_step()) else { return false };
        self.position(&scale, greatest_step).is_some()
    }

    /// Takes a pulse that came so many counts after the newest one.
    #[cold]
    #[inline(never)]
    fn on_pulse(&mut self, distance: i32) {
        if self.has_pulse && distance.unsigned_abs() <= INDEX_WIDTH.unsigned_abs() {
            return;
        }
        let [_, greatest] = self.greatest_steps;
        self.greatest_steps = [greatest, 0];
        self.distance = self.has_pulse.then_some(distance);
        self.since = self.since.wrapping_sub(distance);
        self.has_pulse = true;
    }

    /// Counter of the last sample and its distance from the index in the counter's direction, where the index
    /// is certain.
    pub(super) fn position(&self, scale: &CountScale, greatest_step: i32) -> Option<(u16, i32)> {
        let beyond = scale.within_turn(self.distance?);
        let is_whole = beyond.min(scale.counts_per_turn() - beyond) <= INDEX_WIDTH;
        let is_plausible = self.greatest_steps.iter().all(|step| i32::from(*step) <= greatest_step);
        let counter = self.counter.filter(|_| is_whole && is_plausible)?;
        Some((counter, self.since))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN: i32 = 8192;
    const GREATEST_STEP: i32 = 26;

    /// A search and the true travel of its rotor, in the counter's direction.
    struct Hand {
        search: IndexSearch,
        travel: i32,
    }

    impl Hand {
        fn new() -> Self {
            Self { search: IndexSearch::EMPTY, travel: 65_000 }
        }

        fn sample(&mut self, index: Option<i32>) {
            let sample = AxisSample {
                encoder_count: self.travel as u16,
                index_count: index.map(|at| at as u16),
                ..AxisSample::default()
            };
            self.search.follow(&sample);
        }

        /// Turns to a travel in steps of up to 20 counts, with pulses at these travels.
        fn turn(mut self, to: i32, pulses: &[i32]) -> Self {
            while self.travel != to {
                let before = self.travel;
                self.travel += (to - before).clamp(-20, 20);
                let passed = |pulse: &i32| (before < *pulse) != (self.travel < *pulse);
                let pulse = pulses.iter().copied().find(passed);
                self.sample(pulse);
            }
            self
        }

        fn position(&self) -> Option<(u16, i32)> {
            let scale = CountScale::new(TURN.unsigned_abs(), 7).expect("usual");
            self.search.position(&scale, GREATEST_STEP)
        }
    }

    #[test]
    fn two_pulses_whole_turns_apart_are_certain_in_both_directions() {
        for begin in [0, 40_000, -30_000] {
            for turns in [1, -1, 2, -3] {
                for error in [-5, -4, 0, 4, 5] {
                    let second = begin + turns * TURN + error;
                    let start = begin - 100 * turns.signum();
                    let mut hand = Hand { travel: start, ..Hand::new() };
                    hand.sample(None);
                    let hand = hand.turn(begin + 10 * turns.signum(), &[begin]);
                    assert_eq!(hand.position(), None);
                    let end = second + 300 * turns.signum();
                    let hand = hand.turn(end, &[begin, second]);
                    let expected = (error.abs() <= 4).then_some((end as u16, end - second));
                    assert_eq!(hand.position(), expected, "{begin} {turns} {error}");
                }
            }
        }
    }

    #[test]
    fn the_same_pulse_again_proves_and_contradicts_nothing() {
        let mut hand = Hand { travel: -100, ..Hand::new() };
        for _ in 0..3 {
            // The other edge of the pulse is two counts away.
            hand = hand.turn(100, &[0]).turn(-100, &[2]);
            assert_eq!(hand.position(), None);
        }
        hand = hand.turn(TURN + 50, &[0, TURN]);
        assert_eq!(hand.position().map(|(_, since)| since), Some(50));
        hand = hand.turn(TURN - 70, &[TURN + 3]).turn(TURN + 60, &[TURN]);
        assert_eq!(hand.position().map(|(_, since)| since), Some(60));
    }

    #[test]
    fn a_glitch_or_lost_counts_begin_anew_with_the_newest_pulse() {
        // Before, between and after both pulses.
        let pulses = [0, TURN, 2 * TURN, 3 * TURN, 4 * TURN];
        for glitch in [-3000, 3000, TURN + 900, TURN + 3000] {
            let with: Vec<i32> = pulses.iter().copied().chain([glitch]).collect();
            let turned = |to| Hand { travel: -4000, ..Hand::new() }.turn(to, &with).position();
            let certain: Vec<bool> = (0..4).map(|turn| turned(turn * TURN + 2000).is_some()).collect();
            let expected = match glitch {
                -3000 => [false, true, true, true],
                3000 => [false, false, true, true],
                // The pulse after both was certain comes before or after the end at 2,000 counts.
                _ if glitch < TURN + 2000 => [false, false, false, true],
                _ => [false, true, false, true],
            };
            assert_eq!(certain, expected, "{glitch}");
        }
        // Ten counts lost between the first two pulses, each within a plausible step.
        let hand = Hand { travel: -100, ..Hand::new() }.turn(2 * TURN + 50, &[0, TURN - 10, 2 * TURN - 10]);
        assert_eq!(hand.position().map(|(_, since)| since), Some(60));
        let hand = Hand { travel: -100, ..Hand::new() }.turn(TURN + 50, &[0, TURN - 10]);
        assert_eq!(hand.position(), None);
    }

    #[test]
    fn an_implausible_step_invalidates_the_pulses_around_it() {
        for (step, invalid) in
            [(GREATEST_STEP, false), (GREATEST_STEP + 1, true), (-8192, true), (-32_768, true)]
        {
            let pulses = [0, TURN, 2 * TURN, 3 * TURN];
            // The count returns, so that the pulses still fit.
            let jump = |mut hand: Hand| {
                hand.travel += step;
                hand.sample(None);
                hand.travel -= step;
                hand.sample(None);
                hand
            };
            let between =
                jump(Hand { travel: -100, ..Hand::new() }.turn(3000, &pulses)).turn(TURN + 50, &pulses);
            assert_eq!(between.position().is_none(), invalid, "{step}");
            assert!(between.turn(2 * TURN + 50, &pulses).position().is_some(), "{step}");
            let after = jump(Hand { travel: -100, ..Hand::new() }.turn(TURN + 50, &pulses));
            assert_eq!(after.position().is_none(), invalid, "{step}");
            let after = after.turn(2 * TURN + 50, &pulses);
            assert_eq!(after.position().is_none(), invalid, "{step}");
            assert!(after.turn(3 * TURN + 50, &pulses).position().is_some(), "{step}");
        }
    }
}
