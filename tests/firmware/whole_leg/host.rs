//! A leg under tick-by-tick host control, in every supported mode of CiA 402.

use scarab::leg::{
    Fault, FaultCode, ImpedanceTarget, JointCommand, JointStatus, Reference, SetPoint, Target,
};
use scarab::safety::PowerRequest;
use scarab::units::{NewtonMetre, Radian, RadianPerSecond, RadianPerSecondSquared, Second};

use super::*;

const HOLD: JointCommand = JointCommand {
    target: Target::Hold,
    request_count: 0,
    feedforward: false,
    halt: false,
    velocity: RadianPerSecond(0.5),
    acceleration: RadianPerSecondSquared(2.0),
    deceleration: RadianPerSecondSquared(2.0),
    torque_slope_nm_per_s: 40.0,
    range: [Radian(-10.0), Radian(10.0)],
    largest_torque: NewtonMetre(1000.0),
    following_window: Radian(0.087_266),
    following_time: Second(0.01),
    position_window: Radian(0.017),
    position_time: Second(0.01),
    velocity_window: RadianPerSecond(0.05),
    velocity_time: Second(0.01),
    standing_speed: RadianPerSecond(0.01),
    standing_time: Second(0.01),
    period: Second(0.002),
};

#[derive(Clone)]
struct Hosted {
    pair: Pair,
    commands: [JointCommand; JOINTS],
    status: [JointStatus; JOINTS],
}

impl Hosted {
    fn new() -> Self {
        let pair = Pair::new(&default_leg(), context(), 1).expect("the firmware accepts the default leg");
        let mut hosted = Self { pair, commands: [HOLD; JOINTS], status: [JointStatus::NONE; JOINTS] };
        hosted.pair.leg.command(&[HOLD; JOINTS]);
        assert!(hosted.pair.enable(context().gravity));
        hosted.run(10);
        assert_eq!(activity(&hosted.pair), Activity::Follow);
        hosted
    }

    /// A leg that is enabled in its rest position, rad.
    fn enabled_at(position: [f64; JOINTS]) -> Self {
        let mut hosted = Self::resting_at(position);
        hosted.pair.leg.command(&[HOLD; JOINTS]);
        assert!(hosted.pair.enable(context().gravity));
        hosted.run(10);
        hosted
    }

    fn resting_at(position: [f64; JOINTS]) -> Self {
        let mut pair = Pair::new(&default_leg(), context(), 1).expect("the firmware accepts the default leg");
        pair.world.move_to(&position);
        pair.sample = scarab::hal::LegDrives::sample(&mut pair.world);
        Self { pair, commands: [HOLD; JOINTS], status: [JointStatus::NONE; JOINTS] }
    }

    fn tick(&mut self, request: Option<ControlRequest>) -> scarab::leg::ControlOutput<JOINTS> {
        self.pair.leg.command(&self.commands);
        let output = tick(&mut self.pair, request);
        self.status =
            core::array::from_fn(|joint| self.pair.leg.joint_status(joint, &output).expect("a joint"));
        output
    }

    fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.tick(None);
        }
    }

    fn point(&mut self, joint: usize, position: f32, immediately: bool) {
        let point = SetPoint { position: Radian(position), relative_to: None, immediately };
        self.request(joint, Target::ProfilePosition(point));
    }

    /// Requests a target by bit 4, once the joint is in its mode.
    fn request(&mut self, joint: usize, target: Target) {
        if self.commands[joint].target.mode() != target.mode() {
            self.commands[joint].target = target;
            self.run(1);
        }
        let command = &mut self.commands[joint];
        (command.target, command.request_count) = (target, command.request_count.wrapping_add(1));
    }

    fn cyclic(&mut self, joint: usize, position: f32) {
        self.commands[joint].target = Target::CyclicPosition {
            position: Radian(position),
            velocity_offset: RadianPerSecond::ZERO,
            torque_offset: NewtonMetre::ZERO,
        };
    }

    /// Flexion of the plant's joint, rad.
    fn truth(&self, joint: usize) -> f64 {
        self.pair.world.anatomical_position()[joint]
    }

    fn position(&self, joint: usize) -> f32 {
        self.status[joint].position.0
    }
}

#[test]
fn a_profile_position_is_reached_on_time_in_both_directions() {
    for joint in 0..JOINTS {
        let mut hosted = Hosted::new();
        let from = hosted.position(joint);
        hosted.point(joint, from + 0.4, true);
        hosted.run(1);
        let mut ticks = 1;
        while !hosted.status[joint].reached {
            hosted.run(1);
            ticks += 1;
            assert!(hosted.status[joint].velocity_demand.0 <= 0.500_1);
            assert!(ticks < 2 * SECOND, "not reached");
        }
        // 0.4 rad at 0.5 rad/s, up and down with 2 rad/s^2: 1.05 s, 10 ms in the window.
        let time = ticks as f64 / SECOND as f64;
        assert!((1.04..1.15).contains(&time), "{time} s");
        hosted.run(SECOND);
        assert!((hosted.truth(joint) - f64::from(from + 0.4)).abs() < 0.004, "{}", hosted.truth(joint));
        assert!((hosted.position(joint) - from - 0.4).abs() < 0.004);
    }
}

#[test]
fn a_queued_set_point_waits_for_the_previous_one() {
    let mut hosted = Hosted::new();
    let from = hosted.position(0);
    hosted.point(0, from + 0.2, false);
    hosted.run(400);
    hosted.point(0, from, false);
    hosted.run(1500);
    assert!((hosted.status[0].position_demand.0 - from - 0.2).abs() < 0.05);
    hosted.run(2 * SECOND);
    assert!((hosted.position(0) - from).abs() < 0.01);
    // An interrupting set-point reverses at once.
    hosted.point(0, from + 0.2, true);
    hosted.run(400);
    hosted.point(0, from, true);
    let mut farthest = 0.0_f32;
    for _ in 0..SECOND {
        hosted.run(1);
        farthest = farthest.max(hosted.status[0].position_demand.0 - from);
    }
    assert!(farthest < 0.05, "{farthest}");
}

