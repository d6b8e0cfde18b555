//! Known masses in recordings, and the mass that two models differ by.

use serde_json::Value;

use crate::command::{Folder, Run, base, list};

/// Mass on the shank of the default leg, kg, and its position along it, m.
const MASS: &str = "3@knee:0.3";

/// Logs a simulated run as a recording; returns the truth of the leg without any load.
fn logged(folder: &Folder, name: &str, options: &str) -> Value {
    folder.reported(&format!("identify {options} --log @{name}.csv"), 0).1
}

fn replay(folder: &Folder, options: &str) -> (Run, Value) {
    folder.reported(&format!("replay --leg x2-wearer-75kg {options}"), 0)
}

/// Largest distance of a base parameter from the truth, in sigma.
fn distance(report: &Value, truth: &Value) -> f64 {
    let names = list(report, "base_parameters").iter();
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
    let truth = logged(&folder, "loaded", &format!("--load {MASS}"));
    assert!(distance(&truth, &truth) < 4.0, "{}", distance(&truth, &truth));
    let (run, report) = replay(&folder, &format!("@loaded.csv --split 0.7 --load {MASS}"));
    run.prints("load: 3 kg on link 2 at x 0.3, y 0 m subtracted");
    assert!(distance(&report, &truth) < 3.0, "{}", distance(&report, &truth));
    assert_eq!((&report["load"]["mass"], &report["scale"]), (&Value::from(3.0), &Value::from("relative")));
    let (_, whole) = replay(&folder, "@loaded.csv --split 0.7");
    // First moment of the load: 0.9 kg m.
    assert!((base(&whole, "HX2", "value") - base(&report, "HX2", "value") - 0.9).abs() < 0.01);
    // The load changes values only: sigma comes from the same rows.
    for name in ["HX1R", "ZZ2", "FC1", "IA2"] {
        let ratio = base(&whole, name, "sigma") / base(&report, name, "sigma");
        assert!((ratio - 1.0).abs() < 0.2, "{name}: {ratio}");
    }
}

/// Multiplies the torques of a recording.
fn scale(folder: &Folder, name: &str, factors: [f64; 2]) {
    let mut table = folder.table(name);
    for (factor, column) in factors.iter().zip(["tau1_Nm", "tau2_Nm"]) {
        let index = table.index(column);
        table.rows.iter_mut().for_each(|row| row[index] *= factor);
    }
    folder.write(name, table.text());
}

#[test]
fn recordings_with_a_known_mass_determine_the_scale_of_the_torques() {
    let folder = Folder::new();
    let truth = logged(&folder, "bare", "");
    logged(&folder, "loaded", &format!("--load {MASS}"));
    // Constants that are assumed 10 % too large and 5 % too small.
    let factors = [1.1, 0.95];
    ["bare.csv", "loaded.csv"].into_iter().for_each(|name| scale(&folder, name, factors));
    let options = format!("@bare.csv --split 0.7 --payload {MASS} --with-payload @loaded.csv");
    let (run, report) = replay(&folder, &options);
    run.prints("scale: absolute");
    for (constant, factor) in report["torque_constant"].as_array().expect("two").iter().zip(factors) {
        let [used, found, sigma] =
            ["used", "identified", "sigma"].map(|key| constant[key].as_f64().expect("known"));
        assert!((found - used / factor).abs() < 3.0 * sigma && sigma < 0.01 * used, "{constant}");
    }
    assert!(distance(&report, &truth) < 3.0, "{}", distance(&report, &truth));
    let options = format!("replay --leg x2-wearer-75kg --payload {MASS} @bare.csv");
    folder.scarab(&options).ends_with(2).warns("--with-payload");
    folder
        .scarab(&format!("{options} --with-payload @bare.csv"))
        .ends_with(2)
        .warns("holds the same samples as");
}

/// Whether a number with its sigma lies within three sigma of `expected`.
fn is_within(value: &Value, sigma: &Value, expected: f64) -> bool {
    let known = |number: &Value| number.as_f64().unwrap_or(f64::NAN);
    (known(value) - expected).abs() < 3.0 * known(sigma)
}

#[test]
fn two_models_determine_mass_and_position_of_an_added_load() {
    let folder = Folder::new();
    let model = |name: &str, options: &str| {
        logged(&folder, name, options);
        replay(&folder, &format!("@{name}.csv --split 0.7 --save-model @{name}.toml"));
    };
    model("bare", "");
    // Mass and position within three sigma: on the shank both, on the thigh the first moment alone.
    let added = |mass: &str, name: &str| {
        model(name, &format!("--load {mass} --seed 2"));
        folder.reported(&format!("compare @bare.toml @{name}.toml"), 0)
    };
    let (run, compared) = added(MASS, "shank");
    assert_eq!(compared["verdict"], "changed");
    let best = &compared["added_mass"][0];
    assert_eq!(best["joint"], 2, "{}", run.printed);
    assert!(best["chi2"].as_f64() <= best["chi2_limit"].as_f64(), "{best}");
    assert!(is_within(&best["mass_kg"], &best["mass_sigma_kg"], 3.0), "{best}");
    assert!(best["mass_sigma_kg"].as_f64() < Some(0.3), "{best}");
    assert!(is_within(&best["place_m"][0], &best["place_sigma_m"][0], 0.3), "{best}");
    assert!(is_within(&best["place_m"][1], &best["place_sigma_m"][1], 0.0), "{best}");
    run.prints("as a mass added to link 2: ");
    assert!(!run.printed.contains("added to link 1"), "{}", run.printed);

    // A replay compared with the stored model finds the mass too.
    let (again, report) = replay(&folder, "@shank.csv --split 0.7 --compare-model @bare.toml");
    assert_eq!(report["compared"]["added_mass"][0]["joint"], 2, "{}", again.printed);

    let (run, compared) = added("4@hip:0.2", "thigh");
    let best = &compared["added_mass"][0];
    assert_eq!(best["joint"], 1, "{}", run.printed);
    assert!(best["mass_kg"].is_null() && best["place_m"][0].is_null(), "{best}");
    assert!(is_within(&best["moment_kgm"][0], &best["moment_sigma_kgm"][0], 0.8), "{best}");
    run.prints("as a mass added to link 1: not determined");
}

#[test]
fn models_of_one_leg_show_no_added_mass() {
    let folder = Folder::new();
    for seed in 1..=2 {
        folder.scarab(&format!("identify --seed {seed} --save-model @{seed}.toml")).ends_with(0);
    }
    let (_, compared) = folder.reported("compare @1.toml @2.toml", 0);
    assert_eq!(compared["verdict"], "same");
    let shank = list(&compared, "added_mass").iter().find(|mass| mass["joint"] == 2).expect("the shank");
    assert!(is_within(&shank["mass_kg"], &shank["mass_sigma_kg"], 0.0), "{shank}");
    assert!(shank["place_m"][0].is_null(), "{shank}");
}
