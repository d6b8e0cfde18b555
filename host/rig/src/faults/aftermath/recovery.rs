//! Recovery: the operator's steps after a fault, and the refusal without them.

use hal_sim::faults::{Channel, Form, Injection, Injector, Timing};
use scarab::hal::Contacts;
use scarab::leg::DriveState;
use scarab::safety::{FaultCode, InhibitReason};
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

use crate::faults::aftermath;
use crate::faulty_board::{PERIODS_PER_S, Rig};
use crate::pair::Context;
use scarab::model::planar::BASE;

type TestRig = Rig<2, BASE>;

const OPEN: Contacts = Contacts { enabling: false, start: false };
const HELD: Contacts = Contacts { enabling: true, start: false };
const PRESSED: Contacts = Contacts { enabling: false, start: true };

fn ready() -> TestRig {
    // Without gravity, because the weight of a hanging leg loads the rotor differently at each angle, which a
    // calibration refuses.
    let mut leg = LegFile { gravity: [0.0; 3], ..LegFile::load(DEFAULT_LEG).expect("shipped") };
    // The zero pose is within the range, so the leg can be enabled without moving it first.
    leg.joints.iter_mut().for_each(|joint| joint.range_deg[0] = -20.0);
    let context = Context::with_complete_drives(&leg, 1).expect("the default leg");
    let mut rig = Rig::new(&leg, &context, 1).expect("complete drives");
    hold(&mut rig, OPEN, 0.1);
    rig
}

/// Holds the contacts for some seconds; returns whether the drive was enabled in that time.
fn hold(rig: &mut TestRig, hand: Contacts, seconds: f64) -> bool {
    rig.hand = hand;
    let mut enabled = false;
    for _ in 0..(seconds * PERIODS_PER_S as f64) as u64 {
        rig.advance();
        enabled |= rig.state() == DriveState::OperationEnabled;
    }
    enabled
}

/// Resets as an operator does, with the switch held at the end; returns whether the drive was enabled.
fn reset(rig: &mut TestRig) -> bool {
    (0..aftermath::RESET).fold(false, |enabled, since| {
        rig.hand = aftermath::hand(since);
        rig.advance();
        enabled | (rig.state() == DriveState::OperationEnabled)
    })
}

fn lose_counts(rig: &mut TestRig, joint: usize) {
    let mut injector = Injector::new(1);
    let timing = Timing::from(rig.period);
    assert!(injector.add(Injection { channel: Channel::Counter, joint, form: Form::Offset(500.0), timing }));
    rig.injector = injector;
}

#[test]
fn a_past_fault_is_reset_and_enabled_by_hand_only() {
    let mut rig = ready();
    assert!(hold(&mut rig, HELD, 0.4));
    let timing = Timing::lasting(rig.period, 10);
    rig.injector.add(Injection { channel: Channel::GateFault, joint: 0, form: Form::Off, timing });
    hold(&mut rig, HELD, 0.01);
    assert_eq!((rig.alarm(), rig.is_switching()), (Some(FaultCode::GateFault), false));
    // Neither time nor the switch alone enables again.
    assert!(!hold(&mut rig, HELD, 0.5) && !hold(&mut rig, OPEN, 0.2) && !hold(&mut rig, HELD, 0.5));
    assert!(reset(&mut rig));
    assert_eq!(rig.alarm(), None);
}

#[test]
fn a_lost_rotor_position_requires_calibration_and_reference() {
    for joint in 0..2 {
        let mut rig = ready();
        assert!(hold(&mut rig, HELD, 0.4));
        lose_counts(&mut rig, joint);
        hold(&mut rig, HELD, 0.01);
        assert_eq!((rig.alarm(), rig.is_braking()), (Some(FaultCode::EncoderPosition), true));
        assert!(!reset(&mut rig), "no calibration");
        assert_eq!((rig.causes(), rig.state()), (0, DriveState::NotReadyToSwitchOn));
        // The leg comes to rest, then the axis is calibrated.
        hold(&mut rig, OPEN, 10.0);
        let moved = hold(&mut rig, Contacts { enabling: true, start: true }, 0.2);
        assert!(!moved && !hold(&mut rig, HELD, 20.0), "no reference");
        hold(&mut rig, OPEN, 10.0);
        hold(&mut rig, PRESSED, 0.3);
        assert!(!hold(&mut rig, OPEN, 2.0));
        assert!(hold(&mut rig, HELD, 0.4), "joint {joint}: {:?} {:?}", rig.alarm(), rig.state());
        assert!(rig.is_switching(), "joint {joint}: enabled, but no axis switches");
    }
}

