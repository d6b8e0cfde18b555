//! Requests for the servo's tick, samples of running axes, and outcomes that wait.

use super::*;

/// Ticks both axes until the servo was requested `requests` times; if `answers`, it ticks after each request.
fn request(signals: &Signals<2>, requests: u32, answers: bool) -> u32 {
    let volt_per_code = SenseScale::ODRIVE_3_6.volt_per_code;
    let mut loops = CurrentLoops::new([AxisState::OFF; 2], PERIOD, None, volt_per_code);
    let (mut hardware, mut queues) = (TestHardware::new(), Queues::new());
    let mut periods = 0;
    while hardware.servo_pended < requests {
        periods += 1;
        for axis in 0..2 {
            let before = hardware.servo_pended;
            let tick = tick_at(periods * PERIOD.get(), AxisSample::default());
            loops.tick(axis, &tick, &mut queues.current(), signals, &mut hardware);
            if answers && hardware.servo_pended != before {
                signals.statistics.servo_ticks.add();
            }
        }
    }
    periods
}

#[test]
fn no_request_after_the_start_counts_as_missed() {
    let signals = Signals::new();
    assert_eq!(request(&signals, 10, true), 60);
    assert_eq!((signals.statistics.servo_missed.get(), signals.inhibit.causes()), (0, 0));
    assert_eq!(signals.statistics.current_ticks.each_ref().map(|ticks| ticks.get()), [60; 2]);
}

#[test]
fn a_servo_that_never_answers_is_counted_and_inhibits() {
    let signals = Signals::new();
    request(&signals, 3, false);
    assert_eq!((signals.statistics.servo_missed.get(), signals.inhibit.causes()), (2, 0));
    let signals = Signals::new();
    request(&signals, 4, false);
    let given_up = InhibitReason::ServoTicks.bit();
    assert_eq!((signals.statistics.servo_missed.get(), signals.inhibit.causes()), (3, given_up));
}

#[test]
fn each_running_axis_sends_one_sample_in_six_periods() {
    let mut bench = Bench::new(&CONFIGURATION);
    *bench.loops.axis_state_mut(1).expect("two axes") = AxisState::OFF;
    let mut samples = [0; 2];
    for period in 1..=12 {
        let now = bench.now.wrapping_add(period * PERIOD.get());
        let Ends { mut current, mut servo, .. } = bench.queues.split(&mut bench.events);
        for axis in 0..2 {
            let sample = bench.motors[axis].period(AxisCommand::OFF);
            bench.loops.tick(axis, &tick_at(now, sample), &mut current, &bench.signals, &mut bench.hardware);
            while servo.samples[axis].dequeue().is_some() {
                samples[axis] += 1;
            }
        }
    }
    assert_eq!(samples, [2, 0]);
}

#[test]
fn an_outcome_waits_for_space_in_its_queue() {
    let search = crate::motor::IndexSearch::EMPTY;
    let mut bench = Bench::new(&CONFIGURATION);
    let mut ends = bench.queues.current();
    while ends.outcomes[1].enqueue(Outcome::Index(search)).is_ok() {}
    bench.loops.axis_state_mut(1).and_then(AxisState::axis_mut).expect("running").lose_position();
    bench.outcomes.clear();
    bench.run(2);
    let is_fault = |outcome: &&(usize, Outcome)| matches!(outcome, (1, Outcome::Fault { lost: true, .. }));
    assert_eq!(bench.outcomes.iter().filter(is_fault).count(), 1, "{:?}", bench.outcomes);
    // Searches are not kept: a later pulse repeats them.
    let mut unsent = None;
    let Ends { mut current, .. } = bench.queues.split(&mut bench.events);
    for _ in 0..8 {
        report(1, Outcome::Index(search), &mut unsent, &mut current, &bench.signals);
    }
    assert_eq!(unsent, None);
    report(1, Outcome::Interrupted, &mut unsent, &mut current, &bench.signals);
    assert_eq!(unsent, Some(Outcome::Interrupted));
}
