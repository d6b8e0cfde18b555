//! A leg as plain numbers: constant data of an image, from which its configuration is made.
//!
//! Why apart from [`LegConfiguration`]: that one is computed and can fail. Its base parameters come from an
//! analysis of the chain, and its motions are rounded to ticks. A constant must be plain data. The host
//! writes it from a leg file; a test checks that its configuration equals that of the simulation.
//!
//! Cost: the analysis of the base parameters, about ten million instructions once at the start.

use nalgebra::{Matrix3, Vector3};

use super::activity::VALIDATION_MOTIONS;
use super::configuration::LegConfiguration;
use crate::assist::AssistShares;
use crate::ident::{Choice, DriveChoice, Estimator, LinkPrior, MonitorSettings, Plan, RowModel, Thresholds};
use crate::model::{
    AnatomicalJoint, BaseParameters, Chain, ColumnMask, DenavitHartenberg, PARAMETERS_PER_JOINT, Parameter,
    RigidBody,
};
use crate::motion::{ExcitationTable, MotionError, Periodic};
use crate::motor::AbsoluteEncoders;
use crate::safety::{BrakeDelays, SupplyLimits, Thermistor, WindingRating};
use crate::servo::{JointConfiguration, JointScale, SERVO_RATE_HZ};
use crate::units::{
    Ampere, Hertz, KilogramMetreSquared, NewtonMetre, NewtonMetrePerAmpere, Radian, RadianPerSecond,
    RadianPerSecondSquared, Weber,
};

/// One joint. Angles and limits are the model's (D-H).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointDescription {
    /// Denavit-Hartenberg geometry in m and rad.
    pub geometry: DenavitHartenberg<f32>,
    /// 1 or -1: direction of the model's angle relative to the anatomical one.
    pub direction: i32,
    /// The model's angle at the anatomical zero, rad.
    pub zero_offset: f32,
    /// Whether the drive is mounted mirrored.
    pub mirrored: bool,
    /// Joint angle per encoder count.
    pub radian_per_count: Radian,
    /// Joint torque per motor current.
    pub torque_per_ampere: NewtonMetrePerAmpere,
    /// Smallest and largest angle.
    pub range: [Radian; 2],
    /// Largest speed.
    pub speed: RadianPerSecond,
    /// Largest acceleration.
    pub acceleration: RadianPerSecondSquared,
    /// Largest torque.
    pub torque: NewtonMetre,
    /// Largest motor current.
    pub current: Ampere,
    /// Largest inertia the joint moves.
    pub inertia: KilogramMetreSquared,
    /// Bandwidth of the position loop.
    pub bandwidth: Hertz,
    /// Parts of the drive's model that are estimated.
    pub drive: DriveChoice,
    /// Whether Stribeck friction is estimated.
    pub stribeck: Choice,
    /// Motor, encoder and gear.
    pub motor: MotorDescription,
}

/// Motor, encoder and gear of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorDescription {
    /// Pole pairs of the motor.
    pub pole_pairs: u8,
    /// Flux linkage of the magnets.
    pub flux: Weber,
    /// Encoder counts per motor revolution.
    pub counts_per_turn: u32,
    /// Motor revolutions per joint revolution.
    pub ratio: f32,
    /// Thermal constants of the winding.
    pub winding: WindingRating,
    /// Thermistor in the winding, if there is one.
    pub thermistor: Option<Thermistor>,
    /// Permitted travel of a calibration, motor turns.
    pub calibration_turns: f32,
    /// Absolute encoders.
    pub absolute: AbsoluteEncoders,
}

impl MotorDescription {
    /// Joint angle of one count, rad.
    pub(crate) fn step_rad(&self) -> f32 {
        core::f32::consts::TAU / (self.counts_per_turn as f32 * self.ratio)
    }
}

/// Prior knowledge of one link and its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkDescription {
    /// Mass, kg.
    pub mass: f32,
    /// Centre of mass in the joint's frame, m.
    pub centre_of_mass: [f32; 3],
    /// Inertia about the centre of mass, row by row, kg m^2.
    pub inertia: [[f32; 3]; 3],
    /// Rotor inertia at the joint, kg m^2.
    pub rotor_inertia: f32,
    /// Coulomb friction, N m.
    pub coulomb_friction: f32,
    /// Viscous friction, N m s/rad.
    pub viscous_friction: f32,
    /// Torque offset, N m.
    pub offset: f32,
}

