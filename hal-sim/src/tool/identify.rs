//! `identify`: one or many simulated runs, their logs and statistics.

use std::path::Path;

use comfy_table::Table;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;

use super::consistent_runs;
use super::error::ToolError;
use super::files::NewFile;
use super::leg_file::LegFile;
use super::recording::{JointSeries, Recording};
use super::report::{RunReport, SCHEMA};
use super::series::Series;
use super::simulate::{SimulatedRun, SimulationOptions, simulate};
use super::tables::{self, say};
use scarab::leg::{LoggedSample, Segment};
use scarab::servo::{SERVO_RATE_HZ, TICKS_PER_LOG};

/// Report of many runs.
#[derive(Clone, Debug, Serialize)]
pub struct RunsReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Runs in the order of their seeds.
    pub runs: Vec<RunReport>,
}

/// Runs one identification, with curves on request; writes its log if a path is given.
pub fn identify_one<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &SimulationOptions,
    log: Option<&Path>,
) -> Result<(RunReport, Series), ToolError> {
    let run: SimulatedRun<N> = simulate::<N, B>(leg, options)?;
    if let Some(path) = log {
        let training: Vec<_> =
            run.log.iter().filter(|logged| logged.segment == Some(Segment::Training)).copied().collect();
        write_log(path, leg, &training)?;
    }
    Ok((run.report, run.series))
}

/// Runs one identification per seed, in parallel.
pub fn identify_many<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &[SimulationOptions],
) -> Result<RunsReport, ToolError> {
    let progress = ProgressBar::new(options.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} gone, {eta} left") {
        progress.set_style(style);
    }
    let runs = options
        .par_iter()
        .map(|options| {
            let run = simulate::<N, B>(leg, options).map(|run| run.report);
            progress.inc(1);
            run
        })
        .collect::<Result<Vec<_>, _>>()?;
    progress.finish_and_clear();
    Ok(RunsReport { schema: SCHEMA, runs })
}

/// Writes the training motion in the format of `replay`: anatomical angles and torques.
pub fn write_log<const N: usize>(
    path: &Path,
    leg: &LegFile,
    log: &[LoggedSample<N>],
) -> Result<(), ToolError> {
    let mut recording = Recording {
        file: path.to_owned(),
        time_s: Vec::with_capacity(log.len()),
        joints: vec![JointSeries::default(); N],
        joints_in_file: N,
    };
    let first = log.first().map_or(0, |logged| logged.sample.tick);
    for logged in log {
        let ticks = logged.sample.tick.wrapping_sub(first);
        recording.time_s.push(f64::from(ticks) / f64::from(SERVO_RATE_HZ));
        for (joint, series) in recording.joints.iter_mut().enumerate() {
            let file = &leg.joints[joint];
            let radian_per_count =
                core::f64::consts::TAU / (f64::from(file.encoder.counts) * file.encoder.ratio);
            let counts = f64::from(logged.sample.counts_sum[joint]) / f64::from(TICKS_PER_LOG);
            let direction = if file.direction < 0 { -1.0 } else { 1.0 };
            series.position_rad.push(leg.side.mounting() * counts * radian_per_count);
            series.torque_nm.push(direction * f64::from(logged.sample.torque_nm[joint]));
        }
    }
    let mut out = NewFile::create(path)?;
    recording.write(&mut out).map_err(|error| ToolError::cannot_write(path, &error))?;
    out.finish()
}

/// Root mean square.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value * value, count + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// Quantile of a list.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(index).copied().unwrap_or(f64::NAN)
}

/// Table of the errors relative to the bound, for each base parameter.
fn spread_table(report: &RunsReport) -> Table {
    let mut table = tables::headed(&[
        "base parameter",
        "truth",
        "rms sigma",
        "bso rmse / CRB",
        "ls rmse / CRB",
        "bso bias / CRB",
    ]);
    let names = report.runs.iter().flat_map(|run| &run.base_parameters).map(|base| &base.name);
    let mut seen = Vec::new();
    names.for_each(|name| {
        if !seen.contains(&name) {
            seen.push(name);
        }
    });
    let named =
        |run: &RunReport, name: &str| run.base_parameters.iter().find(|base| base.name == name).cloned();
    let first = |name: &&String| report.runs.iter().find_map(|run| named(run, name));
    for base in seen.iter().filter_map(first) {
        let (Some(truth), Some(bound)) = (base.truth.known(), base.cramer_rao.known()) else { continue };
        let of = |value: &dyn Fn(&RunReport) -> Option<f64>| -> Vec<f64> {
            report.runs.iter().filter_map(value).collect()
        };
        let swarm = of(&|run| named(run, &base.name)?.value.known());
        let squares = of(&|run| run.least_squares.base_parameters.get(&base.name)?.known());
        let sigma = of(&|run| named(run, &base.name)?.sigma.known());
        let bounds = rms(of(&|run| named(run, &base.name)?.cramer_rao.known()).into_iter());
        let bound = if bounds > 0.0 { bounds } else { bound };
        let bias = swarm.iter().map(|value| value - truth).sum::<f64>() / swarm.len().max(1) as f64;
        table.add_row(vec![
            base.name.clone(),
            tables::number(truth.into()),
            tables::number(rms(sigma.into_iter()).into()),
            format!("{:.2}", rms(swarm.iter().map(|value| value - truth)) / bound),
            format!("{:.2}", rms(squares.iter().map(|value| value - truth)) / bound),
            format!("{:+.2}", bias / bound),
        ]);
    }
    table
}

