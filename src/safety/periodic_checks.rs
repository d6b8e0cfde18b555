//! Periodic checks every few milliseconds: gate drivers' registers, absolute encoders and temperatures.
//!
//! Why here: only a board can read the registers over a bus and the thermistors by a converter. The schedule
//! and the reaction depend on values only, so the same code is tested against every fault on the host.
//!
//! | check | period | worst case | reaction |
//! | --- | --- | --- | --- |
//! | wrong gate register, read twice | 8 ms | 8 ms + a tick | `InhibitReason::GateConfiguration`, Off |
//! | absolute encoder silent | 8 ms | 40 ms + servo tick | [`FaultCode::AbsoluteEncoder`], Damp |
//! | absolute encoder contradicts the counter, twice | 8 ms | 16 ms | rotor position lost, Short |
//! | thermistor open or shorted | 50 ms | 50 ms + servo tick | [`FaultCode::Thermistor`], Damp |
//! | bridge at or above its limit | 50 ms | 50 ms + servo tick | [`FaultCode::Temperature`], Damp |
//! | motor's thermistor unreadable, thrice | 100 ms | 350 ms | [`FaultCode::MotorThermistor`], Damp |
//! | winding at or above its limit | 50 ms | 50 ms + servo tick | [`FaultCode::WindingTemperature`], Damp |
//!
//! A register that changes and recovers between two checks is not detected, nor is a thermistor stuck within
//! its range. Cost: about ten instructions.

use super::fault::FaultCode;
use crate::listed::listed;

listed! {
    /// Faults that other levels of the board detect and the servo reacts to.
    #[repr(u8)]
    pub(crate) enum BoardFault {
        /// All faults, in the order of their bits.
        ALL;
        /// Current ticks are missing.
        CurrentTicks;
        /// A bridge is too hot.
        Temperature;
        /// A thermistor is open or shorted.
        Thermistor;
        /// A winding is too hot.
        Winding;
        /// An absolute encoder sends no valid frame.
        AbsoluteEncoder;
        /// The thermistor of a motor cannot be read.
        MotorThermistor;
    }
}

impl BoardFault {
    /// Bit of the fault.
    pub(crate) const fn bit(self) -> u32 {
        1 << self as u8
    }

    /// Code of the fault.
    pub(crate) const fn code(self) -> FaultCode {
        match self {
            Self::CurrentTicks => FaultCode::CurrentTicks,
            Self::Temperature => FaultCode::Temperature,
            Self::Thermistor => FaultCode::Thermistor,
            Self::Winding => FaultCode::WindingTemperature,
            Self::AbsoluteEncoder => FaultCode::AbsoluteEncoder,
            Self::MotorThermistor => FaultCode::MotorThermistor,
        }
    }
}

/// Schedule of the checks; counts rounds of the housekeeping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CheckClock {
    gate_rounds: u32,
    temperature_rounds: u32,
    round: u32,
}

/// Checks that are due in a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Due {
    /// Read the gate drivers' registers.
    pub(crate) gates: bool,
    /// Read the absolute encoders.
    pub(crate) encoders: bool,
    /// Read the thermistors.
    pub(crate) temperatures: bool,
}

impl CheckClock {
    /// A schedule for `rate_hz` rounds per second.
    pub const fn new(rate_hz: u32) -> Self {
        Self { gate_rounds: rate_hz / 125, temperature_rounds: rate_hz / 20, round: 0 }
    }

    /// Counts one round and returns the checks due in it.
    pub(crate) const fn next(&mut self) -> Due {
        self.round = self.round.wrapping_add(1);
        Due {
            gates: self.round.is_multiple_of(self.gate_rounds),
            // Between two checks of the gate drivers, whose SPI they share.
            encoders: (self.round + self.gate_rounds / 2).is_multiple_of(self.gate_rounds),
            temperatures: self.round.is_multiple_of(self.temperature_rounds),
        }
    }
}

/// Fault for a bridge's temperature, if any. Temperature and limit `hottest` in degrees Celsius; `None` for a
/// thermistor that is open or shorted.
pub(crate) fn of_temperature(degrees: Option<f32>, hottest: f32) -> Option<BoardFault> {
    match degrees {
        None => Some(BoardFault::Thermistor),
        Some(degrees) if degrees < hottest => None,
        Some(_) => Some(BoardFault::Temperature),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_checked_within_10_ms_and_temperatures_within_100() {
        let mut clock = CheckClock::new(500);
        let due: [Due; 500] = core::array::from_fn(|_| clock.next());
        let longest = |is_due: fn(&Due) -> bool| {
            let mut since = 0;
            due.iter().fold(0, |longest: u32, due| {
                since = if is_due(due) { 0 } else { since + 1 };
                longest.max(since + 1)
            })
        };
        // One round takes 2 ms.
        assert!(longest(|due| due.gates) * 2 < 10);
        assert!(longest(|due| due.temperatures) * 2 < 100);
    }

    #[test]
    fn heat_and_a_missing_or_invalid_temperature_are_faults() {
        assert_eq!(of_temperature(Some(99.9), 100.0), None);
        assert_eq!(of_temperature(Some(100.0), 100.0), Some(BoardFault::Temperature));
        assert_eq!(of_temperature(Some(f32::NAN), 100.0), Some(BoardFault::Temperature));
        assert_eq!(of_temperature(None, 100.0), Some(BoardFault::Thermistor));
    }
}
