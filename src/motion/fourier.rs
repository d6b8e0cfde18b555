//! A periodic curve of `N` joints as a Fourier series of `H` harmonics.
//!
//! Why: a band-limited periodic excitation can be averaged over its periods, its derivatives are exact, and
//! its bounds follow from its coefficients.
//!
//! ```text
//! q(theta)   = q0 + sum_k  s_k sin(k theta) + c_k cos(k theta)          k = 1..H
//! q'(theta)  =      sum_k  k (s_k cos(k theta) - c_k sin(k theta))
//! q''(theta) =    - sum_k  k^2 (s_k sin(k theta) + c_k cos(k theta))
//! theta = w t,   w = 2 pi / period,   s_k = a_k / (k w),   c_k = -b_k / (k w)
//! ```
//!
//! `q0` rad, any; `s_k`, `c_k` amplitudes in rad; `a_k`, `b_k` the velocity coefficients in rad/s of J.
//! Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 13
//! (1997), equation 9. The amplitudes are stored, not the velocity coefficients. A curve then keeps its shape
//! and range when its period changes.
//!
//! Cost of one evaluation: one [`sin_cos`], 4 H multiplications for the harmonics by the addition theorem and
//! 6 H per joint, about 300 instructions for two joints and six harmonics; no division. The addition theorem
//! loses about two units in the last place per harmonic.

use super::{MotionError, MotionState, Phase};
use crate::real::{is_finite, sin_cos};
use crate::units::{Radian, Second};

/// Harmonics of the gait, and the default number for an excitation.
pub const HARMONICS: usize = 6;

const TURN_RAD: f32 = core::f32::consts::TAU;

/// A periodic curve; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fourier<const N: usize, const H: usize = HARMONICS> {
    period_s: f32,
    angular_frequency_rad_per_s: f32,
    centre_rad: [f32; N],
    sine_rad: [[f32; H]; N],
    cosine_rad: [[f32; H]; N],
}

/// A curve and its first two derivatives with respect to the phase angle, rad, rad/rad, rad/rad^2.
pub(super) struct Shape<const N: usize> {
    pub(super) value: [f32; N],
    pub(super) slope: [f32; N],
    pub(super) curvature: [f32; N],
}

impl<const N: usize, const H: usize> Fourier<N, H> {
    /// Builds a curve from amplitudes `s_k`, `c_k` in rad, lowest harmonic first.
    pub fn new(
        period: Second,
        centre_rad: [f32; N],
        sine_rad: [[f32; H]; N],
        cosine_rad: [[f32; H]; N],
    ) -> Result<Self, MotionError> {
        for joint in 0..N {
            let amplitudes = sine_rad[joint].iter().chain(&cosine_rad[joint]);
            if !is_finite(centre_rad[joint]) || !amplitudes.copied().all(is_finite) {
                return Err(MotionError::NotFinite { joint });
            }
        }
        let curve =
            Self { period_s: 1.0, angular_frequency_rad_per_s: TURN_RAD, centre_rad, sine_rad, cosine_rad };
        curve.with_period(period)
    }

    /// Returns a curve with this path and another period.
    pub fn with_period(self, period: Second) -> Result<Self, MotionError> {
        if !(period.0 > 0.0 && is_finite(period.0) && is_finite(TURN_RAD / period.0)) {
            return Err(MotionError::Period);
        }
        Ok(Self { period_s: period.0, angular_frequency_rad_per_s: TURN_RAD / period.0, ..self })
    }

    /// Maps each joint's angle to `scale * angle + offset`: anatomical to D-H angles, or into another range.
    pub fn mapped(self, scale: [f32; N], offset: [Radian; N]) -> Result<Self, MotionError> {
        let scaled = |amplitudes: [[f32; H]; N]| {
            core::array::from_fn(|joint| amplitudes[joint].map(|amplitude| scale[joint] * amplitude))
        };
        let centre = core::array::from_fn(|joint| scale[joint] * self.centre_rad[joint] + offset[joint].0);
        Self::new(Second(self.period_s), centre, scaled(self.sine_rad), scaled(self.cosine_rad))
    }

    /// Time of one period.
    pub fn period(&self) -> Second {
        Second(self.period_s)
    }

    /// Centre `q0` of every joint, rad.
    pub fn centre_rad(&self) -> [f32; N] {
        self.centre_rad
    }

    /// Amplitudes `s_k` of every joint, rad.
    pub fn sine_rad(&self) -> [[f32; H]; N] {
        self.sine_rad
    }

    /// Amplitudes `c_k` of every joint, rad.
    pub fn cosine_rad(&self) -> [[f32; H]; N] {
        self.cosine_rad
    }

    pub(super) fn angular_frequency_rad_per_s(&self) -> f32 {
        self.angular_frequency_rad_per_s
    }

