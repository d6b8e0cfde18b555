//! Bias of the parameters by the steps of an encoder.
//!
//! Why: an angle in steps has noise in its acceleration, which makes inertias too small in least squares
//! (errors in variables). The noise is not white: where a joint is slow, beside the reversals, it lies in the
//! rows' band. So the noise is not computed but repeated: an encoder with the same steps reads the smoothed
//! motion once more. The shift of the parameters is the bias of the first reading (simulation and
//! extrapolation, Cook and Stefanski 1994, with one repetition).
//!
//! ```text
//! q_s, tau_s = Y(q_s) p        smoothed motion, and the torque that the fitted parameters predict for it
//! shift_k = p(round(q_s), tau_s) - p(q_s, tau_s)      four positions k of the encoder's counts
//! bias    = sqrt(mean^2 + variance of shift_k)
//! torque  = rms of Y(q_s) mean(shift) and of (Y(round(q_s)) - Y(q_s)) p, over the rms of tau_s
//! ```
//!
//! Both fits have the weights of the joints and the resampling of the recording. Cost: five times the rows of
//! a recording. Known limits: where a servo reacts to the steps, they are part of the motion. For one arm in
//! twenty with such a servo the torque error was twice the predicted one, for the others as large as
//! predicted (`scripts/plant_coverage --coarse`, 12 bits, 8 Hz).

use std::path::PathBuf;

use scarab::ident::{KernelError, RowModel, SAMPLE_RATE_HZ};
use scarab::model::Parameter;
use scarab::real::Real;
use scarab_base::stats::rms;

use crate::formats::leg_file::LegFile;
use crate::formats::recording::{JointSeries, Recording};
use crate::leg::setup::encoder_steps;
use crate::run::logging_errors::fit::{Fit, solve};
use crate::run::logging_errors::regressor::Instant;
use crate::run::logging_errors::rows::{Equations, Filters, Motion};
use crate::run::logging_errors::table::Table;
use crate::run::resample::Resampled;

/// Share of the changes of a column that must be whole steps.
const WHOLE_STEPS: f64 = 0.95;
/// Largest deviation from a whole step, as a share of a step.
const EXACT: f64 = 0.05;
/// Changes below this number of steps are counted, and the least number of them.
const SMALL_CHANGE: f64 = 20.0;
const FEWEST: usize = 20;
/// Readings of 4 kHz in one sample of the firmware's log.
const READINGS: usize = 8;
/// Positions of the counts under the motion.
const PHASES: usize = 4;
/// Acceleration noise over the motion's, in power, below which the steps are negligible. White noise of a
/// twelfth of the squared step has this power; slow stretches have up to ten times more.
const NEGLIGIBLE: f64 = 1e-6;
/// Largest error of a joint's predicted torque by the steps, as a share of its rms. Sources: the parameters'
/// bias, and steps in the motion from which the torque is predicted.
pub(crate) const LARGEST_SHARE: f64 = 0.03;
/// Largest noise of the steps in an inertial column, as a share of its power. An inertia is too small by this
/// share; once it is small, the second reading shows less.
pub(crate) const LARGEST_NOISE: f64 = 0.1;
/// Bandwidths to choose from, Hz.
pub(crate) const BANDWIDTHS_HZ: [f64; 8] = [16.0, 12.5, 10.0, 8.0, 6.3, 5.0, 4.0, 3.2];

/// How an angle was read: step and averaging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Encoder {
    /// Angle of one count, rad.
    pub(crate) step_rad: f64,
    /// Readings whose mean is one sample.
    pub(crate) readings: usize,
}

