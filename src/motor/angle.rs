//! Electrical angle and speed, sine and cosine from encoder counts.
//!
//! Why an integer: a turn is 2^32, so angles wrap for free and need no reduction. Counts are reduced to one
//! mechanical turn before they are scaled, so no error grows with the distance travelled.
//!
//! ```text
//! angle = pole pairs / counts per turn * (counts + 1/2) + offset          turns; a count covers [n, n+1)
//! e = angle - estimate;  speed += (w T)^2 e;  estimate += speed + 2 w T e      tracking loop, w = 1000 rad/s
//! ```
//!
//! The loop's speed (double pole at w) feeds the back-EMF forward and turns the voltage by the delay. The
//! angle itself comes from the counter, not from the loop. A constant speed is tracked without lag, a
//! constant acceleration with a speed error of 2/w times itself. At 20,000 rad/s^2 electrical that is 40
//! rad/s, or 0.2 V of back-EMF at 5 mV s. Quantisation: 8,192 counts and 7 pole pairs make 0.31 electrical
//! degrees per count, uniform to +-0.15. A quadrature current of 1 A then reads as 2.7 mA of direct current.
//!
//! Sine and cosine err by up to 1.2e-7; the angle is an integer, so no range reduction remains. A rotation
//! ahead follows from the present one, because the angle x between them is small:
//!
//! ```text
//! sin x = x (1 - x^2 / 6)                error up to x^5 / 120
//! cos x = 1 - x^2 / 2 + x^4 / 24         error up to x^6 / 720; length of both 1 - x^6 / 144
//! ```
//!
//! At 5,000 rad/s electrical, 1.5 ticks are 0.31 rad: errors of 3e-5 and 1.3e-6. The angle ahead is limited
//! to an eighth of a turn, because the series would lengthen the voltage beyond; a configuration permits only
//! speeds below that, a twelfth of a turn per tick.

use crate::hal::CURRENT_RATE_HZ;
use crate::real::sin_cos_of_turns;

/// One turn in units of an [`ElectricalAngle`].
const TURN: f32 = 4_294_967_296.0;
const RADIAN_PER_UNIT: f32 = core::f32::consts::TAU / TURN;
/// An eighth of a turn, units of 2^-32 turns; a power of two is limited by one instruction.
const MOST_AHEAD: i32 = 1 << 29;
const TICK_S: f32 = 1.0 / CURRENT_RATE_HZ as f32;
/// Double pole of the tracking loop, rad/s.
const TRACKING_RAD_PER_S: f32 = 1000.0;
const TRACKING_POSITION: f32 = 2.0 * TRACKING_RAD_PER_S * TICK_S;
const TRACKING_SPEED: f32 = (TRACKING_RAD_PER_S * TICK_S) * (TRACKING_RAD_PER_S * TICK_S);

/// Angle from phase A to the magnets' flux, in units of 2^-32 turns; wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ElectricalAngle(u32);

/// Sine and cosine of an electrical angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rotation {
    /// Sine.
    pub(crate) sine: f32,
    /// Cosine.
    pub(crate) cosine: f32,
}

impl Rotation {
    /// This rotation, turned by a small angle, rad; see the module's equations.
    #[inline(always)]
    fn turned_by(self, angle: f32) -> Self {
        let square = angle * angle;
        let sine = angle - angle * square * (1.0 / 6.0);
        let cosine = 1.0 - square * (0.5 - square * (1.0 / 24.0));
        Self {
            sine: self.sine * cosine + self.cosine * sine,
            cosine: self.cosine * cosine - self.sine * sine,
        }
    }
}

impl ElectricalAngle {
    /// Flux along phase A.
    pub(crate) const ZERO: Self = Self(0);

    /// Converts turns; whole turns are dropped. Valid for -32,768..=32,767.
    pub fn from_turns(turns: f32) -> Self {
        let whole = turns as i32;
        Self(((turns - whole as f32) * TURN) as i64 as u32)
    }

    /// Turns from -0.5 to 0.5.
    pub fn turns(self) -> f32 {
        self.0.cast_signed() as f32 * (1.0 / TURN)
    }

    /// Signed difference from `other` to this angle, turns from -0.5 to 0.5.
    pub(crate) fn since(self, other: Self) -> f32 {
        Self(self.0.wrapping_sub(other.0)).turns()
    }

