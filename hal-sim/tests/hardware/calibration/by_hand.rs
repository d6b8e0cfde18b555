//! Ready after a power-up without motion by the motor: the joint is turned by hand over its index, then the
//! stored calibration is checked at standstill, and the first motion proves the angle.
//!
//! Figures: `cargo test -p hal-sim --test hardware calibration::by_hand -- --nocapture`.

use core::f64::consts::TAU;

use hal_sim::drive::description::{EncoderWiring, SupplyDescription};
use hal_sim::drive::stand::{Load, Stand};
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ};
use scarab::motor::{
    Axis, AxisFault, AxisRequest, Calibration, Calibrator, ElectricalAngle, EncoderSetting, Phase, Refusal,
    StoredCalibration,
};
use scarab::operation::{AxisState, Order, Outcome};
use scarab::safety::Bridges;
use scarab::units::{Ampere, Henry, Ohm};

use crate::calibration::in_place::geared;
use crate::calibration::trial::{TestRandom, Trial};
use crate::calibration::{offset_error, stored};

const PERIOD_S: f64 = 1.0 / CURRENT_RATE_HZ as f64;

/// A power-up: the axis' state at level 0 and its motor.
struct PowerUp {
    trial: Trial,
    stand: Stand,
    state: AxisState,
    sample: AxisSample,
    /// Counts that the counter has lost.
    lost: u16,
    /// Greatest current at a sample, A.
    most_ampere: f64,
}

impl PowerUp {
    fn new(trial: Trial, seed: u64) -> Self {
        let mut stand =
            Stand::new(&trial.axis, &SupplyDescription::default(), Load::Turned(0.0), trial.angle, seed);
        let sample = stand.period(&AxisCommand::OFF, 0.0);
        Self { trial, stand, state: AxisState::OFF, sample, lost: 0, most_ampere: 0.0 }
    }

    /// Runs one period of level 0 with a fault injected into the sample.
    fn period(&mut self, request: AxisRequest, inject: impl Fn(&mut AxisSample)) -> Option<Outcome> {
        inject(&mut self.sample);
        let mut event = None;
        let command = self.state.tick(&self.sample, Bridges::Follow, request, |outcome, _, command| {
            event = Some(outcome);
            command
        });
        self.sample = self.stand.period(&command, 0.0);
        self.sample.encoder_count = self.sample.encoder_count.wrapping_sub(self.lost);
        self.sample.index_count = self.sample.index_count.map(|count| count.wrapping_sub(self.lost));
        let [d, q] = self.stand.rotor_currents();
        self.most_ampere = self.most_ampere.max(d.hypot(q));
        // The index is followed in the state itself.
        event.filter(|outcome| !matches!(outcome, Outcome::Index(_)))
    }

    /// A hand turns the rotor by so many turns, back and forth by a tenth of a turn at first, and not evenly.
    fn turn(&mut self, turns: f64, speed: f64) {
        self.turn_with(turns, speed, |_| {});
    }

    fn turn_with(&mut self, turns: f64, speed: f64, inject: impl Fn(&mut AxisSample)) {
        for part in [-0.1 * turns.signum(), turns + 0.1 * turns.signum()] {
            let end = self.stand.rotor().angle + part * TAU;
            let mut seconds = 0.0_f64;
            while (end - self.stand.rotor().angle) * part > 0.0 {
                // From 0.2 to 1.8 of the speed, 1.5 times a second.
                let now = speed * (0.2 + 3.2 * ((1.5 * seconds).fract() - 0.5).abs());
                self.stand.set_load(Load::Turned(now * part.signum()));
                assert_eq!(self.period(AxisRequest::OFF, &inject), None);
                seconds += PERIOD_S;
            }
        }
        self.stand.set_load(Load::Turned(0.0));
        self.run(2400);
    }

    fn run(&mut self, periods: u32) {
        for _ in 0..periods {
            assert_eq!(self.period(AxisRequest::OFF, |_| {}), None);
        }
    }

    /// The gear and the leg hang on the rotor. A hand supports the leg for so long.
    fn let_go(&mut self, supported_s: f64) {
        let load = match self.trial.load {
            Load::Geared(geared) => Load::Geared(hal_sim::drive::stand::Geared { supported_s, ..geared }),
            other => other,
        };
        self.stand.set_load(load);
    }

