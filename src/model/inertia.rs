//! Mass, centre of mass and inertia of a body, and its ten parameters about a joint frame's origin.
//!
//! Drawings and tables give inertia about the centre of mass. Torque is linear only in the inertia about the
//! joint's own origin. The parallel-axis theorem links the two.
//!
//! ```text
//! h = m c
//! I = I_c + m (c.c E - c c')
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | m, c | mass; centre of mass in the joint's frame | kg, m |
//! | I_c, I | inertia tensor about the centre of mass, about the frame's origin; tensor elements | kg m2 |
//! | h | first moment of mass: HX, HY, HZ | kg m |
//!
//! Source: Steiner's theorem. The paper's Eq. (4) swaps the two inertias' names and the two products of c.
//! Limits: no test here whether such a body can exist; `log_cholesky` has it.

use nalgebra::{Matrix3, Vector3};

use super::parameter::{JointParameters, Parameter};
use crate::real::{Real, is_finite};

/// Number of a link's inertial parameters, the first ones of a joint.
pub const INERTIAL_PARAMETERS: usize = 10;

/// XX XY XZ YY YZ ZZ HX HY HZ M about the joint frame's origin.
pub type InertialParameters<T> = [T; INERTIAL_PARAMETERS];

/// Rigid body in the terms of a drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody<T> {
    /// Mass, kg.
    pub mass: T,
    /// Centre of mass in the joint's frame, m.
    pub centre_of_mass: Vector3<T>,
    /// Tensor about the centre of mass, along the joint frame's axes, kg m2; symmetric.
    pub inertia: Matrix3<T>,
}

impl<T: Real> RigidBody<T> {
    /// Computes the ten parameters about the joint frame's origin. Parameters of bodies
    /// fixed to one another add up.
    pub fn to_parameters(&self) -> InertialParameters<T> {
        let h = self.centre_of_mass * self.mass;
        let inertia = self.inertia + steiner(&self.centre_of_mass, &h);
        [
            inertia.m11,
            inertia.m12,
            inertia.m13,
            inertia.m22,
            inertia.m23,
            inertia.m33,
            h.x,
            h.y,
            h.z,
            self.mass,
        ]
    }

    /// Computes the body with these parameters; `None` unless the mass is finite and positive.
    pub fn from_parameters(parameters: &InertialParameters<T>) -> Option<Self> {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
        if mass <= T::zero() || !is_finite(mass) {
            return None;
        }
        let h = Vector3::new(hx, hy, hz);
        let centre_of_mass = h / mass;
        let about_origin = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Some(Self { mass, centre_of_mass, inertia: about_origin - steiner(&centre_of_mass, &h) })
    }
}

/// m (c.c E - c c') from c and h = m c.
fn steiner<T: Real>(c: &Vector3<T>, h: &Vector3<T>) -> Matrix3<T> {
    Matrix3::from_diagonal_element(c.dot(h)) - c * h.transpose()
}

/// Inertial part of a joint's parameters.
pub fn inertial<T: Real>(parameters: &JointParameters<T>) -> InertialParameters<T> {
    let [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ..] = *parameters;
    [xx, xy, xz, yy, yz, zz, hx, hy, hz, m]
}

/// Joins a link's inertia and its drive to a joint's parameters. The drive: rotor inertia (kg m2), Coulomb (N
/// m), viscous (N m s/rad), offset (N m).
pub fn joint<T: Real>(link: &InertialParameters<T>, drive: &[T; 4]) -> JointParameters<T> {
    let [xx, xy, xz, yy, yz, zz, hx, hy, hz, m] = *link;
    let [ia, fc, fv, off] = *drive;
    [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ia, fc, fv, off]
}

/// Product I w: the inertia tensor about the frame's origin times a vector.
#[inline]
pub(super) fn angular_momentum<T: Real>(parameters: &JointParameters<T>, w: &Vector3<T>) -> Vector3<T> {
    let [xx, xy, xz, yy, yz, zz, ..] = *parameters;
    Vector3::new(
        xx * w.x + xy * w.y + xz * w.z,
        xy * w.x + yy * w.y + yz * w.z,
        xz * w.x + yz * w.y + zz * w.z,
    )
}

/// First moment of mass, kg m.
#[inline]
pub(super) fn first_moment<T: Real>(parameters: &JointParameters<T>) -> Vector3<T> {
    Vector3::new(
        parameters[Parameter::HX.index()],
        parameters[Parameter::HY.index()],
        parameters[Parameter::HZ.index()],
    )
}

#[cfg(test)]
mod tests {
    use super::super::testing::TestRandom;
    use super::*;

    /// Parameters of point masses by their definition, the integrals as sums.
    fn cloud(points: &[(f64, Vector3<f64>)]) -> InertialParameters<f64> {
        let sum = |of: &dyn Fn(&Vector3<f64>) -> f64| {
            points.iter().map(|(mass, position)| mass * of(position)).sum()
        };
        [
            sum(&|p| p.y * p.y + p.z * p.z),
            sum(&|p| -p.x * p.y),
            sum(&|p| -p.x * p.z),
            sum(&|p| p.x * p.x + p.z * p.z),
            sum(&|p| -p.y * p.z),
            sum(&|p| p.x * p.x + p.y * p.y),
            sum(&|p| p.x),
            sum(&|p| p.y),
            sum(&|p| p.z),
            sum(&|_| 1.0),
        ]
    }

    fn points(seed: u64) -> [(f64, Vector3<f64>); 12] {
        let mut random = TestRandom::new(seed);
        [(); 12].map(|()| {
            let position = Vector3::new(0.3 + random.within(0.2), random.within(0.2), random.within(0.1));
            (0.5 + random.within(0.4), position)
        })
    }

    #[test]
    fn parallel_axis_moves_inertia_as_a_cloud_of_points_does() {
        for seed in 31..41 {
            let points = points(seed);
            let about_origin = cloud(&points);
            let mass = about_origin[9];
            let centre = Vector3::new(about_origin[6], about_origin[7], about_origin[8]) / mass;
            let centred = cloud(&points.map(|(mass, position)| (mass, position - centre)));
            let [xx, xy, xz, yy, yz, zz, ..] = centred;
            let body = RigidBody {
                mass,
                centre_of_mass: centre,
                inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            };
            for (found, expected) in body.to_parameters().iter().zip(&about_origin) {
                // Sums of twelve numbers up to 3, rounded in another order.
                assert!((found - expected).abs() < 1e-14, "{found} against {expected}");
            }
            let back = RigidBody::from_parameters(&about_origin).unwrap();
            assert!((back.inertia - body.inertia).abs().max() < 1e-14);
            assert!((back.centre_of_mass - centre).abs().max() < 1e-15);
        }
    }

    #[test]
    fn a_body_without_mass_has_no_centre() {
        let mut parameters = cloud(&points(41));
        for mass in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            parameters[9] = mass;
            assert_eq!(RigidBody::from_parameters(&parameters), None);
        }
    }

    #[test]
    fn a_joint_is_its_link_and_its_drive() {
        let link = cloud(&points(42));
        let parameters = joint(&link, &[0.1, 3.0, 1.2, 0.5]);
        assert_eq!(inertial(&parameters), link);
        assert_eq!(parameters[Parameter::IA.index()..], [0.1, 3.0, 1.2, 0.5]);
    }
}
