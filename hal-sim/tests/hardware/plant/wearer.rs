//! Wearer and exoskeleton as two bodies: energies, reaction, a rigid witness, muscles and motions.
#![expect(clippy::disallowed_methods, reason = "expected values by another library than the plant's")]

use crate::plant::common::{
    Lengths, bare_exoskeleton, exoskeleton, joined, leg, limb, limb_segments, turned, worn_leg,
};
use crate::plant::complete_drive::board;
use hal_sim::description::{FrictionDescription, LegDescription, PushDescription};
use hal_sim::mechanism::Mechanism;
use hal_sim::wearer::WearerTruth;
use hal_sim::wearer::description::{
    CuffDescription, CuffSpring, Impedance, MuscleDescription, PassiveDescription, WearerDescription,
    WearerError,
};
use hal_sim::wearer::motion::{CadenceChange, Gait, IntendedMotion, Reaching, Strokes};
use hal_sim::wearer::muscles::Intention;
use hal_sim::world::{TICK_S, World};
use scarab::hal::DriveCommand;
use scarab::units::Ampere;

/// Segments of a person of 1.75 m by Winter's fractions of height.
const PERSON: Lengths = [0.245 * 1.75, 0.246 * 1.75, 0.152 * 1.75];
const THIGH_M: f64 = PERSON[0];

fn person() -> WearerDescription {
    let muscles = [MuscleDescription::HIP, MuscleDescription::KNEE];
    let cuffs = [CuffDescription::padded(0.28), CuffDescription::padded(0.25)];
    WearerDescription::aligned(limb_segments(PERSON), THIGH_M, muscles, cuffs)
}

/// Person without passive torques; cuffs without damping.
fn elastic_person(stiffness: f64, play: f64) -> WearerDescription {
    let spring = CuffSpring { stiffness, damping: 0.0, play };
    WearerDescription {
        passive: [PassiveDescription::default(); 2],
        cuffs: person().cuffs.map(|cuff| CuffDescription { along: spring, across: spring, ..cuff }),
        ..person()
    }
}

fn worn(leg: &LegDescription<2>, wearer: &WearerDescription, posture: [f64; 2]) -> World<2> {
    let mut world = World::new(leg, 1);
    world.move_to(&posture);
    world.wear(wearer).expect("a leg of hip and knee");
    world
}

fn walking(cadence_hz: f64) -> Intention {
    Intention::Follow(IntendedMotion::Gait(Gait { offset: [0.26, 0.14], ..Gait::at_cadence(cadence_hz) }))
}

fn wearer(world: &World<2>) -> WearerTruth {
    world.wearer_truth().expect("worn")
}

/// Mechanical energy of the exoskeleton, J. Its joints have the direction +1 and -1 and no zero offset.
fn exoskeleton_energy(description: &LegDescription<2>, world: &World<2>) -> f64 {
    let (mechanism, truth) = (Mechanism::new(description), world.truth());
    let joints = |[hip, knee]: [f64; 2]| [hip, -knee];
    let angles = joints(truth.position);
    mechanism.kinetic_energy(&angles, &joints(truth.velocity)) + mechanism.potential_energy(&angles)
}

/// Energy of both bodies and of the cuffs' springs, J.
fn energy(description: &LegDescription<2>, world: &World<2>) -> f64 {
    let truth = wearer(world);
    let stored: f64 = truth.cuffs.iter().map(|cuff| cuff.stored).sum();
    exoskeleton_energy(description, world) + truth.mechanical_energy + stored
}

/// Largest deviation of the energy in 10 s of free swinging, mean deviation in the last second, J, and
/// largest deflection across the thigh's cuff, m.
fn energy_deviation(wearer_description: &WearerDescription) -> [f64; 3] {
    let description = bare_exoskeleton(PERSON);
    let mut world = worn(&description, wearer_description, [1.2, 0.3]);
    let initial = energy(&description, &world);
    let (mut largest, mut late, mut deflection) = (0.0_f64, 0.0, 0.0_f64);
    for tick in 0..40_000 {
        world.advance();
        let deviation = energy(&description, &world) - initial;
        largest = largest.max(deviation.abs());
        deflection = deflection.max(wearer(&world).cuffs[0].deflection[1].abs());
        if tick >= 36_000 {
            late += deviation / 4000.0;
        }
    }
    [largest, late, deflection]
}

