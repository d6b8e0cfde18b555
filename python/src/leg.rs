//! Class `Leg`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use scarab::ident::{Estimator, Plan, prior_parameters};
use scarab::model::{INERTIAL_PARAMETERS, LegParameters, PARAMETERS_PER_JOINT, Parameter, Payload};
use scarab_base::error::ToolError;
use scarab_base::files;
use scarab_base::names::parameter_name;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::check::LARGEST_NOISE_PERCENT;
use scarab_identify::formats::recording::Recording;
use scarab_identify::formats::robot::Robot;
use scarab_identify::formats::temperature;
use scarab_identify::leg::from_robot::{self, RobotOptions};
use scarab_identify::leg::placed_mass::PlacedMass;
use scarab_identify::leg::setup::{PriorChoice, links};
use scarab_identify::leg::states::Angles;
use scarab_identify::run::replay::{Recordings, ReplayOptions, replay};
use scarab_rig::excite::assumption::Assumption;
use scarab_rig::excite::bench::ExciteOptions;
use scarab_rig::excite::design::DesignOptions;
use scarab_rig::excite::run::{check, excite};
use scarab_rig::options::{DriveModel, SimulationOptions};
use scarab_rig::simulate::{SimulatedRun, simulate};

use crate::arrays::{Numbers, Rows, column, finite, shaped, vector};
use crate::dynamics::{Dynamics, States};
use crate::error::{argument, raised};
use crate::identification::Identification;
use crate::motion::Motion;
use crate::pool::compute;
use crate::recording::{named, read, record, recording, several};

#[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg"))]
#[pyclass(frozen, module = "scarab_ident")]
pub struct Leg {
    pub file: LegFile,
    /// Text of the leg file.
    pub text: String,
    remarks: Vec<String>,
}

/// Calls a function with the constant `N`, the number of the leg's joints.
macro_rules! with_joints {
    ($leg:expr, $body:ident ( $($argument:expr),* )) => {
        match $leg.joints.len() {
            1 => $body::<1>($($argument),*),
            2 => $body::<2>($($argument),*),
            _ => $body::<3>($($argument),*),
        }
    };
}
pub(crate) use with_joints;

