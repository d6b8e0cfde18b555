extern crate std;

use std::collections::VecDeque;
use std::vec::Vec;

use super::*;
use crate::hal::AxisCommand;
use crate::leg::CalibrationRefusal;
use crate::motor::calibration::tests::{SETTINGS, calibrate};
use crate::motor::testing::{CONFIGURATION, TestMotor};
use crate::operation::Stage;

#[derive(Default)]
struct Board {
    contacts: (bool, bool),
    causes: u32,
    begun: bool,
    orders: Vec<(usize, Order)>,
    outcomes: [VecDeque<Outcome>; 2],
    kept: Vec<(usize, Option<StoredCalibration>)>,
    forgotten: bool,
    said: Vec<Record<2>>,
}

impl HousekeepingBoard<2> for Board {
    fn contacts(&self) -> (bool, bool) {
        self.contacts
    }
    fn causes(&self) -> u32 {
        self.causes
    }
    fn raise(&mut self, cause: Cause) {
        self.causes |= cause.bit();
    }
    fn reset_interlock(&mut self) {
        self.causes = 0;
    }
    fn gate_holds(&mut self, _: usize) -> bool {
        true
    }
    fn gate_status(&mut self) -> u32 {
        0
    }
    fn switch_gates(&mut self, _: bool) {}
    fn configure_gates(&mut self) -> bool {
        true
    }
    fn temperature(&self, _: usize) -> Option<f32> {
        Some(30.0)
    }
    fn set_temperature(&mut self, _: f32) {}
    fn report(&mut self, _: crate::safety::FaultCode, _: usize) {}
    fn encoder_count(&self, _: usize) -> u16 {
        0
    }
    fn joint_counts(&self, _: usize) -> i32 {
        7
    }
    fn begin_servo(&mut self) {
        self.begun = true;
    }
    fn end_servo(&mut self) {
        self.begun = false;
    }
    fn has_begun(&self) -> bool {
        self.begun
    }
    fn order(&mut self, axis: usize, order: Order) {
        self.orders.push((axis, order));
    }
    fn outcome(&mut self, axis: usize) -> Option<Outcome> {
        self.outcomes[axis].pop_front()
    }
    fn calibrated(&mut self, axis: usize, calibration: &Calibration) {
        self.kept.push((axis, calibration.stored()));
    }
    fn take_forgotten(&mut self) -> bool {
        core::mem::take(&mut self.forgotten)
    }
    fn request(&mut self, _: ControlRequest<2>) -> bool {
        true
    }
    fn drive_state(&mut self) -> Option<DriveState> {
        None
    }
    fn say(&mut self, record: Record<2>) {
        self.said.push(record);
    }
}

const HOUSE: HousekeepingSettings<2> =
    HousekeepingSettings { axes: [CONFIGURATION; 2], calibration: [SETTINGS; 2], hottest_c: 100.0 };

struct Bench {
    keeper: Housekeeper<2>,
    board: Board,
}

impl Bench {
    fn new(keeper: Housekeeper<2>) -> Self {
        let mut bench = Self { keeper, board: Board::default() };
        bench.hold(false, false);
        bench
    }

    /// A tenth of a second, and what was ordered in it.
    fn hold(&mut self, enabling: bool, start: bool) -> Vec<(usize, Order)> {
        self.board.contacts = (enabling, start);
        for _ in 0..RATE_HZ / 10 {
            self.keeper.round(&mut self.board);
        }
        core::mem::take(&mut self.board.orders)
    }

    fn press(&mut self) -> Vec<(usize, Order)> {
        let mut orders = self.hold(true, false);
        orders.extend(self.hold(true, true));
        orders.extend(self.hold(true, false));
        orders
    }

    fn ends(&mut self, axis: usize, outcome: Outcome) -> Vec<(usize, Order)> {
        self.board.outcomes[axis].push_back(outcome);
        self.hold(true, false)
    }
}

fn measured() -> Calibration {
    calibrate(&mut TestMotor::default(), &CONFIGURATION).expect("sound")
}

fn anew() -> Order {
    Order::Calibrate(Calibrator::new(&CONFIGURATION, SETTINGS).expect("usual"))
}

fn checked(stored: StoredCalibration) -> Order {
    Order::Calibrate(Calibrator::from_stored(&CONFIGURATION, SETTINGS, stored).expect("usual"))
}

#[test]
fn what_was_kept_is_checked_and_what_was_not_is_measured() {
    let calibration = measured();
    let stored = calibration.stored().expect("an index");
    let mut bench = Bench::new(Housekeeper::new(HOUSE));
    assert_eq!(bench.press(), [(0, anew())]);
    let mut bench = Bench::new(Housekeeper::new(HOUSE).with_stored([Some(stored), None]));
    assert_eq!(bench.press(), [(0, checked(stored))]);
    let orders = bench.ends(0, Outcome::Calibrated(calibration));
    assert!(matches!(orders[..], [(0, Order::Run(_)), (1, Order::Calibrate(_))]));
    assert_eq!(orders[1].1, anew());
    // Either is told to whoever keeps it.
    bench.ends(1, Outcome::Calibrated(calibration));
    assert_eq!(bench.board.kept, [(0, Some(stored)), (1, Some(stored))]);
    assert!(bench.keeper.is_calibrated());
}

