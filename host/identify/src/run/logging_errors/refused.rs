//! The refused fit, and what corrections leave of its misfit.

use scarab::real::dot;

use crate::report::doubt::{CauseReport, DirectionReport};
use crate::run::logging_errors::corrections::{Correction, corrected};
use crate::run::logging_errors::directions::{Directions, Found, SMALLEST_SYSTEMATIC};
use crate::run::logging_errors::fit::{segment_sigma, solve};
use crate::run::logging_errors::midway::Midway;
use crate::run::logging_errors::rows::{Equations, Motion};
use crate::run::logging_errors::table::Table;
use crate::run::logging_errors::{LoggingErrors, Question, Refitted, midway_words};

/// Sigma by which a parameter may be negative.
const NEGATIVE_SIGMA: f64 = 5.0;
/// Ratio of a joint's torque to the prior's, beyond which its unit is wrong.
const PLAUSIBLE_RATIO: f64 = 30.0;
/// Share of the misfit from which an error is named although its size lies beyond the search.
const BEYOND: f64 = 0.3;
/// Share of the misfit beyond the noise that a cause explains which is named alone.
pub(super) const HALF: f64 = 0.5;
/// Share for samples that are read in another way, which leaves no part of an error.
const EXACT: f64 = 0.8;
/// Share of the misfit beyond the noise that a possible cause explains.
const TENTH: f64 = 0.1;
/// Misfits closer than this ratio count as equal: the simpler correction is named.
const EQUAL: f64 = 1.1;
/// Largest number of possible causes that are listed.
const LISTED: usize = 3;
/// Misfit over the torque of a leg in whose columns no unit is wrong.
const ALMOST: f64 = 0.05;
/// Misfit over the torque up to which one correction may be all that is wrong.
const SMALL_MISFIT: f64 = 0.2;

/// Significance of a direction that is named where no other cause is found.
pub(super) const WEAKER: f64 = 3.0;
/// Name of a cause that no correction explains.
pub(crate) const UNKNOWN: &str = "unknown";

/// Quality of a fit.
#[derive(Clone, Debug)]
pub(super) struct Quality {
    /// Power of each joint's misfit over that of its torque.
    pub(super) left: Vec<f64>,
    pub(super) sound: bool,
}

impl Quality {
    pub(super) fn remaining(&self) -> f64 {
        mean(&self.left).sqrt()
    }
}

/// A corrected error with its fit.
#[derive(Clone)]
pub(super) struct Tried {
    pub(super) cause: CauseReport,
    pub(super) quality: Quality,
    /// All parameters beside the error; empty where the samples are read in another way.
    pub(super) values: Vec<f64>,
    /// Size of the error over its standard deviation; infinite without one.
    pub(super) significance: f64,
    /// Whether the samples are read in another way, without a value to fit.
    is_exact: bool,
    /// Whether a finding refuses the recording for it.
    refuses: bool,
    /// Whether the same error of another joint cannot be distinguished.
    pub(super) is_shared: bool,
}

/// The refused fit, with which every correction is compared.
pub(super) struct Refused<'a> {
    pub(super) question: &'a Question,
    pub(super) errors: &'a LoggingErrors,
    quality: Quality,
    /// Sum of squared weighted residuals of each joint.
    cost: Vec<f64>,
    /// Standard deviation of each parameter.
    sigma: Vec<f64>,
    /// Misfit of each joint for the nearest leg whose parameters have their sign, like [`Quality::left`].
    positive: Vec<f64>,
    /// Part of each joint's misfit that is noise.
    noise: Vec<f64>,
    /// Whether the torque has the prior's sign and size.
    agrees: bool,
}

impl<'a> Refused<'a> {
    pub(super) fn new(question: &'a Question, errors: &'a LoggingErrors) -> Self {
        let all = &errors.equations;
        let fit = all.fit(&all.columns, &all.torque, false);
        let quality = quality(question, all);
        let noise = quality.left.iter().zip(&errors.misfit_over_noise).map(|(left, ratio)| {
            let ratio = ratio.unwrap_or(f64::INFINITY).max(1.0);
            left / (ratio * ratio)
        });
        let mut refused = Self {
            question,
            errors,
            cost: all.cost_of_joints(&fit.residuals(&all.columns, &all.torque)),
            sigma: errors.sigma.iter().map(|sigma| sigma.noise.max(sigma.segments)).collect(),
            positive: Vec::new(),
            noise: noise.collect(),
            agrees: agrees(question, all, &all.columns, &all.torque),
            quality,
        };
        refused.positive = refused.positive();
        refused
    }

