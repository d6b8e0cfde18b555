//! Properties of the monitor.

use super::*;
use crate::hal::SERVO_RATE_HZ;
use crate::safety::derating::JointShares;
use crate::safety::derating::tests::RAMPS;
use crate::safety::limits::tests::{HIP, KNEE};
use crate::testing::TestRandom;
use crate::units::Volt;

const MIDDLE: [Radian; 2] = [Radian(0.45), Radian(-0.9)];
const STANDING: Observation<2> = Observation {
    position: MIDDLE,
    velocity: [RadianPerSecond::ZERO; 2],
    current: [Ampere::ZERO; 2],
    rejected: [false; 2],
};

fn request(torque: f32) -> Request<2> {
    Request { torque: [NewtonMetre(torque); 2], power: None }
}

fn ask(power: PowerRequest) -> Request<2> {
    Request { power: Some(power), ..request(0.0) }
}

fn off() -> Monitor<2> {
    Monitor::new(Limits::new([HIP, KNEE]).expect("sensible"), SERVO_RATE_HZ)
}

/// Requests each step up to enabling; returns the decision on the last one, which has its own observation.
fn enable(monitor: &mut Monitor<2>, before: &Observation<2>, last: &Observation<2>) -> Decision<2> {
    let _ = monitor.decide(before, &ask(PowerRequest::Shutdown));
    let _ = monitor.decide(before, &ask(PowerRequest::SwitchOn));
    monitor.decide(last, &ask(PowerRequest::EnableOperation))
}

fn enabled() -> Monitor<2> {
    let mut monitor = off();
    assert_eq!(enable(&mut monitor, &STANDING, &STANDING).state, DriveState::OperationEnabled);
    monitor
}

#[test]
fn no_value_that_is_not_finite_reaches_the_bridge() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for joint in 0..2 {
            for field in 0..4 {
                let (mut observation, mut wanted) = (STANDING, request(5.0));
                match field {
                    0 => observation.position[joint].0 = bad,
                    1 => observation.velocity[joint].0 = bad,
                    2 => observation.current[joint].0 = bad,
                    _ => wanted.torque[joint].0 = bad,
                }
                let mut monitor = enabled();
                let decision = monitor.decide(&observation, &wanted);
                let fault = Fault { code: FaultCode::NotFinite, joint: joint as u8 };
                assert_eq!(decision.command, DriveCommand::OFF, "field {field}");
                assert_eq!((decision.fault, decision.state), (Some(fault), DriveState::Fault { fault }));
                // The drive stays off when the value is finite again.
                let decision = monitor.decide(&STANDING, &request(5.0));
                assert_eq!(decision.command, DriveCommand::OFF);
            }
        }
    }
}

#[test]
fn torque_and_current_never_exceed_their_caps() {
    let mut monitor = enabled();
    let mut random = TestRandom::new(1);
    for _ in 0..20_000 {
        let mut within = |bound: f64| random.within(bound) as f32;
        let observation = Observation {
            position: [Radian(0.45 + within(0.4)), Radian(-0.9 + within(0.7))],
            velocity: [RadianPerSecond(within(3.0)), RadianPerSecond(within(3.0))],
            ..STANDING
        };
        let wanted = [NewtonMetre(within(1e4)), NewtonMetre(within(300.0))];
        let decision = monitor.decide(&observation, &Request { torque: wanted, power: None });
        assert!(decision.command.enabled);
        for joint in 0..2 {
            assert!(decision.torque[joint].abs().0 <= 100.0);
            assert!(decision.command.currents[joint].abs().0 <= 80.0);
            assert_eq!(decision.limited[joint].torque, wanted[joint].abs().0 > 100.0);
        }
    }
}

#[test]
fn currents_have_the_drives_sign() {
    let mut monitor = enabled();
    let decision = monitor.decide(&STANDING, &request(15.0));
    // 1.5 N m/A; the knee has the opposite sign of its drive. Tolerance: one rounding of the reciprocal.
    assert!((decision.command.currents[0].0 - 10.0).abs() < 1e-5);
    assert!((decision.command.currents[1].0 + 10.0).abs() < 1e-5);
}