#[test]
fn velocity_and_halt_follow_their_ramps_and_a_range_ends_them() {
    let mut hosted = Hosted::new();
    hosted.commands[1].target = Target::ProfileVelocity(RadianPerSecond(0.3));
    hosted.run(SECOND / 2);
    assert!(hosted.status[1].reached && (hosted.status[1].velocity.0 - 0.3).abs() < 0.05);
    hosted.commands[1].halt = true;
    hosted.run(SECOND);
    assert!(hosted.status[1].reached && hosted.status[1].velocity.0.abs() < 0.01);
    hosted.commands[1].halt = false;
    let end = hosted.position(1) + 0.1;
    hosted.commands[1].range = [Radian(-10.0), Radian(end)];
    hosted.run(2 * SECOND);
    assert!((hosted.position(1) - end).abs() < 0.01, "{} {end}", hosted.position(1));
    assert!(is_enabled(&hosted.pair));
}

#[test]
fn a_torque_follows_its_slope_and_is_held_to_the_largest_torque() {
    for cyclic in [false, true] {
        let mut hosted = Hosted::new();
        hosted.run(2 * SECOND);
        let from = hosted.status[0].torque_demand.0;
        let wanted = NewtonMetre(from + 4.0);
        hosted.commands[0].target =
            if cyclic { Target::CyclicTorque(wanted) } else { Target::ProfileTorque(wanted) };
        let mut ticks = 0;
        while (hosted.status[0].torque_demand.0 - wanted.0).abs() > 0.05 {
            hosted.run(1);
            ticks += 1;
            assert!(ticks < SECOND, "{:?}", hosted.status[0]);
        }
        // 4 N m at 40 N m/s.
        assert!(if cyclic { ticks <= 2 } else { (380..=420).contains(&ticks) }, "{ticks}");
        let largest = wanted.0.abs() - 2.0;
        hosted.commands[0].largest_torque = NewtonMetre(largest);
        // 2 N m take 200 ticks.
        hosted.run(220);
        assert!((hosted.status[0].torque_demand.0.abs() - largest).abs() < 1e-3, "{:?}", hosted.status[0]);
        assert!(hosted.status[0].limited);
    }
}

#[test]
fn the_torque_limit_holds_in_every_mode_without_windup() {
    let mut hosted = Hosted::new();
    hosted.run(2 * SECOND);
    let weight = hosted.status[0].torque_demand.0.abs();
    hosted.commands[0].following_window = Radian(10.0);
    hosted.commands[0].largest_torque = NewtonMetre(weight + 1.0);
    let from = hosted.position(0);
    hosted.commands[0].acceleration = RadianPerSecondSquared(30.0);
    hosted.point(0, from + 0.1, true);
    let mut limited = false;
    for _ in 0..SECOND {
        hosted.run(1);
        limited |= hosted.status[0].limited;
        assert!(hosted.status[0].torque_demand.0.abs() <= weight + 1.001, "{:?}", hosted.status[0]);
    }
    assert!(limited);
    // When the torque is permitted again, the joint arrives without overshoot.
    hosted.commands[0].largest_torque = NewtonMetre(1000.0);
    let mut farthest = 0.0_f32;
    for _ in 0..2 * SECOND {
        hosted.run(1);
        farthest = farthest.max(hosted.position(0) - from);
    }
    assert!(farthest < 0.13 && (hosted.position(0) - from - 0.1).abs() < 0.005, "{farthest}");
}

#[test]
fn a_joint_held_again_keeps_its_torque() {
    let mut hosted = Hosted::new();
    hosted.run(2 * SECOND);
    // The host commands the torque that holds the joint against gravity.
    let weight = hosted.status[0].torque_demand;
    hosted.commands[0].target = Target::CyclicTorque(weight);
    hosted.run(200);
    hosted.commands[0].target = Target::Hold;
    let before = hosted.status[0].torque_demand.0;
    hosted.run(1);
    let step = (hosted.status[0].torque_demand.0 - before).abs();
    assert!(step < 1.0, "{step} N m of {before}");
    hosted.run(SECOND);
    assert!(is_enabled(&hosted.pair) && hosted.status[0].velocity.0.abs() < 0.01);
}

#[test]
fn cyclic_positions_of_two_milliseconds_are_followed_by_both_joints() {
    let mut hosted = Hosted::new();
    let from: [f32; JOINTS] = core::array::from_fn(|joint| hosted.position(joint));
    let (mut squared, mut steps) = (0.0_f64, 0.0_f32);
    let mut before = [0.0_f32; JOINTS];
    for tick in 0..4 * SECOND {
        if tick.is_multiple_of(8) {
            let phase = tick as f32 / SECOND as f32 * core::f32::consts::TAU * 0.5;
            for joint in 0..JOINTS {
                hosted.cyclic(joint, from[joint] + 0.1 * (1.0 - scarab::real::sin_cos(phase).1));
            }
        }
        hosted.run(1);
        for joint in 0..JOINTS {
            let error = hosted.status[joint].position_demand - hosted.status[joint].position;
            squared += f64::from(error.0) * f64::from(error.0);
            if tick > 0 {
                steps = steps.max((hosted.status[joint].velocity_demand.0 - before[joint]).abs());
            }
            before[joint] = hosted.status[joint].velocity_demand.0;
        }
    }
    let rms = scarab::real::sqrt(squared / (8 * SECOND) as f64);
    println!("root mean square error {rms:.5} rad, largest step of velocity {steps:.4} rad/s");
    // Feedback alone; the commanded velocity changes by at most 0.99 rad/s^2 * 2 ms from period to period.
    assert!(rms < 0.01 && steps < 0.003, "{rms} {steps}");
}

#[test]
fn a_target_beyond_the_window_is_not_begun_and_a_fault_later() {
    let mut hosted = Hosted::new();
    let from = hosted.position(0);
    hosted.cyclic(0, from + 0.2);
    hosted.run(SECOND);
    assert!((hosted.position(0) - from).abs() < 0.01 && is_enabled(&hosted.pair));
    assert!(hosted.status[0].deviates && !hosted.status[0].follows && !hosted.status[0].reached);
    hosted.cyclic(0, from);
    hosted.run(100);
    assert!(!hosted.status[0].deviates && hosted.status[0].follows);
    hosted.cyclic(0, from + 0.2);
    let mut ticks = 0;
    while is_enabled(&hosted.pair) {
        hosted.run(1);
        ticks += 1;
        assert!(ticks < 100, "no fault");
    }
    let fault = hosted.pair.leg.control().state().fault();
    assert_eq!(fault, Some(Fault { code: FaultCode::FollowingError, joint: 0 }));
    assert!((38..=44).contains(&ticks), "{ticks}");
    hosted.run(SECOND / 10);
    // 10 ms at the speed limit are 0.045 rad, from rest far less.
    assert!((hosted.position(0) - from).abs() < 0.03, "{}", hosted.position(0) - from);
    // A target within the window is approached along the profile.
    let mut hosted = Hosted::new();
    let from = hosted.position(0);
    hosted.cyclic(0, from + 0.06);
    for _ in 0..2 * SECOND {
        hosted.run(1);
        assert!(hosted.status[0].velocity_demand.0 < 0.501);
    }
    assert!((hosted.position(0) - from - 0.06).abs() < 0.004 && is_enabled(&hosted.pair));
}

