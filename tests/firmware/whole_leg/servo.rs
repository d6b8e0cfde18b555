//! Tracking performance of the leg.

use scarab::motion::{Fourier, HARMONICS, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::Second;

use super::*;

const AMPLITUDE_RAD: f32 = 0.01;
const CYCLES: u32 = 12;

/// Amplitude ratio of a joint's response to a commanded sine, about the pose at which it is enabled.
///
/// The last eight cycles are projected on the command, so friction's harmonics do not count.
fn amplitude_ratio(joint: usize, frequency_hz: f32) -> f64 {
    let leg = default_leg();
    let mut pair = enabled(&leg, 1);
    let centre: [f32; JOINTS] = core::array::from_fn(|joint| {
        let configuration = &context().configuration.joints[joint];
        0.5 * (configuration.low.0 + configuration.high.0)
    });
    let mut amplitudes = [[0.0; HARMONICS]; JOINTS];
    amplitudes[joint][0] = AMPLITUDE_RAD;
    let curve = Fourier::new(Second(1.0 / frequency_hz), centre, amplitudes, [[0.0; HARMONICS]; JOINTS]);
    let motion = Periodic::new(curve.expect("finite"), Second(1.0), CYCLES, SERVO_RATE_HZ).expect("sensible");
    let proved = context().configuration.prove(motion).expect("small");
    assert!(pair.leg.set_tracked(proved));
    tick(&mut pair, Some(ControlRequest::Track { with_model: false }));
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Track(Step::Run)));
    run(&mut pair, u64::from(motion.blend_ticks() + (CYCLES - 8) * motion.period_ticks()));
    let scale = context().configuration.joints[joint].scale;
    let (mut commanded, mut followed) = ([0.0; 2], [0.0; 2]);
    let ticks = 8 * motion.period_ticks();
    for index in 0..ticks {
        let truth = pair.world.anatomical_position()[joint];
        let output = tick(&mut pair, None);
        let phase = f64::from(index) / f64::from(motion.period_ticks()) * core::f64::consts::TAU;
        let (sine, cosine) = scarab::real::sin_cos(phase);
        let angle = f64::from(scale.anatomy.direction()) * truth + f64::from(scale.anatomy.zero_offset());
        let command = f64::from(output.motion.position_rad[joint]);
        for (sums, value) in [(&mut commanded, command), (&mut followed, angle)] {
            sums[0] += value * sine;
            sums[1] += value * cosine;
        }
    }
    assert_eq!(activity(&pair), Activity::Track(Step::Run));
    let size = |sums: [f64; 2]| sums[0].hypot(sums[1]);
    assert!((size(commanded) / f64::from(ticks) * 2.0 / f64::from(AMPLITUDE_RAD) - 1.0).abs() < 1e-3);
    size(followed) / size(commanded)
}

#[test]
fn feedback_alone_follows_four_hertz_by_more_than_half_the_power() {
    for joint in 0..JOINTS {
        let ratio = amplitude_ratio(joint, 4.0);
        println!("joint {joint}: {ratio:.3}");
        // Measured: 1.11 and 1.10, because the commanded speed leads; above 1.3 the loop would oscillate.
        assert!(ratio > 0.707 && ratio < 1.3, "joint {joint}: {ratio}");
    }
}

/// A board stops ticking when a rotor position is lost, in any drive state, and restarts with other zeros.
#[test]
fn control_restarted_during_a_motion_is_off() {
    let mut pair = enabled(&default_leg(), 1);
    tick(&mut pair, Some(ControlRequest::Identify));
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(IdentifyPhase::Excite)));
    let (mut control, mut sample) = (pair.leg.control().clone(), pair.sample);
    assert!(control.tick(&sample, None, context().gravity, None).servo.drive().enabled);
    control.restart();
    sample.joints.iter_mut().for_each(|joint| joint.encoder_counts = 0);
    for _ in 0..100 {
        let output = control.tick(&sample, None, context().gravity, None);
        assert!(!output.servo.drive().enabled && output.servo.decision.fault.is_none(), "{output:?}");
        assert_eq!(control.activity(), Activity::Idle);
    }
    assert_eq!(control.state(), DriveState::SwitchOnDisabled);
}

#[test]
fn a_motion_is_set_before_it_is_tracked_and_stays_while_it_runs() {
    let leg = default_leg();
    let mut pair = enabled(&leg, 1);
    let track = ControlRequest::Track { with_model: false };
    assert!(tick(&mut pair, Some(track)).refused, "no motion is set");
    let motion = context().configuration.prove(context().motions.validation[1]).expect("proved before");
    assert!(pair.leg.set_tracked(motion));
    assert!(!tick(&mut pair, Some(track)).refused);
    let other = context().configuration.prove(context().motions.validation[0]).expect("proved before");
    let ticks = [motion, other].map(|motion| u64::from(motion.motion().duration_ticks()));
    assert!(ticks[0].abs_diff(ticks[1]) > 2 * SECOND, "{ticks:?}");
    assert!(!pair.leg.set_tracked(other), "an approach ends at its own motion");
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Track(Step::Run)));
    assert!(!pair.leg.set_tracked(other));
    let begun = pair.ticks;
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Idle));
    let lasted = pair.ticks - begun;
    assert!((ticks[0]..ticks[0] + SECOND).contains(&lasted), "{lasted} {ticks:?}");
    assert!(pair.leg.set_tracked(other));
}
