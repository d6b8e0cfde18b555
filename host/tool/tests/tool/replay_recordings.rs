//! Several recordings of one leg: the scatter between them is part of sigma.

use serde_json::Value;

use crate::command::{Folder, MUJOCO, Run, Table, base};

/// The three periods of the MuJoCo recording, a file each, with an offset added to the knee's torque, N m.
fn periods(folder: &Folder, offset_nm: [f64; 3]) {
    let table = Table::read(MUJOCO);
    let [time, torque] = ["t_s", "tau2_Nm"].map(|name| table.index(name));
    let part = |(number, offset): (usize, &f64)| {
        let from = 10.0 * number as f64;
        let mut part = Table { header: table.header.clone(), rows: table.rows.clone() };
        part.rows.retain(|row| row[time] >= from && row[time] < from + 10.0);
        part.rows.iter_mut().for_each(|row| row[torque] += offset);
        folder.write(&format!("{number}.csv"), part.text());
    };
    offset_nm.iter().enumerate().for_each(part);
}

fn replay(folder: &Folder, files: &str) -> (Run, Value) {
    // Nothing is known of the offset, which differs between the recordings.
    let leg = include_str!("../../../legs/mujoco-leg.toml").replace("{ within_nm = 0.02 }", "\"on\"");
    folder.write("leg.toml", leg);
    let run = folder.scarab(&format!("replay --leg @leg.toml {files} --json @run.json"));
    (run, folder.json("run.json"))
}

#[test]
fn a_parameter_that_differs_between_recordings_has_that_scatter_as_sigma() {
    let folder = Folder::new();
    periods(&folder, [0.0, 1.0, -1.0]);
    let (run, report) = replay(&folder, "@0.csv @1.csv @2.csv");
    run.prints("sigma contains the scatter between 3 recordings");
    assert_eq!(report["recordings"]["count"], 3);
    let names = report["base_parameters"].as_array().expect("a list");
    let index = names.iter().position(|entry| entry["name"] == "OFF2").expect("the knee's offset");
    assert_eq!(names[index]["sigma_from"], "recordings");
    let (sigma, scatter) = (base(&report, "OFF2", "sigma"), &report["recordings"]["sigma"][index]);
    // Three equal recordings: standard deviation 1 N m over sqrt 3. Offsets also move the other parameters.
    assert!((0.4..1.2).contains(&sigma) && sigma >= scatter.as_f64().expect("known"), "{sigma}, {scatter}");
    // Equal recordings keep the sigma of noise or segments.
    periods(&folder, [0.0; 3]);
    let (_, alike) = replay(&folder, "@0.csv @1.csv @2.csv");
    assert!(base(&alike, "OFF2", "sigma") < 0.3 * sigma, "{alike}");
}

#[test]
fn one_recording_reports_that_sigma_lacks_scatter_between_recordings() {
    let folder = Folder::new();
    periods(&folder, [0.0; 3]);
    let (run, report) = replay(&folder, "@0.csv");
    run.prints("sigma does not contain the scatter between recordings: only one");
    assert_eq!(report["recordings"], serde_json::json!({ "count": 1, "sigma": [] }));
}

#[test]
fn a_warning_about_both_parts_of_a_file_is_printed_once() {
    let folder = Folder::new();
    let mut table = Table::read(MUJOCO);
    let step = table.rows.len() / 750;
    table.rows = table.rows.into_iter().step_by(step).collect();
    folder.write("sparse.csv", table.text());
    let errors = folder.scarab("replay --leg mujoco-leg --split 0.67 @sparse.csv").errors;
    assert_eq!(errors.matches("is too large for a recording").count(), 1, "{errors}");
}