#[test]
fn what_was_kept_and_is_not_found_again_is_refused_once_and_then_measured() {
    let stored = measured().stored().expect("an index");
    for refusal in [
        CalibrationRefusal::OtherMotor,
        CalibrationRefusal::StoredOffset,
        // Whatever a wrong constant led to.
        CalibrationRefusal::TimeOut,
    ] {
        let mut bench = Bench::new(Housekeeper::new(HOUSE).with_stored([Some(stored); 2]));
        assert_eq!(bench.press(), [(0, checked(stored))]);
        assert_eq!(bench.ends(0, Outcome::Refused(refusal)), []);
        let told = bench.board.said.iter().any(|record| {
            matches!(record, Record::Calibration { joint: 1, result, .. } if *result == words::calibration(refusal).0)
        });
        assert!(told && !bench.keeper.is_calibrated(), "{refusal:?}");
        assert_eq!(bench.press(), [(0, anew())], "{refusal:?}");
    }
}

#[test]
fn what_was_forgotten_or_is_of_another_configuration_is_not_used() {
    let stored = measured().stored().expect("an index");
    let mut bench = Bench::new(Housekeeper::new(HOUSE).with_stored([Some(stored); 2]));
    bench.board.forgotten = true;
    assert_eq!(bench.press(), [(0, anew())]);
    let mut other = stored;
    other.encoder.pole_pairs += 1;
    let mut bench = Bench::new(Housekeeper::new(HOUSE).with_stored([Some(other); 2]));
    assert_eq!(bench.press(), [(0, anew())]);
}

/// The order that the housekeeper gives, on a motor whose power was off meanwhile; what comes of it.
fn carried_out(motor: &mut TestMotor, order: Order) -> Outcome {
    let mut stage = Stage::OFF;
    stage.obey(order);
    let mut sample = motor.sample();
    for _ in 0..240_000 {
        let (command, told) =
            stage.tick(&sample, crate::safety::Bridges::Follow, crate::motor::AxisRequest::RELEASED);
        if let Some((outcome, _)) = told {
            motor.period(AxisCommand::RELEASED);
            return outcome;
        }
        sample = motor.period(command);
    }
    panic!("no end");
}

#[test]
fn a_motor_whose_encoder_was_turned_while_the_power_was_off_is_refused_and_then_measured() {
    let mut motor = TestMotor::default();
    let stored = calibrate(&mut motor, &CONFIGURATION).expect("sound").stored().expect("an index");
    // The rotor was moved; one encoder is 20 electrical degrees off on its shaft.
    for (shaft_deg, fits) in [(0.0, true), (20.0, false)] {
        let mut motor = TestMotor { angle: motor.angle + 11.0, seed: 9, ..TestMotor::default() };
        motor.encoder_zero += shaft_deg / 360.0 / 7.0;
        let mut bench = Bench::new(Housekeeper::new(HOUSE).with_stored([Some(stored); 2]));
        let (_, order) = bench.press().remove(0);
        let outcome = carried_out(&mut motor, order);
        assert_eq!(matches!(outcome, Outcome::Calibrated(_)), fits, "{outcome:?}");
        if !fits {
            assert_eq!(outcome, Outcome::Refused(CalibrationRefusal::StoredOffset));
            bench.ends(0, outcome);
            let (_, order) = bench.press().remove(0);
            let outcome = carried_out(&mut motor, order);
            assert!(matches!(outcome, Outcome::Calibrated(_)), "{outcome:?}");
        }
    }
}

#[test]
fn after_an_erasure_a_reference_has_to_be_taken_again() {
    let mut bench = Bench::new(Housekeeper::ready(HOUSE));
    bench.board.begun = true;
    bench.ends(0, Outcome::StoodStill);
    bench.ends(1, Outcome::StoodStill);
    let told = |joint| Record::AxisFault { tick: 0, joint, name: "zero_forgotten" };
    let said: Vec<Record<2>> = bench
        .board
        .said
        .iter()
        .filter_map(|record| match record {
            Record::AxisFault { joint, name, .. } => Some(Record::AxisFault { tick: 0, joint: *joint, name }),
            _ => None,
        })
        .collect();
    assert_eq!(said, [told(1), told(2)]);
    // No new calibration: the axes run on.
    assert!(!bench.board.begun && bench.keeper.is_calibrated());
    bench.hold(false, false);
    bench.hold(false, true);
    let mut orders = bench.hold(false, false);
    for _ in 0..6 {
        orders.extend(bench.hold(false, false));
    }
    assert_eq!(orders, [(0, Order::Place(0)), (1, Order::Place(0))]);
    assert!(bench.board.begun);
}
