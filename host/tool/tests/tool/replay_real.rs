//! `scarab replay` on recordings of real machines, held out, at 5 Hz.
//!
//! `SCARAB_RECORDINGS` names the folder (`dp_A0`: planar double pendulum, BSD-3-Clause, DFKI RIC
//! 2022; `sp`: single pendulum, BSD-3-Clause, DFKI RIC 2021). "To beat" is weighted least squares
//! over all rows. Its angle and torque pass a second-order Butterworth filter forward and backward,
//! cut-off 5 Hz (-3 dB at 4 Hz).

use scarab_base::stats::rms;

use crate::command::{Folder, Table, fit, reasons};
use scarab::real::{sin_cos, sqrt};
use std::path::{Path, PathBuf};

fn recordings() -> Option<PathBuf> {
    crate::command::recordings("replay of recordings of real machines")
}

/// Runs `replay`; `@name` stands for a recording. Returns the report and the torque table.
fn replay(recordings: &Path, arguments: &str, code: i32) -> (serde_json::Value, Table) {
    let folder = Folder::new();
    let arguments = format!("replay {}", arguments.replace('@', &format!("{}/", recordings.display())));
    let (_, report) = folder.reported(&format!("{arguments} --csv @torque.csv"), code);
    (report, folder.table("torque.csv"))
}

/// Reference filter: second-order Butterworth at 5 Hz of 500, forward and backward, at rest at its
/// first value.
fn butterworth(values: &[f64]) -> Vec<f64> {
    let (sine, cosine) = sin_cos(std::f64::consts::PI * 5.0 / 500.0);
    let warped = sine / cosine;
    let norm = 1.0 / (1.0 + sqrt(2.0) * warped + warped * warped);
    let (gain, back) = (warped * warped * norm, 2.0 * (warped * warped - 1.0) * norm);
    let back2 = (1.0 - sqrt(2.0) * warped + warped * warped) * norm;
    let once = |values: Vec<f64>| -> Vec<f64> {
        let (mut x1, mut x2) = (values[0], values[0]);
        let (mut y1, mut y2) = (values[0], values[0]);
        let step = |x: f64| {
            let y = gain * (x + 2.0 * x1 + x2) - back * y1 - back2 * y2;
            (x2, x1, y2, y1) = (x1, x, y1, y);
            y
        };
        values.into_iter().map(step).rev().collect()
    };
    once(once(values.to_vec()))
}

/// Root mean square of measured minus predicted torque through the reference filter, over all rows
/// of the table, N m.
fn judged(table: &Table, joint: usize) -> f64 {
    let file = table.column("file");
    let measured = table.column(&format!("tau{joint}_measured_Nm"));
    let predicted = table.column(&format!("tau{joint}_predicted_Nm"));
    let errors: Vec<(f64, f64)> = file
        .iter()
        .zip(measured.iter().zip(&predicted))
        .map(|(file, (measured, predicted))| (*file, measured - predicted))
        .collect();
    let parts = errors.chunk_by(|one, next| one.0 == next.0);
    let filtered: Vec<f64> =
        parts.flat_map(|part| butterworth(&part.iter().map(|row| row.1).collect::<Vec<_>>())).collect();
    rms(filtered)
}

