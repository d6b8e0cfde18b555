//! Inverse dynamics of a chain in double precision, linear in the parameters of its links.
//!
//! Why one of its own: the battery judges the firmware, and an identified model has values for base
//! parameters only, which no mass and centre of mass express.
//!
//! ```text
//! w_i = R' w_(i-1) + qd z        v_i = R' (v_(i-1) + w'_(i-1) x p + w_(i-1) x (w_(i-1) x p)),   v_0 = -g
//! f = M v + w' x h + w x (w x h)              n = I w' + w x I w + h x v          (v, w' accelerations)
//! torque = z . (n + moments of the later links) + IA qdd + FC sgn(qd) + FV qd + OFF
//! ```
//!
//! Source: recursive Newton-Euler algorithm (Luh, Walker, Paul 1980) in modified D-H frames (Khalil, Craig).

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, Vector3};
use scarab_identify::formats::leg_file::LegFile;

/// Parameters of a link, in the order of [`Link::parameters`].
const SYMBOLS: [&str; 14] =
    ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "HX", "HY", "HZ", "M", "IA", "FC", "FV", "OFF"];

/// Values by name: `ZZ1`, `FC2`.
pub(super) type Values = BTreeMap<String, f64>;

/// Angles, rates and accelerations of all joints at one instant, in D-H signs: rad, s.
pub(super) type State = [Vec<f64>; 3];

/// Motion of the base about its z axis: angle, rate, acceleration.
pub(super) type Sway = [f64; 3];

/// Frame and parameters of one link.
#[derive(Clone, Debug)]
struct Link {
    twist: Rotation3<f64>,
    origin: Vector3<f64>,
    parameters: [f64; 14],
}

/// Links in series.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    links: Vec<Link>,
    gravity: Vector3<f64>,
}

/// True values of a leg file's parameters, inertia about the joint.
pub(super) fn truth(leg: &LegFile) -> Values {
    let bodies = leg.joints.iter().enumerate().filter_map(|(at, joint)| Some((at + 1, joint.truth?)));
    let values = bodies.flat_map(|(number, body)| {
        let (m, [x, y, z], [xx, xy, xz, yy, yz, zz]) = (body.mass, body.com, body.inertia_com);
        let about = [
            xx + m * (y * y + z * z),
            xy - m * x * y,
            xz - m * x * z,
            yy + m * (x * x + z * z),
            yz - m * y * z,
            zz + m * (x * x + y * y),
        ];
        let drive = [body.rotor_inertia, body.coulomb, body.viscous, body.offset];
        let all = about.into_iter().chain([m * x, m * y, m * z, m]).chain(drive);
        SYMBOLS.into_iter().zip(all).map(move |(symbol, value)| (format!("{symbol}{number}"), value))
    });
    values.collect()
}

impl Chain {
    /// Chain with the geometry of a leg file; absent values are zero.
    pub(super) fn new(leg: &LegFile, values: &Values) -> Self {
        let links = leg.joints.iter().enumerate().map(|(at, joint)| {
            let twist = Rotation3::from_axis_angle(&Vector3::x_axis(), joint.dh.twist());
            let origin = Vector3::x() * joint.dh.a + twist * Vector3::z() * joint.dh.d;
            let value = |symbol: &str| values.get(&format!("{symbol}{}", at + 1)).copied().unwrap_or(0.0);
            Link { twist, origin, parameters: SYMBOLS.map(value) }
        });
        Self { links: links.collect(), gravity: leg.gravity.into() }
    }

    /// Torque of each joint, N m, with the base at rest or swaying.
    pub(super) fn torque(&self, [q, qd, qdd]: &State, [lean, rate, acceleration]: Sway) -> Vec<f64> {
        let z = Vector3::z();
        let (mut w, mut dw) = (z * rate, z * acceleration);
        let mut dv = -(Rotation3::from_axis_angle(&Vector3::z_axis(), -lean) * self.gravity);
        let mut passed = Vec::with_capacity(self.links.len());
        for (joint, link) in self.links.iter().enumerate() {
            let turn = link.twist * Rotation3::from_axis_angle(&Vector3::z_axis(), q[joint]);
            let back = turn.inverse();
            dv = back * (dv + dw.cross(&link.origin) + w.cross(&w.cross(&link.origin)));
            let carried = back * w;
            dw = back * dw + carried.cross(&z) * qd[joint] + z * qdd[joint];
            w = carried + z * qd[joint];
            let [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ..] = link.parameters;
            let (inertia, h) = (Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz), Vector3::new(hx, hy, hz));
            let force = dv * m + dw.cross(&h) + w.cross(&w.cross(&h));
            let moment = inertia * dw + w.cross(&(inertia * w)) + h.cross(&dv);
            passed.push((turn, force, moment));
        }
        let mut torque = vec![0.0; passed.len()];
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (joint, (turn, own_force, own_moment)) in passed.into_iter().enumerate().rev() {
            force += own_force;
            moment += own_moment;
            let [.., ia, fc, fv, off] = self.links[joint].parameters;
            let friction = if qd[joint] == 0.0 { 0.0 } else { fc * qd[joint].signum() };
            torque[joint] = moment.z + ia * qdd[joint] + friction + fv * qd[joint] + off;
            force = turn * force;
            moment = turn * moment + self.links[joint].origin.cross(&force);
        }
        torque
    }
}

#[cfg(test)]
mod tests {
    use super::{Chain, truth};
    use scarab_identify::formats::leg_file::LegFile;

    #[test]
    fn the_torque_of_a_pendulum_is_that_of_its_closed_form() {
        let text = "name = \"p\"\ngravity = [9.81, 0.0, 0.0]\n[[joint]]\nname = \"j\"\n\
             dh = { alpha = 0.0, a = 0.0, d = 0.0 }\ntruth = { mass = 2.0, com = [0.3, 0.0, 0.1], inertia_com = \
             [0.02, 0.0, 0.0, 0.03, 0.0, 0.025], rotor_inertia = 0.1, coulomb = 0.7, viscous = 0.4, offset = 0.2 }";
        let leg = LegFile::parse(text, "p").expect("a leg");
        for (q, qd, qdd) in [(0.0, 0.0, 3.0), (0.6, -2.0, 1.0), (-2.0, 1.5, -4.0)] {
            let friction = if qd == 0.0 { 0.0 } else { 0.7 * f64::signum(qd) + 0.4 * qd };
            let closed =
                (0.025 + 2.0 * 0.3 * 0.3 + 0.1) * qdd + 2.0 * 9.81 * 0.3 * f64::sin(q) + friction + 0.2;
            let found = Chain::new(&leg, &truth(&leg)).torque(&[vec![q], vec![qd], vec![qdd]], [0.0; 3]);
            assert!((found[0] - closed).abs() < 1e-12, "{} instead of {closed}", found[0]);
        }
    }
}
