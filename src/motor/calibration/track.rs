//! Motion of the rotor during a scan: travel in counts, position of the index, deviation from the field.

use super::{Bench, Refusal};
use crate::hal::AxisSample;
use crate::motor::{CountScale, ElectricalAngle};

/// Greatest change of the deviation of a rotor that follows, electrical turns: beyond 108 degrees from the
/// first one the field no longer holds it. Lightly damped rotors swing by up to 39 degrees (100 simulated
/// motors), salient ones that hardly hold by 65; a load that grows on the way adds to that.
const GREATEST_UNEVENNESS: f32 = 0.3;
/// Counts between index pulses captured from either side.
pub(in crate::motor) const INDEX_WIDTH: i32 = 4;
/// Travel of a rotor that followed is equal in every electrical turn of the field, to one part in so many.
/// Swinging makes up to 0.16 (100 simulated motors), a missed turn at least 0.67.
const EVEN_SHARE: i32 = 2;

/// Unwrapped counter, growing with the field where all is well, and the index on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Track {
    counter: Option<u16>,
    /// Counts travelled since the beginning.
    pub(crate) way: i32,
    /// Travel at the first index pulse.
    pub(crate) index: Option<i32>,
    /// A distance of two index pulses that is not a whole number of turns.
    pub(crate) index_distance: Option<i32>,
}

impl Track {
    /// Starts at this counter, so many counts (in the field's direction) beyond the index.
    pub(super) fn beyond_index(counter: u16, counts: i32) -> Self {
        Self { counter: Some(counter), index: Some(counts.wrapping_neg()), ..Self::default() }
    }

    /// Adds the counter's step to the travel, and records the index.
    pub(super) fn follow(&mut self, bench: &Bench, sample: &AxisSample) {
        let sign = bench.direction.sign();
        let now = sample.encoder_count;
        let step = now.wrapping_sub(self.counter.unwrap_or(now)).cast_signed();
        self.counter = Some(now);
        self.way = self.way.wrapping_add(sign * i32::from(step));
        let Some(at) = sample.index_count.filter(|_| bench.index) else { return };
        let index = self.way.wrapping_sub(sign * i32::from(now.wrapping_sub(at).cast_signed()));
        let first = *self.index.get_or_insert(index);
        let distance = index.wrapping_sub(first).wrapping_abs();
        let beyond = bench.scale.within_turn(distance);
        if beyond.min(bench.scale.counts_per_turn() - beyond) > INDEX_WIDTH {
            self.index_distance = Some(distance);
        }
    }
}

/// Deviation of field from rotor over one pass. The sum is an integer, in 2^-32 turns: exact for the
/// longest pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Deviation {
    first: ElectricalAngle,
    sum: i64,
    ticks: u32,
    uneven: bool,
}

impl Deviation {
    fn push(&mut self, deviation: ElectricalAngle) {
        if self.ticks == 0 {
            self.first = deviation;
        }
        let from_first = deviation.minus(self.first);
        self.uneven |= from_first.turns().abs() > GREATEST_UNEVENNESS;
        self.sum += i64::from(from_first.units());
        self.ticks += 1;
    }

    /// Mean deviation of the pass.
    pub(super) fn mean(&self) -> ElectricalAngle {
        let mean = self.sum / i64::from(self.ticks.max(1));
        self.first.plus(ElectricalAngle::from_units(mean as i32))
    }
}

/// Counts of one pass while the field turned steadily, in total and in each electrical turn of the field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Travel {
    begin: Option<i32>,
    /// Travel at which this turn of the field began, and its number.
    turn_begin: i32,
    turn: u8,
    now: i32,
    least: i32,
    most: i32,
}

impl Travel {
    fn push(&mut self, way: i32, field_turns: f32) {
        let turn = field_turns as u8;
        if self.begin.is_none() {
            *self =
                Self { begin: Some(way), turn_begin: way, turn, now: way, least: i32::MAX, most: i32::MIN };
        }
        self.now = way;
        if turn != self.turn {
            let counts = way.wrapping_sub(self.turn_begin);
            (self.least, self.most) = (self.least.min(counts), self.most.max(counts));
            (self.turn, self.turn_begin) = (turn, way);
        }
    }

    /// Total counts of the pass.
    pub(super) fn counts(&self) -> i32 {
        self.now.wrapping_sub(self.begin.unwrap_or(self.now))
    }

    /// Whether the rotor moved equally far in every turn of the field, to one part in `share`. Then it
    /// followed, even where the configured scale is wrong. A single turn has nothing to be compared with.
    pub(super) fn is_even(&self, share: i32) -> bool {
        let mean = self.least / 2 + self.most / 2;
        let most = mean.wrapping_abs().checked_div(share).unwrap_or_default();
        self.least > self.most || self.most.wrapping_sub(self.least) <= most
    }
}

/// One pass: distance, evenness, deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Followed {
    pub(crate) travel: Travel,
    pub(crate) deviation: Deviation,
}

impl Followed {
    /// Adds one tick of steady motion: `field`, and `turns` travelled steadily, electrical.
    pub(super) fn push(&mut self, scale: &CountScale, way: i32, field: ElectricalAngle, turns: f32) {
        self.travel.push(way, turns);
        self.deviation.push(field.minus(scale.angle(scale.within_turn(way))));
    }

    /// Checks that rotor and field stayed together, for any scale of the counts.
    ///
    /// # Errors
    /// [`Refusal::Slipped`].
    pub(super) fn must_be_even(&self) -> Result<(), Refusal> {
        if self.travel.is_even(EVEN_SHARE) { Ok(()) } else { Err(Refusal::Slipped) }
    }

    /// Checks that the rotor stayed with the field, with the configured scale.
    ///
    /// # Errors
    /// [`Refusal::Slipped`].
    pub(super) fn must_keep_to_the_field(&self) -> Result<(), Refusal> {
        if self.deviation.uneven { Err(Refusal::Slipped) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_the_longest_way_is_exact() {
        // 64 electrical turns at half a turn per second.
        let mut deviation = Deviation::default();
        for tick in 0..3_072_000 {
            deviation.push(ElectricalAngle::from_turns(if tick % 2 == 0 { 0.4 } else { 0.5 }));
        }
        assert!((deviation.mean().since(ElectricalAngle::from_turns(0.45))).abs() < 1e-6);
        assert!(!deviation.uneven);
        deviation.push(ElectricalAngle::from_turns(0.81));
        assert!(deviation.uneven);
    }

    #[test]
    fn a_turn_of_the_field_that_was_missed_is_seen() {
        let travel = |missed: Option<usize>| {
            let (mut travel, mut way) = (Travel::default(), 0.0);
            for tick in 0..=7000 {
                if missed != Some(tick / 1000) {
                    way += 1.1703;
                }
                travel.push(way as i32, tick as f32 / 1000.0);
            }
            travel
        };
        assert!(travel(None).is_even(EVEN_SHARE));
        assert!((0..7).all(|missed| !travel(Some(missed)).is_even(EVEN_SHARE)));
        assert_eq!(travel(None).counts(), 8192);
    }

    #[test]
    fn turns_are_even_where_they_differ_by_at_most_half_of_their_mean() {
        for (least, most, even) in [
            (1000, 1000, true),
            (1000, 1600, true),
            (1000, 1700, false),
            (-1700, -1000, false),
            (0, 1000, false),
            // A single turn.
            (i32::MAX, i32::MIN, true),
        ] {
            let travel = Travel { least, most, ..Travel::default() };
            assert_eq!(travel.is_even(EVEN_SHARE), even, "{least} {most}");
        }
    }
}
