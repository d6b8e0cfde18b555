//! Damage of recordings as real loggers do it.
//!
//! Sizes are in SI units (s, Hz, rad) or shares; angles of gravity in degrees. The rows of `cases.toml` state
//! kinds and sizes.

use std::f64::consts::TAU;

use scarab_base::random::Random;
use scarab_identify::{JointSeries, Recording};

/// Corner of the low-pass behind a clipped torque, Hz.
const CLIP_FILTER_HZ: f64 = 50.0;
/// Duration of a push, s.
const PUSH_S: f64 = 0.6;

/// Damages the files of one logging chain; `joints` are damaged, from 0. False if the kind is unknown.
pub(super) fn apply(kind: &str, files: &mut [Recording], size: f64, joints: &[usize]) -> bool {
    let largest = |files: &[Recording], joint: usize, sign: f64| {
        let torques = files.iter().flat_map(|file| &file.joints[joint].torque_nm);
        torques.fold(f64::MIN, |largest, torque| largest.max(sign * torque))
    };
    let limits: Vec<[f64; 2]> = joints
        .iter()
        .map(|joint| {
            let [top, bottom] = [1.0, -1.0].map(|sign| largest(files, *joint, sign));
            match kind {
                "clip_one_side" if top >= bottom => [f64::MIN, size * top],
                "clip_one_side" => [-size * bottom, f64::MAX],
                _ => [-size * top.max(bottom), size * top.max(bottom)],
            }
        })
        .collect();
    for (number, file) in files.iter_mut().enumerate() {
        let (count, step) = (file.time_s.len(), period(&file.time_s));
        if kind.starts_with("swap") {
            if let [one, .., other] = file.joints.as_mut_slice() {
                if kind != "swap_angles" {
                    std::mem::swap(&mut one.torque_nm, &mut other.torque_nm);
                }
                if kind != "swap_torques" {
                    std::mem::swap(&mut one.position_rad, &mut other.position_rad);
                }
            }
            continue;
        }
        if kind == "jitter" {
            jitter(&mut file.time_s, size);
            continue;
        }
        let time_s = &file.time_s;
        for (joint, [low, high]) in joints.iter().zip(&limits) {
            let JointSeries { position_rad: angles, torque_nm: torques } = &mut file.joints[*joint];
            let length = ((size / step).round() as usize).max(1);
            match kind {
                "clean" => {}
                "delay" => delay(time_s, torques, size),
                "encoder_scale" => each(angles, |angle| angle * (1.0 + size)),
                "clip" | "clip_one_side" => each(torques, |torque| torque.clamp(*low, *high)),
                "clip_filtered" => {
                    each(torques, |torque| torque.clamp(*low, *high));
                    low_pass(time_s, torques, CLIP_FILTER_HZ);
                }
                "gain" => each(torques, |torque| torque * (1.0 + size)),
                "flip_midway" => {
                    each(&mut torques[(size * count as f64).round() as usize..], |torque| -torque)
                }
                "gain_midway" => each(&mut torques[count / 2..], |torque| torque * (1.0 + size)),
                "low_pass" => low_pass(time_s, torques, size),
                "hold_torque" => hold(torques, |sample| sample / length * length),
                "hold_angle" => hold(angles, |sample| sample / length * length),
                "quantise" => {
                    let step_rad = TAU / size.exp2();
                    each(angles, |angle| (angle / step_rad + 1e-6).floor() * step_rad);
                }
                "freeze" => {
                    for share in [0.2, 0.45, 0.6] {
                        let first = (share * count as f64).round() as usize;
                        let last = (first + (size / step).round() as usize).min(count);
                        hold(&mut angles[first..last], |_| 0);
                        hold(&mut torques[first..last], |_| 0);
                    }
                }
                "degrees" => each(angles, f64::to_degrees),
                "millinewtons" => each(torques, |torque| 1000.0 * torque),
                "negate" => each(torques, |torque| -torque),
                "reverse" => {
                    each(torques, |torque| -torque);
                    each(angles, |angle| -angle);
                }
                "push" if number == 0 => {
                    let first = time_s[(0.4 * count as f64).round() as usize];
                    let peak = size * torques.iter().fold(0.0_f64, |peak, torque| peak.max(torque.abs()));
                    for (time, torque) in time_s.iter().zip(torques) {
                        let phase = ((time - first) / PUSH_S).clamp(0.0, 1.0);
                        *torque += peak * (0.5 * TAU * phase).sin();
                    }
                }
                "push" => {}
                _ => return false,
            }
        }
    }
    files.iter_mut().for_each(log);
    true
}

