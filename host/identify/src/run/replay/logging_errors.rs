//! Checks the recordings of a replay for errors of the logging chain, and adds the results to its report.

mod additional;
mod units;

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;
use scarab::ident::{Choice, Reason, Record, RowModel, Solver, noise, prior_parameters};
use scarab::model::friction::Stribeck;
use scarab::model::{AnatomicalJoint, PARAMETERS_PER_JOINT, Parameter};
use scarab_base::error::ToolError;
use scarab_base::names::parameter_name;
use scarab_base::stats::quantile;

use crate::formats::leg_file::geometry::anatomy;
use crate::formats::leg_file::{JointFile, LegFile};
use crate::formats::recording::Recording;
use crate::leg::additional_torque::Additional;
use crate::leg::background::Background;
use crate::report::doubt::{BandwidthReport, CauseReport, ReadAs, RecordingsReport};
use crate::report::findings::FindingReport;
use crate::report::{ACCEPTED, ACCEPTED_WITH_MISFIT, EXPLAINED_BY_NOISE, REFUSED, RunReport};
use crate::run::logging_errors::encoder::{Encoder, Encoders};
use crate::run::logging_errors::regressor::Regressor;
use crate::run::logging_errors::rows::{Equations, Filters, Motion};
use crate::run::logging_errors::table::Table;
use crate::run::logging_errors::{
    LoggingErrors, Question, cause, corrections, noise as scatter, refused, sample_finding,
};
use crate::run::replay::cleaning::cleaned;
use crate::run::replay::read::{Parts, Whole, parts};
use crate::run::replay::recordings::leave_one_out;
use crate::run::replay::rows::{GRID_S, bandwidth_error};
use crate::run::replay::screening::Screening;
use crate::run::replay::{Recordings, ReplayOptions};
use crate::run::resample::{Resampled, TRUSTED_BANDWIDTH};

/// Share of a limit of the prior from which a parameter counts as at the limit.
const AT_LIMIT: f64 = 0.98;

/// Density of each joint's torque noise at the recordings' own rates, (N m)^2 s.
pub(super) fn noise_density<const N: usize>(recordings: &[Recording], bandwidth_hz: f64) -> [Option<f64>; N] {
    let clean: Vec<Recording> = recordings.iter().map(|recording| cleaned::<N>(recording).0).collect();
    core::array::from_fn(|joint| {
        let parts = clean.iter().filter_map(|recording| {
            Some(scatter::scatter(&recording.time_s, &recording.joints.get(joint)?.torque_nm, bandwidth_hz))
        });
        scatter::density(parts.flatten().collect())
    })
}

/// Standard deviation of a 500 Hz sample with noise of these densities; zero where unknown.
pub(super) fn sample_noise<const N: usize>(density: &[Option<f64>; N]) -> [f32; N] {
    density
        .map(|density| density.map_or(0.0, |density| (density * scarab::ident::SAMPLE_RATE_HZ).sqrt() as f32))
}

/// Whether noise explains the misfit of every joint's best fit. Only then limits follow from the noise.
pub(super) fn is_explained_by_noise<const N: usize, const B: usize>(record: &Record<f32, N, B>) -> bool {
    let rows = noise(record);
    (0..N).all(|joint| {
        let misfit = rows[joint] * record.row_information.sqrt();
        record
            .filtered_noise(joint)
            .is_some_and(|noise| f64::from(misfit) <= EXPLAINED_BY_NOISE * f64::from(noise))
    })
}

/// Recordings on the grid, in chain angles and torques, cut at excluded stretches; and the file of each part.
fn motions<const N: usize>(
    wholes: &[Whole],
    anatomy: &[AnatomicalJoint<f64>; N],
    robust: bool,
    screening: &Screening,
) -> (Vec<Motion>, Vec<usize>) {
    let parts = |(file, whole): (usize, &Whole)| {
        let clean = if robust { cleaned::<N>(&whole.recording).0 } else { whole.recording.clone() };
        let grid = Resampled::new(&clean);
        let chain = |values: [f64; N], of: fn(&AnatomicalJoint<f64>, f64) -> f64| -> [f64; N] {
            core::array::from_fn(|joint| of(&anatomy[joint], values[joint]))
        };
        let motion = |points: Range<usize>| Motion {
            training_s: whole.training_s - points.start as f64 * GRID_S,
            within_s: [points.start as f64 * GRID_S, grid.len() as f64 * GRID_S],
            position: Table::of_rows(
                N,
                points
                    .clone()
                    .filter_map(|point| grid.position_rad::<N>(point))
                    .map(|values| chain(values, |joint, angle| joint.angle_to_chain(angle))),
            ),
            torque: Table::of_rows(
                N,
                points
                    .filter_map(|point| grid.torque_nm::<N>(point))
                    .map(|values| chain(values, |joint, torque| joint.to_chain(torque))),
            ),
        };
        let mut parts = Vec::new();
        let mut begin = 0;
        for excluded in screening.excluded(&whole.recording, grid.start_s) {
            if begin < excluded.start.min(grid.len()) {
                parts.push(motion(begin..excluded.start.min(grid.len())));
            }
            begin = begin.max(excluded.end);
        }
        if begin < grid.len() {
            parts.push(motion(begin..grid.len()));
        }
        parts.into_iter().map(move |part| (part, file))
    };
    wholes.iter().enumerate().flat_map(parts).unzip()
}

