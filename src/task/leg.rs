//! The leg this image is built for.
//!
//! The host tool writes the constant from a leg file, which `build.rs` selects.

use crate::leg::{Identification, LegConfiguration, MotionWindow};

include!(env!("SCARAB_LEG_SOURCE"));

/// Joints of a leg, and axes of the board.
pub const JOINTS: usize = 2;
/// Capacity for base parameters: two parallel axes.
pub const BASE: usize = 13;
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