/// Rounds as loggers do: times to 0.1 us, other values to nine digits.
fn log(file: &mut Recording) {
    each(&mut file.time_s, |time| (1e7 * time).round() / 1e7);
    for JointSeries { position_rad, torque_nm } in &mut file.joints {
        for values in [position_rad, torque_nm] {
            each(values, |value| format!("{value:.8e}").parse().unwrap_or(value));
        }
    }
}

/// Turns the vector of gravity in a leg file about the joints' axis.
pub(super) fn turn_gravity(gravity: &mut [f64; 3], angle_deg: f64) {
    let (sine, cosine) = angle_deg.to_radians().sin_cos();
    let [x, y, _] = *gravity;
    (gravity[0], gravity[1]) = (cosine * x - sine * y, sine * x + cosine * y);
}

/// Median step of time stamps, s.
pub(super) fn period(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0)
}

fn each(values: &mut [f64], of: impl Fn(f64) -> f64) {
    values.iter_mut().for_each(|value| *value = of(*value));
}

/// Repeats the value of an earlier sample.
fn hold(values: &mut [f64], source: impl Fn(usize) -> usize) {
    (0..values.len()).for_each(|sample| values[sample] = values[source(sample)]);
}

/// Values at other times, linear between samples and constant beyond their ends.
pub(super) fn interpolated(time_s: &[f64], values: &[f64], at: impl Fn(f64) -> f64) -> Vec<f64> {
    let value = |time: f64| {
        let after = time_s.partition_point(|&stamp| stamp < time);
        if after == 0 || after == time_s.len() {
            return values[after.min(values.len() - 1)];
        }
        let share = (time - time_s[after - 1]) / (time_s[after] - time_s[after - 1]);
        values[after - 1] + share * (values[after] - values[after - 1])
    };
    time_s.iter().map(|time| value(at(*time))).collect()
}

/// Delays by whole samples if the delay is a multiple of an even period, else by interpolation.
pub(super) fn delay(time_s: &[f64], torques: &mut Vec<f64>, size: f64) {
    let step = period(time_s);
    let is_even = time_s.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-5);
    let shift = size / step;
    if is_even && (shift - shift.round()).abs() < 1e-3 && shift > 0.0 {
        let old = torques.clone();
        (0..old.len())
            .for_each(|sample| torques[sample] = old[sample.saturating_sub(shift.round() as usize)]);
    } else {
        *torques = interpolated(time_s, torques, |time| time - size);
    }
}

/// First-order low-pass.
fn low_pass(time_s: &[f64], torques: &mut [f64], corner_hz: f64) {
    let mut before = time_s[0] - period(time_s);
    let mut state = torques[0];
    for (time, torque) in time_s.iter().zip(torques) {
        state += (1.0 - (-TAU * corner_hz * (time - before)).exp()) * (*torque - state);
        (*torque, before) = (state, *time);
    }
}

