//! Figure 7 and Equation (33): predicted and real torque of the chain on the verification motion,
//! for noise of 0 to 15 %.
//!
//! The base parameters of both methods, multiplied by the rows of the verification motion, are compared
//! with the torque of the plant's motors. The error against the noise-free torque is that of the
//! parameters. The error against the measured torque includes noise, which cannot be predicted.
//!
//! Limits: the plant differs from the paper's, whose geometry, motion of joint 1, noise and samples are not
//! printed. The paper's percentages are therefore listed for information only.

use scarab::ident::Plan;
use scarab_base::error::ToolError;
use scarab_base::names::plan_name;
use scarab_base::number::Number;
use scarab_base::shard::Shard;
use scarab_base::table::Table;
use scarab_identify::leg::motions::EXCITATION_CYCLES;
use serde::Serialize;

use super::chain::{self, ChainOptions, ChainRun, Fit, JOINTS, LEG, NOISE_PERCENT, PLANS, median, predicted};
use super::printed::FIGURE_SEVEN;
use super::runs::{RowRuns, run_rows};
use super::seeds::ReportSeed;
use super::verification::{self, ROTATION_DEG};
use super::{Part, Section};
use crate::digits::{number, percent};
use crate::figures::chain::{Curve, JointTorque, Level, drawn};

/// Runs per method and noise level by default.
pub const RUNS: u64 = 10;
/// Levels of noise, percent.
pub const LEVELS: [f64; 7] = [0.0, 1.0, 3.0, 5.0, NOISE_PERCENT, 10.0, 15.0];
/// Goal for the prediction against the noise-free torque at [`NOISE_PERCENT`], percent.
pub const GOAL_PERCENT: f64 = 2.0;

/// Method with the same weight for all joints' rows, whatever their noise.
const UNWEIGHTED: &str = "least squares, unweighted";
/// Sequential method on a longer motion.
const LONG: &str = "sequential, 60 s";
const LONG_CYCLES: u32 = 6;

/// Configuration of a set of runs.
#[derive(Clone, Copy)]
struct Case {
    noise_percent: f64,
    plan: Plan,
    cycles: u32,
    method: &'static str,
}

impl Case {
    fn new(plan: Plan) -> Self {
        Self { noise_percent: NOISE_PERCENT, plan, cycles: EXCITATION_CYCLES, method: plan_name(plan) }
    }
}

/// One joint, method and noise level over all runs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct FitLine {
    /// Noise of the torque in the identification and on the verification motion.
    pub noise_percent: f64,
    /// Plan `one-time` or `sequential`, by the swarm; at 7 % also `least squares, unweighted` and
    /// `sequential, 60 s`.
    pub method: &'static str,
    /// Joint, from 1.
    pub joint: usize,
    /// Mean absolute noise-free torque on the motion; percentages refer to it.
    pub mean_absolute_nm: Number,
    /// Equation (33) against the noise-free torque, median.
    pub rms_nm: Number,
    /// Equation (33) against the noise-free torque, percent, median.
    pub percent_of_truth: Number,
    /// Equation (33) in percent, worst run.
    pub percent_of_truth_worst: Number,
    /// Against the measured torque through the same filter, median.
    pub percent_filtered: Number,
    /// Against every measured sample, median.
    pub percent_of_samples: Number,
    /// Share of rows excluded because the joint was at rest.
    pub still_share: Number,
}

/// Torque error of a joint as printed in the paper.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PaperFit {
    /// Root mean square error, N m.
    pub rms_nm: f64,
    /// Error in percent of mean absolute torque.
    pub percent: f64,
}

/// Report of the verification.
#[derive(Clone, Debug, Serialize)]
pub struct VerificationReport {
    /// Name of the leg file.
    pub leg: &'static str,
    /// Runs of each method at each level.
    pub runs: u64,
    /// Mean absolute torque of the links alone on (31) and (32) with joint 1 held still, N m.
    pub links_alone_nm: [f64; JOINTS],
    /// The paper's errors, proximal joint first.
    pub paper: [PaperFit; JOINTS],
    /// Results by level, method and joint.
    pub lines: Vec<FitLine>,
}