#[test]
fn energy_of_both_bodies_and_elastic_cuffs_is_conserved() {
    for (stiffness, play) in [(2e3, 0.0), (20e3, 0.0), (8e3, 0.005), (1e6, 0.0)] {
        let [largest, late, deflection] = energy_deviation(&elastic_person(stiffness, play));
        println!("{stiffness} N/m, play {play} m: {largest:e} J, late {late:e} J, deflection {deflection} m");
        // Rates of change reach 10/s and 40 J are exchanged: (10/s * 250 us)^2 * 40 J = 2.5e-4 J. The cuffs
        // store below 0.5 J and err by 1.25e-3 of that in steps of 0.1 rad at most.
        assert!(largest < 2.5e-4 && late.abs() < 5e-5);
        assert!(deflection > play, "the cuff must act");
    }
}

#[test]
fn no_permitted_cuff_makes_a_step_unstable() {
    let description = bare_exoskeleton(PERSON);
    for (stiffness, damping) in [(1e3, 2e4), (1e7, 10.0), (5e7, 0.0), (0.0, 2e4)] {
        let mut wearer_description = elastic_person(stiffness, 0.0);
        for cuff in &mut wearer_description.cuffs {
            (cuff.along.damping, cuff.across.damping) = (damping, damping);
        }
        let mut world = worn(&description, &wearer_description, [1.2, 0.3]);
        let initial = energy(&description, &world);
        for _ in 0..4000 {
            world.advance();
            let gained = energy(&description, &world) - initial;
            // The bound of the elastic energy's error above.
            assert!(gained < 2.5e-4, "{stiffness} N/m, {damping} N s/m: {gained} J");
        }
    }
}

#[test]
fn accelerations_are_those_of_the_motion() {
    let mut world = worn(&bare_exoskeleton(PERSON), &person(), [0.9, 0.4]);
    let path: Vec<_> = (0..4000)
        .map(|_| {
            world.advance();
            (world.truth(), wearer(&world))
        })
        .collect();
    let mut fastest = [0.0_f64; 2];
    for three in path.windows(3) {
        let [before, (carrier, limb), after] = three else { panic!("three instants") };
        let second = |[old, now, new]: [[f64; 2]; 3], joint: usize| {
            (new[joint] - 2.0 * now[joint] + old[joint]) / (TICK_S * TICK_S)
        };
        for joint in 0..2 {
            let found = [
                second([before.0.position, carrier.position, after.0.position], joint),
                second([before.1.position, limb.position, after.1.position], joint),
            ];
            // Cuffs vibrate at some 100 rad/s: (100/s * 250 us)^2 / 12 of 100 rad/s^2 are 5e-3 rad/s^2.
            assert!((found[0] - carrier.acceleration[joint]).abs() < 0.02, "{found:?} {carrier:?}");
            assert!((found[1] - limb.acceleration[joint]).abs() < 0.02, "{found:?} {limb:?}");
            fastest[joint] = fastest[joint].max(found[0].abs());
        }
    }
    assert!(fastest.iter().all(|rate| *rate > 2.0), "{fastest:?}");
}

/// Sine torques of the motors, N m, anatomical.
fn driven(tick: u32) -> DriveCommand<2> {
    let time = f64::from(tick) * TICK_S;
    let currents = [25.0 * (3.1 * time).sin(), 12.0 * (5.3 * time).sin()];
    DriveCommand { enabled: true, currents: currents.map(|current| Ampere(current as f32)) }
}

/// Energy in, out and lost over 10 s of a described world, J.
#[derive(Debug)]
struct Balance {
    change: f64,
    motor_work: f64,
    friction_loss: f64,
    end: WearerTruth,
    begin: WearerTruth,
    /// Integral of each cuff's power over the servo ticks.
    power: [f64; 2],
}

