//! Reports the last complete result of a trace as a run, with the same schema and names.
//!
//! Values, sigma, fits, findings and verdict are the board's own. Names, groups and units come from
//! the leg file, which must be the one that the image was built from. Joints, base parameters and
//! their carriers are compared. Values that the board does not send (search costs in double
//! precision, gains of columns) are unknown, and so is the truth.

use scarab::ident::{Estimate, Estimator, Evidence, Plan, Reason, Selection, Status, Test};
use scarab::model::Parameter;
use scarab_base::error::ToolError;
use scarab_base::names::{VALIDATION_NAMES, estimator_name, plan_name};
use scarab_base::number::Number;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::background::Background;
use scarab_identify::leg::setup::{PriorChoice, background};
use scarab_identify::report::disturbances::{OutliersReport, StribeckReport};
use scarab_identify::report::findings::FindingReport;
use scarab_identify::report::trace::TraceReport;
use scarab_identify::report::{
    ConsistentReport, ConsistentSearchReport, FitReport, ParameterReport, RunReport, SwarmReport,
};
use scarab_identify::run::analysis::{Circumstances, Outcome};
use scarab_identify::with_leg_size;

use crate::trace::read::Trace;
use crate::trace::records::{Finding, Fit, Solver};
use crate::trace::result_records::ResultRecords;

/// What a finished trace tells besides its result.
fn trace_report(trace: &Trace) -> TraceReport {
    TraceReport {
        firmware: trace.boot.as_ref().map(|boot| boot.version.clone()),
        board: trace.board.as_ref().map(crate::trace::events::board),
        records: trace.records,
        lost_records: trace.lost(),
        unreadable_lines: trace.problem_count,
        identifications: trace.results.len(),
        faults: trace.faults().map(|event| event.words.clone()).collect(),
        warnings: trace.warnings(),
        loops: trace.statistics.loops(),
    }
}

/// Report of the last complete result.
///
/// # Errors
/// The trace has no complete result, or the result belongs to another leg.
pub fn run_report(trace: &Trace, leg: &LegFile) -> Result<RunReport, ToolError> {
    let records = trace
        .results
        .last()
        .ok_or_else(|| ToolError::input(format!("the trace {}", trace.without_result())))?;
    check_leg(trace, leg)?;
    with_leg_size!(leg, of_size(trace, records, leg))
}

/// Compares the leg file with the leg that the image was built for.
fn check_leg(trace: &Trace, leg: &LegFile) -> Result<(), ToolError> {
    let Some(boot) = &trace.boot else { return Ok(()) };
    // Words of the grammar contain no space.
    if boot.leg != "-" && boot.leg != leg.name.replace(' ', "_") {
        return Err(other(leg, format!("the image is built for the leg `{}`", boot.leg)));
    }
    if boot.joints != leg.joints.len() {
        let (record, own) = (boot.joints, leg.joints.len());
        return Err(other(leg, format!("the board's leg has {record} joints, this one {own}")));
    }
    Ok(())
}

fn other(leg: &LegFile, reason: impl std::fmt::Display) -> ToolError {
    ToolError::input(format!(
        "leg `{}` is not that of the trace: {reason}. Name the trace's leg with --leg",
        leg.name
    ))
}

fn of_size<const N: usize, const B: usize>(
    trace: &Trace,
    records: &ResultRecords,
    leg: &LegFile,
) -> Result<RunReport, ToolError> {
    let background = known::<N, B>(records, leg)?;
    let found = TracedResult { background: &background, leg, records };
    let solver = records.solver.as_ref().ok_or_else(|| ToolError::input("the result has no solver"))?;
    let (estimate, dropped) = found.base(solver)?;
    let (training, validation): (Vec<_>, Vec<_>) = records.fits.iter().partition(|fit| fit.motion == 0);
    let samples: u32 = records.motions.iter().map(|motion| motion.samples).sum();
    let log_hz = trace.boot.as_ref().map_or(scarab::ident::SAMPLE_RATE_HZ, |boot| f64::from(boot.log_hz));
    let stribeck = found.stribeck();
    let outcome = Outcome {
        plan: word(&solver.plan, &[Plan::OneTime, Plan::Sequential].map(plan_name), "plan")?,
        reasons: found.reasons()?,
        findings: records.findings.iter().map(finding).collect::<Result<_, _>>()?,
        rank: solver.rank,
        condition: solver.condition.into(),
        parameters: found.parameters()?,
        selection: found.selection(dropped),
        torque_rms: core::array::from_fn(|joint| {
            found.training(joint).map_or(f32::NAN, |fit| fit.torque_rms_nm)
        }),
        outliers: found.outliers(),
        training: training.into_iter().map(|fit| fit_report(fit, "fourier".into())).collect(),
        validation: validation.into_iter().map(|fit| fit_report(fit, motion_name(fit.motion))).collect(),
        least_squares: core::array::from_fn(|base| found.least_squares(base)),
        // The board does not send the static friction of the least-squares solution.
        least_squares_surplus: vec![Number::UNKNOWN; stribeck.len()],
        least_squares_cost: Number::UNKNOWN,
        bso: SwarmReport {
            seed: solver.swarm_seed,
            iterations: solver.iterations,
            evaluations: solver.evaluations,
            cost_over_least_squares: Number::UNKNOWN,
            excess_chi2: Number::UNKNOWN,
            iterations_to_half_chi2: None,
        },
        consistent: consistent(solver),
        trace: Some(trace_report(trace)),
        estimate,
        stribeck,
    };
    let circumstances =
        Circumstances { simulated_s: f64::from(samples) / log_hz, ..Circumstances::default() };
    Ok(background.run_report(outcome, &circumstances))
}

