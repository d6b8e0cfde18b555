//! Index pulses checked against the counts: distinguishes a glitch on the index line from lost counts.
//!
//! ```text
//! wrong    |position of the pulse| > 4 counts + travel in 10 us         the index is position 0
//! lost     a second wrong pulse at that position (the same bound), after a quarter of a turn away from it
//!          or no right pulse for 2 1/8 turns
//! ```
//!
//! Why two pulses: a lost position brakes both motors and invalidates calibration and reference, while one
//! glitch is noise. Lost counts move every later pulse to the same wrong position, so the second one comes
//! within two turns of the rotor. A right pulse ends the suspicion, and only a right pulse restarts the 2 1/8
//! turns. A wrong pulse at rest is ignored: no index passes a rotor at rest.
//!
//! Until the second pulse the angle is off by `e = counts lost * pole pairs / counts per turn` electrical
//! turns. For a target current `i` the torque falls to that of `i cos(2 pi e)`, and `i sin(2 pi e)` flows
//! along the flux. Figures: docs/motor.md.
//!
//! Known limits: a rotor slower than two counts in 4 ms counts as resting, so lost counts then show only by
//! the 2 1/8 turns. A frozen counter looks like rest; `ModelWatch` detects it.

use crate::motor::CountScale;
use crate::motor::calibration::INDEX_WIDTH;

/// The capturing interrupt may be late by a PWM period divided by this: 10 us.
const LATENCY: i32 = 4;
/// Checks within two counts after which the rotor counts as resting: 4 ms.
const REST_SAMPLES: u8 = 16;

/// An index pulse, or the position where wrong ones are expected.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pulse {
    /// Position within a turn, or less than a turn beyond it.
    position: i32,
    /// Counts by which the capture may be late.
    late: i32,
}

/// State of the index check; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct IndexWatch {
    /// Newest pulse since the last check.
    pulse: Option<Pulse>,
    /// Counts at the last right pulse, or at the start.
    right_at: i32,
    /// First wrong pulse, and the counts at which it came.
    suspect: Option<(Pulse, i32)>,
    /// The rotor was a quarter of a turn away from the suspect.
    left: bool,
    /// Counts at which the rotor rests, and the number of checks since.
    rests_at: i32,
    resting: u8,
}

impl IndexWatch {
    /// Starts without suspicion; the last right pulse came at `counts`.
    pub(super) const fn at(counts: i32) -> Self {
        Self { pulse: None, right_at: counts, suspect: None, left: false, rests_at: counts, resting: 0 }
    }

    /// Records a pulse at a rotor position, in a period in which the counter moved by `step`.
    #[inline(always)]
    pub(super) fn on_pulse(&mut self, position: i32, step: i32) {
        self.pulse = Some(Pulse { position, late: step.abs() / LATENCY });
    }

    /// Shifts the stored counts after the joint's zero was set.
    pub(super) fn shift(&mut self, counts: i32) {
        self.right_at = self.right_at.wrapping_add(counts);
        self.rests_at = self.rests_at.wrapping_add(counts);
        if let Some((_, at)) = &mut self.suspect {
            *at = at.wrapping_add(counts);
        }
    }

