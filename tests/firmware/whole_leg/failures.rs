//! Stops and faults in the middle of an identification.

use scarab::safety::{FaultCode, PowerRequest};

use super::*;

/// Ticks of damping: 300 ms.
const DAMPING: u64 = 1200;

/// During the swarm's search, which is slowed down for the test.
fn during_the_search() -> Pair {
    let mut pair = before_the_search();
    pair.evaluations = 1;
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(IdentifyPhase::Solve)));
    let solver = pair.leg.identification().solver().expect("recorded");
    assert_eq!(solver.search().state(), scarab::ident::SearchState::Running);
    pair
}

/// In the exciting motion of a second identification, with the first one's model in use.
fn identifying_again() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = identified();
        tick(&mut pair, Some(ControlRequest::Identify));
        assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(IdentifyPhase::Excite)));
        run(&mut pair, 5 * SECOND);
        pair
    })
    .clone()
}

/// Continues and checks that the aborted identification has no effect and no command is implausible.
fn nothing_comes_of_it(pair: &mut Pair, ticks: u64) {
    let before = (pair.leg.control().model().copied(), pair.leg.control().verdict());
    let found = pair.leg.identification().clone();
    for _ in 0..ticks {
        let output = tick(pair, None);
        assert!(output.servo.drive().currents.iter().all(|current| current.is_finite()));
        assert_eq!(activity(pair), Activity::Idle);
    }
    assert_eq!((pair.leg.control().model().copied(), pair.leg.control().verdict()), before);
    // The aborted run gets no evaluation.
    assert_eq!(*pair.leg.identification(), found);
}

#[test]
fn a_quick_stop_in_any_phase_allows_a_later_identification() {
    let phases =
        [("excite", during_excitation()), ("solve", during_the_search()), ("validate", during_validation())];
    for (phase, mut pair) in phases {
        let output = tick(&mut pair, Some(ControlRequest::Power(PowerRequest::QuickStop)));
        assert_eq!(activity(&pair), Activity::Idle, "{phase}");
        assert!(matches!(output.servo.decision.state, DriveState::QuickStopActive { .. }), "{phase}");
        for _ in 0..DAMPING {
            // Damping removes energy: torque against motion, or zero.
            let output = tick(&mut pair, None);
            for (torque, speed) in output.servo.decision.torque.iter().zip(output.servo.velocity) {
                assert!(torque.0 * speed.0 <= 0.0, "{phase}: {torque:?} at {speed:?}");
            }
        }
        assert_eq!(pair.leg.control().state(), DriveState::SwitchOnDisabled, "{phase}");
        nothing_comes_of_it(&mut pair, 4 * SECOND);
        assert_eq!((pair.leg.control().verdict(), pair.leg.control().model()), (None, None), "{phase}");
        pair.evaluations = pair::EVALUATIONS_PER_TICK;
        // With its outputs off the leg has come to rest within its range.
        assert!(pair.enable(context().gravity), "{phase}");
        assert!(identify(&mut pair).is_some_and(Verdict::is_accepted), "{phase}");
    }
}

#[test]
fn implausible_counts_end_the_identification_and_keep_the_old_model() {
    for absurd in [i32::MAX, i32::MIN, i32::MAX / 2] {
        for joint in 0..JOINTS {
            let mut pair = identifying_again();
            let model = pair.leg.control().model().copied();
            for _ in 0..3 {
                assert!(matches!(activity(&pair), Activity::Identify(_)));
                pair.sample.joints[joint].encoder_counts = absurd;
                let output = tick(&mut pair, None);
                assert!(output.servo.drive().currents.iter().all(|current| current.is_finite()));
            }
            // One or two impossible readings are bridged; the third damps.
            let fault = pair.leg.control().state().fault().expect("the fault is detected");
            assert_eq!((fault.code, usize::from(fault.joint)), (FaultCode::EncoderStep, joint));
            assert_eq!(activity(&pair), Activity::Idle);
            for _ in 0..=DAMPING {
                pair.sample.joints[joint].encoder_counts = absurd;
                let output = tick(&mut pair, None);
                assert!(output.servo.drive().currents.iter().all(|current| current.is_finite()));
            }
            assert_eq!(pair.leg.control().state(), DriveState::Fault { fault });
            nothing_comes_of_it(&mut pair, SECOND);
            assert_eq!((pair.leg.control().model().copied(), pair.leg.control().verdict()), (model, None));
        }
    }
}