#[test]
fn homing_sets_the_position_to_the_offset_without_motion() {
    let mut hosted = Hosted::new();
    let (position, truth) = (hosted.position(1), hosted.truth(1));
    hosted.commands[1].target = Target::Homing { offset: Radian(position + 0.05) };
    hosted.run(SECOND);
    assert!(!hosted.status[1].homed);
    hosted.commands[1].request_count += 1;
    hosted.run(SECOND);
    assert!(hosted.status[1].homed && !hosted.status[1].deviates);
    assert!((hosted.position(1) - position - 0.05).abs() < 0.002, "{}", hosted.position(1));
    assert!((hosted.truth(1) - truth).abs() < 0.003, "{} {truth}", hosted.truth(1));
    // An offset out of range is an error and has no effect.
    hosted.commands[1].target = Target::Homing { offset: Radian(9.0) };
    hosted.commands[1].request_count += 1;
    hosted.run(SECOND / 10);
    assert!(hosted.status[1].deviates && is_enabled(&hosted.pair));
    assert!((hosted.position(1) - position - 0.05).abs() < 0.002);
}

#[test]
fn homing_leaves_the_range_that_the_monitor_guards() {
    // Hosts see a knee 0.4 rad lower than it is, and command it up to what they see as inside the range.
    let mut hosted = Hosted::new();
    let position = hosted.position(1);
    hosted.commands[1].target = Target::Homing { offset: Radian(position - 0.4) };
    hosted.run(SECOND);
    hosted.commands[1].request_count += 1;
    hosted.run(100);
    assert!(hosted.status[1].homed && (hosted.position(1) - position + 0.4).abs() < 0.002);
    let high = RANGES[1][1];
    hosted.point(1, high as f32, true);
    hosted.run(8 * SECOND);
    assert!(is_enabled(&hosted.pair) && hosted.status[1].limited);
    assert!((hosted.truth(1) - high).abs() < 0.01, "{}", hosted.truth(1));
    assert!((f64::from(hosted.position(1)) + 0.4 - hosted.truth(1)).abs() < 0.003);
}

#[test]
fn an_enabled_leg_is_taken_over_without_a_step_in_every_mode() {
    let zero = (RadianPerSecond::ZERO, NewtonMetre::ZERO);
    for number in [1, 3, 6, 8, 9, -1] {
        let mut hosted = Hosted::resting_at([0.5, 0.9]);
        assert!(hosted.pair.enable(context().gravity));
        // Long at rest without a host; a wearer has moved the leg since the start.
        (0..SECOND).for_each(|_| {
            tick(&mut hosted.pair, None);
        });
        let before = tick(&mut hosted.pair, None).servo.decision.torque;
        let start: [f32; JOINTS] = core::array::from_fn(|joint| hosted.truth(joint) as f32);
        for joint in 0..JOINTS {
            let position = Radian(start[joint]);
            hosted.commands[joint].target = match number {
                1 => Target::ProfilePosition(SetPoint::default()),
                3 => Target::ProfileVelocity(zero.0),
                6 => Target::Homing { offset: position },
                8 => Target::CyclicPosition { position, velocity_offset: zero.0, torque_offset: zero.1 },
                9 => Target::CyclicVelocity { velocity: zero.0, torque_offset: zero.1 },
                _ => Target::Impedance(ImpedanceTarget {
                    position,
                    velocity: zero.0,
                    stiffness: 1e5,
                    damping: 1e5,
                    torque: zero.1,
                }),
            };
        }
        let mut last = before;
        for _ in 0..SECOND {
            let torque = hosted.tick(None).servo.decision.torque;
            for joint in 0..JOINTS {
                let moved = hosted.truth(joint) as f32 - start[joint];
                // The torque that holds the joint within its friction may drift, but does not step.
                let step = torque[joint].0 - last[joint].0;
                assert!(step.abs() < 4.0 && moved.abs() < 0.01, "{number} {joint}: {step} N m, {moved} rad");
            }
            last = torque;
        }
        assert!(is_enabled(&hosted.pair), "{number}");
    }
}

/// A leg that its host moves or loads runs on with other commands. Returns the largest step of the torque in
/// a tick, N m, and the farthest that the joint moves.
fn largest_step(mut hosted: Hosted, change: impl FnOnce(&mut JointCommand)) -> [f64; 2] {
    let mut last = hosted.tick(None).servo.decision.torque[1];
    let start = hosted.truth(1);
    let mut largest = [0.0_f64; 2];
    change(&mut hosted.commands[1]);
    for _ in 0..SECOND / 4 {
        let torque = hosted.tick(None).servo.decision.torque[1];
        largest[0] = largest[0].max((torque - last).0.abs().into());
        largest[1] = largest[1].max((hosted.truth(1) - start).abs());
        last = torque;
    }
    assert!(is_enabled(&hosted.pair), "{:?}", hosted.status[1]);
    largest
}

#[test]
fn the_torque_of_a_mode_or_a_halt_does_not_step() {
    let mut starting = Hosted::enabled_at([0.5, 0.9]);
    starting.commands[1].acceleration = RadianPerSecondSquared(100.0);
    starting.commands[1].target = Target::ProfileVelocity(RadianPerSecond(-0.1));
    starting.run(10);
    let mut restarted = starting.clone();
    for (halt, ticks) in [(true, 5), (false, 6)] {
        restarted.commands[1].halt = halt;
        restarted.run(ticks);
    }
    let mut loaded = Hosted::enabled_at([0.5, 0.9]);
    let (velocity_offset, torque_offset) = (RadianPerSecond::ZERO, NewtonMetre(-15.0));
    let position = Radian(loaded.position(1));
    let target = Target::CyclicPosition { position, velocity_offset, torque_offset };
    loaded.commands[1].target = target;
    loaded.run(SECOND);
    let mut halted = loaded.clone();
    halted.commands[1].halt = true;
    halted.run(SECOND);
    let mut withdrawn = halted.clone();
    withdrawn.commands[1].halt = false;
    withdrawn.run(4);
    let without = Target::CyclicPosition { position, velocity_offset, torque_offset: NewtonMetre::ZERO };
    let steps = [
        ("an offset withdrawn while it comes", largest_step(withdrawn, |command| command.target = without)),
        (
            "stop of a joint that starts",
            largest_step(starting.clone(), |command| command.target = Target::Hold),
        ),
        ("stop while a halt fades", largest_step(restarted, |command| command.target = Target::Hold)),
        ("halt of a joint that starts", largest_step(starting, |command| command.halt = true)),
        ("halt of a loaded joint", largest_step(loaded.clone(), |command| command.halt = true)),
        ("end of its mode", largest_step(loaded, |command| command.target = Target::Hold)),
        ("end of its halt", largest_step(halted, |command| command.halt = false)),
        (
            "a mode with an offset",
            largest_step(Hosted::enabled_at([0.5, 0.9]), |command| command.target = target),
        ),
    ];
    for (what, [step, moved]) in steps {
        assert!(step < 2.0 && moved < 0.01, "{what}: {step} N m, {moved} rad");
    }
}