#[pymethods]
impl Leg {
    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.from_toml"))]
    #[staticmethod]
    fn from_toml(path: PathBuf) -> PyResult<Self> {
        let (text, file) = LegFile::text(&path.to_string_lossy()).map_err(raised)?;
        Self::of_text(text, &file)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.from_text"))]
    #[staticmethod]
    fn from_text(toml: String) -> PyResult<Self> {
        Self::of_text(toml, "text")
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.from_urdf"))]
    #[staticmethod]
    #[pyo3(signature = (path, joints = None, *, locked = None, gravity = None, parallel_rad = 0.0, prior = true))]
    fn from_urdf(
        path: PathBuf,
        joints: Option<Vec<String>>,
        locked: Option<HashMap<String, f64>>,
        gravity: Option<[f64; 3]>,
        parallel_rad: f64,
        prior: bool,
    ) -> PyResult<Self> {
        let most = from_robot::LARGEST_PARALLEL_RAD;
        if !(0.0..=most).contains(&parallel_rad) {
            return Err(argument(format!("parallel_rad is {parallel_rad}; it must be from 0 to {most}")));
        }
        let gravity = gravity.unwrap_or([0.0, 0.0, -9.81]);
        if let Some(wrong) = gravity.iter().find(|part| !part.is_finite()) {
            return Err(argument(format!("gravity contains {wrong}; all numbers must be finite")));
        }
        let robot = files::read_text(&path)
            .and_then(|text| Robot::parse(&text, &path.display().to_string()))
            .map_err(raised)?;
        let options = RobotOptions {
            joints: joints.unwrap_or_default(),
            locked: locked.unwrap_or_default().into_iter().collect(),
            gravity: Vector3::from(gravity),
            parallel_rad,
            with_prior: prior,
        };
        let found = from_robot::leg(&robot, &options).map_err(raised)?;
        Ok(Self { file: found.leg, text: found.text, remarks: found.remarks })
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.name"))]
    #[getter]
    fn name(&self) -> &str {
        &self.file.name
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.joints"))]
    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.file.joints.iter().map(|joint| joint.name.as_str()).collect()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.toml"))]
    #[getter]
    fn toml(&self) -> &str {
        &self.text
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.remarks"))]
    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.parameter_names"))]
    #[getter]
    fn parameter_names(&self) -> Vec<String> {
        let of_joint =
            |joint: usize| Parameter::ALL.into_iter().map(move |parameter| parameter_name(joint, parameter));
        (0..self.file.joints.len()).flat_map(of_joint).collect()
    }

    fn __repr__(&self) -> String {
        format!("<Leg '{}' of joints {}>", self.file.name, self.joints().join(", "))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (&str,))> {
        Ok((py.get_type::<Self>().getattr("from_text")?, (&self.text,)))
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.save"))]
    fn save(&self, path: PathBuf) -> PyResult<()> {
        files::check_new(&path).and_then(|()| files::write_new(&path, &self.text)).map_err(raised)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.parameters"))]
    #[pyo3(signature = (of = None))]
    fn parameters<'py>(&self, py: Python<'py>, of: Option<&str>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let numbers = with_joints!(self.file, flat_parameters(&self.file, of))?;
        Ok(vector(py, numbers))
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.regressor"))]
    #[pyo3(signature = (q, qd, qdd, *, inertial_only = false, dh = false))]
    fn regressor<'py>(
        &self,
        py: Python<'py>,
        q: Numbers<'py>,
        qd: Numbers<'py>,
        qdd: Numbers<'py>,
        inertial_only: bool,
        dh: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let joints = self.file.joints.len();
        let (states, count, is_single) = states(&q, &qd, &qdd, joints)?;
        let columns = if inertial_only { INERTIAL_PARAMETERS } else { PARAMETERS_PER_JOINT };
        let leg = &self.file;
        let numbers = compute(py, || with_joints!(leg, regressors(leg, angles(dh), &states, columns)))??;
        finite("regressor", &numbers, joints * joints * columns)?;
        shaped(py, numbers, &[count, joints, joints * columns], is_single)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.inverse_dynamics"))]
    #[pyo3(signature = (q, qd, qdd, *, parameters = None, of = None, dh = false))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: Numbers<'py>,
        qd: Numbers<'py>,
        qdd: Numbers<'py>,
        parameters: Option<Numbers<'py>>,
        of: Option<&str>,
        dh: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let joints = self.file.joints.len();
        let (states, count, is_single) = states(&q, &qd, &qdd, joints)?;
        let parameters = match (parameters, of) {
            (Some(_), Some(_)) => return Err(argument("parameters and of exclude each other")),
            (Some(parameters), None) => {
                let needed = joints * PARAMETERS_PER_JOINT;
                let numbers = column("parameters", &parameters, &needed.to_string())?;
                if numbers.len() != needed {
                    let found = numbers.len();
                    return Err(argument(format!(
                        "parameters has {found} numbers; expected {needed}, in the order of parameter_names"
                    )));
                }
                if let Some(at) = numbers.iter().position(|number| !number.is_finite()) {
                    let value = numbers[at];
                    return Err(argument(format!("parameters[{at}] is {value}; all numbers must be finite")));
                }
                numbers
            }
            (None, of) => with_joints!(self.file, flat_parameters(&self.file, of))?,
        };
        let leg = &self.file;
        let numbers = compute(py, || with_joints!(leg, torques(leg, angles(dh), &states, &parameters)))??;
        finite("torque", &numbers, joints)?;
        shaped(py, numbers, &[count, joints], is_single)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.identify"))]
    #[pyo3(signature = (
        t, q, tau, *, also = None, validate = None, split = None, bandwidth_hz = None, accept_error_percent = None,
        plan = "one-time", prior = None, estimator = "robust", seed = 1, torque_delay_ms = None, even_stamps = false,
        load = None, payload = None, with_payload = None, temperature_c = None
    ))]
    fn identify<'py>(
        &self,
        py: Python<'py>,
        t: Numbers<'py>,
        q: Numbers<'py>,
        tau: Numbers<'py>,
        also: Option<Bound<'py, PyAny>>,
        validate: Option<Bound<'py, PyAny>>,
        split: Option<f64>,
        bandwidth_hz: Option<Bandwidth>,
        accept_error_percent: Option<f64>,
        plan: &str,
        prior: Option<&str>,
        estimator: &str,
        seed: u64,
        torque_delay_ms: Option<Delay>,
        even_stamps: bool,
        load: Option<&str>,
        payload: Option<&str>,
        with_payload: Option<Bound<'py, PyAny>>,
        temperature_c: Option<f64>,
    ) -> PyResult<Identification> {
        let joints = self.file.joints.len();
        let mut recordings = Recordings {
            training: vec![read("recording", [&t, &q, &tau], joints)?],
            held_out: several("validate", validate.as_ref(), joints)?,
            with_payload: several("with_payload", with_payload.as_ref(), joints)?,
        };
        recordings.training.extend(several("also", also.as_ref(), joints)?);
        let leg = self.at(temperature_c)?;
        let plans = [("one-time", Plan::OneTime), ("sequential", Plan::Sequential)];
        let estimators = [("robust", Estimator::Robust), ("plain", Estimator::Plain)];
        let hertz = bandwidth_hz.map(Bandwidth::hertz).transpose()?;
        let options = ReplayOptions {
            split,
            bandwidth_hz: hertz.flatten().unwrap_or(leg.bandwidth_hz),
            chooses_bandwidth: hertz == Some(None),
            accept_error_percent: accept_error_percent.unwrap_or(leg.accept_error_percent),
            plan: named("plan", plan, &plans)?,
            prior: prior
                .map_or(Ok(PriorChoice::Default), str::parse)
                .map_err(|reason| argument(format!("prior: {reason}")))?,
            estimator: named("estimator", estimator, &estimators)?,
            swarm_seed: seed,
            torque_delay_ms: torque_delay_ms.map_or_else(Vec::new, Delay::values),
            even_stamps,
            load: placed(&leg, load, "load")?,
            payload: placed(&leg, payload, "payload")?,
            ..ReplayOptions::from_leg(&leg)
        };
        let (leg, recordings, options) = (&leg, &recordings, &options);
        let replayed = compute(py, || replay(leg, recordings, options))?.map_err(raised)?;
        Identification::from_replay(py, leg.clone(), replayed)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.excite"))]
    #[pyo3(signature = (
        *, duration_s = 22.0, seed = 1, evaluations = 48_000, torque_noise_percent = None,
        torque_margin_percent = 20.0, assume_truth = false
    ))]
    fn excite(
        &self,
        py: Python<'_>,
        duration_s: f64,
        seed: u64,
        evaluations: u32,
        torque_noise_percent: Option<f64>,
        torque_margin_percent: f64,
        assume_truth: bool,
    ) -> PyResult<Motion> {
        check_noise(torque_noise_percent)?;
        let options = &ExciteOptions {
            design: DesignOptions { duration_s, seed, evaluations },
            given: None,
            carried: Vec::new(),
            torque_noise_percent,
            margin_percent: torque_margin_percent,
            assumption: if assume_truth { Assumption::Truth } else { Assumption::Best },
        };
        options.check().map_err(|reason| raised(ToolError::Input(reason)))?;
        let leg = &self.file;
        let excited = compute(py, || excite(leg, options))?.map_err(raised)?;
        Motion::from_design(leg.clone(), excited)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Leg.simulate"))]
    #[pyo3(signature = (*, motion = None, seed = 1, torque_noise_percent = None, drive = "ideal"))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        motion: Option<&Motion>,
        seed: u64,
        torque_noise_percent: Option<f64>,
        drive: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        check_noise(torque_noise_percent)?;
        let drives = [("ideal", DriveModel::Ideal), ("full", DriveModel::Full)];
        let excitation = motion.map(|motion| motion.excitation.clone());
        let options = &SimulationOptions {
            torque_noise_percent,
            drive: named("drive", drive, &drives)?,
            excitation,
            with_series: true,
            ..SimulationOptions::with_seed(seed)
        };
        let leg = &self.file;
        let (identification, recordings) = compute(py, || simulated(leg, options))?.map_err(raised)?;
        let identification =
            Identification::from_simulation(py, leg.clone(), identification.0, identification.1)?;
        let mut recordings = recordings.iter();
        let training = recordings.next().map(|first| recording(py, first)).transpose()?;
        let validation = recordings.map(|other| recording(py, other)).collect::<PyResult<Vec<_>>>()?;
        record(py, "Simulation")?.call1((training, validation, identification))
    }
}

impl Leg {
    fn of_text(text: String, file: &str) -> PyResult<Self> {
        Ok(Self { file: LegFile::parse(&text, file).map_err(raised)?, text, remarks: Vec::new() })
    }

