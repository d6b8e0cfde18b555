//! Geometry of a serial chain of revolute joints in modified Denavit-Hartenberg numbers.
//!
//! The modified convention puts frame i on joint i's own axis, so that a link's parameters do not depend on
//! the joint after it; Gautier's closed-form regrouping ([`super::base`]) is written in it.
//!
//! ```text
//! T(i-1, i) = Rx(alpha_i) Tx(a_i) Rz(q_i) Tz(d_i)
//!
//!         | cos q           -sin q            0         |            |  a           |
//!     R = | sin q cos alpha  cos q cos alpha -sin alpha |        p = | -d sin alpha |
//!         | sin q sin alpha  cos q sin alpha  cos alpha |            |  d cos alpha |
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | alpha | angle from z(i-1) to z(i) about x(i-1) | rad |
//! | a | distance from z(i-1) to z(i) along x(i-1) | m |
//! | d | distance from x(i-1) to x(i) along z(i) | m |
//! | q | joint angle, from x(i-1) to x(i) about z(i) | rad |
//! | R, p | frame i seen from frame i-1; p does not depend on q | -, m |
//!
//! Source: J. J. Craig, Introduction to Robotics, 3rd ed. 2005, Eq. (3.6); W. Khalil and J.-F.
//! Kleinfinger, 1986.
//! Cost: sine and cosine of alpha are computed once, here; 24 bytes per joint in `f32`.
//! Limits: revolute joints only, one branch, fixed base.

use nalgebra::Vector3;

use super::kinematics::JointFrame;
use crate::real::{Real, abs, is_finite, sin_cos, sqrt};

/// Position of a joint's axis, seen from the joint before it (the base for the first).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DenavitHartenberg<T> {
    /// Twist between the axes, rad.
    pub alpha: T,
    /// Length of the common normal, m.
    pub a: T,
    /// Offset along the joint's own axis, m.
    pub d: T,
}

/// Reason why a chain is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChainError {
    /// A Denavit-Hartenberg number of this joint (counted from 0) is NaN or infinite.
    NotFinite {
        /// The joint, from 0.
        joint: usize,
    },
}

/// Part of a joint's frame that does not depend on its angle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Placement<T> {
    sin_alpha: T,
    cos_alpha: T,
    a: T,
    d: T,
}

/// A serial chain of `N` revolute joints; every number in it is finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain<T, const N: usize> {
    placements: [Placement<T>; N],
}

impl<T: Real, const N: usize> Chain<T, N> {
    /// Builds the chain with these numbers, proximal joint first.
    ///
    /// A sine or cosine of alpha below four units of rounding becomes zero. Axes meant to be parallel or
    /// perpendicular are then exactly so, and the rounding of pi/2 makes no parameter visible.
    ///
    /// # Errors
    /// [`ChainError::NotFinite`] names the first joint with a number that is NaN or infinite.
    pub fn new(geometry: &[DenavitHartenberg<T>; N]) -> Result<Self, ChainError> {
        for (joint, numbers) in geometry.iter().enumerate() {
            if !(is_finite(numbers.alpha) && is_finite(numbers.a) && is_finite(numbers.d)) {
                return Err(ChainError::NotFinite { joint });
            }
        }
        let exact = |value: T| if abs(value) < T::EPSILON * T::from_double(4.0) { T::zero() } else { value };
        let placements = geometry.map(|numbers| {
            let (sin_alpha, cos_alpha) = sin_cos(numbers.alpha);
            Placement { sin_alpha: exact(sin_alpha), cos_alpha: exact(cos_alpha), a: numbers.a, d: numbers.d }
        });
        Ok(Self { placements })
    }

    /// Converts to another precision, each number rounded once.
    pub fn convert<U: Real>(&self) -> Chain<U, N> {
        let convert = |value: T| U::from_double(value.to_double());
        Chain {
            placements: self.placements.map(|placement| Placement {
                sin_alpha: convert(placement.sin_alpha),
                cos_alpha: convert(placement.cos_alpha),
                a: convert(placement.a),
                d: convert(placement.d),
            }),
        }
    }

