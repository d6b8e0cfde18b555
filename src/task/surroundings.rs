//! What the tasks ask of the board around them, as values: so the same tasks run on the board and in the emulator.

use super::leg::JOINTS;
use crate::board::crash::Crash;
use crate::trace::Record;
use crate::units::Volt;

/// One board, seen from above.
#[derive(Clone, Copy)]
pub struct Surroundings {
    /// Processor cycles (instructions in the emulator); wraps.
    pub clock: fn() -> u32,
    /// Of that clock, Hz.
    pub clock_hz: u32,
    /// Deepest use of the stack so far, bytes.
    pub stack_used: fn() -> u32,
    /// Of the stack.
    pub stack_bytes: fn() -> u32,
    /// Of the bus voltage's code; `None` where nothing measures it.
    pub volt_per_code: Option<Volt>,
    /// Of both bridges and the chopper, degrees Celsius; not a number where nothing measures it.
    pub temperatures_c: fn() -> [f32; JOINTS + 1],
    /// Share of the time for which the brake resistor is on.
    pub chopper_duty: fn() -> f32,
    /// A result has been told to its end.
    pub told: fn(),
}

/// What is told once at the start.
#[derive(Clone, Copy)]
pub struct Introduction {
    /// Unique number of the board, lowest word first.
    pub unique: [u32; 3],
    /// Factory's version: major, minor, voltage; 255 where nothing was written.
    pub version: [u8; 3],
    /// Why it started, a word.
    pub reset: &'static str,
    /// How the image before this one ended.
    pub crash: Option<Record<JOINTS>>,
}

/// A crash as it is told.
#[must_use]
pub fn crashed(crash: &'static Crash) -> Record<JOINTS> {
    let Crash { pc, lr, status, address, line, released, kept, .. } = *crash;
    Record::Crash { cause: crash.cause(), pc, lr, status, address, line, file: crash.file(), released, kept }
}
