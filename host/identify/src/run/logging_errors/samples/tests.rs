use scarab_base::random::Random;

use crate::formats::recording::JointSeries;
use crate::run::logging_errors::samples::*;

const STEPS: usize = 10_000;

/// Twenty seconds at 500 Hz: an angle in steps of `count` and a torque of 10 N m with noise of `noise_nm`.
fn recording(count: f64, noise_nm: f64) -> Recording {
    let mut noise = Random::new("samples", 7);
    let time_s: Vec<f64> = (0..STEPS).map(|sample| sample as f64 * 0.002).collect();
    let position_rad = time_s
        .iter()
        .map(|time| 0.8 * (3.1 * time).sin() + 0.2 * (8.3 * time).cos())
        .map(|angle| if count > 0.0 { (angle / count).round() * count } else { angle })
        .collect();
    let torque_nm = time_s
        .iter()
        .map(|time| {
            7.0 * (3.1 * time).sin() + 3.0 * (11.0 * time).sin() + noise_nm * noise.uniform(-1.0, 1.0)
        })
        .collect();
    Recording {
        file: "a.csv".into(),
        time_s,
        joints: vec![JointSeries { position_rad, torque_nm }],
        joints_in_file: 1,
    }
}

fn found(recording: &Recording) -> Screened {
    screen(&[recording], &[0.0; 2], 0.123).remove(0)
}

/// The finding of this name, with its spans; fails if there is another one.
fn only(recording: &Recording, name: &str) -> (SampleFinding, Vec<Range<f64>>) {
    let screened = found(recording);
    assert!(screened.findings.iter().all(|finding| finding.name == name), "{:?}", screened.findings);
    (screened.findings.first().expect("a finding").clone(), screened.spans)
}

#[test]
fn clean_columns_have_no_finding_whatever_their_noise_and_steps() {
    for count in [0.0, 1e-6, 3.8e-4, 1.4e-3] {
        for noise in [0.0, 0.02, 0.3, 3.0] {
            assert_eq!(found(&recording(count, noise)), Screened::default(), "{count} rad, {noise} N m");
        }
    }
    // A torque of 8 bits, and one whose steps are larger than its noise.
    for step in [0.08, 0.5] {
        let mut coarse = recording(3.8e-4, 0.1);
        for torque in &mut coarse.joints[0].torque_nm {
            *torque = (*torque / step).round() * step;
        }
        let screened = found(&coarse);
        assert!(screened.findings.iter().all(|finding| finding.name == QUANTISED), "{:?}", screened.findings);
    }
}

#[test]
fn rows_of_zeros_are_found_between_others_and_not_at_rest() {
    let mut mixed = recording(0.0, 0.3);
    for row in (7..STEPS).step_by(10) {
        (mixed.joints[0].position_rad[row], mixed.joints[0].torque_nm[row]) = (0.0, 0.0);
    }
    let screened = found(&mixed);
    let zeros = screened.findings.iter().find(|finding| finding.name == ZERO_ROWS).expect("found");
    assert!(zeros.refuses && (0.08..=0.1).contains(&zeros.share), "{}", zeros.text);
    // A few lost messages in ten thousand are reported only.
    let mut lost = recording(0.0, 0.3);
    for row in [1_000, 2_000, 3_000, 4_000, 5_000] {
        (lost.joints[0].position_rad[row], lost.joints[0].torque_nm[row]) = (0.0, 0.0);
    }
    assert!(found(&lost).findings.iter().all(|finding| !finding.refuses));
    // A leg that rests at zero before and after its motion, with its drive off.
    let mut resting = recording(0.0, 0.3);
    for row in (0..500).chain(STEPS - 500..STEPS) {
        (resting.joints[0].position_rad[row], resting.joints[0].torque_nm[row]) = (0.0, 0.0);
    }
    assert!(found(&resting).findings.iter().all(|finding| finding.name != ZERO_ROWS));
}

#[test]
fn a_limit_is_found_though_an_exact_angle_rests() {
    let mut resting = recording(0.0, 0.3);
    let series = &mut resting.joints[0];
    // Every half second the joint sticks for 30 ms, wherever it is.
    for start in (100..STEPS - 20).step_by(250) {
        let angle = series.position_rad[start];
        series.position_rad[start..start + 15].fill(angle);
    }
    series.torque_nm.iter_mut().for_each(|torque| *torque = torque.min(7.0));
    let screened = found(&resting);
    assert!(screened.findings.iter().any(|finding| finding.name == SATURATION), "{:?}", screened.findings);
}

