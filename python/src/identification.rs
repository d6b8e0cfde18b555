//! Class `Identification`: parameters with their uncertainty, and the verdict.

use std::path::{Path, PathBuf};

use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use scarab_base::error::ToolError;
use scarab_base::files::{self, is_device};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::model_file::{BaseSet, ModelFile};
use scarab_identify::leg::states::Angles;
use scarab_identify::report::series::{JointCurves, MotionSeries, Series};
use scarab_identify::report::{RunReport, Source};
use scarab_identify::run::predict::Predictor;
use scarab_identify::run::replay::Replayed;
use scarab_tool::view::{figures, html, tables};

use crate::arrays::{Numbers, finite, object, shaped, vector};
use crate::dynamics::{Dynamics, States};
use crate::error::{RefusedError, argument, raised};
use crate::leg::{states, with_joints};
use crate::pool::compute;
use crate::recording::{record, warn};

/// First characters of a report page.
const PAGE: &str = "<!DOCTYPE html>";

#[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification"))]
#[pyclass(frozen, module = "scarab_ident")]
pub struct Identification {
    leg: LegFile,
    run: RunReport,
    series: Series,
    sources: Vec<Source>,
    bandwidth_hz: f64,
    warnings: Vec<String>,
    base: BaseSet,
    /// Stored form; none for a refused result.
    model: Option<ModelFile>,
}

impl Identification {
    /// Result of recordings; their warnings become warnings of Python.
    pub fn from_replay(py: Python<'_>, leg: LegFile, replayed: Replayed) -> PyResult<Self> {
        warn(py, replayed.warnings.iter().cloned())?;
        let Replayed { bandwidth_hz, run, sources, series, warnings } = replayed;
        Ok(Self { sources, bandwidth_hz, warnings, ..Self::new(leg, run, series, bandwidth_hz) })
    }

    /// Result of a simulated leg.
    pub fn from_simulation(
        py: Python<'_>,
        leg: LegFile,
        run: RunReport,
        series: Series,
    ) -> PyResult<Py<Self>> {
        let bandwidth_hz = leg.bandwidth_hz;
        Py::new(py, Self::new(leg, run, series, bandwidth_hz))
    }

    fn new(leg: LegFile, run: RunReport, series: Series, bandwidth_hz: f64) -> Self {
        let (base, model) = (BaseSet::from_run(&run), ModelFile::from_run(&leg, &run, bandwidth_hz));
        Self { leg, run, series, sources: Vec::new(), bandwidth_hz, warnings: Vec::new(), base, model }
    }

    fn model(&self) -> PyResult<&ModelFile> {
        self.model.as_ref().ok_or_else(|| {
            let failed = self.run.findings.iter().filter(|finding| !finding.passed);
            let words: Vec<_> =
                failed.map(|finding| format!("{}: {}", finding.reason, finding.words)).collect();
            RefusedError::new_err(format!("{}: {}", tables::verdict_line(&self.run), words.join("; ")))
        })
    }
}