#[test]
fn modes_that_alternate_drive_a_joint_no_faster_than_one_of_them() {
    let torque_offset = NewtonMetre::ZERO;
    for (joint, speed, ticks_of_a_mode) in [(0, -0.1, 4), (1, -0.15, 1), (1, -0.15, 4)] {
        let velocity = RadianPerSecond(speed);
        let modes = [Target::CyclicVelocity { velocity, torque_offset }, Target::ProfileVelocity(velocity)];
        let fastest = |modes: [Target; 2]| {
            let mut hosted = Hosted::enabled_at([0.5, 0.9]);
            hosted.commands[joint].acceleration = RadianPerSecondSquared(100.0);
            let mut fastest = 0.0_f32;
            for tick in 0..SECOND / 5 {
                hosted.commands[joint].target = modes[(tick / ticks_of_a_mode % 2) as usize];
                hosted.run(1);
                fastest = fastest.max(hosted.status[joint].velocity.0.abs());
            }
            fastest
        };
        let (one, alternating) = (fastest([modes[0]; 2]), fastest(modes));
        assert!(alternating < 1.2 * one, "joint {joint}: {alternating} instead of {one} rad/s");
    }
}

#[test]
fn a_load_that_an_offset_carries_is_carried_on_by_a_torque_mode() {
    for settles_for in [0, 4, 100] {
        let mut hosted = Hosted::enabled_at([0.5, 1.5]);
        hosted.commands[1].torque_slope_nm_per_s = 10.0;
        hosted.run(SECOND);
        let (position, weight) = (Radian(hosted.position(1)), hosted.status[1].torque_demand);
        let (velocity_offset, torque_offset) = (RadianPerSecond::ZERO, weight);
        hosted.commands[1].target = Target::CyclicPosition { position, velocity_offset, torque_offset };
        hosted.run(3 * SECOND);
        let from = hosted.truth(1);
        hosted.commands[1].target = Target::CyclicVelocity { velocity: velocity_offset, torque_offset };
        hosted.run(settles_for);
        hosted.commands[1].target = Target::ProfileTorque(weight);
        hosted.run(SECOND / 2);
        let moved = (hosted.truth(1) - from).abs();
        assert!(is_enabled(&hosted.pair) && moved < 0.01, "{settles_for}: {moved} rad of {weight:?}");
    }
}

#[test]
fn a_torque_mode_begins_without_the_torque_that_drives_the_joint() {
    for ticks_until_free in [2, 6] {
        let mut hosted = Hosted::enabled_at([0.5, 0.9]);
        hosted.commands[1].torque_slope_nm_per_s = 85.0;
        let position = hosted.position(1);
        hosted.cyclic(1, position);
        hosted.run(SECOND);
        hosted.cyclic(1, position + 0.02);
        hosted.run(2);
        hosted.commands[1].halt = true;
        hosted.run(ticks_until_free - 2);
        hosted.commands[1].halt = false;
        hosted.commands[1].target = Target::ProfileTorque(NewtonMetre::ZERO);
        let mut most = 0.0_f32;
        for _ in 0..SECOND / 10 {
            hosted.run(1);
            most = most.max(hosted.status[1].velocity.0);
        }
        assert!(
            is_enabled(&hosted.pair) && most < 0.5,
            "{ticks_until_free}: {most} rad/s {:?}",
            hosted.status[1]
        );
    }
}

#[test]
fn a_halt_ends_in_time_whatever_the_host_has_set() {
    for mode in [3, 4, 10] {
        let mut hosted = Hosted::new();
        hosted.run(SECOND);
        let weight = hosted.status[1].torque_demand;
        let more = weight + NewtonMetre(2.0);
        hosted.commands[1].target = match mode {
            3 => Target::ProfileVelocity(RadianPerSecond(0.3)),
            4 => Target::ProfileTorque(more),
            _ => Target::CyclicTorque(more),
        };
        hosted.run(SECOND / 4);
        let command = &mut hosted.commands[1];
        command.deceleration = RadianPerSecondSquared(1e-6);
        command.torque_slope_nm_per_s = 0.0;
        command.halt = true;
        if mode != 4 {
            command.largest_torque = NewtonMetre::ZERO;
            command.following_window = Radian(10.0);
        }
        hosted.run(2 * SECOND);
        let start = hosted.truth(1);
        hosted.run(SECOND);
        let JointStatus { velocity_demand, torque_demand, .. } = hosted.status[1];
        let moved = (hosted.truth(1) - start).abs();
        let has_stopped = velocity_demand.0 == 0.0 && moved < 1e-3;
        assert!(
            if mode == 4 { torque_demand.0 == 0.0 } else { has_stopped && torque_demand.0 != 0.0 },
            "{mode}: {moved} rad, {:?}",
            hosted.status[1]
        );
    }
}

/// Impedance mode without a spring.
fn damper(damping: f32) -> Target {
    Target::Impedance(ImpedanceTarget {
        position: Radian(1.5),
        velocity: RadianPerSecond::ZERO,
        stiffness: 0.0,
        damping,
        torque: NewtonMetre::ZERO,
    })
}

