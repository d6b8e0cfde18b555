//! Recordings with faulty columns: clipped, held, frozen, wrongly stamped, or given twice; and the duration
//! of a push.

use crate::command::{Folder, MUJOCO, Run, Table, base, list, number, reasons};
use scarab_base::random::Random;
use serde_json::Value;
use std::fs;

/// Writes `walk.csv`: the MuJoCo recording after a change of its table.
fn changed(folder: &Folder, change: impl Fn(&mut Table)) {
    let mut table = Table::read(MUJOCO);
    change(&mut table);
    folder.write("walk.csv", table.text());
}

/// Output and report of a replay of the MuJoCo leg that ends with this code.
fn replay(folder: &Folder, arguments: &str, code: i32) -> (Run, Value) {
    folder.reported(&format!("replay --leg mujoco-leg --split 0.66667 {arguments}"), code)
}

/// Names of the findings in the columns, joint and whether they refuse.
fn samples(report: &Value) -> Vec<(&str, Option<u64>, bool)> {
    let found = list(report, "samples").iter().map(|found| {
        let name = found["name"].as_str().expect("a name");
        (name, found["joint"].as_u64(), found["refuses"].as_bool().expect("known"))
    });
    found.collect()
}

/// Largest distance of the base parameters from those of another report, in its sigma.
fn distance(report: &Value, other: &Value) -> f64 {
    let names = list(other, "base_parameters").iter();
    names
        .map(|entry| {
            let name = entry["name"].as_str().expect("a name");
            (base(report, name, "value") - base(other, name, "value")).abs() / base(report, name, "sigma")
        })
        .fold(0.0, f64::max)
}

fn clip(table: &mut Table, name: &str, share: f64) {
    let column = table.index(name);
    let limit = share * table.rows.iter().fold(0.0, |top: f64, row| top.max(row[column].abs()));
    table.rows.iter_mut().for_each(|row| row[column] = row[column].clamp(-limit, limit));
}

#[test]
fn saturated_torque_is_refused_or_where_short_excluded() {
    let folder = Folder::new();
    let (_, clean) = replay(&folder, MUJOCO, 0);
    assert_eq!(clean["samples"], serde_json::json!([]));

    changed(&folder, |table| clip(table, "tau2_Nm", 0.3));
    let (run, report) = replay(&folder, "@walk.csv", 3);
    assert!(reasons(&report).contains(&"input"), "{report}");
    assert!(samples(&report).contains(&("saturation", Some(2), true)), "{:?}", samples(&report));
    run.prints("tau2_Nm ends at a limit of 3.28");
    run.prints("of the samples lie, first at ");

    changed(&folder, |table| clip(table, "tau1_Nm", 0.93));
    let (run, report) = replay(&folder, "@walk.csv", 0);
    assert_eq!(samples(&report), [("saturation", Some(1), false)]);
    run.warns("These stretches are excluded");
    assert!(distance(&report, &clean) < 3.0, "{}", distance(&report, &clean));
}

#[test]
fn a_recording_given_twice_is_bad_input_under_any_name() {
    let folder = Folder::new();
    let text = fs::read_to_string(MUJOCO).expect("the recording");
    folder.write("arm.csv", &text);
    let copy = folder.write("copy.csv", &text);
    changed(&folder, |table| clip(table, "tau1_Nm", 0.93));
    for (files, words) in [
        ("@arm.csv --validate @copy.csv", "which is identified from: it cannot be held out"),
        ("@arm.csv @copy.csv", "holds the same samples as"),
        (
            "@walk.csv --validate @arm.csv --validate @copy.csv",
            &format!("--validate {}: holds the same samples", copy.display()),
        ),
    ] {
        folder.scarab(&format!("replay --leg mujoco-leg {files}")).refuses(words);
    }
}

#[test]
fn the_duration_of_a_push_does_not_depend_on_recording_length() {
    push_for(&[1, 4]);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn the_duration_of_a_push_is_right_in_forty_minutes() {
    push_for(&[2, 10, 20, 40, 80]);
}

/// Repeats the recording of 30 s, pushes both joints for 0.6 s, and expects that duration and acceptance.
fn push_for(repetitions: &[usize]) {
    let folder = Folder::new();
    for &periods in repetitions {
        changed(&folder, |table| {
            let once = table.rows.clone();
            // The motion has a period of 10 s, so it continues without a step.
            for turn in 1..periods {
                table.rows.extend(once.iter().map(|row| {
                    let mut row = row.clone();
                    row[0] += 0.002 * (turn * once.len()) as f64;
                    row
                }));
            }
            // Both joints move then; friction at rest would hide a part of the push.
            let first = 12.2;
            for name in ["tau1_Nm", "tau2_Nm"] {
                let column = table.index(name);
                let top = table.rows.iter().fold(0.0, |top: f64, row| top.max(row[column].abs()));
                for row in &mut table.rows {
                    let phase = (row[0] - first) / 0.6;
                    if (0.0..1.0).contains(&phase) {
                        row[column] += 1.2 * top * phase * (1.0 - phase);
                    }
                }
            }
        });
        let (_, report) = replay(&folder, "@walk.csv", 0);
        let seen = number(&report["outliers"], "longest_common_s");
        println!("{} s: pushed for {seen} s", 30 * periods);
        assert!((0.48..=0.72).contains(&seen), "{} s: {seen} s", 30 * periods);
    }
}

#[test]
fn wrong_time_stamps_are_refused_where_inertias_are_wrong() {
    let folder = Folder::new();
    changed(&folder, |table| {
        let column = table.index("t_s");
        // Late by up to 1.9 ms, irregularly: rows are stamped when the recorder has time.
        let mut random = Random::new("stamps", 5);
        for row in &mut table.rows {
            row[column] += random.uniform(0.0, 1.9e-3);
        }
    });
    let (_, report) = replay(&folder, "@walk.csv --bandwidth 25", 3);
    assert_eq!(samples(&report), [("time_stamps", None, true)]);
    let found = number(&report["samples"][0], "value");
    // Uniform in 1.9 ms: 0.548 ms rms.
    assert!((found / 0.548e-3 - 1.0).abs() < 0.05, "{found}");
}
