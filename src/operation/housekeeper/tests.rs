use core::iter::from_fn;

use super::super::testing::{TestHardware, picked};
use super::super::{Ends, EventQueue, Queues};
use super::*;
use crate::hal::AxisCommand;
use crate::leg::{CalibrationRefusal, Mismatch, MotorConstant};
use crate::motor::AbsoluteEncoders;
use crate::motor::calibration::tests::{SETTINGS, calibrate, unproven};
use crate::motor::testing::{CONFIGURATION, TestMotor};
use crate::operation::AxisState;
use crate::safety::Bridges;
use crate::safety::winding::tests::RATING;
use crate::testing::TestRandom;

mod absolute;
mod bandwidths;
mod commissioning;
mod reports;
mod second_day;
mod thermistors;

const HOUSEKEEPING: HousekeepingSettings<2> = HousekeepingSettings {
    axes: [CONFIGURATION; 2],
    calibration: [SETTINGS; 2],
    hottest_c: 100.0,
    windings: [RATING; 2],
    thermistors: [None; 2],
    encoders: [EncoderSettings { absolute: AbsoluteEncoders::NONE, counts_per_turn: 8192, ratio: 50.0 }; 2],
    assist: None,
};

struct Bench {
    keeper: Housekeeper<2>,
    hardware: TestHardware<2>,
    signals: Signals<2>,
    queues: Queues<2>,
    events: Box<EventQueue<2>>,
    orders: Vec<(usize, Order)>,
    calibrated: Vec<(usize, Option<StoredCalibration>)>,
    records: Vec<Record<2>>,
}

impl Bench {
    fn new(keeper: Housekeeper<2>) -> Self {
        let mut bench = Self {
            keeper,
            hardware: TestHardware::new(),
            signals: Signals::new(),
            queues: Queues::new(),
            events: Box::default(),
            orders: Vec::new(),
            calibrated: Vec::new(),
            records: Vec::new(),
        };
        bench.hold(false, false);
        bench
    }

    /// Runs one round and collects its output.
    fn round(&mut self) {
        let Ends { mut current, mut servo, mut housekeeping, mut identification, mut calibrated, .. } =
            self.queues.split(&mut self.events);
        self.keeper.round(&mut housekeeping, &self.signals, &mut self.hardware);
        for (axis, orders) in current.orders.iter_mut().enumerate() {
            self.orders.extend(from_fn(|| orders.dequeue()).map(|order| (axis, order)));
        }
        self.calibrated.extend(from_fn(|| calibrated.dequeue()));
        self.records.extend(from_fn(|| identification.notes.dequeue()));
        while servo.requests.dequeue().is_some() {}
    }

    /// Holds the contacts for a tenth of a second and returns the orders.
    fn hold(&mut self, enabling: bool, start: bool) -> Vec<(usize, Order)> {
        self.hardware.contacts = Contacts { enabling, start };
        for _ in 0..RATE_HZ / 10 {
            self.round();
        }
        core::mem::take(&mut self.orders)
    }

    fn press(&mut self) -> Vec<(usize, Order)> {
        let mut orders = self.hold(true, false);
        orders.extend(self.hold(true, true));
        orders.extend(self.hold(true, false));
        orders
    }

    fn ends(&mut self, axis: usize, outcome: Outcome) -> Vec<(usize, Order)> {
        let mut ends = self.queues.split(&mut self.events);
        ends.current.outcomes[axis].enqueue(outcome).expect("not full");
        self.hold(true, false)
    }
}

fn measured() -> Calibration {
    calibrate(&mut TestMotor::default(), &CONFIGURATION).expect("sound")
}

fn unchecked() -> Order {
    Order::Calibrate(Calibrator::new(&CONFIGURATION, SETTINGS).expect("usual"))
}

fn checked(stored: StoredCalibration) -> Order {
    Order::Calibrate(Calibrator::from_stored(&CONFIGURATION, SETTINGS, stored).expect("usual"))
}