    fn calibrator(&self, stored: StoredCalibration) -> Calibrator {
        Calibrator::from_stored(&self.trial.configuration, self.trial.settings, stored).expect("sensible")
    }

    /// Confirms stored values while a hand supports the leg; see [`Self::calibrate`].
    fn confirm(&mut self, stored: StoredCalibration) -> (Result<Calibration, Refusal>, f64, u32) {
        self.let_go(f64::INFINITY);
        let calibrator = self.calibrator(stored);
        self.calibrate(calibrator, |_, _| {})
    }

    /// Orders a calibration; returns its end, and the greatest travel on the way in electrical turns. `hand`
    /// may change the stand in every period.
    fn calibrate(
        &mut self,
        calibrator: Calibrator,
        mut hand: impl FnMut(&mut Stand, u32),
    ) -> (Result<Calibration, Refusal>, f64, u32) {
        self.state.apply_order(Order::Calibrate(calibrator));
        let begin = self.stand.rotor().angle;
        let (mut furthest, mut periods) = (0.0_f64, 0);
        loop {
            hand(&mut self.stand, periods);
            let outcome = self.period(AxisRequest::OFF, |_| {});
            let travel =
                (self.stand.rotor().angle - begin) / TAU * f64::from(self.trial.configuration.pole_pairs);
            furthest = furthest.max(travel.abs());
            periods += 1;
            match outcome {
                Some(Outcome::Calibrated(found)) => return (Ok(found), furthest, periods),
                Some(Outcome::Refused(reason)) => return (Err(reason), furthest, periods),
                Some(other) => panic!("{other:?}"),
                None => assert!(periods < 60 * CURRENT_RATE_HZ, "no end"),
            }
        }
    }

    /// Runs the calibrated axis with these currents by turns, each for a second, until it is proven or
    /// finds a fault. A hand may turn the joint instead, at a speed of the rotor in rad/s. Returns whether
    /// the angle was proven, the fault, and the greatest speed of the rotor.
    fn first_motion(
        &mut self,
        found: &Calibration,
        currents: [f32; 2],
        hand: Option<f64>,
    ) -> (bool, Option<AxisFault>, f64) {
        if !self.state.is_running() {
            let axis = Axis::new(&self.trial.configuration, found, &self.sample).expect("sensible");
            self.state.apply_order(Order::Run(axis));
            self.run(240);
        }
        let mut fastest = 0.0_f64;
        for period in 0..2 * CURRENT_RATE_HZ {
            if let Some(speed) = hand {
                // Within a tenth of a second.
                let share = (f64::from(period) / 2400.0).min(1.0);
                self.stand.set_load(Load::Turned(speed * share));
            }
            let [first, second] = currents.map(Ampere);
            let current = if period < CURRENT_RATE_HZ { first } else { second };
            self.period(AxisRequest { enabled: true, current }, |_| {});
            let axis = self.state.axis_mut().expect("runs");
            if period % 6 == 0 {
                axis.check_constants();
            }
            if period % 6 == 2 {
                axis.check();
            }
            if period % 6 == 5 {
                axis.joint_sample();
            }
            fastest = fastest.max(self.stand.rotor().speed.abs());
            if axis.is_proven() || axis.fault().is_some() {
                return (axis.is_proven(), axis.fault(), fastest);
            }
        }
        (false, None, fastest)
    }
}

/// Stored calibration of an ideal measurement, from the hardware's description.
fn ideal(trial: &Trial) -> StoredCalibration {
    let (axis, configuration) = (&trial.axis, &trial.configuration);
    let sense = if axis.wiring.encoder == EncoderWiring::Reversed { -1.0 } else { 1.0 };
    // Rotor's angle in the middle of the count in which the index lies, and there the flux from the board's
    // phase A.
    let count = TAU / axis.counter.counts;
    let angle = sense * ((sense * axis.counter.index / count).floor() + 0.5) * count;
    let pairs = f64::from(axis.motor.pole_pairs);
    let flux = pairs * angle + axis.motor.electrical_zero - axis.wiring.phases[0] as f64 * TAU / 3.0;
    // A position's angle is that of its middle.
    let offset = flux / TAU - 0.5 * pairs / axis.counter.counts;
    StoredCalibration {
        resistance: Ohm((axis.motor.resistance + axis.bridge.on_resistance) as f32),
        direct_inductance: Henry(axis.motor.inductance_d as f32),
        quadrature_inductance: Henry(axis.motor.inductance_q as f32),
        offset: ElectricalAngle::from_turns((offset - offset.floor()) as f32),
        encoder: EncoderSetting::new(configuration),
        winding_c: None,
        joint_zero: None,
    }
}