    /// Distance between the axis points of the previous joint and of `joint`, m; `None` beyond the last.
    pub(crate) fn distance_to(&self, joint: usize) -> Option<T> {
        self.placements
            .get(joint)
            .map(|placement| sqrt(placement.a * placement.a + placement.d * placement.d))
    }

    /// True if the common normal before `joint` has a nonzero length.
    pub fn has_length(&self, joint: usize) -> bool {
        self.placements.get(joint).is_some_and(|placement| placement.a != T::zero())
    }

    /// Returns the chain with the length before `joint` multiplied by `factor`.
    #[must_use]
    pub fn with_length(&self, joint: usize, factor: T) -> Self {
        let mut changed = *self;
        if let Some(placement) = changed.placements.get_mut(joint) {
            placement.a *= factor;
        }
        changed
    }

    /// Numbers of each joint: sine and cosine of alpha, a, d.
    pub(super) fn numbers(&self) -> [(T, T, T, T); N] {
        self.placements.map(|placement| (placement.sin_alpha, placement.cos_alpha, placement.a, placement.d))
    }

    /// Frame of each joint seen from the one before it, at the angles `q` (rad).
    #[inline]
    pub(super) fn frames(&self, q: &[T; N]) -> [JointFrame<T>; N] {
        core::array::from_fn(|joint| {
            let placement = self.placements[joint];
            let (sin_q, cos_q) = sin_cos(q[joint]);
            JointFrame {
                sin_alpha: placement.sin_alpha,
                cos_alpha: placement.cos_alpha,
                sin_q,
                cos_q,
                origin: Vector3::new(
                    placement.a,
                    -placement.d * placement.sin_alpha,
                    placement.d * placement.cos_alpha,
                ),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::super::testing::TestRandom;
    use super::*;

    #[test]
    fn a_number_that_is_not_finite_is_refused_by_joint() {
        let good = DenavitHartenberg { alpha: 0.0_f32, a: 0.4, d: 0.0 };
        assert!(Chain::new(&[good, good]).is_ok());
        for bad in [
            DenavitHartenberg { alpha: f32::NAN, ..good },
            DenavitHartenberg { a: f32::INFINITY, ..good },
            DenavitHartenberg { d: f32::NEG_INFINITY, ..good },
        ] {
            assert_eq!(Chain::new(&[good, bad]), Err(ChainError::NotFinite { joint: 1 }));
        }
    }

    #[test]
    fn right_angles_are_exact_in_both_precisions() {
        let quarter = DenavitHartenberg { alpha: core::f64::consts::FRAC_PI_2, a: 0.0, d: 0.0 };
        let half = DenavitHartenberg { alpha: core::f64::consts::PI, a: 0.0, d: 0.0 };
        let reference = Chain::new(&[quarter, half]).unwrap();
        let single = Chain::new(&[quarter, half].map(|numbers| DenavitHartenberg {
            alpha: numbers.alpha as f32,
            a: 0.0_f32,
            d: 0.0,
        }));
        assert_eq!(reference.numbers()[0].1, 0.0);
        assert_eq!(reference.numbers()[1].0, 0.0);
        assert_eq!(single, Ok(reference.convert::<f32>()));
    }

    #[test]
    fn a_frame_is_the_product_of_the_four_elementary_motions() {
        let mut random = TestRandom::new(81);
        for _ in 0..20 {
            let [alpha, a, q, d] =
                [random.within(3.0), random.within(1.0), random.within(3.0), random.within(1.0)];
            let shift = |x: f64, z: f64| Matrix4::new_translation(&Vector3::new(x, 0.0, z));
            let turn = |axis: Vector3<f64>| Matrix4::from_scaled_axis(axis);
            let product = turn(Vector3::x() * alpha) * shift(a, 0.0) * turn(Vector3::z() * q) * shift(0.0, d);
            let frame = Chain::new(&[DenavitHartenberg { alpha, a, d }]).unwrap().frames(&[q])[0];
            let v = Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
            let expected = product.transform_point(&v.into()).coords;
            // A few roundings of numbers up to 2.
            assert!((frame.to_parent(&v) + frame.origin - expected).abs().max() < 1e-15);
            assert!((frame.to_child(&frame.to_parent(&v)) - v).abs().max() < 1e-15);
        }
    }
}
