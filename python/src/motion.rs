//! Class `Motion`: an exciting motion.

use std::path::PathBuf;

use pyo3::prelude::*;
use scarab_base::files;
use scarab_identify::formats::excitation::Excitation;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::motion_samples::{MotionSamples, SampleRate};
use scarab_rig::excite::run::{Excited, check_known};

use crate::arrays::{object, shaped, vector};
use crate::error::{argument, raised};
use crate::identification::refuse_other_kind;
use crate::leg::Leg;
use crate::recording::record;

#[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion"))]
#[pyclass(frozen, module = "scarab_ident")]
pub struct Motion {
    leg: LegFile,
    pub excitation: Excitation,
    /// Report of the design, JSON.
    report: Option<String>,
}

impl Motion {
    pub fn from_design(leg: LegFile, excited: Excited) -> PyResult<Self> {
        let report = serde_json::to_string(&excited.report).map_err(|error| argument(error.to_string()))?;
        Ok(Self { leg, excitation: excited.motion, report: Some(report) })
    }

    fn samples_at(&self, rate_hz: u32) -> PyResult<MotionSamples> {
        let rate: SampleRate =
            rate_hz.to_string().parse().map_err(|reason| argument(format!("rate_hz: {rate_hz} {reason}")))?;
        MotionSamples::new(&self.leg, &self.excitation, rate).map_err(raised)
    }
}

#[pymethods]
impl Motion {
    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion.load"))]
    #[staticmethod]
    fn load(path: PathBuf, leg: &Leg) -> PyResult<Self> {
        let (leg, excitation) = (&leg.file, Excitation::load(&path).map_err(raised)?);
        check_known(leg, &path, &excitation).map_err(raised)?;
        Ok(Self { leg: leg.clone(), excitation, report: None })
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion.duration_s"))]
    #[getter]
    fn duration_s(&self) -> f64 {
        self.excitation.duration_s()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion.report"))]
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.report.as_deref().map(|json| object(py, json)).transpose()
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion.samples"))]
    #[pyo3(signature = (rate_hz = 500))]
    fn samples<'py>(&self, py: Python<'py>, rate_hz: u32) -> PyResult<Bound<'py, PyAny>> {
        let samples = self.samples_at(rate_hz)?;
        let time_s: Vec<f64> = samples.time_s().collect();
        let shape = [time_s.len(), self.leg.joints.len()];
        let of = |kind: usize| {
            let numbers = samples.states().flat_map(|state| state[kind].iter().copied());
            shaped(py, numbers.collect(), &shape, false)
        };
        let (q, qd, qdd) = (of(0)?, of(1)?, of(2)?);
        record(py, "Samples")?.call1((vector(py, time_s), q, qd, qdd))
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion.to_trajectory"))]
    #[pyo3(signature = (rate_hz = 500))]
    fn to_trajectory(&self, rate_hz: u32) -> PyResult<String> {
        Ok(self.samples_at(rate_hz)?.to_trajectory())
    }

    #[doc = include_str!(concat!(env!("OUT_DIR"), "/Motion.save"))]
    fn save(&self, path: PathBuf) -> PyResult<()> {
        refuse_other_kind(&path, "a motion file", |path| Excitation::load(path).is_ok())?;
        files::write(&path, self.excitation.to_toml()).map_err(raised)
    }

    fn __repr__(&self) -> String {
        format!("<Motion of '{}', {} s>", self.leg.name, self.excitation.duration_s())
    }
}
