//! Faults that an axis detects by comparing voltages, currents, counts and codes.

use super::*;

/// Servo periods in 20 ms and in 50 ms.
const TWENTY_MS: usize = 80;
const FIFTY_MS: usize = 200;

impl Bench {
    /// Servo periods until a fault acts, with each sample faulted before its tick; `None` without a fault.
    fn until_fault(
        &mut self,
        request: AxisRequest,
        periods: usize,
        inject: impl FnMut(&mut AxisSample),
    ) -> Option<(usize, AxisFault)> {
        self.until_fault_of(|_| request, periods, inject)
    }

    /// As [`Self::until_fault`], with a request for each period.
    fn until_fault_of(
        &mut self,
        mut request: impl FnMut(usize) -> AxisRequest,
        periods: usize,
        mut inject: impl FnMut(&mut AxisSample),
    ) -> Option<(usize, AxisFault)> {
        for period in 1..=periods {
            for tick in 0..6 {
                inject(&mut self.sample);
                self.tick(request(period));
                self.follow_up(tick);
                if let Some(fault) = self.axis.fault() {
                    return Some((period, fault));
                }
            }
        }
        None
    }

    /// As [`Self::until_fault`], with a counter that is frozen from now on.
    fn frozen(&mut self, request: AxisRequest, periods: usize) -> Option<(usize, AxisFault)> {
        let count = self.sample.encoder_count;
        self.until_fault(request, periods, |sample| {
            (sample.encoder_count, sample.index_count) = (count, None);
        })
    }

    /// Turns the motor slowly to an angle, without current.
    fn turn_to(&mut self, angle: f64) {
        while (self.motor.angle - angle).abs() > 1e-3 {
            self.motor.speed = 20.0 * (angle - self.motor.angle).signum();
            self.tick(ask(0.0));
        }
        self.motor.speed = 0.0;
        self.run(ask(0.0), 600);
    }

    fn settled(speed: f64, current: f32) -> Self {
        let mut bench = Self::at(speed, &CONFIGURATION);
        assert_eq!(bench.until_fault(ask(current), 100, |_| {}), None, "{speed} rad/s, {current} A");
        bench
    }
}

#[test]
fn a_counter_that_freezes_above_the_derived_speed_is_seen_within_20_ms_and_brakes_the_motor() {
    for current in [0.0_f32, 15.0, -40.0] {
        let limits = Bench::at(0.0, &CONFIGURATION).axis.constants.model;
        let speed = f64::from(limits.frozen_speed(Ampere(current.abs()))) / 7.0;
        for sign in [1.0, -1.0] {
            let mut bench = Bench::settled(1.2 * sign * speed, current);
            let found = bench.frozen(ask(current), FIFTY_MS);
            let Some((periods, AxisFault::EncoderFrozen)) = found else { panic!("{current} A, {found:?}") };
            assert!(periods <= TWENTY_MS, "{current} A: {periods} periods");
            assert_eq!(bench.tick(ask(current)), AxisCommand::BRAKE);
            assert!(!bench.axis.clear_fault(), "the place is lost");
            // A lower speed is not detected, as documented.
            let slow = 0.4 * speed.min(25.0);
            assert_eq!(Bench::settled(sign * slow, current).frozen(ask(current), FIFTY_MS), None);
        }
    }
}

#[test]
fn a_counter_that_stops_in_motion_is_seen_at_any_current_and_a_rotor_that_is_stopped_is_not() {
    // 13 rad/s are 4 counts a period.
    for (speed, is_seen) in [(16.0, true), (-16.0, true), (150.0, true), (9.0, false), (0.0, false)] {
        for current in [0.0, 38.0, -38.0] {
            let mut bench = Bench::settled(speed, current);
            let found = bench.frozen(ask(current), TWENTY_MS);
            let frozen = matches!(found, Some((periods, AxisFault::EncoderFrozen)) if periods <= 48);
            assert_eq!([found.is_some(), frozen], [is_seen; 2], "{speed} rad/s, {current} A: {found:?}");
            // Stopped with 10,000 rad/s^2, five times what full current does to this motor with its gear.
            let mut bench = Bench::settled(speed, current);
            while bench.motor.speed != 0.0 {
                let most = 1e4 / f64::from(CURRENT_RATE_HZ) * 6.0;
                bench.motor.speed -= bench.motor.speed.clamp(-most, most);
                assert_eq!(bench.until_fault(ask(current), 1, |_| {}), None);
            }
            assert_eq!(bench.until_fault(ask(current), FIFTY_MS, |_| {}), None, "{speed} rad/s, {current} A");
        }
    }
}

