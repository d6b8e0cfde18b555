//! Resampling on the uniform grid: pass band, losses, and equal treatment of angle and torque.

use std::f64::consts::TAU;
use std::path::PathBuf;

use rand_distr::{Distribution, StandardNormal, Uniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use scarab::real::{atan2, sin_cos, sqrt};
use scarab_identify::formats::recording::{JointSeries, Recording};
use scarab_identify::run::resample::{GRID_RATE_HZ, Method, Resampled};

const FREQUENCY_HZ: f64 = 3.0;
const OFFSET_S: f64 = 17.3;

/// Angle: sine of amplitude 1 at 3 Hz; torque: three times that.
fn sine(time_s: Vec<f64>) -> Recording {
    let position_rad: Vec<f64> = time_s.iter().map(|time| sin_cos(TAU * FREQUENCY_HZ * time).0).collect();
    let torque_nm = position_rad.iter().map(|angle| 3.0 * angle).collect();
    recording(time_s, JointSeries { position_rad, torque_nm })
}

fn recording(time_s: Vec<f64>, joint: JointSeries) -> Recording {
    Recording { file: PathBuf::from("synthetic"), time_s, joints: vec![joint], joints_in_file: 1 }
}

/// Ten seconds of stamps that start at an odd time.
fn uniform_stamps(rate_hz: f64) -> Vec<f64> {
    (0..=(10.0 * rate_hz) as usize).map(|sample| OFFSET_S + sample as f64 / rate_hz).collect()
}

/// Stamps at 500 Hz, each up to 0.8 ms early or late: steps of 0.4 to 3.6 ms.
fn jittered_stamps(seed: u64) -> Vec<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let jitter = Uniform::new(-0.8e-3, 0.8e-3).expect("a range");
    uniform_stamps(500.0).into_iter().map(|time| time + jitter.sample(&mut random)).collect()
}

/// Largest difference from the sine, and amplitude and phase (rad, positive: late) of the 3 Hz part.
fn compare(resampled: &Resampled) -> (f64, f64, f64) {
    let joint = &resampled.joints[0];
    let (mut worst, mut in_phase, mut quadrature) = (0.0_f64, 0.0, 0.0);
    // Whole periods only, so that the projection has no leakage.
    let points = (9.0 * GRID_RATE_HZ) as usize;
    for (point, angle) in joint.position_rad.iter().enumerate() {
        let (sine, cosine) = sin_cos(TAU * FREQUENCY_HZ * resampled.time_s(point));
        worst = worst.max((angle - sine).abs());
        if point < points {
            in_phase += angle * sine;
            quadrature += angle * cosine;
        }
    }
    let (in_phase, quadrature) = (in_phase * 2.0 / points as f64, quadrature * 2.0 / points as f64);
    (worst, sqrt(in_phase * in_phase + quadrature * quadrature), -atan2(quadrature, in_phase))
}

#[test]
fn a_one_kilohertz_sine_is_attenuated_as_stated_and_not_delayed() {
    let resampled = Resampled::new(&sine(uniform_stamps(1000.0)));
    let (worst, amplitude, phase) = compare(&resampled);
    assert_eq!(resampled.method, Method::BinMean);
    // sinc(0.006) sinc(0.003)^2 = 1 - 8.9e-5, the -0.01 % of the table.
    assert!((amplitude - (1.0 - 8.9e-5)).abs() < 1e-6, "amplitude {amplitude}");
    assert!(worst < 9.5e-5, "error {worst:e}");
    assert!(phase.abs() < 1e-9, "phase {phase:e} rad");
}

#[test]
fn a_fifty_hertz_sine_is_interpolated_within_the_stated_error() {
    let resampled = Resampled::new(&sine(uniform_stamps(50.0)));
    let (worst, amplitude, phase) = compare(&resampled);
    assert_eq!(resampled.method, Method::CatmullRom);
    // Half way: 3/8 (0.06 pi)^4 = 4.7e-4. At a quarter the odd cubic term is added: (0.06 pi)^3 8 / 6 * 0.1
    // = 9e-4. First and last interval have a one-sided slope and are left to the filter chain's own ends.
    let interior = worst_between(&resampled, 0.05);
    assert!(interior < 9.0e-4, "error {interior:e}");
    assert!(worst < 0.03, "error at the ends {worst:e}");
    assert!((amplitude - 1.0).abs() < 3.0e-4, "amplitude {amplitude}");
    // Odd terms of the intervals cancel: 1e-4 rad at 3 Hz would be 5 us.
    assert!(phase.abs() < 1e-4, "phase {phase:e} rad");
}

#[test]
fn a_jittered_sine_is_restored() {
    let resampled = Resampled::new(&sine(jittered_stamps(1)));
    let (_, amplitude, phase) = compare(&resampled);
    let interior = worst_between(&resampled, 0.01);
    // Untreated, 0.8 ms of jitter are an error of up to 2 pi 3 Hz 0.8 ms = 1.5e-2. A slope over uneven steps
    // is wrong by y''/2 times their difference. The error in the middle is 1/8 of the step times both ends'
    // slope errors: 3.6 ms / 8 * 2 * 178 * 3.2 ms = 5.1e-4 at worst.
    assert!(interior < 5.1e-4, "error {interior:e}");
    // A share of that error follows the curvature: on average -4e-5 at 3 Hz, proportional to the
    // frequency squared.
    assert!((amplitude - 1.0).abs() < 6.0e-5, "amplitude {amplitude}");
    assert!(phase.abs() < 2.0e-5, "phase {phase:e} rad");
}

