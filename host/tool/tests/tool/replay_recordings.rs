//! Several recordings of one leg: the scatter between them is part of sigma.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::command::{Folder, MUJOCO, Table, base, scarab};

/// The three periods of the MuJoCo recording, a file each, with an offset added to the knee's torque, N m.
fn periods(folder: &Folder, offset_nm: [f64; 3]) -> Vec<PathBuf> {
    let table = Table::read(MUJOCO);
    let [time, torque] = ["t_s", "tau2_Nm"].map(|name| table.index(name));
    let part = |(number, offset): (usize, &f64)| {
        let from = 10.0 * number as f64;
        let mut part = Table { header: table.header.clone(), rows: table.rows.clone() };
        part.rows.retain(|row| row[time] >= from && row[time] < from + 10.0);
        part.rows.iter_mut().for_each(|row| row[torque] += offset);
        folder.write(&format!("{number}.csv"), &part.text())
    };
    offset_nm.iter().enumerate().map(part).collect()
}

fn replay(folder: &Folder, files: &[PathBuf]) -> (String, Value) {
    let json = folder.path("run.json");
    let mut paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    paths.extend([Path::new("--json"), &json]);
    let run = scarab("replay --leg mujoco-leg", &paths);
    (run.printed, folder.json("run.json"))
}

#[test]
fn a_parameter_that_differs_between_recordings_has_that_scatter_as_sigma() {
    let folder = Folder::new();
    let offsets = [0.0, 1.0, -1.0];
    let files = periods(&folder, offsets);
    let (printed, report) = replay(&folder, &files);
    assert!(printed.contains("sigma contains the scatter between 3 recordings"), "{printed}");
    assert_eq!(report["recordings"]["count"], 3);
    let names = report["base_parameters"].as_array().expect("a list");
    let index = names.iter().position(|entry| entry["name"] == "OFF2").expect("the knee's offset");
    assert_eq!(names[index]["sigma_from"], "recordings");
    let (sigma, scatter) = (base(&report, "OFF2", "sigma"), &report["recordings"]["sigma"][index]);
    // Three equal recordings: standard deviation 1 N m over sqrt 3. Offsets also move the other parameters.
    assert!((0.4..1.2).contains(&sigma) && sigma >= scatter.as_f64().expect("known"), "{sigma}, {scatter}");
    // Equal recordings keep the sigma of noise or segments.
    let (_, alike) = replay(&folder, &periods(&folder, [0.0; 3]));
    assert!(base(&alike, "OFF2", "sigma") < 0.3 * sigma, "{alike}");
}

#[test]
fn one_recording_reports_that_sigma_lacks_scatter_between_recordings() {
    let folder = Folder::new();
    let files = periods(&folder, [0.0; 3]);
    let (printed, report) = replay(&folder, &files[..1]);
    assert!(printed.contains("sigma does not contain the scatter between recordings: only one"), "{printed}");
    assert_eq!(report["recordings"], serde_json::json!({ "count": 1, "sigma": [] }));
}

#[test]
fn a_warning_about_both_parts_of_a_file_is_printed_once() {
    let folder = Folder::new();
    let mut table = Table::read(MUJOCO);
    let step = table.rows.len() / 750;
    table.rows = table.rows.into_iter().step_by(step).collect();
    let file = folder.write("sparse.csv", &table.text());
    let errors = scarab("replay --leg mujoco-leg --split 0.67", &[&file]).errors;
    assert_eq!(errors.matches("is too large for a recording").count(), 1, "{errors}");
}
