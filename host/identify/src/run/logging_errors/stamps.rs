//! Time stamps that are not the times of the samples.
//!
//! Why: many recorders stamp a row at its arrival, not at its measurement. A moving joint then seems to jump,
//! and the noisy acceleration makes inertias too small in least squares. Irregular sampling with right stamps
//! does no harm. The angles themselves distinguish the two.
//!
//! ```text
//! r_i     = q_i minus the cubic through two neighbours on either side, over the deviation of unit noise
//! s^2     = (r^2 where fast - r^2 where slow) / (qd^2 where fast - qd^2 where slow)      error of the times
//! s_t     with the stamps             s_e    with an even clock in their place
//! wrong   s_t > 0.1 median step  and  s_e < 0.7 s_t
//! e_k     = stamp k minus the even clock, a straight line through each half second
//! share   = var(qdd from e) / var(qdd),   var(qdd from e) = 2/5 (2 pi)^4 B^5 S      at most 0.4 %
//! S       density of qd e at low frequency, from its means over 1 / 4B
//! missing rows   an angle changes by n = 2 to 6 times the mean of its changes beside it, within n / 8,
//!                in every joint that moves fast at once; three times or more
//! ```
//!
//! A counter that stamps the rows hides lost ones: the stamps go on evenly and the leg seems to jump. A joint
//! moves fast where it changes by 8 times its noise and 6 steps of its encoder from row to row.
//!
//! Fast and slow are the upper and lower third of the speeds; r^2 is the square of a median absolute
//! deviation, so outliers and encoder steps do not count. The share is the relative error of an inertia
//! (errors in variables), by the pass band of the row filter. Cost: linear in the samples, except sorts.
//! Known limits: a constant error of the stamps delays all columns alike and changes nothing; drifts slower
//! than half a second do not show.

use std::f64::consts::TAU;

use scarab_base::stats::{quantile, rms};

use crate::formats::recording::Recording;
use crate::report::doubt::SampleFinding;
use crate::run::logging_errors::encoder::Encoder;

/// Finding of wrong time stamps.
pub(crate) const TIME_STAMPS: &str = "time_stamps";

/// Error of the stamps that is always negligible, in median steps.
const HARMLESS_STEPS: f64 = 0.1;
/// Error on an even clock over that of the stamps, below which the even clock is used as the reference.
const EVEN_SHARE: f64 = 0.7;
/// Largest error of an inertia by the stamps. Recordings of 20 s determine an inertia to 0.3 % at best. With
/// a share of 0.3 % parameters shifted by 1.7 sigma, with 0.9 % by 4.3.
const LARGEST_SHARE: f64 = 0.004;
/// Error of the stamps from which rows of different times are mixed, s: a period of the 500 Hz grid.
const LARGEST_ERROR_S: f64 = 0.002;
/// Duration of a piece of the even clock, s.
const PIECE_S: f64 = 0.5;
/// Half the time over which a speed is measured, s.
const SPEED_S: f64 = 0.03;

/// Change of a joint from row to row, over its noise and over its encoder's step, from which it is fast.
const FAST_NOISE: f64 = 8.0;
const FAST_STEPS: f64 = 6.0;
/// Largest difference of the changes before and after a jump, over their mean.
const STEADY: f64 = 0.3;
/// Largest jump, in changes, and its largest distance from a whole number of them, over that number.
const LARGEST_JUMP: f64 = 6.0;
const WHOLE: f64 = 0.125;
/// Jumps that are no accident.
const LEAST_JUMPS: usize = 3;

