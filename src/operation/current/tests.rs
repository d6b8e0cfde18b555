use super::super::axis_state::Order;
use super::super::testing::TestHardware;
use super::super::{Ends, EventQueue, Queues};
use super::*;
use crate::hal::CURRENT_RATE_HZ;
use crate::leg::AxisFault;
use crate::motor::calibration::tests::calibrate;
use crate::motor::testing::{CONFIGURATION, TestMotor};
use crate::motor::{Axis, AxisConfiguration, SenseScale};
use crate::units::Hertz;

mod reported;
mod requests;
mod stop;

/// Clock ticks per period, as on the board.
const PERIOD: NonZeroU32 = NonZeroU32::new(7000).expect("more than none");
/// Periods of a sector's erasure: 1.5 s.
const ERASED: u32 = 36_000;
/// Periods of a word's write: 0.1 ms, rounded up.
const WRITTEN: u32 = 3;

/// Two axes on externally driven motors, with the servo begun.
struct Bench {
    loops: CurrentLoops<2>,
    motors: [TestMotor; 2],
    hardware: TestHardware<2>,
    signals: Signals<2>,
    queues: Queues<2>,
    events: Box<EventQueue<2>>,
    now: u32,
    /// An index pulse whose interrupt comes late and captures the present count.
    late_index: bool,
    /// Outcomes sent to the housekeeping.
    outcomes: Vec<(usize, Outcome)>,
    /// Joints whose servo was requested to damp.
    damped: [bool; 2],
}

impl Bench {
    fn new(configuration: &AxisConfiguration) -> Self {
        let counts_per_turn = f64::from(configuration.counts_per_turn);
        let mut motors = [0.3, 2.0].map(|angle| TestMotor { angle, counts_per_turn, ..TestMotor::default() });
        let states = motors.each_mut().map(|motor| {
            let calibration = calibrate(motor, configuration).expect("sound");
            (motor.speed, motor.driven) = (0.0, true);
            AxisState::running(Axis::new(configuration, &calibration, &motor.sample()).expect("usual"))
        });
        let chopper = Chopper::new(Volt(50.0), Volt(54.0));
        let mut bench = Self {
            loops: CurrentLoops::new(states, PERIOD, chopper, SenseScale::ODRIVE_3_6.volt_per_code),
            motors,
            hardware: TestHardware::new(),
            signals: Signals::new(),
            queues: Queues::new(),
            events: Box::default(),
            now: 0,
            late_index: false,
            outcomes: Vec::new(),
            damped: [false; 2],
        };
        bench.signals.begin_servo();
        bench.run(100);
        bench
    }

    fn causes(&self) -> u32 {
        self.signals.inhibit.causes()
    }

    /// Runs one tick of an axis, and the servo's where it is requested.
    fn tick_axis(&mut self, axis: usize, tick: &Tick) {
        let Ends { mut current, mut housekeeping, mut servo, .. } = self.queues.split(&mut self.events);
        let requested = self.hardware.servo_pended;
        self.loops.tick(axis, tick, &mut current, &self.signals, &mut self.hardware);
        assert!(!self.hardware.is_enabled(), "no current is requested");
        if self.hardware.servo_pended != requested {
            self.signals.statistics.servo_ticks.add();
        }
        servo.samples.iter_mut().for_each(|samples| while samples.dequeue().is_some() {});
        let sent = core::iter::from_fn(|| housekeeping.outcomes[axis].dequeue());
        self.outcomes.extend(sent.map(|outcome| (axis, outcome)));
        for (joint, damped) in self.damped.iter_mut().enumerate() {
            *damped |= self.signals.take_reported(joint).any(|fault| fault == BoardFault::CurrentTicks);
        }
    }

    /// Runs one period with a tick of every axis; if `torn`, one shunt's conversion is missing.
    fn tick(&mut self, torn: bool) {
        self.now = self.now.wrapping_add(PERIOD.get());
        for axis in 0..2 {
            let mut sample = self.motors[axis].period(AxisCommand::OFF);
            if self.late_index {
                sample.index_count = Some(sample.encoder_count);
            }
            self.tick_axis(axis, &Tick { complete: !torn, ..tick_at(self.now, sample) });
        }
    }

    fn run(&mut self, periods: u32) {
        (0..periods).for_each(|_| self.tick(false));
    }

    /// Stalls for some periods while both rotors turn by some turns.
    fn stand(&mut self, periods: u32, turns: f64) {
        self.now = self.now.wrapping_add(periods * PERIOD.get());
        for motor in &mut self.motors {
            motor.angle += turns * core::f64::consts::TAU;
        }
    }

    fn store(&mut self) {
        self.signals.inhibit.raise(InhibitReason::Storing);
        self.run(480);
    }