#[test]
fn a_damper_acts_from_the_first_tick() {
    let mut hosted = Hosted::enabled_at([0.5, 1.5]);
    hosted.commands[1].target = damper(100.0);
    hosted.commands[1].torque_slope_nm_per_s = 0.0;
    hosted.run(1);
    hosted.pair.world.push(1, -60.0, 0.3);
    let mut most = 0.0_f32;
    for _ in 0..SECOND / 4 {
        hosted.run(1);
        most = most.max(hosted.status[1].velocity.0.abs());
    }
    assert!((0.3..1.0).contains(&most), "{most} rad/s");
}

#[test]
fn a_leg_that_is_enabled_while_it_falls_is_not_driven_back_by_its_brake() {
    for target in [Target::ProfileTorque(NewtonMetre::ZERO), damper(0.0), damper(50.0)] {
        let mut hosted = Hosted::enabled_at([0.5, 1.5]);
        hosted.tick(Some(ControlRequest::Power(PowerRequest::DisableVoltage)));
        hosted.commands[1].target = target;
        while hosted.status[1].velocity.0 > -0.4 {
            hosted.run(1);
            assert!(hosted.truth(1) > 1.0);
        }
        for request in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            hosted.tick(Some(ControlRequest::Power(request)));
        }
        let mut most = f32::MIN;
        for _ in 0..SECOND / 4 {
            hosted.run(1);
            most = most.max(hosted.status[1].velocity.0);
        }
        assert!(is_enabled(&hosted.pair) && most < 0.02, "{most} rad/s {:?}", hosted.status[1]);
    }
}

#[test]
fn a_halt_ends_before_the_range_does() {
    let mut hosted = Hosted::enabled_at([0.5, 0.6]);
    hosted.commands[1].velocity = RadianPerSecond(2.0);
    hosted.commands[1].acceleration = RadianPerSecondSquared(10.0);
    hosted.commands[1].deceleration = RadianPerSecondSquared(10.0);
    hosted.commands[1].target = Target::ProfileVelocity(RadianPerSecond(1.6));
    while hosted.truth(1) < 1.3 {
        hosted.run(1);
    }
    hosted.commands[1].deceleration = RadianPerSecondSquared(0.1);
    hosted.commands[1].halt = true;
    hosted.run(2 * SECOND);
    let demand = hosted.status[1].position_demand.0;
    assert!(is_enabled(&hosted.pair) && beyond(1, demand.into()) < 1e-3, "{:?}", hosted.status[1]);
}

#[test]
fn a_halted_host_begins_no_identification() {
    let mut hosted = Hosted::new();
    hosted.run(SECOND);
    hosted.commands[0].halt = true;
    hosted.run(10);
    assert!(hosted.tick(Some(ControlRequest::Identify)).refused);
    hosted.commands[0].halt = false;
    hosted.run(10);
    assert!(!hosted.tick(Some(ControlRequest::Identify)).refused);
}

#[test]
fn a_halted_set_point_goes_on_afterwards() {
    let mut hosted = Hosted::new();
    let from = hosted.position(0);
    hosted.point(0, from + 0.3, false);
    hosted.run(SECOND / 2);
    hosted.commands[0].halt = true;
    hosted.run(SECOND);
    let stopped = hosted.position(0);
    assert!(hosted.status[0].reached && !hosted.status[0].follows && stopped < from + 0.25);
    // One that comes during the halt waits for its turn.
    hosted.point(0, from + 0.1, false);
    hosted.run(SECOND / 2);
    assert!((hosted.position(0) - stopped).abs() < 0.002 && hosted.status[0].is_full);
    hosted.commands[0].halt = false;
    let mut farthest = 0.0_f32;
    for _ in 0..3 * SECOND {
        hosted.run(1);
        farthest = farthest.max(hosted.position(0) - from);
    }
    assert!((farthest - 0.3).abs() < 0.01 && (hosted.position(0) - from - 0.1).abs() < 0.01, "{farthest}");
}

#[test]
fn relative_set_points_add_to_what_the_host_has_chosen() {
    // A second one half way: from the target before it, from the commanded place, from the measured place.
    for (reference, ends) in [(Reference::Target, 0.2), (Reference::Demand, 0.15), (Reference::Actual, 0.15)]
    {
        let mut hosted = Hosted::new();
        let from = hosted.position(1);
        let ask = |hosted: &mut Hosted| {
            let point = SetPoint { position: Radian(0.1), relative_to: Some(reference), immediately: true };
            hosted.request(1, Target::ProfilePosition(point));
        };
        ask(&mut hosted);
        while hosted.status[1].position_demand.0 < from + 0.05 {
            hosted.run(1);
        }
        ask(&mut hosted);
        hosted.run(3 * SECOND);
        let moved = hosted.position(1) - from;
        assert!((moved - ends).abs() < 0.01, "{reference:?}: {moved} rad");
    }
}

#[test]
fn requests_before_enabling_have_no_later_effect() {
    let mut hosted = Hosted::new();
    hosted.tick(Some(ControlRequest::Power(PowerRequest::DisableVoltage)));
    hosted.run(10);
    let from = hosted.position(0);
    hosted.point(0, from + 0.3, true);
    hosted.run(10);
    assert!(hosted.pair.enable(context().gravity));
    hosted.run(SECOND);
    assert!((hosted.status[0].position_demand.0 - from).abs() < 0.05);
    assert_eq!(hosted.status[0].mode, 1);
}

#[test]
fn a_lost_host_is_damped_and_latched_until_reset() {
    let mut hosted = Hosted::new();
    hosted.commands[0].target = Target::ProfileVelocity(RadianPerSecond(0.3));
    hosted.run(SECOND / 2);
    hosted.pair.leg.report(Fault { code: FaultCode::Heartbeat, joint: 0 });
    hosted.run(1);
    assert!(matches!(hosted.pair.leg.control().state(), DriveState::FaultReactionActive { .. }));
    hosted.run(SECOND / 2);
    assert!(matches!(hosted.pair.leg.control().state(), DriveState::Fault { .. }));
    assert!(!hosted.pair.enable(context().gravity));
    hosted.tick(Some(ControlRequest::Power(PowerRequest::ResetFault)));
    assert!(hosted.pair.enable(context().gravity));
}

