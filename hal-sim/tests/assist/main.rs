//! Assistance of the firmware's leg against a simulated wearer with a body of their own.
#![expect(clippy::disallowed_methods, reason = "expected values by another library than the plant's")]

use hal_sim::description::{
    BodyDescription, CurrentSensorDescription, DenavitHartenberg, DriveDescription, EncoderDescription,
    EncoderSide, FrictionDescription, JointDescription, LegDescription,
};
use hal_sim::wearer::description::{
    CuffDescription, Impedance, MuscleDescription, PassiveDescription, SegmentDescription, WearerDescription,
};
use hal_sim::wearer::motion::{Gait, IntendedMotion, Strokes};
use hal_sim::wearer::muscles::Intention;
use hal_sim::world::World;
use nalgebra::{Matrix3, Vector3};
use scarab::hal::Sample;
use scarab::leg::{
    AssistShares, Assured, BASE, ControlOutput, ControlRequest, IdentifiedModel, JOINTS, Leg,
    LegConfiguration, PowerRequest, Wearing,
};
use scarab::model::{LegParameters, RigidBody};
use scarab::{ident, leg, model, motion, motor, safety, units};

mod x2 {
    include!("../../../host/legs/x2-wearer-75kg.rs");
}

type DeviceLeg = Leg<JOINTS, BASE, 256, 26>;

fn body(mass: f64, com: [f64; 2], sagittal: f64) -> BodyDescription {
    BodyDescription {
        mass,
        com: [com[0], com[1], 0.0],
        inertia_com: [sagittal * 0.2, 0.0, 0.0, sagittal, 0.0, sagittal],
    }
}

fn joined(parts: &[(f64, [f64; 2], f64)]) -> (f64, [f64; 2], f64) {
    let mass: f64 = parts.iter().map(|part| part.0).sum();
    let com = [0, 1].map(|axis| parts.iter().map(|part| part.0 * part.1[axis]).sum::<f64>() / mass);
    let inertia = parts
        .iter()
        .map(|(mass, at, own)| own + mass * ((at[0] - com[0]).powi(2) + (at[1] - com[1]).powi(2)))
        .sum();
    (mass, com, inertia)
}

fn exoskeleton() -> LegDescription<2> {
    let thigh = joined(&[(0.70, [0.0811, 0.0], 0.002_197), (2.14, [0.39 - 0.055_64, 0.0], 0.005_901)]);
    let shank = joined(&[
        (0.64, [0.0908, 0.0], 0.002_346),
        (0.47, [0.40 - 0.0562, 0.0], 0.000_794_1),
        (1.25, [0.40, 0.088_34], 0.004_441),
    ]);
    let joint =
        |a: f64, part: (f64, [f64; 2], f64), direction: f64, coulomb: f64, viscous: f64| JointDescription {
            stops: None,
            frame: DenavitHartenberg { alpha: 0.0, a, d: 0.0 },
            direction,
            zero_offset: 0.0,
            body: body(part.0, part.1, part.2),
            rotor_inertia: 1.9,
            friction: FrictionDescription { coulomb, viscous, offset: 0.0, stribeck: None },
            drive: DriveDescription { torque_per_ampere: 1.5, current_limit: 57.0, lag: 1e-3 },
            encoder: EncoderDescription { side: EncoderSide::Motor, counts: 8192.0, ratio: 50.0 },
            current_sensor: CurrentSensorDescription::default(),
        };
    LegDescription {
        gravity: [9.81, 0.0, 0.0],
        joints: [joint(0.0, thigh, 1.0, 4.58, 5.01), joint(0.39, shank, -1.0, 4.67, 3.26)],
        mirrored: false,
        pushes: None,
    }
}

/// Thigh and shank with foot of 75 kg: mass, centre of mass, inertia about it.
fn limb() -> [(f64, [f64; 2], f64); 2] {
    let kg = 75.0;
    [
        joined(&[(0.1 * kg, [0.433 * 0.39, 0.0], 0.1 * kg * (0.323 * 0.39_f64).powi(2))]),
        joined(&[
            (0.0465 * kg, [0.433 * 0.40, 0.0], 0.0465 * kg * (0.302 * 0.40_f64).powi(2)),
            (0.0145 * kg, [0.40, 0.083], 0.0145 * kg * (0.475 * 0.27_f64).powi(2)),
        ]),
    ]
}

