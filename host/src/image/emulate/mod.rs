//! The whole firmware on an emulated Cortex-M4F (`cargo emulate`): build, run, decode.
//!
//! | step | implementation |
//! | --- | --- |
//! | leg and plant as constants | `image::leg_source`, [`plant_source`] |
//! | build | `scripts/firmware-build` |
//! | run | `qemu-system-arm -M netduinoplus2 -icount shift=3`: 8 ns per instruction, so runs repeat exactly |
//! | decode | `trace`, as from a probe |
//! | crash, on request | [`crash`]: its evaluation |

pub mod crash;
pub mod plant_source;
pub mod report;
pub mod run;
