//! Serial chain: torque of each joint for a motion, and the parameters that this torque determines.
//!
//! Every module that predicts or explains torque uses this one, so the conventions are fixed once:
//!
//! - **Frames**: modified Denavit-Hartenberg (Khalil, Craig), see [`Chain`]. Joint
//!   i turns about z of frame i.
//! - **Parameters**: 14 per joint in the order of [`Parameter`]. The ten inertial ones are about the origin
//!   of the joint's frame, in that frame, and inertias are ELEMENTS of the tensor (XY = -integral of x y dm).
//! - **Gravity** is an argument: the acceleration vector in the base frame, m/s2. It turns with the trunk.
//! - **Angles** in this module are the chain's; [`AnatomicalJoint`] converts from and to flexion.
//!
//! ```text
//! torque = regressor(chain, q, qd, qdd, gravity) . parameters
//! ```
//!
//! All code is generic over the scalar ([`crate::real::Real`]: `f32` on the board, `f64` for reference) and
//! the number of joints.

pub(crate) mod anatomy;
pub(crate) mod base;
pub(crate) mod chain;
pub mod fingerprint;
pub mod friction;
pub mod inertia;
mod kinematics;
pub(crate) mod log_cholesky;
pub mod mass_matrix;
pub(crate) mod newton_euler;
pub(crate) mod parameter;
pub(crate) mod payload;
pub mod planar;
pub mod regressor;
#[cfg(test)]
pub(crate) mod testing;

pub use anatomy::{AnatomicalJoint, AnatomyError};
pub use base::{BaseError, BaseParameters, ColumnMask, Separation, Standing, regroup};
pub use chain::{Chain, ChainError, DenavitHartenberg};
pub use fingerprint::Fingerprint;
pub use inertia::{INERTIAL_PARAMETERS, InertialParameters, RigidBody};
pub(crate) use log_cholesky::LogCholesky;
pub use log_cholesky::is_physically_consistent;
pub use mass_matrix::mass_matrix;
pub use newton_euler::{JointState, joint_torques, rigid_body_torques};
pub use parameter::{JointParameters, LegParameters, PARAMETERS_PER_JOINT, Parameter, RegressorRow};
pub use payload::Payload;
pub use regressor::regressor;
pub(crate) use regressor::row_torque;