    /// Sum of both angles, modulo one turn.
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }

    /// Difference of both angles, modulo one turn.
    pub(crate) const fn minus(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }

    /// Sine and cosine.
    #[inline(always)]
    pub(crate) fn rotation(self) -> Rotation {
        let (sine, cosine) = sin_cos_of_turns(self.0);
        Rotation { sine, cosine }
    }

    /// Signed angle from minus to plus half a turn, in units of 2^-32 turns.
    pub const fn units(self) -> i32 {
        self.0.cast_signed()
    }

    /// Creates an angle from units of 2^-32 turns.
    pub const fn from_units(units: i32) -> Self {
        Self(units.cast_unsigned())
    }

    /// This angle advanced by less than half a turn, given in units of 2^-32 turns.
    fn turned_by(self, units: f32) -> Self {
        Self(self.0.wrapping_add((units as i32).cast_unsigned()))
    }
}

/// The tracking loop; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpeedTracker {
    estimate: ElectricalAngle,
    /// Units of 2^-32 turns per tick.
    speed: f32,
}

impl SpeedTracker {
    /// A tracker at rest at an angle.
    pub const fn at(angle: ElectricalAngle) -> Self {
        Self { estimate: angle, speed: 0.0 }
    }

    /// A tracker that starts at an angle with a speed, electrical rad/s.
    pub const fn turning(angle: ElectricalAngle, rad_per_s: f32) -> Self {
        Self { estimate: angle, speed: rad_per_s / (RADIAN_PER_UNIT * CURRENT_RATE_HZ as f32) }
    }

    /// Updates angle and speed with the angle of one tick.
    #[inline(always)]
    pub(crate) fn track(&mut self, angle: ElectricalAngle) {
        let error = angle.0.wrapping_sub(self.estimate.0).cast_signed() as f32;
        self.speed += TRACKING_SPEED * error;
        self.estimate = self.estimate.turned_by(self.speed + TRACKING_POSITION * error);
    }

    /// Electrical speed, rad/s.
    pub(crate) fn rad_per_s(&self) -> f32 {
        self.speed * (RADIAN_PER_UNIT * CURRENT_RATE_HZ as f32)
    }

    /// Predicted rotation some ticks after this one, at the tracked speed; up to an eighth of a turn ahead.
    #[inline(always)]
    pub(crate) fn ahead(&self, rotor: Rotation, ticks: f32) -> Rotation {
        let units = ((self.speed * ticks) as i32).clamp(-MOST_AHEAD, MOST_AHEAD - 1);
        rotor.turned_by(units as f32 * RADIAN_PER_UNIT)
    }
}

/// Scale from encoder counts of one mechanical turn to the electrical angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CountScale {
    counts_per_turn: i32,
    /// Electrical angle of one count. Rounding accumulates to 7.6e-6 turns after 65,536 counts.
    units_per_count: u32,
}

impl CountScale {
    /// Scale of an encoder with `counts_per_turn` (16..=65,536) and a motor with `pole_pairs`
    /// (1..=64). Returns `None` outside these ranges, and where a count is not less than a quarter of
    /// an electrical turn.
    pub fn new(counts_per_turn: u32, pole_pairs: u8) -> Option<Self> {
        let possible = (16..=65_536).contains(&counts_per_turn)
            && (1..=64).contains(&pole_pairs)
            && 4 * u32::from(pole_pairs) < counts_per_turn;
        let turn = u64::from(pole_pairs) << 32;
        let counts = u64::from(counts_per_turn.max(1));
        let units_per_count = ((turn + counts / 2) / counts) as u32;
        possible.then_some(Self { counts_per_turn: counts_per_turn.cast_signed(), units_per_count })
    }

    /// Counts per mechanical turn.
    pub(crate) const fn counts_per_turn(&self) -> i32 {
        self.counts_per_turn
    }

    /// Moves a position within one turn by less than one turn and wraps the result.
    pub(crate) const fn moved(&self, position: i32, step: i32) -> i32 {
        let position = position + step;
        if position >= self.counts_per_turn {
            position - self.counts_per_turn
        } else if position < 0 {
            position + self.counts_per_turn
        } else {
            position
        }
    }

    /// Reduces any number of counts to one turn.
    pub(crate) fn within_turn(&self, counts: i32) -> i32 {
        // A turn has at least 16 counts. The checked form leaves no panic in the image.
        counts.checked_rem_euclid(self.counts_per_turn).unwrap_or_default()
    }