/// Share of a torque wave's amplitude in a servo period: a sine, or alternating signs.
fn wave(frequency: f64, is_square: bool, period: usize) -> f32 {
    let angle = core::f64::consts::TAU * frequency * period as f64 / f64::from(SERVO_RATE_HZ);
    let sine = crate::real::sin_cos(angle + 1e-6).0 as f32;
    if is_square { sine.signum() } else { sine }
}

const FREQUENCIES: [f64; 12] = [1.0, 3.0, 10.0, 30.0, 83.0, 100.0, 125.0, 167.0, 250.0, 333.0, 420.0, 500.0];
/// Factors on resistance and both inductances, and by how much the encoder is turned, electrical degrees:
/// copper 90 K warmer and 35 K colder, iron that saturates, an absolute encoder's error.
const ERRORS: [(f64, f64, f64); 6] = [
    (1.0, 1.0, 0.0),
    (1.35, 1.0, 0.0),
    (1.35, 0.7, 11.0),
    (1.35, 1.3, -11.0),
    (0.87, 0.7, 0.0),
    (0.87, 1.3, 11.0),
];

/// Calls `test` with a bench for each frequency, amplitude, form and error of the constants.
fn waves(mut test: impl FnMut(&Bench, f64, f32, bool, &str)) {
    // The index would contradict a turned encoder.
    let settled = Bench::at(0.0, &AxisConfiguration { index: false, ..CONFIGURATION });
    for (resistance, inductance, degrees) in ERRORS {
        let mut bench = settled.clone();
        bench.motor.resistance *= resistance;
        bench.motor.inductance = bench.motor.inductance.map(|henry| henry * inductance);
        for _ in 0..100 {
            bench.motor.encoder_zero += degrees / 360.0 / 7.0 / 100.0;
            assert_eq!(bench.until_fault(ask(0.0), 1, |_| {}), None);
        }
        for frequency in FREQUENCIES {
            for amplitude in [9.0, 22.0, 40.0] {
                for is_square in [false, true] {
                    let case = format!(
                        "{frequency} Hz, {amplitude} A, square {is_square}, {resistance} R, {inductance} L, {degrees} deg"
                    );
                    test(&bench, frequency, amplitude, is_square, &case);
                }
            }
        }
    }
}

#[test]
fn a_rotor_that_is_held_or_shaken_at_any_frequency_has_no_frozen_counter() {
    waves(|bench, frequency, amplitude, is_square, case| {
        // Held; then the rotor of a joint with and without friction, as the gear shows it.
        for (driven, coulomb) in [(true, 0.0), (false, 0.1), (false, 0.0)] {
            let mut bench = bench.clone();
            (bench.motor.driven, bench.motor.coulomb) = (driven, coulomb);
            (bench.motor.inertia, bench.motor.viscous) = (8e-4, 2e-3);
            // At low frequencies a half wave would drive the free motor beyond its speed.
            let share = if driven { 1.0 } else { (frequency / 30.0).min(1.0) as f32 };
            let request = |period| ask(share * amplitude * wave(frequency, is_square, period));
            // A tenth of a second and a quarter of a wave.
            let periods = 400 + (1000.0 / frequency) as usize;
            let found = bench.until_fault_of(request, periods, |_| {});
            assert_eq!(found, None, "{case}, held {driven}, friction {coulomb}");
        }
    });
}