#[test]
fn held_out_torque_of_real_machines_is_predicted_within_stated_errors() {
    let Some(recordings) = recordings() else { return };
    let double =
        "@dp_A0/00.csv @dp_A0/01.csv @dp_A0/03.csv @dp_A0/05.csv @dp_A0/13.csv --leg dp-a0 --bandwidth 5";
    let excitation = "--validate @dp_A0/02.csv @dp_A0/04.csv @dp_A0/12.csv";
    // Limits in N m, 3 % above the measured values. First the printed error: -3 dB at 5 Hz, rows in which the
    // joint moves. Then the error of the table through the reference filter, over all rows. To beat: 0.100;
    // 0.148, 0.098; 0.202, 0.135. The pendulum's file has 6 s; its three seconds of training hardly determine
    // the estimated offset.
    let table: [(&str, String, &[f64], &[f64]); 3] = [
        (
            "sp/ddp, first half -> second",
            "@sp/ddp.csv --leg sp --split 0.5 --bandwidth 5".into(),
            &[0.105],
            &[0.125],
        ),
        (
            "dp_A0 excitation -> excitation",
            format!("{double} {excitation}"),
            &[0.140, 0.075],
            &[0.130, 0.073],
        ),
        (
            "dp_A0 excitation -> swing-up",
            format!("{double} --validate @dp_A0/11.csv"),
            &[0.121, 0.089],
            &[0.099, 0.081],
        ),
    ];
    for (name, arguments, printed, filtered) in table {
        let (report, torques) = replay(&recordings, &arguments, 0);
        for (index, (printed, filtered)) in printed.iter().zip(filtered).enumerate() {
            let joint = index + 1;
            let of = |field| fit(&report, "validation", joint, field);
            let other = judged(&torques, joint);
            println!(
                "{name}, joint {joint}: {:.4} N m, {:.1} % of mean abs, {:.1} % of rms; other filter {other:.4} N m",
                of("rms_nm"),
                of("percent_of_mean_abs"),
                of("percent_of_rms")
            );
            assert!(of("rms_nm") <= *printed, "{name}, joint {joint}: {} N m", of("rms_nm"));
            assert!(other <= *filtered, "{name}, joint {joint}, other filter: {other} N m");
        }
    }
}

#[test]
fn recordings_of_constrained_motion_are_refused() {
    let Some(recordings) = recordings() else { return };
    // The torque column is the command m g l sin q: a perfect fit with a negative inertia, and no friction.
    let (report, _) = replay(&recordings, "@sp/gravcomp.csv --leg sp --split 0.5 --bandwidth 5", 3);
    for reason in ["unphysical", "not_a_measurement"] {
        assert!(reasons(&report).contains(&reason), "{:?}", reasons(&report));
    }
    // Disturbed by a push in the second half.
    let (report, _) = replay(&recordings, "@sp/energy.csv --leg sp --split 0.5 --bandwidth 5", 3);
    assert!(reasons(&report).contains(&"validation"), "{:?}", reasons(&report));
}

#[test]
fn excluded_pushes_do_not_make_an_unvalidated_recording_acceptable() {
    let Some(recordings) = recordings() else { return };
    let whole = |report: &serde_json::Value| -> f64 {
        let findings = report["findings"].as_array().expect("a list").iter();
        let shares = findings.filter(|finding| finding["test"] == "whole_error");
        shares.map(|finding| finding["value"].as_f64().expect("a number")).fold(0.0, f64::max)
    };
    for bandwidth in [3, 5, 8] {
        let arguments = format!("@sp/energy.csv --leg sp --bandwidth {bandwidth}");
        let (report, _) = replay(&recordings, &arguments, 3);
        // The pushes may be named as contact as well.
        assert!(reasons(&report).contains(&"residual"), "{bandwidth} Hz: {:?}", reasons(&report));
        println!("sp/energy at {bandwidth} Hz misses {:.2} of the torque", whole(&report));
    }
    let excitation = "@dp_A0/00.csv @dp_A0/01.csv @dp_A0/03.csv @dp_A0/05.csv @dp_A0/13.csv --leg dp-a0";
    // At 8 Hz vibration makes 15 % of the pendulum's torque.
    for (arguments, bandwidths) in [("@sp/ddp.csv --leg sp", &[3, 5][..]), (excitation, &[4, 5, 8])] {
        for bandwidth in bandwidths {
            let (report, _) = replay(&recordings, &format!("{arguments} --bandwidth {bandwidth}"), 0);
            assert_eq!(report["validated"], false);
            println!("{arguments} at {bandwidth} Hz misses {:.2} of the torque", whole(&report));
        }
    }
}