fn firm(distance: f64) -> CuffDescription {
    let k: f64 = option_env!("CUFFK").unwrap_or("20e3").parse().unwrap();
    let d: f64 = option_env!("CUFFD").unwrap_or("400").parse().unwrap();
    CuffDescription {
        distance,
        along: hal_sim::wearer::description::CuffSpring { stiffness: k / 4.0, damping: d / 4.0, play: 0.0 },
        across: hal_sim::wearer::description::CuffSpring { stiffness: k, damping: d, play: 0.0 },
    }
}

fn person(insisting: bool) -> WearerDescription {
    let [thigh, shank] = limb().map(|(mass, com, inertia_com)| SegmentDescription { mass, com, inertia_com });
    let muscles = if insisting {
        let stiff = |stiffness: f64, damping: f64| MuscleDescription {
            torque_limit: 400.0,
            intrinsic: Impedance { stiffness, damping },
            reflex: Impedance::default(),
            resisting: Impedance { stiffness: 300.0, damping: 20.0 },
        };
        [stiff(2000.0, 60.0), stiff(1500.0, 30.0)]
    } else {
        [MuscleDescription::FIRM_HIP, MuscleDescription::FIRM_KNEE]
    };
    WearerDescription {
        thigh,
        shank,
        thigh_length: 0.39,
        hip_offset: [0.0; 2],
        passive: [PassiveDescription::HIP, PassiveDescription::KNEE],
        muscles,
        neural_delay: 0.07,
        cuffs: [firm(0.28), firm(0.25)],
    }
}

fn parameters(bodies: [BodyDescription; 2], drives: [[f64; 3]; 2]) -> LegParameters<f32, 2> {
    core::array::from_fn(|joint| {
        let body = bodies[joint];
        let [xx, xy, xz, yy, yz, zz] = body.inertia_com;
        let rigid = RigidBody {
            mass: body.mass,
            centre_of_mass: Vector3::from(body.com),
            inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        };
        let mut all = [0.0_f32; 14];
        for (slot, value) in all.iter_mut().zip(rigid.to_parameters()) {
            *slot = value as f32;
        }
        for (slot, value) in all[10..].iter_mut().zip(drives[joint]) {
            *slot = value as f32;
        }
        all
    })
}

const DRIVES: [[f64; 3]; 2] = [[1.9, 4.58, 5.01], [1.9, 4.67, 3.26]];

fn true_model(
    configuration: &LegConfiguration<2, BASE>,
    parameters: &LegParameters<f32, 2>,
) -> IdentifiedModel<2> {
    let values = configuration.model.base.project(parameters);
    let assured = Assured {
        coulomb_nm: [parameters[0][11], parameters[1][11]],
        viscous: [parameters[0][12], parameters[1][12]],
        inertia_share: 1.0,
    };
    IdentifiedModel::new(&configuration.model, &values).with_assured(assured)
}

struct Bench {
    leg: Box<DeviceLeg>,
    world: World<2>,
    sample: Sample<2>,
}

const GRAVITY: [f32; 3] = [9.81, 0.0, 0.0];

impl Bench {
    fn new(wearer: &WearerDescription, posture: [f64; 2]) -> Self {
        let configuration: LegConfiguration<2, BASE> = x2::LEG.configuration().expect("shipped");
        let mut leg = Box::new(DeviceLeg::new(&configuration).expect("shipped"));
        let description = exoskeleton();
        let bodies = description.joints.map(|joint| joint.body);
        let empty = parameters(bodies, DRIVES);
        let limbs = limb();
        let joint_worn = core::array::from_fn(|joint| {
            let (mass, com, inertia) = joined(&[
                (
                    bodies[joint].mass,
                    [bodies[joint].com[0], bodies[joint].com[1]],
                    bodies[joint].inertia_com[5],
                ),
                limbs[joint],
            ]);
            body(mass, com, inertia)
        });
        let worn = parameters(joint_worn, DRIVES);
        assert!(leg.set_model(Wearing::Empty, true_model(&configuration, &empty)));
        assert!(leg.set_model(Wearing::Worn, true_model(&configuration, &worn)));
        let mut world = World::new(&description, 1);
        world.place(&posture);
        world.wear(wearer).expect("a hip and a knee");
        let sample = scarab::hal::LegDrives::sample(&mut world);
        Self { leg, world, sample }
    }

    fn tick(&mut self, request: Option<ControlRequest>) -> ControlOutput<2> {
        let output = self.leg.tick(&self.sample, request, GRAVITY, 0);
        self.sample = self.world.tick(output.servo.drive());
        output
    }

    fn enable(&mut self) {
        self.tick(None);
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            self.tick(Some(ControlRequest::Power(power)));
        }
        assert!(self.leg.control().state().is_enabled());
    }
}