    /// Misfit of the nearest leg in which no parameter that must be positive is negative.
    fn positive(&self) -> Vec<f64> {
        let Equations { columns, torque, weight, active, known, .. } = &self.errors.equations;
        let mut active = active.clone();
        loop {
            let fit = solve(columns, torque, weight, &active, known);
            let is_negative =
                |base: &usize| active[*base] && fit.values[*base] < 0.0 && self.question.is_bounded(*base);
            let negative: Vec<usize> = (0..active.len()).filter(is_negative).collect();
            if negative.is_empty() {
                return self.left(&fit.values, columns, torque);
            }
            negative.into_iter().for_each(|base| active[base] = false);
        }
    }

    /// Misfit that these parameters leave to each joint.
    fn left(&self, values: &[f64], columns: &Table, torque: &[f64]) -> Vec<f64> {
        let residuals: Vec<f64> =
            columns.rows().zip(torque).map(|(row, torque)| torque - dot(row, values)).collect();
        let left = self.errors.equations.cost_of_joints(&residuals);
        let joints = left.iter().zip(&self.cost).zip(&self.quality.left);
        joints.map(|((left, cost), plain)| plain * left / cost.max(1e-300)).collect()
    }

    /// Share of the misfit beyond the noise that a correction explains.
    pub(super) fn explained(&self, tried: &Tried) -> f64 {
        explained(mean(&self.positive), mean(&self.noise), mean(&tried.quality.left))
    }

    /// Joint of whose misfit a correction explains most, and the share.
    fn explained_of_joint(&self, tried: &Tried) -> (usize, f64) {
        let each = self.positive.iter().zip(&self.noise).zip(&tried.quality.left);
        let shares = each.map(|((plain, noise), left)| explained(*plain, *noise, *left)).enumerate();
        shares.max_by(|one, other| one.1.total_cmp(&other.1)).unwrap_or_default()
    }

    /// Whether a cause is named alone. A torque unlike the prior's shows an error whatever else is wrong.
    /// Samples that are read in another way must fit as well as the refused leg. A leg that almost fits has
    /// no wrong unit.
    pub(super) fn is_named_alone(&self, tried: &Tried) -> bool {
        let almost_fits = self.agrees && self.quality.sound && self.quality.remaining() < ALMOST;
        if almost_fits && !tried.cause.reads.is_empty() {
            return false;
        }
        let fits = tried.quality.remaining() < SMALL_MISFIT.max(EQUAL * self.quality.remaining());
        let (least, fits) = if tried.is_exact { (EXACT, fits) } else { (HALF, true) };
        fits && (self.explained(tried) >= least || !self.agrees)
    }

    /// Whether the torque is unlike the prior's.
    pub(super) fn is_alien(&self) -> bool {
        !self.agrees
    }

    /// Whether two corrections explain the misfit alike, and leave alike of it.
    pub(super) fn are_equal(&self, one: &Tried, other: &Tried) -> bool {
        are_close(one, other) && (self.explained(one) - self.explained(other)).abs() < TENTH
    }

    pub(super) fn tried(&self, refitted: Refitted) -> Tried {
        let Refitted { cause, values, columns, torque, significance } = refitted;
        let sound = is_sound(self.question, &values[..self.sigma.len()], &self.sigma)
            && agrees(self.question, &self.errors.equations, &columns, &torque);
        let quality = Quality { left: self.left(&values, &columns, &torque), sound };
        let mut tried =
            Tried { cause, quality, values, significance, is_exact: false, refuses: false, is_shared: false };
        tried.cause.explained = self.explained(&tried).into();
        tried
    }

    /// A gain that changes midway.
    pub(super) fn midway(&self, midway: &Midway) -> Tried {
        let all = &self.errors.equations;
        let torque = midway.corrected(all);
        let values = all.fit(&all.columns, &torque, false).values;
        let significance = midway.change.abs() / midway.sigma;
        let cause = changed_midway(midway);
        let columns = all.columns.clone();
        let tried = self.tried(Refitted { cause, values, columns, torque, significance });
        Tried { refuses: true, ..tried }
    }

