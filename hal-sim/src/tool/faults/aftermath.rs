//! What may follow a fault: the safe state that its code leads to, and an operator who resets and enables again.
//!
//! States are written out here a second time, apart from the firmware's own table (`scarab::safety::FaultCode::reaction`): who leads a fault
//! elsewhere has to say so in both, or every run that meets it fails.

use scarab::hal::Contacts;
use scarab::safety::FaultCode;

use super::rig::PERIODS_PER_S;

/// Of so many seeds one is reset and enabled again after its safe state.
pub const RESET_EVERY: u64 = 8;

/// Both contacts open; the button held until a reset is taken and over; open again; the switch held until what may be enabled is.
const STEPS: [(u64, Contacts); 4] = [
    (PERIODS_PER_S / 10, OPEN),
    (PERIODS_PER_S * 22 / 10, Contacts { enabling: false, start: true }),
    (PERIODS_PER_S / 10, OPEN),
    (PERIODS_PER_S * 4 / 10, Contacts { enabling: true, start: false }),
];
const OPEN: Contacts = Contacts { enabling: false, start: false };

/// Periods of a reset, from the contacts' opening to a drive that has been enabled for a while, if it was.
pub const RESET: u64 = STEPS[0].0 + STEPS[1].0 + STEPS[2].0 + STEPS[3].0;

/// What the operator's hand does so many periods after it began to reset.
#[must_use]
pub fn hand(since: u64) -> Contacts {
    let mut left = since;
    for (periods, hand) in STEPS {
        if left < periods {
            return hand;
        }
        left -= periods;
    }
    STEPS[3].1
}

/// The safe states that a fault may lead to.
#[must_use]
pub fn leads_to(code: FaultCode) -> &'static [&'static str] {
    use FaultCode as Code;
    match code {
        // A motor that is too fast to be shorted is released, and so are both where nobody was switching.
        Code::EncoderPlace | Code::EncoderFrozen => &["Short", "Off"],
        Code::EncoderStep
        | Code::SupplyLost
        | Code::Temperature
        | Code::Thermistor
        | Code::PositionLimit
        | Code::Overspeed
        | Code::FollowingError
        | Code::Heartbeat
        | Code::HostSilent
        | Code::LatePdo
        | Code::BusOff
        | Code::BusPassive => &["Damp"],
        // Where too many are missing nobody can damp.
        Code::CurrentTicks => &["Damp", "Off"],
        Code::OpenPhase
        | Code::CurrentZero
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
        Code::Timers | Code::BoardVersion | Code::Configuration => &["Refuse"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_firmware_says_of_a_code_is_among_the_states_it_may_lead_to() {
        for code in FaultCode::ALL {
            assert!(leads_to(code).contains(&code.reaction().name()), "{code:?}");
        }
    }

    #[test]
    fn a_reset_opens_both_contacts_before_and_after_the_button_and_ends_enabling() {
        let hands: Vec<Contacts> = (0..RESET + 10).map(hand).collect();
        assert_eq!(hands[0], OPEN);
        assert!(hands.iter().all(|hand| !(hand.enabling && hand.start)));
        let pressed = hands.iter().filter(|hand| hand.start).count() as u64;
        assert!(pressed > 2 * PERIODS_PER_S, "the operator's two seconds, a bounce and the reset itself");
        assert_eq!(hands.last(), Some(&Contacts { enabling: true, start: false }));
    }
}
