//! The identified model at work: what the compensation leaves of the torque between exoskeleton and wearer.
//!
//! | part | contents |
//! | --- | --- |
//! | `draws` | random wearers and exoskeletons |
//! | `energy` | energy given to limp and resisting wearers; legs at rest |
//! | [`subject`] | leg, wearer, and the models identified of both |
//! | [`trial`] | one run of leg and wearer |
//! | [`study`] | every mode, motion and comparison over all seeds |
//! | `periodic` | locking, effort and stopping of a periodic motion |
//! | `stability` | largest stable share of inertia over stiffness and damping of the cuffs |

pub(crate) mod draws;
pub(crate) mod energy;
pub(crate) mod periodic;
pub(crate) mod stability;
pub mod study;
pub mod subject;
pub mod trial;