#[test]
fn overspeed_damps_in_the_same_tick_for_300_ms_then_turns_off() {
    let mut monitor = enabled();
    let fast = Observation { velocity: [RadianPerSecond::ZERO, RadianPerSecond(3.5)], ..STANDING };
    let decision = monitor.decide(&fast, &request(30.0));
    let fault = Fault { code: FaultCode::Overspeed, joint: 1 };
    assert_eq!(decision.fault, Some(fault));
    assert!(decision.command.enabled && decision.torque[1] == NewtonMetre(-100.0));
    assert_eq!(decision.torque[0], NewtonMetre::ZERO);
    let mut damped = 1;
    while monitor.decide(&STANDING, &request(30.0)).command.enabled {
        damped += 1;
    }
    assert_eq!(damped, SERVO_RATE_HZ * 3 / 10);
    assert_eq!(monitor.state(), DriveState::Fault { fault });
}

#[test]
fn only_half_a_degree_beyond_the_range_is_a_fault() {
    for (position, faulty) in [
        (HIP.high + Radian(0.0085), false),
        (HIP.low - Radian(0.0085), false),
        (HIP.high + Radian(0.0089), true),
        (HIP.low - Radian(0.0089), true),
    ] {
        let mut monitor = enabled();
        let outside = Observation { position: [position, MIDDLE[1]], ..STANDING };
        let fault = monitor.decide(&outside, &request(0.0)).fault;
        assert_eq!(fault.map(|fault| fault.code), faulty.then_some(FaultCode::PositionLimit));
    }
}

#[test]
fn a_fault_is_latched_until_reset_and_enabling_starts_over() {
    let mut monitor = enabled();
    let broken = Observation { current: [Ampere(f32::NAN); 2], ..STANDING };
    let _ = monitor.decide(&broken, &request(0.0));
    for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
        assert!(!monitor.decide(&STANDING, &ask(power)).command.enabled);
    }
    // Reset has no effect while the cause lasts.
    let _ = monitor.decide(&broken, &ask(PowerRequest::ResetFault));
    assert!(monitor.state().fault().is_some());
    let _ = monitor.decide(&STANDING, &ask(PowerRequest::ResetFault));
    assert_eq!(monitor.state(), DriveState::SwitchOnDisabled);
    assert!(!monitor.decide(&STANDING, &ask(PowerRequest::EnableOperation)).command.enabled);
    assert!(enable(&mut monitor, &STANDING, &STANDING).command.enabled);
}

#[test]
fn three_rejected_readings_in_ten_milliseconds_are_a_fault() {
    let glitch = Observation { rejected: [true, false], ..STANDING };
    for (gap, faulty) in [(0, true), (18, true), (19, false), (100, false)] {
        let mut monitor = enabled();
        let mut fault = None;
        for _ in 0..3 {
            for _ in 0..gap {
                fault = fault.or(monitor.decide(&STANDING, &request(0.0)).fault);
            }
            fault = fault.or(monitor.decide(&glitch, &request(0.0)).fault);
        }
        // Three readings with 18 good ones between them span 39 of the 40 ticks.
        assert_eq!(fault.map(|fault| fault.code), faulty.then_some(FaultCode::EncoderStep), "gap {gap}");
    }
}

/// The hip stands in the middle of its range; the knee is here and moves, rad/s.
fn knee(position: Radian, speed: f32) -> Observation<2> {
    let velocity = [RadianPerSecond::ZERO, RadianPerSecond(speed)];
    Observation { position: [MIDDLE[0], position], velocity, ..STANDING }
}

