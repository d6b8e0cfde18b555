//! The whole firmware on an emulated Cortex-M4F (`cargo emulate`): build, run, decode.
//!
//! | step | by |
//! | --- | --- |
//! | leg and plant as constants | `image::leg_source`, [`plant_source`] |
//! | build | `scripts/firmware-build` |
//! | run | `qemu-system-arm -M netduinoplus2 -icount shift=3`: 8 ns for each instruction, so every run is the same |
//! | decode | `trace`, as from a probe |
//! | where it was asked to crash | [`crash`]: what came of it |

pub mod crash;
pub mod plant_source;
pub mod report;
pub mod run;