/// Share of errors within a number of reported sigma, pooled.
fn coverage(report: &RunsReport, sigmas: f64) -> f64 {
    let (mut within, mut all) = (0_u32, 0_u32);
    for base in report.runs.iter().flat_map(|run| &run.base_parameters) {
        if let (Some(value), Some(truth), Some(sigma)) =
            (base.value.known(), base.truth.known(), base.sigma.known())
        {
            within += u32::from((value - truth).abs() <= sigmas * sigma);
            all += 1;
        }
    }
    100.0 * f64::from(within) / f64::from(all.max(1))
}

/// Prints statistics of many runs.
pub fn print_runs(report: &RunsReport) -> Result<(), ToolError> {
    let runs = &report.runs;
    let Some(first) = runs.first() else { return Ok(()) };
    say!("{}: {} runs, prior {}, plan {}\n", first.leg, runs.len(), first.prior, first.plan);
    say!("{}\n", spread_table(report));
    say!(
        "sigma covers {:.1} % within one and {:.1} % within three (68.3, 99.7 for a normal distribution)",
        coverage(report, 1.0),
        coverage(report, 3.0)
    );
    let mut fits = tables::headed(&[
        "motion",
        "joint",
        "% of mean abs, noise-free: median",
        "worst",
        "% of mean abs, measured: median",
    ]);
    for (index, fit) in first.validation.iter().enumerate() {
        let of = |value: &dyn Fn(&super::report::FitReport) -> Option<f64>| -> Vec<f64> {
            runs.iter().filter_map(|run| value(run.validation.get(index)?)).collect()
        };
        let mut truth = of(&|fit| fit.percent_of_mean_abs_vs_truth.known());
        let mut measured = of(&|fit| fit.percent_of_mean_abs.known());
        fits.add_row(vec![
            fit.motion.clone(),
            fit.joint.to_string(),
            format!("{:.3}", quantile(&mut truth, 0.5)),
            format!("{:.3}", quantile(&mut truth, 1.0)),
            format!("{:.3}", quantile(&mut measured, 0.5)),
        ]);
    }
    say!("\n{fits}\n");
    let excess: Vec<f64> = runs.iter().filter_map(|run| run.bso.excess_chi2.known()).collect();
    let mut to_half: Vec<f64> =
        runs.iter().map(|run| run.bso.iterations_to_half_chi2.map_or(f64::INFINITY, f64::from)).collect();
    let mut iterations: Vec<f64> = runs.iter().map(|run| f64::from(run.bso.iterations)).collect();
    say!(
        "beetle swarm, cold start: excess <= 0.5 chi-square units in {} of {} runs (worst {}); iterations to there {} \
         median, {} in 95 %; to the end {} median, {} in 95 %",
        excess.iter().filter(|excess| **excess <= 0.5).count(),
        runs.len(),
        tables::number(excess.iter().copied().fold(f64::NEG_INFINITY, f64::max).into()),
        quantile(&mut to_half, 0.5),
        quantile(&mut to_half, 0.95),
        quantile(&mut iterations, 0.5),
        quantile(&mut iterations, 0.95),
    );
    consistent_runs::print(runs)?;
    for joint in 0..first.tracking.len() {
        let of = |value: &dyn Fn(&super::report::TrackingReport) -> Option<f64>| -> f64 {
            let mut values: Vec<f64> =
                runs.iter().filter_map(|run| value(run.tracking.get(joint)?)).collect();
            quantile(&mut values, 0.5)
        };
        say!(
            "tracking on gait, joint {}: {} deg rms without the model, {} with it (medians)",
            joint + 1,
            tables::number(of(&|tracking| tracking.rms_deg_without_model.known()).into()),
            tables::number(of(&|tracking| tracking.rms_deg_with_model.known()).into()),
        );
    }
    for line in super::scale::summary(runs) {
        say!("{line}");
    }
    let accepted = runs.iter().filter(|run| run.accepted()).count();
    say!("\naccepted: {accepted} of {}", runs.len());
    for run in runs.iter().filter(|run| !run.accepted()) {
        say!("seed {}: refused, {}", run.seed.unwrap_or(0), run.reasons.join(", "));
    }
    let (simulated, wall) = runs
        .iter()
        .fold((0.0, 0.0), |(simulated, wall), run| (simulated + run.simulated_s, wall + run.wall_s));
    say!("simulated time over time on one core: {:.0} times real time", simulated / wall);
    Ok(())
}