/// Examines the time stamps of a recording for rows with this bandwidth. `described_rad` are the steps of the
/// encoders by the leg file.
pub(crate) fn examine(
    recording: &Recording,
    described_rad: &[f64],
    bandwidth_hz: f64,
) -> Option<SampleFinding> {
    let time = &recording.time_s;
    let median_step = recording.median_step_s();
    if time.len() < 20 || !(median_step > 0.0) {
        return None;
    }
    let even: Vec<f64> = (0..time.len()).map(|sample| sample as f64 * median_step).collect();
    let is_wrong = recording.joints.iter().any(|joint| {
        let speeds = speeds(time, &joint.position_rad, median_step);
        let error = |clock: &[f64]| time_error(clock, &joint.position_rad, &speeds);
        match (error(time), error(&even)) {
            (Some(stamps), Some(even)) => stamps > HARMLESS_STEPS * median_step && even < EVEN_SHARE * stamps,
            _ => false,
        }
    });
    if !is_wrong {
        return missing_rows(recording, described_rad, median_step, bandwidth_hz);
    }
    let errors = clock_errors(time, median_step);
    let size = rms(errors.iter().copied());
    let share = recording
        .joints
        .iter()
        .map(|joint| inertia_error(time, &joint.position_rad, &errors, median_step, bandwidth_hz))
        .fold(0.0, f64::max);
    let is_mixed = size > LARGEST_ERROR_S.max(median_step);
    let refuses = (share > LARGEST_SHARE && size > HARMLESS_STEPS * median_step) || is_mixed;
    Some(SampleFinding {
        name: TIME_STAMPS,
        file: recording.file.display().to_string(),
        joint: None,
        value: size,
        unit: "s",
        // Neighbouring residuals share samples: a third of them is independent.
        sigma: Some(size * (3.0 / time.len() as f64).sqrt()),
        share: 1.0,
        refuses,
        text: format!(
            "t_s is off by {:.2} ms rms: the angles were sampled by an even clock. At {bandwidth_hz} Hz an inertia \
             would come out {:.2} % too small; limits: {} %, {} ms{}",
            1e3 * size,
            100.0 * share,
            100.0 * LARGEST_SHARE,
            1e3 * LARGEST_ERROR_S,
            if refuses {
                ": replace the stamps by an even clock (--even-stamps), or record the times of the samples"
            } else {
                ""
            }
        ),
    })
}

/// Rows that are missing although the stamps go on.
fn missing_rows(
    recording: &Recording,
    described_rad: &[f64],
    median_step: f64,
    bandwidth_hz: f64,
) -> Option<SampleFinding> {
    let time = &recording.time_s;
    // Missing rows between a row and the next one; `None` where no joint is fast, or the joints disagree.
    let mut missing: Vec<Option<f64>> = vec![None; time.len()];
    let mut differ = vec![false; time.len()];
    for (joint, &described) in recording.joints.iter().zip(described_rad) {
        let angle = &joint.position_rad;
        let step_rad = Encoder::detect(angle, described).map_or(0.0, |encoder| encoder.step_rad);
        let rate = |row: usize| (angle[row + 1] - angle[row]) / (time[row + 1] - time[row]) * median_step;
        let changes: Vec<f64> = (0..time.len() - 1).map(rate).collect();
        // Neighbours of a smooth motion change evenly.
        let bends = changes.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs());
        let noise = quantile(bends.collect(), 0.5) / (0.6745 * f64::sqrt(6.0));
        for (row, three) in changes.windows(3).enumerate() {
            let (mean, between) = (0.5 * (three[0] + three[2]), three[1]);
            let is_fast = mean.abs() > (FAST_NOISE * noise).max(FAST_STEPS * step_rad)
                && (three[0] - three[2]).abs() < STEADY * mean.abs();
            if is_fast {
                let jump = (between / mean).round();
                let is_whole = (between / mean - jump).abs() < WHOLE * jump;
                let found = if is_whole && jump <= LARGEST_JUMP { jump - 1.0 } else { 0.0 };
                differ[row + 1] |= missing[row + 1].replace(found).is_some_and(|other| other != found);
            }
        }
    }
    let is_jump = |row: &usize| !differ[*row] && missing[*row].is_some_and(|missing| missing > 0.0);
    let jumps: Vec<usize> = (0..time.len()).filter(is_jump).collect();
    let first = jumps.first().filter(|_| jumps.len() >= LEAST_JUMPS)?;
    let (mut lost, mut clock) = (0.0, Vec::with_capacity(time.len()));
    for (row, stamp) in time.iter().enumerate() {
        clock.push(stamp + lost * median_step);
        lost += if is_jump(&row) { missing[row].unwrap_or(0.0) } else { 0.0 };
    }
    let errors = clock_errors(&clock, median_step);
    let inertia = recording
        .joints
        .iter()
        .map(|joint| inertia_error(&clock, &joint.position_rad, &errors, median_step, bandwidth_hz))
        .fold(0.0, f64::max);
    let share = lost / time.len() as f64;
    Some(SampleFinding {
        name: TIME_STAMPS,
        file: recording.file.display().to_string(),
        joint: None,
        value: rms(errors.iter().copied()),
        unit: "s",
        sigma: None,
        share,
        // An inertia changes with the square of the clock.
        refuses: inertia.max(2.0 * share) > LARGEST_SHARE,
        text: format!(
            "{lost:.0} rows are missing although t_s goes on, {:.2} % of all, first after {:.3} s: the leg seems to jump \
             there. Stamp each row when it is measured, not by its number",
            100.0 * share,
            time[*first]
        ),
    })
}