#[derive(Default, Debug)]
struct Rms {
    interaction: [f64; 2],
    muscle: [f64; 2],
    error: [f64; 2],
    energy: f64,
    damping: f64,
}

fn measure(bench: &mut Bench, seconds: f64) -> Rms {
    let mut rms = Rms::default();
    let ticks = (seconds * 4000.0) as u32;
    for _ in 0..ticks {
        bench.tick(None);
        let truth = bench.world.wearer_truth().expect("worn");
        for joint in 0..2 {
            rms.interaction[joint] += truth.interaction_torque[joint].powi(2);
            rms.muscle[joint] += truth.muscle_torque[joint].powi(2);
            if let Some(intended) = truth.intended {
                rms.error[joint] += (intended.position[joint] - truth.position[joint]).powi(2);
            }
        }
        if let Some(energy) = bench.leg.law().energy() {
            rms.energy = rms.energy.max(f64::from(energy.given_j()));
            rms.damping = rms.damping.max(f64::from(energy.damping()));
        }
    }
    let mean = |sum: f64| (sum / f64::from(ticks)).sqrt();
    Rms {
        interaction: rms.interaction.map(mean),
        muscle: rms.muscle.map(mean),
        error: rms.error.map(mean),
        ..rms
    }
}

#[test]
fn try_it() {
    let gait = |hz: f64| {
        IntendedMotion::Gait(Gait {
            offset: [0.33, 0.5],
            scale: [f64::min(0.7, 0.45 / hz); 2],
            ..Gait::at_cadence(hz)
        })
    };
    let motions = [
        ("gait 0.5", gait(0.5)),
        ("gait 0.8", gait(0.8)),
        ("gait 1.2", gait(1.2)),
        (
            "kick",
            IntendedMotion::Strokes(Strokes {
                postures: [[0.5, 1.3], [0.5, 0.5]],
                durations: [0.5, 0.05, 0.6, 0.2],
            }),
        ),
    ];
    for (name, motion) in motions {
        for (label, shares) in [
            ("off", None),
            ("gravity", Some(AssistShares::GRAVITY_ONLY)),
            ("friction", Some(AssistShares { friction: 1.0, ..AssistShares::GRAVITY_ONLY })),
            ("50 %", Some(AssistShares { friction: 1.0, inertia: 0.5, ..AssistShares::GRAVITY_ONLY })),
            ("70 %", Some(AssistShares { friction: 1.0, inertia: 0.7, ..AssistShares::GRAVITY_ONLY })),
            ("80 %", Some(AssistShares { friction: 1.0, inertia: 0.8, ..AssistShares::GRAVITY_ONLY })),
        ] {
            let mut bench = Bench::new(&person(true), [0.5, 0.6]);
            if let Some(shares) = shares {
                bench.enable();
                let output = bench.tick(Some(ControlRequest::Assist(shares)));
                assert!(!output.refused);
            }
            bench.world.intend(Intention::Follow(motion)).expect("a valid motion");
            let _ = measure(&mut bench, 4.0);
            let rms = measure(&mut bench, 10.0);
            println!(
                "{name} {label:9} interaction {:6.2} {:6.2}  muscle {:6.2} {:6.2}  error {:.4} {:.4}  energy {:.2} b {:.1} {:?}",
                rms.interaction[0],
                rms.interaction[1],
                rms.muscle[0],
                rms.muscle[1],
                rms.error[0],
                rms.error[1],
                rms.energy,
                rms.damping,
                bench.leg.control().state(),
            );
        }
    }
}

#[test]
fn energy_compared() {
    let gait = |hz: f64| {
        IntendedMotion::Gait(Gait {
            offset: [0.33, 0.5],
            scale: [f64::min(0.7, 0.45 / hz); 2],
            ..Gait::at_cadence(hz)
        })
    };
    let mut bench = Bench::new(&person(true), [0.5, 0.6]);
    bench.enable();
    bench.tick(Some(ControlRequest::Assist(AssistShares::GRAVITY_ONLY)));
    bench.world.intend(Intention::Follow(gait(0.8))).expect("a valid motion");
    let mut low = f64::INFINITY;
    for tick in 0..40_000 {
        let output = bench.tick(None);
        let truth = bench.world.wearer_truth().expect("worn");
        let given: f64 = truth.cuffs.iter().map(|cuff| cuff.given).sum();
        low = low.min(given);
        if tick % 400 == 0 {
            let position = bench.world.truth().position;
            println!(
                "{:.2} true {:.3} above low {:.3} observer {:.3} torque {:.1?} q {:.2?} {:?} limits {:?}",
                f64::from(tick) / 4000.0,
                given,
                given - low,
                bench.leg.law().energy().map_or(-1.0, |energy| energy.given_j()),
                output.servo.decision.torque,
                position,
                bench.leg.control().activity(),
                output.servo.decision.limited,
            );
        }
    }
}

