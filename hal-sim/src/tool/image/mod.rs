//! The flash image seen from the host: the leg it is built for, its build, its size, and the way onto a board.
//!
//! | module | what lives there |
//! | --- | --- |
//! | [`leg_source`] | a leg file as the constant that an image holds |
//! | [`build`] | the build, by `scripts/firmware-build`; flashing by `probe-rs` |
//! | [`size`] | sections, memory, largest symbols, and the goals |
//! | [`panics`] | where an image can panic, and what its interrupts reach of it |

pub mod build;
pub mod leg_source;
pub mod panics;
pub mod size;
