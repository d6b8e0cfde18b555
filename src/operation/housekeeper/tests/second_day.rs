//! Stored calibrations after a power-up: joints turned by hand, checked at standstill, referenced, enabled.

use core::num::NonZeroU32;

use super::super::super::testing::{RAMPS, VOLT_PER_CODE};
use super::super::super::{CurrentLoops, ServoLevel, Tick};
use super::*;
use crate::hal::CURRENT_RATE_HZ;
use crate::leg::Control;
use crate::leg::testing::{LEG, configuration};
use crate::motor::AbsoluteAngle;

const PERIOD: NonZeroU32 = NonZeroU32::new(7000).expect("more than none");
/// Motor angle of one joint turn.
const RATIO_RAD: f64 = 50.0 * core::f64::consts::TAU;

/// Levels 0, 1 and 6 of a board with two motors, from the power-up on.
pub(super) struct Machine {
    loops: CurrentLoops<2>,
    pub(super) keeper: Housekeeper<2>,
    level: ServoLevel<2>,
    control: Control<2>,
    hardware: TestHardware<2>,
    pub(super) signals: Signals<2>,
    queues: Queues<2>,
    events: Box<EventQueue<2>>,
    pub(super) motors: [TestMotor; 2],
    /// Added to each counter.
    pub(super) counted: [u16; 2],
    /// The SPI's angle grows with the rotor's, whatever the counter does.
    pub(super) is_spi_forward: bool,
    /// Error of each joint's encoder, steps, or no valid frame.
    pub(super) joint_steps: [Option<i32>; 2],
    samples: [AxisSample; 2],
    period: u32,
    pub(super) records: Vec<Record<2>>,
    /// Calibrations offered to the storage.
    pub(super) offered: [Option<StoredCalibration>; 2],
    /// Greatest current of any motor so far, A.
    pub(super) most_ampere: f64,
}

impl Machine {
    fn new(motors: [TestMotor; 2], stored: [Option<StoredCalibration>; 2]) -> Self {
        Self::with(HOUSEKEEPING, motors, stored)
    }

    pub(super) fn with(
        settings: HousekeepingSettings<2>,
        mut motors: [TestMotor; 2],
        stored: [Option<StoredCalibration>; 2],
    ) -> Self {
        let control = Control::new(&configuration()).expect("a leg");
        Self {
            loops: CurrentLoops::new([AxisState::OFF; 2], PERIOD, None, VOLT_PER_CODE),
            keeper: Housekeeper::new(settings).with_stored(stored),
            level: ServoLevel::new(&control, RAMPS, VOLT_PER_CODE, None),
            control,
            hardware: TestHardware::new(),
            signals: Signals::new(),
            queues: Queues::new(),
            events: Box::default(),
            samples: motors.each_mut().map(TestMotor::sample),
            motors,
            counted: [0; 2],
            is_spi_forward: false,
            joint_steps: [Some(0); 2],
            period: 0,
            records: Vec::new(),
            offered: [None; 2],
            most_ampere: 0.0,
        }
    }

    fn period(&mut self) {
        let Ends { mut current, mut servo, mut housekeeping, mut identification, mut calibrated, .. } =
            self.queues.split(&mut self.events);
        if self.period.is_multiple_of(CURRENT_RATE_HZ / RATE_HZ) {
            self.keeper.round(&mut housekeeping, &self.signals, &mut self.hardware);
        }
        self.period += 1;
        let now = self.period.wrapping_mul(PERIOD.get());
        for axis in 0..2 {
            let mut sample = self.samples[axis];
            sample.encoder_count = sample.encoder_count.wrapping_add(self.counted[axis]);
            sample.index_count = sample.index_count.map(|at| at.wrapping_add(self.counted[axis]));
            self.hardware.encoder_counts[axis] = sample.encoder_count;
            let requested = self.hardware.servo_pended;
            let tick =
                Tick { now, emergency_stop: false, gate_fault: false, complete: true, supply: true, sample };
            self.loops.tick(axis, &tick, &mut current, &self.signals, &mut self.hardware);
            if self.hardware.servo_pended != requested {
                let gravity = LEG.gravity;
                let Self { level, control, signals, hardware, .. } = self;
                level.tick(control, gravity, &mut servo, signals, hardware);
                signals.statistics.servo_ticks.add();
            }
            self.samples[axis] = self.motors[axis].period(self.hardware.bridges[axis]);
            let steps = |turns: f64| (turns.rem_euclid(1.0) * 16_384.0) as u16;
            let frame = |steps: u16| AbsoluteAngle::from_steps(steps).to_frame();
            let motor = &self.motors[axis];
            let position = motor.position();
            let rotor = frame(steps(if self.is_spi_forward { -position } else { position }));
            let joint = self.joint_steps[axis]
                .map_or(u16::MAX, |error| frame(steps(motor.angle / RATIO_RAD).wrapping_add(error as u16)));
            self.hardware.encoder_frames[axis] = [rotor, joint];
            let [d, q] = self.motors[axis].current;
            self.most_ampere = self.most_ampere.max(d.hypot(q));
        }
        while let Some((axis, stored)) = calibrated.dequeue() {
            self.offered[axis] = stored;
        }
        self.records.extend(from_fn(|| identification.notes.dequeue()));
        while identification.events.dequeue().is_some() {}
    }

