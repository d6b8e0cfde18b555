//! Contact of the foot with the floor, and the blocked joint of the plant.
use hal_sim::world::{TICK_S, World};
use scarab::hal::DriveCommand;
use scarab::units::Ampere;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

const FOOT: [f64; 3] = [0.4, 0.0, 0.0];

fn world() -> World<2> {
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let mut world = World::new(&leg.description().expect("two joints with truth"), 1);
    world.move_to(&[0.4, 0.9]);
    world
}

fn command(currents: [f32; 2]) -> DriveCommand<2> {
    DriveCommand { enabled: true, currents: currents.map(Ampere) }
}

/// Height of the foot above the hip, m; thigh 0.39 m, knee flexion positive.
fn foot_height(world: &World<2>) -> f64 {
    let [hip, knee] = world.anatomical_position();
    -0.39 * scarab::real::sin_cos(hip).1 - FOOT[0] * scarab::real::sin_cos(hip - knee).1
}

/// Lets the leg fall with outputs off for a time; returns the lowest height of the foot.
fn lowest(world: &mut World<2>, seconds: f64) -> f64 {
    let mut lowest = f64::INFINITY;
    for _ in 0..(seconds / TICK_S) as u32 {
        world.tick(&DriveCommand::OFF);
        lowest = lowest.min(foot_height(world));
    }
    lowest
}

#[test]
fn the_floor_holds_a_falling_leg_for_its_duration() {
    // Heavy enough to fall against the friction of the drives.
    let heavy = || {
        let mut world = world();
        world.attach(1, 10.0, [0.3, 0.0, 0.0]);
        world
    };
    let start = foot_height(&heavy());
    let free = lowest(&mut heavy(), 1.0);
    assert!(free < start - 0.05, "without a floor the foot falls by only {} m", start - free);
    let mut standing = heavy();
    standing.touch(FOOT, 0.0, 1.0);
    let held = lowest(&mut standing, 1.0);
    // The foot sinks in until a stiffness of 10 kN/m carries it.
    assert!(held > start - 0.02, "{} m below", start - held);
    assert!(lowest(&mut standing, 1.0) < start - 0.05, "the foot does not fall after the floor's time");
}

#[test]
fn the_floor_pushes_but_never_pulls() {
    let lift = |mut world: World<2>| {
        for _ in 0..2000 {
            world.tick(&command([40.0, 20.0]));
        }
        foot_height(&world)
    };
    let mut standing = world();
    standing.touch(FOOT, 0.0, 10.0);
    let (free, standing) = (lift(world()), lift(standing));
    let start = foot_height(&world());
    assert!(free > start + 0.05 && standing > start + 0.05, "{free} {standing} from {start}");
}

#[test]
fn before_its_start_the_floor_has_no_effect() {
    let (mut free, mut later) = (world(), world());
    later.touch(FOOT, 0.5, 1.0);
    for _ in 0..1999 {
        assert_eq!(free.tick(&command([3.0, -2.0])), later.tick(&command([3.0, -2.0])));
    }
}

#[test]
fn a_blocked_joint_keeps_its_position_while_the_other_moves() {
    for joint in 0..2 {
        let mut world = world();
        world.block(joint);
        world.attach(1, 5.0, [0.3, 0.0, 0.0]);
        let before = world.anatomical_position();
        for tick in 0..4000 {
            let current = if tick % 1000 < 500 { 50.0 } else { -50.0 };
            world.tick(&command([current, current]));
        }
        let after = world.anatomical_position();
        assert_eq!(before[joint], after[joint]);
        assert!(world.sticking()[joint]);
        assert!((before[1 - joint] - after[1 - joint]).abs() > 0.05);
    }
}