/// Draws and formats the section of these runs.
pub fn section(runs: &[Vec<[Fit; JOINTS]>]) -> Result<Section, ToolError> {
    let report = report(runs, &LEVELS)?;
    let leg = chain::leg()?;
    let shown = |plan| {
        chain::run(
            &leg,
            &leg,
            &ChainOptions { with_series: true, ..ChainOptions::new(ReportSeed::from_run(0).search(), plan) },
        )
    };
    let names: Vec<_> = leg.joints.iter().map(|joint| joint.name.as_str()).collect();
    let curves = curves(&names, &shown(Plan::OneTime)?, &shown(Plan::Sequential)?);
    let levels: Vec<_> = report.lines.iter().filter_map(level).collect();
    let paper = report.paper.map(|paper| paper.percent);
    let figure = drawn(&curves, &levels, &paper)?;
    Section::new(Part::FigureSeven, "verification", &report, words(&report), vec![figure])
}

/// Cases at these levels of noise.
fn cases(levels: &[f64]) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for &noise_percent in levels {
        cases.extend(PLANS.map(|plan| Case { noise_percent, ..Case::new(plan) }));
    }
    if levels.contains(&NOISE_PERCENT) {
        cases.push(Case { method: UNWEIGHTED, ..Case::new(Plan::OneTime) });
        cases.push(Case { method: LONG, cycles: LONG_CYCLES, ..Case::new(Plan::Sequential) });
    }
    cases
}

/// Runs every method at these levels of noise.
pub fn runs(runs: u64, levels: &[f64], shard: Shard) -> Result<RowRuns<[Fit; JOINTS]>, ToolError> {
    let leg = chain::leg()?;
    run_rows("Figure 7", &cases(levels), runs, shard, |case, seed| {
        let options = ChainOptions {
            noise_percent: case.noise_percent,
            cycles: case.cycles,
            ..ChainOptions::new(seed.search(), case.plan)
        };
        let run = chain::run(&leg, &leg, &options)?;
        let values = if case.method == UNWEIGHTED { &run.unweighted } else { &run.values };
        Ok(run.verification.fit(&run.model, values))
    })
}

/// Reports these runs.
pub fn report(runs: &[Vec<[Fit; JOINTS]>], levels: &[f64]) -> Result<VerificationReport, ToolError> {
    let leg = chain::leg()?;
    let cases = cases(levels);
    let of_cases = cases.iter().zip(runs);
    let lines =
        of_cases.flat_map(|(case, fits)| (0..JOINTS).map(move |joint| line(case, joint, fits))).collect();
    Ok(VerificationReport {
        leg: LEG,
        runs: runs.first().map_or(0, Vec::len) as u64,
        links_alone_nm: verification::links_alone(&leg)?,
        paper: FIGURE_SEVEN.map(|(rms_nm, percent)| PaperFit { rms_nm, percent }),
        lines,
    })
}

fn line(case: &Case, joint: usize, runs: &[[Fit; JOINTS]]) -> FitLine {
    let of =
        |value: fn(&Fit) -> f64| -> Number { median(runs.iter().map(|fits| value(&fits[joint]))).into() };
    let worst = runs.iter().map(|fits| fits[joint].percent_of_truth).fold(f64::NEG_INFINITY, f64::max);
    FitLine {
        noise_percent: case.noise_percent,
        method: case.method,
        joint: joint + 1,
        mean_absolute_nm: of(|fit| fit.mean_absolute_nm),
        rms_nm: of(|fit| fit.rms_nm),
        percent_of_truth: of(|fit| fit.percent_of_truth),
        percent_of_truth_worst: worst.into(),
        percent_filtered: of(|fit| fit.percent_filtered),
        percent_of_samples: of(|fit| fit.percent_of_samples),
        still_share: of(|fit| fit.still_share),
    }
}

fn level(line: &FitLine) -> Option<Level> {
    is_plain(line).then_some(())?;
    Some(Level {
        noise_percent: line.noise_percent,
        joint: line.joint - 1,
        sequential: line.method == plan_name(Plan::Sequential),
        percent: line.percent_of_truth.known()?,
    })
}

