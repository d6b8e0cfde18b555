//! Time of the model: whole ticks of 1/336 MHz.
//!
//! All clocks of the microcontroller are whole numbers of ticks: 2 at 168 MHz, 21 at 16 MHz (internal
//! oscillator), 42 at 8 MHz (crystal), 10,500 at 32 kHz (watchdog).

/// Instant or duration, ticks since power-on.
pub type Ticks = u64;

pub const TICK_HZ: u64 = 336_000_000;
/// Instant that never comes.
pub const NEVER: Ticks = u64::MAX;
/// Ticks of the processor's clock at 168 MHz.
pub const FULL_SPEED: Ticks = 2;

/// Converts seconds to ticks, rounded; negative and not finite durations are 0.
pub fn ticks(seconds: f64) -> Ticks {
    (seconds * TICK_HZ as f64).round() as Ticks
}

pub fn seconds(ticks: Ticks) -> f64 {
    ticks as f64 / TICK_HZ as f64
}

pub fn microseconds(ticks: Ticks) -> f64 {
    1e6 * seconds(ticks)
}
