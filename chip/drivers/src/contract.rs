//! Agreement between the program and its check (`cargo chip drivers`).
//!
//! The program counts its steps in `DRIVERS_STEP` and waits at each until `DRIVERS_GO` has the same value.
//! Results go to `DRIVERS_RESULTS`, their number to `DRIVERS_COUNT`.

/// Added to a release: feed the watchdog once after its start.
pub const FED: u32 = 0x100;
/// Words that are written to flash.
pub const STORED: [u32; 4] = [0x0123_4567, 0x89AB_CDEF, 0xFFFF_0000, 0x5555_AAAA];
