//! Rows of recordings: each file on the firmware's grid, and fed to its recorder.

use std::ops::Range;
use std::path::PathBuf;

use scarab::ident::{Estimator, KernelError, Progress, Recorder, SAMPLE_RATE_HZ};
use scarab::model::AnatomicalJoint;
use scarab_base::error::ToolError;

use super::ReplayOptions;
use super::cleaning::cleaned;
use super::screening::Screening;
use crate::formats::recording::Recording;
use crate::leg::background::Background;
use crate::report::Source;
use crate::run::resample::{PENDING, Resampled, TAPS};

/// Sample time of the firmware, s.
pub(super) const GRID_S: f64 = 1.0 / SAMPLE_RATE_HZ;
/// Above this bandwidth, 50 Hz rows alias the noise that the low-pass passes, and sigma becomes too small.
const LARGEST_BANDWIDTH_HZ: f64 = 25.0;

pub(super) type HostRecorder<const N: usize, const B: usize> = Recorder<f32, N, B, TAPS, PENDING>;

/// One file on the firmware's grid, as D-H angles and torques.
pub(super) struct Samples<const N: usize> {
    pub(super) file: PathBuf,
    /// Outliers replaced before resampling, converted to samples of the grid.
    pub(super) replaced: [u32; N],
    /// Doubt about the bandwidth at this rate.
    warning: Option<String>,
    rate_hz: f64,
    pub(super) start_s: f64,
    /// Points without a valid sample, in order.
    excluded: Vec<Range<usize>>,
    pub(super) position: Vec<[f32; N]>,
    pub(super) torque: Vec<[f32; N]>,
}

impl<const N: usize> Samples<N> {
    pub(super) fn new(
        recording: &Recording,
        anatomy: &[AnatomicalJoint<f64>; N],
        options: &ReplayOptions,
        screening: &Screening,
    ) -> Self {
        let (clean, replaced) = cleaned::<N>(recording);
        let (recording, replaced) = match options.estimator {
            Estimator::Robust => (&clean, replaced),
            Estimator::Plain => (recording, [0; N]),
        };
        let grid = Resampled::new(recording);
        // Unit: samples of the grid, as in the recorder.
        let share = grid.len() as f64 / recording.time_s.len() as f64;
        let replaced = replaced.map(|count| (f64::from(count) * share).round() as u32);
        let points = 0..grid.len();
        let position = points.clone().filter_map(|point| grid.position_rad::<N>(point));
        let torque = points.filter_map(|point| grid.torque_nm::<N>(point));
        Self {
            file: recording.file.clone(),
            replaced,
            warning: grid.bandwidth_warning(options.bandwidth_hz),
            rate_hz: grid.native_rate_hz,
            start_s: grid.start_s,
            excluded: screening.excluded(recording, grid.start_s),
            position: position
                .map(|q| core::array::from_fn(|joint| anatomy[joint].angle_to_chain(q[joint]) as f32))
                .collect(),
            torque: torque
                .map(|tau| core::array::from_fn(|joint| anatomy[joint].to_chain(tau[joint]) as f32))
                .collect(),
        }
    }

    /// Doubt about the bandwidth, with the file's name.
    pub(super) fn warning(&self) -> Option<String> {
        self.warning.as_ref().map(|warning| format!("{}: {warning}", self.file.display()))
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.position.len() as f64 / SAMPLE_RATE_HZ
    }
}

pub(super) fn new_recorder<const N: usize, const B: usize>(
    bandwidth_hz: f64,
) -> Result<HostRecorder<N, B>, ToolError> {
    if bandwidth_hz > LARGEST_BANDWIDTH_HZ {
        return Err(ToolError::input(format!(
            "--bandwidth {bandwidth_hz}: at most {LARGEST_BANDWIDTH_HZ} Hz"
        )));
    }
    HostRecorder::new(bandwidth_hz as f32).map_err(|error| bandwidth_error(bandwidth_hz, error))
}

pub(super) fn bandwidth_error(bandwidth_hz: f64, error: KernelError) -> ToolError {
    ToolError::input(match error {
        KernelError::Bandwidth => format!("--bandwidth {bandwidth_hz}: must be a positive number"),
        KernelError::TooLong { .. } => format!("--bandwidth {bandwidth_hz}: at least 1 Hz"),
        KernelError::TooShort => format!("--bandwidth {bandwidth_hz}: at most {LARGEST_BANDWIDTH_HZ} Hz"),
    })
}

/// Every file is a separate motion: windows never span two files.
pub(super) fn feed<const N: usize, const B: usize>(
    recorder: &mut HostRecorder<N, B>,
    background: &Background<N, B>,
    files: &[Samples<N>],
    role: &'static str,
    mut seen: impl FnMut(usize, f64, &Progress<f32, N, B>),
) -> Vec<Source> {
    let mut sources = Vec::with_capacity(files.len());
    let reach = recorder.delay();
    for (number, samples) in files.iter().enumerate() {
        let (mut rows, mut cut, before) = (0, 0, recorder.rows());
        let mut is_running = true;
        let mut take = |index: usize, progress: Option<Progress<f32, N, B>>| {
            let Some(progress) = progress else { return };
            let time_s = samples.start_s + (index - reach) as f64 / SAMPLE_RATE_HZ;
            seen(number + 1, time_s, &progress);
            rows += u32::from(progress.rows.is_some());
        };
        for (index, (position, torque)) in samples.position.iter().zip(&samples.torque).enumerate() {
            let is_excluded = samples.excluded.iter().any(|points| points.contains(&index));
            if is_excluded && is_running {
                for late in index.. {
                    let Some(progress) = recorder.flush(&background.device) else { break };
                    take(late, progress);
                }
                cut += recorder.break_off();
            }
            is_running = !is_excluded;
            if is_running {
                take(index, recorder.push(&background.device, position, torque));
            }
        }
        let mut index = samples.position.len();
        while let Some(progress) = recorder.flush(&background.device) {
            take(index, progress);
            index += 1;
        }
        rows += cut + recorder.break_off();
        let used = recorder.rows().iter().zip(before).map(|(after, before)| after - before).collect();
        sources.push(Source {
            file: samples.file.clone(),
            role,
            start_s: samples.start_s,
            duration_s: samples.duration_s(),
            rate_hz: samples.rate_hz,
            rows,
            used,
        });
    }
    sources
}
