//! The leg this image is built for. The constant is written by the host tool from a leg file; `build.rs` says which.

use crate::leg::{Identification, LegConfiguration, MotionWindow};

include!(env!("SCARAB_LEG_SOURCE"));

/// Joints of a leg, and axes of the board.
pub const JOINTS: usize = 2;
/// Room for base parameters: two parallel axes.
pub const BASE: usize = 13;
/// Taps of the filters.
pub const TAPS: usize = 256;
/// Open outputs that go with them.
pub const PENDING: usize = 26;

/// What a leg is built from.
pub type Leg = LegConfiguration<JOINTS, BASE>;
/// The half that finds out.
pub type LegIdentification = Identification<JOINTS, BASE, TAPS, PENDING, &'static mut LegWindow>;
/// Its window.
pub type LegWindow = MotionWindow<f32, JOINTS, BASE>;
