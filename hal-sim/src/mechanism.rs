//! Rigid bodies of a leg by Lagrange's equations, in world coordinates.
//!
//! Why another formulation than the firmware's: an error in the Newton-Euler recursion or in a D-H frame
//! cannot repeat itself in energies and world vectors.
//!
//! Quantities at joint angles q, all in the world frame. The vector z_j is the unit vector of axis j, p_j a
//! point on it, c_i the centre of mass of link i. Further, I_i is the link's tensor about c_i, and g
//! gravity's acceleration.
//!
//! ```text
//! a_ij   = z_j x (c_i - p_j)                                  derivative of c_i by q_j (j <= i)
//! w_ij   = I_i z_j
//! M_jk   = sum_i m_i a_ij . a_ik + z_j . w_ik   (+ rotor inertia where j = k)
//! dM_jk/dq_l from  d(z_j)/dq_l  = z_l x z_j for l < j, else 0
//!                  d(a_ij)/dq_l = z_min(j,l) x a_i,max(j,l) for l <= i
//!                  d(I_i)/dq_l = [z_l] I_i - I_i [z_l] for l <= i;  all terms cancel for l <= min(j, k)
//! C_jl   = sum_k 1/2 (dM_jl/dq_k + dM_jk/dq_l - dM_kl/dq_j) v_k         Christoffel symbols times velocity
//! G_j    = dV/dq_j = -sum_i m_i g . a_ij,   V = -sum_i m_i g . c_i
//! torque = M qdd + C(q, v) v + G
//! ```
//!
//! Angles rad, torques N m.
//! Source: any text on analytical mechanics; the closed derivatives are derived above. The rotor turns with
//! its own joint only (no gyroscopic torque of a rotor carried by another link).
//! Cost for two joints: about 700 floating-point operations and two sine-cosine pairs.

use crate::conventions::{RigidLink, links_at_reference};
use crate::description::LegDescription;
use crate::maths::sin_cos;
use nalgebra::{Matrix3, Vector3};

/// Rigid links in series, 1 to 3 of them, moving under gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanism<const N: usize> {
    links: [RigidLink; N],
    gravity: Vector3<f64>,
}

/// The three terms of Lagrange's equations at one state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics<const N: usize> {
    /// M(q), kg m^2, symmetric.
    pub inertia: [[f64; N]; N],
    /// C(q, v), N m s: times a velocity, the Coriolis and centrifugal torque.
    pub coriolis: [[f64; N]; N],
    /// G(q), N m: torque that holds the leg against gravity.
    pub gravity: [f64; N],
}

/// Positions and axes in the world frame. Entries `[i][j]` are filled for j <= i.
struct Pose<const N: usize> {
    axis: [Vector3<f64>; N],
    centre: [Vector3<f64>; N],
    lever: [[Vector3<f64>; N]; N],
    spin: [[Vector3<f64>; N]; N],
}

impl<const N: usize> Mechanism<N> {
    /// Rigid bodies of a described leg.
    pub fn new(description: &LegDescription<N>) -> Self {
        const { assert!(1 <= N && N <= 3) };
        Self { links: links_at_reference(&description.joints), gravity: Vector3::from(description.gravity) }
    }

    #[inline(always)]
    fn pose(&self, angles: &[f64; N]) -> Pose<N> {
        let zero = Vector3::zeros();
        let mut pose =
            Pose { axis: [zero; N], centre: [zero; N], lever: [[zero; N]; N], spin: [[zero; N]; N] };
        let mut orientation = Matrix3::identity();
        let mut point = zero;
        let mut points = [zero; N];
        for i in 0..N {
            let link = &self.links[i];
            point += orientation * link.from_previous;
            points[i] = point;
            pose.axis[i] = orientation * link.axis;
            orientation *= turn_about(&link.axis, angles[i]);
            pose.centre[i] = point + orientation * link.to_centre;
            for j in 0..=i {
                pose.lever[i][j] = pose.axis[j].cross(&(pose.centre[i] - points[j]));
                pose.spin[i][j] = orientation * (link.inertia * orientation.tr_mul(&pose.axis[j]));
            }
        }
        pose
    }

