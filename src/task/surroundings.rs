//! Board functions used by the tasks, as values: so the same tasks run on the board and in the emulator.

use super::leg::JOINTS;
use crate::board::crash::Crash;
use crate::trace::Record;
use crate::units::Volt;

/// Functions and constants of one board.
#[derive(Clone, Copy)]
pub struct Surroundings {
    /// Clock in processor cycles (instructions in the emulator); wraps.
    pub clock: fn() -> u32,
    /// Frequency of that clock, Hz.
    pub clock_hz: u32,
    /// Deepest use of the stack so far, bytes.
    pub stack_used: fn() -> u32,
    /// Size of the stack, bytes.
    pub stack_bytes: fn() -> u32,
    /// Bus voltage per code; `None` where it is not measured.
    pub volt_per_code: Option<Volt>,
    /// Temperatures of both bridges and the chopper, degrees Celsius; NaN where not measured.
    pub temperatures_c: fn() -> [f32; JOINTS + 1],
    /// Duty of the brake resistor.
    pub chopper_duty: fn() -> f32,
    /// Called when a result has been reported completely.
    pub told: fn(),
}

/// Data of the records sent at the start.
#[derive(Clone, Copy)]
pub struct Introduction {
    /// Unique number of the board, lowest word first.
    pub unique: [u32; 3],
    /// Factory version: major, minor, voltage; 255 where nothing was written.
    pub version: [u8; 3],
    /// Reason of the last reset, as in records.
    pub reset: &'static str,
    /// Crash that ended the previous run.
    pub crash: Option<Record<JOINTS>>,
}

/// Converts a crash to its record.
#[must_use]
pub fn crashed(crash: &'static Crash) -> Record<JOINTS> {
    let Crash { pc, lr, status, address, line, released, kept, .. } = *crash;
    Record::Crash { cause: crash.cause(), pc, lr, status, address, line, file: crash.file(), released, kept }
}
