//! Sessions of assistance: requests, samples to the law, torques back.

use super::super::super::AssistLevel;
use super::*;
use crate::leg::testing::model;
use crate::leg::{AssistPhase, AssistShares, Plan, Wearing};

const SHARES: AssistShares = AssistShares { friction: 1.0, ..AssistShares::GRAVITY_ONLY };

/// An enabled leg with a model of the empty leg.
fn ready() -> Bench {
    let mut bench = Bench::enabled();
    assert!(bench.control.set_model(Wearing::Empty, model()));
    bench
}

/// Ticks with the level of the law, which the servo requests with each sample.
fn run(bench: &mut Bench, law: &mut AssistLevel<2>, ticks: u32) {
    for _ in 0..ticks {
        let pended = bench.hardware.assist_pended;
        bench.tick();
        if bench.hardware.assist_pended > pended {
            law.run(&mut bench.assist);
        }
    }
}

#[test]
fn the_button_begins_a_session_and_ends_it() {
    let (mut bench, mut law) = (ready(), AssistLevel::new());
    bench.ask(ControlRequest::Assist(SHARES));
    run(&mut bench, &mut law, SERVO_RATE_HZ + 20);
    assert_eq!(bench.control.activity(), Activity::Assist(AssistPhase::Run));
    assert!(law.law().energy().is_some());
    bench.ask(ControlRequest::Assist(SHARES));
    run(&mut bench, &mut law, 1);
    assert_eq!(bench.control.activity(), Activity::Assist(AssistPhase::Leave));
    run(&mut bench, &mut law, SERVO_RATE_HZ + 20);
    assert!(!bench.control.activity().assists());
    assert_eq!(bench.control.state(), DriveState::OperationEnabled);
}

#[test]
fn refusals_and_ends_are_recorded_with_their_reason() {
    let (mut bench, mut law) = (Bench::enabled(), AssistLevel::new());
    let record = |bench: &Bench, event, why| {
        bench.events.iter().any(|found| matches!(found, LegEvent::Record(Record::Assist { event: e, why: w, .. }) if *e == event && *w == why))
    };
    bench.ask(ControlRequest::Assist(SHARES));
    run(&mut bench, &mut law, 2);
    assert!(record(&bench, "refused", "no_empty_model"));
    assert!(bench.control.set_model(Wearing::Empty, model()));
    bench.ask(ControlRequest::Assist(AssistShares { weight: 0.5, ..SHARES }));
    run(&mut bench, &mut law, 2);
    assert!(record(&bench, "refused", "no_worn_model"));
    bench.ask(ControlRequest::Assist(SHARES));
    run(&mut bench, &mut law, 20);
    bench.order(None, Some(LegRequest::EndAssist));
    run(&mut bench, &mut law, 2);
    assert!(record(&bench, "ending", "requested"));
}

#[test]
fn without_an_answer_of_the_law_the_session_ends() {
    let mut bench = ready();
    bench.ask(ControlRequest::Assist(SHARES));
    bench.run(60);
    // The law never had a share of the torque.
    assert!(!bench.control.activity().assists());
}

#[test]
fn a_host_begins_and_ends_a_session_and_names_the_leg() {
    let (mut bench, mut law) = (ready(), AssistLevel::new());
    bench.order(None, Some(LegRequest::Assist(SHARES)));
    run(&mut bench, &mut law, 20);
    assert_eq!(bench.control.activity(), Activity::Assist(AssistPhase::Enter));
    bench.order(None, Some(LegRequest::EndAssist));
    run(&mut bench, &mut law, 100);
    assert!(!bench.control.activity().assists());
    let worn = LegRequest::Identify { plan: Plan::OneTime, seed: 1, wearing: Some(Wearing::Worn) };
    bench.order(None, Some(worn));
    run(&mut bench, &mut law, 1);
    assert_eq!(bench.control.wearing(), Some(Wearing::Worn));
    assert!(bench.events.contains(&LegEvent::Begun(Some((Plan::OneTime, 1)), Some(Wearing::Worn))));
}

#[test]
fn an_open_switch_ends_a_session_at_once() {
    let (mut bench, mut law) = (ready(), AssistLevel::new());
    bench.order(None, Some(LegRequest::Assist(SHARES)));
    run(&mut bench, &mut law, 100);
    bench.hardware.contacts.enabling = false;
    run(&mut bench, &mut law, 2);
    assert!(!bench.control.state().is_enabled() && !bench.control.activity().assists());
}
