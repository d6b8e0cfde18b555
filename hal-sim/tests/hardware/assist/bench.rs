//! Firmware, exoskeleton and wearer, ticked together.

use crate::plant::common::{self, DRIVES, Lengths, joined, limb, limb_segments};
use hal_sim::description::{BodyDescription, DriveDescription, EncoderDescription, LegDescription};
use hal_sim::wearer::WearerTruth;
use hal_sim::wearer::description::{
    CuffDescription, CuffSpring, Impedance, MuscleDescription, WearerDescription,
};
use hal_sim::wearer::muscles::Intention;
use hal_sim::world::World;
use nalgebra::{Matrix3, Vector3};
use scarab::hal::{LegDrives, Sample};
use scarab::leg::{
    Activity, AssistPhase, AssistShares, Assured, BASE, ControlOutput, ControlRequest, IdentifiedModel,
    JOINTS, Leg, LegConfiguration, PowerRequest, Wearing,
};
use scarab::model::{LegParameters, Parameter, RigidBody};

/// Servo ticks per second.
pub const SECOND: u32 = 4000;
const GRAVITY: [f32; 3] = [9.81, 0.0, 0.0];
/// Lengths of the default leg.
const LENGTHS: Lengths = [0.39, 0.40, 0.27];

/// The exoskeleton with the drives and encoders of the device.
pub fn exoskeleton() -> LegDescription<2> {
    let mut description = common::exoskeleton(LENGTHS);
    for joint in &mut description.joints {
        joint.drive = DriveDescription { torque_per_ampere: 1.5, current_limit: 57.0, lag: 1e-3 };
        joint.encoder = EncoderDescription { counts: 8192.0, ratio: 50.0 };
    }
    description
}

/// Cuff that yields 5 mm across and 20 mm along under 100 N; firmer than the plant's padded one, whose
/// resonance with a rotor's inertia of 1.9 kg m^2 lies within a gait's harmonics.
pub fn firm_cuff(distance: f64) -> CuffDescription {
    let spring = |stiffness: f64, damping: f64| CuffSpring { stiffness, damping, play: 0.0 };
    CuffDescription { distance, along: spring(5e3, 100.0), across: spring(20e3, 400.0) }
}

/// A wearer of 75 kg with firm muscles.
pub fn person() -> WearerDescription {
    let muscles = [MuscleDescription::FIRM_HIP, MuscleDescription::FIRM_KNEE];
    WearerDescription::aligned(
        limb_segments(LENGTHS),
        LENGTHS[0],
        muscles,
        [firm_cuff(0.28), firm_cuff(0.25)],
    )
}

/// A wearer who moves as intended, whatever the exoskeleton does: experiments with and without assistance
/// then compare the same motion.
pub fn insisting() -> WearerDescription {
    let stiff = |stiffness: f64, damping: f64| MuscleDescription {
        torque_limit: 400.0,
        intrinsic: Impedance { stiffness, damping },
        reflex: Impedance::default(),
        ..MuscleDescription::FIRM_HIP
    };
    WearerDescription { muscles: [stiff(2000.0, 60.0), stiff(1500.0, 30.0)], ..person() }
}

fn parameters(bodies: [BodyDescription; 2]) -> LegParameters<f32, 2> {
    core::array::from_fn(|joint| {
        let BodyDescription { mass, com, inertia_com: [xx, xy, xz, yy, yz, zz] } = bodies[joint];
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let body = RigidBody { mass, centre_of_mass: Vector3::from(com), inertia };
        let mut all = [0.0_f32; 14];
        for (slot, value) in all.iter_mut().zip(body.to_parameters().into_iter().chain(DRIVES[joint])) {
            *slot = value as f32;
        }
        all
    })
}

/// Model with these parameters, all of them certain.
fn certain(
    configuration: &LegConfiguration<2, BASE>,
    parameters: &LegParameters<f32, 2>,
) -> IdentifiedModel<2> {
    let of = |parameter: Parameter| parameters.map(|joint| joint[parameter.index()]);
    let assured = Assured { coulomb_nm: of(Parameter::FC), viscous: of(Parameter::FV), inertia_share: 1.0 };
    let values = configuration.model.base.project(parameters);
    IdentifiedModel::new(&configuration.model, &values).with_assured(assured)
}