impl Encoder {
    /// Encoder of a column of angles; `None` for a continuous one. `described_rad` is the step by the leg
    /// file, which distinguishes a mean of readings from finer counts.
    pub(crate) fn detect(angle: &[f64], described_rad: f64) -> Option<Self> {
        let mut changes: Vec<f64> =
            angle.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|&change| change > 1e-12).collect();
        changes.sort_by(f64::total_cmp);
        // The smallest change is one step, unless the outlier filter replaced a few samples by values between
        // the counts.
        let step_rad = [1000, 200, 50].iter().find_map(|part| step(&changes, changes.len() / part))?;
        let is_mean = (READINGS as f64 * step_rad / described_rad - 1.0).abs() < EXACT;
        Some(if is_mean {
            Self { step_rad: described_rad, readings: READINGS }
        } else {
            Self { step_rad, readings: 1 }
        })
    }

    /// Reading of an angle over time; `phase` moves the counts by that share of one.
    fn read(&self, angle: impl Fn(f64) -> f64, time_s: f64, sample_s: f64, phase: f64) -> f64 {
        let readings = self.readings as f64;
        (0..self.readings)
            .map(|reading| {
                let early = (reading as f64 - 0.5 * (readings - 1.0)) / readings * sample_s;
                ((angle(time_s + early) / self.step_rad + phase).round() - phase) * self.step_rad
            })
            .sum::<f64>()
            / readings
    }
}

/// Encoders of the recordings' angles.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Encoders {
    /// Encoder of each joint; `None` where the angle is continuous.
    pub(crate) joints: Vec<Option<Encoder>>,
    /// Time between two samples, s.
    pub(crate) sample_s: f64,
}

/// Effect of the steps on the parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bias {
    /// Bias of each base parameter, as a standard deviation.
    pub(crate) sigma: Vec<f64>,
    /// Error of each joint's predicted torque, share of its rms.
    pub(crate) torque_share: Vec<f64>,
    /// Power of the steps' noise over that of a joint's noisiest inertial column.
    pub(crate) column_noise: Vec<f64>,
}

impl Bias {
    /// Joint with the largest torque error, and that error as a share.
    pub(crate) fn largest_share(&self) -> (usize, f64) {
        largest(&self.torque_share)
    }

    /// Joint whose columns are noisiest, and their noise.
    pub(crate) fn largest_noise(&self) -> (usize, f64) {
        largest(&self.column_noise)
    }

    /// Whether the bias is too large for the second reading to show it.
    pub(crate) fn is_beyond(&self) -> bool {
        self.largest_noise().1 > LARGEST_NOISE
    }

    /// Whether the bias refuses the recording.
    pub(crate) fn refuses(&self) -> bool {
        self.is_beyond() || self.largest_share().1 > LARGEST_SHARE
    }
}

impl Encoders {
    /// Describes the encoders to a model, for rows of this bandwidth: standstill by the leg file, pulses by
    /// the coarser of leg file and recordings. The counts of a recording alone do not determine standstill:
    /// with 2.9 mrad, slow rows of the real pendulum `sp` still predict well.
    pub(crate) fn describe<T: Real, const N: usize, const B: usize>(
        &self,
        leg: &LegFile,
        bandwidth_hz: f64,
        model: &mut RowModel<T, N, B>,
    ) {
        let described = encoder_steps::<T, N>(leg);
        let coarser = core::array::from_fn(|joint| {
            let seen = T::from_double(self.joints[joint].map_or(0.0, |encoder| encoder.step_rad));
            if seen > described[joint] { seen } else { described[joint] }
        });
        model.set_encoders(&coarser, T::from_double(bandwidth_hz));
        let pulse = model.pulse;
        model.set_encoders(&described, T::from_double(bandwidth_hz));
        model.pulse = pulse;
    }

