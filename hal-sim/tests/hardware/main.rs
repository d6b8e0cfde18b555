//! Simulated hardware: the plant against textbook formulas, and the firmware's calibration and assistance in
//! it. One program, so that the libraries are linked once.

mod assist;
mod calibration;
mod plant;

// The generated leg of `assist` names modules of the firmware by their path in that crate.
use scarab::{ident, leg, model, motion, motor, safety, units};
