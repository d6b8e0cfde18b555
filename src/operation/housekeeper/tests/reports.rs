//! Reports of the housekeeping for each joint, up to the servo that reacts to them.

use super::super::super::{ServoLevel, testing};
use super::*;
use crate::leg::testing::{LEG, configuration};
use crate::leg::{Control, Fault, FaultCode};
use crate::servo::SERVO_RATE_HZ;

/// The fault of the servo's tick after a tenth of a second of housekeeping.
fn fault_of(bench: &mut Bench) -> Option<Fault> {
    let mut control = Control::new(&configuration()).expect("a leg");
    let volt_per_code = testing::VOLT_PER_CODE;
    let mut level = ServoLevel::new(&control, testing::RAMPS, volt_per_code, None);
    let mut ends = testing::ends();
    bench.signals.statistics.see_bus((48.0 / volt_per_code.0) as u16);
    bench.signals.begin_servo();
    let mut tick = |bench: &mut Bench| {
        level.tick(&mut control, LEG.gravity, &mut ends.servo, &bench.signals, &mut bench.hardware);
        control.state()
    };
    assert_eq!(tick(bench), DriveState::SwitchOnDisabled);
    bench.hold(false, false);
    match tick(bench) {
        DriveState::Fault { fault } => Some(fault),
        _ => None,
    }
}

#[test]
fn heat_or_an_open_thermistor_is_the_fault_of_its_joint() {
    assert_eq!(fault_of(&mut Bench::new(Housekeeper::new(HOUSEKEEPING))), None);
    for joint in 0..2 {
        for (degrees, code) in [(Some(100.0), FaultCode::Temperature), (None, FaultCode::Thermistor)] {
            let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
            bench.hardware.temperatures[joint] = degrees;
            assert_eq!(fault_of(&mut bench), Some(Fault { code, joint: joint as u8 }));
        }
    }
}

#[test]
fn the_hottest_bridge_derates_and_an_open_thermistor_leaves_no_torque() {
    for (temperatures, hottest_c) in [
        ([Some(40.0), Some(85.0)], 85.0),
        ([Some(90.0), Some(30.0)], 90.0),
        ([Some(30.0), None], HOUSEKEEPING.hottest_c),
    ] {
        let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
        bench.hardware.temperatures = temperatures;
        bench.hold(false, false);
        assert_eq!(bench.signals.hottest_c(), hottest_c);
    }
}

#[test]
fn a_winding_warms_with_its_squared_current_and_leaves_less_torque() {
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_windings([40.0; 2]));
    let mut expected = Winding::new(RATING, Some(40.0));
    // The integral wraps after 18 s at 60 A.
    for _ in 0..25 * RATE_HZ {
        for _ in 0..SERVO_RATE_HZ / RATE_HZ {
            bench.signals.add_i2t(1, 3600.0);
        }
        expected.advance(3600.0 / RATE_HZ as f32, 1.0 / RATE_HZ as f32);
        bench.round();
    }
    let [cold, hot] =
        [0, 1].map(|joint| (bench.signals.winding_c(joint), bench.signals.winding_share(joint)));
    assert_eq!(cold, (40.0, 1.0));
    assert!((hot.0 - expected.temperature_c()).abs() < 0.01, "{hot:?} {expected:?}");
    assert!(hot.1 < 1.0 && (hot.1 - expected.share()).abs() < 1e-3, "{hot:?}");
}

#[test]
fn windings_are_assumed_warm_until_their_temperature_is_known() {
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    assert_eq!(bench.signals.winding_share(0), 1.0, "before the first round");
    bench.round();
    assert!((79.9..80.0).contains(&bench.signals.winding_c(0)));
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_windings([95.0, 45.0]));
    bench.round();
    let shares = [0, 1].map(|joint| bench.signals.winding_share(joint));
    assert!((0.25..0.26).contains(&shares[0]) && shares[1] == 1.0, "{shares:?}");
}

#[test]
fn each_gate_driver_is_recorded_with_its_own_status() {
    let statuses = |bench: &Bench, cause: InhibitReason| -> Vec<(u8, u32)> {
        let own = |why: &str| why == cause.name();
        picked!(bench.records, Record::GateDriver { why, joint, status } if own(why) => (*joint, *status))
            .collect()
    };
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    bench.hardware.gate_status = [0x0481_0300, 0x0402_0301];
    bench.signals.inhibit.raise(InhibitReason::GateFault);
    bench.hold(false, false);
    let expected = [(1, 0x0481_0300), (2, 0x0402_0301)];
    assert_eq!(statuses(&bench, InhibitReason::GateFault), expected, "once");
    assert_eq!(statuses(&bench, InhibitReason::GateConfiguration), []);
    // The second driver loses its registers and no longer answers.
    bench.hardware.gates_hold[1] = false;
    bench.hardware.gate_status[1] = u32::MAX;
    bench.hold(false, false);
    assert_eq!(statuses(&bench, InhibitReason::GateConfiguration), [(1, 0x0481_0300), (2, u32::MAX)]);
    assert_ne!(bench.signals.inhibit.causes() & InhibitReason::GateConfiguration.bit(), 0);
}

#[test]
fn a_reference_is_refused_while_a_joint_moves() {
    for moving in [None, Some(0), Some(1)] {
        let mut bench = Bench::new(Housekeeper::ready(HOUSEKEEPING));
        bench.hold(false, true);
        bench.hardware.contacts = Contacts::default();
        for round in 0..RATE_HZ {
            if let Some(joint) = moving {
                // 50 counts a second.
                bench.signals.statistics.counts[joint].set(round / 10);
            }
            bench.round();
        }
        let answers =
            picked!(bench.records, Record::Request { name: "reference", accepted, .. } => *accepted);
        let (expected, set): (&[bool], &[_]) = match moving {
            None => (&[true], &[(0, Order::SetCounts(0)), (1, Order::SetCounts(0))]),
            Some(_) => (&[true, false], &[]),
        };
        assert!(answers.eq(expected.iter().copied()), "{moving:?}");
        assert_eq!((&bench.orders[..], bench.signals.has_begun()), (set, moving.is_none()), "{moving:?}");
    }
}
