//! Errors of the logging chain that the verdict on a model alone does not detect.
//!
//! Why: a recording with a late torque, or with a wrong encoder scale, fits almost as well as a right one,
//! with wrong parameters and a small sigma. Each such error is fitted beside the parameters and always
//! reported. It refuses the recording where it is significant, changes the parameters, and explains part of
//! the misfit.
//!
//! | file | subject |
//! | --- | --- |
//! | [`regressor`] | the leg's regressor behind an interface without its size |
//! | [`rows`] | filtered rows of whole recordings in double precision, weights |
//! | [`fit`] | least squares, a further column beside it, both standard deviations |
//! | [`beside`] | several further columns; springs and friction by load |
//! | [`directions`] | delay, encoder scale, torque scale, gravity, springs, drifts |
//! | [`lag`] | low-pass or delay of the torque as a cause |
//! | [`assumption`] | clocks, weight, lengths, absolute angles, crosstalk, friction by load as a cause |
//! | [`midway`] | gain or sign of the torque that changes midway |
//! | [`encoder`] | bias by the steps of an encoder |
//! | [`noise`] | noise of the torque at the recording's own rate |
//! | [`samples`], [`stamps`] | samples that no sensor measured, wrong time stamps |
//! | [`cause`] | most likely cause of a refusal, by refits |
//! | [`corrections`] | units, signs and columns that are tried |
//! | [`refused`] | what a correction leaves of the misfit |
//! | [`report`] | JSON and lines |
//!
//! Runs on the host only.

pub(crate) mod assumption;
pub(crate) mod beside;
pub(crate) mod cause;
pub(crate) mod corrections;
pub(crate) mod directions;
pub(crate) mod encoder;
pub(crate) mod fit;
pub(crate) mod lag;
pub(crate) mod midway;
pub(crate) mod noise;
pub(crate) mod refused;
pub(crate) mod regressor;
pub(crate) mod report;
pub(crate) mod rows;
pub(crate) mod samples;
pub(crate) mod stamps;
pub(crate) mod table;

use std::sync::Arc;

use nalgebra::Vector3;
use scarab::ident::KernelError;
use scarab::model::AnatomicalJoint;
use scarab_base::number::Number;

use crate::report::doubt::{CauseReport, DirectionReport, DoubtReport, SampleFinding};
use crate::report::findings::FindingReport;
use directions::{CHANCE, Directions, Found, certain};
use encoder::{Bias, Encoders, LARGEST_NOISE, LARGEST_SHARE};
use midway::Midway;
use regressor::Regressor;
use rows::{Equations, Filters, Motion};
use table::Table;

/// Recordings and the chosen model: input of all checks.
#[derive(Clone)]
pub(crate) struct Question {
    /// Model that was chosen.
    pub(crate) regressor: Arc<dyn Regressor>,
    /// Columns that were estimated.
    pub(crate) active: Vec<bool>,
    /// Anatomical angles of the joints.
    pub(crate) anatomy: Vec<AnatomicalJoint<f64>>,
    /// Axis of the first joint in the base frame.
    pub(crate) axis: Vector3<f64>,
    /// Whole recordings.
    pub(crate) motions: Arc<[Motion]>,
    /// Bandwidth of the rows, Hz.
    pub(crate) bandwidth_hz: f64,
    /// Base parameters of the prior.
    pub(crate) prior: Option<Vec<f64>>,
    /// Torque limit of each joint, N m.
    pub(crate) torque_limit: Vec<f64>,
    /// Density of each joint's torque noise, (N m)^2 s.
    pub(crate) noise: Vec<Option<f64>>,
    /// Standard deviation of each base parameter by noise.
    pub(crate) sigma: Vec<f64>,
    /// Motor turns per joint turn, where the leg file states an encoder at the motor.
    pub(crate) motor_ratio: Vec<Option<f64>>,
    /// How the angles were read.
    pub(crate) encoders: Encoders,
    /// Error of a joint's torque that is accepted, as a share of its root mean square.
    pub(crate) accepted_error: f64,
}

impl Question {
    /// Number of joints.
    pub(crate) fn joints(&self) -> usize {
        self.regressor.joints()
    }

    /// Whether a base parameter must be positive.
    pub(crate) fn is_bounded(&self, base: usize) -> bool {
        self.regressor.carrier(base).is_some_and(|(_, kind)| kind.is_never_negative())
    }

    /// Chain angles of the joints' zeros, rad.
    pub(crate) fn zero(&self) -> Vec<f64> {
        self.anatomy.iter().map(|joint| joint.zero_offset()).collect()
    }

