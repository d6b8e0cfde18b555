//! Reports of one leg from its logged samples: means, filtered torque with its prediction, estimates.

use scarab::model::AnatomicalJoint;
use scarab::servo::{LOG_RATE_HZ, SERVO_RATE_HZ, TICKS_PER_LOG};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::geometry::anatomical_joints;
use scarab_identify::formats::leg_file::{JointFile, LegFile};
use scarab_identify::leg::stick::Stick;
use scarab_identify::report::{BaseReport, RunReport};
use scarab_identify::run::progress::{ChainSample, PredictedRow, Progress};

use crate::live::report::{
    EstimateOrigin, JointScene, LegScene, LiveEstimate, LiveNote, LiveOutcome, LiveParameter, LiveRow,
    LiveSample, LiveUpdate, RATE_HZ, Scene, Severity,
};

/// Logged samples of one period.
const SAMPLES: u32 = LOG_RATE_HZ / RATE_HZ;
/// Time from the middle of a period to its last servo tick, s.
const HALF_PERIOD_S: f64 = (SERVO_RATE_HZ / RATE_HZ - 1) as f64 / 2.0 / SERVO_RATE_HZ as f64;

/// Time from the middle of a logged sample to its last servo tick, s.
pub(crate) const HALF_SAMPLE_S: f64 = (TICKS_PER_LOG - 1) as f64 / 2.0 / SERVO_RATE_HZ as f64;

/// Description of a source with one leg.
pub(crate) fn scene(leg: &LegFile, source: String, speed: f64) -> Scene {
    let joint = |joint: &JointFile| JointScene { name: joint.name.clone() };
    let joints = leg.joints.iter().map(joint).collect();
    Scene { source, speed, legs: vec![LegScene { name: leg.name.clone(), joints }] }
}

/// Sums over one period of the picture, in the model's angles and signs.
#[derive(Clone)]
struct Sums {
    angle: Vec<f64>,
    torque: Vec<f64>,
    logged: u32,
    commanded: Vec<f64>,
    ticks: u32,
}

impl Sums {
    fn empty(joints: usize) -> Self {
        let zeros = vec![0.0; joints];
        Self { angle: zeros.clone(), torque: zeros.clone(), logged: 0, commanded: zeros, ticks: 0 }
    }
}

/// Reports about one leg.
pub(crate) struct Picture<'a> {
    leg: &'a LegFile,
    out: &'a dyn Fn(LiveUpdate),
    stick: Stick,
    anatomy: Vec<AnatomicalJoint<f64>>,
    sums: Sums,
    /// Whether torques come from currents by the leg's torque constants.
    has_currents: bool,
    /// Index of the leg in the scene.
    leg_index: usize,
    /// Time of the reports, s: that of the last servo tick.
    pub(crate) time_s: f64,
}

impl<'a> Picture<'a> {
    /// Creates the reports of a leg, at time zero.
    ///
    /// # Errors
    /// The leg file's directions or zeros cannot be used.
    pub fn new(leg: &'a LegFile, out: &'a dyn Fn(LiveUpdate)) -> Result<Self, ToolError> {
        let (stick, anatomy) = (Stick::from_leg(leg), anatomical_joints(leg)?);
        let sums = Sums::empty(anatomy.len());
        Ok(Self { leg, out, stick, anatomy, sums, has_currents: true, leg_index: 0, time_s: 0.0 })
    }

    /// Conversion of each joint between anatomical and chain angles.
    pub(crate) fn anatomy(&self) -> &[AnatomicalJoint<f64>] {
        &self.anatomy
    }

    /// Reports currents as unknown.
    pub(crate) fn without_currents(self) -> Self {
        Self { has_currents: false, ..self }
    }

    /// Reports as the leg with this index in the scene.
    pub(crate) fn at(self, leg_index: usize) -> Self {
        Self { leg_index, ..self }
    }

    /// Index of the leg in the scene.
    pub(crate) fn leg_index(&self) -> usize {
        self.leg_index
    }

