//! Recordings: arrays in, arrays out.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use scarab_host::formats::recording::dialect::{Decimal, Delimiter};
use scarab_host::formats::recording::import::{ColumnChoice, Import, UnitChoice};
use scarab_host::formats::recording::{JointSeries, Read, Recording};

use crate::arrays::{Numbers, column, shaped, vector};
use crate::error::{argument, raised};
use crate::leg::Leg;

/// Time, angles and torques of one recording.
pub type Triple<'py> = (Numbers<'py>, Numbers<'py>, Numbers<'py>);

/// One recording, or a list of them.
#[derive(FromPyObject)]
pub enum Several<'py> {
    One(Triple<'py>),
    Many(Vec<Triple<'py>>),
}

impl Several<'_> {
    /// Checks all recordings; `name` stands for a file in messages.
    pub fn read(&self, name: &str, joints: usize) -> PyResult<Vec<Read>> {
        match self {
            Self::One(one) => Ok(vec![read(name, one, joints)?]),
            Self::Many(many) => many
                .iter()
                .enumerate()
                .map(|(number, one)| read(&format!("{name}[{number}]"), one, joints))
                .collect(),
        }
    }
}

/// Checks one recording, as a file is checked.
pub fn read(name: &str, (t, q, tau): &Triple<'_>, joints: usize) -> PyResult<Read> {
    let time_s = column(&format!("{name}: t"), t)?;
    let q = by_joint(&format!("{name}: q"), q, time_s.len(), joints)?;
    let tau = by_joint(&format!("{name}: tau"), tau, time_s.len(), joints)?;
    let series: Vec<JointSeries> = q
        .into_iter()
        .zip(tau)
        .map(|(position_rad, torque_nm)| JointSeries { position_rad, torque_nm })
        .collect();
    Recording::of_samples(Path::new(name), &time_s, &series).map_err(raised)
}

/// Numbers of each joint, from an array of shape `(samples, joints)`, or `(samples,)` for one joint.
fn by_joint(name: &str, array: &Numbers<'_>, samples: usize, joints: usize) -> PyResult<Vec<Vec<f64>>> {
    let array = array.as_array();
    let fits = match array.shape() {
        [rows] => joints == 1 && *rows == samples,
        [rows, columns] => *rows == samples && *columns == joints,
        _ => false,
    };
    if !fits {
        return Err(argument(format!(
            "{name} has shape {:?}; needed is ({samples}, {joints}): a row for each time, a column for each joint",
            array.shape()
        )));
    }
    let numbers: Vec<f64> = array.iter().copied().collect();
    Ok((0..joints).map(|joint| numbers[joint..].iter().step_by(joints).copied().collect()).collect())
}

/// Record `Recording` of Python.
pub fn recording<'py>(py: Python<'py>, recording: &Recording) -> PyResult<Bound<'py, PyAny>> {
    let (samples, joints) = (recording.time_s.len(), recording.joints.len());
    let table = |of: fn(&JointSeries) -> &[f64]| {
        let numbers =
            (0..samples).flat_map(|sample| recording.joints.iter().map(move |joint| of(joint)[sample]));
        shaped(py, numbers.collect(), &[samples, joints], false)
    };
    let (q, tau) = (table(|joint| &joint.position_rad)?, table(|joint| &joint.torque_nm)?);
    record(py, "Recording")?.call1((vector(py, recording.time_s.clone()), q, tau))
}

/// Class of a record, by name.
pub fn record<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("scarab_ident._records")?.getattr(name)
}

/// Reads a recording of a leg from a file.
#[pyfunction]
#[pyo3(signature = (path, leg, *, columns = "", units = "", skip_bad = false, delimiter = None, decimal = None))]
pub fn read_recording<'py>(
    py: Python<'py>,
    path: PathBuf,
    leg: &Leg,
    columns: &str,
    units: &str,
    skip_bad: bool,
    delimiter: Option<&str>,
    decimal: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let columns: Vec<ColumnChoice> = parts("columns", columns)?;
    let units: Vec<UnitChoice> = parts("units", units)?;
    let import = Import {
        skip_bad,
        delimiter: named(
            "delimiter",
            delimiter,
            &[("comma", Delimiter::Comma), ("semicolon", Delimiter::Semicolon), ("tab", Delimiter::Tab)],
        )?,
        decimal: named("decimal", decimal, &[("point", Decimal::Point), ("comma", Decimal::Comma)])?,
        command: format!("scarab replay {}", path.display()),
        ..Import::of(&leg.file, &leg.text)
    };
    let import = import.with(&columns, &units).map_err(argument)?;
    let read = py.detach(|| Recording::read(&path, &import)).map_err(raised)?;
    recording(py, &read.recording)
}

/// Parts of an argument that are separated by commas.
fn parts<T: std::str::FromStr<Err = String>>(name: &str, text: &str) -> PyResult<Vec<T>> {
    let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
    parts.map(|part| part.parse().map_err(|reason| argument(format!("{name}: {reason}")))).collect()
}

/// Value of this name.
pub fn named<T: Copy>(argument_name: &str, name: Option<&str>, values: &[(&str, T)]) -> PyResult<Option<T>> {
    let Some(name) = name else { return Ok(None) };
    let found = values.iter().find(|(known, _)| *known == name);
    found.map(|(_, value)| Some(*value)).ok_or_else(|| {
        let known: Vec<_> = values.iter().map(|(known, _)| format!("'{known}'")).collect();
        argument(format!("{argument_name} is '{name}'; possible are {}", known.join(", ")))
    })
}
