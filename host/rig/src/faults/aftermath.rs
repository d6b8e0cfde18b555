//! Allowed reactions to a fault: the safe states of each code, and an operator who resets and enables again.
//!
//! The states are repeated here, independently of the firmware's table
//! (`scarab::safety::FaultCode::reaction`). A changed reaction must be changed in both, or every run with
//! that code fails.

#[cfg(test)]
mod recovery;

use scarab::hal::Contacts;
use scarab::safety::FaultCode;

use crate::faulty_board::PERIODS_PER_S;

/// One in this many seeds continues with a reset and enabling after the safe state.
pub(crate) const RESET_EVERY: u64 = 8;

/// Sequence of a reset: both contacts open; the button pressed until the reset is complete; open again; the
/// switch held until the drive would be enabled.
const STEPS: [(u64, Contacts); 4] = [
    (PERIODS_PER_S / 10, OPEN),
    (PERIODS_PER_S * 22 / 10, Contacts { enabling: false, start: true }),
    (PERIODS_PER_S / 10, OPEN),
    (PERIODS_PER_S * 4 / 10, Contacts { enabling: true, start: false }),
];
const OPEN: Contacts = Contacts { enabling: false, start: false };

/// Periods of the whole sequence.
pub(crate) const RESET: u64 = STEPS[0].0 + STEPS[1].0 + STEPS[2].0 + STEPS[3].0;

/// Contacts of the operator, `since` periods after the start of the reset.
pub(crate) fn hand(since: u64) -> Contacts {
    let mut left = since;
    for (periods, hand) in STEPS {
        if left < periods {
            return hand;
        }
        left -= periods;
    }
    STEPS[3].1
}

/// Safe states that a fault may lead to.
pub(crate) fn leads_to(code: FaultCode) -> &'static [&'static str] {
    use FaultCode as Code;
    match code {
        // A motor too fast for a short circuit is turned off; both are, if neither was switching.
        Code::EncoderPosition | Code::EncoderFrozen | Code::ChargeCurrent => &["Short", "Off"],
        Code::EncoderStep
        | Code::AbsoluteEncoder
        | Code::SupplyLost
        | Code::Temperature
        | Code::Thermistor
        | Code::WindingTemperature
        | Code::MotorThermistor
        | Code::PositionLimit
        | Code::Overspeed
        | Code::FollowingError
        | Code::Heartbeat
        | Code::HostSilent
        | Code::LatePdo
        | Code::BusOff
        | Code::BusPassive
        | Code::SupplyCurrent => &["Damp"],
        // With too many missing ticks, damping is impossible.
        Code::CurrentTicks => &["Damp", "Off"],
        Code::OpenPhase
        | Code::CurrentOffset
        | Code::StuckConversion
        | Code::CurrentSense
        | Code::Conversion
        | Code::Overcurrent
        | Code::GateFault
        | Code::GateConfiguration
        | Code::BusVoltage
        | Code::NotFinite
        | Code::EmergencyStop
        | Code::ServoTicks
        | Code::Parameters => &["Off"],
        Code::Watchdog | Code::Crash => &["Refuse", "Off"],
        Code::ProcessorSupply | Code::Timers | Code::BoardVersion | Code::Configuration => &["Refuse"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_firmwares_reaction_is_among_the_allowed_states() {
        for code in FaultCode::ALL {
            assert!(leads_to(code).contains(&code.reaction().name()), "{code:?}");
        }
    }

    #[test]
    fn a_reset_opens_both_contacts_and_ends_with_the_switch_held() {
        let hands: Vec<Contacts> = (0..RESET + 10).map(hand).collect();
        assert_eq!(hands[0], OPEN);
        assert!(hands.iter().all(|hand| !(hand.enabling && hand.start)));
        let pressed = hands.iter().filter(|hand| hand.start).count() as u64;
        assert!(pressed > 2 * PERIODS_PER_S, "two seconds, debouncing and the reset itself");
        assert_eq!(hands.last(), Some(&Contacts { enabling: true, start: false }));
    }
}