    fn stored(&mut self) {
        self.run(24);
        self.signals.inhibit.end_storing();
        self.run(240);
    }

    /// Turns both rotors through a whole turn past their index. Returns whether no axis finds it at a wrong
    /// position.
    fn is_at_its_position(&mut self) -> bool {
        self.motors.iter_mut().for_each(|motor| motor.speed = 60.0);
        self.run(2600);
        let faults = self.loops.axes.each_ref().map(|axis| axis.stage.fault());
        faults == [None; 2] && self.causes() == 0
    }
}

/// Tick of a healthy board.
fn tick_at(now: u32, sample: AxisSample) -> Tick {
    Tick { now, emergency_stop: false, gate_fault: false, complete: true, supply: true, sample }
}

#[test]
fn an_axis_without_index_pulses_finds_its_position_lost() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.motors.iter_mut().for_each(|motor| motor.speed = 60.0);
    // Three turns.
    for _ in 0..7800 {
        bench.now = bench.now.wrapping_add(PERIOD.get());
        for axis in 0..2 {
            let sample = AxisSample { index_count: None, ..bench.motors[axis].period(AxisCommand::OFF) };
            bench.tick_axis(axis, &tick_at(bench.now, sample));
        }
    }
    let lost = |axis| {
        move |(of, outcome): &(usize, Outcome)| {
            *of == axis && matches!(outcome, Outcome::Fault { fault: AxisFault::Encoder, lost: true })
        }
    };
    assert!([0, 1].iter().all(|axis| bench.outcomes.iter().any(lost(*axis))), "{:?}", bench.outcomes);
}

#[test]
fn an_axis_checks_its_constants_in_every_servo_period() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.run(TICKS_PER_SERVO);
    bench.loops.axis_state_mut(1).and_then(AxisState::axis_mut).expect("running").flip_bit(0, 3);
    // The checksum of the constants is compared in every 256th servo period.
    bench.run(256 * TICKS_PER_SERVO);
    let is_seen = |(axis, outcome): &(usize, Outcome)| {
        *axis == 1 && matches!(outcome, Outcome::Fault { fault: AxisFault::Parameters, .. })
    };
    assert!(bench.outcomes.iter().any(is_seen), "{:?}", bench.outcomes);
}

#[test]
fn an_ordered_bandwidth_reaches_the_running_axis() {
    let mut bench = Bench::new(&CONFIGURATION);
    let state = bench.loops.axis_state_mut(1).expect("two axes");
    let before = *state.axis_mut().expect("running");
    let mut expected = before;
    expected.set_bandwidth(Hertz(600.0));
    assert_eq!(state.apply_order(Order::Bandwidth(Hertz(600.0))), None);
    assert_eq!(state.axis_mut(), Some(&mut expected));
    assert_ne!(before, expected);
}

#[test]
fn the_brake_resistor_has_no_duty_while_the_flash_is_written() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.motors.iter_mut().for_each(|motor| motor.bus = 53.0);
    bench.run(3);
    assert!(bench.hardware.brake > 0.7, "{}", bench.hardware.brake);
    bench.signals.inhibit.raise(InhibitReason::Storing);
    bench.tick(false);
    assert_eq!(bench.hardware.brake, 0.0);
    bench.signals.inhibit.end_storing();
    bench.tick(false);
    assert!(bench.hardware.brake > 0.7, "{}", bench.hardware.brake);
}

#[test]
fn an_erasure_discards_only_the_zeros() {
    // At rest, an eighth of a turn, half of the counter's range, one full range, far.
    for turns in [0.0, 0.125, -0.4, 4.0, 8.0, -8.0, 123.456] {
        let mut bench = Bench::new(&CONFIGURATION);
        bench.store();
        assert!(bench.signals.has_begun());
        bench.stand(ERASED, turns);
        // The first conversions afterwards may be torn, and the index's interrupt comes at another position.
        bench.late_index = true;
        bench.tick(true);
        bench.tick(false);
        bench.late_index = false;
        bench.stand(ERASED, turns);
        bench.stored();
        assert!(!bench.signals.has_begun());
        assert_eq!(bench.damped, [false; 2]);
        let expected = [0, 1, 0, 1].map(|axis| (axis, Outcome::StoodStill));
        assert_eq!(bench.outcomes, expected, "{turns}");
        assert_eq!(bench.causes(), 0);
        // The rotor angle is still known: the index is at its position.
        assert!(bench.is_at_its_position(), "{turns}");
        assert_eq!(bench.outcomes.len(), 4);
    }
}