fn turned_off(stored: StoredCalibration, degrees: f32) -> StoredCalibration {
    StoredCalibration { offset: stored.offset.plus(ElectricalAngle::from_turns(degrees / 360.0)), ..stored }
}

/// An axis whose joint was turned over its index at least twice and is at rest.
fn ready(trial: Trial, seed: u64) -> PowerUp {
    let mut random = TestRandom::new(seed + 2_000_000);
    let mut power_up = PowerUp::new(trial, seed);
    let turns = random.between(2.0, 2.8) * random.one_of([1.0, -1.0]);
    power_up.turn(turns, random.between(15.0, 60.0));
    power_up
}

/// Confirms the ideal stored values of random legs. Returns the share of legs whose angle their own motor
/// proved with a quarter of the current; a hand turns the others.
fn confirms(seeds: core::ops::RangeInclusive<u64>) -> f64 {
    let legs = seeds.clone().count() as f64;
    let (mut worst, mut by_motor) = ([0.0_f64; 6], 0.0);
    for seed in seeds {
        let mut leg = ready(geared(seed, None), seed);
        let stored = ideal(&leg.trial);
        assert!(leg.most_ampere < 1e-9, "seed {seed}: {} A before the order", leg.most_ampere);
        let (result, travel, periods) = leg.confirm(stored);
        let found = result.unwrap_or_else(|reason| panic!("seed {seed}: {reason:?}\n{:?}", leg.trial));
        assert!(!found.is_proven() && found.indexed() && found.offset() == stored.offset, "seed {seed}");
        let offset = offset_error(&mut leg.stand, &leg.trial, &found, seed);
        leg.sample = leg.stand.period(&AxisCommand::OFF, 0.0);
        leg.let_go(0.0);
        // A quarter of the limit, 10 A, moves some legs too slowly. Then a hand turns the joint.
        let (mut proven, mut fault, _) = leg.first_motion(&found, [10.0, -10.0], None);
        by_motor += f64::from(u8::from(proven));
        if !proven {
            (proven, fault, _) = leg.first_motion(&found, [0.0; 2], Some(80.0));
        }
        assert!(proven && fault.is_none(), "seed {seed}: {fault:?}");
        let errors = [
            f64::from(found.resistance().0 / stored.resistance.0) - 1.0,
            f64::from(found.direct_inductance().0 / stored.direct_inductance.0) - 1.0,
            f64::from(found.quadrature_inductance().0 / stored.quadrature_inductance.0) - 1.0,
            offset,
            travel,
            f64::from(periods) * PERIOD_S,
        ];
        println!("{seed:>3}  R, Ld, Lq, offset, travel, seconds: {errors:+.4?}");
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error.abs());
        }
    }
    println!("worst R, Ld, Lq, offset, travel, seconds: {worst:.4?}; {by_motor} proven by the motor");
    // Where the flux lies across a phase, that phase's current changes its sign with the wave, and dead time
    // with it: up to 4 % of inductance. A count of the coarsest encoder is 2.1 electrical degrees.
    let limits = [0.02, 0.02, 0.045, 0.2, 1e-3, 1.5];
    assert!(worst.iter().zip(limits).all(|(worst, limit)| *worst < limit), "{worst:?}");
    by_motor / legs
}

#[test]
fn stored_values_of_12_legs_are_confirmed_without_motion() {
    assert!(confirms(1..=12) > 0.9);
}

/// `cargo test -p hal-sim --test hardware 400_legs -- --ignored --nocapture`.
#[test]
#[ignore = "campaign: .ci/full"]
fn stored_values_of_400_legs_are_confirmed_without_motion() {
    assert!(confirms(1..=400) > 0.9);
}

