//! Serial chain: what torque each joint of a leg needs for a motion, and which parameters that torque can tell.
//!
//! Every room that predicts or explains torque goes through here, so the conventions are fixed once:
//!
//! - **Frames**: modified Denavit-Hartenberg (Khalil, Craig), see [`chain`]. Joint i turns about z of frame i.
//! - **Parameters**: 14 per joint in the order of [`Parameter`]. The ten inertial ones are about the origin of the
//!   joint's frame, in that frame, and inertias are ELEMENTS of the tensor (XY = -integral of x y dm).
//! - **Gravity** is an argument: the acceleration vector in the base frame, m/s2. It turns with the trunk.
//! - **Angles** in here are the chain's; [`anatomy`] converts from and to flexion.
//!
//! ```text
//! torque = regressor(chain, q, qd, qdd, gravity) . parameters
//! ```
//!
//! Everything is generic over the scalar ([`crate::real::Real`]: `f32` on the board, `f64` for reference) and the
//! number of joints.

pub mod anatomy;
pub mod base;
pub mod chain;
pub mod fingerprint;
pub mod friction;
pub mod inertia;
mod kinematics;
pub mod log_cholesky;
pub mod mass_matrix;
pub mod newton_euler;
pub mod parameter;
pub mod payload;
pub mod regressor;
#[cfg(test)]
mod testing;

pub use anatomy::AnatomicalJoint;
pub use base::{BaseError, BaseParameters, ColumnMask, Standing, regroup};
pub use chain::{Chain, ChainError, DenavitHartenberg};
pub use fingerprint::Fingerprint;
pub use inertia::{INERTIAL_PARAMETERS, InertialParameters, RigidBody};
pub use log_cholesky::{LogCholesky, is_physically_consistent};
pub use mass_matrix::mass_matrix;
pub use newton_euler::{JointState, joint_torques, rigid_body_torques};
pub use parameter::{JointParameters, LegParameters, PARAMETERS_PER_JOINT, Parameter, RegressorRow};
pub use payload::Payload;
pub use regressor::{regressor, row_torque};
