//! Requests to an axis, and the faults by which it stops by itself.

use crate::units::Ampere;

/// Request to an axis for one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisRequest {
    /// Whether the bridge switches.
    pub enabled: bool,
    /// Quadrature current in the joint's sense, clamped to the configuration's limit.
    pub current: Ampere,
}

impl AxisRequest {
    /// Outputs off.
    pub const RELEASED: Self = Self { enabled: false, current: Ampere::ZERO };
}

/// Why an axis turned its outputs off or brakes by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisFault {
    /// A shunt amplifier at its rail: two ticks in a row, or too many within few ticks.
    CurrentSense,
    /// Current vector longer than the bound.
    Overcurrent,
    /// Bus voltage out of range, as often as in [`Self::CurrentSense`].
    BusVoltage,
    /// Two implausible encoder steps in a row, two index pulses at one wrong position, or none at the right
    /// one. The rotor position is lost and requires a new calibration.
    Encoder,
    /// Target, voltage or duty not finite.
    NotANumber,
    /// The counter stands still while the motor turns. The motor brakes until the fault is cleared; the rotor
    /// position is lost.
    EncoderFrozen,
    /// Voltage and current disagree: a phase does not conduct.
    OpenPhase,
    /// The current-sensor offsets drifted.
    CurrentZero,
    /// A shunt code does not change while its phase's target current does.
    StuckConversion,
    /// Checksum of gains and limits changed.
    Parameters,
}

/// Requested state of the bridge for one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BridgeRequest {
    /// Outputs off.
    Released,
    /// Follow a quadrature current in the joint's sense.
    Follow(Ampere),
    /// Low sides on: a passive brake.
    Brake,
}

impl From<AxisRequest> for BridgeRequest {
    fn from(request: AxisRequest) -> Self {
        if request.enabled { Self::Follow(request.current) } else { Self::Released }
    }
}