#[test]
fn what_a_calibration_in_motion_stored_is_confirmed_on_the_next_day() {
    for seed in [1, 2] {
        let trial = geared(seed, Some(0.1));
        let stored = stored(&trial, seed);
        // Another day: counter and joint are elsewhere.
        let mut trial = trial;
        trial.axis.counter.start = trial.axis.counter.start.wrapping_add(12_345);
        trial.angle += 3.0;
        let mut leg = ready(trial, seed + 100);
        let (result, travel, _) = leg.confirm(stored);
        let found = result.expect("the same motor");
        assert!(!found.is_proven() && travel < 1e-3, "seed {seed}: {travel}");
        let error = offset_error(&mut leg.stand, &leg.trial, &found, seed);
        assert!(error.abs() < 1.0, "seed {seed}: {error} degrees");
    }
}

fn wrong_offsets_are_refused(all_degrees: &[f32], legs: u64) {
    for &degrees in all_degrees {
        let (mut refused, mut worst, mut rolled) = (0, 0.0_f64, 0.0_f64);
        for seed in 1..=legs {
            for sign in [1.0, -1.0] {
                let mut leg = ready(geared(seed, None), seed);
                let wrong = turned_off(ideal(&leg.trial), sign * degrees);
                let (result, travel, _) = leg.confirm(wrong);
                worst = worst.max(travel);
                if let Err(reason) = result {
                    assert_eq!(reason, Refusal::Moved, "seed {seed}: {degrees} degrees");
                    refused += 1;
                    // The bridge is off; the joint rolls on.
                    let end = leg.stand.rotor().angle;
                    leg.run(12_000);
                    rolled = rolled.max((leg.stand.rotor().angle - end).abs() / TAU);
                }
            }
        }
        println!(
            "{degrees:>4} degrees: {refused} of {} refused, travel {worst:.3} electrical turns, then {rolled:.4} turns",
            2 * legs
        );
        // Friction of up to 4 A stops the rotor up to 12 degrees off, and 11 degrees of travel are permitted.
        assert!(degrees > 5.0 || refused == 0, "{degrees}: {refused}");
        assert!(degrees < 25.0 || refused == 2 * legs, "{degrees}: {refused}");
        // 0.05 turns are 0.36 degrees of the joint.
        assert!(worst < 0.04 && rolled < 0.05, "{degrees}: {worst} {rolled}");
    }
}

