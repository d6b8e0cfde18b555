//! Motion of the links: velocities and accelerations propagated from frame to frame.
//!
//! Newton-Euler and the regressor need the same three vectors per link, each in the link's own frame; gravity
//! enters as an upward acceleration of the base.
//!
//! ```text
//! w_i  = R' w + z qd
//! wd_i = R' wd + (R' w) x z qd + z qdd
//! a_i  = R' (a + wd x p + w x (w x p))              a_0 = -gravity
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | w, wd | angular velocity and acceleration of the link before | rad/s, rad/s2 |
//! | a | acceleration of its frame's origin, less gravity | m/s2 |
//! | R, p | frame i seen from the frame before, see [`super::chain`] | -, m |
//!
//! Source: J. Y. S. Luh, M. W. Walker and R. P. C. Paul, 1980; link frames as in
//! Craig 2005, Eqs (6.45)-(6.47).
//! Cost: about 70 multiplications and additions per link.

use nalgebra::Vector3;

use crate::real::Real;

/// Cross product a x b. `nalgebra`'s own checks its operands' shapes at every call in a size-optimised build.
#[inline(always)]
pub(super) fn cross<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// Sum a + b by component. In a size-optimised build `nalgebra`'s own is a loop over memory:
/// 45 instructions instead of 3.
#[inline(always)]
pub(super) fn sum<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x + b.x, a.y + b.y, a.z + b.z)
}

/// Product s a, for the reason given at [`sum`].
#[inline(always)]
pub(super) fn scaled<T: Real>(a: &Vector3<T>, s: T) -> Vector3<T> {
    Vector3::new(a.x * s, a.y * s, a.z * s)
}

/// A joint's frame seen from the frame before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointFrame<T> {
    pub(crate) sin_alpha: T,
    pub(crate) cos_alpha: T,
    pub(crate) sin_q: T,
    pub(crate) cos_q: T,
    /// Origin of the joint's frame, m.
    pub(crate) origin: Vector3<T>,
}

impl<T: Real> JointFrame<T> {
    /// Rotates a vector from the joint's frame to the frame before it: R v = Rx(alpha) Rz(q) v.
    #[inline(always)]
    pub(crate) fn to_parent(self, v: &Vector3<T>) -> Vector3<T> {
        let y = self.sin_q * v.x + self.cos_q * v.y;
        Vector3::new(
            self.cos_q * v.x - self.sin_q * v.y,
            self.cos_alpha * y - self.sin_alpha * v.z,
            self.sin_alpha * y + self.cos_alpha * v.z,
        )
    }

    /// Rotates a vector from the frame before to the joint's frame: R' v.
    #[inline(always)]
    pub(crate) fn to_child(self, v: &Vector3<T>) -> Vector3<T> {
        let y = self.cos_alpha * v.y + self.sin_alpha * v.z;
        Vector3::new(
            self.cos_q * v.x + self.sin_q * y,
            self.cos_q * y - self.sin_q * v.x,
            self.cos_alpha * v.z - self.sin_alpha * v.y,
        )
    }
}

/// Motion of a link in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinkMotion<T> {
    /// Angular velocity, rad/s.
    pub(crate) angular_velocity: Vector3<T>,
    /// Angular acceleration, rad/s2.
    pub(crate) angular_acceleration: Vector3<T>,
    /// Acceleration of the frame's origin, less gravity, m/s2.
    pub(crate) acceleration: Vector3<T>,
}

impl<T: Real> LinkMotion<T> {
    /// Motion of a base at rest under `gravity` (m/s2, base frame).
    #[inline]
    pub(crate) fn base(gravity: &Vector3<T>) -> Self {
        let zero = Vector3::new(T::zero(), T::zero(), T::zero());
        Self {
            angular_velocity: zero,
            angular_acceleration: zero,
            acceleration: Vector3::new(-gravity.x, -gravity.y, -gravity.z),
        }
    }

    /// Motion of the next link, across a joint with speed `qd` (rad/s) and acceleration `qdd` (rad/s2).
    #[inline(always)]
    pub(crate) fn next(&self, frame: JointFrame<T>, qd: T, qdd: T) -> Self {
        let carried = frame.to_child(&self.angular_velocity);
        let turned = frame.to_child(&self.angular_acceleration);
        let tangential = cross(&self.angular_acceleration, &frame.origin);
        let centripetal = cross(&self.angular_velocity, &cross(&self.angular_velocity, &frame.origin));
        let at_origin = sum(&sum(&self.acceleration, &tangential), &centripetal);
        Self {
            angular_velocity: Vector3::new(carried.x, carried.y, carried.z + qd),
            angular_acceleration: Vector3::new(
                turned.x + carried.y * qd,
                turned.y - carried.x * qd,
                turned.z + qdd,
            ),
            acceleration: frame.to_child(&at_origin),
        }
    }
}

/// Velocity of a link per unit speed of one joint before it: a column of the link's
/// Jacobian, in the link's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointAxis<T> {
    /// Direction of the joint's axis.
    pub(crate) angular: Vector3<T>,
    /// Velocity of the frame's origin, m.
    pub(crate) linear: Vector3<T>,
}

impl<T: Real> JointAxis<T> {
    /// Column for the link's own joint: it turns about z and leaves the origin at rest.
    #[inline]
    pub(crate) fn own() -> Self {
        Self {
            angular: Vector3::new(T::zero(), T::zero(), T::one()),
            linear: Vector3::new(T::zero(), T::zero(), T::zero()),
        }
    }

    /// Column of this axis in the frame of the next link.
    #[inline]
    pub(crate) fn next(&self, frame: JointFrame<T>) -> Self {
        Self {
            angular: frame.to_child(&self.angular),
            linear: frame.to_child(&sum(&self.linear, &cross(&self.angular, &frame.origin))),
        }
    }
}
