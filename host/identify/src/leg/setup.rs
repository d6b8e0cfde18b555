//! Converts a leg file to the firmware's configuration.

use core::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::ident::{
    Choice, DriveChoice, Estimator, LinkPrior, MonitorSettings, Plan, RowModel, Thresholds, prior_parameters,
};
use scarab::leg::LegConfiguration;
use scarab::model::{
    BaseError, BaseParameters, Chain, ColumnMask, LegParameters, PARAMETERS_PER_JOINT, Parameter, RigidBody,
    is_physically_consistent, mass_matrix,
};
use scarab::motion::JointEnvelope;
use scarab::real::Real;
use scarab::servo::{JointConfiguration, JointScale};
use scarab::units::{
    Ampere, KilogramMetreSquared, NewtonMetre, NewtonMetrePerAmpere, Radian, RadianPerSecond,
    RadianPerSecondSquared,
};
use scarab_base::error::FileError;

use crate::formats::leg_file::geometry::{anatomy, chain};
use crate::formats::leg_file::{BodySide, JointFile, LegFile, LinkParameters, POSITION_BANDWIDTH};
use crate::leg::background::{Background, StribeckTruth};
use crate::leg::link_body::body;
use crate::leg::model_choice::{TermSwitches, drive_choice, stribeck_choice};
use crate::leg::motions::{Motions, motions};

/// Default seed.
pub const DEFAULT_SEED: u64 = 1;

/// Prior of an identification.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PriorChoice {
    /// Prior of the leg file if present, else none.
    #[default]
    Default,
    /// No prior.
    None,
    /// Prior of the leg file.
    File,
    /// Truth with an error of this percentage.
    Wrong(f64),
}

impl core::str::FromStr for PriorChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.strip_prefix("wrong:")) {
            ("none", _) => Ok(Self::None),
            ("file", _) => Ok(Self::File),
            (_, Some(percent)) => match percent.parse::<f64>() {
                Ok(percent) if (0.0..100.0).contains(&percent) => Ok(Self::Wrong(percent)),
                _ => Err(format!("`{percent}` is not a percentage from 0 to below 100")),
            },
            _ => Err(format!("`{text}` is not one of none, file, wrong:PERCENT")),
        }
    }
}

/// Selects the capacity for base parameters of a leg of `joints` joints: for two parallel axes, or
/// for any axes.
///
/// Runs `$body` with the constants `N` (joints) and `B` (capacity for base parameters).
#[doc(hidden)]
#[macro_export]
macro_rules! with_leg_size {
    ($leg:expr, $body:ident ( $($argument:expr),* )) => {
        match ($leg.joints.len(), $crate::leg::setup::base_rank($leg)) {
            (1, _) => $body::<1, 6>($($argument),*),
            (2, 0..=13) => $body::<2, 13>($($argument),*),
            (2, _) => $body::<2, 18>($($argument),*),
            _ => $body::<3, 28>($($argument),*),
        }
    };
}

/// Number of base parameters of a leg of two joints; zero for another number, or if they cannot be found.
pub fn base_rank(leg: &LegFile) -> usize {
    row_model::<2, 18>(leg).map_or(0, |model| model.base.rank())
}

/// Whether a leg file can be used for a replay.
///
/// # Errors
/// Names what a replay lacks.
pub fn check_background(leg: &LegFile) -> Result<(), FileError> {
    fn check<const N: usize, const B: usize>(leg: &LegFile) -> Result<(), FileError> {
        background::<N, B>(leg, PriorChoice::Default, DEFAULT_SEED).map(drop)
    }
    with_leg_size!(leg, check(leg))
}

/// Whether a leg file can be simulated, with the firmware in control.
///
/// # Errors
/// Names what a simulation lacks.
pub fn check_simulation(leg: &LegFile) -> Result<(), FileError> {
    fn check<const N: usize, const B: usize>(leg: &LegFile) -> Result<(), FileError> {
        let background = background::<N, B>(leg, PriorChoice::Default, DEFAULT_SEED)?;
        configuration(leg, &background, Plan::default(), DEFAULT_SEED)?;
        leg.description::<N>().map(drop)
    }
    with_leg_size!(leg, check(leg))
}

/// Columns to be estimated according to a leg file.
pub(crate) fn column_mask<const N: usize>(leg: &LegFile) -> ColumnMask<N> {
    core::array::from_fn(|joint| {
        let mut columns = [true; PARAMETERS_PER_JOINT];
        if let Some(joint) = leg.joints.get(joint) {
            columns[Parameter::OFF.index()] = drive_choice(joint).constant.is_possible();
            columns[Parameter::IA.index()] = drive_choice(joint).rotor.is_possible();
        }
        columns
    })
}

/// Joint angles of one count of the encoders, rad, by the arithmetic of the board's description.
pub(crate) fn encoder_steps<T: Real, const N: usize>(leg: &LegFile) -> [T; N] {
    core::array::from_fn(|joint| {
        leg.joints.get(joint).map_or(T::zero(), |joint| {
            T::from_double(TAU)
                / (T::from_double(f64::from(joint.encoder.counts)) * T::from_double(joint.encoder.ratio))
        })
    })
}