    /// Electrical angle at the middle of a count.
    pub(crate) const fn angle(&self, position: i32) -> ElectricalAngle {
        ElectricalAngle(
            position
                .cast_unsigned()
                .wrapping_mul(self.units_per_count)
                .wrapping_add(self.units_per_count >> 1),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_the_same_after_whole_turns_of_any_encoder() {
        for (counts, pairs) in [(8192, 7), (4000, 7), (10_000, 21), (2400, 4), (16_384, 14)] {
            let scale = CountScale::new(counts, pairs).expect("usual");
            let (mut position, steps) = (0, counts.cast_signed() / 3);
            for _ in 0..3 {
                position = scale.moved(position, steps);
            }
            position = scale.moved(position, counts.cast_signed() - 3 * steps);
            assert_eq!(position, 0);
            let half = scale.angle(counts.cast_signed() / 2).since(scale.angle(0)).abs();
            // Tolerance: rounding of half a turn's counts.
            assert!((half - if pairs % 2 == 1 { 0.5 } else { 0.0 }).abs() < 4e-6, "{half}");
            // One mechanical turn is `pairs` electrical turns; the last step closes it to a hundredth
            // of a count.
            let last = scale.angle(counts.cast_signed() - 1);
            let step = scale.angle(0).since(last);
            assert!((step * counts as f32 / f32::from(pairs) - 1.0).abs() < 1e-2, "{step}");
        }
        assert_eq!(CountScale::new(24, 7), None);
        assert_eq!(CountScale::new(8192, 0), None);
        assert_eq!(CountScale::new(0, 1), None);
    }

    #[test]
    fn a_constant_speed_is_tracked_without_lag_and_through_every_wrap() {
        let scale = CountScale::new(8192, 7).expect("usual");
        for counts_per_tick in [-40.7_f64, -3.3, 0.11, 12.9] {
            let mut tracker = SpeedTracker::at(ElectricalAngle::ZERO);
            for tick in 0..CURRENT_RATE_HZ {
                let count = (counts_per_tick * f64::from(tick)).floor() as i32;
                tracker.track(scale.angle(count.rem_euclid(8192)));
            }
            let true_speed =
                counts_per_tick * 7.0 / 8192.0 * core::f64::consts::TAU * f64::from(CURRENT_RATE_HZ);
            // Filtered steps of one count: below half a count over the loop's 1 ms, 2.7 rad/s.
            assert!((f64::from(tracker.rad_per_s()) - true_speed).abs() < 2.7, "{}", tracker.rad_per_s());
        }
    }

    #[test]
    fn a_rotation_ahead_is_turned_by_speed_and_ticks() {
        let mut tracker = SpeedTracker::at(ElectricalAngle::ZERO);
        // The sine's error is 6e-8, 2.5e-5 and 4.8e-4 at 0.09, 0.31 and 0.57 rad; the first one is rounding.
        for (speed, from, error) in [(-0.01, 0.005, 1e-6), (0.033, 0.73, 4e-5), (-0.06, -0.4, 5e-4)] {
            tracker.speed = speed * TURN;
            let ahead = tracker.ahead(ElectricalAngle::from_turns(from).rotation(), 1.5);
            let truth = ElectricalAngle::from_turns(from + 1.5 * speed).rotation();
            assert!((ahead.sine - truth.sine).abs() < error, "{speed}: {ahead:?}, {truth:?}");
            assert!((ahead.cosine - truth.cosine).abs() < error, "{speed}: {ahead:?}, {truth:?}");
        }
    }

    #[test]
    fn no_speed_lengthens_a_rotation_or_makes_it_infinite() {
        let mut tracker = SpeedTracker::at(ElectricalAngle::ZERO);
        let rotor = ElectricalAngle::from_turns(0.3).rotation();
        for speed in [0.05 * TURN, 0.09 * TURN, -0.3 * TURN, f32::MAX, f32::NEG_INFINITY, f32::NAN] {
            tracker.speed = speed;
            let Rotation { sine, cosine } = tracker.ahead(rotor, 1.5);
            let length = crate::real::sqrt(sine * sine + cosine * cosine);
            assert!((0.99..1.000_001).contains(&length), "{speed}: {length}");
        }
    }
}
