use super::*;
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::calibration::tests::calibrate;
use crate::motor::testing::{CONFIGURATION, TestMotor};
use crate::motor::{AxisConfiguration, DeadTime, Direction};
use crate::units::{Volt, Weber};

mod first_motion;
mod index;
mod watches;

const fn ask(current: f32) -> AxisRequest {
    AxisRequest { enabled: true, current: Ampere(current) }
}

/// A motor that turns at a given mechanical speed, its axis, and the newest sample.
#[derive(Clone)]
struct Bench {
    motor: TestMotor,
    axis: Axis,
    sample: AxisSample,
}

impl Bench {
    fn at(speed: f64, configuration: &AxisConfiguration) -> Self {
        let mut motor = TestMotor::default();
        let calibration = calibrate(&mut motor, configuration).expect("sound");
        (motor.driven, motor.speed) = (true, speed);
        let sample = motor.sample();
        let axis = Axis::new(configuration, &calibration, &sample).expect("usual");
        let mut bench = Self { motor, axis, sample };
        // Track the speed before anything switches.
        bench.run(AxisRequest::OFF, 480);
        bench
    }

    /// The board's calls of a servo period after a tick: checks, and the joint's sample after the sixth.
    fn follow_up(&mut self, tick: usize) {
        match tick % 6 {
            0 => self.axis.check_constants(),
            2 => self.axis.check(),
            5 => {
                let _ = self.axis.joint_sample();
            }
            _ => {}
        }
    }

    fn tick(&mut self, request: AxisRequest) -> AxisCommand {
        let command = self.axis.tick(&self.sample, request);
        self.sample = self.motor.period(command);
        command
    }

    /// Runs ticks and takes the joint's sample after every sixth, as a board does.
    fn run_sampled(&mut self, request: AxisRequest, ticks: usize, inject: impl Fn(&mut AxisSample)) {
        for tick in 0..ticks {
            inject(&mut self.sample);
            self.tick(request);
            self.follow_up(tick);
        }
    }

    fn run(&mut self, request: AxisRequest, ticks: usize) -> AxisCommand {
        (0..ticks).fold(AxisCommand::OFF, |_, _| self.tick(request))
    }

    /// Mean and spread (peak to peak) of both true currents over at least one electrical turn.
    fn watch(&mut self, request: AxisRequest, ticks: usize) -> [(f64, f64); 2] {
        let (mut sum, mut least, mut most) = ([0.0; 2], [f64::MAX; 2], [f64::MIN; 2]);
        for _ in 0..ticks {
            self.tick(request);
            for axis in 0..2 {
                let current = self.motor.current[axis];
                sum[axis] += current;
                least[axis] = least[axis].min(current);
                most[axis] = most[axis].max(current);
            }
        }
        [0, 1].map(|axis| (sum[axis] / ticks as f64, most[axis] - least[axis]))
    }
}

#[test]
fn the_torque_current_follows_and_the_field_stays_zero_at_every_speed_and_sign() {
    for speed in [0.0, 50.0, -120.0, 225.0] {
        let mut bench = Bench::at(speed, &CONFIGURATION);
        for current in [15.0, -15.0] {
            bench.run(ask(current), 1200);
            let [(d, _), (q, _)] = bench.watch(ask(current), 2400);
            // Tolerance: current-sensor offsets to 0.3 codes, a degree of angle error.
            assert!((q - f64::from(current)).abs() < 0.1 && d.abs() < 0.3, "{speed} rad/s: {d} {q} A");
        }
        assert_eq!(bench.axis.fault(), None);
        // One count per tick is 18 rad/s of the motor; tracked to a fiftieth.
        let electrical = f64::from(bench.axis.speed.rad_per_s());
        assert!((electrical - 7.0 * speed).abs() < 4.0, "{electrical} rad/s");
    }
}