/// Encoders of the recordings' angles: the coarsest of each joint, at the median time of the samples.
pub(super) fn encoders(wholes: &[Whole], leg: &LegFile) -> Encoders {
    let steps_s = wholes.iter().map(|whole| whole.recording.median_step_s()).collect();
    let joint = |(joint, described): (usize, &JointFile)| {
        let described_rad = described.encoder.step_rad();
        let found = wholes.iter().filter_map(|whole| {
            Encoder::detect(&whole.recording.joints.get(joint)?.position_rad, described_rad)
        });
        found.max_by(|one, other| one.step_rad.total_cmp(&other.step_rad))
    };
    let joints = leg.joints.iter().enumerate().map(joint).collect();
    Encoders { joints, sample_s: quantile(steps_s, 0.5) }
}

/// Bandwidth for `--bandwidth auto`: the largest at which the encoders' steps are negligible, and which the
/// recordings' rate permits.
pub(super) fn chosen_bandwidth<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
    recordings: &Recordings,
    options: &ReplayOptions,
) -> Result<f64, ToolError> {
    let Parts { wholes, screening, .. } = parts(recordings, options, leg, &[1.0; N], &Additional::default())?;
    let robust = options.estimator == scarab::ident::Estimator::Robust;
    let (motions, _) = motions(&wholes, &anatomy::<N>(leg)?, robust, &screening);
    let encoders = encoders(&wholes, leg);
    let active = vec![true; background.model.base.rank()];
    let largest_hz = TRUSTED_BANDWIDTH / encoders.sample_s;
    let rows = |bandwidth_hz| {
        let mut model = background.model.clone();
        encoders.describe(leg, bandwidth_hz, &mut model);
        let regressor: Arc<dyn Regressor> = Arc::new(model);
        Ok(Equations::new(&regressor, &motions, Filters::new(bandwidth_hz)?, &active))
    };
    encoders.bandwidth_hz(largest_hz, rows).map_err(|error| bandwidth_error(options.bandwidth_hz, error))
}

/// What an examination says besides the report.
pub(super) struct Examined {
    pub(super) warning: Option<String>,
    /// Additional torques with which the recordings are to be identified again.
    pub(super) additional: Option<Additional>,
}

/// Data for all checks of the recordings.
pub(super) struct Subject<'a, const N: usize, const B: usize> {
    pub(crate) leg: &'a LegFile,
    pub(crate) background: &'a Background<N, B>,
    pub(crate) anatomy: &'a [AnatomicalJoint<f64>; N],
    pub(crate) solver: &'a Solver<f32, N, B>,
    pub(crate) wholes: &'a [Whole],
    pub(crate) options: &'a ReplayOptions,
    pub(crate) noise: [Option<f64>; N],
    pub(crate) screening: &'a Screening,
    /// Base parameters of a known load, which the recorded torque contains.
    pub(crate) load: [f32; B],
    /// Torques that were subtracted.
    pub(crate) additional: &'a Additional,
    /// Larger bandwidth that the encoders allow.
    pub(crate) proposed_hz: Option<f64>,
    /// Largest bandwidth of the Stribeck search, where the encoders are too coarse for it.
    pub(crate) stribeck_hz: Option<f64>,
}