#[test]
fn coarse_angles_interpolated_to_another_clock_are_neither_held_nor_frozen() {
    // Slow enough that the angle repeats itself for up to 30 ms between two counts.
    let mut coarse = recording(0.0, 0.3);
    for (angle, time) in coarse.joints[0].position_rad.iter_mut().zip(&coarse.time_s) {
        *angle = (0.15 * (3.1 * time).sin() / 2.9e-3).round() * 2.9e-3;
    }
    let series = &coarse.joints[0];
    for step_s in [0.001, 0.0021, 0.0033, 0.004] {
        let time_s: Vec<f64> =
            (0..).map(|sample| 0.0007 + f64::from(sample) * step_s).take_while(|time| *time < 19.9).collect();
        let onto = |values: &[f64]| -> Vec<f64> {
            let at = |time: &f64| {
                let (before, part) = ((time / 0.002) as usize, (time / 0.002).fract());
                values[before] + part * (values[before + 1] - values[before])
            };
            time_s.iter().map(at).collect()
        };
        let joints = vec![JointSeries {
            position_rad: onto(&series.position_rad),
            torque_nm: onto(&series.torque_nm),
        }];
        let screened = found(&Recording { time_s: time_s.clone(), joints, ..coarse.clone() });
        assert!(
            screened.findings.iter().all(|finding| finding.name == QUANTISED),
            "{step_s} s: {:?}",
            screened.findings
        );
    }
}

#[test]
fn a_gravity_torque_with_a_broad_peak_is_not_taken_for_a_limit() {
    // Swings up to the horizontal, without noise: a peak of the fourth order.
    let mut swing = recording(0.0, 0.0);
    let series = &mut swing.joints[0];
    for (time, (angle, torque)) in
        swing.time_s.iter().zip(series.position_rad.iter_mut().zip(&mut series.torque_nm))
    {
        *angle = 0.5 * std::f64::consts::PI * (1.7 * time).sin();
        *torque = 20.0 * angle.sin();
    }
    assert_eq!(found(&swing), Screened::default());
}

#[test]
fn a_leg_that_rests_at_its_largest_torque_is_not_saturated() {
    let mut rest = recording(3.8e-4, 0.0);
    let series = &mut rest.joints[0];
    // The leg stops for four seconds and goes on from there.
    for values in [&mut series.position_rad, &mut series.torque_nm] {
        values.copy_within(4_000..8_000, 6_000);
        let value = values[4_000];
        values[4_000..6_000].fill(value);
    }
    series.torque_nm[4_000..6_000].fill(12.0);
    assert_eq!(found(&rest), Screened::default());
}

#[test]
fn torque_at_a_limit_is_found_with_limit_and_share_on_one_side_and_on_both() {
    for (noise, share) in [(0.0, 0.8), (0.3, 0.8), (0.3, 0.6)] {
        let mut clipped = recording(3.8e-4, noise);
        let top = clipped.joints[0].torque_nm.iter().copied().fold(0.0, f64::max);
        for torque in &mut clipped.joints[0].torque_nm {
            *torque = torque.min(share * top);
        }
        let (finding, _) = only(&clipped, SATURATION);
        assert_eq!((finding.value, finding.joint), (share * top, Some(1)));
        let at = clipped.joints[0].torque_nm.iter().filter(|&&torque| torque > 0.99 * share * top).count();
        assert!((finding.share * STEPS as f64 / at as f64 - 1.0).abs() < 0.2, "{} of {at}", finding.share);
        for torque in &mut clipped.joints[0].torque_nm {
            *torque = torque.max(-share * top);
        }
        assert_eq!(found(&clipped).findings.len(), 2);
    }
}

#[test]
fn a_limit_behind_a_filter_is_found_by_its_missing_noise() {
    let mut clipped = recording(3.8e-4, 0.5);
    let mut state = 0.0;
    for torque in &mut clipped.joints[0].torque_nm {
        // First order, 50 Hz.
        state += 0.467 * (torque.clamp(-6.0, 6.0) - state);
        *torque = state;
    }
    let (finding, _) = only(&clipped, SATURATION);
    assert!((finding.value.abs() / 6.0 - 1.0).abs() < 1e-3 && finding.refuses, "{finding:?}");
}

