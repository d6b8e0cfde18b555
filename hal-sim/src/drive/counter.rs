//! Quadrature counter of the motor's encoder, with index pulse.
//!
//! ```text
//! counter = start + floor(sense * angle / 2 pi * counts)      16 bits, wrapping
//! index   : where (angle - index) / 2 pi passes a whole number; the counter is captured there
//! steps   = floor((angle - index) / 2 pi * 2^14)             absolute encoder, 14 bits
//! ```
//!
//! All three see the angle with the encoder's error `e sin(angle)`, as one chip makes all of them.
//!
//! Angles are the rotor's in rad, over all turns.
//! Cost: one multiplication and one comparison per sample.

use super::description::{CounterDescription, EncoderWiring};
use crate::maths::{floor, sin_cos};
use core::f64::consts::TAU;

/// The counter of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counter {
    description: CounterDescription,
    wiring: EncoderWiring,
    /// Whole turns from the index at the last sample.
    turns: i64,
}

impl Counter {
    /// A counter by its description, with the rotor at `angle`.
    pub fn new(description: &CounterDescription, wiring: EncoderWiring, angle: f64) -> Self {
        let mut counter = Self { description: *description, wiring, turns: 0 };
        counter.turns = counter.index_turns(counter.seen(angle));
        counter
    }

    /// Reads the counter at an angle, and its value at the index pulse if one came since the last reading.
    pub fn read(&mut self, angle: f64) -> (u16, Option<u16>) {
        if self.wiring == EncoderWiring::Missing {
            return (self.description.start, None);
        }
        let angle = self.seen(angle);
        let turns = self.index_turns(angle);
        // Upward the last pulse passed is that of the turn that began, downward that of the turn that ended.
        let pulse = turns.max(turns.saturating_add(1).min(self.turns));
        let captured = (turns != self.turns).then(|| self.count(self.description.index + TAU * pulse as f64));
        self.turns = turns;
        (self.count(angle), captured)
    }

    /// Reading of an absolute encoder in the same chip, 14 bits.
    pub fn steps(&self, angle: f64) -> u16 {
        steps(self.seen(angle) - self.description.index)
    }

    /// Angle with the encoder's error.
    fn seen(&self, angle: f64) -> f64 {
        let error = self.description.error;
        if error == 0.0 { angle } else { angle + error * sin_cos(angle).0 }
    }

    fn index_turns(&self, angle: f64) -> i64 {
        floor((angle - self.description.index) / TAU)
    }

    fn count(&self, angle: f64) -> u16 {
        let sense = if self.wiring == EncoderWiring::Reversed { -1.0 } else { 1.0 };
        let counts = floor(sense * angle / TAU * self.description.counts);
        // Dropping the upper bits is the wrap of a 16-bit counter.
        self.description.start.wrapping_add(counts as u16)
    }
}

/// Angle as 14 bits of a turn.
pub fn steps(angle: f64) -> u16 {
    (floor(angle / TAU * 16_384.0) & 0x3FFF) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: f64 = TAU / 8192.0;

    fn counter(wiring: EncoderWiring) -> Counter {
        let description = CounterDescription {
            counts: 8192.0,
            start: 65_530,
            index: 100.5 * COUNT,
            error: 0.0,
            absolute: false,
        };
        Counter::new(&description, wiring, 0.0)
    }

    #[test]
    fn the_counter_wraps_at_sixteen_bits_in_both_directions() {
        let mut forward = counter(EncoderWiring::Forward);
        assert_eq!(forward.read(0.5 * COUNT).0, 65_530);
        assert_eq!(forward.read(6.5 * COUNT).0, 0);
        assert_eq!(forward.read(-65_536.0 * COUNT + 0.5 * COUNT).0, 65_530);
        let mut reversed = counter(EncoderWiring::Reversed);
        assert_eq!(reversed.read(-0.5 * COUNT).0, 65_530);
        assert_eq!(reversed.read(9.5 * COUNT).0, 65_520);
        let mut missing = counter(EncoderWiring::Missing);
        assert_eq!(missing.read(3.0 * TAU), (65_530, None));
    }

    #[test]
    fn an_absolute_encoder_reads_the_angle_from_the_index() {
        let counter = counter(EncoderWiring::Reversed);
        for (counts, steps) in [(100.6, 0), (100.4, 16_383), (100.5 + 8192.0 * 2.25, 4096), (-8091.4, 0)] {
            assert_eq!(counter.steps(counts * COUNT), steps, "{counts}");
        }
    }

    #[test]
    fn the_error_acts_on_count_and_absolute_reading_alike() {
        let description =
            CounterDescription { counts: 4096.0, error: 0.014, ..CounterDescription::default() };
        let mut counter = Counter::new(&description, EncoderWiring::Forward, 0.0);
        for degree in 0..720 {
            let angle = f64::from(degree).to_radians();
            let (count, steps) = (counter.read(angle).0, counter.steps(angle));
            assert_eq!(count % 4096, steps / 4, "{degree}");
            let error = (f64::from(steps) / 16_384.0 * TAU - angle % TAU).abs();
            assert!(error.min(TAU - error) < 0.0145, "{degree}: {error}");
        }
    }

    #[test]
    fn the_index_comes_once_per_turn_at_one_position_from_both_sides() {
        let mut counter = counter(EncoderWiring::Forward);
        let mut seen = [(0, 0); 7];
        let mut pulses = 0;
        for step in (0..20_000_i32).chain((0..20_000).rev()) {
            if let (_, Some(captured)) = counter.read(f64::from(step) * COUNT) {
                seen[pulses] = (step, captured);
                pulses += 1;
            }
        }
        let captured = |turn: i32| 65_530_u16.wrapping_add((100 + 8192 * turn) as u16);
        assert_eq!(
            seen[..pulses],
            [
                (101, captured(0)),
                (8293, captured(1)),
                (16_485, captured(2)),
                (16_484, captured(2)),
                (8292, captured(1)),
                (100, captured(0))
            ]
        );
    }
}