#[test]
fn an_identification_starts_at_rest_and_returns_the_leg_to_the_host() {
    let mut hosted = Hosted::new();
    hosted.commands[0].target = Target::ProfileVelocity(RadianPerSecond(0.2));
    hosted.run(400);
    assert!(hosted.tick(Some(ControlRequest::Identify)).refused);
    hosted.commands[0].target = Target::Hold;
    hosted.run(SECOND);
    assert!(!hosted.tick(Some(ControlRequest::Identify)).refused);
    hosted.run(SECOND);
    assert!(matches!(activity(&hosted.pair), Activity::Identify(_)));
    assert_eq!(hosted.status[0].mode, 0);
    // One that is cancelled or halted in motion comes to rest along the profile.
    hosted.run(3 * SECOND);
    assert!(matches!(activity(&hosted.pair), Activity::Identify(_)));
    for halt in [false, true] {
        let mut hosted = hosted.clone();
        let before = hosted.status[1].velocity_demand.0;
        if halt {
            hosted.commands[0].halt = true;
        } else {
            hosted.pair.leg.cancel();
        }
        hosted.run(1);
        assert_eq!(activity(&hosted.pair), Activity::Follow);
        assert!((hosted.status[1].velocity_demand.0 - before).abs() < 0.01);
        hosted.run(2 * SECOND);
        assert!(is_enabled(&hosted.pair) && hosted.status[1].velocity_demand.0 == 0.0);
        assert_eq!(hosted.pair.leg.control().verdict(), None);
    }
}

/// Ranges of the default leg, rad.
const RANGES: [[f64; 2]; JOINTS] = [[0.037_873, 0.875_806], [0.119_555, 1.667_313]];

/// How far a joint is beyond its range, rad.
fn beyond(joint: usize, angle: f64) -> f64 {
    let [low, high] = RANGES[joint];
    (low - angle).max(angle - high).max(0.0)
}

/// Poses outside the range: joint, angles, and the sign of the return. Gravity hardly loads the hip at its
/// lower end, and pulls the bent knee inwards.
const OUTSIDE: [(usize, [f64; JOINTS], f32); 3] =
    [(0, [-0.04, 0.6], 1.0), (1, [0.3, 0.04], 1.0), (1, [0.3, 1.75], -1.0)];

/// Observes a returning joint for a time; returns its farthest excursion and largest speed outside.
fn watch(hosted: &mut Hosted, joint: usize, ticks: u64) -> [f64; 2] {
    let mut most = [0.0_f64; 2];
    for _ in 0..ticks {
        hosted.run(1);
        assert!(is_enabled(&hosted.pair), "{:?}", hosted.status);
        let out = beyond(joint, hosted.truth(joint));
        if out > 0.002 {
            most = [most[0].max(out), most[1].max(hosted.pair.world.velocity()[joint].abs())];
            // A quarter of 85 N m.
            assert!(hosted.status[joint].torque_demand.0.abs() < 21.26, "{:?}", hosted.status[joint]);
        }
    }
    most
}

#[test]
fn every_inward_command_returns_a_joint_into_its_range() {
    let targets: [fn(&mut Hosted, usize, f32); 4] = [
        |hosted, joint, _| hosted.point(joint, if joint == 0 { 0.4 } else { 0.8 }, true),
        |hosted, joint, sign| {
            hosted.commands[joint].target = Target::ProfileVelocity(RadianPerSecond(0.4 * sign))
        },
        // A host that commands the joint's present position.
        |hosted, joint, _| hosted.cyclic(joint, hosted.position(joint)),
        |hosted, joint, sign| {
            hosted.commands[joint].target = Target::CyclicTorque(NewtonMetre(16.0 * sign));
        },
    ];
    for (index, command) in targets.into_iter().enumerate() {
        for (joint, pose, sign) in OUTSIDE {
            let mut hosted = Hosted::enabled_at(pose);
            let from = beyond(joint, hosted.truth(joint));
            assert!(from > 0.07, "{from}");
            assert_eq!(hosted.status[joint].inputs, 1 << 20, "bit 20 of 60FD");
            command(&mut hosted, joint, sign);
            let mut ticks = 0;
            let mut most = [0.0_f64; 2];
            while hosted.status[joint].inputs != 0 {
                let now = watch(&mut hosted, joint, 1);
                most = [most[0].max(now[0]), most[1].max(now[1])];
                ticks += 1;
                assert!(ticks < 4 * SECOND, "{index} {joint}: {most:?} {}", hosted.truth(joint));
            }
            // The commanded speed is 0.1 rad/s, more while the knee's weight is taken over. A commanded
            // torque may reach the bound of 0.2 rad/s, plus the weight's share during braking.
            let fastest = if index == 3 { 0.3 } else { 0.16 };
            assert!(most[0] < from + 0.002 && most[1] < fastest, "{index} {joint}: {from} {most:?}");
            if index < 3 {
                let rest = watch(&mut hosted, joint, SECOND);
                assert!(rest[0] < 0.009, "{index} {joint}: {rest:?}");
            }
        }
    }
}

#[test]
fn no_host_command_moves_a_joint_farther_out() {
    let targets: [fn(&mut Hosted, usize, f32); 5] = [
        |_, _, _| {},
        |hosted, joint, sign| hosted.point(joint, hosted.position(joint) - sign, true),
        |hosted, joint, sign| {
            hosted.commands[joint].target = Target::ProfileVelocity(RadianPerSecond(-0.4 * sign))
        },
        |hosted, joint, sign| {
            hosted.commands[joint].target = Target::ProfileTorque(NewtonMetre(-60.0 * sign));
        },
        |hosted, joint, sign| hosted.commands[joint].target = Target::CyclicTorque(NewtonMetre(-60.0 * sign)),
    ];
    for (index, command) in targets.into_iter().enumerate() {
        for (joint, pose, sign) in OUTSIDE {
            let mut hosted = Hosted::enabled_at(pose);
            let from = beyond(joint, hosted.truth(joint));
            command(&mut hosted, joint, sign);
            let [farthest, _] = watch(&mut hosted, joint, 2 * SECOND);
            assert!(farthest < from + 0.002, "{index} {joint}: {from} {farthest}");
        }
    }
}

#[test]
fn an_identification_outside_the_range_returns_slowly_too() {
    for (joint, pose, _) in OUTSIDE {
        let mut hosted = Hosted::resting_at(pose);
        assert!(hosted.pair.enable(context().gravity));
        let from = beyond(joint, hosted.truth(joint));
        // The switch alone causes no motion.
        (0..SECOND).for_each(|_| {
            tick(&mut hosted.pair, None);
        });
        assert!((beyond(joint, hosted.truth(joint)) - from).abs() < 0.06 && is_enabled(&hosted.pair));
        tick(&mut hosted.pair, Some(ControlRequest::Identify));
        let (mut ticks, mut fastest) = (0, 0.0_f64);
        while beyond(joint, hosted.truth(joint)) > 0.002 {
            tick(&mut hosted.pair, None);
            (ticks, fastest) = (ticks + 1, fastest.max(hosted.pair.world.velocity()[joint].abs()));
            assert!(ticks < 6 * SECOND && is_enabled(&hosted.pair), "{joint}: {}", hosted.truth(joint));
        }
        assert!(fastest < 0.15, "{joint}: {fastest}");
        assert!(matches!(activity(&hosted.pair), Activity::Identify(_)));
    }
}