/// Background of the leg; a prior only where the board had one.
pub(super) fn known<const N: usize, const B: usize>(
    records: &ResultRecords,
    leg: &LegFile,
) -> Result<Background<N, B>, ToolError> {
    // Only a prior splits sums and fills in parameters that torque does not determine.
    let split =
        records.parameters.iter().filter(|record| ["grouped", "prior"].contains(&record.status.as_str()));
    let has_prior = split.into_iter().any(|record| record.value.is_finite() && record.value != 0.0);
    let choice = if has_prior { PriorChoice::Default } else { PriorChoice::None };
    let mut background = background::<N, B>(leg, choice, 0)?;
    if has_prior && background.prior.is_none() {
        background.prior_name = "unknown".into();
    }
    background.use_estimator(Estimator::default());
    background.truth = None;
    background.stribeck_truth = [None; N];
    Ok(background)
}

/// Result together with the background of its leg.
pub(super) struct TracedResult<'a, const N: usize, const B: usize> {
    pub(crate) background: &'a Background<N, B>,
    pub(crate) leg: &'a LegFile,
    pub(crate) records: &'a ResultRecords,
}

impl<const N: usize, const B: usize> TracedResult<'_, N, B> {
    /// Values, covariance and dropped columns; the base parameters must be the leg file's.
    pub fn base(&self, solver: &Solver) -> Result<(Estimate<f32, B>, [bool; B]), ToolError> {
        let base = &self.background.model.base;
        let rank = base.rank();
        if (solver.base, self.records.base.len()) != (rank, rank) {
            let reason = format!("the board has {} base parameters, this leg {rank}", solver.base);
            return Err(other(self.leg, reason));
        }
        let (mut estimate, mut dropped) = (Estimate::<f32, B>::nothing(), [false; B]);
        let mut seen = [false; B];
        for record in &self.records.base {
            let own =
                base.independent(record.index).map(|(joint, parameter)| (joint + 1, parameter.symbol()));
            if own != Some((record.joint, record.symbol.as_str())) || seen[record.index] {
                let own = own.map_or("nothing".into(), |(joint, symbol)| format!("{symbol}{joint}"));
                return Err(other(
                    self.leg,
                    format!(
                        "its base parameter {} is {own}, the board's {}{}",
                        record.index, record.symbol, record.joint
                    ),
                ));
            }
            (seen[record.index], dropped[record.index]) = (true, record.dropped);
            if record.value.is_finite() {
                (estimate.values[record.index], estimate.determined[record.index]) = (record.value, true);
            }
        }
        for record in &self.records.covariance {
            if record.row >= rank || record.column >= rank {
                return Err(other(self.leg, "the covariance has more rows than there are base parameters"));
            }
            estimate.covariance[record.row][record.column] = record.value;
            estimate.covariance[record.column][record.row] = record.value;
        }
        Ok((estimate, dropped))
    }

    fn parameters(&self) -> Result<Vec<ParameterReport>, ToolError> {
        let background = self.background;
        let truth = background.truth.as_ref();
        let prior = background.prior.as_ref().map(scarab::ident::prior_parameters);
        let mut reports = Vec::with_capacity(N * Parameter::ALL.len());
        for joint in 0..N {
            for parameter in Parameter::ALL {
                let mut all = self.records.parameters.iter();
                let record = all
                    .find(|record| (record.joint, record.symbol.as_str()) == (joint + 1, parameter.symbol()))
                    .ok_or_else(|| {
                        other(
                            self.leg,
                            format!("parameter {}{} is missing in the trace", parameter.symbol(), joint + 1),
                        )
                    })?;
                const STATUS: [Status; 4] =
                    [Status::Identified, Status::Grouped, Status::Weak, Status::Prior];
                reports.push(ParameterReport {
                    name: background.name(joint, parameter),
                    joint: joint + 1,
                    value: record.value.into(),
                    unit: parameter.unit(),
                    sigma: record.sigma.into(),
                    status: word(&record.status, &STATUS.map(Status::name), "status")?,
                    grouped_with: background.grouped_with(joint, parameter),
                    truth: truth.map(|truth| truth[joint][parameter.index()]).into(),
                    prior: prior.map(|prior| prior[joint][parameter.index()]).into(),
                });
            }
        }
        Ok(reports)
    }

    fn stribeck(&self) -> Vec<StribeckReport> {
        let record = self.records.stribeck.iter().filter(|record| (1..=N).contains(&record.joint));
        record
            .map(|record| StribeckReport {
                joint: record.joint,
                surplus_nm: record.surplus_nm.into(),
                surplus_sigma_nm: record.surplus_sigma_nm.into(),
                speed_rad_s: record.speed_rad_s.into(),
                speed_sigma_rad_s: record.speed_sigma_rad_s.into(),
                gain_chi2: record.gain_chi2.into(),
            })
            .collect()
    }

    /// The board does not send the gains of columns, except for detected Stribeck friction.
    fn selection(&self, dropped: [bool; B]) -> Selection<f32, N, B> {
        let gain = |joint: usize| {
            let found = self.records.stribeck.iter().find(|record| record.joint == joint + 1);
            Some(found.map_or((f32::NAN, f32::NAN), |record| (record.gain_chi2, record.surplus_nm)))
        };
        let is_searched = |joint: usize| self.background.device.stribeck_choice(joint).is_possible();
        Selection {
            is_made: true,
            dropped,
            gain: [f32::NAN; B],
            stribeck: core::array::from_fn(|joint| gain(joint).filter(|_| is_searched(joint))),
        }
    }

    fn training(&self, joint: usize) -> Option<&Fit> {
        self.records.fits.iter().find(|fit| (fit.motion, fit.joint) == (0, joint + 1))
    }

    fn outliers(&self) -> OutliersReport {
        let motion = self.records.motions.iter().find(|motion| motion.motion == 0);
        let number = |of: fn(&Fit) -> f32| (0..N).map(|joint| self.training(joint).map(of).into()).collect();
        OutliersReport {
            estimator: estimator_name(Estimator::default()),
            samples: motion.map_or(0, |motion| motion.samples),
            replaced: (0..N).map(|joint| self.training(joint).map_or(0, |fit| fit.replaced)).collect(),
            disturbed_share: number(|fit| fit.disturbed_share),
            longest_s: number(|fit| fit.disturbed_longest_s),
            longest_common_s: motion.map(|motion| motion.longest_common_s).into(),
        }
    }

    fn least_squares(&self, base: usize) -> Number {
        self.records.base.iter().find(|record| record.index == base).map(|record| record.least_squares).into()
    }

    fn reasons(&self) -> Result<Vec<&'static str>, ToolError> {
        let names = Reason::ALL.map(Reason::name);
        self.records.reasons.iter().map(|record| word(&record.reason, &names, "reason")).collect()
    }
}