impl<const N: usize, const B: usize> Subject<'_, N, B> {
    /// Adds directions, sigma, tests and the likely cause of a refusal to the report. Returns a warning, and
    /// other additional torques to subtract.
    pub(super) fn examine(&self, run: &mut RunReport) -> Result<Examined, ToolError> {
        let samples = &self.screening.findings;
        let (question, file_of) = self.question();
        let mut errors = LoggingErrors::fit(&question)
            .map_err(|error| bandwidth_error(self.options.bandwidth_hz, error))?;
        let mut report = errors.as_ref().map(LoggingErrors::report).unwrap_or_default();
        let mut refined = None;
        if let Some(errors) = &mut errors {
            report.recordings = self.between_recordings(errors, &file_of);
            run.additional_torque = self.additional.torques.clone();
            report.unseen_springs = self.unseen_springs(&question, errors);
            refined = self.refined(run, &question, errors);
            self.widen(run, errors);
            run.findings.extend(errors.findings());
            run.findings.extend(cause::in_degrees(&question, errors).map(|found| {
                let remedy = units::remedy(self.options.import.as_ref(), &found);
                let words = found.words + &remedy.unwrap_or_default();
                let values = [found.value; 2];
                FindingReport::judged(Reason::Input.name(), found.name, found.joint, values, Some(words))
            }));
        }
        run.findings.extend(samples.iter().filter(|found| found.refuses).map(sample_finding));
        let failed =
            |name: &str| run.findings.iter().any(|finding| !finding.passed && finding.reason == name);
        let before: Vec<&str> =
            run.reasons.iter().copied().filter(|name| *name != Reason::Contact.name()).collect();
        run.reasons = Reason::ALL
            .map(Reason::name)
            .into_iter()
            .filter(|name| before.contains(name) || failed(name))
            .collect();
        report.at_prior_limit = at_prior_limit(run);
        report.bandwidth = Some(BandwidthReport {
            bandwidth_hz: self.options.bandwidth_hz,
            is_chosen: self.options.chooses_bandwidth,
            proposed_hz: self.proposed_hz,
            stribeck_hz: self.stribeck_hz,
        });
        report.accept_error_percent = self.options.accept_error_percent;
        let import = self.options.import.as_ref();
        let current =
            errors.as_ref().and_then(|errors| units::current(&question, &errors.equations, import, None));
        let mut suspected = current.as_ref();
        if !run.accepted() {
            let cause = self.likely_cause(&question, errors.as_ref(), &run.findings, &mut suspected);
            correct_words(run, cause.name);
            report.likely_cause = Some(cause);
        }
        // Torques of another scale make another leg, which may be accepted.
        let warning = suspected
            .zip(self.wholes.first())
            .map(|(current, whole)| format!("{}: {}", whole.recording.file.display(), current.words));
        run.doubt = Some(report);
        run.verdict = match (run.accepted(), run.unexplained_misfit()) {
            (true, None) => ACCEPTED,
            (true, Some(_)) => ACCEPTED_WITH_MISFIT,
            (false, _) => REFUSED,
        };
        if let (ACCEPTED_WITH_MISFIT, Some(errors)) = (run.verdict, &mut errors) {
            self.explain_misfit(run, &question, errors);
        }
        additional::correlate(run);
        let wanted = errors.as_ref().and_then(|errors| self.wanted(run, &question, errors));
        Ok(Examined { warning, additional: wanted.or(refined) })
    }

    /// Names what explains the misfit of an accepted leg, and adds its effect on the parameters to sigma.
    fn explain_misfit(&self, run: &mut RunReport, question: &Question, errors: &mut LoggingErrors) {
        let Some((cause, shift)) = cause::of_misfit(question, errors) else { return };
        for (sigma, shift) in errors.sigma.iter_mut().zip(shift) {
            sigma.logging = sigma.logging.hypot(shift);
        }
        self.widen(run, errors);
        if let Some(doubt) = &mut run.doubt {
            doubt.likely_cause = Some(cause);
        }
    }

    /// Likely cause of a refusal, with its remedy. Takes `suspected`, a current, where it is the cause.
    fn likely_cause(
        &self,
        question: &Question,
        errors: Option<&LoggingErrors>,
        findings: &[FindingReport],
        suspected: &mut Option<&CauseReport>,
    ) -> CauseReport {
        let import = self.options.import.as_ref();
        let mut cause = cause::likely(question, errors, &self.screening.findings, findings);
        // A torque in mN m and a current in mA differ by the torque constants only.
        let is_scale = cause.name == refused::UNKNOWN || cause.reads.contains(&ReadAs::MillinewtonMetres);
        if let Some(current) = suspected.take_if(|_| is_scale) {
            return current.clone();
        }
        let with_angles = || {
            let angles = corrections::with_other_angles(question);
            angles
                .iter()
                .filter(|(read, _)| cause.name == refused::UNKNOWN || cause.reads.contains(read))
                .find_map(|(read, equations)| units::current(question, equations, import, Some(*read)))
        };
        if let Some(current) = is_scale.then(with_angles).flatten() {
            return current;
        }
        cause.words += &units::remedy(import, &cause).unwrap_or_default();
        cause
    }

    /// Adds the scatter between recordings to sigma.
    fn between_recordings(&self, errors: &mut LoggingErrors, file_of: &[usize]) -> RecordingsReport {
        let (count, scatter) = leave_one_out(&errors.equations, file_of);
        let Some(scatter) = scatter else { return RecordingsReport { count, sigma: Vec::new() } };
        for (sigma, scatter) in errors.sigma.iter_mut().zip(&scatter) {
            sigma.recordings = *scatter;
        }
        let kept = self.background.kept(&self.solver.record().selection.dropped);
        RecordingsReport { count, sigma: kept.map(|base| scatter[base].into()).collect() }
    }

    /// Input of the checks, and the file of each of its motions.
    fn question(&self) -> (Question, Vec<usize>) {
        let (background, solver) = (self.background, self.solver);
        let dropped = &solver.record().selection.dropped;
        let rank = background.model.base.rank();
        let model = RowModel {
            stribeck_choice: [Choice::Off; N],
            stribeck: background.device.stribeck.map(|curve| Stribeck {
                excess: f64::from(curve.excess),
                velocity: f64::from(curve.velocity),
            }),
            ..background.model.clone()
        };
        let (sine, cosine) = self.leg.joints.first().map_or((0.0, 1.0), |joint| joint.dh.twist().sin_cos());
        let load = self.load.map(f64::from);
        // The recorded torque includes the load's.
        let prior = background.prior.as_ref().map(|prior| {
            let alone = model.base.project(&prior_parameters(prior));
            (0..rank).map(|base| alone[base] + load[base]).collect()
        });
        let estimate = solver.estimate();
        let robust = self.options.estimator == scarab::ident::Estimator::Robust;
        let (motions, file_of) = motions(self.wholes, self.anatomy, robust, self.screening);
        let question = Question {
            active: (0..rank).map(|base| !dropped[base]).collect(),
            anatomy: self.anatomy.to_vec(),
            axis: Vector3::new(0.0, -sine, cosine),
            motions: motions.into(),
            bandwidth_hz: self.options.bandwidth_hz,
            prior,
            torque_limit: self.leg.joints.iter().map(|joint| joint.torque_limit_nm).collect(),
            noise: self.noise.to_vec(),
            motor_ratio: (0..N)
                .map(|joint| self.options.import.as_ref()?.drives.get(joint)?.motor_ratio)
                .collect(),
            encoders: encoders(self.wholes, self.leg),
            accepted_error: self.options.accept_error_percent / 100.0,
            sigma: (0..rank).map(|base| estimate.sigma(base).map_or(0.0, f64::from)).collect(),
            regressor: Arc::new(model),
        };
        (question, file_of)
    }

    /// Replaces the reported standard deviations by the larger ones.
    fn widen(&self, run: &mut RunReport, errors: &LoggingErrors) {
        let kept: Vec<usize> = self.background.kept(&self.solver.record().selection.dropped).collect();
        let mut ratios = vec![1.0; kept.len()];
        for ((base, report), ratio) in kept.iter().zip(&mut run.base_parameters).zip(&mut ratios) {
            let Some(before) = report.sigma.known() else { continue };
            let sigma = errors.sigma[*base];
            report.sigma = sigma.total().into();
            report.sigma_from = sigma.source();
            report.sigma_noise = sigma.noise.into();
            report.sigma_misfit = sigma.misfit().into();
            if before > 0.0 {
                *ratio = sigma.total() / before;
            }
            if report.terms.len() == 1 {
                for parameter in run.parameters.iter_mut().filter(|parameter| parameter.name == report.name) {
                    if parameter.sigma.known().is_some() {
                        parameter.sigma = sigma.total().into();
                    }
                }
            }
        }
        for (row, one) in run.detail.covariance.iter_mut().zip(&ratios) {
            for (element, other) in row.iter_mut().zip(&ratios) {
                *element *= one * other;
            }
        }
    }
}