#[test]
fn the_voltage_is_turned_to_where_the_rotor_will_be_in_the_middle_of_its_period() {
    // A loop just enabled, without feedforward and at zero measured current, returns a quadrature voltage of
    // kp times the target. So the duties lie a quarter turn ahead of the angle in which they act.
    for counts_per_tick in [5_i32, -5, 12, -12] {
        let configuration =
            AxisConfiguration { feedforward: false, dead_time: DeadTime::Uncompensated, ..CONFIGURATION };
        let mut bench = Bench::at(0.0, &configuration);
        let mut sample = bench.sample;
        sample.shunt_codes = bench.axis.constants.current_offsets.map(|zero| (zero + 0.5) as u16);
        sample.index_count = None;
        for _ in 0..1200 {
            bench.axis.tick(&sample, AxisRequest::OFF);
            sample.encoder_count = sample.encoder_count.wrapping_add(counts_per_tick as u16);
        }
        let [a, b, c] = bench.axis.tick(&sample, ask(10.0)).duty;
        let alpha = f64::from(2.0 * a - b - c) / 3.0;
        let beta = f64::from(b - c) * 0.577_350_269;
        let scale = &bench.axis.constants.scale;
        let angle = scale.angle(bench.axis.position).plus(bench.axis.constants.offset);
        let duty_turns = crate::real::atan2(beta, alpha) / core::f64::consts::TAU;
        let ahead = duty_turns - 0.25 - f64::from(angle.turns());
        let expected = 1.5 * f64::from(counts_per_tick) * 7.0 / 8192.0;
        // Tolerance: half a code of current against ten ampere is a tenth of a degree. One period more or
        // less is at least 1.5 degrees.
        let error = (ahead - expected - (ahead - expected).round()) * 360.0;
        assert!(error.abs() < 0.3, "{counts_per_tick} counts per tick: {error} degrees");
    }
}

#[test]
fn dead_time_compensation_leaves_less_of_the_sixth_harmonic() {
    let ripple = |dead_time| {
        let mut bench = Bench::at(60.0, &AxisConfiguration { dead_time, ..CONFIGURATION });
        bench.motor.noise_codes = 0.0;
        bench.run(ask(10.0), 1200);
        let [_, (_, spread)] = bench.watch(ask(10.0), 1200);
        spread
    };
    let with = ripple(DeadTime::Compensated { band: Ampere(0.3) });
    let without = ripple(DeadTime::Uncompensated);
    assert!(with < 0.7 * without, "{with} A with, {without} A without");
}

#[test]
fn the_joint_sample_belongs_to_the_middle_of_its_ticks_and_starts_over() {
    let mut bench = Bench::at(200.0, &CONFIGURATION);
    bench.run(ask(5.0), 600);
    let first = bench.axis.joint_sample();
    assert!((first.current.0 - 5.0).abs() < 0.2, "{first:?}");
    bench.run(ask(5.0), 6);
    let second = bench.axis.joint_sample();
    bench.run(ask(5.0), 6);
    let third = bench.axis.joint_sample();
    // 200 rad/s are 10.865 counts per tick, 65.2 in six ticks.
    assert!((64..=67).contains(&(third.encoder_counts - second.encoder_counts)), "{second:?} {third:?}");
    // Without a tick in between, the newest count is returned: two and a half ticks later.
    let newest = bench.axis.joint_sample();
    assert!((25..=30).contains(&(newest.encoder_counts - third.encoder_counts)), "{newest:?}");
    bench.axis.set_counts(-1_000_000);
    assert_eq!(bench.axis.joint_sample().encoder_counts, -1_000_000);
}

#[test]
fn counts_stay_exact_through_many_wraps_of_the_counter() {
    let mut bench = Bench::at(-400.0, &AxisConfiguration { flexion: Direction::Down, ..CONFIGURATION });
    let _ = bench.axis.joint_sample();
    bench.axis.set_counts(0);
    let begin = bench.motor.angle;
    bench.run(AxisRequest::OFF, CURRENT_RATE_HZ as usize);
    // The newest sample has not been ticked yet.
    bench.tick(AxisRequest::OFF);
    bench.tick(AxisRequest::OFF);
    let turned = -(bench.motor.angle - begin) / core::f64::consts::TAU * 8192.0;
    let _ = bench.axis.joint_sample();
    let counts = f64::from(bench.axis.joint_sample().encoder_counts);
    // 521,000 counts, eight wraps; two ticks of 21.7 counts between sample and motor.
    assert!(turned > 500_000.0 && (turned - counts).abs() < 70.0, "{turned} {counts}");
}