#[test]
fn a_refused_enabling_names_joint_and_reason() {
    let cases = [
        (knee(Radian(0.1), 0.0), RefusalReason::OutOfRange),
        (knee(MIDDLE[1], 3.2), RefusalReason::Moving),
        // One that falls towards the end of its range: 0.5 rad/s 10 mrad before it.
        (knee(KNEE.low + Radian(0.01), -0.5), RefusalReason::Moving),
        (Observation { rejected: [false, true], ..STANDING }, RefusalReason::Encoder),
    ];
    for (observation, reason) in cases {
        let mut monitor = off();
        monitor.permit_return([true, false]);
        let decision = enable(&mut monitor, &STANDING, &observation);
        assert_eq!(decision.refused, Some(Refusal { joint: 1, reason }));
        assert_eq!((decision.state, decision.command.enabled), (DriveState::SwitchedOn, false));
    }
}

#[test]
fn a_joint_whose_angle_is_not_proven_is_enabled_at_rest_only() {
    for (first_motion, speed, is_enabled) in
        [(1.0, -1.0, true), (0.25, -1.0, false), (0.9, -0.11, false), (0.25, -0.09, true)]
    {
        let mut monitor = off();
        let joints = [JointShares { first_motion, ..JointShares::ALL }; 2];
        monitor.derate(&RAMPS.at(25.0, Volt(48.0), joints));
        let decision = enable(&mut monitor, &STANDING, &knee(KNEE.low + Radian(0.1), speed));
        let refused = (!is_enabled).then_some(Refusal { joint: 1, reason: RefusalReason::Moving });
        assert_eq!(decision.refused, refused, "{first_motion} of the current, {speed} rad/s");
    }
}

/// Places the hip beyond its upper end and the knee beyond its lower end, rad, and requests enabling there.
fn outside(hip: f32, knee: f32) -> (Monitor<2>, Observation<2>) {
    let mut monitor = off();
    let position = [HIP.high + Radian(hip), KNEE.low - Radian(knee)];
    let observation = Observation { position, ..STANDING };
    let _ = enable(&mut monitor, &observation, &observation);
    (monitor, observation)
}

#[test]
fn a_joint_outside_its_range_only_returns_slowly() {
    let (mut monitor, observation) = outside(0.1, 0.2);
    assert_eq!((monitor.state(), monitor.returns()), (DriveState::OperationEnabled, [true; 2]));
    // Outwards is hip up, knee down: no torque. Inwards: a quarter of 100 N m.
    let decide = |monitor: &mut Monitor<2>, torque: [f32; 2], speed: f32| {
        let velocity = [RadianPerSecond(-speed), RadianPerSecond(speed)];
        let request = Request { torque: torque.map(NewtonMetre), power: None };
        let decision = monitor.decide(&Observation { velocity, ..observation }, &request);
        assert_eq!((decision.fault, decision.command.enabled), (None, true));
        (decision.torque.map(|torque| torque.0), decision.limited)
    };
    let (torque, limited) = decide(&mut monitor, [50.0, -50.0], 0.0);
    assert_eq!((torque, limited.map(|limited| limited.range)), ([0.0; 2], [true; 2]));
    let (torque, limited) = decide(&mut monitor, [-50.0, 50.0], 0.0);
    assert_eq!((torque, limited.map(|limited| limited.torque)), ([-25.0, 25.0], [true; 2]));
    // Above twice 0.1 rad/s the joint is braked, also with a quarter.
    assert_eq!(decide(&mut monitor, [-50.0, 50.0], 0.4).0, [25.0, -25.0]);
    // Inside the range the usual bounds apply.
    let decision = monitor.decide(&STANDING, &request(90.0));
    assert_eq!((decision.fault, monitor.returns()), (None, [false; 2]));
    assert_eq!(monitor.decide(&STANDING, &request(90.0)).torque, [NewtonMetre(90.0); 2]);
    let fault = monitor.decide(&observation, &request(0.0)).fault;
    assert_eq!(fault.map(|fault| fault.code), Some(FaultCode::PositionLimit), "left its range again");
}

