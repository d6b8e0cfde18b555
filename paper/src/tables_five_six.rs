//! Tables V and VI: identified parameters of the three-joint chain by both methods, compared with
//! the paper's.
//!
//! Both tables come from the same runs: the default exciting motion of `identify`, with all joints
//! moving. Each seed runs once by the one-time plan and once by the sequential one, searched by the
//! beetle swarm; least squares is listed beside. Table V compares single parameters, as the paper
//! does. Table VI compares the combinations that torque determines.
//!
//! ```text
//! error        median over the runs of |value - truth| / |truth|, percent; none where the truth is zero
//! error/sigma  root mean square over the runs of (value - truth) / sigma, sigma that of each run
//! ```

use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_base::shard::Shard;
use scarab_base::stats::rms;
use scarab_base::table::Table;
use scarab_identify::report::RunReport;
use serde::Serialize;

use super::chain::{self, ChainOptions, LEG, NOISE_PERCENT, PLANS, median};
use super::printed::{Printed, TABLE_FIVE, TABLE_SIX};
use super::ranks::Ranks;
use super::runs::{RowRuns, run_rows};
use super::{Part, Section};
use crate::digits::{number, percent};

/// Runs of each method by default.
pub const RUNS: u64 = 20;

/// Estimate of one value by one method, over all runs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Found {
    /// Median estimate.
    pub value: Number,
    /// Median of the reported standard deviation; null unless the parameter is identified alone.
    pub sigma: Number,
    /// Median absolute error, percent of the truth.
    pub error_percent: Number,
    /// Root mean square of error over sigma.
    pub error_over_sigma: Number,
}

impl Found {
    /// Summary of each run's value and sigma.
    fn new(truth: Number, runs: &[(Number, Number)]) -> Self {
        let values = || runs.iter().filter_map(|(value, _)| value.known());
        let sigmas = || runs.iter().filter_map(|(_, sigma)| sigma.known());
        let truth = truth.known();
        let errors = |truth: f64| median(values().map(|value| 100.0 * ((value - truth) / truth).abs()));
        let scores: Vec<_> = runs
            .iter()
            .filter_map(|(value, sigma)| Some((value.known()? - truth?) / sigma.known()?))
            .collect();
        Self {
            value: median(values()).into(),
            sigma: median(sigmas()).into(),
            error_percent: truth.filter(|&truth| truth != 0.0).and_then(errors).into(),
            error_over_sigma: (!scores.is_empty()).then(|| rms(scores)).into(),
        }
    }

    fn with_sigma(&self) -> String {
        match self.sigma.known() {
            Some(_) => format!("{} \u{b1} {}", number(self.value), number(self.sigma)),
            None => number(self.value),
        }
    }
}

/// Value as printed in the paper.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PaperValue {
    /// Column "X_rea".
    pub real: f64,
    /// Column "X_ide".
    pub identified: f64,
    /// Column "e" as printed, percent; null for a dash.
    pub error_printed_percent: Option<f64>,
    /// Equation (30) of the two values above, percent.
    pub error_percent: Option<f64>,
}

impl From<&Printed> for PaperValue {
    fn from(printed: &Printed) -> Self {
        Self {
            real: printed.real,
            identified: printed.identified,
            error_printed_percent: printed.error_percent,
            error_percent: printed.error(),
        }
    }
}

/// A line of Table V.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterLine {
    /// Symbol and joint.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Printed values.
    pub paper: PaperValue,
    /// True value of the simulated chain.
    pub truth: Number,
    /// Most frequent status by the one-time plan: `identified`, `weak`, `grouped` or `prior`.
    pub status: &'static str,
    /// Other parameters of the same sums.
    pub grouped_with: Vec<String>,
    /// One-time plan, by the swarm.
    pub one_time: Found,
    /// Sequential plan, by the swarm.
    pub sequential: Found,
}

/// A line of Table VI.
#[derive(Clone, Debug, Serialize)]
pub struct BaseLine {
    /// Carrier, followed by `R` if others are regrouped into it.
    pub name: String,
    /// Weighted sum of the parameters.
    pub terms: String,
    /// SI unit.
    pub unit: &'static str,
    /// Printed values.
    pub paper: PaperValue,
    /// True value of the simulated chain.
    pub truth: Number,
    /// One-time plan, by the swarm.
    pub one_time: Found,
    /// Sequential plan, by the swarm.
    pub sequential: Found,
    /// One-time plan, in closed form.
    pub least_squares: Found,
}