    /// Directions that are more than chance, then each kind that several joints show at once.
    pub(super) fn directions(&self) -> Vec<Tried> {
        let Self { question, errors, .. } = self;
        let all = &errors.equations;
        let directions = Directions { equations: all, zero: question.zero(), axis: question.axis };
        let mut tried: Vec<Tried> = Vec::new();
        let mut kinds: Vec<Vec<(&Found, &DirectionReport)>> = Vec::new();
        for (found, report) in errors.found.iter().zip(&errors.directions) {
            let is_estimate = !found.at_limit || found.explained() > BEYOND;
            if found.significance() < WEAKER || !is_estimate {
                continue;
            }
            let (columns, torque) = directions.system(found.kind, found.value);
            let refitted = Refitted {
                cause: CauseReport::direction(found, report),
                values: found.values.clone(),
                columns: columns.into_owned(),
                torque: torque.into_owned(),
                significance: found.significance(),
            };
            let is_shared = found.alike.iter().any(|other| other.starts_with(found.kind.name()));
            tried.push(Tried { is_shared, refuses: !report.passed, ..self.tried(refitted) });
            if found.kind.is_combined() && !found.at_limit {
                match kinds.iter_mut().find(|kind| kind[0].0.kind.name() == found.kind.name()) {
                    Some(kind) => kind.push((found, report)),
                    None => kinds.push(vec![(found, report)]),
                }
            }
        }
        for kind in kinds.into_iter().filter(|kind| kind.len() > 1) {
            let mut columns = all.columns.clone();
            let mut torque = all.torque.clone();
            for (found, _) in &kind {
                let (own_columns, own_torque) = directions.system(found.kind, found.value);
                let rows = columns.rows_mut().zip(&mut torque).zip(own_columns.rows().zip(&*own_torque));
                for (((row, torque), (own_row, own_torque)), source) in rows.zip(&all.sources) {
                    if Some(source.joint) == found.kind.joint() {
                        row.copy_from_slice(own_row);
                        *torque = *own_torque;
                    }
                }
            }
            let words: Vec<String> = kind.iter().map(|(_, report)| report.words()).collect();
            tried.push(self.tried(Refitted {
                cause: CauseReport {
                    name: kind[0].0.kind.name(),
                    words: words.join("; "),
                    ..CauseReport::default()
                },
                values: all.fit(&columns, &torque, false).values,
                columns,
                torque,
                significance: kind.iter().map(|(found, _)| found.significance()).fold(0.0, f64::max),
            }));
        }
        tried
    }