    /// This input with every column, without Stribeck friction and without knowledge of offsets; `None` if
    /// nothing changes.
    pub(crate) fn with_all_columns(&self) -> Option<Self> {
        let without_knowledge = self.regressor.without_knowledge();
        if without_knowledge.is_none() && self.active.iter().all(|on| *on) {
            return None;
        }
        let regressor = without_knowledge.unwrap_or_else(|| self.regressor.clone());
        Some(Self { active: vec![true; regressor.rank()], regressor, ..self.clone() })
    }

    /// Equations of other motions under this model; `None` with too few rows.
    ///
    /// # Errors
    /// The filter cannot be built for the bandwidth.
    pub(crate) fn equations(&self, motions: &[Motion]) -> Result<Option<Equations>, KernelError> {
        self.equations_at(motions, self.bandwidth_hz)
    }

    /// Equations of other motions at another bandwidth.
    ///
    /// # Errors
    /// The filter cannot be built for the bandwidth.
    pub(crate) fn equations_at(
        &self,
        motions: &[Motion],
        bandwidth_hz: f64,
    ) -> Result<Option<Equations>, KernelError> {
        let regressor = self.regressor_at(bandwidth_hz);
        Ok(Equations::new(&regressor, motions, Filters::new(bandwidth_hz)?, &self.active))
    }

    fn regressor_at(&self, bandwidth_hz: f64) -> Arc<dyn Regressor> {
        self.regressor.with_bandwidth(bandwidth_hz / self.bandwidth_hz)
    }

    /// Bandwidth at which the encoders' steps are negligible, if they are not at this one.
    ///
    /// # Errors
    /// The filter cannot be built for the bandwidth.
    fn calmer_hz(&self) -> Result<Option<f64>, KernelError> {
        let hz = self.encoders.bandwidth_hz(self.bandwidth_hz, |hz| self.equations_at(&self.motions, hz))?;
        Ok((hz < self.bandwidth_hz).then_some(hz))
    }

    /// This input at a lower bandwidth.
    fn at(&self, bandwidth_hz: f64) -> Self {
        Self { regressor: self.regressor_at(bandwidth_hz), bandwidth_hz, ..self.clone() }
    }
}

/// An error that was corrected in the rows, with the parameters fitted beside it.
pub(crate) struct Refitted {
    /// The error as a cause.
    pub(crate) cause: CauseReport,
    /// All parameters, then those of further columns.
    pub(crate) values: Vec<f64>,
    /// Columns of the parameters, then further ones.
    pub(crate) columns: Table,
    /// Torques that they explain.
    pub(crate) torque: Vec<f64>,
    /// Size of the error over its standard deviation; infinite without one.
    pub(crate) significance: f64,
}

/// Results of all checks.
pub(crate) struct LoggingErrors {
    /// Rows of all recordings.
    pub(crate) equations: Equations,
    /// Directions with their fits.
    pub(crate) found: Vec<Found>,
    /// Directions as reported.
    pub(crate) directions: Vec<DirectionReport>,
    /// Change midway.
    pub(crate) midway: Option<Midway>,
    /// Misfit over noise of each joint; `None` where the noise is unknown.
    pub(crate) misfit_over_noise: Vec<Option<f64>>,
    /// Standard deviation of each base parameter: noise, scatter over segments, and possible errors that were
    /// not refused.
    pub(crate) sigma: Vec<Sigma>,
    /// Effect of the encoders' steps; `None` where they are negligible.
    pub(crate) encoder: Option<Bias>,
    /// Bandwidth at which the steps are negligible, Hz; only where they refuse.
    better_hz: Option<f64>,
    /// Standard deviations by which the leg's weight shows in the torque; `None` for a leg without weight, or
    /// of one joint.
    weight: Option<f64>,
}

/// Standard deviation of a parameter in its parts.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sigma {
    /// Part caused by noise.
    pub(crate) noise: f64,
    /// Part caused by the scatter over segments of the recording.
    pub(crate) segments: f64,
    /// Part caused by the scatter between recordings; zero where unknown.
    pub(crate) recordings: f64,
    /// Part caused by directions that are not significant, and by columns that were dropped.
    pub(crate) logging: f64,
    /// Part caused by the steps of the encoders.
    pub(crate) encoder: f64,
}

impl Sigma {
    /// Part caused by unmodelled effects.
    pub(crate) fn misfit(&self) -> f64 {
        self.segments.max(self.recordings)
    }

    /// Reported value.
    pub fn total(&self) -> f64 {
        self.noise.max(self.misfit()).hypot(self.logging).hypot(self.encoder)
    }

