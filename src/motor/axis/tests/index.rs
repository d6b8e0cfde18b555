//! An axis' reaction to index pulses: noise, lost counts, and missing pulses.

use super::*;
use crate::real::sin_cos;

#[test]
fn an_index_away_from_its_position_is_a_lost_position() {
    for (missed, lost) in [(3, false), (-3, false), (6, true), (-6, true), (300, true)] {
        for request in [ask(5.0), AxisRequest::OFF] {
            for speed in [50.0, -50.0] {
                let mut bench = Bench::at(speed, &CONFIGURATION);
                bench.run(request, 100);
                bench.motor.encoder_zero += f64::from(missed) / 8192.0;
                // The index keeps its position on the shaft; three turns.
                bench.run_sampled(request, 9048, |sample| {
                    sample.index_count = sample.index_count.map(|at| at.wrapping_add(missed as u16));
                });
                assert_eq!(bench.axis.fault(), lost.then_some(AxisFault::Encoder), "{missed} {speed}");
                assert_eq!(bench.axis.clear_fault(), !lost);
            }
        }
    }
}

#[test]
fn two_turns_without_an_index_are_a_lost_position_where_there_was_one() {
    // A turn takes 3,016 ticks.
    for (speed, ticks, lost) in [(50.0, 5000, false), (50.0, 9000, true), (-50.0, 9000, true)] {
        for request in [ask(5.0), AxisRequest::OFF] {
            let mut bench = Bench::at(speed, &CONFIGURATION);
            bench.run_sampled(request, ticks, |sample| sample.index_count = None);
            assert_eq!(bench.axis.fault(), lost.then_some(AxisFault::Encoder), "{speed} {ticks}");
            assert_eq!(bench.axis.clear_fault(), !lost);
        }
    }
    // Moved to and fro within a turn, no pulse is missing.
    let mut bench = Bench::at(50.0, &CONFIGURATION);
    for way in 0..40 {
        bench.motor.speed = if way % 2 == 0 { 50.0 } else { -50.0 };
        bench.run_sampled(ask(0.0), 2000, |sample| sample.index_count = None);
    }
    assert_eq!(bench.axis.fault(), None);
}

/// Ticks per turn at 50 rad/s.
const TURN: usize = 3016;

#[test]
fn one_wrong_index_pulse_changes_no_command_and_takes_nothing() {
    for request in [ask(5.0), AxisRequest::OFF] {
        for speed in [0.0, 50.0, -50.0] {
            // Single pulses, and bursts as long as a servo tick with a pulse in each tick.
            for burst in [1, 6] {
                let mut bench = Bench::at(speed, &CONFIGURATION);
                bench.run_sampled(request, 96, |_| {});
                let mut twin = bench.clone();
                bench.run_sampled(request, burst, |sample| sample.index_count = Some(sample.encoder_count));
                twin.run_sampled(request, burst, |_| {});
                for tick in 0..3 * TURN {
                    assert_eq!(bench.tick(request), twin.tick(request), "{speed} rad/s, tick {tick}");
                    if tick % 6 == 5 {
                        assert_eq!(bench.axis.joint_sample(), twin.axis.joint_sample());
                    } else {
                        bench.follow_up(tick);
                        twin.follow_up(tick);
                    }
                }
                assert_eq!((bench.axis.fault(), bench.axis.is_lost()), (None, false), "{speed} rad/s");
            }
        }
    }
}

#[test]
fn counts_that_were_lost_are_seen_at_the_second_index() {
    for (missed, speed) in [(6, 50.0), (-6, 50.0), (30, -50.0)] {
        let mut bench = Bench::at(speed, &CONFIGURATION);
        // Start shortly behind an index.
        while bench.sample.index_count.is_none() {
            bench.tick(ask(5.0));
        }
        bench.run_sampled(ask(5.0), 120, |_| {});
        bench.motor.encoder_zero += f64::from(missed) / 8192.0;
        let lose = |sample: &mut AxisSample| {
            sample.index_count = sample.index_count.map(|at| at.wrapping_add(missed as u16));
        };
        bench.run_sampled(ask(5.0), 3 * TURN / 2, lose);
        assert_eq!(bench.axis.fault(), None, "{missed} {speed}: one index");
        bench.run_sampled(ask(5.0), TURN / 2, lose);
        assert_eq!(bench.axis.fault(), Some(AxisFault::Encoder), "{missed} {speed}: two turns");
        assert_eq!(bench.tick(ask(5.0)), AxisCommand::BRAKE);
    }
}

/// Claim of docs/motor.md: `i cos(e)` makes torque and `i sin(e)` flows along the flux, e the electrical
/// angle lost.
#[test]
fn until_the_second_index_the_torque_falls_with_the_cosine_of_what_was_lost() {
    for (losses, counts) in [(1, 5), (1, 26), (5, 29)] {
        let mut bench = Bench::at(50.0, &CONFIGURATION);
        bench.run_sampled(ask(10.0), 1200, |_| {});
        for _ in 0..losses {
            bench.motor.encoder_zero -= f64::from(counts) / 8192.0;
            bench.run_sampled(ask(10.0), 12, |sample| sample.index_count = None);
        }
        bench.run_sampled(ask(10.0), 240, |sample| sample.index_count = None);
        let [(d, _), (q, _)] = bench.watch(ask(10.0), 864);
        let lost = f64::from(losses * counts) * 7.0 / 8192.0 * core::f64::consts::TAU;
        let (sine, cosine) = sin_cos(lost);
        // Tolerance: a degree of the calibration's offset, and the current-sensor offsets.
        assert!((q - 10.0 * cosine).abs() < 0.2, "{losses} times {counts}: {q} A, {cosine}");
        assert!((d.abs() - 10.0 * sine).abs() < 0.3, "{losses} times {counts}: {d} A, {sine}");
        assert_eq!(bench.axis.fault(), None, "{losses} times {counts}");
    }
}