/// Normal error of the time stamps, which stay sorted and increase by 0.2 us at least.
fn jitter(time_s: &mut [f64], size: f64) {
    let mut random = Random::new("jitter", 11);
    time_s.iter_mut().for_each(|time| *time += size * random.normal());
    time_s.sort_by(f64::total_cmp);
    for sample in 1..time_s.len() {
        time_s[sample] = time_s[sample].max(time_s[sample - 1] + 2e-7);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::{apply, turn_gravity};
    use scarab_identify::{JointSeries, Recording};

    /// Two joints at 100 Hz, with angles and torques that name sample and joint.
    pub(crate) fn recording() -> Recording {
        let time_s: Vec<f64> = (0..200).map(|sample| f64::from(sample) / 100.0).collect();
        let joint = |sign: f64| JointSeries {
            position_rad: time_s.iter().map(|time| sign * time).collect(),
            torque_nm: time_s.iter().map(|time| sign * (10.0 + 100.0 * time)).collect(),
        };
        Recording { file: "r".into(), joints: vec![joint(1.0), joint(-1.0)], joints_in_file: 2, time_s }
    }

    /// Angle and torque of the first joint at sample 100, where undamaged ones are 1 rad and 110 N m.
    fn damaged(kind: &str, size: f64) -> [f64; 2] {
        let mut files = [recording()];
        assert!(apply(kind, &mut files, size, &[0]), "{kind}");
        let second = &files[0].joints[1];
        let other = &recording().joints[1];
        assert!(
            kind.starts_with("swap") || (second.torque_nm[100] - other.torque_nm[100]).abs() < 1e-6,
            "{kind}"
        );
        [files[0].joints[0].position_rad[100], files[0].joints[0].torque_nm[100]]
    }

    #[test]
    fn each_damage_changes_what_its_name_says() {
        let cases = [
            ("clean", 0.0, 1.0, 110.0),
            ("delay", 0.02, 1.0, 108.0),
            ("delay", 0.025, 1.0, 107.5),
            ("encoder_scale", 0.05, 1.05, 110.0),
            ("gain", 0.1, 1.0, 121.0),
            ("clip", 0.5, 1.0, 104.5),
            ("clip_one_side", 0.5, 1.0, 104.5),
            ("flip_midway", 0.5, 1.0, -110.0),
            ("flip_midway", 0.75, 1.0, 110.0),
            ("gain_midway", 1.0, 1.0, 220.0),
            ("swap_torques", 0.0, 1.0, -110.0),
            ("swap_angles", 0.0, -1.0, 110.0),
            ("swap_joints", 0.0, -1.0, -110.0),
            ("hold_torque", 0.06, 1.0, 106.0),
            ("hold_angle", 0.06, 0.96, 110.0),
            ("quantise", 3.0, 0.25 * std::f64::consts::PI, 110.0),
            ("freeze", 0.2, 0.9, 100.0),
            ("degrees", 0.0, 1.0_f64.to_degrees(), 110.0),
            ("millinewtons", 0.0, 1.0, 110_000.0),
            ("negate", 0.0, 1.0, -110.0),
            ("reverse", 0.0, -1.0, -110.0),
            ("push", 0.5, 1.0, 110.0 + 0.5 * 209.0 * (std::f64::consts::PI / 3.0).sin()),
        ];
        for (kind, size, angle, torque) in cases {
            let found = damaged(kind, size);
            let is_right = (found[0] - angle).abs() < 1e-7 && (found[1] - torque).abs() < 1e-6;
            assert!(is_right || (kind == "freeze" && found[0] <= angle), "{kind} {size}: {found:?}");
        }
        assert!(!apply("none", &mut [recording()], 0.0, &[0]), "an unknown kind");
    }

    #[test]
    fn a_slow_filter_lags_a_ramp_by_its_time_constant() {
        let constant = 1.0 / (std::f64::consts::TAU * 5.0);
        let [_, torque] = damaged("low_pass", 5.0);
        assert!((110.0 - torque - 100.0 * constant).abs() < 0.6, "{torque}");
        // Unfiltered, the limit of 109.934 N m is reached.
        assert!(damaged("clip_filtered", 0.526)[1] < 109.92);
    }

    #[test]
    fn disturbed_stamps_stay_sorted_and_gravity_keeps_its_size() {
        let mut files = [recording()];
        assert!(apply("jitter", &mut files, 0.01, &[]));
        assert!(files[0].time_s.windows(2).all(|pair| pair[1] > pair[0]));
        assert!(files[0].time_s != recording().time_s);
        let mut gravity = [9.81, 0.0, 0.0];
        turn_gravity(&mut gravity, 90.0);
        assert!(gravity[0].abs() < 1e-12 && (gravity[1] - 9.81).abs() < 1e-12);
    }
}