    /// Leg at a temperature of its drives.
    fn at(&self, temperature_c: Option<f64>) -> PyResult<LegFile> {
        let stated = temperature_c
            .map(|celsius| {
                temperature::checked(celsius).map_err(|reason| argument(format!("temperature_c: {reason}")))
            })
            .transpose()?;
        Ok(LegFile { temperature_c: stated.or(self.file.temperature_c), ..self.file.clone() })
    }
}

/// Bandwidth as given: a frequency, or `auto`.
#[derive(FromPyObject)]
pub enum Bandwidth {
    Hertz(f64),
    Word(String),
}

impl Bandwidth {
    /// Frequency; `None` for `auto`.
    fn hertz(self) -> PyResult<Option<f64>> {
        match self {
            Self::Hertz(hertz) => Ok(Some(hertz)),
            Self::Word(word) if word == "auto" => Ok(None),
            Self::Word(word) => {
                Err(argument(format!("bandwidth_hz is '{word}'; it must be a number of Hz, or 'auto'")))
            }
        }
    }
}

/// Delay of all torques, or of each.
#[derive(FromPyObject)]
pub enum Delay {
    All(f64),
    Each(Vec<f64>),
}

impl Delay {
    fn values(self) -> Vec<f64> {
        match self {
            Self::All(one) => vec![one],
            Self::Each(values) => values,
        }
    }
}

/// Mass on a leg, as stated.
fn placed(leg: &LegFile, mass: Option<&str>, name: &str) -> PyResult<Option<Payload<f64>>> {
    let mass = mass.map(str::parse::<PlacedMass>).transpose();
    let mass = mass.map_err(|reason| argument(format!("{name}: {reason}")))?;
    mass.map(|mass| mass.on(leg, name)).transpose().map_err(raised)
}

fn check_noise(percent: Option<f64>) -> PyResult<()> {
    match percent {
        Some(percent) if !(0.0..=LARGEST_NOISE_PERCENT).contains(&percent) => Err(argument(format!(
            "torque_noise_percent is {percent}; it must be from 0 to {LARGEST_NOISE_PERCENT}"
        ))),
        _ => Ok(()),
    }
}

fn angles(dh: bool) -> Angles {
    if dh { Angles::DenavitHartenberg } else { Angles::Anatomical }
}

/// States of three arrays, their number, and whether a single state was given.
pub fn states(
    q: &Numbers<'_>,
    qd: &Numbers<'_>,
    qdd: &Numbers<'_>,
    joints: usize,
) -> PyResult<(States, usize, bool)> {
    let [q, qd, qdd] =
        [("q", q), ("qd", qd), ("qdd", qdd)].map(|(name, array)| Rows::new(name, array, joints));
    let (q, qd, qdd) = (q?, qd?, qdd?);
    for (name, other) in [("qd", &qd), ("qdd", &qdd)] {
        if (other.count(), other.is_single) != (q.count(), q.is_single) {
            let [theirs, own] = [other, &q].map(Rows::shape_text);
            return Err(argument(format!("{name} has the shape {theirs}, q has {own}; both must be equal")));
        }
    }
    let (count, is_single) = (q.count(), q.is_single);
    Ok((States { q: q.numbers, qd: qd.numbers, qdd: qdd.numbers }, count, is_single))
}

fn regressors<const N: usize>(
    leg: &LegFile,
    angles: Angles,
    states: &States,
    columns: usize,
) -> PyResult<Vec<f64>> {
    Ok(Dynamics::<N>::new(leg, angles).map_err(raised)?.regressors(states, columns))
}

fn torques<const N: usize>(
    leg: &LegFile,
    angles: Angles,
    states: &States,
    parameters: &[f64],
) -> PyResult<Vec<f64>> {
    let parameters: LegParameters<f64, N> = core::array::from_fn(|joint| {
        core::array::from_fn(|parameter| parameters[joint * PARAMETERS_PER_JOINT + parameter])
    });
    Ok(Dynamics::<N>::new(leg, angles).map_err(raised)?.torques(states, &parameters))
}

/// Parameters of the leg file in the order of the names: `truth`, `prior`, or the first that exists.
fn flat_parameters<const N: usize>(leg: &LegFile, of: Option<&str>) -> PyResult<Vec<f64>> {
    let truth = || links::<N>(leg, |joint| joint.truth.as_ref());
    let prior = || links::<N>(leg, |joint| joint.prior.as_ref());
    let (found, needed) = match of {
        None => (truth().or_else(prior), "`truth` or `prior`"),
        Some("truth") => (truth(), "`truth`"),
        Some("prior") => (prior(), "`prior`"),
        Some(other) => return Err(argument(format!("of is '{other}'; it must be one of 'truth', 'prior'"))),
    };
    let found = found.ok_or_else(|| {
        argument(format!("the leg `{}` has no {needed} for every joint: give parameters", leg.name))
    })?;
    Ok(prior_parameters(&found).into_iter().flatten().collect())
}

/// Report and curves of a simulation, and its recordings, the training motion first.
type Simulated =
    ((scarab_identify::report::RunReport, scarab_identify::report::series::Series), Vec<Recording>);

fn simulated(leg: &LegFile, options: &SimulationOptions) -> Result<Simulated, ToolError> {
    if let Some(motion) = &options.excitation {
        check(leg, Path::new("motion"), motion, &[])?;
    }
    let SimulatedRun { report, recordings, series } = simulate(leg, options)?;
    let recordings = recordings.into_iter().filter(|recording| !recording.time_s.is_empty());
    Ok(((report, series), recordings.collect()))
}