#[test]
fn homing_without_a_method_is_an_error_and_keeps_the_zero() {
    let mut hosted = Hosted::new();
    hosted.run(2 * SECOND);
    let before = hosted.position(0);
    hosted.request(0, Target::Homing { offset: Radian(f32::INFINITY) });
    hosted.run(100);
    assert!(hosted.status[0].deviates && !hosted.status[0].homed);
    assert!((hosted.position(0) - before).abs() < 1e-3 && is_enabled(&hosted.pair));
}

/// Published host software searches a mechanical stop: it moves a joint outwards until 50 N m are measured.
#[test]
fn a_host_s_search_for_a_stop_ends_at_the_range() {
    for (joint, velocity) in [(0, -0.2), (1, -0.2), (1, 0.4)] {
        let mut hosted = Hosted::new();
        hosted.commands[joint].target = Target::ProfileVelocity(RadianPerSecond(velocity));
        let mut most = 0.0_f32;
        for _ in 0..6 * SECOND {
            hosted.run(1);
            most = most.max(hosted.status[joint].torque_demand.0.abs());
        }
        std::println!(
            "joint {joint} at {velocity} rad/s: {most:.1} N m at most, {:.4} rad",
            hosted.truth(joint)
        );
        assert!(is_enabled(&hosted.pair) && most < 50.0 && beyond(joint, hosted.truth(joint)) < 0.009);
    }
}

#[test]
fn limits_that_exclude_a_joint_when_it_is_enabled_pull_it_nowhere() {
    let joint = 1;
    for limits in [[0.2, 0.3], [-9.0, -8.0]] {
        for way in 0..3 {
            let mut hosted = Hosted::new();
            hosted.run(SECOND);
            let from = hosted.position(joint);
            let mut hosted = Hosted::resting_at(hosted.pair.world.anatomical_position());
            hosted.commands[joint].range = limits.map(|limit| Radian(from + limit));
            hosted.pair.leg.command(&hosted.commands);
            assert!(hosted.pair.enable(context().gravity));
            hosted.run(10);
            match way {
                0 => impedance(&mut hosted, joint, from, 200.0, 15.0),
                1 => hosted.cyclic(joint, from),
                _ => hosted.point(joint, from, true),
            }
            for _ in 0..SECOND {
                hosted.run(1);
                let moved = (hosted.position(joint) - from).abs();
                assert!(moved < 0.06 && is_enabled(&hosted.pair), "{limits:?} {way}: moved by {moved} rad");
            }
        }
    }
    // The joint moves into them at any speed, and is then held by the other one.
    for is_cyclic in [true, false] {
        let mut hosted = Hosted::new();
        hosted.run(SECOND);
        let from = hosted.position(joint);
        let mut hosted = Hosted::resting_at(hosted.pair.world.anatomical_position());
        hosted.commands[joint].range = [0.1, 0.5].map(|limit| Radian(from + limit));
        hosted.pair.leg.command(&hosted.commands);
        assert!(hosted.pair.enable(context().gravity));
        hosted.run(10);
        for tick in 0..2 * SECOND {
            let target = (0.8 * tick as f32 / SECOND as f32).min(0.6);
            match is_cyclic {
                true => hosted.cyclic(joint, from + target),
                false => impedance(&mut hosted, joint, from + target, 200.0, 15.0),
            }
            hosted.run(1);
            assert!(is_enabled(&hosted.pair) && hosted.position(joint) < from + 0.52, "{is_cyclic} {tick}");
        }
        assert!(hosted.position(joint) > from + 0.3, "{is_cyclic}: {}", hosted.position(joint) - from);
    }
}

#[test]
fn requests_of_one_mode_start_nothing_in_the_next() {
    let mut hosted = Hosted::new();
    hosted.run(SECOND);
    let from = hosted.position(1);
    for (before, after) in [
        (
            Target::Homing { offset: Radian(from) },
            Target::ProfilePosition(SetPoint { position: Radian(from + 0.3), ..SetPoint::default() }),
        ),
        (Target::ProfilePosition(SetPoint::default()), Target::Homing { offset: Radian(from + 0.3) }),
    ] {
        hosted.commands[1].target = before;
        hosted.run(10);
        // Both change in one frame.
        hosted.commands[1].request_count += 1;
        hosted.commands[1].target = after;
        hosted.run(SECOND / 2);
        let JointStatus { position, homed, .. } = hosted.status[1];
        assert!((position.0 - from).abs() < 0.01 && !homed, "{after:?}: {position:?}");
    }
}

#[test]
fn a_profile_velocity_is_not_limited_by_that_of_the_profile() {
    let mut hosted = Hosted::new();
    hosted.commands[1].velocity = RadianPerSecond(0.1);
    hosted.commands[1].target = Target::ProfileVelocity(RadianPerSecond(0.4));
    hosted.run(SECOND / 2);
    let JointStatus { velocity, reached, .. } = hosted.status[1];
    assert!(reached && (velocity.0 - 0.4).abs() < 0.05, "{velocity:?}");
}

/// Commands a spring and a damper around a position.
fn impedance(hosted: &mut Hosted, joint: usize, position: f32, stiffness: f32, damping: f32) {
    hosted.commands[joint].torque_slope_nm_per_s = 400.0;
    hosted.commands[joint].target = Target::Impedance(ImpedanceTarget {
        position: Radian(position),
        velocity: RadianPerSecond::ZERO,
        stiffness,
        damping,
        torque: NewtonMetre::ZERO,
    });
}

/// Torque demanded beyond that of the spring, N m, once the joint rests.
fn beyond_the_spring(hosted: &mut Hosted, joint: usize, target: ImpedanceTarget) -> f64 {
    hosted.commands[joint].target = Target::Impedance(target);
    hosted.run(2 * SECOND);
    let spring = f64::from(target.stiffness) * (f64::from(target.position.0) - hosted.truth(joint));
    f64::from(hosted.status[joint].torque_demand.0) - spring
}