/// Parameters that end at a limit of the prior: mass at a fifth or five times, rotor and friction at five
/// times.
fn at_prior_limit(run: &RunReport) -> Vec<String> {
    let limited = [Parameter::M, Parameter::IA, Parameter::FC, Parameter::FV];
    let mut found = Vec::new();
    for (index, parameter) in run.parameters.iter().enumerate() {
        let Some(kind) = Parameter::ALL.get(index % PARAMETERS_PER_JOINT) else { continue };
        let (Some(value), Some(prior)) = (parameter.value.known(), parameter.prior.known()) else { continue };
        if !limited.contains(kind) || !(prior > 0.0) {
            continue;
        }
        if value >= 5.0 * AT_LIMIT * prior {
            found.push(format!("{} at five times the prior", parameter.name));
        } else if *kind == Parameter::M && value * AT_LIMIT <= 0.2 * prior {
            found.push(format!("{} at a fifth of the prior", parameter_name(parameter.joint - 1, *kind)));
        }
    }
    found
}

/// Removes the words "computed from the angle" where the sign or unit of the torque is wrong.
fn correct_words(run: &mut RunReport, cause: &str) {
    if !matches!(
        cause,
        "torque_sign"
            | "torque_unit"
            | "angle_unit"
            | "units"
            | "torque_current"
            | "joints_swapped"
            | "direction"
            | "gravity"
    ) {
        return;
    }
    for finding in run.findings.iter_mut().filter(|finding| finding.test == "dynamic_share") {
        if let Some(at) = finding.words.find(": it was computed from the angle") {
            finding.words.truncate(at);
        }
    }
}
