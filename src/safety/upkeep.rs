//! What is looked at every few milliseconds: gate drivers' registers and temperatures.
//!
//! Why here: registers are read over a bus and thermistors by a converter that only a board has; when they are looked at and what
//! then follows is decided by values only, so the same code is tested against every fault on the host.
//!
//! | what | looked at every | worst | leads to |
//! | --- | --- | --- | --- |
//! | a gate driver that does not hold its registers, read twice | 8 ms | 8 ms and a current tick | [`Cause::GateConfiguration`], released |
//! | a thermistor that is open or shorted | 50 ms | 50 ms and a servo tick | [`FaultCode::Thermistor`], damped |
//! | a bridge that is not cooler than the bound | 50 ms | the same | [`FaultCode::Temperature`], damped |
//!
//! A register that is upset and right again between two looks is not seen; a thermistor that is stuck within its range is not seen
//! at all. Cost: some ten instructions.

use super::fault::FaultCode;
use super::interlock::Cause;

/// Faults that the board's other levels see and the servo reacts to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BoardFault {
    /// Current ticks are missing.
    CurrentTicks,
    /// A bridge is too hot.
    Temperature,
    /// A thermistor is open or shorted.
    Thermistor,
}

impl BoardFault {
    /// All of them, in the order of their bits.
    pub const ALL: [Self; 3] = [Self::CurrentTicks, Self::Temperature, Self::Thermistor];

    /// One bit for each fault.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }

    /// Code of the fault.
    #[must_use]
    pub const fn code(self) -> FaultCode {
        match self {
            Self::CurrentTicks => FaultCode::CurrentTicks,
            Self::Temperature => FaultCode::Temperature,
            Self::Thermistor => FaultCode::Thermistor,
        }
    }
}

/// When to look; counts rounds of the housekeeping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UpkeepClock {
    gate_rounds: u32,
    temperature_rounds: u32,
    round: u32,
}

/// What is to be looked at in a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due {
    /// The gate drivers' registers.
    pub gates: bool,
    /// The thermistors.
    pub temperatures: bool,
}

impl UpkeepClock {
    /// Rounds that come so often per second.
    #[must_use]
    pub const fn new(rate_hz: u32) -> Self {
        Self { gate_rounds: rate_hz / 125, temperature_rounds: rate_hz / 20, round: 0 }
    }

    /// One round: what is due in it.
    pub const fn next(&mut self) -> Due {
        self.round = self.round.wrapping_add(1);
        Due {
            gates: self.round.is_multiple_of(self.gate_rounds),
            temperatures: self.round.is_multiple_of(self.temperature_rounds),
        }
    }
}

/// Why the drive is kept off because of a gate driver, if it is.
#[must_use]
pub const fn of_gate_driver(holds: bool) -> Option<Cause> {
    if holds { None } else { Some(Cause::GateConfiguration) }
}

/// What the servo has to hear of because of a bridge's temperature, degrees Celsius; none is that of a thermistor that is open or
/// shorted.
#[must_use]
pub fn of_temperature(degrees: Option<f32>, hottest: f32) -> Option<BoardFault> {
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
    fn registers_are_looked_at_within_10_ms_and_temperatures_within_100() {
        let mut clock = UpkeepClock::new(500);
        let due: [Due; 500] = core::array::from_fn(|_| clock.next());
        let longest = |is_due: fn(&Due) -> bool| {
            let mut since = 0;
            due.iter().fold(0, |longest: u32, due| {
                since = if is_due(due) { 0 } else { since + 1 };
                longest.max(since + 1)
            })
        };
        // Rounds of 2 ms.
        assert!(longest(|due| due.gates) * 2 < 10);
        assert!(longest(|due| due.temperatures) * 2 < 100);
    }

    #[test]
    fn what_is_hot_what_is_none_and_what_is_no_number_keeps_the_drive_off() {
        assert_eq!(of_temperature(Some(99.9), 100.0), None);
        assert_eq!(of_temperature(Some(100.0), 100.0), Some(BoardFault::Temperature));
        assert_eq!(of_temperature(Some(f32::NAN), 100.0), Some(BoardFault::Temperature));
        assert_eq!(of_temperature(None, 100.0), Some(BoardFault::Thermistor));
        assert_eq!((of_gate_driver(true), of_gate_driver(false)), (None, Some(Cause::GateConfiguration)));
    }
}
