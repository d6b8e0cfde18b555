//! Why nothing may be enabled: one word, in which every reason has a bit.
//!
//! As long as it is not zero the current loops release both bridges in every tick, and the servo keeps its drive off. Reasons
//! are raised anywhere and stay until the operator resets them; one that still holds is raised again in the next tick.

use core::sync::atomic::{AtomicU32, Ordering};

/// Why the drive is kept off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Cause {
    /// The emergency stop's contact is open.
    EmergencyStop,
    /// A gate driver reports a fault.
    GateFault,
    /// A gate driver does not hold its configuration.
    GateConfiguration,
    /// The first axis released itself.
    Axis1,
    /// The second axis did.
    Axis2,
    /// A bridge is too hot.
    Temperature,
    /// A thermistor is open or shorted.
    Thermistor,
    /// Current ticks came late three times in a row.
    CurrentTicks,
    /// The servo did not answer three times in a row.
    ServoTicks,
    /// One shunt's conversion ended without the other's.
    Conversion,
    /// The image before this one crashed.
    Crash,
    /// The watchdog bit.
    Watchdog,
    /// The bridges' timers are not in phase.
    Timers,
    /// The factory's version does not tell the divider of the bus voltage.
    BoardVersion,
    /// The constants of an axis or of the leg make no sense.
    Configuration,
}

impl Cause {
    /// All of them, in the order of their bits.
    pub const ALL: [Self; 15] = [
        Self::EmergencyStop,
        Self::GateFault,
        Self::GateConfiguration,
        Self::Axis1,
        Self::Axis2,
        Self::Temperature,
        Self::Thermistor,
        Self::CurrentTicks,
        Self::ServoTicks,
        Self::Conversion,
        Self::Crash,
        Self::Watchdog,
        Self::Timers,
        Self::BoardVersion,
        Self::Configuration,
    ];

    /// The word in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::EmergencyStop => "emergency_stop",
            Self::GateFault => "gate_fault",
            Self::GateConfiguration => "gate_configuration",
            Self::Axis1 => "axis_1",
            Self::Axis2 => "axis_2",
            Self::Temperature => "temperature",
            Self::Thermistor => "thermistor",
            Self::CurrentTicks => "current_ticks",
            Self::ServoTicks => "servo_ticks",
            Self::Conversion => "conversion",
            Self::Crash => "crash",
            Self::Watchdog => "watchdog",
            Self::Timers => "timers",
            Self::BoardVersion => "board_version",
            Self::Configuration => "configuration",
        }
    }

    /// Its bit.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }

    /// Nothing the operator does makes this good: only another board, other constants or another start.
    #[must_use]
    pub const fn is_for_ever(self) -> bool {
        matches!(self, Self::Timers | Self::BoardVersion | Self::Configuration)
    }
}

static CAUSES: AtomicU32 = AtomicU32::new(0);

/// From now on nothing is enabled.
pub fn raise(cause: Cause) {
    CAUSES.fetch_or(cause.bit(), Ordering::Relaxed);
}

/// Nothing speaks against enabling.
#[inline(always)]
pub fn is_clear() -> bool {
    CAUSES.load(Ordering::Relaxed) == 0
}

/// All causes.
pub fn causes() -> u32 {
    CAUSES.load(Ordering::Relaxed)
}

/// The operator has reset: what does not hold for ever is forgotten.
pub fn reset() {
    let kept =
        Cause::ALL.iter().filter(|cause| cause.is_for_ever()).fold(0, |kept, cause| kept | cause.bit());
    CAUSES.fetch_and(kept, Ordering::Relaxed);
}
