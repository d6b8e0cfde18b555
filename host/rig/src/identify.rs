//! `identify`: one or many simulated runs, their logs and statistics.

use std::path::Path;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use scarab::leg::LoggedSample;
use scarab::servo::{SERVO_RATE_HZ, TICKS_PER_LOG};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::recording::{JointSeries, Recording};
use scarab_identify::report::RunReport;
use scarab_identify::report::series::Series;

use crate::options::SimulationOptions;
use crate::simulate::simulate;

/// Runs one identification, with curves on request; writes its log if a path is given.
pub fn identify_one(
    leg: &LegFile,
    options: &SimulationOptions,
    log: Option<&Path>,
) -> Result<(RunReport, Series), ToolError> {
    let run = simulate(leg, options)?;
    if let (Some(path), Some(training)) = (log, run.recordings.first()) {
        training.save(path)?;
    }
    Ok((run.report, run.series))
}

/// Runs one identification per seed, in parallel.
pub fn identify_many(leg: &LegFile, options: &[SimulationOptions]) -> Result<Vec<RunReport>, ToolError> {
    let progress = ProgressBar::new(options.len() as u64);
    if let Ok(style) =
        ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} elapsed, {eta} left")
    {
        progress.set_style(style);
    }
    let runs = options
        .par_iter()
        .map(|options| {
            let run = simulate(leg, options).map(|run| run.report);
            progress.inc(1);
            run
        })
        .collect();
    progress.finish_and_clear();
    runs
}

/// Recording of samples of a log: anatomical angles and torques. `name` stands for the file.
pub(crate) fn recorded<const N: usize>(name: &Path, leg: &LegFile, log: &[LoggedSample<N>]) -> Recording {
    let mut recording = Recording {
        file: name.to_owned(),
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
            let radian_per_count = file.encoder.step_rad();
            let counts = f64::from(logged.sample.counts_sum[joint]) / f64::from(TICKS_PER_LOG);
            let direction = if file.direction < 0 { -1.0 } else { 1.0 };
            series.position_rad.push(leg.side.mounting() * counts * radian_per_count);
            series.torque_nm.push(direction * f64::from(logged.sample.torque_nm[joint]));
        }
    }
    recording
}