#[test]
fn the_bandwidth_of_a_running_axis_changes_without_a_fault_or_a_jump() {
    // Current in the tick at which a step of 20 A begins to flow, as a share of it.
    let begins = |bandwidth: Option<f32>| {
        let mut bench = Bench::at(0.0, &CONFIGURATION);
        if let Some(bandwidth) = bandwidth {
            bench.axis.set_bandwidth(Hertz(bandwidth));
        }
        bench.run(ask(20.0), 4);
        bench.axis.measured().q.0.abs() / 20.0
    };
    let shares = [None, Some(1000.0), Some(500.0)].map(begins);
    assert!((shares[0] - shares[1]).abs() < 1e-3 && shares[2] < 0.6 * shares[0], "{shares:?}");
    // While a current flows, with all checks, over several checksums.
    let mut bench = Bench::at(60.0, &CONFIGURATION);
    for bandwidth in [500.0, 1000.0, 700.0] {
        bench.run_sampled(ask(15.0), 3000, |_| ());
        bench.axis.set_bandwidth(Hertz(bandwidth));
        for _ in 0..100 {
            bench.tick(ask(15.0));
            let current = bench.axis.measured().q.0.abs();
            assert!((current - 15.0).abs() < 1.0, "{current} A at {bandwidth} Hz");
        }
    }
    assert_eq!(bench.axis.fault(), None);
    // A damaged limit is still found after a change.
    bench.axis.flip_bit(0, 3);
    bench.axis.set_bandwidth(Hertz(600.0));
    bench.run_sampled(ask(15.0), 2000, |_| ());
    assert_eq!(bench.axis.fault(), Some(AxisFault::Parameters));
}

#[test]
fn every_bound_turns_off_until_the_fault_is_cleared() {
    type Inject = fn(&mut AxisSample);
    let injections: [(Inject, AxisFault, usize); 4] = [
        (|sample| sample.shunt_codes[1] = 4000, AxisFault::CurrentSense, 2),
        (|sample| sample.bus_code = 3950, AxisFault::BusVoltage, 2),
        (|sample| sample.bus_code = 0, AxisFault::BusVoltage, 2),
        (|sample| sample.shunt_codes = [3700, 2048], AxisFault::Overcurrent, 1),
    ];
    for (inject, fault, patience) in injections {
        let mut bench = Bench::at(50.0, &CONFIGURATION);
        bench.run(ask(5.0), 100);
        for tick in 1..=patience {
            assert_eq!(bench.axis.fault(), None);
            inject(&mut bench.sample);
            assert_eq!(bench.tick(ask(5.0)).enabled, tick < patience, "{fault:?}");
        }
        assert_eq!(bench.axis.fault(), Some(fault));
        assert_eq!(bench.run(ask(5.0), 10), AxisCommand::OFF);
        assert!(bench.axis.clear_fault());
        assert!(bench.run(ask(5.0), 10).enabled);
    }
}

#[test]
fn who_is_about_to_switch_is_patient_with_no_bad_sample() {
    type Inject = fn(&mut AxisSample);
    let cases: [(Inject, AxisFault); 3] = [
        (|sample| sample.shunt_codes[0] = 0, AxisFault::CurrentSense),
        (|sample| sample.bus_code = 4095, AxisFault::BusVoltage),
        (|sample| sample.encoder_count ^= 0x4000, AxisFault::Encoder),
    ];
    for (inject, fault) in cases {
        let mut bench = Bench::at(0.0, &CONFIGURATION);
        inject(&mut bench.sample);
        assert_eq!((bench.tick(ask(5.0)), bench.axis.fault()), (AxisCommand::OFF, Some(fault)));
        // While switching, the same sample is tolerated.
        let mut bench = Bench::at(0.0, &CONFIGURATION);
        bench.run(ask(5.0), 10);
        inject(&mut bench.sample);
        assert!(bench.tick(ask(5.0)).enabled && bench.axis.fault().is_none(), "{fault:?}");
    }
}

