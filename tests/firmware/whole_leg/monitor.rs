//! Monitoring after acceptance: the load changes while the leg walks.

use scarab::ident::Cause;
use scarab::leg::UPDATE_ROWS;
use scarab::motion::Periodic;
use scarab::safety::PowerRequest;
use scarab::servo::{SERVO_RATE_HZ, ServoOutput};
use scarab::units::Second;

use super::*;

/// Payload of 3 kg at 0.2 m of the shank.
const MASS: f64 = 3.0;
const DISTANCE_M: f64 = 0.2;

/// Requests to walk the 3 s gait for three minutes.
fn walk(pair: &mut Pair, with_model: bool) {
    let curve = *context().motions.validation[1].curve();
    let motion = Periodic::new(curve, Second(1.0), 60, SERVO_RATE_HZ).expect("a motion");
    assert!(pair.leg.set_tracked(context().configuration.prove(motion).expect("within limits")));
    tick(pair, Some(ControlRequest::Track { with_model }));
}

/// A pair ten seconds into the walk with the model.
fn walking() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = identified();
        walk(&mut pair, true);
        assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Track(Step::Run)));
        run(&mut pair, 10 * SECOND);
        assert_eq!(pair.leg.control().change(), None);
        pair
    })
    .clone()
}

/// A pair just after an update was offered.
fn offered() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = walking();
        pair.world.attach(1, MASS, [DISTANCE_M, 0.0, 0.0]);
        assert!(run_until(&mut pair, |pair| pair.leg.control().is_update_offered()));
        pair
    })
    .clone()
}

fn seconds_until(pair: &mut Pair, reached: impl Fn(&Pair) -> bool) -> f64 {
    let before = pair.ticks;
    assert!(run_until(pair, reached));
    (pair.ticks - before) as f64 / SECOND as f64
}

#[test]
fn a_payload_is_detected_in_seconds_and_identified() {
    let mut pair = walking();
    pair.world.attach(1, MASS, [DISTANCE_M, 0.0, 0.0]);
    let noticed = seconds_until(&mut pair, |pair| pair.leg.control().change().is_some());
    let change = *pair.leg.control().change().expect("noticed");
    println!("detected after {noticed} s, {change:?}");
    // Expected: six seconds of persistence, during which the knee partly rests, and the filter's length.
    assert!((6.0..9.0).contains(&noticed), "{noticed} s");
    assert!((f64::from(change.since_s) - noticed).abs() < 1.5, "{change:?}");
    assert!(change.joints[1]);

    let collected = seconds_until(&mut pair, |pair| pair.leg.control().is_update_offered());
    println!("collected in {collected} s");
    assert!(collected * 50.0 >= f64::from(UPDATE_ROWS) && collected < 20.0, "{collected} s");
    let update = pair.leg.identification().model_monitor().update().expect("offered").clone();
    assert_eq!(update.cause, Cause::Payload { link: 1 });
    let found = &update.payload[1];
    // Mass and moment, the first two parameters of a payload; three standard deviations (1.7 % and 1.8 %).
    for (index, truth) in [(0, MASS), (1, MASS * DISTANCE_M)] {
        let sigma = f64::from(found.sigma(index).expect("determined"));
        assert!((f64::from(found.values[index]) - truth).abs() < 3.0 * sigma, "{found:?}");
        assert!(sigma < 0.01 * truth, "sigma {sigma} of {truth}");
    }
    // No update was applied without a request.
    assert_eq!(pair.leg.control().model(), identified().leg.control().model());
}

#[test]
fn an_update_is_applied_without_a_torque_step_and_then_monitored() {
    let mut pair = offered();
    let old = *pair.leg.control().model().expect("accepted");
    let torque = |output: &ServoOutput<JOINTS>| output.wanted_torque.map(|torque| torque.0);
    let before = torque(&tick(&mut pair, None).servo);
    let largest = |pair: &mut Pair, mut request: Option<ControlRequest>| {
        let (mut largest, mut before) = (0.0_f32, before);
        for _ in 0..SECOND {
            let now = torque(&tick(pair, request.take()).servo);
            largest =
                now.iter().zip(before).fold(largest, |most, (now, before)| most.max((now - before).abs()));
            before = now;
        }
        largest
    };
    let mut same_phase = pair.clone();
    let unfaded = largest(&mut pair, None);
    let faded = largest(&mut same_phase, Some(ControlRequest::TakeUpdate));
    println!("largest step of torque in one tick: {unfaded} N m without, {faded} N m with the update");
    // One count of the encoder steps the torque by some tenths of a N m, the fading by a 2000th of some
    // 10 N m.
    assert!(faded < unfaded + 0.2, "{faded} against {unfaded}");
    let mut pair = same_phase;
    assert_ne!(pair.leg.control().model(), Some(&old));
    assert_eq!(pair.leg.control().change(), None);
    // An update can be applied only once.
    assert!(tick(&mut pair, Some(ControlRequest::TakeUpdate)).refused);
    for _ in 0..60 * SECOND {
        tick(&mut pair, None);
        assert_eq!(pair.leg.control().change(), None);
    }
}

#[test]
fn no_update_is_available_before_a_change() {
    let mut pair = walking();
    let output = tick(&mut pair, Some(ControlRequest::TakeUpdate));
    assert!(output.refused && !output.took_update);
    assert_eq!(activity(&pair), Activity::Track(Step::Run));
}

#[test]
fn a_leg_that_was_never_identified_is_not_monitored() {
    let mut pair = enabled(&default_leg(), 1);
    walk(&mut pair, false);
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Track(Step::Run)));
    pair.world.attach(1, MASS, [DISTANCE_M, 0.0, 0.0]);
    for _ in 0..30 * SECOND {
        tick(&mut pair, None);
        assert_eq!(pair.leg.control().change(), None);
    }
}

#[test]
fn a_stop_discards_the_collected_rows() {
    let mut pair = walking();
    pair.world.attach(1, MASS, [DISTANCE_M, 0.0, 0.0]);
    assert!(run_until(&mut pair, |pair| pair.leg.control().change().is_some()));
    tick(&mut pair, Some(ControlRequest::Power(PowerRequest::QuickStop)));
    for _ in 0..30 * SECOND {
        tick(&mut pair, None);
        assert!(!pair.leg.control().is_update_offered());
    }
    // After enabling again the change is detected again.
    assert!(pair.enable(context().gravity));
    walk(&mut pair, true);
    assert_eq!(pair.leg.control().change(), None);
    assert!(run_until(&mut pair, |pair| pair.leg.control().change().is_some()));
}

#[test]
fn a_stored_model_has_no_uncertainty_and_is_not_monitored() {
    let mut pair = identified();
    let kept = *pair.leg.control().model().expect("accepted");
    assert!(pair.leg.identification().model_monitor().baseline().is_some());
    assert!(pair.leg.adopt(kept));
    assert_eq!(pair.leg.identification().model_monitor().baseline(), None);
}
