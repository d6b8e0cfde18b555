//! Stick figure: joints and tip of a leg in a vertical plane.
//!
//! The plane contains gravity and is normal to the last joint's axis at zero angles. The last link points to
//! its centre of mass, and is drawn as long as the shank (`segments`) or as the link before it.

use nalgebra::{Matrix3, Vector3};

use crate::formats::leg_file::{DhFile, LegFile};

/// Length of a drawn link whose length is unknown, m.
const UNKNOWN_LENGTH: f64 = 0.4;
/// Lengths and shares below this are zero.
const NOTHING: f64 = 1e-3;

/// Geometry of the figure.
#[derive(Clone, Debug)]
pub struct Stick {
    joints: Vec<DhFile>,
    /// To the right and downwards, in the base frame.
    view: [Vector3<f64>; 2],
    /// Tip in the last joint's frame, m.
    tip: Vector3<f64>,
}

/// Rotation and position of a joint's frame in the previous one.
fn placed(joint: &DhFile, angle: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let ((sa, ca), (sq, cq)) = (joint.twist().sin_cos(), angle.sin_cos());
    let rotation = Matrix3::new(cq, -sq, 0.0, sq * ca, cq * ca, -sa, sq * sa, cq * sa, ca);
    (rotation, Vector3::new(joint.a, -joint.d * sa, joint.d * ca))
}

impl Stick {
    /// Figure of a leg.
    pub fn from_leg(leg: &LegFile) -> Self {
        let joints: Vec<DhFile> = leg.joints.iter().map(|joint| joint.dh).collect();
        let last = leg.joints.last();
        let along = last.and_then(|joint| joint.truth.as_ref().or(joint.prior.as_ref())).map(|link| link.com);
        let along = Vector3::from(along.unwrap_or_default());
        let along = if along.norm() > NOTHING { along.normalize() } else { Vector3::x() };
        let before = joints.iter().map(|joint| joint.a.hypot(joint.d)).rfind(|length| *length > NOTHING);
        let shank = leg.segments.map(|segments| segments.shank_m).or(before).unwrap_or(UNKNOWN_LENGTH);
        let axis = joints.iter().fold(Matrix3::identity(), |frame, joint| frame * placed(joint, 0.0).0)
            * Vector3::z();
        let gravity = Vector3::from(leg.gravity);
        // Without gravity in the plane the base's x axis points down, or its y axis.
        let down = [gravity, Vector3::x(), Vector3::y()]
            .into_iter()
            .map(|vector| vector - axis * axis.dot(&vector))
            .find(|vector| vector.norm() > NOTHING)
            .map_or_else(Vector3::x, |vector| vector.normalize());
        Self { joints, view: [axis.cross(&down), down], tip: along * shank }
    }

    /// Joints and tip for angles of the chain, rad.
    pub fn points(&self, angles_rad: &[f64]) -> Vec<[f32; 2]> {
        let (mut frame, mut position) = (Matrix3::identity(), Vector3::zeros());
        let mut points = Vec::with_capacity(self.joints.len() + 1);
        let seen = |position: &Vector3<f64>| self.view.map(|axis| axis.dot(position) as f32);
        for (joint, angle) in self.joints.iter().zip(angles_rad) {
            let (rotation, offset) = placed(joint, *angle);
            position += frame * offset;
            frame *= rotation;
            points.push(seen(&position));
        }
        points.push(seen(&(position + frame * self.tip)));
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::leg_file::{DEFAULT_LEG, SHIPPED_LEGS};

    #[test]
    fn the_default_leg_hangs_and_bends_forwards_at_the_hip() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let stick = Stick::from_leg(&leg);
        let thigh = leg.joints[1].dh.a as f32;
        let hanging = stick.points(&[0.0, 0.0]);
        assert_eq!(hanging[..2], [[0.0, 0.0], [0.0, thigh]]);
        assert!(hanging[2][1] > thigh, "{hanging:?}");
        let raised = stick.points(&[core::f64::consts::FRAC_PI_2, 0.0]);
        assert!((raised[1][0] - thigh).abs() < 1e-6 && raised[1][1].abs() < 1e-6, "{raised:?}");
    }

    #[test]
    fn every_shipped_leg_has_a_figure_with_links() {
        for (name, _) in SHIPPED_LEGS {
            let leg = LegFile::load(name).expect("shipped");
            let points = Stick::from_leg(&leg).points(&vec![0.3; leg.joints.len()]);
            assert_eq!(points.len(), leg.joints.len() + 1, "{name}");
            let [.., before, tip] = points[..] else { panic!("{name}: {points:?}") };
            assert!((tip[0] - before[0]).hypot(tip[1] - before[1]) > 0.05, "{name}: {points:?}");
        }
    }
}
