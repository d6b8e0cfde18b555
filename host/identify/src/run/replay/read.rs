//! Recordings as they are used: corrected as requested, examined, and split.

use scarab_base::error::ToolError;

use super::screening::{Screening, refuse_copies};
use super::{Recordings, ReplayOptions};
use crate::formats::leg_file::LegFile;
use crate::formats::recording::{JointSeries, Read, Recording};
use crate::leg::additional_torque::Additional;
use crate::report::reading::ReadReport;

/// Whole recording, with the duration of its training part.
pub(super) struct Whole {
    pub(crate) recording: Recording,
    pub(crate) training_s: f64,
}

/// Recording with an even clock, and with the torque scaled and delayed, as requested. `ratios` are the
/// recorded torques over the true ones.
fn corrected(
    mut recording: Recording,
    options: &ReplayOptions,
    ratios: &[f64],
) -> Result<Recording, ToolError> {
    let joints = ratios.len();
    for (series, ratio) in recording.joints.iter_mut().zip(ratios) {
        series.torque_nm.iter_mut().for_each(|torque| *torque /= ratio);
    }
    if options.even_stamps {
        recording.even_stamps();
    }
    let delays = &options.torque_delay_ms;
    if delays.is_empty() {
        return Ok(recording);
    }
    if delays.len() != 1 && delays.len() != joints {
        return Err(ToolError::input(format!(
            "--torque-delay: {} values; give one for all joints, or one for each of {joints}",
            delays.len()
        )));
    }
    let late_s: Vec<f64> =
        (0..joints).map(|joint| delays[if delays.len() == 1 { 0 } else { joint }] * 1e-3).collect();
    let duration = recording.duration_s();
    if let Some(wrong) = late_s.iter().find(|late| !(late.abs() < 0.1 * duration)) {
        return Err(ToolError::input(format!(
            "--torque-delay {}: the limit is a tenth of the recording ({:.0} ms)",
            1e3 * wrong,
            100.0 * duration
        )));
    }
    Ok(advanced(&recording, &late_s))
}

/// Recording with each torque taken later by its delay; samples whose torque lies outside are dropped.
fn advanced(recording: &Recording, late_s: &[f64]) -> Recording {
    let time = &recording.time_s;
    let (Some(&first), Some(&last)) = (time.first(), time.last()) else { return recording.clone() };
    let inside = |now: f64| late_s.iter().all(|late| (first..=last).contains(&(now + late)));
    let kept: Vec<usize> = (0..time.len()).filter(|&sample| inside(time[sample])).collect();
    let at = |values: &[f64], now: f64| {
        let right = time.partition_point(|&stamp| stamp < now).clamp(1, time.len() - 1);
        let share = (now - time[right - 1]) / (time[right] - time[right - 1]);
        values[right - 1] + share * (values[right] - values[right - 1])
    };
    let joints = recording.joints.iter().zip(late_s).map(|(series, late)| JointSeries {
        position_rad: kept.iter().map(|&sample| series.position_rad[sample]).collect(),
        torque_nm: kept.iter().map(|&sample| at(&series.torque_nm, time[sample] + late)).collect(),
    });
    Recording {
        file: recording.file.clone(),
        time_s: kept.iter().map(|&sample| time[sample]).collect(),
        joints: joints.collect(),
        joints_in_file: recording.joints_in_file,
    }
}

/// Recordings as they are used.
pub(super) struct Parts {
    /// Training parts.
    pub(super) training: Vec<Recording>,
    /// Held-out parts.
    pub(super) held_out: Vec<Recording>,
    /// Whole files.
    pub(super) wholes: Vec<Whole>,
    /// Findings about the samples.
    pub(super) screening: Screening,
    /// How each recording was read.
    pub(super) read: Vec<ReadReport>,
}

/// Corrects all recordings, examines them, subtracts the `additional` torques, and splits them as requested.
pub(super) fn parts(
    recordings: &Recordings,
    options: &ReplayOptions,
    leg: &LegFile,
    ratios: &[f64],
    additional: &Additional,
) -> Result<Parts, ToolError> {
    let of = |reads: &[Read]| -> Result<Vec<Recording>, ToolError> {
        reads.iter().map(|read| corrected(read.recording.clone(), options, ratios)).collect()
    };
    let (mut training, mut held_out) = (of(&recordings.training)?, of(&recordings.held_out)?);
    let read = recordings.training.iter().chain(&recordings.held_out).map(|read| read.report.clone());
    refuse_copies(&training, &held_out, "--validate")?;
    let all: Vec<&Recording> = training.iter().chain(&held_out).collect();
    let screening = Screening::new(&all, leg, options.bandwidth_hz);
    for recording in training.iter_mut().chain(&mut held_out) {
        additional.subtract(recording);
    }
    let share =
        |recording: &Recording| options.split.map_or(f64::INFINITY, |share| share * recording.duration_s());
    let whole = |recording: &Recording, training_s| Whole { recording: recording.clone(), training_s };
    let mut wholes: Vec<Whole> = training.iter().map(|file| whole(file, share(file))).collect();
    wholes.extend(held_out.iter().map(|file| whole(file, 0.0)));
    if let Some(fraction) = options.split {
        let parts = training.iter().map(|whole| whole.split(fraction)).collect::<Result<Vec<_>, _>>()?;
        let (first, rest): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        training = first;
        held_out.extend(rest);
    }
    Ok(Parts { training, held_out, wholes, screening, read: read.collect() })
}