fn balance(description: &LegDescription<2>, mut world: World<2>) -> Balance {
    let (begin, before) = (wearer(&world), energy(description, &world));
    let (mut motor_work, mut friction_loss, mut power) = (0.0, 0.0, [0.0; 2]);
    for tick in 0..40_000 {
        let (old, old_power) = (world.truth(), wearer(&world).cuffs.map(|cuff| cuff.power));
        world.tick(&driven(tick));
        let new = world.truth();
        for joint in 0..2 {
            let FrictionDescription { coulomb, viscous, .. } = description.joints[joint].friction;
            let turned = new.position[joint] - old.position[joint];
            motor_work += 0.5 * (old.motor_torque[joint] + new.motor_torque[joint]) * turned;
            friction_loss += coulomb * turned.abs() + viscous * turned * turned / TICK_S;
        }
        for (sum, (old, new)) in power.iter_mut().zip(old_power.into_iter().zip(wearer(&world).cuffs)) {
            *sum += 0.5 * TICK_S * (old + new.power);
        }
    }
    let change = energy(description, &world) - before;
    Balance { change, motor_work, friction_loss, end: wearer(&world), begin, power }
}

#[test]
fn work_of_motors_and_muscles_is_energy_and_loss() {
    let description = exoskeleton(PERSON);
    let with_play = |play: f64| {
        let mut wearer = person();
        for cuff in &mut wearer.cuffs {
            (cuff.along.play, cuff.across.play) = (play, play);
        }
        wearer
    };
    for (play, intention) in [(0.0, walking(0.8)), (0.004, walking(0.8)), (0.004, Intention::Limp)] {
        let mut world = worn(&description, &with_play(play), [0.5, 0.6]);
        world.intend(intention).expect("a valid motion");
        let found = balance(&description, world);
        let cuffs = found.end.cuffs;
        let lost = found.friction_loss
            + found.end.passive_loss
            + cuffs.iter().map(|cuff| cuff.dissipated).sum::<f64>();
        let error = found.motor_work + found.end.muscle_work - lost - found.change;
        println!(
            "motors {:.3} J, muscles {:.3} J, lost {lost:.3} J, change {:.3} J, error {error:.1e} J",
            found.motor_work, found.end.muscle_work, found.change
        );
        // Steps err by (10/s * 250 us)^2 = 6e-6 of what flows; a contact adds its own to within a step.
        assert!(error.abs() < 1e-5 * (found.motor_work.abs() + found.end.muscle_work.abs() + lost));
        for (number, cuff) in cuffs.iter().enumerate() {
            let kept = cuff.stored - found.begin.cuffs[number].stored;
            let lack = cuff.given - cuff.received - cuff.dissipated - kept;
            let missed = cuff.received - found.power[number];
            println!(
                "cuff {number}: received {:.3} J, lack {lack:.1e} J, by power {missed:.1e} J",
                cuff.received
            );
            let scale = cuff.dissipated + cuff.received.abs();
            assert!(cuff.dissipated > 1e-3 && lack.abs() < 1e-4 * scale, "{cuff:?}");
            assert!(missed.abs() < 2e-3 * scale, "{cuff:?}");
        }
    }
}

/// Exoskeleton and person as one rigid leg.
fn merged(description: &LegDescription<2>) -> LegDescription<2> {
    let mut merged = *description;
    for (joint, limb) in merged.joints.iter_mut().zip(limb(PERSON)) {
        joint.body = joined(&joint.body, &limb);
    }
    merged
}

#[test]
fn with_stiff_cuffs_both_bodies_move_as_one_rigid_leg() {
    // The thigh is not vertical at the anatomical zero.
    let mut description = bare_exoskeleton(PERSON);
    description.gravity = [8.0, 5.7, 0.0];
    let deviation = |stiffness: f64| {
        let wearer = elastic_person(stiffness, 0.0);
        let mut two = worn(&description, &wearer, [0.6, 0.8]);
        let mut one = World::new(&merged(&description), 1);
        one.move_to(&[0.6, 0.8]);
        let mut largest = 0.0_f64;
        for tick in 0..8000 {
            one.tick(&driven(tick));
            two.tick(&driven(tick));
            let (rigid, coupled) = (one.truth().position, two.truth().position);
            for joint in 0..2 {
                largest = largest.max((rigid[joint] - coupled[joint]).abs());
            }
        }
        assert!(one.truth().position.iter().any(|angle| angle.abs() > 0.1));
        largest
    };
    let found = [3e4, 3e5, 3e6].map(deviation);
    println!("largest deviation in 2 s: {found:?} rad");
    // Deflections are forces over stiffness, and the double pendulum amplifies them alike. The steps of the
    // rigid leg, longer than those of stiff cuffs, add some 5e-5 rad.
    for pair in found.windows(2) {
        assert!((7.0..14.0).contains(&(pair[0] / pair[1])), "{found:?}");
    }
    assert!(found[2] < 6e-4, "{found:?}");
}