    /// Inertia matrix, Coriolis matrix and gravity torque at joint angles (rad) and rates (rad/s).
    #[inline(always)]
    pub fn dynamics(&self, angles: &[f64; N], rates: &[f64; N]) -> Dynamics<N> {
        let pose = self.pose(angles);
        let mut inertia = [[0.0; N]; N];
        let mut gravity = [0.0; N];
        // `slope[l][j][k]` is dM_jk/dq_l.
        let mut slope = [[[0.0; N]; N]; N];
        for i in 0..N {
            let mass = self.links[i].mass;
            let (lever, spin) = (&pose.lever[i], &pose.spin[i]);
            for j in 0..=i {
                gravity[j] -= mass * self.gravity.dot(&lever[j]);
                for k in 0..=j {
                    inertia[j][k] += mass * lever[j].dot(&lever[k]) + pose.axis[k].dot(&spin[j]);
                    for l in k + 1..=i {
                        let (first, last) = if l < j { (l, j) } else { (j, l) };
                        let lever_j_turned = pose.axis[first].cross(&lever[last]);
                        let lever_k_turned = pose.axis[k].cross(&lever[l]);
                        let mut change =
                            mass * (lever_j_turned.dot(&lever[k]) + lever[j].dot(&lever_k_turned));
                        change += pose.axis[k].cross(&pose.axis[l]).dot(&spin[j]);
                        if j < l {
                            change += pose.axis[j].cross(&pose.axis[l]).dot(&spin[k]);
                        }
                        slope[l][j][k] += change;
                    }
                }
            }
        }
        for j in 0..N {
            inertia[j][j] += self.links[j].rotor_inertia;
            for k in 0..j {
                inertia[k][j] = inertia[j][k];
                for l in 0..N {
                    slope[l][k][j] = slope[l][j][k];
                }
            }
        }
        Dynamics { inertia, coriolis: christoffel_times(&slope, rates), gravity }
    }

    /// Torque of the rigid bodies and rotors for a motion, without friction: rad, rad/s, rad/s^2 to N m.
    pub fn inverse_dynamics(
        &self,
        angles: &[f64; N],
        rates: &[f64; N],
        accelerations: &[f64; N],
    ) -> [f64; N] {
        let dynamics = self.dynamics(angles, rates);
        let inertial = times(&dynamics.inertia, accelerations);
        let coriolis = times(&dynamics.coriolis, rates);
        core::array::from_fn(|j| inertial[j] + coriolis[j] + dynamics.gravity[j])
    }

    /// Position of a point of the last link at joint angles (rad), and its derivative by each joint, m/rad.
    /// The point is given from the last joint in the world frame at the reference pose, m.
    pub(crate) fn point_of_last_link(
        &self,
        angles: &[f64; N],
        from_joint: &Vector3<f64>,
    ) -> (Vector3<f64>, [Vector3<f64>; N]) {
        let mut orientation = Matrix3::identity();
        let (mut points, mut axes) = ([Vector3::zeros(); N], [Vector3::zeros(); N]);
        let mut point = Vector3::zeros();
        for (joint, link) in self.links.iter().enumerate() {
            point += orientation * link.from_previous;
            points[joint] = point;
            axes[joint] = orientation * link.axis;
            orientation *= turn_about(&link.axis, angles[joint]);
        }
        let end = point + orientation * from_joint;
        (end, core::array::from_fn(|joint| axes[joint].cross(&(end - points[joint]))))
    }

    /// Unit vector against gravity; zero without gravity.
    pub(crate) fn up(&self) -> Vector3<f64> {
        self.gravity.try_normalize(0.0).map_or_else(Vector3::zeros, |down| -down)
    }

    /// Kinetic energy of bodies and rotors, J.
    pub fn kinetic_energy(&self, angles: &[f64; N], rates: &[f64; N]) -> f64 {
        let momentum = times(&self.dynamics(angles, rates).inertia, rates);
        (0..N).map(|j| 0.5 * momentum[j] * rates[j]).sum()
    }

    /// Potential energy in gravity, J; zero where all centres of mass lie at the base's origin.
    pub fn potential_energy(&self, angles: &[f64; N]) -> f64 {
        let pose = self.pose(angles);
        (0..N).map(|i| -self.links[i].mass * self.gravity.dot(&pose.centre[i])).sum()
    }
}

/// Rotation about a unit vector by an angle in rad (Rodrigues).
#[inline(always)]
fn turn_about(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (sine, cosine) = sin_cos(angle);
    let rest = *axis * (1.0 - cosine);
    let (x, y, z) = (axis.x, axis.y, axis.z);
    Matrix3::new(
        cosine + rest.x * x,
        rest.x * y - sine * z,
        rest.x * z + sine * y,
        rest.x * y + sine * z,
        cosine + rest.y * y,
        rest.y * z - sine * x,
        rest.x * z - sine * y,
        rest.y * z + sine * x,
        cosine + rest.z * z,
    )
}

#[inline(always)]
fn christoffel_times<const N: usize>(slope: &[[[f64; N]; N]; N], rates: &[f64; N]) -> [[f64; N]; N] {
    let mut coriolis = [[0.0; N]; N];
    for j in 0..N {
        for l in 0..N {
            for k in 0..N {
                coriolis[j][l] += 0.5 * (slope[k][j][l] + slope[l][j][k] - slope[j][k][l]) * rates[k];
            }
        }
    }
    coriolis
}

/// Matrix times vector.
#[inline(always)]
pub(crate) fn times<const N: usize>(matrix: &[[f64; N]; N], vector: &[f64; N]) -> [f64; N] {
    core::array::from_fn(|row| (0..N).map(|column| matrix[row][column] * vector[column]).sum())
}