/// Speed at each sample that has two neighbours on either side, rad/s.
fn speeds(time: &[f64], angle: &[f64], median_step: f64) -> Vec<f64> {
    let half = ((SPEED_S / median_step).round() as usize).max(2);
    (2..angle.len() - 2)
        .map(|sample| {
            let (before, after) = (sample.saturating_sub(half), (sample + half).min(angle.len() - 1));
            ((angle[after] - angle[before]) / (time[after] - time[before])).abs()
        })
        .collect()
}

/// Error of the times of a clock, s; `None` without motion.
fn time_error(clock: &[f64], angle: &[f64], speeds: &[f64]) -> Option<f64> {
    let mut sorted = speeds.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (slow, fast) = (*sorted.get(sorted.len() / 3)?, *sorted.get(2 * sorted.len() / 3)?);
    let part = |is_part: &dyn Fn(f64) -> bool| {
        let (residuals, squares): (Vec<f64>, Vec<f64>) = speeds
            .iter()
            .enumerate()
            .filter(|(_, speed)| is_part(**speed))
            .map(|(index, &speed)| (residual(clock, angle, index + 2).abs(), speed * speed))
            .unzip();
        let deviation = quantile(residuals, 0.5) / 0.6745;
        (deviation * deviation, quantile(squares, 0.5))
    };
    let (quiet, slow_square) = part(&|speed| speed <= slow);
    let (noisy, fast_square) = part(&|speed| speed >= fast);
    let difference = fast_square - slow_square;
    (difference > 1e-6).then(|| ((noisy - quiet).max(0.0) / difference).sqrt())
}

/// Distance of a sample from the cubic through its four neighbours, relative to that of unit noise.
fn residual(clock: &[f64], angle: &[f64], sample: usize) -> f64 {
    let neighbours = [sample - 2, sample - 1, sample + 1, sample + 2];
    let (mut distance, mut noise) = (0.0, 1.0);
    for own in neighbours {
        let others = neighbours.iter().filter(|&&other| other != own);
        let weight: f64 =
            others.map(|&other| (clock[sample] - clock[other]) / (clock[own] - clock[other])).product();
        distance += weight * (angle[own] - angle[sample]);
        noise += weight * weight;
    }
    distance / f64::sqrt(noise)
}

/// Each stamp minus a straight line through its piece of the recording, s.
fn clock_errors(time: &[f64], median_step: f64) -> Vec<f64> {
    let mean_step = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let length = ((PIECE_S / mean_step.max(median_step)).round() as usize).max(5);
    let mut errors = Vec::with_capacity(time.len());
    for piece in time.chunks(length) {
        let count = piece.len() as f64;
        let middle = 0.5 * (count - 1.0);
        let mean = piece.iter().sum::<f64>() / count;
        let (mut product, mut square) = (0.0, 0.0);
        for (index, &stamp) in piece.iter().enumerate() {
            product += (index as f64 - middle) * (stamp - mean);
            square += (index as f64 - middle) * (index as f64 - middle);
        }
        let slope = if square > 0.0 { product / square } else { 0.0 };
        errors.extend(
            piece.iter().enumerate().map(|(index, stamp)| stamp - mean - slope * (index as f64 - middle)),
        );
    }
    errors
}

/// Relative error of an inertia that these errors of the stamps cause.
fn inertia_error(time: &[f64], angle: &[f64], errors: &[f64], median_step: f64, bandwidth_hz: f64) -> f64 {
    let width_s = 1.0 / (4.0 * bandwidth_hz);
    let length = ((width_s / median_step).round() as usize).max(1);
    let speeds = speeds(time, angle, median_step);
    let apparent: Vec<f64> = speeds.iter().zip(&errors[2..]).map(|(speed, error)| speed * error).collect();
    let means = |values: &[f64]| -> Vec<f64> {
        values.chunks_exact(length).map(|chunk| chunk.iter().sum::<f64>() / length as f64).collect()
    };
    let duration = length as f64 * median_step;
    let density = rms(means(&apparent)).powi(2) * duration;
    let noise = 0.4 * TAU.powi(4) * bandwidth_hz.powi(5) * density;
    let smooth = means(angle);
    let accelerations: Vec<f64> = smooth
        .windows(3)
        .map(|three| (three[2] - 2.0 * three[1] + three[0]) / (duration * duration))
        .collect();
    let signal = rms(accelerations.iter().copied()).powi(2);
    if signal > 0.0 { noise / signal } else { 0.0 }
}

#[cfg(test)]
mod tests;