    /// Bias of the parameters of `fit`; `None` where the steps are negligible.
    ///
    /// # Errors
    /// The filter cannot be built for the bandwidth.
    pub(crate) fn bias(
        &self,
        equations: &Equations,
        fit: &Fit,
        bandwidth_hz: f64,
    ) -> Result<Option<Bias>, KernelError> {
        if !self.can_matter(equations, bandwidth_hz) {
            return Ok(None);
        }
        let refit = |phase: Option<f64>| -> Result<Option<(Equations, Vec<f64>)>, KernelError> {
            let motions: Vec<Motion> = equations
                .smoothed()
                .filter(|(instants, _)| instants.len() > 1)
                .map(|(instants, training_s)| self.repeated(equations, fit, instants, training_s, phase))
                .collect();
            let filters = Filters::new(bandwidth_hz)?;
            let Some(again) = Equations::new(&equations.regressor, &motions, filters, &equations.active)
            else {
                return Ok(None);
            };
            let weight: Vec<f64> = again
                .sources
                .iter()
                .map(|source| if source.training { 1.0 / equations.row_sigma[source.joint] } else { 0.0 })
                .collect();
            let values = solve(&again.columns, &again.torque, &weight, &again.active, &again.known).values;
            Ok(Some((again, values)))
        };
        let Some((smooth, before)) = refit(None)? else { return Ok(None) };
        let (mut shifts, mut noise, mut predicted) = (Table::new(before.len()), Vec::new(), Vec::new());
        for phase in 0..PHASES {
            let Some((read, values)) = refit(Some(phase as f64 / PHASES as f64))? else { return Ok(None) };
            let shift: Vec<f64> = values.iter().zip(&before).map(|(read, smooth)| read - smooth).collect();
            shifts.push(&shift);
            if phase == 0 {
                let before_steps = smooth.columns_at(&read.sources, &*smooth.regressor, &|_| {});
                noise = column_noise(&before_steps, &read);
                predicted = prediction_noise(&before_steps, &read, fit);
            }
        }
        let count = shifts.len() as f64;
        let mean: Vec<f64> = (0..before.len()).map(|base| shifts.column(base).sum::<f64>() / count).collect();
        let sigma = (0..before.len()).map(|base| rms(shifts.column(base))).collect();
        let missing = equations.columns.times(&mean);
        let torque_share = |joint: usize| {
            let (mut missed, mut all) = (0.0, 0.0);
            let rows = equations.sources.iter().zip(&missing).zip(&equations.torque);
            for ((_, missing), torque) in
                rows.filter(|((source, _), _)| source.joint == joint && source.training)
            {
                missed += missing * missing;
                all += torque * torque;
            }
            f64::sqrt(missed / f64::max(all, 1e-300)).hypot(predicted[joint])
        };
        let torque_share = (0..equations.joints()).map(torque_share).collect();
        Ok(Some(Bias { sigma, torque_share, column_noise: noise }))
    }

    /// Largest of [`BANDWIDTHS_HZ`] up to `largest_hz` at which the steps shift no parameter by more than its
    /// standard deviation by noise and segments; the smallest one if none qualifies.
    ///
    /// # Errors
    /// The filter cannot be built for a bandwidth.
    pub(crate) fn bandwidth_hz(
        &self,
        largest_hz: f64,
        rows: impl Fn(f64) -> Result<Option<Equations>, KernelError>,
    ) -> Result<f64, KernelError> {
        let [.., mut chosen] = BANDWIDTHS_HZ;
        for &bandwidth_hz in BANDWIDTHS_HZ.iter().rev().filter(|&&bandwidth_hz| bandwidth_hz <= largest_hz) {
            let Some(equations) = rows(bandwidth_hz)? else { continue };
            let fit = equations.fit(&equations.columns, &equations.torque, true);
            let sigma = equations.scatter(&fit);
            let is_good = self.bias(&equations, &fit, bandwidth_hz)?.is_none_or(|bias| {
                let shifts = bias.sigma.iter().zip(&sigma);
                shifts.into_iter().all(|(shift, sigma)| *shift <= *sigma) && !bias.refuses()
            });
            if !is_good {
                break;
            }
            chosen = bandwidth_hz;
        }
        Ok(chosen)
    }

    /// Whether the noise of the steps is more than [`NEGLIGIBLE`] in some joint's acceleration.
    fn can_matter(&self, equations: &Equations, bandwidth_hz: f64) -> bool {
        let rate_hz = (1.0 / self.sample_s).max(SAMPLE_RATE_HZ);
        // Second derivative of white noise behind a low-pass: integral of (2 pi f)^4 over its band.
        let gain = 2.0 / rate_hz * (core::f64::consts::TAU).powi(4) * bandwidth_hz.powi(5) / 5.0;
        (0..equations.joints()).any(|joint| {
            let Some(encoder) = self.joints[joint] else { return false };
            let (mut power, mut count) = (0.0, 0.0);
            for instant in equations.smoothed().flat_map(|(instants, _)| instants) {
                power += instant.acceleration[joint].powi(2);
                count += 1.0;
            }
            let noise = gain * encoder.step_rad.powi(2) / 12.0;
            power > 0.0 && noise > NEGLIGIBLE * power / f64::max(count, 1.0)
        })
    }