    /// Largest part.
    pub(crate) fn source(&self) -> &'static str {
        let scatter = self.noise.max(self.misfit());
        if self.logging.max(self.encoder) > scatter {
            if self.encoder > self.logging { "encoder" } else { "doubt" }
        } else if self.recordings > self.noise.max(self.segments) {
            "recordings"
        } else if self.segments > self.noise {
            "segments"
        } else {
            "noise"
        }
    }
}

impl LoggingErrors {
    /// Fits every direction; `None` where a joint has too few rows.
    ///
    /// # Errors
    /// The filter cannot be built for the bandwidth.
    pub(crate) fn fit(question: &Question) -> Result<Option<Self>, KernelError> {
        let Some(equations) = question.equations(&question.motions)? else { return Ok(None) };
        let found = Directions { equations: &equations, zero: question.zero(), axis: question.axis }.all();
        let fit = equations.fit(&equations.columns, &equations.torque, true);
        let scatter = equations.scatter(&fit);
        let encoder = question.encoders.bias(&equations, &fit, question.bandwidth_hz)?;
        let better_hz = match &encoder {
            Some(bias) if bias.refuses() => question.calmer_hz()?,
            _ => None,
        };
        let parts = question.sigma.iter().zip(&scatter).enumerate();
        let mut sigma: Vec<Sigma> = parts
            .map(|(base, (&noise, &segments))| Sigma {
                noise,
                segments,
                encoder: encoder.as_ref().map_or(0.0, |bias| bias.sigma[base]),
                ..Sigma::default()
            })
            .collect();
        let misfit_over_noise = |joint: usize| {
            let misfit = equations.row_sigma[joint] * equations.information().sqrt();
            let noise = (question.noise[joint]? * scarab::ident::SAMPLE_RATE_HZ * equations.energy()).sqrt();
            (noise > 0.0).then(|| misfit / noise)
        };
        let misfit_over_noise: Vec<_> = (0..equations.joints()).map(misfit_over_noise).collect();
        let systematic = systematic(&misfit_over_noise, &equations.rows);
        let parameters: Vec<f64> = sigma.iter().map(Sigma::total).collect();
        let directions: Vec<DirectionReport> = found
            .iter()
            .map(|found| DirectionReport::new(found, &parameters, systematic, question))
            .collect();
        for (found, _) in found.iter().zip(&directions).filter(|(_, report)| report.passed) {
            for (sigma, variance) in sigma.iter_mut().zip(found.variance()) {
                sigma.logging = sigma.logging.hypot(variance.sqrt());
            }
        }
        let load = assumption::load_friction(question, &equations);
        let plain = equations.fit(&equations.columns, &equations.torque, false).values;
        for (sigma, (with, without)) in sigma.iter_mut().zip(load.values.iter().zip(&plain)) {
            sigma.logging = sigma.logging.hypot((with - without) * certain(load.significance).sqrt());
        }
        let all = equations.with_all_columns();
        let with = all.fit(&all.columns, &all.torque, false).values;
        for (base, sigma) in sigma.iter_mut().enumerate().filter(|(base, _)| equations.active[*base]) {
            sigma.logging = sigma.logging.hypot(with[base] - plain[base]);
        }
        let midway = midway::find(&equations);
        let weight = weight(&equations);
        Ok(Some(Self {
            equations,
            found,
            directions,
            midway,
            misfit_over_noise,
            sigma,
            encoder,
            better_hz,
            weight,
        }))
    }

    /// Findings for the verdict.
    pub fn findings(&self) -> Vec<FindingReport> {
        let mut findings: Vec<FindingReport> = self.directions.iter().map(DirectionReport::finding).collect();
        findings.extend(self.encoder.as_ref().map(|bias| {
            let ((joint, value), limit) = if bias.is_beyond() {
                (bias.largest_noise(), LARGEST_NOISE)
            } else {
                (bias.largest_share(), LARGEST_SHARE)
            };
            let failure = bias.refuses().then(|| self.encoder_words(bias));
            let values = [value, limit].map(Number::from);
            FindingReport::judged("input", "encoder_steps", Some(joint + 1), values, failure)
        }));
        findings.extend(self.weight.map(|weight| {
            let failure = (weight < CHANCE).then(no_gravity_words);
            let values = [weight, CHANCE].map(Number::from);
            FindingReport::judged("input", NO_GRAVITY, None, values, failure)
        }));
        findings.extend(self.midway.as_ref().map(|midway| {
            let failure = midway.refuses().then(|| midway_words(midway));
            let values = [midway.change, midway.limit()].map(Number::from);
            let joint = midway.joint.map(|joint| joint + 1);
            FindingReport::judged("residual", "changed_midway", joint, values, failure)
        }));
        findings
    }