#[test]
fn few_saturated_samples_are_excluded_and_many_refused() {
    let mut clipped = recording(3.8e-4, 0.3);
    let clip = |recording: &mut Recording, limit: f64| {
        recording.joints[0].torque_nm.iter_mut().for_each(|torque| *torque = torque.min(limit));
    };
    clip(&mut clipped, 9.7);
    let (finding, spans) = only(&clipped, SATURATION);
    assert!(!finding.refuses && !spans.is_empty(), "{finding:?}");
    for (time, torque) in clipped.time_s.iter().zip(&clipped.joints[0].torque_nm) {
        assert!(*torque < 9.7 || spans.iter().any(|span| span.contains(time)), "{time}");
    }
    clip(&mut clipped, 4.0);
    assert!(only(&clipped, SATURATION).0.refuses);
}

#[test]
fn a_limit_shared_by_recordings_is_found_where_one_alone_shows_too_little() {
    let (mut clipped, mut calm) = (recording(3.8e-4, 0.3), recording(3.8e-4, 0.3));
    clipped.joints[0].torque_nm.iter_mut().for_each(|torque| *torque = torque.min(9.0));
    calm.joints[0].torque_nm.iter_mut().for_each(|torque| *torque *= 0.6);
    calm.joints[0].torque_nm[5_000..5_008].fill(9.0);
    assert_eq!(found(&calm), Screened::default());
    for screened in screen(&[&clipped, &calm], &[0.0; 2], 0.123) {
        let [finding] = screened.findings.as_slice() else { panic!("{:?}", screened.findings) };
        assert_eq!((finding.name, finding.value), (SATURATION, 9.0));
    }
}

#[test]
fn values_that_are_repeated_are_found_with_their_holding_time() {
    for hold in [5, 10, 25] {
        for is_torque in [true, false] {
            let mut held = recording(3.8e-4, 0.3);
            let series = &mut held.joints[0];
            let values = if is_torque { &mut series.torque_nm } else { &mut series.position_rad };
            for sample in 0..values.len() {
                values[sample] = values[sample / hold * hold];
            }
            let (finding, spans) = only(&held, HELD);
            assert!((finding.value - 0.002 * hold as f64).abs() < 1e-9, "{finding:?}");
            assert!(finding.refuses && spans.is_empty());
            assert!(finding.text.contains("repeats its values"), "{}", finding.text);
        }
    }
}

#[test]
fn a_column_at_half_the_rate_is_reported_but_not_refused() {
    let mut held = recording(3.8e-4, 0.3);
    let torque = &mut held.joints[0].torque_nm;
    for sample in 0..torque.len() {
        torque[sample] = torque[sample / 2 * 2];
    }
    let (finding, _) = only(&held, HELD);
    assert!(!finding.refuses && (finding.value - 0.004).abs() < 1e-9, "{finding:?}");
}

#[test]
fn frozen_stretches_are_excluded() {
    for noise in [0.0, 0.3] {
        let mut frozen = recording(3.8e-4, noise);
        let series = &mut frozen.joints[0];
        for first in [2_000, 5_000] {
            for values in [&mut series.position_rad, &mut series.torque_nm] {
                let value = values[first];
                values[first..first + 150].fill(value);
            }
        }
        let (finding, spans) = only(&frozen, HELD);
        assert!(!finding.refuses && (finding.value - 0.6).abs() < 0.02, "{finding:?}");
        assert_eq!(spans.len(), 2);
        for (span, first) in spans.iter().zip([4.0, 10.0]) {
            assert!((span.start - first).abs() < 0.01 && (span.end - first - 0.3).abs() < 0.01, "{span:?}");
        }
    }
}

#[test]
fn a_constant_torque_beside_a_moving_leg_is_frozen() {
    let mut frozen = recording(3.8e-4, 0.3);
    let torque = &mut frozen.joints[0].torque_nm;
    let value = torque[3_000];
    torque[3_000..3_100].fill(value);
    let (finding, spans) = only(&frozen, HELD);
    assert!(!finding.refuses && spans.len() == 1, "{finding:?} {spans:?}");
}

#[test]
fn a_glitch_at_full_scale_is_no_limit() {
    let mut wild = recording(3.8e-4, 0.3);
    for sample in (50..STEPS).step_by(100) {
        wild.joints[0].torque_nm[sample] = 32.767;
    }
    assert_eq!(found(&wild), Screened::default());
}