#[test]
fn a_lost_rotor_position_ends_the_servo_in_its_tick() {
    let mut rig = ready();
    assert!(hold(&mut rig, HELD, 0.4));
    lose_counts(&mut rig, 1);
    for _ in 0..4 {
        rig.advance();
        let found = rig.alarm() == Some(FaultCode::EncoderPosition);
        assert_eq!(rig.state() == DriveState::NotReadyToSwitchOn, found);
    }
    assert!(rig.alarm().is_some() && rig.is_braking());
}

#[test]
fn a_rotor_position_lost_during_a_reference_ends_it() {
    let mut rig = ready();
    assert!(hold(&mut rig, HELD, 0.4));
    lose_counts(&mut rig, 0);
    hold(&mut rig, HELD, 0.01);
    reset(&mut rig);
    hold(&mut rig, OPEN, 10.0);
    hold(&mut rig, Contacts { enabling: true, start: true }, 0.2);
    hold(&mut rig, HELD, 20.0);
    hold(&mut rig, OPEN, 10.0);
    hold(&mut rig, PRESSED, 0.3);
    // Half of the second for which the joints must stand still.
    hold(&mut rig, OPEN, 0.25);
    lose_counts(&mut rig, 1);
    assert!(!hold(&mut rig, OPEN, 2.0) && !hold(&mut rig, HELD, 0.4));
    assert!(!reset(&mut rig));
}

#[test]
fn a_calibration_ends_with_the_switch_and_with_the_emergency_stop() {
    for stop in [false, true] {
        let mut rig = ready();
        assert!(hold(&mut rig, HELD, 0.4));
        lose_counts(&mut rig, 0);
        hold(&mut rig, HELD, 0.01);
        reset(&mut rig);
        hold(&mut rig, OPEN, 1.0);
        hold(&mut rig, Contacts { enabling: true, start: true }, 0.2);
        hold(&mut rig, HELD, 0.2);
        assert!(rig.is_switching(), "the axis is being calibrated");
        if stop {
            let timing = Timing::lasting(rig.period, 1);
            let form = Form::Off;
            rig.injector.add(Injection { channel: Channel::EmergencyStop, joint: 0, form, timing });
            rig.advance();
        } else {
            // One round of the housekeeping and one tick.
            hold(&mut rig, OPEN, 0.003);
        }
        assert!(!rig.is_switching(), "stop {stop}");
        assert!(!hold(&mut rig, HELD, 1.0) && !rig.is_switching());
    }
}

#[test]
fn missing_ticks_during_a_flash_write_are_no_fault() {
    // Writing words takes less than 2 ms. An erasure takes longer and discards the joints' zeros.
    for (storing, periods, enabled) in [(false, 40, false), (true, 40, true), (true, 100, false)] {
        let mut rig = ready();
        rig.board.signals.inhibit.raise_bits(if storing { InhibitReason::Storing.bit() } else { 0 });
        for joint in 0..2 {
            // The board lengthens the watchdog's timeout during the write; here it does not.
            let timing = Timing::lasting(rig.period, periods);
            rig.injector.add(Injection { channel: Channel::Tick, joint, form: Form::Off, timing });
        }
        assert!(!hold(&mut rig, HELD, 0.4) || !storing, "enabled during the write");
        rig.board.signals.inhibit.end_storing();
        assert_eq!(rig.causes() == 0, storing);
        assert_eq!(hold(&mut rig, OPEN, 0.1) || hold(&mut rig, HELD, 0.4), enabled, "{storing} {periods}");
    }
}
