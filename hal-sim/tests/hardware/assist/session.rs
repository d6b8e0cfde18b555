//! Beginning and end of a session: what is refused, and torque without steps.

use super::bench::{Bench, SECOND, insisting, models, person};
use super::{HALF, MOST, POSTURE, walking};
use hal_sim::wearer::muscles::Intention;
use scarab::leg::{Activity, AssistPhase, AssistShares, ControlRequest, PowerRequest, Wearing};

/// A tenth of the torque cap, N m.
const TENTH_OF_CAP: f64 = 8.5;

/// Largest change of a commanded torque within a log period (2 ms) while ticks run, N m.
fn largest_step(bench: &mut Bench, ticks: u32) -> f64 {
    let mut past = std::collections::VecDeque::new();
    let mut largest = 0.0_f64;
    for _ in 0..ticks {
        let torque = bench.tick(None).servo.decision.torque.map(|torque| f64::from(torque.0));
        if past.len() == 8 {
            past.pop_front();
        }
        past.push_back(torque);
        let oldest: [f64; 2] = past[0];
        largest = (0..2).fold(largest, |largest, joint| largest.max((torque[joint] - oldest[joint]).abs()));
    }
    largest
}

#[test]
fn a_session_begins_and_ends_in_motion_without_a_step_of_torque() {
    let mut bench = Bench::enabled(&person(), POSTURE);
    // The motors take the weight of both legs before the session.
    bench.run(SECOND);
    bench.begin(MOST);
    bench.intend(Intention::Follow(walking(0.5)));
    let begun = largest_step(&mut bench, 4 * SECOND);
    assert_eq!(bench.leg.control().activity(), Activity::Assist(AssistPhase::Run));
    assert!(!bench.tick(Some(ControlRequest::EndAssist)).refused);
    let ended = largest_step(&mut bench, SECOND - 10);
    assert_eq!(bench.leg.control().activity(), Activity::Assist(AssistPhase::Leave));
    let held = largest_step(&mut bench, 40);
    assert_eq!(bench.leg.control().activity(), Activity::Idle);
    assert!(begun < TENTH_OF_CAP && ended < TENTH_OF_CAP && held < TENTH_OF_CAP, "{begun} {ended} {held}");
}

#[test]
fn a_session_without_its_models_is_refused() {
    let mut bench = Bench::off(&person(), POSTURE);
    bench.power_up();
    let weight = AssistShares { weight: 0.5, ..HALF };
    assert!(bench.tick(Some(ControlRequest::Assist(HALF))).refused, "no model");
    let [empty, worn] = models(1.0);
    assert!(bench.leg.set_model(Wearing::Empty, empty));
    assert!(bench.tick(Some(ControlRequest::Assist(weight))).refused, "no model of the worn leg");
    let beyond = AssistShares { inertia: 0.9, ..HALF };
    assert!(bench.tick(Some(ControlRequest::Assist(beyond))).refused, "a share beyond its limit");
    assert!(bench.leg.set_model(Wearing::Worn, worn));
    assert!(!bench.tick(Some(ControlRequest::Assist(weight))).refused);
    assert!(bench.tick(Some(ControlRequest::Identify)).refused, "assisting");
    assert!(bench.tick(Some(ControlRequest::Assist(weight))).refused, "assisting");
}

#[test]
fn a_quick_stop_ends_the_session_at_once() {
    let mut bench = Bench::assisting(&insisting(), POSTURE, MOST);
    bench.intend(Intention::Follow(walking(0.8)));
    bench.run(3 * SECOND);
    bench.tick(Some(ControlRequest::Power(PowerRequest::QuickStop)));
    assert!(!bench.assists() && !bench.leg.control().state().is_enabled());
    bench.run(2 * SECOND);
    assert!(!bench.assists());
}

#[test]
fn a_model_that_overcompensates_friction_stays_within_the_speed_limit() {
    let mut bench = Bench::enabled(&person(), POSTURE);
    // Half again the true friction, as if it were certain: the leg accelerates once it moves, and its energy
    // observer takes that for friction too.
    let [empty, _] = models(1.5);
    assert!(bench.leg.set_model(Wearing::Empty, empty));
    bench.begin(AssistShares { friction: 1.0, ..AssistShares::GRAVITY_ONLY });
    bench.run(SECOND);
    bench.intend(Intention::Follow(walking(0.5)));
    let mut fastest = 0.0_f64;
    for _ in 0..20 * SECOND {
        bench.tick(None);
        fastest = bench.world.velocity().iter().fold(fastest, |fastest, speed| fastest.max(speed.abs()));
    }
    // The limit is 4.5 rad/s; the wearer pushes too.
    assert!(fastest < 1.1 * 4.5, "{fastest}");
}

#[test]
fn a_session_that_leaves_while_it_enters_has_no_step_of_torque() {
    let mut bench = Bench::enabled(&person(), POSTURE);
    bench.run(SECOND);
    bench.begin(MOST);
    bench.run(SECOND / 10);
    assert!(!bench.tick(Some(ControlRequest::EndAssist)).refused);
    let largest = largest_step(&mut bench, SECOND);
    assert_eq!(bench.leg.control().activity(), Activity::Idle);
    assert!(largest < TENTH_OF_CAP, "{largest}");
}
