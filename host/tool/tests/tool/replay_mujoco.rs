//! `scarab replay` on a recording from another physics engine, at 8 Hz.
//!
//! Two periods train, the third is held out. Friction at rest is undetermined, so rows with a
//! resting joint in their window are excluded. The tool decides by the smoothed speed, this test by
//! the true one. The hip's mean absolute torque is 10.3 N m in the remaining rows and 7.7 N m over
//! the whole motion; each error states its reference.

use crate::command::{Folder, MUJOCO, Table, base, fit};
use scarab::ident::LowPass;
use scarab::ident::record::recorder::{LARGEST_STILL_SHARE, STILL_SPEED};
use scarab::real::sqrt;
use serde_json::Value;

const CLEAN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mujoco_leg/clean_torque.csv");
/// Mean absolute torque of hip and knee over the whole motion, N m, from the simulation.
const MEAN_ABSOLUTE: [f64; 2] = [7.6965, 4.8675];
const BANDWIDTH_HZ: f64 = 8.0;
const CLEAN_RATE_HZ: f64 = 100.0;

/// Report of a replay that writes `torque.csv`.
fn replay(folder: &Folder, arguments: &str) -> Value {
    let options = "--leg mujoco-leg --split 0.666666 --bandwidth 8 --csv @torque.csv";
    let (run, report) = folder.reported(&format!("replay {MUJOCO} {options} {arguments}"), 0);
    assert_eq!(run.errors, "");
    report
}

#[test]
fn torque_held_out_is_predicted_to_the_noise_of_the_recording() {
    let folder = Folder::new();
    for plan in ["one-time", "sequential"] {
        let report = replay(&folder, &format!("--plan {plan}"));
        // Relative to the mean over the whole motion, noise alone is 0.95 and 0.76 %; measured:
        // 1.040 and 0.841 %.
        for (joint, limit, limit_of_whole) in [(1, 1.05, 1.05), (2, 0.9, 0.9)] {
            let percent = fit(&report, "validation", joint, "percent_of_mean_abs");
            let of_whole = 100.0 * fit(&report, "validation", joint, "rms_nm") / MEAN_ABSOLUTE[joint - 1];
            println!(
                "{plan}, joint {joint}: {percent:.3} % of the mean of these rows, {of_whole:.3} % of all"
            );
            assert!(percent <= limit, "{plan}, joint {joint}: {percent} %");
            assert!(of_whole <= limit_of_whole, "{plan}, joint {joint}: {of_whole} % of the whole motion");
        }
    }
}

#[test]
fn parameters_of_the_simulated_leg_are_found_within_their_sigma() {
    let folder = Folder::new();
    let report = replay(&folder, "");
    assert_eq!(report["rank"], 13);
    // One draw of the noise: 13 errors of up to three sigma; large parameters also within 4 %.
    for entry in report["base_parameters"].as_array().expect("a list") {
        let name = entry["name"].as_str().expect("a name");
        let [value, sigma, truth] = ["value", "sigma", "truth"].map(|field| base(&report, name, field));
        println!("{name}: {value:.4} +- {sigma:.4}, truth {truth}");
        assert!((value - truth).abs() <= 3.0 * sigma, "{name}: {value} +- {sigma}, truth {truth}");
        if ["ZZ1R", "HX1R", "ZZ2", "HX2", "FC1", "FV1", "FC2", "FV2"].contains(&name) {
            assert!((value / truth - 1.0).abs() < 0.04, "{name}: {value}, truth {truth}");
        }
    }
}

#[test]
fn noise_free_torque_held_out_is_predicted_within_half_a_percent() {
    let folder = Folder::new();
    replay(&folder, "");
    let (predicted, clean) = (folder.table("torque.csv"), Table::read(CLEAN));
    let low_pass = LowPass::<f64, 64>::new(BANDWIDTH_HZ, CLEAN_RATE_HZ).expect("fits");
    for joint in [1, 2] {
        let (time, torque) = (predicted.column("t_s"), predicted.column(&format!("tau{joint}_predicted_Nm")));
        // A noise-free stamp lies between two of the grid's: the mean of both, 2 ms apart.
        let at = |now: f64| {
            let right = time.partition_point(|&stamp| stamp < now);
            let share = (now - *time.get(right.checked_sub(1)?)?) / (time.get(right)? - time[right - 1]);
            Some(torque[right - 1] + share * (torque[right] - torque[right - 1]))
        };
        let speed = clean.column(&format!("qd{joint}_radps"));
        let truth = clean.column(&format!("tau{joint}_Nm"));
        // Error and speed at every prediction.
        let (errors, speeds): (Vec<f64>, Vec<f64>) = clean
            .column("t_s")
            .iter()
            .zip(truth.iter().zip(&speed))
            .filter_map(|(&now, (truth, speed))| Some((at(now)? - truth, *speed)))
            .unzip();
        let (mut sum, mut kept, mut rows) = (0.0, 0, 0);
        for (window, speeds) in errors.windows(low_pass.taps()).zip(speeds.windows(low_pass.taps())) {
            let still: f64 = speeds
                .iter()
                .zip(low_pass.weights())
                .filter(|(speed, _)| speed.abs() < STILL_SPEED)
                .map(|(_, weight)| weight.abs())
                .sum();
            rows += 1;
            if still / low_pass.weights().iter().map(|weight| weight.abs()).sum::<f64>()
                <= LARGEST_STILL_SHARE
            {
                let error: f64 =
                    window.iter().zip(low_pass.weights()).map(|(error, weight)| error * weight).sum();
                (sum, kept) = (sum + error * error, kept + 1);
            }
        }
        let percent = 100.0 * sqrt(sum / f64::from(kept)) / MEAN_ABSOLUTE[joint - 1];
        println!("joint {joint}: {percent:.3} % of mean absolute torque in {kept} of {rows} rows");
        // Measured: 0.39 and 0.31 %, in 70 and 89 % of the rows.
        assert!(percent <= 0.5, "joint {joint}: {percent} %");
        assert!(3 * kept > 2 * rows, "joint {joint}: {kept} of {rows} rows");
    }
}