    /// Holds the contacts for some seconds.
    pub(super) fn hold(&mut self, enabling: bool, start: bool, seconds: f64) {
        self.hardware.contacts = Contacts { enabling, start };
        (0..(seconds * f64::from(CURRENT_RATE_HZ)) as u32).for_each(|_| self.period());
    }

    /// The second day, after a hand turned both joints over their index twice.
    fn turned() -> Self {
        let (motors, stored) = second_day();
        let mut machine = Self::new(motors, stored);
        machine.hold(false, false, 0.1);
        machine.turn(2.3 * core::f64::consts::TAU);
        machine
    }

    /// The operator holds the switch and presses start.
    pub(super) fn press(&mut self) {
        self.hold(true, false, 0.1);
        self.hold(true, true, 0.1);
    }

    /// The operator begins a calibration and holds the switch for some seconds.
    pub(super) fn calibrate(&mut self, seconds: f64) {
        self.press();
        self.hold(true, false, seconds);
    }

    /// The operator takes the pose as reference.
    pub(super) fn reference(&mut self) {
        self.hold(false, false, 0.1);
        self.hold(false, true, 0.2);
        self.hold(false, false, 0.7);
    }

    /// A hand turns both motors by an angle in rad, at 60 rad/s.
    pub(super) fn turn(&mut self, angle: f64) {
        self.drive(true, 60.0 * angle.signum());
        let contacts = self.hardware.contacts;
        self.hold(contacts.enabling, contacts.start, angle.abs() / 60.0);
        self.drive(false, 0.0);
    }

    /// A hand holds both motors at a speed, rad/s, or lets go.
    fn drive(&mut self, driven: bool, speed: f64) {
        self.motors.iter_mut().for_each(|motor| (motor.driven, motor.speed) = (driven, speed));
    }

    pub(super) fn results(&self) -> Vec<(u8, &'static str)> {
        picked!(self.records, Record::Calibration { joint, result, .. } => (*joint, *result)).collect()
    }

    pub(super) fn state(&self) -> DriveState {
        self.control.state()
    }

    fn is_proven(&mut self) -> [bool; 2] {
        [0, 1].map(|axis| {
            let axis = self.loops.axis_state_mut(axis).and_then(AxisState::axis_mut);
            axis.is_some_and(|axis| axis.is_proven())
        })
    }
}

/// Motors with the joint's inertia and friction at the rotor, elsewhere than at their stored calibration.
pub(super) fn second_day() -> ([TestMotor; 2], [Option<StoredCalibration>; 2]) {
    let stored = measured().stored().expect("an index");
    let motors = [5.0, -8.0].map(|moved| {
        let motor = TestMotor::default();
        TestMotor {
            angle: motor.angle + moved,
            encoder_zero: motor.encoder_zero + 2.0,
            inertia: 1.5e-3,
            coulomb: 0.06,
            viscous: 1e-3,
            random: TestRandom::new(9),
            ..motor
        }
    });
    (motors, [Some(stored); 2])
}

#[test]
fn a_second_day_is_enabled_without_motion_by_the_motors() {
    let mut machine = Machine::turned();
    assert_eq!(machine.most_ampere, 0.0);
    let begin = machine.motors.each_ref().map(|motor| motor.angle);
    machine.calibrate(2.9);
    assert_eq!(machine.results(), [(1, "confirmed"), (2, "confirmed")]);
    for (motor, begin) in machine.motors.iter().zip(begin) {
        let moved = (motor.angle - begin) * 7.0 / core::f64::consts::TAU;
        assert!(moved.abs() < 0.005, "{moved} electrical turns");
    }
    // Reference, then by hand into the range: 0.4 rad of the joint.
    machine.reference();
    assert!(machine.signals.has_begun());
    machine.turn(20.0);
    machine.hold(false, false, 0.3);
    machine.hold(true, false, 0.5);
    assert_eq!(machine.control.state(), DriveState::OperationEnabled);
    assert_eq!(machine.is_proven(), [false; 2]);
    // The held pose resists a hand; its motion proves both angles.
    machine.turn(-4.0);
    machine.hold(true, false, 0.1);
    assert_eq!(machine.is_proven(), [true; 2]);
    assert_eq!(machine.control.state(), DriveState::OperationEnabled);
}

#[test]
fn the_operator_is_told_when_an_index_is_certain_and_when_no_more() {
    let certain = |machine: &Machine| -> Vec<(u8, bool)> {
        picked!(machine.records, Record::Index { joint, certain } => (*joint, *certain)).collect()
    };
    let (motors, stored) = second_day();
    let mut machine = Machine::new(motors, stored);
    machine.hold(false, false, 0.1);
    machine.turn(0.9 * core::f64::consts::TAU);
    assert_eq!(certain(&machine), []);
    machine.turn(1.3 * core::f64::consts::TAU);
    assert_eq!(certain(&machine), [(1, true), (2, true)]);
    // Counts are lost at the second motor.
    machine.counted[1] = 20;
    machine.turn(core::f64::consts::TAU);
    assert_eq!(certain(&machine), [(1, true), (2, true), (2, false)]);
    machine.turn(core::f64::consts::TAU);
    assert_eq!(certain(&machine), [(1, true), (2, true), (2, false), (2, true)]);
}