#[test]
fn a_wrong_stored_offset_moves_the_rotor_and_is_refused() {
    wrong_offsets_are_refused(&[5.0, 25.0, 90.0, 165.0], 2);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn eleven_wrong_offsets_of_ten_legs_are_refused() {
    wrong_offsets_are_refused(&[5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 60.0, 90.0, 120.0, 150.0, 165.0], 10);
}

fn half_a_turn_off(legs: u64) {
    let mut fastest = 0.0_f64;
    for seed in 1..=legs {
        let mut leg = ready(geared(seed, None), seed);
        let wrong = turned_off(ideal(&leg.trial), 180.0);
        let (result, travel, _) = leg.confirm(wrong);
        let found = result.expect("at rest at the unstable equilibrium");
        leg.let_go(0.0);
        let (proven, fault, speed) = leg.first_motion(&found, [8.0, -8.0], None);
        assert!(!proven && fault == Some(AxisFault::Encoder), "seed {seed}: {fault:?} {travel}");
        fastest = fastest.max(speed);
    }
    println!("fastest {fastest:.1} rad/s of the rotor");
    // 35 rad/s are 0.7 rad/s of the joint.
    assert!(fastest < 35.0, "{fastest}");
}

#[test]
fn half_a_turn_off_rests_and_is_found_by_the_first_motion() {
    half_a_turn_off(3);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn half_a_turn_off_is_found_by_the_first_motion_of_20_legs() {
    half_a_turn_off(20);
}

/// A leg whose motor has hardly any saliency, so that inductances show no wrong angle.
fn round_rotor(seed: u64) -> Trial {
    let mut trial = geared(seed, None);
    trial.axis.motor.inductance_q = 1.04 * trial.axis.motor.inductance_d;
    trial
}

/// Confirms stored values with a rotor that is clamped, so that no wrong angle can move it.
fn confirmed_while_clamped(leg: &mut PowerUp, stored: StoredCalibration) -> Calibration {
    leg.stand.set_load(Load::Turned(0.0));
    let calibrator = leg.calibrator(stored);
    leg.calibrate(calibrator, |_, _| {}).0.expect("clamped")
}

fn a_hidden_angle_is_never_proven(legs: core::ops::RangeInclusive<u64>) {
    for degrees in [60.0_f32, -60.0, 90.0, -90.0, 120.0, 180.0] {
        for seed in legs.clone() {
            let mut leg = ready(round_rotor(seed), seed);
            let wrong = turned_off(ideal(&leg.trial), degrees);
            let found = confirmed_while_clamped(&mut leg, wrong);
            leg.let_go(0.0);
            let (proven, fault, _) = leg.first_motion(&found, [9.0, -9.0], None);
            assert!(!proven && matches!(fault, None | Some(AxisFault::Encoder)), "{degrees}: {fault:?}");

            // A hand that turns the joint shows it, also without current: 80 rad/s are 1.6 of the joint.
            let mut leg = ready(round_rotor(seed), seed);
            let wrong = turned_off(ideal(&leg.trial), degrees);
            let found = confirmed_while_clamped(&mut leg, wrong);
            let (proven, fault, _) = leg.first_motion(&found, [0.0; 2], Some(80.0));
            assert!(!proven && fault == Some(AxisFault::Encoder), "seed {seed}, {degrees}: {fault:?}");
        }
    }
}

#[test]
fn a_wrong_angle_that_a_clamped_joint_hid_is_never_proven() {
    a_hidden_angle_is_never_proven(1..=1);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn wrong_angles_that_six_clamped_joints_hid_are_never_proven() {
    a_hidden_angle_is_never_proven(1..=6);
}

fn exchanged_since_the_store(legs: u64) {
    let changes: [fn(&mut Trial); 3] = [
        |trial| trial.axis.wiring.phases.swap(0, 1),
        |trial| trial.axis.wiring.phases.swap(1, 2),
        |trial| {
            let encoder = &mut trial.axis.wiring.encoder;
            *encoder = if *encoder == EncoderWiring::Forward {
                EncoderWiring::Reversed
            } else {
                EncoderWiring::Forward
            };
        },
    ];
    let (mut moved, mut passed) = (0, 0);
    for change in changes {
        for seed in 1..=legs {
            let mut trial = round_rotor(seed);
            let stored = ideal(&trial);
            change(&mut trial);
            let mut leg = ready(trial, seed);
            let result = leg.confirm(stored).0;
            let (found, hand) = match result {
                Err(Refusal::Moved) => {
                    moved += 1;
                    (confirmed_while_clamped(&mut leg, stored), Some(80.0))
                }
                Err(reason) => panic!("seed {seed}: {reason:?}"),
                Ok(found) => {
                    passed += 1;
                    leg.let_go(0.0);
                    (found, None)
                }
            };
            let (proven, fault, _) = leg.first_motion(&found, [9.0, -9.0], hand);
            assert!(!proven, "seed {seed}: proven");
            assert!(
                fault == Some(AxisFault::Encoder) || hand.is_none() && fault.is_none(),
                "{seed}: {fault:?}"
            );
        }
    }
    println!("{moved} refused, {passed} confirmed by chance");
    assert!(moved >= 2 * legs && moved + passed == 3 * legs);
}

#[test]
fn leads_or_encoder_exchanged_since_the_store_are_refused_or_never_proven() {
    exchanged_since_the_store(3);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn exchanged_leads_or_encoders_of_ten_legs_are_refused_or_never_proven() {
    exchanged_since_the_store(10);
}

#[test]
fn a_joint_pushed_during_the_check_is_refused_and_then_measured_in_motion() {
    let trial = geared(3, Some(0.1));
    let stored = ideal(&trial);
    let mut leg = ready(trial, 3);
    leg.let_go(f64::INFINITY);
    let calibrator = leg.calibrator(stored);
    let load = leg.trial.load;
    let (result, ..) = leg.calibrate(calibrator, |stand, period| match period {
        // Twice as far as permitted, within a fifth of a second.
        12_000 => stand.set_load(Load::Turned(0.3)),
        16_000 => stand.set_load(load),
        _ => {}
    });
    assert_eq!(result.err(), Some(Refusal::Moved));
    leg.let_go(2.0);
    let calibrator = leg.calibrator(stored).turning();
    let (result, travel, _) = leg.calibrate(calibrator, |_, _| {});
    let found = result.expect("the same motor");
    assert!(found.is_proven() && found.offset() == stored.offset && travel > 7.0, "{travel}");
}

/// Result of a calibration from stored values after hand's turns with a fault, and whether the motor turned.
fn after(turns: f64, inject: impl Fn(&mut AxisSample, f64)) -> bool {
    let trial = geared(5, Some(0.1));
    let stored = ideal(&trial);
    let (counts, begin) = (trial.axis.counter.counts, trial.angle);
    let mut leg = PowerUp::new(trial, 5);
    let turned = core::cell::Cell::new(0_i32);
    let last = core::cell::Cell::new(leg.sample.encoder_count);
    leg.turn_with(turns, 30.0, |sample| {
        let step = sample.encoder_count.wrapping_sub(last.replace(sample.encoder_count)).cast_signed();
        turned.set(turned.get() + i32::from(step));
        inject(sample, f64::from(turned.get().abs()) / counts);
    });
    assert!((leg.stand.rotor().angle - begin).abs() > 0.5, "turned");
    leg.let_go(2.0);
    let calibrator = leg.calibrator(stored);
    let (result, travel, _) = leg.calibrate(calibrator, |_, _| {});
    let found = result.expect("sound");
    assert_eq!(found.is_proven(), travel > 1.0);
    found.is_proven()
}

#[test]
fn without_a_certain_index_the_motor_turns_as_before() {
    assert!(!after(2.3, |_, _| {}));
    // Less than a turn.
    assert!(after(0.8, |_, _| {}));
    // A glitch after the last pulse but one, and one that further pulses outlive.
    let glitch = |sample: &mut AxisSample, turned: f64, from: f64| {
        if (from..from + 0.002).contains(&turned) {
            sample.index_count = Some(sample.encoder_count);
        }
    };
    assert!(after(2.3, |sample, turned| glitch(sample, turned, 2.2)));
    assert!(!after(4.3, |sample, turned| glitch(sample, turned, 0.7)));
}

#[test]
fn counts_lost_between_the_pulses_take_two_more_of_them() {
    for (further, turns) in [(1.05, true), (2.3, false)] {
        let trial = geared(5, Some(0.1));
        let stored = ideal(&trial);
        let mut leg = PowerUp::new(trial, 5);
        leg.turn(2.3, 30.0);
        // No more than a plausible step.
        leg.lost = 6;
        leg.turn(further, 30.0);
        leg.let_go(2.0);
        let calibrator = leg.calibrator(stored);
        let found = leg.calibrate(calibrator, |_, _| {}).0.expect("sound");
        assert_eq!(found.is_proven(), turns, "{further} turns");
        assert_eq!(found.offset(), stored.offset);
    }
}

#[test]
fn another_motor_is_refused_at_standstill() {
    type Change = fn(&mut Trial);
    let changes: [Change; 3] = [
        |trial| trial.axis.motor.resistance *= 1.5,
        |trial| trial.axis.motor.inductance_d *= 1.3,
        |trial| trial.axis.motor.inductance_q *= 0.74,
    ];
    for change in changes {
        for seed in 1..=5 {
            let mut trial = geared(seed, None);
            let stored = ideal(&trial);
            change(&mut trial);
            let mut leg = ready(trial, seed);
            let (result, travel, _) = leg.confirm(stored);
            assert!(matches!(result, Err(Refusal::OtherMotor(..))), "seed {seed}: {result:?}");
            assert!(travel < 1e-3, "seed {seed}: {travel}");
        }
    }
}

#[test]
fn an_open_phase_is_refused_at_standstill() {
    let mut named = 0;
    for output in 0..3 {
        for seed in 1..=5 {
            let trial = geared(seed, None);
            let stored = ideal(&trial);
            let mut leg = ready(trial, seed);
            leg.stand.break_wire(output);
            let reason = leg.confirm(stored).0.expect_err("open");
            let phase = [Phase::A, Phase::B, Phase::C][output];
            // Near the open phase's axis the bent current turns the rotor. Across that axis the phase would
            // carry no current anyway, and shows only in the inductance.
            let open = Refusal::PhaseOpen(phase);
            let is_expected = [open, Refusal::Moved, Refusal::MotorConstants].contains(&reason);
            assert!(is_expected, "output {output}, seed {seed}: {reason:?}");
            named += u32::from(reason == open);
        }
    }
    assert!(named >= 10, "{named} of 15");
}