#[test]
fn a_frozen_counter_is_seen_while_torque_of_any_frequency_acts() {
    waves(|bench, frequency, amplitude, is_square, case| {
        let model = bench.axis.constants.model;
        let speed = f64::from(model.frozen_speed(Ampere(1.35 * amplitude))) / 7.0;
        let at_rest = bench.sample.encoder_count;
        for (sign, begins_at_rest) in [(1.0, false), (-1.0, false), (1.0, true)] {
            let mut bench = bench.clone();
            let request = |period| ask(amplitude * wave(frequency, is_square, period));
            bench.motor.speed = if begins_at_rest { 0.0 } else { 1.2 * sign * speed };
            let freeze_at = |count: u16| {
                move |sample: &mut AxisSample| (sample.encoder_count, sample.index_count) = (count, None)
            };
            let count = if begins_at_rest {
                // Frozen at rest nothing shows, until the rotor turns.
                assert_eq!(bench.until_fault_of(request, 80, freeze_at(at_rest)), None, "{case}");
                bench.motor.speed = 1.5 * speed;
                at_rest
            } else {
                assert_eq!(bench.until_fault_of(request, 80, |_| {}), None, "{case}");
                bench.sample.encoder_count
            };
            let found = bench.until_fault_of(|period| request(period + 80), FIFTY_MS, freeze_at(count));
            let in_time = matches!(found, Some((periods, AxisFault::EncoderFrozen)) if periods <= TWENTY_MS);
            assert!(in_time, "{case}, sign {sign}, at rest {begins_at_rest}: {found:?}");
        }
    });
}

#[test]
fn a_sound_axis_brakes_for_as_long_as_the_other_one_needs_it() {
    for speed in [20.0, -100.0, 140.0] {
        let mut bench = Bench::settled(speed, 10.0);
        for tick in 0..4800 {
            assert_eq!(
                bench.axis.act(&bench.sample, BridgeRequest::Brake),
                AxisCommand::BRAKE,
                "{speed} rad/s, tick {tick}"
            );
            bench.sample = bench.motor.period(AxisCommand::BRAKE);
            bench.follow_up(tick);
        }
        let current = bench.motor.current[0].hypot(bench.motor.current[1]);
        assert_eq!(bench.axis.fault(), None, "{speed} rad/s: {current} A");
    }
}

#[test]
fn a_motor_too_fast_to_brake_below_the_current_bound_is_off() {
    // Braking at 150 to 180 rad/s already carries 55 A.
    for speed in [200.0, -260.0] {
        let mut bench = Bench::settled(speed, 0.0);
        assert_eq!(bench.axis.act(&bench.sample, BridgeRequest::Brake), AxisCommand::OFF, "{speed} rad/s");
        assert_eq!(bench.axis.fault(), Some(AxisFault::Overcurrent));
        assert!(bench.axis.clear_fault(), "nothing was lost");

        let mut bench = Bench::settled(speed, 0.0);
        assert!(matches!(bench.frozen(ask(0.0), FIFTY_MS), Some((_, AxisFault::EncoderFrozen))));
        assert_eq!(bench.tick(ask(0.0)), AxisCommand::OFF, "{speed} rad/s");
        assert!(!bench.axis.clear_fault(), "the place is lost, whatever was found since");
    }
}

#[test]
fn a_braking_motor_turns_off_on_request_or_beyond_the_current_bound() {
    let mut bench = Bench::settled(60.0, 10.0);
    assert!(bench.frozen(ask(10.0), TWENTY_MS).is_some());
    for _ in 0..100 {
        assert_eq!(bench.axis.act(&bench.sample, BridgeRequest::Brake), AxisCommand::BRAKE);
        bench.sample = bench.motor.period(AxisCommand::BRAKE);
    }
    // 60 rad/s make 1.2 V at 0.05 ohm: the motor brakes, whatever the sensors measure.
    let torque = bench.motor.current[1];
    assert!(torque < -15.0, "{torque} A");
    assert_eq!(bench.tick(AxisRequest::OFF), AxisCommand::OFF);
    bench.sample.shunt_codes = [3700, 2048];
    assert_eq!(bench.axis.act(&bench.sample, BridgeRequest::Brake), AxisCommand::OFF);
    assert_eq!(bench.axis.fault(), Some(AxisFault::Overcurrent));
    assert_eq!(bench.axis.act(&bench.sample, BridgeRequest::Brake), AxisCommand::OFF);
    assert!(!bench.axis.clear_fault(), "the place that was lost before stays lost");
}