/// The person's limb as a leg of its own, for the inverse dynamics of the exoskeleton's code path.
fn limb_alone() -> World<2> {
    let mut alone = bare_exoskeleton(PERSON);
    alone.joints.iter_mut().zip(limb(PERSON)).for_each(|(joint, limb)| joint.body = limb);
    World::new(&alone, 1)
}

#[test]
fn interaction_torque_is_what_the_wearers_own_accelerations_demand() {
    let alone = limb_alone();
    let mut world = worn(&exoskeleton(PERSON), &person(), [0.3, 0.4]);
    world.intend(walking(0.8)).expect("a valid motion");
    let path: Vec<WearerTruth> = (0..12_000)
        .map(|tick| {
            world.tick(&driven(tick));
            wearer(&world)
        })
        .collect();
    let (mut largest, mut error, mut unequal) = (0.0_f64, [0.0_f64; 2], 0.0_f64);
    for three in path.windows(3) {
        let now = &three[1];
        let acceleration = [0, 1].map(|joint| {
            (three[2].position[joint] - 2.0 * now.position[joint] + three[0].position[joint])
                / (TICK_S * TICK_S)
        });
        let demanded = alone.inverse_dynamics(&now.position, &now.velocity, &acceleration);
        for joint in 0..2 {
            let muscle = 0.5 * (now.muscle_torque[joint] + three[2].muscle_torque[joint]);
            let cuffs = demanded[joint] - muscle - now.passive_torque[joint];
            largest = largest.max(cuffs.abs());
            error[joint] = error[joint].max((cuffs - now.reaction_torque[joint]).abs());
        }
        // The hip axes coincide, so the moments about them are opposite.
        unequal = unequal.max((now.reaction_torque[0] + now.interaction_torque[0]).abs());
    }
    println!("up to {largest:.2} N m, errors {error:?} N m, action against reaction {unequal:.1e} N m");
    assert!(largest > 10.0, "{largest}");
    // Second differences over a tick of 250 us while cuffs vibrate at some 60 rad/s: (60/s * 250 us)^2 / 12
    // of 40 N m are 7e-4 N m. A joint of the exoskeleton that starts or stops adds its step of the force.
    assert!(error.iter().all(|error| *error < 0.03), "{error:?}");
    assert!(unequal < 1e-12, "{unequal:e}");
}

#[test]
fn reflexes_answer_exactly_after_the_neural_delay() {
    let posture = [0.4, 0.7];
    for delay_ms in [0_u32, 50, 70, 100] {
        let mut wearer_description = person();
        wearer_description.neural_delay = f64::from(delay_ms) * 1e-3;
        for muscle in &mut wearer_description.muscles {
            muscle.intrinsic = Impedance::default();
        }
        let mut quiet = worn(&bare_exoskeleton(PERSON), &wearer_description, posture);
        quiet.intend(Intention::Follow(IntendedMotion::Rest(posture))).expect("a valid motion");
        (0..8000).for_each(|_| quiet.advance());
        let mut pushed = quiet.clone();
        pushed.push(0, 40.0, 0.1);
        let answer = (0..2000).find(|_| {
            quiet.advance();
            pushed.advance();
            wearer(&quiet).muscle_torque != wearer(&pushed).muscle_torque
        });
        // The push moves the limb within the first tick. The next sample of the reflexes, at every fourth
        // tick, is the first to see it.
        assert_eq!(answer, Some(4 * (delay_ms + 1)), "delay of {delay_ms} ms");
    }
}

/// Cuffs that transmit nothing.
fn uncoupled() -> WearerDescription {
    let mut wearer = person();
    for cuff in &mut wearer.cuffs {
        (cuff.along, cuff.across) = (CuffSpring::default(), CuffSpring::default());
    }
    wearer
}

