//! Proven bounds of a motion from its coefficients, and the proof that they lie within limits.
//!
//! Sampling a curve misses its peaks; summing its amplitudes overstates them. Both together are
//! tight and certain. At a peak of f the slope vanishes, and the nearest of M points of a grid is at
//! most pi/M away, so by Taylor
//!
//! ```text
//! max f <= max over the grid + (pi/M)^2 / 2 * sum_k k^2 A_k            A_k = sqrt(s_k^2 + c_k^2)
//! ```
//!
//! and with k^3, k^4 for the first and second derivative. M = 64 H makes the remainder at most
//! 0.12 % of `sum_k k^n A_k`. A further term covers the rounding of the tick's single precision.
//!
//! Cost: 64 H evaluations of the curve, 206,000 instructions for two joints and six harmonics; once, when a
//! motion is accepted.

use super::Fourier;
use crate::real::{abs, max, min, sqrt};
use crate::units::{Radian, RadianPerSecond, RadianPerSecondSquared};

const POINTS_PER_HARMONIC: usize = 64;

/// Limits or proven bounds of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointEnvelope {
    /// Smallest angle.
    pub low: Radian,
    /// Largest angle.
    pub high: Radian,
    /// Largest magnitude of velocity.
    pub speed: RadianPerSecond,
    /// Largest magnitude of acceleration.
    pub acceleration: RadianPerSecondSquared,
}

/// Quantity that exceeds its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The smallest angle, rad.
    Low,
    /// The largest angle, rad.
    High,
    /// Speed, rad/s.
    Speed,
    /// Acceleration, rad/s^2.
    Acceleration,
}

/// First joint and quantity that cannot be proven to stay within limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitViolation {
    /// Joint, counted from 0.
    pub joint: usize,
    /// Exceeded quantity.
    pub quantity: Quantity,
    /// Bound of the motion, in the quantity's unit.
    pub bound: f32,
    /// Limit, in the quantity's unit.
    pub limit: f32,
}

/// Proof that a motion stays within the limits it was compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proof<const N: usize> {
    envelope: [JointEnvelope; N],
}

impl<const N: usize> Proof<N> {
    /// Bounds of the motion itself.
    pub fn envelope(&self) -> [JointEnvelope; N] {
        self.envelope
    }
}

/// Compares bounds with limits; NaN is a violation.
pub fn prove<const N: usize>(
    envelope: [JointEnvelope; N],
    limits: &[JointEnvelope; N],
) -> Result<Proof<N>, LimitViolation> {
    for joint in 0..N {
        let (bound, limit) = (&envelope[joint], &limits[joint]);
        let comparisons = [
            (Quantity::Low, bound.low.0, limit.low.0, bound.low.0 >= limit.low.0),
            (Quantity::High, bound.high.0, limit.high.0, bound.high.0 <= limit.high.0),
            (Quantity::Speed, bound.speed.0, limit.speed.0, bound.speed.0 <= limit.speed.0),
            (
                Quantity::Acceleration,
                bound.acceleration.0,
                limit.acceleration.0,
                bound.acceleration.0 <= limit.acceleration.0,
            ),
        ];
        for (quantity, bound, limit, holds) in comparisons {
            if !holds {
                return Err(LimitViolation { joint, quantity, bound, limit });
            }
        }
    }
    Ok(Proof { envelope })
}

impl<const N: usize, const H: usize> Fourier<N, H> {
    /// Proven bounds of the curve at full speed; see the module's inequality.
    pub fn envelope(&self) -> [JointEnvelope; N] {
        let points = POINTS_PER_HARMONIC * H.max(1);
        let mut lowest = [f32::INFINITY; N];
        let mut highest = [f32::NEG_INFINITY; N];
        let (mut steepest, mut sharpest) = ([0.0_f32; N], [0.0_f32; N]);
        for point in 0..points {
            let shape = self.shape_at(point as f32 / points as f32);
            for joint in 0..N {
                lowest[joint] = min(lowest[joint], shape.value[joint]);
                highest[joint] = max(highest[joint], shape.value[joint]);
                steepest[joint] = max(steepest[joint], abs(shape.slope[joint]));
                sharpest[joint] = max(sharpest[joint], abs(shape.curvature[joint]));
            }
        }
        let half_step = core::f32::consts::PI / points as f32;
        let rate = self.angular_frequency_rad_per_s();
        core::array::from_fn(|joint| {
            let sums = self.amplitude_sums(joint);
            let slack = |order: usize| {
                // Rounding: the angle by up to 2 pi eps, each harmonic by some 2 eps, each sum by H eps.
                let rounding = f32::EPSILON * (8.0 + 4.0 * H as f32) * (sums[order] + sums[order + 1]);
                0.5 * half_step * half_step * sums[order + 2] + rounding
            };
            let centre_rounding = f32::EPSILON * (1.0 + H as f32) * abs(self.centre_rad()[joint]);
            JointEnvelope {
                low: Radian(lowest[joint] - slack(0) - centre_rounding),
                high: Radian(highest[joint] + slack(0) + centre_rounding),
                speed: RadianPerSecond(rate * (steepest[joint] + slack(1))),
                acceleration: RadianPerSecondSquared(rate * rate * (sharpest[joint] + slack(2))),
            }
        })
    }