    /// Leg of the picture.
    pub(crate) fn leg(&self) -> &'a LegFile {
        self.leg
    }

    /// Begins a period.
    pub(crate) fn restart(&mut self) {
        self.sums = Sums::empty(self.anatomy.len());
    }

    /// Hands on a report.
    pub(crate) fn send(&self, update: LiveUpdate) {
        (self.out)(update);
    }

    /// Adds a line to the timeline.
    pub(crate) fn note(&self, weight: Severity, words: impl Into<String>) {
        let time_s = rounded(self.time_s);
        self.send(LiveUpdate::Note(LiveNote { time_s, weight, words: words.into() }));
    }

    /// Takes the commanded angles of one servo tick, D-H, rad.
    pub(crate) fn command(&mut self, position_rad: &[f32]) {
        self.sums.ticks += 1;
        for (sum, angle) in self.sums.commanded.iter_mut().zip(position_rad) {
            *sum += f64::from(*angle);
        }
    }

    /// Adds a logged sample to the means and to the progress of the identification. In the motion to identify
    /// from, least squares over the motion so far are reported each second. A torque that is not a number is
    /// unknown.
    pub(crate) fn learn(&mut self, logged: &ChainSample, progress: &mut dyn Progress) {
        self.log(logged);
        if !logged.torque_nm.iter().all(|torque| torque.is_finite()) {
            progress.break_off();
            return;
        }
        let Some(row) = progress.push(logged) else { return };
        self.row(&row);
        if let Some(base) = progress.estimate() {
            self.estimate(EstimateOrigin::Motion, 0, &base);
        }
    }

    /// Adds a logged sample to the means; the last one of a period ends it.
    fn log(&mut self, logged: &ChainSample) {
        let sums = &mut self.sums;
        sums.logged += 1;
        for joint in 0..self.anatomy.len() {
            sums.angle[joint] += f64::from(logged.position_rad[joint]);
            sums.torque[joint] += f64::from(logged.torque_nm[joint]);
        }
        if sums.logged < SAMPLES {
            return;
        }
        let joints = self.anatomy.len();
        let sums = core::mem::replace(&mut self.sums, Sums::empty(joints));
        let angles: Vec<f64> = sums.angle.iter().map(|sum| sum / f64::from(SAMPLES)).collect();
        let anatomical = |joint: usize, angle: f64| self.anatomy[joint].angle_from_chain(angle) as f32;
        let torque = |joint: usize| {
            let torque = self.anatomy[joint].from_chain(sums.torque[joint] / f64::from(SAMPLES));
            Some(torque).filter(|torque| torque.is_finite())
        };
        let commanded = |joint: usize| {
            (sums.ticks > 0).then(|| anatomical(joint, sums.commanded[joint] / f64::from(sums.ticks)))
        };
        let current = |joint: usize| {
            let torque = torque(joint).filter(|_| self.has_currents)?;
            Some((torque / self.leg.joints[joint].torque_per_ampere) as f32)
        };
        let sample = LiveSample {
            leg: self.leg_index,
            time_s: rounded(self.time_s - HALF_PERIOD_S),
            angle_rad: (0..joints).map(|joint| anatomical(joint, angles[joint])).collect(),
            commanded_rad: (0..joints).map(commanded).collect(),
            torque_nm: (0..joints).map(|joint| torque(joint).map(|torque| torque as f32)).collect(),
            current_a: (0..joints).map(current).collect(),
            points_m: self.stick.points(&angles),
        };
        self.send(LiveUpdate::Sample(sample));
    }

    /// Reports a row.
    fn row(&mut self, row: &PredictedRow) {
        let signed = |joint: usize, torque: f32| self.anatomy[joint].from_chain(f64::from(torque)) as f32;
        let (measured, predicted) = (row.measured.iter().enumerate(), row.predicted.iter().enumerate());
        let row = LiveRow {
            leg: self.leg_index,
            time_s: rounded(self.time_s - HALF_SAMPLE_S - row.age_s),
            measured_nm: measured.map(|(joint, torque)| signed(joint, *torque)).collect(),
            predicted_nm: predicted
                .map(|(joint, torque)| torque.map(|torque| signed(joint, torque)))
                .collect(),
        };
        self.send(LiveUpdate::Row(row));
    }

    /// Reports an estimate.
    pub(crate) fn estimate(&mut self, origin: EstimateOrigin, iterations: u32, base: &[BaseReport]) {
        let values = base.iter().map(|base| LiveParameter {
            name: base.name.clone(),
            unit: base.unit,
            value: base.value,
            sigma: base.sigma,
            truth: base.truth,
        });
        let (time_s, values) = (rounded(self.time_s), values.collect());
        self.send(LiveUpdate::Estimate(LiveEstimate {
            leg: self.leg_index,
            time_s,
            origin,
            iterations,
            values,
        }));
    }

    /// Reports the end of a run.
    pub(crate) fn conclude(&mut self, report: &RunReport) {
        self.estimate(EstimateOrigin::Result, report.bso.iterations, &report.base_parameters);
        self.send(LiveUpdate::Outcome(LiveOutcome {
            leg: self.leg_index,
            verdict: report.verdict.into(),
            validated: report.validated,
            reasons: report.reasons.iter().map(|reason| (*reason).into()).collect(),
            findings: report.findings.clone(),
        }));
        let (weight, words) = match report.accepted() {
            true => (Severity::Note, "verdict: accepted".into()),
            false => (Severity::Warning, format!("verdict: refused, {}", report.reasons.join(", "))),
        };
        self.note(weight, words);
    }
}

/// Time in whole microseconds, s.
fn rounded(time_s: f64) -> f64 {
    (time_s * 1e6).round() / 1e6
}