#[test]
fn an_open_phase_is_seen_within_50_ms() {
    // Joint speeds of at least 0.4 rad/s, and a motor at rest with current in the open phase.
    for (speed, current) in [(20.0, 10.0), (60.0, -5.0), (-200.0, 30.0), (0.0, 10.0)] {
        let mut bench = Bench::settled(speed, current);
        bench.motor.open = true;
        let found = bench.until_fault(ask(current), FIFTY_MS, |_| {});
        let Some((_, fault)) = found else { panic!("{speed} rad/s, {current} A") };
        // At rest the fault may show as a frozen counter; then the motor brakes with two phases.
        use AxisFault::{CurrentOffset, EncoderFrozen, OpenPhase, Overcurrent};
        assert!(matches!(fault, OpenPhase | CurrentOffset | Overcurrent | EncoderFrozen));
        let brakes = fault == EncoderFrozen;
        assert!(speed == 0.0 || !brakes, "{speed} rad/s, {current} A: {fault:?}");
        assert_eq!(bench.tick(ask(current)), if brakes { AxisCommand::BRAKE } else { AxisCommand::OFF });
    }
}

#[test]
fn a_zero_that_drifts_by_six_amperes_is_seen_within_50_ms_of_motion() {
    for (speed, current) in [(60.0, 0.0), (60.0, 20.0), (-100.0, 30.0), (220.0, -10.0)] {
        for (shunt, codes) in [(0, 150.0), (1, -150.0)] {
            let mut bench = Bench::settled(speed, current);
            bench.motor.current_offsets[shunt] += codes;
            let found = bench.until_fault(ask(current), FIFTY_MS, |_| {});
            let found = found.map(|(_, fault)| fault);
            assert_eq!(found, Some(AxisFault::CurrentOffset), "{speed} rad/s, {current} A");
            // A drift of 1 A is tolerated.
            let mut bench = Bench::settled(speed, current);
            bench.motor.current_offsets[shunt] += codes / 6.0;
            assert_eq!(bench.until_fault(ask(current), 400, |_| {}), None, "{speed} rad/s, {current} A");
        }
    }
}

#[test]
fn offsets_that_drifted_while_off_are_refused_at_enabling() {
    for (codes, refused) in [(25.0, false), (-60.0, true), (100.0, true)] {
        let mut bench = Bench::at(50.0, &CONFIGURATION);
        bench.motor.current_offsets[1] += codes;
        // 240 ticks are 10 ms.
        bench.run(AxisRequest::OFF, 240);
        assert_eq!(bench.tick(ask(0.0)).enabled, !refused, "{codes} codes");
        assert_eq!(bench.axis.fault(), refused.then_some(AxisFault::CurrentOffset), "{codes} codes");
    }
}

#[test]
fn a_warm_motor_that_is_reversed_again_and_again_raises_nothing() {
    for (resistance, flux, inductance) in [(1.3, 0.85, 0.8), (0.85, 1.1, 1.1), (1.0, 1.0, 1.0)] {
        let mut bench = Bench::settled(0.0, 0.0);
        bench.motor.resistance *= resistance;
        bench.motor.flux *= flux;
        bench.motor.inductance = bench.motor.inductance.map(|henry| henry * inductance);
        for step in 0..CURRENT_RATE_HZ {
            // Speeds up to the joint's greatest, at 3 Hz; currents at 7 Hz, with a step in each cycle.
            let time = f64::from(step) / f64::from(CURRENT_RATE_HZ);
            bench.motor.speed = 220.0 * crate::real::sin_cos(time * 18.8).0;
            let current = 38.0 * crate::real::sin_cos(time * 44.0).0 as f32;
            bench.tick(ask(if step % 3000 < 1500 { current } else { -0.5 * current }));
            bench.follow_up(step as usize);
            assert_eq!(bench.axis.fault(), None, "{resistance} {flux} {inductance} at {time} s");
        }
    }
}