#[pymethods]
impl Identification {
    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.accepted"))]
    #[getter]
    fn accepted(&self) -> bool {
        self.run.accepted()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.validated"))]
    #[getter]
    fn validated(&self) -> bool {
        self.run.validated
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.verdict"))]
    #[getter]
    fn verdict(&self) -> String {
        tables::verdict_line(&self.run)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.reasons"))]
    #[getter]
    fn reasons(&self) -> Vec<String> {
        self.run.reasons.iter().map(|reason| (*reason).to_owned()).collect()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.warnings"))]
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.bandwidth_hz"))]
    #[getter]
    fn bandwidth_hz(&self) -> f64 {
        self.bandwidth_hz
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.names"))]
    #[getter]
    fn names(&self) -> Vec<&str> {
        self.base.parameters.iter().map(|base| base.name.as_str()).collect()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.units"))]
    #[getter]
    fn units(&self) -> Vec<&str> {
        self.base.parameters.iter().map(|base| base.unit.as_str()).collect()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.values"))]
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, self.base.parameters.iter().map(|base| base.value).collect())
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.sigma"))]
    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, self.base.parameters.iter().map(|base| base.sigma).collect())
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.covariance"))]
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let size = self.base.parameters.len();
        shaped(py, self.base.covariance.iter().flatten().copied().collect(), &[size, size], false)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.sums"))]
    #[getter]
    fn sums<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let all: Vec<&str> = self.run.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
        let rows = self.base.parameters.iter().flat_map(|base| {
            all.iter().map(|name| base.terms.get(*name).copied().unwrap_or(0.0)).collect::<Vec<_>>()
        });
        shaped(py, rows.collect(), &[self.base.parameters.len(), all.len()], false)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.parameters"))]
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (all, class) = (PyDict::new(py), record(py, "Parameter")?);
        for one in &self.run.parameters {
            let fields = (one.value.known(), one.sigma.known(), one.unit, one.status);
            all.set_item(&one.name, class.call1(fields)?)?;
        }
        Ok(all)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.motions"))]
    #[getter]
    fn motions<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let class = record(py, "Curves")?;
        let of = |motion: &MotionSeries, curve: fn(&JointCurves) -> &[f64]| {
            let (rows, joints) = (motion.time_s.len(), motion.joints.len());
            let numbers = (0..rows).flat_map(|row| motion.joints.iter().map(move |joint| curve(joint)[row]));
            shaped(py, numbers.collect(), &[rows, joints], false)
        };
        let one = |motion: &MotionSeries| {
            let is_at_rest: Vec<Vec<bool>> = (0..motion.time_s.len())
                .map(|row| motion.joints.iter().map(|joint| joint.still[row]).collect())
                .collect();
            class.call1((
                &motion.name,
                motion.role.name(),
                vector(py, motion.time_s.clone()),
                of(motion, |joint| &joint.measured_deg)?,
                of(motion, |joint| &joint.measured_nm)?,
                of(motion, |joint| &joint.predicted_nm)?,
                py.import("numpy")?.call_method1("array", (is_at_rest, "bool"))?,
            ))
        };
        self.series.motions.iter().map(one).collect()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.report"))]
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(
            py,
            &serde_json::to_string(&self.run).map_err(|error| raised(ToolError::input(error.to_string())))?,
        )
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.predict"))]
    #[pyo3(signature = (q, qd, qdd, *, dh = false))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        q: Numbers<'py>,
        qd: Numbers<'py>,
        qdd: Numbers<'py>,
        dh: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let model = self.model()?;
        let joints = self.leg.joints.len();
        let (states, count, is_single) = states(&q, &qd, &qdd, joints)?;
        let angles = if dh { Angles::DenavitHartenberg } else { Angles::Anatomical };
        let leg = &self.leg;
        let (torque, sigma) =
            compute(py, || with_joints!(leg, predicted(leg, model, angles, &states)))?.map_err(raised)?;
        finite("torque", &torque, joints)?;
        finite("torque", &sigma, joints)?;
        let of = |numbers| shaped(py, numbers, &[count, joints], is_single);
        record(py, "Prediction")?.call1((of(torque)?, of(sigma)?))
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.save"))]
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let model = self.model()?;
        refuse_other_kind(&path, "a model file", |path| ModelFile::load(path).is_ok())?;
        model.write(&path).map_err(raised)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.write_report"))]
    fn write_report(&self, path: PathBuf) -> PyResult<()> {
        let is_page = |path: &Path| files::read_text(path).is_ok_and(|text| text.starts_with(PAGE));
        refuse_other_kind(&path, "a report page", is_page)?;
        let names: Vec<_> = self.leg.joints.iter().map(|joint| joint.name.as_str()).collect();
        let written = || -> Result<(), ToolError> {
            let drawn = figures::all(&names, &self.run, &self.series)?;
            let mut circumstances = html::Circumstances::from_command(&self.leg, []);
            circumstances.command = "scarab_ident (Python)".into();
            files::write(&path, html::page(&circumstances, &self.run, &self.sources, &drawn)?)
        };
        written().map_err(raised)
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Identification.plot"))]
    #[pyo3(signature = (joint = None))]
    fn plot<'py>(slf: &Bound<'py, Self>, joint: Option<&str>) -> PyResult<Bound<'py, PyAny>> {
        let joints: Vec<&str> = slf.get().leg.joints.iter().map(|joint| joint.name.as_str()).collect();
        slf.py().import("scarab_ident._plot")?.call_method1("plot", (slf, joints, joint))
    }

    fn __str__(&self) -> String {
        tables::run_text(&self.run, &self.leg)
    }

    fn __repr__(&self) -> String {
        format!("<Identification of '{}': {}>", self.run.leg, tables::verdict_line(&self.run))
    }
}

/// Refuses to replace a file of another kind, such as the recording or the leg file.
pub fn refuse_other_kind(path: &Path, kind: &str, is_kind: impl Fn(&Path) -> bool) -> PyResult<()> {
    if path.exists() && !is_device(path) && !is_kind(path) {
        return Err(argument(format!("{}: exists and is not {kind}: choose another name", path.display())));
    }
    Ok(())
}

/// Torques and their standard deviations.
fn predicted<const N: usize>(
    leg: &LegFile,
    model: &ModelFile,
    angles: Angles,
    states: &States,
) -> Result<(Vec<f64>, Vec<f64>), ToolError> {
    let (predictor, dynamics) = (Predictor::<N>::new(model)?, Dynamics::<N>::new(leg, angles)?);
    let samples = 0..states.q.len() / N;
    let all = samples.flat_map(|sample| {
        let torques = predictor.torques(&dynamics.state(states, sample));
        torques
            .into_iter()
            .enumerate()
            .map(|(joint, torque)| (dynamics.outside(joint, torque.total()), torque.sigma))
            .collect::<Vec<_>>()
    });
    Ok(all.unzip())
}