#[test]
fn a_stored_calibration_is_checked_and_a_missing_one_measured() {
    let calibration = measured();
    let stored = calibration.stored().expect("an index");
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    assert_eq!(bench.press(), [(0, unchecked())]);
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored), None]));
    assert_eq!(bench.press(), [(0, checked(stored))]);
    // The axis takes its rotor position from the present counter.
    bench.hardware.encoder_counts = [4321, 0];
    let sample = AxisSample { encoder_count: 4321, ..AxisSample::default() };
    let running = Axis::new(&CONFIGURATION, &calibration, &sample).expect("usual");
    let orders = bench.ends(0, Outcome::Calibrated(calibration));
    assert!(matches!(orders[..], [(0, Order::Run(axis)), (1, Order::Calibrate(_))] if axis == running));
    assert_eq!(orders[1].1, unchecked());
    // Both calibrations are sent to the storage.
    bench.ends(1, Outcome::Calibrated(calibration));
    assert_eq!(bench.calibrated, [(0, Some(stored)), (1, Some(stored))]);
    assert!(bench.keeper.is_calibrated());
}

#[test]
fn a_temperature_is_stored_if_known_and_replaces_an_assumed_one() {
    let calibration = measured();
    let offered = |keeper: Housekeeper<2>| {
        let mut bench = Bench::new(keeper);
        bench.press();
        bench.ends(0, Outcome::Calibrated(calibration));
        let stored = bench.calibrated[0].1.expect("an index");
        (stored, bench.signals.winding_c(0))
    };
    let (stored, celsius) = offered(Housekeeper::new(HOUSEKEEPING));
    assert_eq!(stored.winding_c, None, "an assumption is not stored");
    assert!(celsius > 79.0, "{celsius}");
    let (stored, _) = offered(Housekeeper::new(HOUSEKEEPING).with_windings([25.0; 2]));
    assert!(stored.winding_c.is_some_and(|celsius| (celsius - 25.0).abs() < 1.0), "{stored:?}");
    // After the next power-up the same resistance shows the same temperature, and a margin of 6 K; not below
    // the ambient temperature of 40 degrees.
    for (before, found) in [(60.0, 66.0), (25.0, 40.0)] {
        let stored = StoredCalibration { winding_c: Some(before), ..stored };
        let (_, celsius) = offered(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
        assert!((celsius - found).abs() < 1.0, "{celsius} {found}");
    }
}

#[test]
fn a_wrong_stored_calibration_is_refused_once_and_then_measured() {
    let stored = measured().stored().expect("an index");
    for refusal in [
        CalibrationRefusal::OtherMotor(MotorConstant::Resistance, Mismatch { stated: 0.04, found: 0.09 }),
        CalibrationRefusal::StoredOffset(Mismatch { stated: 0.1, found: 0.2 }),
        // A wrong constant may lead to any refusal.
        CalibrationRefusal::TimeOut,
    ] {
        let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
        assert_eq!(bench.press(), [(0, checked(stored))]);
        assert_eq!(bench.ends(0, Outcome::Refused(refusal)), []);
        let recorded = bench.records.iter().any(|record| {
            matches!(record, Record::Calibration { joint: 1, result, .. } if *result == words::calibration(refusal))
        });
        assert!(recorded && !bench.keeper.is_calibrated(), "{refusal:?}");
        assert_eq!(bench.press(), [(0, unchecked())], "{refusal:?}");
    }
}

#[test]
fn the_records_show_both_values_of_a_contradiction_and_what_a_turning_motor_shows() {
    let stored = measured().stored().expect("an index");
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
    bench.press();
    let mismatch = Mismatch { stated: 2e-3, found: 3e-3 };
    bench.ends(0, Outcome::Refused(CalibrationRefusal::Flux(mismatch)));
    let shown = bench.records.iter().any(|record| {
        matches!(record, Record::Calibration { result: "flux", stated: 2e-3, found: 3e-3, .. })
    });
    assert!(shown, "{:?}", bench.records);

    let findings = measured().findings().expect("turned");
    for (calibration, shown) in [(measured(), true), (unproven(&measured(), 0.0), false)] {
        let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
        bench.press();
        bench.ends(0, Outcome::Calibrated(calibration));
        let mut found = picked!(
            bench.records,
            Record::CalibrationFindings { joint: 1, flux_wb: a, friction_sigma_a: b, .. } => [*a, *b]
        );
        assert_eq!(found.next(), shown.then_some([findings.flux.0, findings.friction_sigma.0]));
    }
}

#[test]
fn a_stored_calibration_outlives_a_load_or_a_hand() {
    let stored = measured().stored().expect("an index");
    for refusal in [CalibrationRefusal::Load(70), CalibrationRefusal::Travel, CalibrationRefusal::Turning] {
        let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
        assert_eq!(bench.press(), [(0, checked(stored))]);
        assert_eq!(bench.ends(0, Outcome::Refused(refusal)), []);
        assert_eq!(bench.press(), [(0, checked(stored))], "{refusal:?}");
    }
}

#[test]
fn the_status_light_shows_what_the_board_waits_for() {
    let flashes = |bench: &mut Bench| {
        let mut lit = Vec::new();
        for _ in 0..2 * RATE_HZ {
            bench.round();
            lit.push(bench.hardware.is_lit);
        }
        // A cycle of the light, from wherever the rounds began.
        (0..lit.len()).filter(|round| lit[*round] && !lit[(round + lit.len() - 1) % lit.len()]).count()
    };
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    assert_eq!(flashes(&mut bench), 3);
    let mut bench = Bench::new(Housekeeper::ready(HOUSEKEEPING));
    assert_eq!(flashes(&mut bench), 2);
    bench.signals.begin_servo();
    assert_eq!(flashes(&mut bench), 1);
    bench.signals.inhibit.raise(InhibitReason::EmergencyStop);
    assert_eq!(flashes(&mut bench), 4);
}

#[test]
fn an_erased_or_foreign_calibration_is_not_used() {
    let stored = measured().stored().expect("an index");
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
    bench.signals.forget_stored();
    assert_eq!(bench.press(), [(0, unchecked())]);
    let mut other = stored;
    other.encoder.pole_pairs += 1;
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(other); 2]));
    assert_eq!(bench.press(), [(0, unchecked())]);
}

