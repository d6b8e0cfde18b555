//! The way back: what an operator has to do after a fault, and what nobody gets without it.

use scarab::leg::DriveState;
use scarab::safety::{Cause, FaultCode};

use scarab::hal::Contacts;

use super::{PERIODS_PER_S, Rig};
use crate::faults::{Channel, Form, Injection, Injector, Timing};
use crate::tool::faults::aftermath;
use crate::tool::faults::campaign::BASE;
use crate::tool::leg_file::{DEFAULT_LEG, LegFile};
use crate::tool::pair::Context;
use crate::tool::simulate::{DriveModel, SimulationOptions};

type TestRig = Rig<2, BASE>;

const OPEN: Contacts = Contacts { enabling: false, start: false };
const HELD: Contacts = Contacts { enabling: true, start: false };
const PRESSED: Contacts = Contacts { enabling: false, start: true };

fn ready() -> TestRig {
    // Without weight: a leg that hangs pulls at its rotor, by more in one place than in another, and is not calibrated while it does.
    let mut leg = LegFile { gravity: [0.0; 3], ..LegFile::load(DEFAULT_LEG).expect("shipped") };
    // The pose that is stated as zero lies within the range: nobody has to move the leg before it is enabled.
    leg.joints.iter_mut().for_each(|joint| joint.range_deg[0] = -20.0);
    let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(1) };
    let context = Context::new(&leg, &options).expect("the default leg");
    let mut rig = Rig::new(&leg, &context, 1).expect("complete drives");
    hold(&mut rig, OPEN, 0.1);
    rig
}

/// A hand at the contacts for so many seconds; whether the drive was enabled meanwhile.
fn hold(rig: &mut TestRig, hand: Contacts, seconds: f64) -> bool {
    rig.hand = hand;
    let mut enabled = false;
    for _ in 0..(seconds * PERIODS_PER_S as f64) as u64 {
        rig.advance();
        enabled |= rig.state() == DriveState::OperationEnabled;
    }
    enabled
}

/// Resets as an operator does, the switch closed at the end; whether the drive was enabled.
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
fn a_fault_that_is_gone_is_reset_by_hand_and_enabled_by_hand() {
    let mut rig = ready();
    assert!(hold(&mut rig, HELD, 0.4));
    let timing = Timing::lasting(rig.period, 10);
    rig.injector.add(Injection { channel: Channel::GateFault, joint: 0, form: Form::Off, timing });
    hold(&mut rig, HELD, 0.01);
    assert_eq!((rig.alarm(), rig.is_switching()), (Some(FaultCode::GateFault), false));
    // Neither time nor the switch alone bring it back.
    assert!(!hold(&mut rig, HELD, 0.5) && !hold(&mut rig, OPEN, 0.2) && !hold(&mut rig, HELD, 0.5));
    assert!(reset(&mut rig));
    assert_eq!(rig.alarm(), None);
}

#[test]
fn an_axis_that_lost_its_place_moves_again_only_after_a_calibration_and_a_reference() {
    for joint in 0..2 {
        let mut rig = ready();
        assert!(hold(&mut rig, HELD, 0.4));
        lose_counts(&mut rig, joint);
        hold(&mut rig, HELD, 0.01);
        assert_eq!((rig.alarm(), rig.is_braking()), (Some(FaultCode::EncoderPlace), true));
        assert!(!reset(&mut rig), "no calibration");
        assert_eq!((rig.causes(), rig.state()), (0, DriveState::NotReadyToSwitchOn));
        // The leg hangs until it stands, then the axis is measured.
        hold(&mut rig, OPEN, 10.0);
        let moved = hold(&mut rig, Contacts { enabling: true, start: true }, 0.2);
        assert!(!moved && !hold(&mut rig, HELD, 20.0), "no reference");
        hold(&mut rig, OPEN, 10.0);
        hold(&mut rig, PRESSED, 0.3);
        assert!(!hold(&mut rig, OPEN, 2.0));
        assert!(hold(&mut rig, HELD, 0.4), "joint {joint}: {:?} {:?}", rig.alarm(), rig.state());
        assert!(rig.is_switching(), "joint {joint}: enabled, and no axis runs");
    }
}

#[test]
fn a_lost_place_ends_the_servo_in_the_tick_that_finds_it() {
    let mut rig = ready();
    assert!(hold(&mut rig, HELD, 0.4));
    lose_counts(&mut rig, 1);
    for _ in 0..4 {
        rig.advance();
        let found = rig.alarm() == Some(FaultCode::EncoderPlace);
        assert_eq!(rig.state() == DriveState::NotReadyToSwitchOn, found);
    }
    assert!(rig.alarm().is_some() && rig.is_braking());
}

#[test]
fn a_place_that_is_lost_while_the_joints_are_referenced_ends_the_reference() {
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
    // Half of the second that the joints have to stand for.
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
        assert!(rig.is_switching(), "it is measured");
        if stop {
            let timing = Timing::lasting(rig.period, 1);
            let form = Form::Off;
            rig.injector.add(Injection { channel: Channel::EmergencyStop, joint: 0, form, timing });
            rig.advance();
        } else {
            // A round of the housekeeping, and a tick.
            hold(&mut rig, OPEN, 0.003);
        }
        assert!(!rig.is_switching(), "stop {stop}");
        assert!(!hold(&mut rig, HELD, 1.0) && !rig.is_switching());
    }
}

#[test]
fn ticks_that_do_not_come_while_the_flash_is_written_are_nobody_s_fault() {
    // Words take less than 2 ms; what an erasure lasts through, the joints' zeros do not: a reference has to be taken again.
    for (storing, periods, enabled) in [(false, 40, false), (true, 40, true), (true, 100, false)] {
        let mut rig = ready();
        rig.board.signals.inhibit.raise_bits(if storing { Cause::Storing.bit() } else { 0 });
        for joint in 0..2 {
            // The watchdog is stretched on the board and not here.
            let timing = Timing::lasting(rig.period, periods);
            rig.injector.add(Injection { channel: Channel::Tick, joint, form: Form::Off, timing });
        }
        assert!(!hold(&mut rig, HELD, 0.4) || !storing, "nothing is enabled meanwhile");
        rig.board.signals.inhibit.end_storing();
        assert_eq!(rig.causes() == 0, storing);
        assert_eq!(hold(&mut rig, OPEN, 0.1) || hold(&mut rig, HELD, 0.4), enabled, "{storing} {periods}");
    }
}