#[test]
fn feedforward_torque_and_target_velocity_add_to_the_spring() {
    for (joint, velocity, torque) in [(0, 0.5, 0.0), (0, 0.0, 12.0), (1, -0.4, 5.0)] {
        let mut hosted = Hosted::new();
        hosted.run(SECOND);
        let (from, damping) = (hosted.position(joint), 16.0);
        impedance(&mut hosted, joint, from, 200.0, damping);
        let Target::Impedance(target) = hosted.commands[joint].target else { panic!("impedance") };
        let alone = beyond_the_spring(&mut hosted, joint, target);
        let with =
            ImpedanceTarget { velocity: RadianPerSecond(velocity), torque: NewtonMetre(torque), ..target };
        let added = beyond_the_spring(&mut hosted, joint, with) - alone;
        let expected = f64::from(damping * velocity + torque);
        assert!((added / expected - 1.0).abs() < 0.05, "{joint}: {added} of {expected} N m");
        assert!(!hosted.status[joint].limited && is_enabled(&hosted.pair));
    }
}

#[test]
fn an_impedance_beyond_its_limits_is_bounded_and_reported() {
    let [stiffest, strongest] = context().configuration.joints[0].stiffest_impedance();
    let high = context().configuration.joints[0].high.0;
    for (position, stiffness, damping) in
        [(0.0, 2.0 * stiffest, 0.0), (0.0, 100.0, 2.0 * strongest), (2.0 * high, 100.0, 10.0)]
    {
        let mut hosted = Hosted::new();
        hosted.run(SECOND);
        let target = hosted.position(0) + position;
        impedance(&mut hosted, 0, target, stiffness, damping);
        hosted.run(SECOND);
        assert!(hosted.status[0].limited && is_enabled(&hosted.pair), "{position} {stiffness} {damping}");
        assert!(hosted.truth(0) < f64::from(high), "{}", hosted.truth(0));
    }
}

/// Stiffness and damping that a joint showed: least squares of its torque over deviation and velocity of the
/// plant, rad and rad/s.
fn shown(samples: &[[f64; 3]]) -> [f64; 2] {
    let count = samples.len() as f64;
    let mean = |index: usize| samples.iter().map(|sample| sample[index]).sum::<f64>() / count;
    let means = [mean(0), mean(1), mean(2)];
    let product = |a: usize, b: usize| {
        samples.iter().map(|sample| (sample[a] - means[a]) * (sample[b] - means[b])).sum::<f64>()
    };
    let [aa, ab, bb, at, bt] = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2)].map(|(a, b)| product(a, b));
    let determinant = aa * bb - ab * ab;
    [(bb * at - ab * bt) / determinant, (aa * bt - ab * at) / determinant]
}

#[test]
fn a_joint_shows_the_commanded_stiffness_and_damping() {
    for (joint, stiffness, damping) in [(0, 150.0, 12.0), (0, 400.0, 30.0), (1, 80.0, 6.0), (1, 200.0, 15.0)]
    {
        let mut hosted = Hosted::new();
        hosted.run(SECOND);
        let from = hosted.position(joint);
        impedance(&mut hosted, joint, from, stiffness, damping);
        hosted.run(SECOND);
        impedance(&mut hosted, joint, from + 0.15, stiffness, damping);
        // The torque answers the motion at the time when it acts, six ticks after it is demanded.
        let (mut samples, mut demanded) = (Vec::new(), [f64::NAN; 6]);
        let mut before = hosted.truth(joint);
        for _ in 0..SECOND {
            hosted.run(1);
            let now = hosted.truth(joint);
            let velocity = (now - before) * f64::from(SERVO_RATE_HZ);
            before = now;
            samples.push([f64::from(from) + 0.15 - now, -velocity, demanded[0]]);
            demanded.rotate_left(1);
            demanded[5] = f64::from(hosted.status[joint].torque_demand.0);
        }
        let [k, d] = shown(&samples[6..]);
        assert!((k / f64::from(stiffness) - 1.0).abs() < 0.05, "{joint}: {k} of {stiffness} N m/rad");
        assert!((d / f64::from(damping) - 1.0).abs() < 0.05, "{joint}: {d} of {damping} N m s/rad");
        assert!(!hosted.status[joint].limited && is_enabled(&hosted.pair));
    }
}

#[test]
fn every_permitted_impedance_comes_to_rest_after_a_push() {
    for joint in 0..JOINTS {
        let [stiffest, strongest] = context().configuration.joints[joint].stiffest_impedance();
        for (stiffness, damping) in [
            (30.0, 0.0),
            (300.0, 0.0),
            (0.3 * stiffest, 0.0),
            (stiffest, 0.0),
            (2.0 * stiffest, 2.0 * strongest),
            (0.0, strongest),
            (300.0, strongest),
        ] {
            let mut hosted = Hosted::new();
            hosted.run(SECOND);
            let from = hosted.position(joint);
            impedance(&mut hosted, joint, from, stiffness, damping);
            let [mut worst, mut torque] = [0.0_f32; 2];
            hosted.run(SECOND);
            hosted.pair.world.push(joint, 8.0, 0.1);
            hosted.run(4 * SECOND);
            for _ in 0..SECOND {
                hosted.run(1);
                worst = worst.max(hosted.status[joint].velocity.0.abs());
                torque = torque.max(hosted.status[joint].torque_demand.0.abs());
            }
            let words = format!("{joint}: {stiffness} {damping}: {worst} rad/s, {torque} N m");
            assert!(worst < 0.03 && is_enabled(&hosted.pair), "{words}");
        }
    }
}

#[test]
fn the_impedance_mode_begins_and_ends_without_a_torque_step() {
    let mut hosted = Hosted::new();
    hosted.run(2 * SECOND);
    let from = hosted.position(1);
    let mut last = hosted.status[1].torque_demand.0;
    let mut step = 0.0_f32;
    let mut run = |hosted: &mut Hosted, ticks| {
        for _ in 0..ticks {
            hosted.run(1);
            let now = hosted.status[1].torque_demand.0;
            (step, last) = (step.max((now - last).abs()), now);
        }
        step
    };
    impedance(&mut hosted, 1, from + 0.2, 200.0, 15.0);
    hosted.commands[1].torque_slope_nm_per_s = 40.0;
    assert!(run(&mut hosted, 1) < 1.0, "begins");
    run(&mut hosted, SECOND);
    hosted.commands[1].target = Target::Hold;
    let step = run(&mut hosted, SECOND);
    assert!(step < 1.0 && is_enabled(&hosted.pair), "{step} N m");
}