/// Description of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegDescription<const N: usize> {
    /// Name, shown in traces.
    pub name: &'static str,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: [f32; 3],
    /// Limits of the supply.
    pub supply: SupplyLimits,
    /// Delays of the holding brake, if there is one.
    pub holding_brake: Option<BrakeDelays>,
    /// Shares of the assistance that the start button of the enabled leg begins and ends; `None` lets it
    /// identify.
    pub assist: Option<AssistShares>,
    /// Joints, proximal first.
    pub joints: [JointDescription; N],
    /// Prior knowledge of links and drives, if any.
    pub prior: Option<[LinkDescription; N]>,
    /// One-time or sequential identification.
    pub plan: Plan,
    /// Seed of the swarm's random numbers.
    pub swarm_seed: u64,
    /// Robust or plain estimator.
    pub estimator: Estimator,
    /// Bandwidth of the identification's low-pass, Hz.
    pub bandwidth_hz: f32,
    /// Training motion.
    pub excitation: ExcitationTable<N>,
    /// Validation motions.
    pub validation: [ExcitationTable<N>; VALIDATION_MOTIONS],
}

/// Reason why a description is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptionError {
    /// A D-H number is not finite.
    Geometry,
    /// Direction or zero offset of this joint.
    Anatomy {
        /// Index of the joint, from 0.
        joint: usize,
    },
    /// The base parameters cannot be separated, or exceed the capacity.
    Base,
    /// A motion is invalid.
    Motion(MotionError),
}

impl JointDescription {
    fn configuration(&self, joint: usize) -> Result<JointConfiguration, DescriptionError> {
        let anatomy = AnatomicalJoint::new(self.direction, self.zero_offset)
            .map_err(|_| DescriptionError::Anatomy { joint })?;
        Ok(JointConfiguration {
            scale: JointScale {
                radian_per_count: self.radian_per_count,
                anatomy,
                mirrored: self.mirrored,
                torque_per_ampere: self.torque_per_ampere,
            },
            low: self.range[0],
            high: self.range[1],
            speed: self.speed,
            torque: self.torque,
            current: self.current,
            inertia: self.inertia,
            bandwidth: self.bandwidth,
        })
    }

    fn columns(&self) -> [bool; PARAMETERS_PER_JOINT] {
        let mut columns = [true; PARAMETERS_PER_JOINT];
        columns[Parameter::OFF.index()] = self.drive.constant.is_possible();
        columns[Parameter::IA.index()] = self.drive.rotor.is_possible();
        columns
    }
}

impl LinkDescription {
    fn prior(&self) -> LinkPrior<f32> {
        LinkPrior {
            body: RigidBody {
                mass: self.mass,
                centre_of_mass: Vector3::from(self.centre_of_mass),
                inertia: Matrix3::from_row_slice(self.inertia.as_flattened()),
            },
            rotor_inertia: self.rotor_inertia,
            coulomb_friction: self.coulomb_friction,
            viscous_friction: self.viscous_friction,
            offset: self.offset,
        }
    }
}

impl<const N: usize> LegDescription<N> {
    /// Computes the leg's configuration.
    ///
    /// # Errors
    /// [`DescriptionError`] names the first invalid part. Limits and motions are checked when the leg is
    /// built.
    #[inline(never)]
    pub fn configuration<const B: usize>(&self) -> Result<LegConfiguration<N, B>, DescriptionError> {
        let geometry = self.joints.map(|joint| joint.geometry);
        let chain = Chain::new(&geometry).map_err(|_| DescriptionError::Geometry)?;
        let gravity = Vector3::from(self.gravity);
        let columns: ColumnMask<N> = self.joints.map(|joint| joint.columns());
        let base = BaseParameters::analyse(&chain, &gravity, &columns).map_err(|_| DescriptionError::Base)?;
        let first = self.joints.first().ok_or(DescriptionError::Geometry)?.configuration(0)?;
        let mut joints = [first; N];
        for (joint, (slot, description)) in joints.iter_mut().zip(&self.joints).enumerate() {
            *slot = description.configuration(joint)?;
        }
        let excitation = self.excitation.motion(SERVO_RATE_HZ).map_err(DescriptionError::Motion)?;
        let mut validation: [Periodic<N>; VALIDATION_MOTIONS] = [excitation; VALIDATION_MOTIONS];
        for (slot, table) in validation.iter_mut().zip(&self.validation) {
            *slot = table.motion(SERVO_RATE_HZ).map_err(DescriptionError::Motion)?;
        }
        let mut model = RowModel {
            stribeck_choice: self.joints.map(|joint| joint.stribeck),
            drive_choice: self.joints.map(|joint| joint.drive),
            ..RowModel::new(chain, gravity, base)
        };
        model.set_encoders(&self.joints.map(|joint| joint.motor.step_rad()), self.bandwidth_hz);
        Ok(LegConfiguration {
            joints,
            acceleration: self.joints.map(|joint| joint.acceleration),
            model,
            prior: self.prior.map(|links| links.map(|link| link.prior())),
            plan: self.plan,
            swarm_seed: self.swarm_seed,
            thresholds: Thresholds::default(),
            monitor: MonitorSettings::default(),
            estimator: self.estimator,
            bandwidth_hz: self.bandwidth_hz,
            excitation,
            validation,
        })
    }
}
