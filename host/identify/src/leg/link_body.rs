//! Rigid bodies of a leg file's links: sums, differences and segments of a wearer.

use nalgebra::{Matrix3, Vector3};
use scarab::model::RigidBody;

use crate::formats::anthropometry::{Segment, joined};
use crate::formats::leg_file::LinkParameters;

/// Rigid body of mass (kg), centre of mass (m) and tensor elements XX XY XZ YY YZ ZZ about it (kg m^2).
pub(super) fn body(mass: f64, com: [f64; 3], [xx, xy, xz, yy, yz, zz]: [f64; 6]) -> RigidBody<f64> {
    RigidBody {
        mass,
        centre_of_mass: Vector3::from(com),
        inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    }
}

/// Body that remains without a part.
pub(super) fn difference(whole: &RigidBody<f64>, part: &RigidBody<f64>) -> Option<RigidBody<f64>> {
    let (mut left, part) = (whole.to_parameters(), part.to_parameters());
    left.iter_mut().zip(part).for_each(|(left, part)| *left -= part);
    RigidBody::from_parameters(&left)
}

/// Link without segments of a wearer; `None` if no mass remains.
pub(super) fn without(link: &LinkParameters, segments: &[Segment]) -> Option<RigidBody<f64>> {
    let (mass, com, inertia) = joined(segments);
    difference(&body(link.mass, link.com, link.inertia_com), &body(mass, com, inertia))
}

/// Link with segments of a wearer added to a body.
pub(super) fn joined_with(machine: &RigidBody<f64>, segments: &[Segment]) -> Option<RigidBody<f64>> {
    let (mass, com, inertia) = joined(segments);
    difference(machine, &body(-mass, com, inertia.map(|element| -element)))
}

/// Rotor and friction of a link with a new body.
pub(super) fn linked(link: &LinkParameters, body: &RigidBody<f64>) -> LinkParameters {
    let tensor = &body.inertia;
    LinkParameters {
        mass: body.mass,
        com: body.centre_of_mass.into(),
        inertia_com: [tensor.m11, tensor.m12, tensor.m13, tensor.m22, tensor.m23, tensor.m33],
        ..*link
    }
}
