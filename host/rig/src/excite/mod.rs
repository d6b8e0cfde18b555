//! Designs an exciting motion, predicts its result, and stores it as a file.
//!
//! | part | contents |
//! | --- | --- |
//! | [`assumption`] | leg assumed before the leg has moved |
//! | [`mod@bench`] | the assumed leg with everything that its motions need |
//! | `candidate` | coordinates in a box to a curve within angle, speed and acceleration |
//! | `score` | information and torque of a curve, cheaply |
//! | `demand` | torque of every tick, blends and approach included |
//! | [`design`] | the swarm over the curves |
//! | `expectation` | sigma and status of every parameter, through the firmware's own chain |
//! | `obstacle` | limit that a motion exceeds, in words |
//! | [`run`] | a designed or given motion with its report |
//! | `warnings` | read before the motion is run |

pub mod assumption;
pub mod bench;
pub(crate) mod candidate;
pub(crate) mod demand;
pub mod design;
pub(crate) mod expectation;
pub(crate) mod obstacle;
pub mod run;
pub(crate) mod score;
pub(crate) mod warnings;
