//! A run as curves over time, for figures: anatomical angles and torques.

use scarab::ident::{Ends, FilteredRows, LARGEST_STILL_SHARE, Recorder};
use scarab::leg::{LoggedSample, Segment};
use scarab::motion::Periodic;
use scarab::servo::SERVO_RATE_HZ;

use super::error::ToolError;
use super::motions::VALIDATION_NAMES;
use super::pair::{Context, PENDING, TAPS};

/// Rate of the logged samples over that of the filtered rows.
const SAMPLES_PER_ROW: usize = scarab::ident::DECIMATION;
/// Seconds between two points of a commanded motion.
const COMMANDED_STEP_S: f64 = 0.05;

/// Curves of a run.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Torque of every joint on every motion that was predicted, motions outside.
    pub torque: Vec<Vec<TorqueSeries>>,
    /// Commanded angles of the motions identified from and predicted.
    pub commanded: Vec<CommandedSeries>,
    /// Cost of the swarm's best above the optimum in its box, chi-square units, after each iteration.
    pub excess: Vec<(u32, f64)>,
}

/// One joint's torque on one motion, all through the filter of the identification.
#[derive(Clone, Debug, Default)]
pub struct TorqueSeries {
    /// Of the motion.
    pub motion: &'static str,
    /// Since the motion began, s.
    pub time_s: Vec<f64>,
    /// From the noisy current, N m.
    pub measured: Vec<f64>,
    /// By the result of the identification, N m.
    pub predicted: Vec<f64>,
    /// Of the plant's motor, N m.
    pub noise_free: Vec<f64>,
    /// Whether the joint sticks: friction takes any value there, and nothing can be predicted.
    pub sticks: Vec<bool>,
}

/// Angles of one motion.
#[derive(Clone, Debug)]
pub struct CommandedSeries {
    /// Of the motion.
    pub motion: &'static str,
    /// Since the motion began, s.
    pub time_s: Vec<f64>,
    /// Of each joint, degrees.
    pub position_deg: Vec<Vec<f64>>,
}

impl<const N: usize, const B: usize> Context<N, B> {
    fn direction(&self, joint: usize) -> f64 {
        f64::from(self.configuration.joints[joint].scale.anatomy.direction())
    }

    /// Torques of the predicted motions; `truth` holds their noise-free rows in the same order.
    pub(super) fn torque_series(
        &self,
        log: &[LoggedSample<N>],
        truth: &[Vec<FilteredRows<f32, N, B>>],
        values: &[f32; B],
    ) -> Result<Vec<Vec<TorqueSeries>>, ToolError> {
        let mut motions = Vec::new();
        for (index, (motion, truth)) in VALIDATION_NAMES.into_iter().zip(truth).enumerate() {
            let segment = Some(Segment::Validation(index as u8));
            let samples = log.iter().filter(|logged| logged.segment == segment);
            motions.push(self.motion_torque(motion, samples, truth, values)?);
        }
        Ok(motions)
    }

    fn motion_torque<'a>(
        &self,
        motion: &'static str,
        samples: impl Iterator<Item = &'a LoggedSample<N>>,
        truth: &[FilteredRows<f32, N, B>],
        values: &[f32; B],
    ) -> Result<Vec<TorqueSeries>, ToolError> {
        let mut recorder =
            Box::new(Recorder::<f32, N, B, TAPS, PENDING>::new(self.configuration.bandwidth_hz).map_err(
                |error| ToolError::input(format!("the filter does not fit the device: {error:?}")),
            )?);
        recorder.clear(Ends::Whole);
        let first_centre = self.smoothing.reach() + self.low_pass.reach();
        let mut curves = vec![TorqueSeries { motion, ..TorqueSeries::default() }; N];
        let measured = samples.filter_map(|logged| {
            let sample = &logged.sample;
            recorder.push(&self.background.device, &sample.position_rad, &sample.torque_nm)?.rows
        });
        for (row, (measured, truth)) in measured.zip(truth).enumerate() {
            for (joint, curve) in curves.iter_mut().enumerate() {
                let predicted: f32 = measured.regressor[joint]
                    .iter()
                    .zip(values)
                    .map(|(element, value)| element * value)
                    .sum();
                let sign = self.direction(joint);
                curve
                    .time_s
                    .push((first_centre + row * SAMPLES_PER_ROW) as f64 / scarab::ident::SAMPLE_RATE_HZ);
                curve.measured.push(sign * f64::from(measured.torque[joint]));
                curve.predicted.push(sign * f64::from(predicted));
                curve.noise_free.push(sign * f64::from(truth.torque[joint]));
                curve.sticks.push(f64::from(truth.still[joint]) > LARGEST_STILL_SHARE);
            }
        }
        Ok(curves)
    }

    /// The motion identified from and those predicted.
    pub(super) fn commanded_series(&self) -> Vec<CommandedSeries> {
        let predicted = VALIDATION_NAMES.into_iter().zip(&self.motions.validation);
        core::iter::once(("excitation", &self.motions.excitation))
            .chain(predicted)
            .map(|(name, motion)| self.commanded(name, motion))
            .collect()
    }

    fn commanded(&self, name: &'static str, motion: &Periodic<N>) -> CommandedSeries {
        let ticks_per_point = (COMMANDED_STEP_S * f64::from(SERVO_RATE_HZ)) as usize;
        let ticks: Vec<u32> = (0..=motion.duration_ticks()).step_by(ticks_per_point).collect();
        let position_deg = |joint: usize| {
            let zero = f64::from(self.configuration.joints[joint].scale.anatomy.zero_offset());
            let anatomical = |tick: &u32| {
                let angle = f64::from(motion.state_at(*tick).position_rad[joint]);
                (self.direction(joint) * (angle - zero)).to_degrees()
            };
            ticks.iter().map(anatomical).collect()
        };
        CommandedSeries {
            motion: name,
            position_deg: (0..N).map(position_deg).collect(),
            time_s: ticks.iter().map(|tick| f64::from(*tick) / f64::from(SERVO_RATE_HZ)).collect(),
        }
    }
}