#[test]
fn a_wearer_alone_walks_as_intended_by_feedforward() {
    let change = Some(CadenceChange { at: 4.0, cadence_hz: 1.0, within: 0.5 });
    let mut world = worn(&exoskeleton(PERSON), &uncoupled(), [0.3, 0.4]);
    let gait = Gait { change, ..Gait::at_cadence(0.8) };
    world.intend(Intention::Follow(IntendedMotion::Gait(gait))).expect("a valid motion");
    let mut largest = 0.0_f64;
    for _ in 0..40_000 {
        world.advance();
        let truth = wearer(&world);
        let intended = truth.intended.expect("follows");
        for joint in 0..2 {
            let lag = TICK_S * intended.velocity[joint];
            largest = largest.max((intended.position[joint] + lag - truth.position[joint]).abs());
        }
        assert_eq!(truth.interaction_torque, [0.0; 2]);
    }
    println!("largest error alone: {largest:.1e} rad");
    // Torques are constant during a tick: 40 N m change by 1 % in a tick, over an impedance near 10 N m/rad.
    assert!(largest < 5e-3, "{largest:e}");
}

#[test]
fn an_exoskeleton_with_loose_cuffs_moves_as_without_wearer() {
    let mut loose = worn(&exoskeleton(PERSON), &uncoupled(), [0.3, 0.4]);
    let mut empty = World::new(&exoskeleton(PERSON), 1);
    empty.move_to(&[0.3, 0.4]);
    let mut starts = 0;
    for tick in 0..12_000 {
        let before = empty.sticking();
        loose.tick(&driven(tick));
        empty.tick(&driven(tick));
        starts += u32::from(before != empty.sticking());
        for joint in 0..2 {
            // Rounding of the mean torque; joints start and stop in the same parts of a tick.
            assert!((loose.truth().position[joint] - empty.truth().position[joint]).abs() < 1e-12);
        }
    }
    assert!(starts > 4, "{starts}");
}

#[test]
fn a_disturbed_wearer_settles_with_any_neural_delay() {
    for neural_delay in [0.0, 0.05, 0.1] {
        let mut world =
            worn(&exoskeleton(PERSON), &WearerDescription { neural_delay, ..uncoupled() }, [0.8, 0.3]);
        (0..1200).for_each(|_| world.advance());
        let thrown = wearer(&world).velocity;
        assert!(thrown.iter().any(|rate| rate.abs() > 0.5), "{thrown:?}");
        world.intend(Intention::Follow(IntendedMotion::Rest([0.5, 0.6]))).expect("a valid motion");
        (0..80_000).for_each(|_| world.advance());
        let truth = wearer(&world);
        // The slowest motion decays at 0.4/s with 100 ms: in 20 s some 1 rad falls to 3e-4.
        assert!(
            (truth.position[0] - 0.5).abs() < 3e-3 && (truth.position[1] - 0.6).abs() < 3e-3,
            "{truth:?}"
        );
    }
}

/// Root mean squares of 10 s with drives off, hip before knee.
struct Rms {
    interaction: [f64; 2],
    muscle: [f64; 2],
    /// Range of the wearer's motion over that of the intended one.
    reached: [f64; 2],
}

