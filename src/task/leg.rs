//! The leg this image is built for.
//!
//! The host tool writes the constant from a leg file, which `build.rs` selects.

use crate::leg::{Identification, LegConfiguration, MotionWindow};

pub use crate::leg::{BASE, JOINTS};

include!(env!("SCARAB_LEG_SOURCE"));

/// Taps of the filters.
pub const TAPS: usize = 256;
/// Filter outputs in progress for these taps.
pub const PENDING: usize = 26;

/// Configuration of the leg.
pub type Leg = LegConfiguration<JOINTS, BASE>;
/// Identification half of the leg.
pub type LegIdentification = Identification<JOINTS, BASE, TAPS, PENDING, &'static mut LegWindow>;
/// Window of motion blocks of the identification.
pub type LegWindow = MotionWindow<f32, JOINTS, BASE>;