    /// Whether the rotor position is lost. Called once per servo period; `longest` counts may pass without a
    /// right pulse.
    pub(super) fn is_lost(&mut self, counts: i32, scale: &CountScale, longest: u32) -> bool {
        let since = |at: i32| counts.wrapping_sub(at).unsigned_abs();
        self.resting = if since(self.rests_at) < 2 { self.resting.saturating_add(1) } else { 0 };
        if self.resting == 0 {
            self.rests_at = counts;
        }
        if let Some((_, at)) = self.suspect {
            self.left |= since(at) >= scale.counts_per_turn().unsigned_abs() / 4;
        }
        let is_overdue = since(self.right_at) > longest;
        let Some(pulse) = self.pulse.take() else { return is_overdue };
        let lies_at = |position: i32, late: i32| {
            let distance = scale.within_turn(pulse.position - position);
            distance.min(scale.counts_per_turn() - distance) <= INDEX_WIDTH + late
        };
        if lies_at(0, pulse.late) {
            (self.right_at, self.suspect) = (counts, None);
            return false;
        }
        if self.resting >= REST_SAMPLES {
            return is_overdue;
        }
        match self.suspect {
            Some((first, _)) if lies_at(first.position, pulse.late + first.late) => self.left || is_overdue,
            _ => {
                (self.suspect, self.left) = (Some((pulse, counts)), false);
                is_overdue
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN: i32 = 8192;
    const LONGEST: u32 = 17_408;

    /// An index check and a rotor that has turned since it began.
    struct Turning {
        watch: IndexWatch,
        scale: CountScale,
        counts: i32,
    }

    impl Turning {
        fn new() -> Self {
            let scale = CountScale::new(TURN.unsigned_abs(), 7).expect("usual");
            Self { watch: IndexWatch::at(0), scale, counts: 0 }
        }

        /// Turns by so many counts, at most 50 between two checks, without a pulse.
        fn turn(&mut self, counts: i32) -> bool {
            let end = self.counts + counts;
            let mut lost = false;
            while self.counts != end {
                self.counts += (end - self.counts).clamp(-50, 50);
                lost |= self.check();
            }
            lost
        }

        /// One pulse at a position, in a period of so many counts.
        fn pulse(&mut self, position: i32, step: i32) -> bool {
            self.watch.on_pulse(position, step);
            self.check()
        }

        fn check(&mut self) -> bool {
            self.watch.is_lost(self.counts, &self.scale, LONGEST)
        }

        fn is_suspicious(&self) -> bool {
            self.watch.suspect.is_some()
        }
    }

    #[test]
    fn a_pulse_is_right_up_to_four_counts_and_the_travel_of_10_us() {
        // The travel is a quarter of the step; beyond it the pulse is a suspect.
        for (position, step, right) in
            [(4, 3, true), (5, 3, false), (5, 4, true), (6, -8, true), (7, 8, false)]
        {
            for position in [position, -position, position + TURN, TURN - position] {
                let mut rotor = Turning::new();
                assert!(!rotor.turn(100) && !rotor.pulse(position, step));
                assert_eq!(rotor.is_suspicious(), !right, "{position} {step}");
            }
        }
    }

    #[test]
    fn one_wrong_pulse_is_noise_and_a_second_one_there_a_loss() {
        for (second, lost) in [(300, true), (304, true), (296, true), (305, false), (295, false)] {
            for turn in [TURN, -TURN] {
                let mut rotor = Turning::new();
                assert!(!rotor.turn(300) && !rotor.pulse(300, 0) && !rotor.turn(turn));
                assert_eq!(rotor.pulse(second, 0), lost, "{second}");
                // Lost counts stay lost; a pulse at another position becomes the new suspect.
                assert!(!rotor.turn(turn) || lost);
                assert!(rotor.pulse(second, 0), "{second}");
            }
        }
    }

    #[test]
    fn the_second_pulse_counts_after_a_quarter_of_a_turn_away() {
        for (away, lost) in [(0, false), (TURN / 4 - 1, false), (TURN / 4, true), (-TURN / 4, true)] {
            let mut rotor = Turning::new();
            assert!(!rotor.turn(300) && !rotor.pulse(300, 0));
            assert!(!rotor.turn(away) && !rotor.turn(-away));
            assert_eq!(rotor.pulse(300, 0), lost, "{away}");
        }
    }

    #[test]
    fn a_right_pulse_ends_the_suspicion() {
        let mut rotor = Turning::new();
        assert!(!rotor.turn(300) && !rotor.pulse(300, 0) && !rotor.turn(TURN - 300));
        assert!(!rotor.pulse(0, 0) && !rotor.turn(300) && !rotor.pulse(300, 0));
    }

    #[test]
    fn a_rotor_that_stands_has_no_wrong_pulses() {
        let mut rotor = Turning::new();
        assert!(!rotor.turn(300));
        for period in 0..40 {
            // The encoder may flicker between two counts.
            rotor.counts = 300 + period % 2;
            assert!(!rotor.check());
        }
        assert!(!rotor.pulse(300, 0) && !rotor.is_suspicious());
        // A pulse at the suspect's position is ignored as well. Its own check is the last of 16, or of 15.
        let mut rotor = Turning::new();
        for (checks, lost) in [(REST_SAMPLES - 1, false), (REST_SAMPLES - 2, true)] {
            rotor = Turning::new();
            assert!(!rotor.turn(300) && !rotor.pulse(300, 0) && !rotor.turn(TURN));
            assert!((0..checks).all(|_| !rotor.check()));
            assert_eq!(rotor.pulse(300, 0), lost, "{checks}");
        }
        assert!((0..REST_SAMPLES).all(|_| !rotor.check()) && !rotor.pulse(300, 0));
        // Two counts further the rotor turns again.
        rotor.counts += 2;
        assert!(rotor.pulse(300, 0));
    }

    #[test]
    fn only_a_right_pulse_restarts_the_turns_without_one() {
        let longest = LONGEST.cast_signed();
        for sign in [1, -1] {
            let mut rotor = Turning::new();
            assert!(!rotor.turn(sign * TURN) && !rotor.pulse(0, 0) && !rotor.turn(sign * 5000));
            assert!(!rotor.pulse(5000, 0) && !rotor.turn(sign * (longest - 5000)));
            assert!(rotor.turn(sign));
        }
    }

    #[test]
    fn a_new_zero_of_the_joint_moves_nothing_on_the_rotor() {
        let mut rotor = Turning::new();
        assert!(!rotor.turn(300) && !rotor.pulse(300, 0));
        rotor.counts -= 1_000_000;
        rotor.watch.shift(-1_000_000);
        assert!(!rotor.check() && !rotor.watch.left, "it never left");
        assert!(!rotor.turn(TURN) && rotor.pulse(300, 0));
    }
}