#[test]
fn a_code_that_stays_while_its_target_changes_is_detected_in_the_fourth_tick() {
    for shunt in [0, 1] {
        let mut bench = Bench::settled(100.0, 20.0);
        let stuck = bench.sample.shunt_codes[shunt];
        let mut ticks = 0;
        while bench.axis.fault().is_none() {
            bench.sample.shunt_codes[shunt] = stuck;
            bench.tick(ask(20.0));
            ticks += 1;
            assert!(ticks <= 54, "a quarter of an electrical turn");
        }
        assert_eq!(bench.axis.fault(), Some(AxisFault::StuckConversion));
        // After a step, the fourth tick shows the fault.
        let mut bench = Bench::settled(0.0, 0.0);
        // Along phase A the quadrature current flows through both shunts.
        bench.turn_to(0.0);
        let stuck = bench.sample.shunt_codes[shunt];
        for tick in 0..100 {
            bench.sample.shunt_codes[shunt] = stuck;
            let current = if tick < 90 { 0.0 } else { 10.0 };
            bench.tick(ask(current));
            assert_eq!(bench.axis.fault().is_some(), tick >= 93, "tick {tick}");
        }
    }
}

#[test]
fn a_changed_bit_of_gains_or_limits_is_seen_within_100_ms() {
    let flip = |number: &mut f32, bit: u32| *number = f32::from_bits(number.to_bits() ^ 1 << bit);
    for bit in [0, 13, 31] {
        for word in 0..4 {
            let mut bench = Bench::settled(50.0, 5.0);
            let constants = &mut bench.axis.constants;
            match word {
                0 => flip(&mut constants.current_limit, bit),
                1 => flip(&mut constants.overcurrent_square, bit),
                2 => flip(&mut constants.current_offsets[1], bit),
                _ => constants.greatest_step ^= 1 << bit,
            }
            let found = bench.until_fault(ask(5.0), 400, |_| {});
            let Some((periods, _)) = found else { panic!("word {word}, bit {bit}") };
            assert!(periods <= 256, "{periods} servo periods");
        }
    }
}

#[test]
fn codes_without_noise_that_stay_are_no_fault_while_no_target_changes() {
    let mut bench = Bench::at(0.0, &CONFIGURATION);
    bench.motor.noise_codes = 0.0;
    bench.motor.current_offsets = [12.0, -21.0];
    assert_eq!(bench.until_fault(ask(0.0), 200, |_| {}), None);
    for current in [0.9, 5.0, -5.0, 30.0, -40.0, 0.0] {
        assert_eq!(bench.until_fault(ask(current), 200, |_| {}), None, "{current} A");
    }
}

#[test]
fn a_code_that_is_wrong_every_other_tick_is_not_survived_for_long() {
    type Inject = fn(&mut AxisSample);
    let injections: [(Inject, AxisFault); 2] = [
        (|sample| sample.shunt_codes[1] = 4000, AxisFault::CurrentSense),
        (|sample| sample.bus_code = 3950, AxisFault::BusVoltage),
    ];
    // One wrong reading in every `of`, and the number of wrong readings until the fault.
    for (of, detected_after) in [(2, Some(3)), (3, Some(4)), (4, Some(6)), (5, None)] {
        for (inject, fault) in injections {
            let mut bench = Bench::at(50.0, &CONFIGURATION);
            bench.run(ask(5.0), 100);
            let mut wrong = 0;
            for tick in 0..400 {
                if tick % of == 0 && bench.axis.fault().is_none() {
                    inject(&mut bench.sample);
                    wrong += 1;
                }
                bench.tick(ask(5.0));
            }
            assert_eq!(bench.axis.fault(), detected_after.map(|_| fault), "one of {of}");
            assert!(detected_after.is_none_or(|after| after == wrong), "one of {of}: {wrong}");
        }
    }
}

#[test]
fn duties_that_are_no_numbers_release() {
    let mut bench = Bench::at(50.0, &CONFIGURATION);
    bench.run(ask(5.0), 100);
    bench.axis.invalidate_modulation();
    assert_eq!(bench.tick(ask(5.0)), AxisCommand::OFF);
    assert_eq!(bench.axis.fault(), Some(AxisFault::NotANumber));
}

#[test]
fn a_flip_changes_the_bit_that_is_named() {
    let sound = Bench::settled(0.0, 0.0).axis;
    let flip_bit = |bit| {
        let mut axis = sound;
        axis.flip_bit(0, bit);
        axis
    };
    assert!(flip_bit(3) != sound && flip_bit(3) != flip_bit(4));
    assert!(flip_bit(3) == flip_bit(35), "32 bits");
}