    /// `sum_k k^n A_k` for n = 0..=4, rad.
    fn amplitude_sums(&self, joint: usize) -> [f32; 5] {
        let mut sums = [0.0; 5];
        for harmonic in 0..H {
            let (s, c) = (self.sine_rad()[joint][harmonic], self.cosine_rad()[joint][harmonic]);
            let mut term = sqrt(s * s + c * c);
            for sum in &mut sums {
                *sum += term;
                term *= (harmonic + 1) as f32;
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::super::fourier::tests::random_curve;
    use super::super::{MotionState, Phase};
    use super::*;

    /// Extremes of one joint on a dense grid over a period: low, high, speed, acceleration.
    fn sampled(state: impl Fn(f32) -> MotionState<2>, joint: usize) -> [f32; 4] {
        let mut extremes = [f32::INFINITY, f32::NEG_INFINITY, 0.0, 0.0];
        for point in 0..20_000 {
            let state = state(point as f32 / 20_000.0);
            extremes[0] = extremes[0].min(state.position_rad[joint]);
            extremes[1] = extremes[1].max(state.position_rad[joint]);
            extremes[2] = extremes[2].max(state.velocity_rad_per_s[joint].abs());
            extremes[3] = extremes[3].max(state.acceleration_rad_per_s2[joint].abs());
        }
        extremes
    }

    #[test]
    fn bounds_bound_and_are_tight_within_a_percent() {
        for seed in 0..100 {
            let curve = random_curve(seed);
            let envelope = curve.envelope();
            for joint in 0..2 {
                let [low, high, speed, acceleration] =
                    sampled(|turn| curve.state_at(&Phase::steady(turn)), joint);
                let bound = &envelope[joint];
                assert!(bound.low.0 <= low && bound.high.0 >= high, "seed {seed}");
                assert!(bound.speed.0 >= speed && bound.acceleration.0 >= acceleration, "seed {seed}");
                // 0.12 % of the amplitude sum, which may be several times the peak of the curve.
                let span = high - low;
                assert!(low - bound.low.0 < 0.005 * span && bound.high.0 - high < 0.005 * span);
                assert!(bound.speed.0 < 1.01 * speed, "seed {seed}: {} {speed}", bound.speed.0);
                let ratio = bound.acceleration.0 / acceleration;
                assert!(ratio < 1.01, "seed {seed}: {ratio}");
            }
        }
    }

    #[test]
    fn a_peak_between_two_grid_points_is_still_bounded() {
        // The worst case of the grid: one harmonic whose peak lies half a step from the nearest point.
        let points = POINTS_PER_HARMONIC as f32;
        let (sine, cosine) = crate::real::sin_cos(core::f32::consts::PI / points);
        let curve = Fourier::new(crate::units::Second(1.0), [0.0], [[sine]], [[cosine]]).expect("finite");
        let high = curve.envelope()[0].high.0;
        assert!(high >= 1.0, "{high}");
        // cos(pi/64) + (pi/64)^2/2 exceeds 1 by (pi/64)^4/24 = 2.4e-7, and by the rounding term.
        assert!(high < 1.0 + 5e-6, "{high}");
    }

    #[test]
    fn a_violation_names_joint_and_quantity() {
        let curve = random_curve(5);
        let envelope = curve.envelope();
        let fine = prove(envelope, &envelope).expect("a motion stays within its own bounds");
        assert_eq!(fine.envelope(), envelope);
        let mut limits = envelope;
        limits[1].speed.0 *= 0.99;
        let violation = prove(envelope, &limits).expect_err("joint 2 is too fast");
        assert_eq!((violation.joint, violation.quantity), (1, Quantity::Speed));
        assert_eq!((violation.bound, violation.limit), (envelope[1].speed.0, limits[1].speed.0));
        limits[0].low.0 += 0.1;
        let violation = prove(envelope, &limits).expect_err("joint 1 leaves its range");
        assert_eq!((violation.joint, violation.quantity), (0, Quantity::Low));
        limits[0] = envelope[0];
        limits[0].acceleration.0 = f32::NAN;
        let violation = prove(envelope, &limits).expect_err("a limit that is not a number allows nothing");
        assert_eq!((violation.joint, violation.quantity), (0, Quantity::Acceleration));
    }
}
