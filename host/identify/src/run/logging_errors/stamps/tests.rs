use scarab_base::random::Random;

use crate::formats::recording::JointSeries;
use crate::run::logging_errors::stamps::*;

/// Twenty seconds at 500 Hz, sampled at `times + sampled * normal` and stamped `stamped * normal` wrong.
fn recording(sampled_s: f64, stamped_s: f64) -> Recording {
    let mut random = Random::new("stamps", 3);
    let mut rows: Vec<(f64, f64)> = (0..10_000)
        .map(|sample| {
            let time = f64::from(sample) * 0.002 + sampled_s * random.normal();
            let angle = 0.8 * (3.1 * time).sin() + 0.2 * (8.3 * time).cos();
            (time + stamped_s * random.normal(), (angle / 3.8e-4).round() * 3.8e-4)
        })
        .collect();
    let mut stamps: Vec<f64> = rows.iter().map(|row| row.0).collect();
    stamps.sort_by(f64::total_cmp);
    for (row, stamp) in rows.iter_mut().zip(stamps) {
        row.0 = stamp;
    }
    Recording {
        file: "a.csv".into(),
        time_s: rows.iter().map(|row| row.0).collect(),
        joints: vec![JointSeries {
            position_rad: rows.iter().map(|row| row.1).collect(),
            torque_nm: vec![0.0; rows.len()],
        }],
        joints_in_file: 1,
    }
}

#[test]
fn irregular_sampling_with_right_stamps_raises_no_finding() {
    for sampled in [0.0, 1e-4, 3e-4] {
        assert_eq!(examine(&recording(sampled, 0.0), &[0.0], 16.0), None, "{sampled} s");
    }
}

#[test]
fn stamp_errors_below_a_tenth_of_a_sample_raise_no_finding() {
    for stamped in [2e-5, 1e-4] {
        assert_eq!(examine(&recording(0.0, stamped), &[0.0], 25.0), None, "{stamped} s");
    }
}

#[test]
fn wrong_stamps_are_estimated_and_refused_where_inertias_are_wrong() {
    let found = |stamped: f64, bandwidth_hz: f64| {
        examine(&recording(0.0, stamped), &[0.0], bandwidth_hz).expect("wrong stamps")
    };
    let finding = found(5e-4, 8.0);
    // The line through each half second uses two of 250 degrees of freedom.
    assert!((finding.value - 5e-4).abs() < 3.0 * finding.sigma.expect("known") + 2e-6, "{finding:?}");
    assert!(!found(5e-4, 4.0).refuses);
    assert!(found(5e-4, 25.0).refuses);
    assert!(found(1e-2, 8.0).refuses);
}

/// Recording at 100 Hz without every `period`-th row, whose stamps count the rows that are left.
fn counted(period: usize, step_rad: f64) -> Recording {
    let angle = |time: f64| 0.8 * (3.1 * time).sin() + 0.2 * (8.3 * time).cos();
    let kept = (1..8_001_usize).filter(|row| row % period != 0).map(|row| angle(row as f64 * 0.01));
    let position_rad: Vec<f64> = kept.map(|angle| (angle / step_rad).round() * step_rad).collect();
    let time_s: Vec<f64> = (0..position_rad.len()).map(|row| row as f64 * 0.01).collect();
    let torque_nm = vec![0.0; time_s.len()];
    let joints = vec![JointSeries { position_rad, torque_nm }];
    Recording { file: "a.csv".into(), time_s, joints, joints_in_file: 1 }
}

#[test]
fn rows_that_a_counter_hides_are_counted() {
    for (period, refuses) in [(50, true), (100, true), (1_300, false)] {
        let finding = examine(&counted(period, 1e-6), &[0.0], 8.0).expect("missing rows");
        let missing = finding.share * (8_000 - 8_000 / period) as f64;
        // Rows that are lost near a reversal do not show.
        let all = (8_000 / period) as f64;
        assert!(missing <= all && missing >= 0.6 * all - 1.0, "{missing} of {all}: {}", finding.text);
        assert_eq!(finding.refuses, refuses, "{}", finding.text);
    }
    // Complete, and with an encoder so coarse that every change is one or two steps.
    assert_eq!(examine(&counted(9_000, 1e-6), &[0.0], 8.0), None);
    assert_eq!(examine(&counted(9_000, 3e-3), &[3e-3], 8.0), None);
}