/// Curves of one run of each method over time.
fn curves<'n>(names: &[&'n str], one_time: &ChainRun, sequential: &ChainRun) -> Vec<JointTorque<'n>> {
    let Some(motion) = one_time.series.motions.iter().find(|motion| motion.name == "gait-6.5") else {
        return Vec::new();
    };
    let joints = names.iter().zip(&motion.joints).enumerate();
    joints
        .map(|(joint, (&name, curves))| {
            // Sign of the anatomical torque: the series is anatomical, the rows are not.
            let sign = |run: &ChainRun| if run.direction[joint] < 0 { -1.0 } else { 1.0 };
            let of = |run: &ChainRun, values: &dyn Fn(&ChainRun, usize) -> f64| -> Vec<f64> {
                let count = run.verification.noise_free.len().min(motion.time_s.len());
                (0..count).map(|row| sign(run) * values(run, row)).collect()
            };
            let truth =
                |run: &ChainRun, row: usize| f64::from(run.verification.noise_free[row].torque[joint]);
            let own = |run: &ChainRun, row: usize| {
                predicted(&run.verification.noise_free[row].regressor[joint], &run.values)
            };
            let measured = |run: &ChainRun, row: usize| {
                run.verification.filtered_nm.get(row).map_or(f64::NAN, |torque| f64::from(torque[joint]))
            };
            let error = |run: &ChainRun, row: usize| own(run, row) - truth(run, row);
            JointTorque {
                name,
                time_s: motion.time_s.clone(),
                still: curves.still.clone(),
                measured: of(one_time, &measured),
                real: of(one_time, &truth),
                predicted: of(one_time, &own),
                errors: [
                    Curve { sequential: false, nm: of(one_time, &error) },
                    Curve { sequential: true, nm: of(sequential, &error) },
                ],
            }
        })
        .collect()
}

/// Whether the line is from one of the two plain methods.
fn is_plain(line: &FitLine) -> bool {
    PLANS.iter().any(|&plan| plan_name(plan) == line.method)
}

fn words(report: &VerificationReport) -> String {
    let mut table = Table::default().label("joint, method").numbers([
        "mean abs torque, N m",
        "RMS, N m",
        "% of it, noise-free",
        "worst run",
        "measured, same filter",
        "measured samples",
        "excluded at rest, %",
        "paper: RMS, N m",
        "%",
    ]);
    for line in report.lines.iter().filter(|line| line.noise_percent == NOISE_PERCENT) {
        let paper = report.paper[line.joint - 1];
        table.row([
            format!("{}, {}", line.joint, line.method),
            number(line.mean_absolute_nm),
            number(line.rms_nm),
            percent(line.percent_of_truth.known()),
            percent(line.percent_of_truth_worst.known()),
            percent(line.percent_filtered.known()),
            percent(line.percent_of_samples.known()),
            percent(line.still_share.known().map(|share| 100.0 * share)),
            number(paper.rms_nm.into()),
            percent(Some(paper.percent)),
        ]);
    }
    let heads =
        PLANS.iter().flat_map(|&plan| (1..=JOINTS).map(move |joint| format!("{} {joint}", plan_name(plan))));
    let mut over_noise = Table::default().label("noise, %").numbers(heads);
    let per_level = PLANS.len() * JOINTS;
    let plain: Vec<_> = report.lines.iter().filter(|line| is_plain(line)).collect();
    for lines in plain.chunks(per_level) {
        let level = lines.first().map_or(0.0, |line| line.noise_percent);
        let cells = lines.iter().map(|line| percent(line.percent_of_truth.known()));
        over_noise.row(core::iter::once(format!("{level}")).chain(cells));
    }
    let servo = report.lines.iter().find(|line| line.noise_percent == 0.0 && line.joint == 1);
    let servo = servo.and_then(|line| line.percent_of_samples.known()).map_or(String::new(), |of| {
        format!(
            "Single samples of joint 1 also hold what its servo does against single encoder counts: they differ by {} % \
             without any noise.\n\n",
            percent(Some(of))
        )
    });
    let links = report.links_alone_nm.map(|nm| number(nm.into()));
    format!(
        "Another plant than the paper's: leg `{}`, {} runs of each method at each noise, medians. (31) and (32) as repaired, \
         6.5 s; joint 1, of which they say nothing, turns by {ROTATION_DEG} degrees either way. Held still, the links alone \
         would load the joints with {} N m on average: along gravity, joint 1 hardly feels the walking leg, and its torque \
         here is mostly its own friction and inertia.\n\n\
         At {NOISE_PERCENT} % noise:\n\n{}\n{servo}\
         Error against the noise-free torque in percent of its mean size, by joint:\n\n{}",
        report.leg,
        report.runs,
        links.join(", "),
        table.to_markdown(),
        over_noise.to_markdown(),
    )
}
