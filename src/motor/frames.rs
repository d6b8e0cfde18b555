//! The three frames of a motor's currents and voltages, as types.
//!
//! Why types: the same two or three numbers mean different things in each frame, and only the type
//! shows which. A value changes its frame only through the functions here, and through an angle where
//! one is needed.
//!
//! ```text
//! alpha = (2 a - b - c) / 3          a = alpha                         (Clarke, amplitude invariant)
//! beta  = (b - c) / sqrt(3)          b, c = -alpha / 2 +- sqrt(3) / 2 beta
//! d =  cos alpha + sin beta          alpha = cos d - sin q                        (Park)
//! q = -sin alpha + cos beta          beta  = sin d + cos q
//! ```
//!
//! `a`, `b`, `c` phase quantities against the star point; `alpha` along phase A, `beta` a quarter turn ahead;
//! `d` along the magnets' flux, `q` a quarter turn ahead of it; sin and cos of the electrical angle from
//! phase A to d. Amplitude invariant: a balanced sine of amplitude 1 is a vector of length 1, and power is
//! 3/2 (v_d i_d + v_q i_q).
//! Source: Park (1929), Clarke (1943).
//! Cost: 5 operations for each Clarke, 6 for each Park.

use core::ops::{Add, Mul, Neg, Sub};

use super::Rotation;

const ONE_OVER_SQRT_3: f32 = 0.577_350_26;
const HALF_SQRT_3: f32 = 0.866_025_4;

/// A quantity with vector components: any of the unit newtypes, and bare numbers.
pub trait Quantity:
    Copy + Add<Output = Self> + Sub<Output = Self> + Neg<Output = Self> + Mul<f32, Output = Self>
{
}

impl<Q> Quantity for Q where
    Q: Copy + Add<Output = Q> + Sub<Output = Q> + Neg<Output = Q> + Mul<f32, Output = Q>
{
}

/// One value per phase.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Phases<Q> {
    /// Phase A.
    pub(crate) a: Q,
    /// Phase B.
    pub(crate) b: Q,
    /// Phase C.
    pub(crate) c: Q,
}

/// Vector in the stator's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stationary<Q> {
    /// Along phase A.
    pub alpha: Q,
    /// A quarter of an electrical turn ahead.
    pub beta: Q,
}

/// Vector in the rotor's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Rotating<Q> {
    /// Along the magnets' flux.
    pub(crate) d: Q,
    /// A quarter of an electrical turn ahead: produces the torque.
    pub(crate) q: Q,
}

impl<Q: Quantity> Phases<Q> {
    /// Clarke's transformation; the common-mode component is lost.
    pub(crate) fn to_stationary(self) -> Stationary<Q> {
        Stationary {
            alpha: (self.a + self.a - self.b - self.c) * (1.0 / 3.0),
            beta: (self.b - self.c) * ONE_OVER_SQRT_3,
        }
    }
}

impl<Q: Quantity> Stationary<Q> {
    /// Clarke's transformation of two phases, for a sum of zero over all three: currents without a neutral.
    pub(crate) fn from_two_phases(b: Q, c: Q) -> Self {
        Self { alpha: -(b + c), beta: (b - c) * ONE_OVER_SQRT_3 }
    }

    /// [`Rotating::to_stationary`] of a vector without direct component.
    pub(crate) fn from_quadrature(q: Q, rotor: Rotation) -> Self {
        Self { alpha: -(q * rotor.sine), beta: q * rotor.cosine }
    }

    /// Inverse Clarke's transformation; the three phases sum to zero.
    pub(crate) fn to_phases(self) -> Phases<Q> {
        let (half, beta) = (self.alpha * -0.5, self.beta * HALF_SQRT_3);
        Phases { a: self.alpha, b: half + beta, c: half - beta }
    }

    /// Park's transformation into the frame of a rotor at an angle.
    pub(crate) fn to_rotating(self, rotor: Rotation) -> Rotating<Q> {
        Rotating {
            d: self.alpha * rotor.cosine + self.beta * rotor.sine,
            q: self.beta * rotor.cosine - self.alpha * rotor.sine,
        }
    }
}

impl<Q: Quantity> Rotating<Q> {
    /// Inverse Park's transformation, from the frame of a rotor at an angle.
    pub(crate) fn to_stationary(self, rotor: Rotation) -> Stationary<Q> {
        Stationary {
            alpha: self.d * rotor.cosine - self.q * rotor.sine,
            beta: self.d * rotor.sine + self.q * rotor.cosine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::ElectricalAngle;
    use crate::real::sin_cos;
    use crate::units::Ampere;

    const THIRD: f32 = core::f32::consts::TAU / 3.0;

    fn balanced(amplitude: f32, angle: f32) -> Phases<Ampere> {
        let along = |axis: f32| Ampere(amplitude * sin_cos(angle - axis).1);
        Phases { a: along(0.0), b: along(THIRD), c: along(-THIRD) }
    }

    #[test]
    fn a_balanced_sine_is_a_vector_of_its_amplitude_and_phase() {
        for step in 0..360 {
            let angle = (step as f32).to_radians();
            let vector = balanced(7.0, angle).to_stationary();
            let (sine, cosine) = sin_cos(angle);
            // Tolerance: six roundings of numbers of 7.
            assert!((vector.alpha.0 - 7.0 * cosine).abs() < 3e-6, "{step}");
            assert!((vector.beta.0 - 7.0 * sine).abs() < 3e-6, "{step}");
        }
    }

    #[test]
    fn a_vector_that_turns_with_the_rotor_stands_still_in_its_frame() {
        for step in 0..360 {
            let angle = (step as f32).to_radians();
            let rotor = ElectricalAngle::from_turns(step as f32 / 360.0).rotation();
            let ahead =
                balanced(4.0, angle + core::f32::consts::FRAC_PI_2).to_stationary().to_rotating(rotor);
            assert!(ahead.d.abs().0 < 4e-6 && (ahead.q.0 - 4.0).abs() < 4e-6, "{step}: {ahead:?}");
        }
    }
}