/// True models of the empty and the worn leg; friction of the first times a factor.
pub fn models(friction: f32) -> [IdentifiedModel<2>; 2] {
    let configuration: LegConfiguration<2, BASE> = super::x2::LEG.configuration().expect("shipped");
    let own = exoskeleton().joints.map(|joint| joint.body);
    let mut empty = parameters(own);
    for joint in &mut empty {
        for parameter in [Parameter::FC, Parameter::FV] {
            joint[parameter.index()] *= friction;
        }
    }
    let limb = limb(LENGTHS);
    let worn = parameters([0, 1].map(|joint| joined(&own[joint], &limb[joint])));
    [certain(&configuration, &empty), certain(&configuration, &worn)]
}

/// The device's leg.
type DeviceLeg = Leg<JOINTS, BASE, 256, 26>;

/// Firmware, exoskeleton and wearer.
#[derive(Clone)]
pub struct Bench {
    pub leg: Box<DeviceLeg>,
    pub world: World<2>,
    sample: Sample<2>,
}

/// Root mean squares over some time.
#[derive(Debug)]
pub struct Measured {
    /// Interaction torque, N m.
    pub interaction: [f64; 2],
    /// Torque of the muscles, N m.
    pub muscle: [f64; 2],
    /// Intended minus actual angle of the wearer, rad.
    pub deviation: [f64; 2],
}

impl Bench {
    /// An enabled leg on a limp wearer, with the true models.
    pub fn enabled(wearer: &WearerDescription, posture: [f64; 2]) -> Self {
        let mut bench = Self::off(wearer, posture);
        let [empty, worn] = models(1.0);
        assert!(bench.leg.set_model(Wearing::Empty, empty) && bench.leg.set_model(Wearing::Worn, worn));
        bench.power_up();
        assert!(bench.leg.control().state().is_enabled());
        bench
    }

    /// A leg without models on a limp wearer, drive off.
    pub fn off(wearer: &WearerDescription, posture: [f64; 2]) -> Self {
        let configuration: LegConfiguration<2, BASE> = super::x2::LEG.configuration().expect("shipped");
        let leg = Box::new(DeviceLeg::new(&configuration).expect("shipped"));
        let mut world = World::new(&exoskeleton(), 1);
        world.move_to(&posture);
        world.wear(wearer).expect("a leg of hip and knee");
        let sample = world.sample();
        Self { leg, world, sample }
    }

    /// A session with these shares, faded in, with the wearer limp.
    pub fn assisting(wearer: &WearerDescription, posture: [f64; 2], shares: AssistShares) -> Self {
        let mut bench = Self::enabled(wearer, posture);
        bench.begin(shares);
        bench.run(SECOND + 100);
        assert_eq!(bench.leg.control().activity(), Activity::Assist(AssistPhase::Run));
        bench
    }

    pub fn power_up(&mut self) {
        self.tick(None);
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            self.tick(Some(ControlRequest::Power(power)));
        }
    }

    pub fn begin(&mut self, shares: AssistShares) {
        assert!(!self.tick(Some(ControlRequest::Assist(shares))).refused);
    }

    pub fn tick(&mut self, request: Option<ControlRequest>) -> ControlOutput<2> {
        let output = self.leg.tick(&self.sample, request, GRAVITY, 0);
        self.sample = self.world.tick(output.servo.drive());
        output
    }

    pub fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick(None);
        }
    }

    pub fn intend(&mut self, intention: Intention) {
        self.world.intend(intention).expect("a valid motion of a worn leg");
    }

    pub fn wearer(&self) -> WearerTruth {
        self.world.wearer_truth().expect("worn")
    }

    /// Energy that the wearer has received through the cuffs, J.
    pub fn received_j(&self) -> f64 {
        self.wearer().cuffs.iter().map(|cuff| cuff.received).sum()
    }

    pub fn assists(&self) -> bool {
        self.leg.control().activity().assists()
    }

    /// Measures for some ticks.
    pub fn measure(&mut self, ticks: u32) -> Measured {
        let mut sums = [[0.0; 2]; 3];
        for _ in 0..ticks {
            self.tick(None);
            let truth = self.wearer();
            let intended = truth.intended.map_or(truth.position, |intended| intended.position);
            for joint in 0..2 {
                sums[0][joint] += truth.interaction_torque[joint].powi(2);
                sums[1][joint] += truth.muscle_torque[joint].powi(2);
                sums[2][joint] += (intended[joint] - truth.position[joint]).powi(2);
            }
        }
        let [interaction, muscle, deviation] =
            sums.map(|pair| pair.map(|sum| (sum / f64::from(ticks)).sqrt()));
        Measured { interaction, muscle, deviation }
    }
}
