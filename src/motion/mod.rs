//! What a leg is told to do: motions that start and end at rest and are proved to stay within limits, and what a host
//! commands tick by tick.
//!
//! Why a room of its own: identification needs exact derivatives of what was commanded, and a wearer needs to know
//! before the first tick that a motion stays in range. So every motion here is closed-form, its derivatives are
//! derived and not differenced, and its bounds follow from its coefficients ([`Motion::prove`]), not from a try.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Fourier`] | a periodic curve of `N` joints and `H` harmonics, one sine and cosine per evaluation |
//! | [`gait`] | the walking pattern of the paper, repaired and closed, as such a curve |
//! | [`Ramp`] | from a pose to a pose, at rest at both ends |
//! | [`Periodic`] | whole cycles of a curve, entered and left at rest by ramping the speed of its phase |
//! | [`Motion`] | one of them, or a pose held |
//! | [`Course`] | one joint, tick by tick, towards a target that may change at any time |
//! | [`ExcitationTable`] | a periodic motion as plain numbers, for a constant in an image |
//! | [`JointEnvelope`], [`Proof`] | bounds of a motion, and the witness that they lie within limits |
//!
//! Time is counted in servo ticks from the start of the motion and never kept as seconds in `f32`: after an hour a
//! second in `f32` is 0.24 ms coarse, a tick is still a tick. Angles are whatever the curve was made of; the leg
//! converts a curve once ([`Fourier::mapped`]) to the model's D-H angles and commands those.

pub mod bounds;
pub mod course;
pub mod fourier;
pub mod gait;
pub mod periodic;
pub mod plan;
pub mod ramp;
pub mod table;

pub use bounds::{JointEnvelope, LimitViolation, Proof, Quantity};
pub use course::{Course, Rates};
pub use fourier::{Fourier, HARMONICS};
pub use periodic::{Periodic, Phase};
pub use plan::Motion;
pub use ramp::Ramp;
pub use table::ExcitationTable;

use crate::units::Second;
use core::num::NonZeroU32;

/// Where `N` joints are commanded to be, and how they are to move there, at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState<const N: usize> {
    /// Joint angles, rad.
    pub position_rad: [f32; N],
    /// Joint velocities, rad/s.
    pub velocity_rad_per_s: [f32; N],
    /// Joint accelerations, rad/s^2.
    pub acceleration_rad_per_s2: [f32; N],
}

impl<const N: usize> MotionState<N> {
    /// Standing still in a pose, rad.
    #[must_use]
    pub const fn at_rest(position_rad: [f32; N]) -> Self {
        Self { position_rad, velocity_rad_per_s: [0.0; N], acceleration_rad_per_s2: [0.0; N] }
    }
}

/// Why a motion cannot be made from what was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionError {
    /// A coefficient or pose of this joint (from 0) is not finite.
    NotFinite {
        /// Counted from 0.
        joint: usize,
    },
    /// The period is not positive, shorter than two ticks, or longer than 2^24 ticks.
    Period,
    /// The blend is not positive or longer than 2^24 ticks.
    Blend,
    /// No cycles, or so many that their ticks do not fit 32 bits.
    Cycles,
    /// The speed or acceleration allowed to this joint (from 0) is not positive.
    Rate {
        /// Counted from 0.
        joint: usize,
    },
    /// The range given for this joint (from 0) is empty or not finite.
    Range {
        /// Counted from 0.
        joint: usize,
    },
}

/// Ticks up to here are exact in `f32`.
const MOST_EXACT_TICKS: u32 = 1 << 24;

/// The nearest whole number of ticks; `None` below one tick, above 2^24, or for what is not a number.
fn whole_ticks(time: Second, rate_hz: u32) -> Option<NonZeroU32> {
    let ticks = time.0 * rate_hz as f32 + 0.5;
    let fits = ticks < MOST_EXACT_TICKS as f32;
    NonZeroU32::new(if fits { ticks as u32 } else { 0 })
}