/// Adds the choices that a leg file leaves to the data.
fn chosen<T: Real, const N: usize, const B: usize>(
    leg: &LegFile,
    mut model: RowModel<T, N, B>,
) -> RowModel<T, N, B> {
    let drive = |joint: usize| leg.joints.get(joint).map_or(DriveChoice::ALL, drive_choice);
    let stribeck = |joint: usize| leg.joints.get(joint).map_or(Choice::Off, stribeck_choice);
    model.set_encoders(&encoder_steps(leg), T::from_double(leg.bandwidth_hz));
    RowModel {
        stribeck_choice: core::array::from_fn(stribeck),
        drive_choice: core::array::from_fn(drive),
        ..model
    }
}

/// Geometry, gravity and base parameters of a leg.
pub fn row_model<const N: usize, const B: usize>(leg: &LegFile) -> Result<RowModel<f64, N, B>, FileError> {
    let (chain, gravity) = (chain(leg)?, Vector3::from(leg.gravity));
    let base = BaseParameters::analyse(&chain, &gravity, &column_mask(leg)).map_err(|error| {
        let reason = match error {
            BaseError::TooMany { rank } => format!("{rank} base parameters, at most {B} are supported"),
            BaseError::NothingSeen => "no torque depends on any parameter".into(),
            BaseError::NotFinite => "a number is not finite".into(),
        };
        leg.error(reason)
    })?;
    Ok(chosen(leg, RowModel::new(chain, gravity, base)))
}

/// Row model in the device's precision, analysed in that precision.
pub(crate) fn device_model<const N: usize, const B: usize>(
    leg: &LegFile,
    reference: &RowModel<f64, N, B>,
) -> Result<RowModel<f32, N, B>, FileError> {
    let (chain, gravity) = (reference.chain.convert(), reference.gravity.map(|element| element as f32));
    let base = BaseParameters::analyse(&chain, &gravity, &column_mask(leg))
        .map_err(|_| leg.error("base parameters cannot be distinguished in single precision"))?;
    if (0..B).any(|index| base.independent(index) != reference.base.independent(index)) {
        return Err(leg.error("base parameters differ between single and double precision"));
    }
    Ok(chosen(leg, RowModel::new(chain, gravity, base)))
}

fn link_prior(link: &LinkParameters) -> LinkPrior<f64> {
    LinkPrior {
        body: body(link.mass, link.com, link.inertia_com),
        rotor_inertia: link.rotor_inertia,
        coulomb_friction: link.coulomb,
        viscous_friction: link.viscous,
        offset: link.offset + link.asymmetry,
    }
}

/// `truth` or `prior` of every joint; `None` if one lacks it.
pub fn links<const N: usize>(
    leg: &LegFile,
    of: impl Fn(&JointFile) -> Option<&LinkParameters>,
) -> Option<[LinkPrior<f64>; N]> {
    let links: Option<Vec<_>> = leg.joints.iter().map(|joint| of(joint).map(link_prior)).collect();
    links?.try_into().ok()
}

/// Separates the random signs of a wrong prior from the noise of the same seed.
const PRIOR_STREAM: u64 = 0x0070_7269_6f72;

/// Prior with an error of `percent` in every number, signs from the seed; physically consistent,
/// offset zero.
pub(crate) fn wrong_prior<const N: usize>(
    truth: &[LinkPrior<f64>; N],
    percent: f64,
    seed: u64,
) -> [LinkPrior<f64>; N] {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ PRIOR_STREAM);
    let mut off = |value: f64| {
        let sign = if random.next_u64() >> 63 == 1 { 1.0 } else { -1.0 };
        value * (1.0 + sign * percent / 100.0)
    };
    truth.map(|link| {
        let mass = off(link.body.mass);
        let centre_of_mass = link.body.centre_of_mass.map(&mut off);
        let inertia =
            Matrix3::from_fn(
                |row, column| if row <= column { off(link.body.inertia[(row, column)]) } else { 0.0 },
            );
        let mut inertia = inertia + inertia.transpose() - Matrix3::from_diagonal(&inertia.diagonal());
        // Independent signs may violate the triangle inequality of the principal moments: move
        // towards the truth's shape, which satisfies it.
        for _ in 0..60 {
            let body = RigidBody { mass, centre_of_mass, inertia };
            if is_physically_consistent(&body.to_parameters()) {
                break;
            }
            inertia = inertia * 0.9 + link.body.inertia * 0.1;
        }
        LinkPrior {
            body: RigidBody { mass, centre_of_mass, inertia },
            rotor_inertia: off(link.rotor_inertia),
            coulomb_friction: off(link.coulomb_friction),
            viscous_friction: off(link.viscous_friction),
            offset: 0.0,
        }
    })
}