fn rms(wearer_description: &WearerDescription, motion: IntendedMotion) -> Rms {
    let mut world = worn(&exoskeleton(PERSON), wearer_description, [0.4, 0.5]);
    world.intend(Intention::Follow(motion)).expect("a valid motion");
    (0..12_000).for_each(|_| world.advance());
    let path: Vec<WearerTruth> = (0..40_000)
        .map(|_| {
            world.advance();
            wearer(&world)
        })
        .collect();
    let of = |value: &dyn Fn(&WearerTruth) -> f64| {
        (path.iter().map(|truth| value(truth).powi(2)).sum::<f64>() / path.len() as f64).sqrt()
    };
    let range = |value: &dyn Fn(&WearerTruth) -> f64| {
        let values = || path.iter().map(value);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let intended = |truth: &WearerTruth, joint: usize| truth.intended.expect("follows").position[joint];
    Rms {
        interaction: [0, 1].map(|joint| of(&|truth| truth.interaction_torque[joint])),
        muscle: [0, 1].map(|joint| of(&|truth| truth.muscle_torque[joint])),
        reached: [0, 1].map(|joint| {
            range(&|truth| truth.position[joint]) / range(&|truth| intended(truth, joint)).max(0.1)
        }),
    }
}

#[test]
fn interaction_torque_of_an_unpowered_exoskeleton_is_plausible_for_every_motion() {
    let gait =
        |cadence_hz: f64| IntendedMotion::Gait(Gait { offset: [0.26, 0.14], ..Gait::at_cadence(cadence_hz) });
    let reaching = Reaching { low: [0.1, 0.2], high: [0.85, 1.6], durations: [0.5, 1.2], seed: 1 };
    let firm = WearerDescription {
        muscles: [MuscleDescription::FIRM_HIP, MuscleDescription::FIRM_KNEE],
        ..person()
    };
    for (name, motion) in [
        ("gait 0.5 Hz", gait(0.5)),
        ("gait 0.8 Hz", gait(0.8)),
        ("gait 1.2 Hz", gait(1.2)),
        ("kicking", IntendedMotion::Strokes(Strokes::kicking(0.5))),
        ("leg extension", IntendedMotion::Strokes(Strokes::leg_extension(0.8))),
        ("reaching", IntendedMotion::Reaching(reaching)),
    ] {
        for (who, wearer_description) in [("relaxed", &person()), ("firm", &firm)] {
            let Rms { interaction, muscle, reached } = rms(wearer_description, motion);
            println!(
                "{name}, {who}: interaction {interaction:.2?}, muscles {muscle:.2?} N m, reached {reached:.2?}"
            );
            // The exoskeleton's gravity torque alone is a few N m; its rotors take 1.9 kg m^2 * 30 rad/s^2.
            assert!(interaction.iter().all(|torque| (2.0..80.0).contains(torque)), "{name}");
        }
    }
}

#[test]
fn a_limp_wearer_is_moved_by_the_exoskeleton_alone() {
    let mut world = worn(&exoskeleton(PERSON), &person(), [0.4, 0.5]);
    let begin = wearer(&world);
    let mut farthest = 0.0_f64;
    for tick in 0..20_000 {
        world.tick(&driven(tick));
        let (truth, carrier) = (wearer(&world), world.truth());
        assert_eq!((truth.muscle_torque, truth.muscle_work), ([0.0; 2], 0.0));
        for joint in 0..2 {
            farthest = farthest.max((truth.position[joint] - begin.position[joint]).abs());
            let apart = (truth.position[joint] - carrier.position[joint]).abs();
            // A limb of 12 kg deflects cuffs of 8 kN/m by about 10 mm at 0.25 m.
            assert!(apart < 0.08, "{apart}");
        }
    }
    let end = wearer(&world);
    let received: f64 = end.cuffs.iter().map(|cuff| cuff.received).sum();
    let kept = end.mechanical_energy - begin.mechanical_energy;
    println!("received {received:.4} J, kept {kept:.4} J, passive loss {:.4} J", end.passive_loss);
    assert!(farthest > 0.1, "the exoskeleton must move");
    assert!((received - kept - end.passive_loss).abs() < 1e-3 * end.passive_loss, "{end:?}");
}

#[test]
fn a_resisting_wearer_holds_the_exoskeleton_where_a_limp_one_yields() {
    let turned = |intention: Intention| {
        let mut world = worn(&exoskeleton(PERSON), &person(), [0.4, 0.5]);
        world.intend(intention).expect("no motion to refuse");
        let command = DriveCommand { enabled: true, currents: [Ampere(30.0), Ampere(20.0)] };
        for _ in 0..12_000 {
            world.tick(&command);
        }
        let position = world.truth().position;
        [position[0] - 0.4, position[1] - 0.5]
    };
    let (limp, resisting) = (turned(Intention::Limp), turned(Intention::Resist));
    println!("limp {limp:.3?} rad, resisting {resisting:.3?} rad");
    for joint in 0..2 {
        assert!(resisting[joint].abs() < 0.4 && resisting[joint].abs() < 0.5 * limp[joint].abs());
    }
}

#[test]
fn muscles_are_limited_to_their_largest_torque() {
    let mut weak = person();
    weak.muscles.iter_mut().for_each(|muscle| muscle.torque_limit = 6.0);
    let mut world = worn(&exoskeleton(PERSON), &weak, [0.4, 0.5]);
    world.intend(walking(1.0)).expect("a valid motion");
    let mut largest = [0.0_f64; 2];
    for _ in 0..12_000 {
        world.advance();
        for (largest, torque) in largest.iter_mut().zip(wearer(&world).muscle_torque) {
            *largest = largest.max(torque.abs());
        }
    }
    assert_eq!(largest, [6.0; 2]);
}

#[test]
fn offset_axes_load_the_cuffs_of_a_bent_leg() {
    let forces = |hip_offset: [f64; 2], thigh_length: f64| {
        let wearer_description = WearerDescription { hip_offset, thigh_length, ..person() };
        let straight = wearer(&worn(&bare_exoskeleton(PERSON), &wearer_description, [0.0; 2]));
        let bent = wearer(&worn(&bare_exoskeleton(PERSON), &wearer_description, [0.6, 1.2]));
        assert!(straight.cuffs.iter().flat_map(|cuff| cuff.deflection).all(|d| d.abs() < 1e-12));
        bent.cuffs.map(|cuff| cuff.force)
    };
    assert!(forces([0.0; 2], THIGH_M).iter().flatten().all(|force| force.abs() < 1e-9));
    let hip = forces([0.01, 0.02], THIGH_M);
    let knee = forces([0.0; 2], THIGH_M + 0.02);
    println!("hip offset: {hip:.1?} N, longer thigh: {knee:.1?} N");
    assert!(hip[0].iter().any(|force| force.abs() > 10.0));
    // A longer thigh does not load the cuff above the knee.
    assert!(knee[0].iter().all(|force| force.abs() < 1e-9) && knee[1].iter().any(|force| force.abs() > 10.0));
}

#[test]
fn a_turned_description_wears_identically() {
    let plain = exoskeleton(PERSON);
    let [one, other] = [plain, turned(&plain)].map(|description| {
        let mut world = worn(&description, &person(), [0.4, 0.5]);
        world.intend(walking(0.8)).expect("a valid motion");
        (0..8000).for_each(|tick| {
            world.tick(&driven(tick));
        });
        wearer(&world)
    });
    for joint in 0..2 {
        // Rounding differs by the turned frames; two seconds of motion hardly amplify it.
        assert!((one.position[joint] - other.position[joint]).abs() < 1e-9, "{one:?} {other:?}");
        assert!((one.interaction_torque[joint] - other.interaction_torque[joint]).abs() < 1e-6);
    }
}

#[test]
fn a_wearer_walks_alike_with_ideal_and_with_complete_drives_off() {
    let ideal = World::new(&exoskeleton(PERSON), 1);
    let complete = World::with_complete_drives(&exoskeleton(PERSON), &board(), 1);
    let [ideal, complete] = [ideal, complete].map(|mut world| {
        world.move_to(&[0.4, 0.5]);
        world.wear(&person()).expect("a leg of hip and knee");
        world.intend(walking(0.5)).expect("a valid motion");
        (0..16_000).for_each(|_| world.advance());
        (wearer(&world), world.truth())
    });
    println!("{:?} {:?}", ideal.0.position, complete.0.position);
    for joint in 0..2 {
        // Other steps: friction starts and reverses up to an eighth of a servo tick apart.
        assert!((ideal.0.position[joint] - complete.0.position[joint]).abs() < 1e-5);
        assert!((ideal.1.position[joint] - complete.1.position[joint]).abs() < 1e-5);
    }
    assert!((ideal.0.muscle_work - complete.0.muscle_work).abs() < 0.01 * ideal.0.muscle_work);
}

#[test]
fn placing_a_worn_leg_places_the_wearer() {
    let mut world = worn(&exoskeleton(PERSON), &person(), [0.4, 0.5]);
    world.intend(walking(1.0)).expect("a valid motion");
    (0..8000).for_each(|_| world.advance());
    world.move_to(&[0.7, 0.9]);
    let truth = wearer(&world);
    assert!((truth.position[0] - 0.7).abs() < 1e-12 && (truth.position[1] - 0.9).abs() < 1e-12);
    assert_eq!(truth.velocity, [0.0; 2]);
    world.advance();
    let intended = wearer(&world).intended.expect("follows");
    assert!((intended.position[1] - 0.9).abs() < 1e-6, "the motion begins again at the new posture");
}

#[test]
fn copies_of_a_worn_world_continue_identically() {
    let mut description = exoskeleton(PERSON);
    description.pushes = Some(PushDescription { rate: 3.0, torque: 20.0, duration: 0.2 });
    let mut world = worn(&description, &person(), [0.4, 0.5]);
    let reaching = Reaching { low: [0.1, 0.2], high: [0.85, 1.6], durations: [0.5, 1.2], seed: 9 };
    world.intend(Intention::Follow(IntendedMotion::Reaching(reaching))).expect("a valid motion");
    (0..3000).for_each(|_| world.advance());
    let mut copy = world.clone();
    for _ in 0..3000 {
        world.advance();
        copy.advance();
    }
    assert!(copy == world);
    copy.advance();
    assert!(copy != world);
}

#[test]
fn legs_and_wearers_that_do_not_fit_are_refused() {
    let refused = |change: fn(&mut LegDescription<2>, &mut WearerDescription)| {
        let (mut description, mut wearer) = (exoskeleton(PERSON), person());
        change(&mut description, &mut wearer);
        World::new(&description, 1).wear(&wearer).expect_err("does not fit")
    };
    let one_joint = leg([9.81, 0.0, 0.0], [exoskeleton(PERSON).joints[0]]);
    let three_joints = crate::plant::common::spatial_chain();
    for (error, joints) in
        [(World::new(&one_joint, 1).wear(&person()), 1), (World::new(&three_joints, 1).wear(&person()), 3)]
    {
        assert_eq!(error, Err(WearerError::JointCount(joints)));
    }
    // A knee whose positive angles extend it.
    assert_eq!(World::new(&worn_leg(), 1).wear(&person()), Err(WearerError::KneeDirection));
    let tilted = refused(|leg, _| leg.joints[1].frame.alpha = 0.1);
    assert!(matches!(tilted, WearerError::AxesNotParallel { tilt } if (tilt - 0.1_f64.sin()).abs() < 1e-12));
    let lying = refused(|leg, _| leg.gravity = [0.0, 0.0, 9.81]);
    assert_eq!(lying, WearerError::PlaneNotVertical { sideways: 9.81 });
    let no_thigh = refused(|leg, _| leg.joints[1].frame.a = 0.0);
    assert_eq!(no_thigh, WearerError::NoThigh { length: 0.0 });
    let massless = refused(|leg, _| {
        leg.joints.iter_mut().for_each(|joint| {
            (joint.body, joint.rotor_inertia) = (Default::default(), 0.0);
        });
    });
    assert!(matches!(massless, WearerError::TooFast { .. }), "{massless}");
    let too_fast = refused(|_, wearer| wearer.cuffs[1].across.damping = 1e5);
    assert!(matches!(too_fast, WearerError::TooFast { .. }), "{too_fast}");
    for (part, quantity, error) in [
        ("thigh", "mass, kg,", refused(|_, wearer| wearer.thigh.mass = 0.0)),
        ("shank", "inertia, kg m^2,", refused(|_, wearer| wearer.shank.inertia_com = f64::NAN)),
        ("wearer", "neural delay, s,", refused(|_, wearer| wearer.neural_delay = 0.101)),
        ("knee", "reflex damping, N m s/rad,", refused(|_, wearer| wearer.muscles[1].reflex.damping = -1.0)),
        ("thigh cuff", "play, m,", refused(|_, wearer| wearer.cuffs[0].along.play = -1e-3)),
        ("shank cuff", "distance, m,", refused(|_, wearer| wearer.cuffs[1].distance = f64::INFINITY)),
    ] {
        assert!(
            matches!(error, WearerError::OutOfRange { part: p, quantity: q, .. } if (p, q) == (part, quantity)),
            "{error}"
        );
    }
    let mut bare = World::new(&exoskeleton(PERSON), 1);
    assert_eq!(bare.intend(Intention::Limp), Err(WearerError::NotWorn));
    assert_eq!(bare.wearer_truth(), None);
}