#[test]
fn one_bad_sample_is_survived_and_a_lost_position_is_not_cleared() {
    let mut bench = Bench::at(50.0, &CONFIGURATION);
    bench.run(ask(5.0), 100);
    for _ in 0..10 {
        bench.sample.encoder_count ^= 0x4000;
        assert!(bench.tick(ask(5.0)).enabled);
        bench.run(ask(5.0), 2);
    }
    assert_eq!(bench.axis.fault(), None);
    for _ in 0..2 {
        bench.sample.encoder_count ^= 0x4000;
        bench.tick(ask(5.0));
    }
    assert_eq!(bench.axis.fault(), Some(AxisFault::Encoder));
    // Without the rotor's angle only braking is left.
    assert_eq!(bench.run(ask(5.0), 10), AxisCommand::BRAKE);
    assert_eq!(bench.run(AxisRequest::OFF, 1), AxisCommand::OFF);
    assert!(!bench.axis.clear_fault());
}

#[test]
fn nothing_that_is_not_finite_reaches_the_bridge() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut bench = Bench::at(0.0, &CONFIGURATION);
        bench.run(ask(5.0), 100);
        assert_eq!(bench.tick(ask(bad)), AxisCommand::OFF);
        assert_eq!(bench.axis.fault(), Some(AxisFault::NotANumber));
        assert!(bench.axis.clear_fault());
        bench.run(ask(5.0), 600);
        let [_, (q, _)] = bench.watch(ask(5.0), 600);
        assert!((q - 5.0).abs() < 0.1, "{q} A");
    }
}

#[test]
fn an_axis_of_absurd_numbers_is_refused_by_part() {
    let refused = |change: fn(&mut AxisConfiguration)| {
        let mut configuration = CONFIGURATION;
        change(&mut configuration);
        configuration.check().expect_err("absurd")
    };
    assert_eq!(refused(|c| c.pole_pairs = 0), AxisError::Encoder);
    assert_eq!(refused(|c| c.sense.volt_per_code = Volt(f32::NAN)), AxisError::Sense);
    assert_eq!(refused(|c| c.timing.settling.0 = 1.0), AxisError::Timing);
    assert_eq!(refused(|c| c.greatest_speed.0 = 1e5), AxisError::Speed);
    assert_eq!(refused(|c| c.flux = Weber(0.0)), AxisError::Motor);
    assert_eq!(refused(|c| c.bandwidth.0 = 1e4), AxisError::Motor);
    assert_eq!(refused(|c| c.current_limit.0 = 56.0), AxisError::Current);
    assert_eq!(refused(|c| c.overcurrent.0 = 70.0), AxisError::Current);
    assert_eq!(refused(|c| c.bus = [Volt(30.0), Volt(20.0)]), AxisError::Bus);
    // The converter's range ends at 62.7 V.
    assert_eq!(refused(|c| c.bus[1] = Volt(60.0)), AxisError::Bus);
    // 7 pole pairs and 2.9 mV s make 58 V between two phases at 1650 rad/s.
    assert_eq!(refused(|c| c.greatest_speed.0 = 1700.0), AxisError::BackEmf);
    assert_eq!(CONFIGURATION.check(), Ok(()));
}

