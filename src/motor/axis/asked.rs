//! What an axis is asked for, and why it stops by itself.

use crate::units::Ampere;

/// What an axis is asked for in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisRequest {
    /// The bridge switches.
    pub enabled: bool,
    /// Quadrature current in the joint's sense, limited to the configuration's.
    pub current: Ampere,
}

impl AxisRequest {
    /// Bridge released.
    pub const RELEASED: Self = Self { enabled: false, current: Ampere::ZERO };
}

/// Why an axis released its bridge by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisFault {
    /// A shunt amplifier at its rail: two ticks in a row, or too many of a few.
    CurrentSense,
    /// The current vector is longer than the bound.
    Overcurrent,
    /// Bus voltage out of its range, as above.
    BusVoltage,
    /// Two encoder steps in a row that no motor makes, two index pulses at one wrong place, or none at the right one. The
    /// place is lost: only a new calibration helps.
    Encoder,
    /// Target, voltage or duty not a number.
    NotANumber,
    /// The counter stands still while the motor turns. The motor is a brake until the fault is cleared; the place is lost.
    EncoderFrozen,
    /// The voltage is not that of the current: a phase does not conduct.
    OpenPhase,
    /// The shunts' zeros drifted.
    CurrentZero,
    /// A shunt's code stays while its phase is asked for another current.
    StuckConversion,
    /// Gains or limits are not what they were.
    Parameters,
}

/// What the bridge is to do in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// Nothing.
    Released,
    /// Quadrature current in the joint's sense.
    Follow(Ampere),
    /// Low sides on: a passive brake.
    Brake,
}

impl From<AxisRequest> for Wish {
    fn from(request: AxisRequest) -> Self {
        if request.enabled { Self::Follow(request.current) } else { Self::Released }
    }
}