/// Report of both tables.
#[derive(Clone, Debug, Serialize)]
pub struct TablesReport {
    /// Name of the leg file.
    pub leg: &'static str,
    /// Noise per logged 500 Hz sample, percent of each joint's mean absolute torque on the exciting motion.
    pub noise_percent: f64,
    /// Runs of each method.
    pub runs: u64,
    /// Runs accepted by the verdict, one-time and sequential.
    pub accepted: [usize; 2],
    /// Median iterations of the swarm, one-time and sequential.
    pub iterations_median: [Number; 2],
    /// Number of combinations that torque determines.
    pub rank: Ranks,
    /// The paper's 20 parameters.
    pub table_v: Vec<ParameterLine>,
    /// The paper's 15 combinations.
    pub table_vi: Vec<BaseLine>,
}

/// Runs both plans.
pub fn runs(runs: u64, shard: Shard) -> Result<RowRuns<RunReport>, ToolError> {
    let leg = chain::leg()?;
    run_rows("Tables V and VI", &PLANS, runs, shard, |plan, seed| {
        Ok(chain::run(&leg, &leg, &ChainOptions::new(seed.search(), *plan))?.report)
    })
}

/// Formats the section of these runs.
pub fn section(runs: &[Vec<RunReport>]) -> Result<Section, ToolError> {
    let report = report(runs)?;
    Section::new(Part::TablesFiveSix, "tables_v_vi", &report, words(&report), Vec::new())
}

/// Reports these runs.
pub fn report(runs: &[Vec<RunReport>]) -> Result<TablesReport, ToolError> {
    let leg = chain::leg()?;
    let of = |plan: usize| -> Vec<&RunReport> { runs.get(plan).into_iter().flatten().collect() };
    let methods = [of(0), of(1)];
    let accepted = methods.each_ref().map(|runs| runs.iter().filter(|run| run.accepted()).count());
    let iterations_median =
        methods.each_ref().map(|runs| median(runs.iter().map(|run| f64::from(run.bso.iterations))).into());
    Ok(TablesReport {
        leg: LEG,
        noise_percent: NOISE_PERCENT,
        runs: methods[0].len() as u64,
        accepted,
        iterations_median,
        rank: Ranks::new(&leg, methods[0].first().copied())?,
        table_v: TABLE_FIVE.iter().filter_map(|printed| parameter_line(printed, &methods)).collect(),
        table_vi: TABLE_SIX.iter().filter_map(|printed| base_line(printed, &methods)).collect(),
    })
}

fn parameter_line(printed: &Printed, methods: &[Vec<&RunReport>; 2]) -> Option<ParameterLine> {
    let named = |run: &RunReport| run.parameters.iter().find(|found| found.name == printed.name).cloned();
    let found = methods.each_ref().map(|runs| runs.iter().filter_map(|run| named(run)).collect::<Vec<_>>());
    let first = found[0].first()?;
    let of = |index: usize| -> Found {
        let runs: Vec<_> = found[index].iter().map(|found| (found.value, found.sigma)).collect();
        Found::new(first.truth, &runs)
    };
    let frequency = |status: &str| found[0].iter().filter(|found| found.status == status).count();
    let status = found[0].iter().map(|found| found.status).max_by_key(|status| frequency(status))?;
    Some(ParameterLine {
        name: first.name.clone(),
        unit: first.unit,
        paper: printed.into(),
        truth: first.truth,
        status,
        grouped_with: first.grouped_with.clone(),
        one_time: of(0),
        sequential: of(1),
    })
}