#[test]
fn an_interrupted_check_can_be_repeated_without_turning_the_joints_again() {
    let mut machine = Machine::turned();
    for _ in 0..2 {
        machine.calibrate(0.5);
        machine.hold(false, false, 0.1);
    }
    machine.calibrate(2.9);
    let interrupted = (1, "interrupted");
    assert_eq!(machine.results(), [interrupted, interrupted, (1, "confirmed"), (2, "confirmed")]);
}

#[test]
fn a_joint_that_still_moves_when_start_is_pressed_can_be_checked_afterwards() {
    let mut machine = Machine::turned();
    machine.hold(true, false, 0.1);
    machine.drive(true, 20.0);
    machine.hold(true, true, 0.1);
    machine.drive(false, 0.0);
    machine.calibrate(2.9);
    assert_eq!(machine.results(), [(1, "turning"), (1, "confirmed"), (2, "confirmed")]);
}

#[test]
fn a_check_at_standstill_leaves_what_is_stored() {
    let (mut motor, stored) = (TestMotor::default(), measured().stored().expect("an index"));
    let mut state = AxisState::OFF;
    (motor.driven, motor.speed) = (true, 60.0);
    for _ in 0..6000 {
        let sample = motor.period(AxisCommand::OFF);
        state.tick(&sample, Bridges::Follow, crate::motor::AxisRequest::OFF, |_, _, command| command);
    }
    (motor.driven, motor.speed) = (false, 0.0);
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
    let (_, order) = bench.press().remove(0);
    let outcome = carried_out_by(&mut state, &mut motor, order);
    let Outcome::Calibrated(found) = outcome else { panic!("{outcome:?}") };
    assert!(!found.is_proven() && found.stored() != Some(stored));
    bench.ends(0, outcome);
    assert_eq!(bench.calibrated, [(0, Some(stored))]);
}

#[test]
fn a_moved_rotor_keeps_what_is_stored_but_has_to_turn_next() {
    let calibration = measured();
    let stored = calibration.stored().expect("an index");
    let turning = |stored| {
        let calibrator = Calibrator::from_stored(&CONFIGURATION, SETTINGS, stored).expect("usual");
        Order::Calibrate(calibrator.turning())
    };
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING).with_stored([Some(stored); 2]));
    assert_eq!(bench.press(), [(0, checked(stored))]);
    bench.ends(0, Outcome::Refused(CalibrationRefusal::Moved));
    for _ in 0..2 {
        // A further push or an opened switch changes nothing.
        assert_eq!(bench.press(), [(0, turning(stored))]);
        bench.ends(0, Outcome::Refused(CalibrationRefusal::Turning));
        assert_eq!(bench.press(), [(0, turning(stored))]);
        bench.ends(0, Outcome::Interrupted);
    }
    assert_eq!(bench.press(), [(0, turning(stored))]);
    // The other axis may still be checked at standstill.
    let orders = bench.ends(0, Outcome::Calibrated(calibration));
    assert!(matches!(&orders[..], [(0, Order::Run(_)), (1, order)] if *order == checked(stored)));
    bench.ends(1, Outcome::Calibrated(calibration));
    // A lost rotor position, such as one found by the first motion, has to turn as well.
    bench.ends(0, Outcome::Fault { fault: AxisFault::Encoder, lost: true });
    bench.hold(false, false);
    assert_eq!(bench.press(), [(0, turning(stored))]);
    // An offset that the motion contradicts is measured again.
    bench.ends(0, Outcome::Refused(CalibrationRefusal::StoredOffset(Mismatch { stated: 0.1, found: 0.2 })));
    assert_eq!(bench.press(), [(0, unchecked())]);
}

#[test]
fn a_stall_or_a_lost_axis_forgets_the_index() {
    let (mut motor, calibration) = (TestMotor::default(), measured());
    let mut state = AxisState::OFF;
    let turned = |state: &mut AxisState, motor: &mut TestMotor| {
        (motor.driven, motor.speed) = (true, 60.0);
        for _ in 0..6000 {
            let sample = motor.period(AxisCommand::OFF);
            state.tick(&sample, Bridges::Follow, crate::motor::AxisRequest::OFF, |_, _, command| command);
        }
    };
    for long in [false, true] {
        turned(&mut state, &mut motor);
        assert_ne!(state, AxisState::OFF);
        state.stood_still(&motor.sample(), long);
        assert_eq!(state, AxisState::OFF);
    }
    turned(&mut state, &mut motor);
    let axis = Axis::new(&CONFIGURATION, &calibration, &motor.sample()).expect("usual");
    state.apply_order(Order::Run(axis));
    turned(&mut state, &mut motor);
    state.apply_order(Order::Off);
    assert_eq!(state, AxisState::OFF);
}