    /// Smoothed motion with its predicted torque, read by the encoders at a phase; unquantised without a
    /// phase.
    fn repeated(
        &self,
        equations: &Equations,
        fit: &Fit,
        instants: &[Instant],
        training_s: f64,
        phase: Option<f64>,
    ) -> Motion {
        let joints = equations.joints();
        let predicted = instants.iter().map(|instant| equations.regressor.rows(instant).times(&fit.values));
        let torque = Table::of_rows(joints, predicted);
        let end_s = instants.len().saturating_sub(1) as f64 / SAMPLE_RATE_HZ;
        let samples = (end_s / self.sample_s).floor() as usize + 1;
        let time_s: Vec<f64> = (0..samples).map(|sample| sample as f64 * self.sample_s).collect();
        let series = (0..joints).map(|joint| {
            let angle = |time_s: f64| angle_at(instants, joint, time_s);
            JointSeries {
                position_rad: time_s
                    .iter()
                    .map(|&time_s| match (self.joints[joint], phase) {
                        (Some(encoder), Some(phase)) => encoder.read(angle, time_s, self.sample_s, phase),
                        _ => angle(time_s),
                    })
                    .collect(),
                torque_nm: time_s.iter().map(|&time_s| linear(&torque, joint, time_s)).collect(),
            }
        });
        let recording =
            Recording { file: PathBuf::new(), joints: series.collect(), time_s, joints_in_file: joints };
        let grid = Resampled::new(&recording);
        Motion {
            training_s: training_s - grid.start_s,
            within_s: [0.0, grid.len() as f64 / SAMPLE_RATE_HZ],
            position: Table::of_columns(grid.joints.iter().map(|joint| &joint.position_rad[..])),
            torque: Table::of_columns(grid.joints.iter().map(|joint| &joint.torque_nm[..])),
        }
    }
}

fn largest(of_joints: &[f64]) -> (usize, f64) {
    let joints = of_joints.iter().copied().enumerate();
    joints.max_by(|one, other| one.1.total_cmp(&other.1)).unwrap_or((0, 0.0))
}

/// Power by which the noisiest inertial column of each joint differs between two motions, over its own.
fn column_noise(before: &Table, read: &Equations) -> Vec<f64> {
    let of_joint = |joint: usize| {
        let inertial = (0..read.active.len()).filter(|&base| {
            let carrier = read.regressor.carrier(base);
            read.active[base]
                && carrier.is_some_and(|(own, parameter)| {
                    own == joint && matches!(parameter, Parameter::ZZ | Parameter::IA)
                })
        });
        let share = |base: usize| {
            let (mut noise, mut power) = (0.0, 0.0);
            for ((source, before), after) in read.sources.iter().zip(before.rows()).zip(read.columns.rows()) {
                if source.joint == joint && source.training {
                    noise += (after[base] - before[base]).powi(2);
                    power += before[base].powi(2);
                }
            }
            noise / f64::max(power, 1e-300)
        };
        inertial.map(share).fold(0.0, f64::max)
    };
    (0..read.joints()).map(of_joint).collect()
}

/// Change of each joint's prediction by the steps, share of its rms. `smooth` are the columns without them.
fn prediction_noise(smooth: &Table, read: &Equations, fit: &Fit) -> Vec<f64> {
    let (smooth, read_torque) = (fit.predictions(smooth), fit.predictions(&read.columns));
    let of_joint = |joint: usize| {
        let (mut noise, mut power) = (0.0, 0.0);
        let rows = read.sources.iter().zip(smooth.iter().zip(&read_torque));
        for (_, (smooth, read)) in rows.filter(|(source, _)| source.joint == joint && source.training) {
            noise += (read - smooth).powi(2);
            power += smooth * smooth;
        }
        f64::sqrt(noise / f64::max(power, 1e-300))
    };
    (0..read.joints()).map(of_joint).collect()
}

