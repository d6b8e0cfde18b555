//! Flash image on the host: its leg, build and size, and flashing.
//!
//! | module | contents |
//! | --- | --- |
//! | [`leg_source`] | a leg file as the constant of an image |
//! | [`build`] | the build, by `scripts/firmware-build`; flashing by `probe-rs` |
//! | `seal` | check sum of an image, and the program for an update over the bus |
//! | [`size`] | sections, memory, largest symbols, and the goals |
//! | [`panics`] | locations at which an image can panic, and those within its interrupts |

pub mod build;
pub mod leg_source;
pub mod panics;
pub(crate) mod seal;
pub mod size;
