//! A refused, aborted or overtaken identification has no lasting effect.

use scarab::safety::PowerRequest;
use scarab_identify::formats::leg_file::StribeckFile;

use super::*;

/// Ticks of damping: 300 ms.
const DAMPING: u64 = 1200;

#[test]
fn after_a_stop_the_model_returns_without_a_torque_step() {
    let mut pair = identified();
    track_gait(&mut pair, context());
    run(&mut pair, SECOND);
    let in_motion = tick(&mut pair, None).servo.wanted_torque.map(|torque| torque.0.abs());
    tick(&mut pair, Some(ControlRequest::Power(PowerRequest::QuickStop)));
    // Wait until the leg hangs still: the damping by its speed does not come from the model.
    run(&mut pair, DAMPING + 5 * SECOND);
    assert!(pair.enable(context().gravity));
    let mut before = [0.0; JOINTS];
    for ticks in 0..SECOND {
        let torque = tick(&mut pair, None).servo.decision.torque.map(|torque| torque.0);
        for joint in 0..JOINTS {
            // The whole torque of the model, mostly gravity, fades in over 2000 ticks: 0.02 N m in each. One
            // encoder count adds the feedback's response.
            let step = (torque[joint] - before[joint]).abs();
            assert!(step < 0.6, "joint {joint}, tick {ticks}: {step} N m, {in_motion:?} in motion");
        }
        before = torque;
    }
    // At the end the model holds the leg.
    assert!(before[0].abs() > 1.0 || before[1].abs() > 1.0, "{before:?}");
}

#[test]
fn an_identification_begun_before_the_verdict_keeps_both_halves_consistent() {
    let mut pair = identified();
    tick(&mut pair, Some(ControlRequest::Identify));
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(IdentifyPhase::Judge)));
    let model = pair.leg.control().model().copied();
    let watched = pair.leg.identification().model_monitor().clone();
    let output = tick(&mut pair, Some(ControlRequest::Identify));
    assert!(!output.refused);
    assert_eq!(activity(&pair), Activity::Identify(IdentifyPhase::Approach));
    // The verdict was expected within eight ticks.
    run(&mut pair, 100);
    assert_eq!(pair.leg.control().verdict(), None);
    assert_eq!(pair.leg.control().model().copied(), model);
    assert_eq!(*pair.leg.identification().model_monitor(), watched, "it monitors a model that is not in use");
}

#[test]
fn a_refused_result_does_not_change_the_monitored_friction() {
    let mut leg = default_leg();
    for joint in &mut leg.joints {
        joint.stribeck = Some(StribeckFile { static_nm: 6.5, speed_rad_s: 0.1 });
    }
    let context =
        Context::new(&leg, &SimulationOptions::with_seed(1)).expect("the default leg with another friction");
    let mut pair = Pair::new(&leg, &context, 1).expect("the firmware accepts the leg");
    assert!(pair.enable(context.gravity));
    assert!(identify(&mut pair).is_some_and(Verdict::is_accepted));
    let accepted = pair.leg.identification().model().stribeck;
    assert!(accepted.iter().all(|curve| curve.excess > 0.1), "{accepted:?}");

    // Identify again, with a current sensor that reads twice the current in slow passages.
    tick(&mut pair, Some(ControlRequest::Identify));
    while matches!(activity(&pair), Activity::Identify(_)) {
        if activity(&pair) == Activity::Identify(IdentifyPhase::Excite) {
            for joint in &mut pair.sample.joints {
                joint.current = joint.current * 2.0;
            }
        }
        tick(&mut pair, None);
    }
    let verdict = pair.leg.control().verdict().expect("the identification did not end");
    assert!(!verdict.is_accepted());
    assert_ne!(pair.leg.identification().model().stribeck, accepted, "the refused result has another curve");

    track_gait(&mut pair, &context);
    run(&mut pair, SECOND);
    assert_eq!(pair.leg.identification().model().stribeck, accepted);
}
