//! Turns samples into filtered signals: angle, speed, acceleration and torque of one past instant.
//!
//! | file | content | source |
//! | --- | --- | --- |
//! | `hampel` | outlier filter before all others | Hampel 1974 |
//! | `kernel` | a finite low-pass and its exact derivatives | Rabiner, Gold and McGonegal 1970 |
//! | `smoothing` | first filter step: angles through the kernel, torque delayed to the same instant | |
//! | `noise` | noise level of the torque from its own scatter | Jain and Chlamtac 1985 |

pub mod hampel;
pub(crate) mod kernel;
pub mod noise;
pub(crate) mod smoothing;
