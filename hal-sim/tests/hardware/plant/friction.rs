//! Friction: joints stick, break away, slide and drag each other.

use crate::plant::common::{joint, leg, planar_leg, spatial_chain, worn_leg};
use hal_sim::description::{FrictionDescription, LegDescription, Stribeck};
use hal_sim::leg::{Leg, LegState};
use hal_sim::world::{TICK_S, World};
use scarab::hal::DriveCommand;
use scarab::units::Ampere;

fn dry(coulomb: f64) -> FrictionDescription {
    FrictionDescription { coulomb, ..FrictionDescription::default() }
}

/// Flywheel of 1 kg m^2 on a vertical axis: inertia and friction only.
fn flywheel(friction: FrictionDescription) -> LegDescription<1> {
    let mut wheel = joint([0.0; 3], 2.0, [0.0; 3], [0.5, 0.0, 0.0, 0.5, 0.0, 1.0]);
    wheel.friction = friction;
    leg([0.0, 0.0, 9.81], [wheel])
}

#[test]
fn a_leg_held_by_friction_does_not_move_by_one_bit() {
    let mut held = planar_leg();
    held.joints[0].friction = dry(12.0);
    held.joints[1].friction = dry(5.0);
    let mut world = World::new(&held, 3);
    world.move_to(&[0.2, 0.1]);
    let before = world.truth();
    // Gravity pulls with 9.7 and 1.9 N m here, below both levels.
    for _ in 0..20_000 {
        world.advance();
    }
    let after = world.truth();
    assert_eq!((after.position, after.velocity), (before.position, [0.0; 2]));
    assert_eq!((after.acceleration, after.sticking), ([0.0; 2], [true; 2]));
}

#[test]
fn a_resting_joint_breaks_away_at_its_level_and_not_before() {
    let wheel = Leg::new(&flywheel(dry(3.0)));
    for (torque, moves) in [(2.999_999, false), (-2.999_999, false), (3.000_001, true), (-3.000_001, true)] {
        let mut state = LegState { angles: [0.4], rates: [0.0] };
        for _ in 0..4000 {
            wheel.advance(&mut state, &[torque], &[torque], TICK_S);
        }
        assert_eq!(state.rates[0] != 0.0, moves, "{torque} N m");
        assert_eq!(state.angles[0] != 0.4, moves, "{torque} N m");
        assert_eq!(wheel.forward_dynamics(&state, &[torque])[0] != 0.0, moves, "{torque} N m");
    }
}

#[test]
fn a_sliding_joint_stops_after_the_analytic_time_and_distance() {
    let wheel = Leg::new(&flywheel(dry(3.0)));
    let mut state = LegState { angles: [0.0], rates: [1.5003] };
    let mut ticks = 0;
    while state.rates[0] != 0.0 && ticks < 10_000 {
        wheel.advance(&mut state, &[0.0], &[0.0], TICK_S);
        ticks += 1;
    }
    // At 3 rad/s^2 the wheel stops after 0.5001 s, within tick 2001, at v^2 / 6. The end is found
    // to within a fine step of 31 us. Within it the wheel creeps 3 rad/s^2 * (31 us)^2 / 2 = 1.5e-9
    // rad; a whole tick would leave 9e-8.
    assert_eq!(ticks, 2001);
    assert!((state.angles[0] - 1.5003 * 1.5003 / 6.0).abs() < 2e-9, "{}", state.angles[0]);
}

#[test]
fn friction_that_falls_with_speed_is_integrated_to_second_order() {
    let stribeck = Some(Stribeck { static_level: 9.0, speed: 1.0 });
    let wheel =
        Leg::new(&flywheel(FrictionDescription { coulomb: 3.0, viscous: 0.5, offset: 0.0, stribeck }));
    let rate_after = |steps: u32| {
        let mut state = LegState { angles: [0.0], rates: [0.8] };
        for _ in 0..steps {
            wheel.advance(&mut state, &[8.0], &[8.0], 0.4 / f64::from(steps));
        }
        state.rates[0]
    };
    let [coarse, medium, fine] = [100, 200, 400].map(rate_after);
    let ratio = (coarse - medium) / (medium - fine);
    assert!((3.9..4.1).contains(&ratio), "half the step must leave a quarter of the error, not 1/{ratio}");
}

#[test]
fn speed_settles_where_viscous_friction_and_offset_balance_the_torque() {
    let friction = FrictionDescription { coulomb: 1.0, viscous: 4.0, offset: 0.5, stribeck: None };
    let wheel = Leg::new(&flywheel(friction));
    let mut state = LegState { angles: [0.0], rates: [0.0] };
    for _ in 0..40_000 {
        wheel.advance(&mut state, &[3.5], &[3.5], TICK_S);
    }
    // 3.5 = 1 + 4 v + 0.5; ten seconds are 40 time constants.
    assert!((state.rates[0] - 0.5).abs() < 1e-12, "{}", state.rates[0]);
    assert_eq!(wheel.inverse_dynamics(&[0.0], &[0.5], &[0.0]), [3.5]);
}