fn carried_out_by(stage: &mut AxisState, motor: &mut TestMotor, order: Order) -> Outcome {
    stage.apply_order(order);
    let mut sample = motor.sample();
    for _ in 0..720_000 {
        let mut event = None;
        let target = crate::motor::AxisRequest::OFF;
        let command = stage.tick(&sample, Bridges::Follow, target, |outcome, _, command| {
            event = Some(outcome);
            command
        });
        if let Some(outcome) = event {
            motor.period(AxisCommand::OFF);
            return outcome;
        }
        sample = motor.period(command);
    }
    panic!("the calibration does not end");
}

#[test]
fn after_an_erasure_a_reference_has_to_be_taken_again() {
    let mut bench = Bench::new(Housekeeper::ready(HOUSEKEEPING));
    bench.signals.begin_servo();
    bench.ends(0, Outcome::StoodStill);
    bench.ends(1, Outcome::StoodStill);
    let recorded = picked!(bench.records, Record::AxisFault { joint, name, .. } => (*joint, *name));
    assert!(recorded.eq([(1, "zero_forgotten"), (2, "zero_forgotten")]), "{:?}", bench.records);
    // No new calibration is needed: the axes run on.
    assert!(!bench.signals.has_begun() && bench.keeper.is_calibrated());
    bench.hold(false, false);
    bench.hold(false, true);
    let orders: Vec<_> = (0..7).flat_map(|_| bench.hold(false, false)).collect();
    assert_eq!(orders, [(0, Order::SetCounts(0)), (1, Order::SetCounts(0))]);
    assert!(bench.signals.has_begun());
}

#[test]
fn a_reset_releases_braking_motors_until_gates_are_configured() {
    for gates_configure in [true, false] {
        let mut bench = Bench::new(Housekeeper::ready(HOUSEKEEPING));
        bench.hardware.gates_configure = gates_configure;
        bench.signals.inhibit.raise(InhibitReason::EncoderFrozen);
        bench.hardware.bridges = [AxisCommand::BRAKE; 2];
        for _ in 0..19 {
            bench.hold(false, true);
        }
        assert_eq!((bench.hardware.is_enabled(), bench.hardware.gates_switched.len()), (true, 0));
        bench.hardware.contacts = Contacts { enabling: false, start: true };
        while bench.hardware.gates_switched.is_empty() {
            bench.round();
        }
        // The drivers' supply is off, and a current tick would turn the outputs off as well.
        assert!(!bench.hardware.is_enabled());
        while bench.orders.is_empty() {
            assert_eq!(Bridges::from_causes(bench.signals.inhibit.causes()), Bridges::Off);
            bench.round();
        }
        assert_eq!(bench.hardware.gates_switched, [false, true]);
        let left = if gates_configure { 0 } else { InhibitReason::GateConfiguration.bit() };
        assert_eq!(bench.signals.inhibit.causes(), left);
    }
}