#[test]
fn a_recording_on_the_grid_is_unchanged() {
    let recording = sine((0..2000_u32).map(|sample| f64::from(sample) / GRID_RATE_HZ).collect());
    let resampled = Resampled::new(&recording);
    assert_eq!(resampled.joints, recording.joints);
    assert_eq!(resampled.len(), 2000);
    // Stamps rounded to a microsecond and an offset move a grid point by 0.5 us: 2 pi 3 Hz 0.5 us = 1e-5.
    let rounded = recording.time_s.iter().map(|time| ((time + 0.000_333) * 1e6).round() / 1e6).collect();
    let shifted = Resampled::new(&Recording { time_s: rounded, ..recording.clone() });
    assert_eq!(shifted.len(), 2000);
    for (one, other) in shifted.joints[0].position_rad.iter().zip(&recording.joints[0].position_rad) {
        assert!((one - other).abs() < 1.0e-5);
    }
}

#[test]
fn noise_of_a_one_kilohertz_recording_drops_by_the_two_sample_mean() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    let time_s = uniform_stamps(1000.0);
    let torque_nm: Vec<f64> = time_s.iter().map(|_| StandardNormal.sample(&mut random)).collect();
    let position_rad = vec![0.0; time_s.len()];
    let resampled = Resampled::new(&recording(time_s, JointSeries { position_rad, torque_nm }));
    let noise = &resampled.joints[0].torque_nm;
    let deviation = sqrt(noise.iter().map(|value| value * value).sum::<f64>() / noise.len() as f64);
    // Weights 1/4, 1/2, 1/4: sqrt(3/8) = 0.612, below the 1/sqrt(2) of a mean of two samples. 5,000 values.
    assert!((deviation - 0.612).abs() < 0.02, "deviation {deviation}");
    // After the low-pass only the density at low frequency matters. The mean of 100 grid points (0.2 s, 200
    // samples) must have the deviation 1/sqrt(200). 50 blocks: +-10 %, three deviations of it.
    let blocks: Vec<f64> = noise.chunks_exact(100).map(|block| block.iter().sum::<f64>() / 100.0).collect();
    let slow = sqrt(blocks.iter().map(|mean| mean * mean).sum::<f64>() / blocks.len() as f64 * 200.0);
    assert!((slow - 1.0).abs() < 0.3, "density at low frequency {slow}");
}

#[test]
fn angle_and_torque_go_through_the_same_operator() {
    for stamps in [uniform_stamps(1000.0), uniform_stamps(50.0), jittered_stamps(3)] {
        let resampled = Resampled::new(&sine(stamps));
        for point in 0..resampled.len() {
            let [angle] = resampled.position_rad::<1>(point).expect("a grid point");
            let [torque] = resampled.torque_nm::<1>(point).expect("a grid point");
            assert!((torque - 3.0 * angle).abs() < 1e-9, "at {point}: {torque} is not three times {angle}");
        }
    }
}

#[test]
fn stamps_in_bursts_do_not_amplify_noise() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
    // Two samples 10 us apart every 10 ms: a parabola's slope would amplify the noise of the short step.
    let stamp = |k: u32| f64::from(k / 3) * 0.010 + [0.0, 1e-5, 5e-3][(k % 3) as usize];
    let time_s: Vec<f64> = (0..900).map(stamp).collect();
    let position_rad: Vec<f64> = time_s.iter().map(|_| StandardNormal.sample(&mut random)).collect();
    let mut sparse = recording(time_s, JointSeries { torque_nm: position_rad.clone(), position_rad });
    // The median step selects the method for a burst; both methods must stay smooth.
    for expected in [Method::CatmullRom, Method::BinMean] {
        if expected == Method::BinMean {
            sparse.time_s.iter_mut().for_each(|time| *time /= 4.0);
        }
        let resampled = Resampled::new(&sparse);
        assert_eq!(resampled.method, expected);
        let largest =
            resampled.joints[0].position_rad.iter().fold(0.0_f64, |worst, value| worst.max(value.abs()));
        // 900 normal values reach 3.3; the cubic may overshoot by a quarter.
        assert!(largest < 4.2, "{expected:?}: {largest} standard deviations");
    }
}

#[test]
fn too_large_a_bandwidth_gives_a_warning() {
    let resampled = Resampled::new(&sine(uniform_stamps(50.0)));
    assert_eq!(resampled.bandwidth_warning(8.0), None);
    assert_eq!(
        resampled.bandwidth_warning(12.0).expect("a warning").to_string(),
        "a bandwidth of 12 Hz is too large for a recording at 50 Hz: choose at most 10.0 Hz"
    );
}

#[test]
fn points_and_joints_beyond_the_last_have_no_value() {
    let resampled = Resampled::new(&sine(uniform_stamps(500.0)));
    assert_eq!(resampled.position_rad::<1>(resampled.len()), None);
    assert_eq!(resampled.torque_nm::<2>(0), None);
    assert!(Resampled::new(&sine(Vec::new())).is_empty());
    assert!(Resampled::new(&sine(vec![1.0])).is_empty());
}

/// Largest difference from the sine, without `margin_s` at both ends.
fn worst_between(resampled: &Resampled, margin_s: f64) -> f64 {
    let margin = (margin_s * GRID_RATE_HZ) as usize;
    (margin..resampled.len() - margin)
        .map(|point| {
            let sine = sin_cos(TAU * FREQUENCY_HZ * resampled.time_s(point)).0;
            (resampled.joints[0].position_rad[point] - sine).abs()
        })
        .fold(0.0, f64::max)
}
