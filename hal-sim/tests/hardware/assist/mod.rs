//! Assistance of the firmware's leg on a simulated wearer with a body of their own.
//!
//! The plant gives what no drive can measure: the torque between exoskeleton and wearer, the muscles' torque,
//! and the energy that has passed the cuffs. The models are the true ones; identified ones are those of the
//! host tool's experiments.
#![expect(clippy::disallowed_methods, reason = "expected values by another library than the plant's")]

mod bench;
mod energy;
mod periodic;
mod session;
mod transparent;
mod weight;

use hal_sim::wearer::motion::{Gait, IntendedMotion};
use scarab::leg::AssistShares;

mod x2 {
    include!("../../../../host/legs/x2-wearer-75kg.rs");
}

/// Hip and knee at the start of a test, rad.
const POSTURE: [f64; 2] = [0.5, 0.6];
/// Friction and half of the inertia compensated.
const HALF: AssistShares = AssistShares { friction: 1.0, inertia: 0.5, ..AssistShares::GRAVITY_ONLY };
/// Friction and four fifths of the inertia compensated.
const MOST: AssistShares = AssistShares { inertia: 0.8, ..HALF };

/// Walking in the air, with angles that keep speeds below 3.5 rad/s and joints away from the ends of their
/// ranges.
fn gait(cadence_hz: f64) -> Gait {
    Gait { offset: [0.33, 0.5], scale: [f64::min(0.7, 0.45 / cadence_hz); 2], ..Gait::at_cadence(cadence_hz) }
}

fn walking(cadence_hz: f64) -> IntendedMotion {
    IntendedMotion::Gait(gait(cadence_hz))
}