fn consistent(solver: &Solver) -> ConsistentReport {
    ConsistentReport {
        chosen: "base",
        optimum_over_least_squares: Number::UNKNOWN,
        result_over_least_squares: solver.consistency_chi2.into(),
        degrees_of_freedom: None,
        full: None,
        base: ConsistentSearchReport {
            iterations: solver.iterations,
            evaluations: solver.evaluations,
            steps: solver.steps,
            ..ConsistentSearchReport::default()
        },
    }
}

/// Motions of the validation have the names that a simulated run gives them.
fn motion_name(motion: usize) -> String {
    let name = motion.checked_sub(1).and_then(|unused| VALIDATION_NAMES.get(unused));
    name.map_or_else(|| format!("motion {motion}"), |name| (*name).to_owned())
}

fn fit_report(fit: &Fit, motion: String) -> FitReport {
    let percent = |of: f32| Number::from(100.0 * f64::from(fit.rms_nm) / f64::from(of));
    FitReport {
        joint: fit.joint,
        motion,
        rms_nm: fit.rms_nm.into(),
        percent_of_mean_abs: percent(fit.mean_abs_nm),
        percent_of_rms: percent(fit.torque_rms_nm),
        percent_of_mean_abs_vs_truth: Number::UNKNOWN,
        sticking_share: Number::UNKNOWN,
        disturbed_share: fit.disturbed_share.into(),
        disturbed_longest_s: fit.disturbed_longest_s.into(),
        replaced: fit.replaced,
    }
}

fn finding(record: &Finding) -> Result<FindingReport, ToolError> {
    let tests = Test::ALL.into_iter().find(|test| test.name() == record.test);
    let reasons = Reason::ALL.into_iter().find(|reason| reason.name() == record.reason);
    let (Some(test), Some(reason)) = (tests, reasons) else {
        let words = format!(
            "the finding `{}` ({}) is unknown: the trace comes from a later version",
            record.test, record.reason
        );
        return Err(ToolError::input(words));
    };
    let evidence = Evidence {
        reason,
        test,
        joint: record.joint.checked_sub(1),
        motion: record.motion.checked_sub(1),
        value: record.value,
        limit: record.limit,
        passed: record.passed,
    };
    Ok(FindingReport::new(&evidence, &VALIDATION_NAMES))
}

/// Looks a word up in a closed list.
fn word(record: &str, all: &[&'static str], what: &str) -> Result<&'static str, ToolError> {
    all.iter().find(|word| **word == record).copied().ok_or_else(|| {
        ToolError::input(format!(
            "the {what} `{record}` is not one of {}: the trace comes from a later version",
            all.join(", ")
        ))
    })
}