#[test]
fn writing_words_discards_nothing() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.store();
    for _ in 0..100 {
        // Motion of a falling joint: 60 rad/s of its motor.
        bench.stand(WRITTEN, 60.0 / core::f64::consts::TAU * f64::from(WRITTEN) / f64::from(CURRENT_RATE_HZ));
        bench.tick(false);
    }
    bench.stored();
    assert_eq!((bench.signals.has_begun(), bench.outcomes.len(), bench.causes()), (true, 0, 0));
    assert!(bench.is_at_its_position());
}

#[test]
fn an_erasure_loses_the_position_of_an_uneven_counter_range() {
    let configuration = AxisConfiguration { counts_per_turn: 10_000, ..CONFIGURATION };
    let lost = Outcome::Fault { fault: AxisFault::Encoder, lost: true };
    for (periods, is_lost) in [(WRITTEN, false), (ERASED, true)] {
        let mut bench = Bench::new(&configuration);
        bench.store();
        bench.stand(periods, 0.001);
        bench.stored();
        assert_eq!(bench.outcomes.contains(&(0, lost)), is_lost);
        assert_eq!(bench.signals.has_begun(), !is_lost);
    }
}

#[test]
fn the_same_gap_without_a_flash_write_is_a_fault() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.stand(ERASED, 0.4);
    bench.run(3);
    assert_eq!(bench.damped, [true; 2]);
    assert_eq!(bench.causes() & InhibitReason::CurrentTicks.bit(), InhibitReason::CurrentTicks.bit());
    let mut bench = Bench::new(&CONFIGURATION);
    bench.tick(true);
    assert_eq!(bench.causes(), InhibitReason::Conversion.bit());
}

#[test]
fn late_ticks_are_reported_for_their_own_joint() {
    for late in [0, 1] {
        let mut bench = Bench::new(&CONFIGURATION);
        // The other axis' ticks are on time.
        for period in 1..=8 {
            bench.now = bench.now.wrapping_add(PERIOD.get());
            for axis in 0..2 {
                if axis != late || period > 4 {
                    let sample = bench.motors[axis].period(AxisCommand::OFF);
                    bench.tick_axis(axis, &tick_at(bench.now, sample));
                }
            }
        }
        assert_eq!(bench.damped, [late == 0, late == 1]);
    }
}

#[test]
fn the_emergency_stop_works_during_a_flash_write() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.store();
    let tick = Tick { emergency_stop: true, ..tick_at(bench.now, bench.motors[0].sample()) };
    bench.tick_axis(0, &tick);
    assert_eq!(bench.causes(), InhibitReason::Storing.bit() | InhibitReason::EmergencyStop.bit());
}

#[test]
fn a_missing_bus_voltage_inhibits_at_the_second_period() {
    let mut bench = Bench::new(&CONFIGURATION);
    // A code above the threshold of the brake resistor, which is no longer measured.
    bench.motors[0].bus = 53.0;
    let mut causes = Vec::new();
    for supply in [false, true, false, false] {
        let sample = bench.motors[0].sample();
        let tick = Tick { supply, ..tick_at(bench.now, sample) };
        bench.tick_axis(0, &tick);
        bench.now += PERIOD.get();
        causes.push(bench.causes());
    }
    // The first missing reading is tolerated.
    assert_eq!(causes, [0, 0, 0, InhibitReason::Conversion.bit()]);
    assert_eq!(bench.hardware.brake, 0.0);
}

#[test]
fn the_brake_resistor_takes_the_larger_duty_of_servo_and_bus_voltage() {
    let mut bench = Bench::new(&CONFIGURATION);
    bench.motors.iter_mut().for_each(|motor| motor.bus = 48.0);
    bench.signals.set_wanted_brake(0.25);
    bench.run(2);
    assert_eq!([bench.hardware.brake, bench.signals.given_brake()], [0.25; 2]);
    bench.motors.iter_mut().for_each(|motor| motor.bus = 53.0);
    bench.run(2);
    assert!(bench.hardware.brake > 0.7 && bench.signals.given_brake() == bench.hardware.brake);
    // The energy budget counts for both.
    bench.run(24_000);
    assert_eq!([bench.hardware.brake, bench.signals.given_brake()], [0.0; 2]);
    let mut bench = Bench::new(&CONFIGURATION);
    bench.loops.remove_chopper();
    bench.signals.set_wanted_brake(0.25);
    bench.run(2);
    assert_eq!([bench.hardware.brake, bench.signals.given_brake()], [0.0; 2]);
}

#[test]
fn only_a_stall_of_more_than_2_ms_discards_the_zeros() {
    for (stood, forgets) in [(CERTAIN_PERIODS, false), (CERTAIN_PERIODS + 1, true)] {
        let mut bench = Bench::new(&CONFIGURATION);
        bench.store();
        bench.stand(stood, 0.0);
        bench.stored();
        assert_eq!(bench.outcomes.contains(&(0, Outcome::StoodStill)), forgets, "{stood}");
    }
}