#[test]
fn a_returning_joint_that_moves_outwards_stops_the_leg() {
    for (first, then, faulty) in
        [(0.1, 0.1085, false), (0.1, 0.1089, true), (0.05, 0.0585, false), (0.05, 0.0589, true)]
    {
        // The joint comes nearer before it moves out again.
        let (mut monitor, observation) = outside(0.1, 0.0);
        let [_, knee] = observation.position;
        let at = |beyond: f32| Observation { position: [HIP.high + Radian(beyond), knee], ..STANDING };
        assert_eq!(monitor.decide(&at(first), &request(0.0)).fault, None);
        let fault = monitor.decide(&at(then), &request(0.0)).fault;
        let expected = faulty.then_some(FaultCode::PositionLimit);
        assert_eq!(fault.map(|fault| fault.code), expected, "{first} {then}");
        // A requested stop is no fault, although the leg falls during it.
        let (mut monitor, _) = outside(0.1, 0.0);
        let _ = monitor.decide(&at(first), &ask(PowerRequest::QuickStop));
        assert_eq!(monitor.decide(&at(then + 0.1), &request(0.0)).fault, None);
    }
    let (mut monitor, observation) = outside(0.1, 0.2);
    monitor.restart();
    monitor.permit_return([false; 2]);
    assert_ne!(enable(&mut monitor, &observation, &observation).state, DriveState::OperationEnabled);
}

#[test]
fn a_joint_beyond_its_end_stops_is_not_enabled() {
    for (hip, knee, refused) in
        [(0.25, 0.25, None), (0.27, 0.0, Some(0)), (0.0, 0.27, Some(1)), (1.5, 1.5, Some(0))]
    {
        let (mut monitor, observation) = outside(hip, knee);
        let asked = monitor.decide(&observation, &ask(PowerRequest::EnableOperation));
        let expected = refused.map(|joint| Refusal { joint, reason: RefusalReason::OutOfRange });
        assert_eq!(asked.refused, expected);
        assert_eq!(monitor.state() == DriveState::OperationEnabled, refused.is_none());
    }
}

#[test]
fn a_falling_joint_outside_its_range_is_not_enabled() {
    let (mut monitor, observation) = outside(0.1, 0.2);
    let _ = monitor.decide(&observation, &ask(PowerRequest::DisableOperation));
    let falling = Observation { velocity: [RadianPerSecond(0.12), RadianPerSecond::ZERO], ..observation };
    let refused = monitor.decide(&falling, &ask(PowerRequest::EnableOperation)).refused;
    assert_eq!(refused, Some(Refusal { joint: 0, reason: RefusalReason::Moving }));
    assert_eq!(monitor.decide(&observation, &ask(PowerRequest::EnableOperation)).refused, None);
}

#[test]
fn a_quick_stop_damps_and_does_not_end_enabled() {
    let mut monitor = enabled();
    let turning = Observation { velocity: [RadianPerSecond(0.01); 2], ..STANDING };
    let decision =
        monitor.decide(&turning, &Request { power: Some(PowerRequest::QuickStop), ..request(50.0) });
    assert!(decision.command.enabled && decision.torque[0].0 < 0.0);
    for _ in 0..SERVO_RATE_HZ {
        let _ = monitor.decide(&STANDING, &request(50.0));
    }
    assert_eq!(monitor.state(), DriveState::SwitchOnDisabled);
}

#[test]
fn off_takes_precedence_over_damp_in_the_same_tick() {
    let fault = |code| Fault { code, joint: 0 };
    let (off, damp) = (fault(FaultCode::Parameters), fault(FaultCode::SupplyLost));
    for [first, second] in [[off, damp], [damp, off]] {
        let mut monitor = enabled();
        monitor.report(first);
        monitor.report(second);
        let decision = monitor.decide(&STANDING, &request(0.0));
        assert_eq!((decision.fault, decision.command.enabled), (Some(off), false));
    }
}