    /// Position, velocity and acceleration at a phase: `qd = q' w v`, `qdd = q'' (w v)^2 + q' w v'` with the
    /// phase's relative speed `v`.
    pub fn state_at(&self, phase: &Phase) -> MotionState<N> {
        let shape = self.shape_at(phase.turn);
        let rate = self.angular_frequency_rad_per_s * phase.speed;
        let rate_change = self.angular_frequency_rad_per_s * phase.speed_slope_per_s;
        MotionState {
            position_rad: shape.value,
            velocity_rad_per_s: shape.slope.map(|slope| slope * rate),
            acceleration_rad_per_s2: core::array::from_fn(|joint| {
                shape.curvature[joint] * (rate * rate) + shape.slope[joint] * rate_change
            }),
        }
    }

    pub(super) fn shape_at(&self, turn: f32) -> Shape<N> {
        let (sine, cosine) = sin_cos(turn * TURN_RAD);
        let mut shape = Shape { value: self.centre_rad, slope: [0.0; N], curvature: [0.0; N] };
        // Joint by joint, so that the three sums stay in registers.
        for joint in 0..N {
            let (mut value, mut slope, mut curvature) = (shape.value[joint], 0.0, 0.0);
            let (mut sine_k, mut cosine_k, mut order) = (sine, cosine, 1.0);
            for (s, c) in self.sine_rad[joint].iter().zip(&self.cosine_rad[joint]) {
                let part = s * sine_k + c * cosine_k;
                value += part;
                slope += order * (s * cosine_k - c * sine_k);
                curvature -= order * order * part;
                order += 1.0;
                (sine_k, cosine_k) = (sine_k * cosine + cosine_k * sine, cosine_k * cosine - sine_k * sine);
            }
            (shape.value[joint], shape.slope[joint], shape.curvature[joint]) = (value, slope, curvature);
        }
        shape
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::testing::TestRandom;

    /// Random curve with amplitudes that fall with the order, as an excitation's do.
    pub(in crate::motion) fn random_curve(seed: u64) -> Fourier<2, 6> {
        let mut random = TestRandom::new(seed);
        let mut amplitudes =
            || [(); 2].map(|()| core::array::from_fn(|index| random.within(0.3) as f32 / (index + 1) as f32));
        let (sine, cosine) = (amplitudes(), amplitudes());
        Fourier::new(Second(10.0), [0.4, -0.7], sine, cosine).expect("finite amplitudes")
    }

    /// First equation of the module in double precision.
    pub(in crate::motion) fn position_in_double(curve: &Fourier<2, 6>, joint: usize, turn: f64) -> f64 {
        let mut position = f64::from(curve.centre_rad[joint]);
        for harmonic in 0..6 {
            let (sine, cosine) = sin_cos(core::f64::consts::TAU * turn * (harmonic + 1) as f64);
            position += f64::from(curve.sine_rad[joint][harmonic]) * sine
                + f64::from(curve.cosine_rad[joint][harmonic]) * cosine;
        }
        position
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_position() {
        for seed in 0..20 {
            let curve = random_curve(seed);
            let period = f64::from(curve.period().0);
            for step in 0..97 {
                let turn = step as f32 / 97.0;
                let state = curve.state_at(&Phase::steady(turn));
                let turn = f64::from(turn);
                for joint in 0..2 {
                    let position = |turn| position_in_double(&curve, joint, turn);
                    // Central differences of h = 1e-4 turns err by h^2/6 q'''
                    // (1e-6 here) and 1e-16/h^2 (1e-8).
                    let h = 1e-4;
                    let velocity = (position(turn + h) - position(turn - h)) / (2.0 * h * period);
                    let acceleration = (position(turn + h) - 2.0 * position(turn) + position(turn - h))
                        / (h * h * period * period);
                    // Rounding in f32: 6 harmonics of up to 0.3 rad, orders squared
                    // up to 36: a few units of 1e-6.
                    assert!((f64::from(state.position_rad[joint]) - position(turn)).abs() < 2e-6);
                    assert!((f64::from(state.velocity_rad_per_s[joint]) - velocity).abs() < 1e-5);
                    assert!((f64::from(state.acceleration_rad_per_s2[joint]) - acceleration).abs() < 3e-5);
                }
            }
        }
    }

    #[test]
    fn another_period_keeps_the_path_and_scales_the_derivatives() {
        let slow = random_curve(3);
        let fast = slow.with_period(Second(5.0)).expect("positive");
        let phase = Phase::steady(0.3);
        let (slow, fast) = (slow.state_at(&phase), fast.state_at(&phase));
        assert_eq!(slow.position_rad, fast.position_rad);
        // Halving is exact in binary.
        assert_eq!(slow.velocity_rad_per_s.map(|v| 2.0 * v), fast.velocity_rad_per_s);
        assert_eq!(slow.acceleration_rad_per_s2.map(|a| 4.0 * a), fast.acceleration_rad_per_s2);
    }

    #[test]
    fn curves_that_are_not_numbers_are_refused() {
        let amplitudes = [[f32::NAN, 0.0], [0.0, 0.0]];
        let fine = [[0.0; 2]; 2];
        let made = Fourier::new(Second(1.0), [0.0; 2], fine, [amplitudes[1], amplitudes[0]]);
        assert_eq!(made, Err(MotionError::NotFinite { joint: 1 }));
        for period in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-40] {
            assert_eq!(Fourier::new(Second(period), [0.0; 2], fine, fine), Err(MotionError::Period));
        }
    }
}