/// Step of an encoder from the changes of its angle in ascending order. The change at `index` must be one
/// step, and the other small ones whole steps.
fn step(changes: &[f64], index: usize) -> Option<f64> {
    let smallest = *changes.get(index)?;
    // A mean, because numbers in text are rounded.
    let single: Vec<f64> =
        changes.iter().copied().filter(|change| (change / smallest - 1.0).abs() < EXACT).collect();
    let step_rad = single.iter().sum::<f64>() / single.len().max(1) as f64;
    let steps = changes.iter().map(|change| change / step_rad).take_while(|&steps| steps < SMALL_CHANGE);
    let (mut small, mut whole) = (0, 0);
    for steps in steps {
        small += 1;
        whole += usize::from((steps - steps.round()).abs() < EXACT);
    }
    (small >= FEWEST && whole as f64 >= WHOLE_STEPS * small as f64).then_some(step_rad)
}

/// Position of a time between two grid points: the first of them, and the share of the way to the second.
fn between(time_s: f64, points: usize) -> (usize, f64) {
    let position = (time_s * SAMPLE_RATE_HZ).clamp(0.0, points.saturating_sub(1) as f64);
    let first = (position.floor() as usize).min(points.saturating_sub(2));
    (first, position - first as f64)
}

fn linear(series: &Table, joint: usize, time_s: f64) -> f64 {
    let (first, share) = between(time_s, series.len());
    let after = series[(first + 1).min(series.len() - 1)][joint];
    series[first][joint] + share * (after - series[first][joint])
}

/// Angle at any time: cubic with the smoothed speeds.
fn angle_at(instants: &[Instant], joint: usize, time_s: f64) -> f64 {
    let (first, share) = between(time_s, instants.len());
    let left = &instants[first];
    let right = instants.get(first + 1).unwrap_or(left);
    let step_s = 1.0 / SAMPLE_RATE_HZ;
    let rest = 1.0 - share;
    rest * rest * ((1.0 + 2.0 * share) * left.position[joint] + share * step_s * left.velocity[joint])
        + share * share * ((1.0 + 2.0 * rest) * right.position[joint] - rest * step_s * right.velocity[joint])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swing(step_rad: f64) -> Vec<f64> {
        (0..5000).map(|k| ((k as f64 * 0.002 * 3.0).sin() / step_rad).floor() * step_rad).collect()
    }

    #[test]
    fn steps_are_found_in_a_column_and_a_continuous_angle_has_none() {
        let found = Encoder::detect(&swing(1.5e-3), 1e-4).expect("an encoder");
        assert!((found.step_rad / 1.5e-3 - 1.0).abs() < 1e-6 && found.readings == 1, "{found:?}");
        let smooth: Vec<f64> = (0..5000).map(|k| (k as f64 * 0.002 * 3.0).sin()).collect();
        assert_eq!(Encoder::detect(&smooth, 1e-4), None);
        assert_eq!(Encoder::detect(&[0.0; 100], 1e-4), None);
    }

    #[test]
    fn leg_file_distinguishes_means_of_eight_readings_from_finer_counts() {
        let fine: Vec<f64> =
            (0..40_000).map(|k| ((k as f64 * 0.000_25).sin() / 1.6e-3).floor() * 1.6e-3).collect();
        let means: Vec<f64> = fine.chunks_exact(8).map(|chunk| chunk.iter().sum::<f64>() / 8.0).collect();
        let found = Encoder::detect(&means, 1.6e-3).expect("an encoder");
        assert_eq!((found.step_rad, found.readings), (1.6e-3, 8));
        let without = Encoder::detect(&means, 0.1).expect("an encoder");
        assert!((without.step_rad / 2e-4 - 1.0).abs() < 1e-6 && without.readings == 1, "{without:?}");
    }
}