fn base_line(printed: &Printed, methods: &[Vec<&RunReport>; 2]) -> Option<BaseLine> {
    let named = |run: &RunReport| {
        run.base_parameters.iter().find(|base| base.name.trim_end_matches('R') == printed.name).cloned()
    };
    let found = methods.each_ref().map(|runs| runs.iter().filter_map(|run| named(run)).collect::<Vec<_>>());
    let first = found[0].first()?.clone();
    let of = |index: usize| -> Found {
        let runs: Vec<_> = found[index].iter().map(|base| (base.value, base.sigma)).collect();
        Found::new(first.truth, &runs)
    };
    let squares: Vec<_> = methods[0]
        .iter()
        .zip(&found[0])
        .filter_map(|(run, base)| Some((*run.least_squares.base_parameters.get(&first.name)?, base.sigma)))
        .collect();
    let terms = first.terms.iter().map(|(name, &factor)| match factor {
        _ if (factor - 1.0).abs() < 1e-9 => format!("+ {name}"),
        _ if (factor + 1.0).abs() < 1e-9 => format!("- {name}"),
        _ if factor < 0.0 => format!("- {} {name}", number((-factor).into())),
        _ => format!("+ {} {name}", number(factor.into())),
    });
    let terms = terms.collect::<Vec<_>>().join(" ");
    Some(BaseLine {
        terms: terms.strip_prefix("+ ").unwrap_or(&terms).to_owned(),
        unit: first.unit,
        paper: printed.into(),
        truth: first.truth,
        one_time: of(0),
        sequential: of(1),
        least_squares: Found::new(first.truth, &squares),
        name: first.name,
    })
}

/// Columns of the printed values.
const PAPER_COLUMNS: [&str; 4] = ["paper: real", "identified", "error, % as printed", "by (30)"];

fn table_five(lines: &[ParameterLine]) -> Table {
    let mut table = Table::default().label("").numbers(PAPER_COLUMNS).numbers([
        "determined by torque",
        "here: truth",
        "one-time",
        "error, %",
        "sequential",
        "error, %",
    ]);
    for line in lines {
        table.row([
            line.name.clone(),
            number(line.paper.real.into()),
            number(line.paper.identified.into()),
            percent(line.paper.error_printed_percent),
            percent(line.paper.error_percent),
            match line.status {
                "grouped" => format!("with {}", line.grouped_with.join(" ")),
                "prior" => "not at all".into(),
                "weak" => "alone, weakly".into(),
                _ => "alone".into(),
            },
            number(line.truth),
            line.one_time.with_sigma(),
            percent(line.one_time.error_percent.known()),
            line.sequential.with_sigma(),
            percent(line.sequential.error_percent.known()),
        ]);
    }
    table
}

fn table_six(lines: &[BaseLine]) -> Table {
    let mut table = Table::default()
        .label("")
        .numbers(PAPER_COLUMNS)
        .numbers(["sum", "here: truth"])
        .numbers(["one-time", "error, %", "error/sigma"])
        .numbers(["sequential", "error, %", "error/sigma", "least squares: error, %"]);
    for line in lines {
        table.row([
            line.name.clone(),
            number(line.paper.real.into()),
            number(line.paper.identified.into()),
            percent(line.paper.error_printed_percent),
            percent(line.paper.error_percent),
            line.terms.clone(),
            number(line.truth),
            line.one_time.with_sigma(),
            percent(line.one_time.error_percent.known()),
            percent(line.one_time.error_over_sigma.known()),
            line.sequential.with_sigma(),
            percent(line.sequential.error_percent.known()),
            percent(line.sequential.error_over_sigma.known()),
            percent(line.least_squares.error_percent.known()),
        ]);
    }
    table
}

fn words(report: &TablesReport) -> String {
    let rank = &report.rank;
    let alone = report.table_v.iter().filter(|line| matches!(line.status, "identified" | "weak"));
    let alone: Vec<_> = alone.map(|line| line.name.as_str()).collect();
    format!(
        "{} runs of each method, {} % torque noise, leg `{}`; medians over the runs, \u{b1} the reported standard deviation; \
         errors are those of single runs. Accepted: {} one-time, {} sequential. SI units.\n\n\
         The 20 parameters of Table V have rank {}, all 30 of three links {}, {} where one joint moves at a time and its own \
         torque is read; with rotors, friction and offsets {} of {} are determined. Alone are measured: {} ({}).\n\n**Table V**\n\n{}\n**Table VI**\n\n{}",
        report.runs,
        report.noise_percent,
        report.leg,
        report.accepted[0],
        report.accepted[1],
        rank.of_table_v,
        rank.of_all_inertial,
        rank.joint_by_joint,
        rank.of_the_leg,
        rank.columns,
        alone.join(" "),
        alone.len(),
        table_five(&report.table_v).to_markdown(),
        table_six(&report.table_vi).to_markdown(),
    )
}