#[test]
fn stribeck_holds_to_its_static_level_and_falls_to_coulomb_with_speed() {
    let stribeck = Some(Stribeck { static_level: 5.0, speed: 0.1 });
    let friction = FrictionDescription { coulomb: 3.0, viscous: 0.0, offset: 0.0, stribeck };
    let wheel = Leg::new(&flywheel(friction));
    let mut resting = LegState { angles: [0.0], rates: [0.0] };
    wheel.advance(&mut resting, &[4.99], &[4.99], TICK_S);
    assert_eq!(resting.rates, [0.0]);
    let mut sliding = LegState { angles: [0.0], rates: [0.0] };
    // The wheel creeps first: 0.01 N m of surplus, 2 N m once the speed has passed 0.1 rad/s.
    for _ in 0..8000 {
        wheel.advance(&mut sliding, &[5.01], &[5.01], TICK_S);
    }
    assert!(sliding.rates[0] > 1.0, "the wheel does not speed up after breaking away: {}", sliding.rates[0]);
    // 4 N m cannot start the wheel but keep it turning.
    let mut kept = LegState { angles: [0.0], rates: [0.5] };
    for _ in 0..400 {
        wheel.advance(&mut kept, &[4.0], &[4.0], TICK_S);
    }
    assert!((kept.rates[0] - 0.6).abs() < 1e-9, "{}", kept.rates[0]);
    let level = |rate: f64| friction.torque(rate);
    assert_eq!(level(1.0), 3.0);
    // One speed: 3 + 2/e.
    assert!((level(-0.1) + 3.735_758_882_342_885).abs() < 1e-12);
}

#[test]
fn coupled_joints_stick_and_slide_consistently_with_inverse_dynamics() {
    // The chain is shaken hard enough that each joint starts, stops and turns many times.
    let mut chain = spatial_chain();
    for (joint, coulomb) in chain.joints.iter_mut().zip([12.0, 14.0, 5.0]) {
        joint.friction = FrictionDescription { coulomb, viscous: 0.5, offset: 0.2, stribeck: None };
    }
    let leg = Leg::new(&chain);
    let mut state = LegState { angles: [0.3, -0.4, 0.5], rates: [0.0; 3] };
    let mut resting = [0_u32; 3];
    for tick in 0..40_000 {
        let shake = 0.006 * f64::from(tick % 8000 - 4000);
        let torque = [shake, 1.5 * shake, -0.5 * shake];
        let acceleration = leg.forward_dynamics(&state, &torque);
        let demanded = leg.inverse_dynamics(&state.angles, &state.rates, &acceleration);
        for joint in 0..3 {
            let difference = torque[joint] - demanded[joint];
            let level = chain.joints[joint].friction.coulomb;
            if state.rates[joint] != 0.0 {
                assert!(difference.abs() < 1e-9, "torque error of a sliding joint: {difference}");
            } else if acceleration[joint] == 0.0 {
                resting[joint] += 1;
                assert!(
                    difference.abs() <= level + 1e-9,
                    "a stuck joint holds more than its level: {difference}"
                );
            } else {
                assert!((difference - level * acceleration[joint].signum()).abs() < 1e-9, "{difference}");
            }
        }
        leg.advance(&mut state, &torque, &torque, TICK_S);
    }
    assert!(resting.iter().all(|&ticks| ticks > 200), "a joint was hardly ever stuck: {resting:?}");
}

#[test]
fn no_friction_makes_a_step_unstable() {
    let mut stiff = planar_leg();
    for joint in &mut stiff.joints {
        joint.friction = FrictionDescription { coulomb: 1e5, viscous: 1e7, offset: 0.0, stribeck: None };
    }
    let leg = Leg::new(&stiff);
    let mut state = LegState { angles: [0.5, 0.5], rates: [3.0, -8.0] };
    for _ in 0..100 {
        leg.advance(&mut state, &[0.0; 2], &[0.0; 2], TICK_S);
    }
    assert_eq!(state.rates, [0.0; 2]);
}

#[test]
fn a_leg_with_bridges_off_swings_out_and_hangs() {
    let mut world = World::new(&worn_leg(), 5);
    world.move_to(&[0.9, 0.3]);
    let pushing = DriveCommand { enabled: true, currents: [Ampere(40.0), Ampere(5.0)] };
    for _ in 0..400 {
        world.tick(&pushing);
    }
    assert!(world.truth().motor_torque[0] > 39.0);
    world.tick(&DriveCommand::OFF);
    assert_eq!(world.truth().motor_torque, [0.0; 2]);
    for _ in 0..80_000 {
        world.tick(&DriveCommand::OFF);
    }
    let truth = world.truth();
    assert_eq!(truth.sticking, [true; 2]);
    assert!(truth.position[0].abs() < 0.3, "{truth:?}");
}