    /// Message about steps that are too coarse.
    fn encoder_words(&self, bias: &Bias) -> String {
        let better = self.better_hz.map_or(String::new(), |hz| format!("; `--bandwidth {hz}` is better"));
        let effect = if bias.is_beyond() {
            let (joint, share) = bias.largest_noise();
            format!(
                "make {:.0} % of the acceleration of joint {}, limit {:.0} %",
                100.0 * share,
                joint + 1,
                100.0 * LARGEST_NOISE
            )
        } else {
            let (joint, share) = bias.largest_share();
            format!(
                "change the torque of joint {} by {:.1} % of its rms, limit {:.1} %",
                joint + 1,
                100.0 * share,
                100.0 * LARGEST_SHARE
            )
        };
        format!("encoder too coarse at this bandwidth: its steps {effect}{better}")
    }

    /// Report without a cause.
    pub(crate) fn report(&self) -> DoubtReport {
        DoubtReport {
            directions: self.directions.clone(),
            misfit_over_noise: self.misfit_over_noise.iter().copied().map(Number::from).collect(),
            ..DoubtReport::default()
        }
    }
}

/// Acceleration of gravity across a joint's axis from which a leg's weight must show, m/s^2.
const LEAST_GRAVITY: f64 = 1.0;

/// Standard deviations by which the weight shows: the misfit without gravity over that with it. The torque of
/// one joint may be balanced, and one about vertical axes holds no weight.
fn weight(equations: &Equations) -> Option<f64> {
    let weightless = equations.regressor.with_gravity(&|_| Vector3::zeros());
    let columns = equations.columns_of(&*weightless, &|_| {});
    let [plain, without] =
        [&equations.columns, &columns].map(|columns| equations.fit(columns, &equations.torque, false).cost);
    let pairs = equations.columns.elements().zip(columns.elements());
    let largest = pairs.map(|(with, without)| (with - without).abs()).fold(0.0, f64::max);
    let has_weight = equations.joints() > 1 && largest > LEAST_GRAVITY;
    has_weight.then(|| (without - plain).max(0.0).sqrt())
}

/// Finding and cause of a torque without weight.
pub(crate) const NO_GRAVITY: &str = "no_gravity";

/// Sentence about a torque without weight.
pub(crate) fn no_gravity_words() -> String {
    "the torque holds no weight: was gravity compensation subtracted? Log the torque of the motors; of a balanced leg, \
     state `gravity = [0, 0, 0]` in the leg file"
        .into()
}

/// Finding about samples, for the verdict.
pub(crate) fn sample_finding(finding: &SampleFinding) -> FindingReport {
    let failure = finding.refuses.then(|| format!("{}: {}", finding.file, finding.text));
    let values = [finding.value.into(), Number::UNKNOWN];
    FindingReport::judged("input", finding.name, finding.joint, values, failure)
}

/// Finding about samples, as the likely cause.
pub(crate) fn sample_cause(finding: &SampleFinding) -> CauseReport {
    CauseReport {
        name: finding.name,
        joint: finding.joint,
        value: finding.value.into(),
        sigma: finding.sigma.into(),
        words: format!("{}: {}", finding.file, finding.text),
        ..CauseReport::default()
    }
}

/// Message about a change midway.
pub(crate) fn midway_words(midway: &Midway) -> String {
    let joints = joint_words(midway.joint);
    let what = if midway.change < -1.0 {
        "changes its sign".into()
    } else {
        format!("changes by {:+.0} +- {:.0} %", 100.0 * midway.change, 100.0 * midway.sigma)
    };
    format!(
        "the torque of {joints} {what} after {:.0} % of {}, which explains {:.0} % of the misfit",
        100.0 * midway.share,
        recording_words(midway.scope),
        100.0 * midway.explained
    )
}

/// One recording, or each, in words.
fn recording_words(scope: Option<usize>) -> String {
    scope.map_or("each recording".into(), |motion| format!("recording {}", motion + 1))
}

/// One joint, or all, in words.
fn joint_words(joint: Option<usize>) -> String {
    joint.map_or("all joints".into(), |joint| format!("joint {}", joint + 1))
}

/// Part of the misfit's power that is not noise, 0..1; one where the noise is unknown.
fn systematic(misfit_over_noise: &[Option<f64>], rows: &[f64]) -> f64 {
    let all: f64 = rows.iter().sum();
    let noise: f64 = misfit_over_noise
        .iter()
        .zip(rows)
        .map(|(ratio, rows)| ratio.map_or(0.0, |ratio| rows / (ratio * ratio).max(1.0)))
        .sum();
    (1.0 - noise / all.max(1.0)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests;
