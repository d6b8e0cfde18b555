//! Known masses in recordings, and the mass that two models differ by.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::command::{Folder, Table, base, scarab};

/// Mass on the shank of the default leg, kg, and its position along it, m.
const MASS: &str = "3@knee:0.3";

/// Logs a simulated run; returns the recording and the truth of the leg without any load.
fn logged(folder: &Folder, name: &str, options: &str) -> (PathBuf, Value) {
    let (log, report) = (folder.path(&format!("{name}.csv")), folder.path(&format!("{name}-identify.json")));
    scarab(&format!("identify {options} --json"), &[&report, Path::new("--log"), &log]).ends_with(0);
    (log, folder.json(&format!("{name}-identify.json")))
}

fn replay(folder: &Folder, options: &str, paths: &[&Path]) -> (String, Value) {
    let report = folder.path("replay.json");
    let mut line = paths.to_vec();
    line.extend([Path::new("--json"), &report]);
    let words = format!("replay --leg x2-wearer-75kg {options}");
    let run = scarab(&words, &line).ends_with(0);
    (run.printed, folder.json("replay.json"))
}

/// Largest distance of a base parameter from the truth, in sigma.
fn distance(report: &Value, truth: &Value) -> f64 {
    let names = report["base_parameters"].as_array().expect("a list").iter();
    names
        .filter_map(|entry| entry["name"].as_str())
        .map(|name| {
            let [value, sigma] = ["value", "sigma"].map(|key| base(report, name, key));
            ((value - base(truth, name, "truth")) / sigma).abs()
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_stated_load_is_subtracted_an_unstated_one_is_in_the_parameters() {
    let folder = Folder::new();
    let (file, truth) = logged(&folder, "loaded", &format!("--load {MASS}"));
    assert!(distance(&truth, &truth) < 4.0, "{}", distance(&truth, &truth));
    let (printed, report) = replay(&folder, &format!("--split 0.7 --load {MASS}"), &[&file]);
    assert!(printed.contains("load: 3 kg on link 2 at x 0.3, y 0 m subtracted"), "{printed}");
    assert!(distance(&report, &truth) < 3.0, "{}", distance(&report, &truth));
    assert_eq!((&report["load"]["mass"], &report["scale"]), (&Value::from(3.0), &Value::from("relative")));
    let (_, whole) = replay(&folder, "--split 0.7", &[&file]);
    // First moment of the load: 0.9 kg m.
    assert!((base(&whole, "HX2", "value") - base(&report, "HX2", "value") - 0.9).abs() < 0.01);
    // The load changes values only: sigma comes from the same rows.
    for name in ["HX1R", "ZZ2", "FC1", "IA2"] {
        let ratio = base(&whole, name, "sigma") / base(&report, name, "sigma");
        assert!((ratio - 1.0).abs() < 0.2, "{name}: {ratio}");
    }
}

/// Recording with the torques multiplied.
fn scaled(folder: &Folder, name: &str, file: &Path, factors: [f64; 2]) -> PathBuf {
    let mut table = Table::read(file.to_str().expect("a path"));
    for (factor, column) in factors.iter().zip(["tau1_Nm", "tau2_Nm"]) {
        let index = table.index(column);
        table.rows.iter_mut().for_each(|row| row[index] *= factor);
    }
    folder.write(name, &table.text())
}

#[test]
fn recordings_with_a_known_mass_determine_the_scale_of_the_torques() {
    let folder = Folder::new();
    let (bare, truth) = logged(&folder, "bare", "");
    let (loaded, _) = logged(&folder, "loaded", &format!("--load {MASS}"));
    // Constants that are assumed 10 % too large and 5 % too small.
    let factors = [1.1, 0.95];
    let (bare, loaded) =
        (scaled(&folder, "bare.csv", &bare, factors), scaled(&folder, "with.csv", &loaded, factors));
    let options = format!("--split 0.7 --payload {MASS}");
    let (printed, report) = replay(&folder, &options, &[&bare, Path::new("--with-payload"), &loaded]);
    assert!(printed.contains("scale: absolute"), "{printed}");
    for (constant, factor) in report["torque_constant"].as_array().expect("two").iter().zip(factors) {
        let [used, found, sigma] =
            ["used", "identified", "sigma"].map(|key| constant[key].as_f64().expect("known"));
        assert!((found - used / factor).abs() < 3.0 * sigma && sigma < 0.01 * used, "{constant}");
    }
    assert!(distance(&report, &truth) < 3.0, "{}", distance(&report, &truth));
    let refusal = scarab("replay --leg x2-wearer-75kg --payload 3@knee:0.3", &[&bare]).ends_with(2);
    assert!(refusal.errors.contains("--with-payload"), "{}", refusal.errors);
    let options = format!("replay --leg x2-wearer-75kg --payload {MASS}");
    let copied = scarab(&options, &[&bare, Path::new("--with-payload"), &bare]).ends_with(2);
    assert!(copied.errors.contains("holds the same samples as"), "{}", copied.errors);
}

/// Whether a number with its sigma lies within three sigma of `expected`.
fn is_within(value: &Value, sigma: &Value, expected: f64) -> bool {
    let known = |number: &Value| number.as_f64().unwrap_or(f64::NAN);
    (known(value) - expected).abs() < 3.0 * known(sigma)
}

#[test]
fn two_models_determine_mass_and_position_of_an_added_load() {
    let folder = Folder::new();
    let (bare, _) = logged(&folder, "bare", "");
    let model = |name: &str, file: &Path| {
        let path = folder.path(name);
        replay(&folder, "--split 0.7", &[file, Path::new("--save-model"), &path]);
        path
    };
    let before = model("before.toml", &bare);
    // Mass and position within three sigma: on the shank both, on the thigh the first moment alone.
    let added = |mass: &str, name: &str| {
        let (file, _) = logged(&folder, name, &format!("--load {mass} --seed 2"));
        let after = model(&format!("{name}.toml"), &file);
        let json = folder.path("compare.json");
        let run = scarab("compare", &[&before, &after, Path::new("--json"), &json]).ends_with(0);
        (run.printed, folder.json("compare.json"), file)
    };
    let (printed, compared, file) = added(MASS, "shank");
    assert_eq!(compared["verdict"], "changed");
    let best = &compared["added_mass"][0];
    assert_eq!(best["joint"], 2, "{printed}");
    assert!(best["chi2"].as_f64() <= best["chi2_limit"].as_f64(), "{best}");
    assert!(is_within(&best["mass_kg"], &best["mass_sigma_kg"], 3.0), "{best}");
    assert!(best["mass_sigma_kg"].as_f64() < Some(0.3), "{best}");
    assert!(is_within(&best["place_m"][0], &best["place_sigma_m"][0], 0.3), "{best}");
    assert!(is_within(&best["place_m"][1], &best["place_sigma_m"][1], 0.0), "{best}");
    assert!(printed.contains("as a mass added to link 2: "), "{printed}");
    assert!(!printed.contains("added to link 1"), "{printed}");

    // A replay compared with the stored model finds the mass too.
    let (again, report) = replay(&folder, "--split 0.7", &[&file, Path::new("--compare-model"), &before]);
    assert_eq!(report["compared"]["added_mass"][0]["joint"], 2, "{again}");

    let (printed, compared, _) = added("4@hip:0.2", "thigh");
    let best = &compared["added_mass"][0];
    assert_eq!(best["joint"], 1, "{printed}");
    assert!(best["mass_kg"].is_null() && best["place_m"][0].is_null(), "{best}");
    assert!(is_within(&best["moment_kgm"][0], &best["moment_sigma_kgm"][0], 0.8), "{best}");
    assert!(printed.contains("as a mass added to link 1: not determined"), "{printed}");
}

#[test]
fn models_of_one_leg_show_no_added_mass() {
    let folder = Folder::new();
    let models: Vec<PathBuf> = (1..=2)
        .map(|seed| {
            let path = folder.path(&format!("{seed}.toml"));
            scarab(&format!("identify --seed {seed} --save-model"), &[&path]).ends_with(0);
            path
        })
        .collect();
    let json = folder.path("compare.json");
    scarab("compare", &[&models[0], &models[1], Path::new("--json"), &json]).ends_with(0);
    let compared = folder.json("compare.json");
    assert_eq!(compared["verdict"], "same");
    let shank = compared["added_mass"].as_array().expect("a list").iter().find(|mass| mass["joint"] == 2);
    let shank = shank.expect("the shank");
    assert!(is_within(&shank["mass_kg"], &shank["mass_sigma_kg"], 0.0), "{shank}");
    assert!(shank["place_m"][0].is_null(), "{shank}");
}
