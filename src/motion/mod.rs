//! Commanded motion of a leg: motions proven to stay within limits, and a host's tick-by-tick commands.
//!
//! Why a separate module: identification needs exact derivatives of the command. A wearer must be safe before
//! the first tick: a motion stays in range. Every motion here is therefore closed-form with analytic
//! derivatives, and its bounds follow from its coefficients ([`Motion::prove`]), not from a trial.
//!
//! | part | content |
//! | --- | --- |
//! | [`Fourier`] | a periodic curve of `N` joints and `H` harmonics, one sine and cosine per evaluation |
//! | [`gait`] | the walking pattern of the paper, repaired and closed, as such a curve |
//! | [`Ramp`] | from a pose to a pose, at rest at both ends |
//! | [`Periodic`] | whole cycles of a curve, with blends from and to rest by ramping the phase's speed |
//! | [`Motion`] | any of these motions, or a pose held |
//! | `Course` | one joint, tick by tick, towards a target that may change at any time |
//! | [`ExcitationTable`] | a periodic motion as plain numbers, for a constant in an image |
//! | [`JointEnvelope`], [`Proof`] | bounds of a motion, and the proof that they lie within limits |
//!
//! Time is counted in servo ticks from the start of the motion, never in seconds as `f32`. After an hour a
//! second in `f32` has a resolution of 0.24 ms; a tick stays exact. Angles are those of the curve. The leg
//! converts a curve once ([`Fourier::mapped`]) to the model's D-H angles and commands those.

pub(crate) mod bounds;
pub(crate) mod course;
pub(crate) mod fourier;
pub mod gait;
pub(crate) mod periodic;
pub(crate) mod plan;
pub(crate) mod ramp;
pub(crate) mod table;

pub use bounds::{JointEnvelope, LimitViolation, Proof, Quantity};
pub(crate) use course::{Course, Rates};
pub use fourier::{Fourier, HARMONICS};
pub use periodic::{Periodic, Phase};
pub use plan::Motion;
pub use ramp::Ramp;
pub use table::ExcitationTable;

use crate::units::Second;
use core::num::NonZeroU32;

/// Commanded position and motion of `N` joints at one tick.
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
    /// State at rest in a pose, rad.
    pub const fn at_rest(position_rad: [f32; N]) -> Self {
        Self { position_rad, velocity_rad_per_s: [0.0; N], acceleration_rad_per_s2: [0.0; N] }
    }
}

/// Reason why a motion cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionError {
    /// A coefficient or pose of this joint (from 0) is not finite.
    NotFinite {
        /// Joint, counted from 0.
        joint: usize,
    },
    /// The period is not positive, shorter than two ticks, or longer than 2^24 ticks.
    Period,
    /// The blend is not positive or longer than 2^24 ticks.
    Blend,
    /// The number of cycles is zero, or so large that their ticks do not fit 32 bits.
    Cycles,
    /// The speed or acceleration allowed to this joint (from 0) is not positive.
    Rate {
        /// Joint, counted from 0.
        joint: usize,
    },
    /// The range given for this joint (from 0) is empty or not finite.
    Range {
        /// Joint, counted from 0.
        joint: usize,
    },
}

/// Largest number of ticks that is exact in `f32`.
const MOST_EXACT_TICKS: u32 = 1 << 24;

/// Nearest whole number of ticks; `None` below one tick, above 2^24, or for NaN.
fn whole_ticks(time: Second, rate_hz: u32) -> Option<NonZeroU32> {
    let ticks = time.0 * rate_hz as f32 + 0.5;
    let fits = ticks < MOST_EXACT_TICKS as f32;
    NonZeroU32::new(if fits { ticks as u32 } else { 0 })
}