#[test]
fn a_single_implausible_count_is_bridged_and_never_harmful() {
    // 30,000 counts are 26 degrees: a mean of eight with such a reading would move parameters by 20 sigma.
    for (joint, glitch) in [(1, i32::MAX), (0, 30_000), (1, -30_000), (0, 10_000), (1, 3_000)] {
        let mut pair = during_excitation();
        let counts = &mut pair.sample.joints[joint].encoder_counts;
        *counts = counts.wrapping_add(glitch);
        tick(&mut pair, None);
        assert_eq!(activity(&pair), Activity::Identify(IdentifyPhase::Excite));
        assert!(run_until(&mut pair, |pair| !matches!(activity(pair), Activity::Identify(_))));
        assert!(is_enabled(&pair));
        let verdict = pair.leg.control().verdict().expect("the motion did not continue");
        if verdict.is_accepted() {
            let worst = worst_pull(&pair.leg.identification().solver().expect("solved").estimate());
            assert!(worst < 4.0, "joint {joint}, {glitch} counts: {worst} sigma");
        }
    }
}

#[test]
fn a_refused_result_keeps_the_previous_model() {
    let mut pair = identified();
    let model = pair.leg.control().model().copied();
    assert!(model.is_some());
    tick(&mut pair, Some(ControlRequest::Identify));
    while matches!(activity(&pair), Activity::Identify(_)) {
        if let Activity::Identify(IdentifyPhase::Validate { .. }) = activity(&pair) {
            // A sensor fault that begins after the excitation.
            pair.sample.joints[1].current = pair.sample.joints[1].current * 2.0;
        }
        tick(&mut pair, None);
    }
    let verdict = pair.leg.control().verdict().expect("the identification did not end");
    assert!(verdict.has(scarab::ident::Reason::Validation));
    assert_eq!(pair.leg.control().model().copied(), model);
}

#[test]
fn a_request_during_motion_is_refused_without_a_command_step() {
    let mut pair = during_validation();
    let phase = IdentifyPhase::Validate { motion: 2, step: Step::Run };
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(phase)));
    run(&mut pair, 4 * SECOND);
    let before = pair.tick(None, context().gravity);
    let asked = pair.tick(Some(ControlRequest::Identify), context().gravity);
    assert!(asked.refused && !before.refused);
    assert_eq!(activity(&pair), Activity::Identify(phase));
    assert!(run_until(&mut pair, |pair| !matches!(activity(pair), Activity::Identify(_))));
    assert!(pair.leg.control().verdict().is_some_and(Verdict::is_accepted));
}

#[test]
fn commanded_speed_and_torque_never_jump_from_start_to_tracking() {
    let mut pair = enabled(&default_leg(), 1);
    let mut before = pair.tick(None, context().gravity);
    let mut request = Some(ControlRequest::Identify);
    let gait = context().configuration.prove(context().motions.validation[1]).expect("proved at the start");
    for second_half in [false, true] {
        while pair.ticks == 0 || request.is_some() || activity(&pair) != Activity::Idle {
            let output = pair.tick(request.take(), context().gravity);
            for joint in 0..JOINTS {
                let speed = output.motion.velocity_rad_per_s[joint] - before.motion.velocity_rad_per_s[joint];
                // The gait's largest acceleration is 25 rad/s2: 0.006 rad/s in a tick.
                assert!(speed.abs() < 0.008, "joint {joint}, tick {}: {speed}", pair.ticks);
                let torque = output.servo.decision.torque[joint].0 - before.servo.decision.torque[joint].0;
                // The feedforward of Coulomb friction reverses by 9.3 N m within 0.04 rad/s; gravity is 20 N
                // m and more.
                assert!(torque.abs() < 4.0, "joint {joint}, tick {}: {torque}", pair.ticks);
            }
            before = output;
        }
        if !second_half {
            assert!(pair.leg.set_tracked(gait));
            request = Some(ControlRequest::Track { with_model: true });
        }
    }
}