#[test]
fn every_one_of_the_65536_offsets_of_the_counter_gives_the_same_bits() {
    for speed in [180.0, -180.0] {
        let mut bench = Bench::at(speed, &CONFIGURATION);
        bench.run(ask(12.0), 240);
        // 48 ticks are 470 counts, so all offsets include each one from which the counter wraps on the way.
        let begin = bench.axis;
        let samples: [AxisSample; 48] = core::array::from_fn(|_| {
            let sample = bench.sample;
            bench.tick(ask(12.0));
            sample
        });
        let mut reference = begin;
        let commands = samples.map(|sample| reference.tick(&sample, ask(12.0)));
        let joint = reference.joint_sample();
        for offset in 0..=u16::MAX {
            let mut axis = begin;
            axis.counter = axis.counter.wrapping_add(offset);
            for (sample, command) in samples.iter().zip(&commands) {
                let shifted = AxisSample {
                    encoder_count: sample.encoder_count.wrapping_add(offset),
                    index_count: sample.index_count.map(|count| count.wrapping_add(offset)),
                    ..*sample
                };
                assert_eq!(axis.tick(&shifted, ask(12.0)), *command, "{offset}");
            }
            assert_eq!((axis.joint_sample(), axis.fault()), (joint, None), "{offset}");
        }
    }
}

#[test]
fn a_rejected_reading_is_reported_once() {
    let mut bench = Bench::at(60.0, &CONFIGURATION);
    bench.run(ask(5.0), 240);
    assert!(!bench.axis.joint_sample().doubtful);
    bench.run(ask(5.0), 3);
    bench.sample.encoder_count = bench.sample.encoder_count.wrapping_add(5000);
    bench.run(ask(5.0), 3);
    assert_eq!([bench.axis.joint_sample().doubtful, bench.axis.joint_sample().doubtful], [true, false]);
    assert_eq!(bench.axis.fault(), None);
}

/// Accepted or not, one wrong reading of any size stops nothing and leaves the rotor position unchanged.
#[test]
fn the_way_back_from_a_wrong_reading_is_no_second_one() {
    for speed in [-60.0, 0.0, 60.0] {
        let bench = Bench::at(speed, &CONFIGURATION);
        let mut sound = bench.clone();
        sound.run(AxisRequest::OFF, 12);
        sound.axis.joint_sample();
        sound.run(AxisRequest::OFF, 6);
        let expected = sound.axis.joint_sample().encoder_counts;
        for size in (1..=80).flat_map(|size| [size, -size]) {
            let mut bench = bench.clone();
            bench.sample.encoder_count = bench.sample.encoder_count.wrapping_add_signed(size);
            bench.run(AxisRequest::OFF, 12);
            assert_eq!(bench.axis.fault(), None, "{size} counts at {speed} rad/s");
            bench.axis.joint_sample();
            bench.run(AxisRequest::OFF, 6);
            assert_eq!(bench.axis.joint_sample().encoder_counts, expected, "{size} counts at {speed} rad/s");
        }
    }
}

#[test]
fn the_squared_current_has_both_components_and_counts_a_brake() {
    let mut bench = Bench::at(60.0, &CONFIGURATION);
    bench.run(ask(20.0), 1200);
    let follows = bench.axis.square_a2();
    assert!((follows - 400.0).abs() < 8.0, "{follows}");
    for _ in 0..1200 {
        let command = bench.axis.act(&bench.sample, BridgeRequest::Brake);
        bench.sample = bench.motor.period(command);
    }
    let (Rotating { d, q }, brakes) = (bench.axis.measured(), bench.axis.square_a2());
    assert!(d.0.abs() > 1.0 && q.0.abs() > 1.0, "{d:?} {q:?}");
    assert!((brakes - d.0 * d.0 - q.0 * q.0).abs() < 1e-3 * brakes, "{brakes}");
}

#[test]
fn a_mean_of_counts_is_right_although_their_sum_wraps() {
    let mut window = Window::EMPTY;
    for ticks in 0..4 {
        window.push(1_600_000_000 + ticks, 2.0);
    }
    let mean = window.mean().expect("four ticks");
    assert_eq!((mean.encoder_counts, mean.current), (1_600_000_001, Ampere(2.0)));
}
