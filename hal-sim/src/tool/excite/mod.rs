//! Designs an exciting motion, predicts its result, and stores it as a file.
//!
//! | part | contents |
//! | --- | --- |
//! | [`assumption`] | leg assumed before the leg has moved |
//! | [`mod@bench`] | the assumed leg with everything that its motions need |
//! | [`candidate`] | coordinates in a box to a curve within angle, speed and acceleration |
//! | [`score`] | information and torque of a curve, cheaply |
//! | [`demand`] | torque of every tick, blends and approach included |
//! | [`design`] | the swarm over the curves |
//! | [`expectation`] | sigma and status of every parameter, through the firmware's own chain |
//! | [`mod@file`], [`constant`] | the motion as TOML, and as a constant for an image |
//! | [`run`] | a designed or given motion with its report |
//! | [`report`], [`text`] | its properties as data and in words |

pub mod assumption;
pub mod bench;
pub mod candidate;
pub mod constant;
pub mod demand;
pub mod design;
pub mod expectation;
pub mod file;
pub mod report;
pub mod run;
pub mod score;
pub mod text;