#[test]
fn weight() {
    let extension = IntendedMotion::Strokes(Strokes {
        postures: [[0.6, 1.4], [0.6, 0.5]],
        durations: [1.5, 0.5, 2.0, 1.0],
    });
    for share in [0.0, 0.5, 1.0] {
        let mut bench = Bench::new(&person(true), [0.5, 1.0]);
        bench.enable();
        let shares =
            AssistShares { friction: 1.0, inertia: 0.5, weight: share, ..AssistShares::GRAVITY_ONLY };
        assert!(!bench.tick(Some(ControlRequest::Assist(shares))).refused);
        bench.world.intend(Intention::Follow(extension)).expect("valid");
        let _ = measure(&mut bench, 5.0);
        println!("weight {share}: {:.2?}", measure(&mut bench, 20.0));
    }
}

#[test]
fn periodic() {
    let gait = |hz: f64| {
        IntendedMotion::Gait(Gait {
            offset: [0.33, 0.5],
            scale: [f64::min(0.7, 0.45 / hz); 2],
            ..Gait::at_cadence(hz)
        })
    };
    for hz in [0.5, 0.8, 1.2] {
        for share in [0.0, 0.3, -0.3] {
            let mut bench = Bench::new(&person(true), [0.5, 0.6]);
            bench.enable();
            let shares =
                AssistShares { friction: 1.0, inertia: 0.8, periodic: share, ..AssistShares::GRAVITY_ONLY };
            assert!(!bench.tick(Some(ControlRequest::Assist(shares))).refused);
            bench.world.intend(Intention::Follow(gait(hz))).expect("valid");
            for second in 0..6 {
                let _ = measure(&mut bench, 1.0);
                if let Some(periodic) = bench.leg.law().periodic() {
                    print!(
                        "{second}: gate {:.2} f {:.3} share {:.2}; ",
                        periodic.gate(),
                        periodic.oscillator().hertz(),
                        periodic.oscillator().predicted_share()
                    );
                }
            }
            println!();
            println!(
                "gait {hz} periodic {share}: {:.2?} {:?}",
                measure(&mut bench, 10.0),
                bench.leg.control().activity()
            );
            if let Some(periodic) = bench.leg.law().periodic() {
                println!("    {:?} gate {:.2}", periodic.oscillator().hertz(), periodic.gate());
            }
        }
    }
}

#[test]
fn limp() {
    let gait = |hz: f64| {
        IntendedMotion::Gait(Gait {
            offset: [0.33, 0.5],
            scale: [f64::min(0.7, 0.45 / hz); 2],
            ..Gait::at_cadence(hz)
        })
    };
    for (label, shares) in [
        ("transparent", AssistShares { friction: 1.0, inertia: 0.8, ..AssistShares::GRAVITY_ONLY }),
        ("weight", AssistShares { friction: 1.0, inertia: 0.8, weight: 0.5, ..AssistShares::GRAVITY_ONLY }),
        (
            "periodic",
            AssistShares { friction: 1.0, inertia: 0.8, periodic: 0.5, ..AssistShares::GRAVITY_ONLY },
        ),
    ] {
        for after in [Intention::Limp, Intention::Resist] {
            let mut bench = Bench::new(&person(false), [0.5, 0.6]);
            bench.enable();
            assert!(!bench.tick(Some(ControlRequest::Assist(shares))).refused);
            bench.world.intend(Intention::Follow(gait(0.8))).expect("valid");
            let _ = measure(&mut bench, 9.7);
            bench.world.intend(after).expect("worn");
            println!("{label} {after:?}");
            let received = |bench: &Bench| -> f64 {
                bench.world.wearer_truth().expect("worn").cuffs.iter().map(|cuff| cuff.received).sum()
            };
            let mut last = received(&bench);
            for _ in 0..8 {
                let rms = measure(&mut bench, 1.25);
                let now = received(&bench);
                let velocity = bench.world.velocity();
                print!(
                    "  given {:.2} J e {:.2} gate {:.2} v {:.2?}",
                    now - last,
                    rms.energy,
                    bench.leg.law().periodic().map_or(0.0, |p| p.gate()),
                    velocity
                );
                last = now;
            }
            println!(" {:?}", bench.leg.control().activity());
        }
    }
}