/// Knowledge of a leg besides its data.
pub fn background<const N: usize, const B: usize>(
    leg: &LegFile,
    prior: PriorChoice,
    seed: u64,
) -> Result<Background<N, B>, FileError> {
    let model = row_model::<N, B>(leg)?;
    let device = device_model(leg, &model)?;
    let truth = links::<N>(leg, |joint| joint.truth.as_ref());
    let from_file = links::<N>(leg, |joint| joint.prior.as_ref());
    let (prior, prior_name) = match prior {
        PriorChoice::None => (None, "none".to_owned()),
        PriorChoice::Default => (from_file, if from_file.is_some() { "file" } else { "none" }.to_owned()),
        PriorChoice::File => {
            (Some(from_file.ok_or_else(|| leg.error("not every joint has a `prior`"))?), "file".to_owned())
        }
        PriorChoice::Wrong(percent) => {
            let truth = truth.ok_or_else(|| {
                leg.error("`--prior wrong` distorts the `truth` of every joint, which is missing")
            })?;
            (Some(wrong_prior(&truth, percent, seed)), format!("wrong:{percent}"))
        }
    };
    let columns = column_mask::<N>(leg).iter().flatten().filter(|on| **on).count();
    Ok(Background {
        leg: leg.name.clone(),
        model,
        device,
        columns,
        prior,
        prior_name,
        truth: truth.map(|truth| prior_parameters(&truth)),
        temperature_c: leg.temperature_c,
        requested: leg.joints.iter().map(TermSwitches::from_joint).collect(),
        stribeck_truth: core::array::from_fn(|joint| stribeck_truth(leg.joints.get(joint)?)),
    })
}

/// Stribeck curve of a simulated joint.
fn stribeck_truth(joint: &JointFile) -> Option<StribeckTruth> {
    let (truth, curve) = (joint.truth?, joint.stribeck?);
    Some(StribeckTruth { surplus: curve.static_nm - truth.coulomb, speed: curve.speed_rad_s })
}

/// Largest inertia moved by each joint, kg m2, over postures of the whole circle.
pub fn largest_inertia<const N: usize>(
    chain: &Chain<f64, N>,
    parameters: &LegParameters<f64, N>,
) -> [f64; N] {
    let mut largest = [0.0_f64; N];
    for step in 0..64 {
        let q = core::array::from_fn(|joint| f64::from(step) * TAU / 64.0 * (joint + 1) as f64);
        let mass = mass_matrix(chain, parameters, &q);
        for joint in 0..N {
            largest[joint] = largest[joint].max(mass[(joint, joint)]);
        }
    }
    largest
}

/// Configuration of the firmware for a leg, and its motions.
pub fn configuration<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
    plan: Plan,
    swarm_seed: u64,
) -> Result<(LegConfiguration<N, B>, Motions<N>), FileError> {
    let inertia = servo_inertia(leg, background)?;
    let anatomy = anatomy::<N>(leg)?;
    let joints: [JointConfiguration; N] = core::array::from_fn(|index| {
        let joint = &leg.joints[index];
        let ends = joint.range_deg.map(|end| anatomy[index].angle_to_chain(end.to_radians()) as f32);
        JointConfiguration {
            scale: JointScale {
                radian_per_count: Radian(joint.encoder.step_rad() as f32),
                anatomy: anatomy[index].convert(),
                mirrored: leg.side == BodySide::Left,
                torque_per_ampere: NewtonMetrePerAmpere(joint.torque_per_ampere as f32),
            },
            low: Radian(ends[0].min(ends[1])),
            high: Radian(ends[0].max(ends[1])),
            speed: RadianPerSecond(joint.speed_limit_deg_s.to_radians() as f32),
            torque: NewtonMetre(joint.torque_limit_nm as f32),
            current: Ampere(joint.current_limit() as f32),
            inertia: KilogramMetreSquared(inertia[index] as f32),
            bandwidth: POSITION_BANDWIDTH,
        }
    });
    let acceleration = core::array::from_fn(|index| {
        RadianPerSecondSquared(leg.joints[index].acceleration_limit_deg_s2.to_radians() as f32)
    });
    let limits = core::array::from_fn(|index| JointEnvelope {
        low: joints[index].low,
        high: joints[index].high,
        speed: joints[index].speed,
        acceleration: acceleration[index],
    });
    let motions = motions(leg, &background.model, &limits)?;
    let configuration = LegConfiguration {
        joints,
        acceleration,
        model: background.device.clone(),
        prior: background.prior.map(|prior| prior.map(|link| link.convert())),
        plan,
        swarm_seed,
        thresholds: Thresholds::default(),
        monitor: MonitorSettings::default(),
        estimator: Estimator::default(),
        bandwidth_hz: leg.bandwidth_hz as f32,
        excitation: motions.excitation,
        validation: motions.validation,
    };
    Ok((configuration, motions))
}

/// Largest inertia of each joint from the leg file's prior, else its truth; determines the servo's gains.
fn servo_inertia<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
) -> Result<[f64; N], FileError> {
    let links = links::<N>(leg, |joint| joint.prior.as_ref().or(joint.truth.as_ref()))
        .ok_or_else(|| leg.error("the servo's gains need `prior` or `truth` of every joint; `replay` identifies from a recording without them"))?;
    Ok(largest_inertia(&background.model.chain, &prior_parameters(&links)))
}
