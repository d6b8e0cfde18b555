//! Results of simulated experiments, as data.
//!
//! | module | experiment |
//! | --- | --- |
//! | [`assist`] | an assisted wearer |
//! | [`monitor`] | a watched model |
//! | [`motor`] | a motor on the stand |

pub mod assist;
pub mod monitor;
pub mod motor;