    /// No cause, and the corrections that explain part of the misfit.
    pub(super) fn unknown(&self, tried: Vec<Tried>) -> CauseReport {
        let mut possible = tried;
        // What explains most of one joint's misfit may be hidden by the misfit of another.
        possible.retain(|tried| tried.refuses || self.explained_of_joint(tried).1 >= TENTH);
        possible.sort_by(|one, other| {
            let shares = [one, other].map(|tried| self.explained_of_joint(tried).1);
            other.refuses.cmp(&one.refuses).then(shares[1].total_cmp(&shares[0]))
        });
        possible.truncate(LISTED);
        let words = if possible.is_empty() {
            "no correction of units and no single one of signs, columns, delay, scale, gravity, clock, spring, drift, crosstalk \
             or friction explains the misfit"
                .into()
        } else {
            let words = |tried: &Tried| {
                let (joint, share) = self.explained_of_joint(tried);
                format!(
                    "{} (explains {:.0} %, of joint {} {:.0} %)",
                    tried.cause.named(),
                    100.0 * self.explained(tried),
                    joint + 1,
                    100.0 * share
                )
            };
            format!(
                "no correction explains enough of the misfit beyond the noise. Possible causes among others: {}",
                possible.iter().map(words).collect::<Vec<_>>().join("; or ")
            )
        };
        let with_share =
            |tried: Tried| CauseReport { explained: self.explained(&tried).into(), ..tried.cause };
        let possible = possible.into_iter().map(with_share).collect();
        CauseReport { name: UNKNOWN, words, possible, ..CauseReport::default() }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Share of a misfit beyond the noise that is gone, 0..1. All are powers; the noise is known to some percent.
fn explained(plain: f64, noise: f64, left: f64) -> f64 {
    let systematic = (plain - noise).max(SMALLEST_SYSTEMATIC * plain).max(1e-300);
    ((plain - left) / systematic).clamp(0.0, 1.0)
}

/// Fit of the corrected motions; `None` with too few rows.
pub(super) fn refit(question: &Question, correction: &Correction) -> Option<Tried> {
    let motions: Vec<Motion> =
        question.motions.iter().map(|motion| corrected(question, motion, correction)).collect();
    let equations = question.equations(&motions).ok().flatten()?;
    let quality = quality(question, &equations);
    let words = format!(
        "{}; then the misfit is {:.1} % of the torque{}",
        correction.words,
        100.0 * quality.remaining(),
        if quality.remaining() < SMALL_MISFIT {
            " and no inertia or friction is negative"
        } else {
            ": there is another error"
        }
    );
    let cause = CauseReport {
        name: correction.name,
        joint: correction.joint.map(|joint| joint + 1),
        words,
        reads: correction.reads.clone(),
        ..CauseReport::default()
    };
    Some(Tried {
        cause,
        quality,
        values: Vec::new(),
        significance: f64::INFINITY,
        is_exact: true,
        refuses: false,
        is_shared: false,
    })
}

/// Mean square torque of each joint.
fn power(equations: &Equations) -> Vec<f64> {
    let of_joint = |joint: usize| {
        let torques = equations.sources.iter().zip(&equations.torque);
        let of: Vec<f64> =
            torques.filter(|(source, _)| source.joint == joint).map(|(_, torque)| torque * torque).collect();
        of.iter().sum::<f64>() / of.len().max(1) as f64
    };
    (0..equations.joints()).map(of_joint).collect()
}

pub(super) fn quality(question: &Question, equations: &Equations) -> Quality {
    let fit = equations.fit(&equations.columns, &equations.torque, false);
    let Equations { columns, torque, weight, .. } = equations;
    let scatter = segment_sigma(&fit, columns, torque, weight, &equations.clusters());
    let sigma: Vec<f64> = scatter
        .iter()
        .enumerate()
        .map(|(base, scatter)| fit.inverse[base][base].max(0.0).sqrt().max(*scatter))
        .collect();
    let each = equations.row_sigma.iter().zip(power(equations));
    Quality {
        left: each
            .map(|(sigma, power)| sigma * sigma * equations.information() / power.max(1e-300))
            .collect(),
        sound: is_sound(question, &fit.values, &sigma)
            && agrees(question, equations, &equations.columns, &equations.torque),
    }
}

/// Whether every parameter that must be positive is so within 5 sigma.
fn is_sound(question: &Question, values: &[f64], sigma: &[f64]) -> bool {
    (0..values.len())
        .filter(|&base| question.active[base] && question.is_bounded(base))
        .all(|base| values[base] > -NEGATIVE_SIGMA * sigma[base])
}

/// Whether the torque has the sign and size of the prior's; without a prior, at most thrice the joint's
/// limit.
fn agrees(question: &Question, equations: &Equations, columns: &Table, torque: &[f64]) -> bool {
    let rows = || equations.sources.iter().zip(torque).zip(columns.rows());
    let Some(prior) = &question.prior else {
        return rows().all(|((source, torque), _)| torque.abs() < 3.0 * question.torque_limit[source.joint]);
    };
    let zeros = || vec![0.0; equations.joints()];
    let (mut along, mut measured, mut expected) = (0.0, zeros(), zeros());
    for ((source, torque), row) in rows() {
        let guess = dot(row, prior);
        along += guess * torque;
        measured[source.joint] += torque * torque;
        expected[source.joint] += guess * guess;
    }
    along > 0.0
        && measured.iter().zip(expected).all(|(measured, expected)| {
            let ratio = (measured / expected.max(1e-300)).sqrt();
            (1.0 / PLAUSIBLE_RATIO..PLAUSIBLE_RATIO).contains(&ratio)
        })
}

/// Whether two corrections leave nearly the same misfit.
pub(super) fn are_close(one: &Tried, other: &Tried) -> bool {
    let [one, other] = [one, other].map(|tried| tried.quality.remaining());
    one.max(other) <= EQUAL * one.min(other)
}

/// A gain that changes midway.
pub(super) fn changed_midway(midway: &Midway) -> CauseReport {
    CauseReport {
        name: "changed_midway",
        joint: midway.joint.map(|joint| joint + 1),
        value: midway.change.into(),
        sigma: midway.sigma.into(),
        words: midway_words(midway),
        ..CauseReport::default()
    }
}
