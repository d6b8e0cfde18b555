//! Recordings: arrays in, arrays out.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use scarab_identify::formats::recording::dialect::{Decimal, Delimiter};
use scarab_identify::formats::recording::import::{ColumnChoice, Import, UnitChoice};
use scarab_identify::formats::recording::{JointSeries, Read, Recording};
use scarab_identify::run::replay::warnings::of_more_joints;
use scarab_tool::view::tables::reading_notes;

use crate::arrays::{Array, Numbers, column, shaped, vector};
use crate::error::{argument, raised};
use crate::leg::Leg;

/// Checks one recording `(t, q, tau)`, or a list of them, as files are checked.
pub fn several(name: &str, given: Option<&Bound<'_, PyAny>>, joints: usize) -> PyResult<Vec<Read>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    let one = |name: &str, given: &Bound<'_, PyAny>| match given.cast::<PyTuple>() {
        Ok(triple) if triple.len() == 3 => {
            read(name, [&triple.get_item(0)?, &triple.get_item(1)?, &triple.get_item(2)?], joints)
        }
        _ => Err(argument(format!("{name} must be a recording (t, q, tau), or a list of recordings"))),
    };
    match given.cast::<PyList>() {
        Ok(list) => {
            list.iter().enumerate().map(|(number, given)| one(&format!("{name}[{number}]"), &given)).collect()
        }
        Err(_) => Ok(vec![one(name, given)?]),
    }
}

/// Checks one recording, as a file is checked; `name` stands for the file in messages.
pub fn read(name: &str, [t, q, tau]: [&Numbers<'_>; 3], joints: usize) -> PyResult<Read> {
    let time_s = column(&format!("{name}: t"), t, "samples")?;
    let q = by_joint(&format!("{name}: q"), q, time_s.len(), joints)?;
    let tau = by_joint(&format!("{name}: tau"), tau, time_s.len(), joints)?;
    let series: Vec<JointSeries> = q
        .into_iter()
        .zip(tau)
        .map(|(position_rad, torque_nm)| JointSeries { position_rad, torque_nm })
        .collect();
    Recording::from_samples(Path::new(name), &time_s, &series).map_err(raised)
}

/// Numbers of each joint, from an array of shape `(samples, joints)`, or `(samples,)` for one joint.
fn by_joint(name: &str, given: &Numbers<'_>, samples: usize, joints: usize) -> PyResult<Vec<Vec<f64>>> {
    let array = Array::new(name, given)?;
    let fits = match array.shape[..] {
        [rows] => joints == 1 && rows == samples,
        [rows, columns] => rows == samples && columns == joints,
        _ => false,
    };
    if !fits {
        return Err(argument(format!(
            "{name} has the shape {}; expected ({samples}, {joints}): a row for each time, a column for each joint",
            array.shape_text()
        )));
    }
    let of_joint = |joint: usize| array.numbers.iter().skip(joint).step_by(joints).copied().collect();
    Ok((0..joints).map(of_joint).collect())
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

/// Gives warnings of Python.
pub fn warn(py: Python<'_>, warnings: impl IntoIterator<Item = String>) -> PyResult<()> {
    let warn = py.import("warnings")?.getattr("warn")?;
    warnings.into_iter().try_for_each(|warning| warn.call1((warning,)).map(drop))
}

#[doc = include_str!(concat!(env!("OUT_DIR"), "/read_recording"))]
#[pyfunction]
#[pyo3(signature = (path, leg, *, columns = "", units = "", skip_bad = false, rate_hz = None, merge_rows = false, even_stamps = false, delimiter = None, decimal = None))]
pub fn read_recording<'py>(
    py: Python<'py>,
    path: PathBuf,
    leg: &Leg,
    columns: &str,
    units: &str,
    skip_bad: bool,
    rate_hz: Option<f64>,
    merge_rows: bool,
    even_stamps: bool,
    delimiter: Option<&str>,
    decimal: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let columns: Vec<ColumnChoice> = parts("columns", columns)?;
    let units: Vec<UnitChoice> = parts("units", units)?;
    let delimiters = [
        ("comma", Delimiter::Comma),
        ("semicolon", Delimiter::Semicolon),
        ("tab", Delimiter::Tab),
        ("space", Delimiter::Space),
    ];
    let decimals = [("point", Decimal::Point), ("comma", Decimal::Comma)];
    let import = Import {
        skip_bad,
        rate_hz,
        merge_rows,
        even_stamps,
        delimiter: delimiter.map(|name| named("delimiter", name, &delimiters)).transpose()?,
        decimal: decimal.map(|name| named("decimal", name, &decimals)).transpose()?,
        command: format!("scarab replay {}", path.display()),
        ..Import::from_leg(&leg.file, &leg.text)
    };
    let import = import.with(&columns, &units).map_err(argument)?;
    let Read { recording: read, report } = py.detach(|| Recording::read(&path, &import)).map_err(raised)?;
    let skipped = (report.skipped > 0).then(|| reading_notes(std::slice::from_ref(&report)));
    warn(py, skipped.into_iter().flatten().chain(report.warning).chain(of_more_joints(&read, &leg.file)))?;
    recording(py, &read)
}

/// Parts of an argument that are separated by commas.
fn parts<T: std::str::FromStr<Err = String>>(name: &str, text: &str) -> PyResult<Vec<T>> {
    let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
    parts.map(|part| part.parse().map_err(|reason| argument(format!("{name}: {reason}")))).collect()
}

/// Value of this name.
pub fn named<T: Copy>(argument_name: &str, name: &str, values: &[(&str, T)]) -> PyResult<T> {
    let found = values.iter().find(|(known, _)| *known == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<_> = values.iter().map(|(known, _)| format!("'{known}'")).collect();
        argument(format!("{argument_name} is '{name}'; it must be one of {}", known.join(", ")))
    })
}
