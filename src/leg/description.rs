//! A leg as plain numbers: what an image holds as a constant, and the configuration that follows from it.
//!
//! Why apart from [`LegConfiguration`]: that one is made by code (base parameters are found by asking the chain, motions are
//! rounded to ticks) and may refuse; a constant has to be plain data. The host writes this constant from a leg file, and a test holds that
//! the configuration made from it is the one the simulation runs with.
//!
//! Cost: the base parameters, some ten million instructions once at the start.

use nalgebra::{Matrix3, Vector3};

use super::activity::VALIDATION_MOTIONS;
use super::configuration::LegConfiguration;
use crate::ident::{Choice, DriveChoice, Estimator, LinkPrior, MonitorSettings, Plan, RowModel, Thresholds};
use crate::model::{
    AnatomicalJoint, BaseParameters, Chain, ColumnMask, DenavitHartenberg, PARAMETERS_PER_JOINT, Parameter,
    RigidBody,
};
use crate::motion::{ExcitationTable, MotionError, Periodic};
use crate::servo::{JointConfiguration, JointScale, SERVO_RATE_HZ};
use crate::units::{
    Ampere, Hertz, KilogramMetreSquared, NewtonMetre, NewtonMetrePerAmpere, Radian, RadianPerSecond,
    RadianPerSecondSquared, Weber,
};

/// One joint; angles and limits are the model's (D-H).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointDescription {
    /// Geometry: m, rad.
    pub geometry: DenavitHartenberg<f32>,
    /// 1 or -1: how the model's angle runs with the anatomical one.
    pub direction: i32,
    /// The model's angle at the anatomical zero, rad.
    pub zero_offset: f32,
    /// The drive is mounted mirrored.
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
    /// Of the position loop.
    pub bandwidth: Hertz,
    /// Which parts of the drive's model are estimated.
    pub drive: DriveChoice,
    /// Whether Stribeck friction is looked for.
    pub stribeck: Choice,
    /// Motor, encoder and gear.
    pub motor: MotorDescription,
}

/// What drives a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorDescription {
    /// Of the motor.
    pub pole_pairs: u8,
    /// Flux linkage of its magnets.
    pub flux: Weber,
    /// Of the encoder at the motor.
    pub counts_per_turn: u32,
    /// Motor turns per joint turn.
    pub ratio: f32,
}

/// What is believed of one link and its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkDescription {
    /// kg.
    pub mass: f32,
    /// In the joint's frame, m.
    pub centre_of_mass: [f32; 3],
    /// About the centre of mass, row by row, kg m^2.
    pub inertia: [[f32; 3]; 3],
    /// At the joint, kg m^2.
    pub rotor_inertia: f32,
    /// N m.
    pub coulomb_friction: f32,
    /// N m s/rad.
    pub viscous_friction: f32,
    /// N m.
    pub offset: f32,
}

/// A leg; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegDescription<const N: usize> {
    /// For the reader of a trace.
    pub name: &'static str,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: [f32; 3],
    /// Proximal first.
    pub joints: [JointDescription; N],
    /// What is believed before measuring, if anything.
    pub prior: Option<[LinkDescription; N]>,
    /// One-time or sequential.
    pub plan: Plan,
    /// Of the swarm.
    pub swarm_seed: u64,
    /// Robust or plain.
    pub estimator: Estimator,
    /// Of the identification's low-pass, Hz.
    pub bandwidth_hz: f32,
    /// The motion identified from.
    pub excitation: ExcitationTable<N>,
    /// The motions predicted.
    pub validation: [ExcitationTable<N>; VALIDATION_MOTIONS],
}

/// Why a description makes no leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptionError {
    /// A D-H number is not finite.
    Geometry,
    /// Direction or zero offset of this joint (from 0).
    Anatomy {
        /// Counted from 0.
        joint: usize,
    },
    /// The base parameters cannot be told apart, or are more than there is room for.
    Base,
    /// A motion's numbers make no sense.
    Motion(MotionError),
}

impl From<MotionError> for DescriptionError {
    fn from(error: MotionError) -> Self {
        Self::Motion(error)
    }
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
    /// What the leg is built from.
    ///
    /// # Errors
    /// The first part that makes no sense; limits and motions are judged when the leg is built.
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
        let excitation = self.excitation.motion(SERVO_RATE_HZ)?;
        let mut validation: [Periodic<N>; VALIDATION_MOTIONS] = [excitation; VALIDATION_MOTIONS];
        for (slot, table) in validation.iter_mut().zip(&self.validation) {
            *slot = table.motion(SERVO_RATE_HZ)?;
        }
        Ok(LegConfiguration {
            joints,
            acceleration: self.joints.map(|joint| joint.acceleration),
            model: RowModel {
                stribeck_choice: self.joints.map(|joint| joint.stribeck),
                drive_choice: self.joints.map(|joint| joint.drive),
                ..RowModel::new(chain, gravity, base)
            },
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
