//! `scarab replay` as an interface: valid recordings, contents of the report and the torque table.

use crate::command::{Folder, MUJOCO, base, fit, reasons};
use crate::pendulum::{Motion, TRUTH, finds_the_truth, leg};
use scarab::ident::record::recorder::SMOOTHING_BANDWIDTHS;
use scarab::ident::{Kernel, LowPass};
use scarab::real::sqrt;
use serde_json::Value;

/// Replays the named recordings of the folder with its `leg.toml`; writes `report.json` and `torque.csv`.
fn replay(folder: &Folder, files: &[&str], arguments: &str) -> (Value, crate::command::Run) {
    let (run, report) = folder
        .reported(&format!("replay {} --leg @leg.toml --csv @torque.csv {arguments}", files.join(" ")), 0);
    (report, run)
}

fn folder_with(more: &str, recordings: &[(&str, Motion)]) -> Folder {
    let folder = Folder::new();
    folder.write("leg.toml", leg(more));
    for (name, motion) in recordings {
        folder.write(name, motion.csv());
    }
    folder
}

#[test]
fn jittered_stamps_and_other_rates_give_the_same_parameters() {
    for (rate_hz, jitter_s) in
        [(500.0, 0.0), (500.0, 0.8e-3), (1000.0, 0.4e-3), (137.0, 1e-3), (3333.0, 1e-4)]
    {
        let folder = folder_with("", &[("a.csv", Motion { rate_hz, jitter_s, ..Motion::default() })]);
        let (report, run) = replay(&folder, &["@a.csv"], "");
        assert_eq!(run.errors, "");
        println!("{rate_hz} Hz, {jitter_s} s of jitter: {:.2} sigma", finds_the_truth(&report));
    }
}

#[test]
fn direction_inverts_angle_and_torque_the_zero_offset_shifts_the_angle() {
    let plain = folder_with("", &[("a.csv", Motion::default())]);
    let (expected, _) = replay(&plain, &["@a.csv"], "--split 0.5");
    let turned = Motion { direction: -1.0, zero_offset: 30_f64.to_radians(), ..Motion::default() };
    let folder = folder_with("direction = -1\nzero_offset_deg = 30.0\n", &[("a.csv", turned)]);
    let (report, _) = replay(&folder, &["@a.csv"], "--split 0.5");
    for (name, _) in TRUTH {
        let difference = base(&report, name, "value") - base(&expected, name, "value");
        // Nine digits in the file and single precision: far below the noise.
        assert!(difference.abs() < 0.05 * base(&expected, name, "sigma"), "{name}: {difference}");
    }
    // The output is anatomical again.
    let (torques, expected) = (folder.table("torque.csv"), plain.table("torque.csv"));
    for column in ["tau1_measured_Nm", "tau1_predicted_Nm"] {
        for (ours, theirs) in torques.column(column).iter().zip(expected.column(column)) {
            assert!((ours + theirs).abs() < 1e-3, "{column}: {ours} {theirs}");
        }
    }
}

#[test]
fn several_files_form_one_training_set_without_windows_across_files() {
    // The pendulum jumps by two radians between the files.
    let (one, other) = (Motion::default(), Motion { centre: -1.6, seed: 2, ..Motion::default() });
    let folder = folder_with("", &[("a.csv", one), ("b.csv", other)]);
    let (alone, _) = replay(&folder, &["@a.csv"], "");
    let (both, run) = replay(&folder, &["@a.csv", "@b.csv"], "");
    let (reversed, _) = replay(&folder, &["@b.csv", "@a.csv"], "");
    finds_the_truth(&both);
    assert!((both["simulated_s"].as_f64().expect("a number") - 20.0).abs() < 1e-6);
    // Twice the data: 0.71. The scatter of two recordings is |z| of it: 3 % exceed 2.1, which is a ratio of
    // 1.5.
    let ratios = TRUTH.map(|(name, _)| base(&both, name, "sigma") / base(&alone, name, "sigma"));
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!(mean < 0.9 && ratios.iter().all(|ratio| *ratio < 1.5), "{ratios:?}");
    for (name, _) in TRUTH {
        let sigma = base(&both, name, "sigma");
        let difference = (base(&both, name, "value") - base(&reversed, name, "value")).abs();
        assert!(difference < 0.05 * sigma, "{name}: {difference} of {sigma}");
    }
    // Samples minus the smoothing window, every tenth; rows are cut at the ends of a file.
    let smoothing = Kernel::<f64, 512>::new(8.0 * SMOOTHING_BANDWIDTHS, 500.0).expect("fits");
    let rows = (5000 - smoothing.taps() + 1).div_ceil(10);
    for name in ["a.csv", "b.csv"] {
        let line = run.printed.lines().find(|line| line.contains(name)).expect("a line for the file");
        let cells: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(cells[1..5], ["training", "0.00", "10.00", "500"], "{line}");
        // Used rows, and rows of a joint that turned slowly.
        let counts: Vec<usize> = cells[5..].iter().filter_map(|cell| cell.parse().ok()).collect();
        assert_eq!(counts.iter().sum::<usize>(), rows, "{line}");
        assert!(counts[1] < rows / 20, "{line}");
    }
}

#[test]
fn a_split_trains_on_the_first_part_of_each_file_and_holds_out_the_rest() {
    let samples = Motion::default().samples();
    let folder = folder_with("", &[("whole.csv", Motion::default())]);
    folder.write("first.csv", crate::pendulum::csv(&samples[..3000]));
    folder.write("rest.csv", crate::pendulum::csv(&samples[3000..]));
    let (split, run) = replay(&folder, &["@whole.csv"], "--split 0.6");
    let torques = folder.read("torque.csv");
    let (apart, _) = replay(&folder, &["@first.csv"], "--validate @rest.csv");
    for part in ["training", "validation", "bso"] {
        assert_eq!(split[part], apart[part], "{part}");
    }
    // The rows at the split belong to one segment or to two, which changes the scatter over segments.
    let parameters = |report: &Value| report["base_parameters"].as_array().expect("a list").clone();
    for (one, other) in parameters(&split).iter().zip(&parameters(&apart)) {
        assert_eq!((&one["name"], &one["value"]), (&other["name"], &other["value"]));
        let [one, other] = [one, other].map(|parameter| parameter["sigma"].as_f64().expect("a number"));
        assert!((0.6..1.6).contains(&(one / other)), "{one} {other}");
    }
    assert_eq!(folder.read("torque.csv"), torques);
    run.prints("validation");
    run.prints("6.00");
}

#[test]
fn filtering_both_columns_of_the_table_gives_the_printed_error() {
    let motions =
        [(0.4, 1), (-0.3, 2), (0.8, 3)].map(|(centre, seed)| Motion { centre, seed, ..Motion::default() });
    let folder = folder_with("", &[("a.csv", motions[0]), ("b.csv", motions[1]), ("c.csv", motions[2])]);
    let (report, _) = replay(&folder, &["@a.csv"], "--bandwidth 6 --validate @b.csv @c.csv");
    let table = folder.table("torque.csv");
    assert_eq!(table.header, ["t_s", "tau1_measured_Nm", "tau1_predicted_Nm", "file"]);

    let low_pass = LowPass::<f64, 512>::new(6.0, 500.0).expect("fits");
    let smoothing = Kernel::<f64, 512>::new(6.0 * SMOOTHING_BANDWIDTHS, 500.0).expect("fits");
    let filtered = |window: &[Vec<f64>], column: usize| -> f64 {
        window.iter().zip(low_pass.weights()).map(|(row, weight)| row[column] * weight).sum()
    };
    let (mut errors, mut size, mut rows) = (0.0, 0.0, 0.0);
    for (file, motion) in [(1.0, motions[1]), (2.0, motions[2])] {
        let samples = motion.samples();
        let part: Vec<_> = table.rows.iter().filter(|row| row[3] == file).cloned().collect();
        assert_eq!(
            part.len(),
            samples.len() - smoothing.taps() + 1,
            "a prediction wherever the window is full"
        );
        for (row, sample) in part.iter().zip(&samples[smoothing.reach()..]) {
            assert!((row[0] - sample[0]).abs() < 2e-6, "time {} {}", row[0], sample[0]);
            assert!((row[1] - sample[2]).abs() < 1e-5, "measured {} {}", row[1], sample[2]);
        }
        for window in part.windows(low_pass.taps()).step_by(10) {
            let (measured, predicted) = (filtered(window, 1), filtered(window, 2));
            errors += (measured - predicted) * (measured - predicted);
            size += measured.abs();
            rows += 1.0;
        }
    }
    let (error, size) = (sqrt(errors / rows), size / rows);
    let printed = |field| fit(&report, "validation", 1, field);
    println!("{error} {}", printed("rms_nm"));
    // Single precision over 13 N m against an error of 0.02 N m.
    assert!((error / printed("rms_nm") - 1.0).abs() < 2e-3, "{error} {}", printed("rms_nm"));
    assert!((100.0 * error / size / printed("percent_of_mean_abs") - 1.0).abs() < 2e-3);
}

#[test]
fn a_file_with_more_joints_than_the_leg_gives_a_warning() {
    let folder = folder_with("", &[]);
    let rows: Vec<String> =
        Motion::default().samples().iter().map(|[t, q, tau]| format!("{t:.4},{q},{tau},0.1,0.2")).collect();
    let text = "t_s,q1_rad,tau1_Nm,q2_rad,tau2_Nm\n".to_owned() + &rows.join("\n");
    folder.write("a.csv", &text);
    let (_, run) = replay(&folder, &["@a.csv"], "");
    assert!(
        run.errors.starts_with("warning: ")
            && run.errors.contains("a.csv: holds 2 joints, the leg `pendulum` has 1"),
        "{}",
        run.errors
    );
}

#[test]
fn a_last_line_without_line_end_gives_a_warning() {
    let folder = folder_with("", &[]);
    let whole = Motion::default().csv();
    // Cut within the last number.
    folder.write("a.csv", &whole[..whole.len() - 3]);
    let (_, run) = replay(&folder, &["@a.csv"], "");
    let words = "a.csv: the last line has no line end: if the file was cut, its last value is wrong";
    run.warns(words);
}

#[test]
fn angles_outside_the_range_of_the_leg_give_a_warning() {
    let folder = folder_with("", &[("a.csv", Motion { centre: 9.0, ..Motion::default() })]);
    let (_, run) = replay(&folder, &["@a.csv"], "");
    run.warns("q1_rad goes from");
    run.warns("the range of `only` is -200 to 200 deg");
}

#[test]
fn a_result_without_validation_is_reported_as_such() {
    let folder = folder_with("", &[("a.csv", Motion::default())]);
    let note = "not validated: no motion was held out";
    let (report, run) = replay(&folder, &["@a.csv"], "");
    assert!(run.printed.contains(note) && run.printed.contains("verdict: accepted, not validated"));
    assert_eq!((&report["validation"], &report["validated"]), (&Value::Array(Vec::new()), &false.into()));
    let (report, run) = replay(&folder, &["@a.csv"], "--split 0.5");
    assert!(!run.printed.contains("not validated"), "{}", run.printed);
    assert_eq!(report["validated"], true);
}

/// Fails unless the object has these keys, each a number or, if allowed, null.
fn has_numbers(object: &Value, numbers: &[&str], may_be_null: bool) {
    for key in numbers {
        let value = object.get(key).unwrap_or_else(|| panic!("no {key} in {object}"));
        assert!(value.is_number() || may_be_null && value.is_null(), "{key} is {value}");
    }
}

/// Checks every field of the interface.
fn is_complete(report: &Value, joints: usize) {
    has_numbers(report, &["schema", "swarm_seed", "rank", "columns", "simulated_s", "wall_s"], false);
    has_numbers(report, &["condition", "seed"], true);
    for key in ["leg", "prior", "plan", "verdict"] {
        assert!(report[key].is_string(), "{key} is {}", report[key]);
    }
    let list = |key: &str| report[key].as_array().unwrap_or_else(|| panic!("{key} is {}", report[key]));
    assert!(list("tracking").is_empty(), "nothing is tracked in a replay");
    let parameters = list("parameters");
    assert_eq!(parameters.len(), 14 * joints);
    let symbols = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "HX", "HY", "HZ", "M", "IA", "FC", "FV", "OFF"];
    for (index, parameter) in parameters.iter().enumerate() {
        let joint = index / 14 + 1;
        assert_eq!(parameter["name"], format!("{}{joint}", symbols[index % 14]));
        assert_eq!(parameter["joint"], joint);
        has_numbers(parameter, &["value", "sigma", "truth"], true);
        assert!(parameter["unit"].is_string() && parameter["grouped_with"].is_array());
        let status = parameter["status"].as_str().expect("a word");
        assert!(["identified", "grouped", "weak", "prior"].contains(&status), "{status}");
    }
    for base in list("base_parameters") {
        assert!(base["name"].is_string() && base["unit"].is_string());
        has_numbers(base, &["value", "sigma", "truth"], true);
        let terms = base["terms"].as_object().expect("an object");
        assert!(!terms.is_empty() && terms.values().all(Value::is_number), "{base}");
    }
    for part in ["training", "validation"] {
        assert_eq!(list(part).len(), joints, "{part}");
        for (index, entry) in list(part).iter().enumerate() {
            assert_eq!((&entry["joint"], &entry["motion"]), (&Value::from(index + 1), &"recording".into()));
            let fields = ["rms_nm", "percent_of_mean_abs", "percent_of_rms"];
            has_numbers(entry, &fields, report["verdict"] == "refused");
            assert!(entry["percent_of_mean_abs_vs_truth"].is_null() && entry["sticking_share"].is_null());
        }
    }
    has_numbers(&report["least_squares"], &["cost"], true);
    let values = report["least_squares"]["base_parameters"].as_object().expect("an object");
    assert_eq!(values.len(), list("base_parameters").len());
    has_numbers(&report["bso"], &["seed", "iterations", "evaluations"], false);
    has_numbers(&report["bso"], &["cost_over_least_squares", "excess_chi2"], true);
}

#[test]
fn reports_are_complete_and_free_of_nan_whatever_the_verdict() {
    let folder = Folder::new();
    let (_, report) = folder.reported(&format!("replay {MUJOCO} --leg mujoco-leg --split 0.6"), 0);
    is_complete(&report, 2);
    assert_eq!((&report["verdict"], reasons(&report).len()), (&"accepted".into(), 0));
    assert!(report["parameters"].as_array().expect("a list").iter().all(|entry| entry["value"].is_number()));
    // A parameter that is in no sum is its own base parameter.
    assert_eq!(base(&report, "HX2", "value"), report["parameters"][14 + 6]["value"]);

    // Without motion, prior or truth all values are unknown.
    folder.write("leg.toml", leg(""));
    let still: Vec<[f64; 3]> = (0..2500).map(|k| [f64::from(k) * 0.002, 0.3, 1.5]).collect();
    folder.write("still.csv", crate::pendulum::csv(&still));
    let (run, report) = folder.reported("replay --split 0.5 --csv @torque.csv --leg @leg.toml @still.csv", 3);
    run.prints("verdict: refused, unexcited");
    assert!(!run.printed.contains("NaN"), "{}", run.printed);
    is_complete(&report, 1);
    assert_eq!(report["verdict"], "refused");
    assert!(reasons(&report).contains(&"unexcited"), "{:?}", reasons(&report));
    assert!(report["parameters"].as_array().expect("a list").iter().all(|entry| entry["value"].is_null()));
    // The torque table is also written for a rejected result.
    assert!(!folder.table("torque.csv").rows.is_empty());
}

#[test]
fn the_same_seed_gives_the_same_report_and_another_the_same_optimum() {
    let folder = folder_with("", &[("a.csv", Motion::default())]);
    let report = |arguments: &str| {
        let (mut report, _) = replay(&folder, &["@a.csv"], arguments);
        report["wall_s"] = Value::Null;
        report
    };
    let first = report("--swarm-seed 7");
    assert_eq!(report("--swarm-seed 7"), first);
    let other = report("--swarm-seed 8");
    assert_ne!(other["bso"], first["bso"]);
    for (name, _) in TRUTH {
        let difference = (base(&other, name, "value") - base(&first, name, "value")).abs();
        assert!(difference < 0.2 * base(&first, name, "sigma"), "{name}: {difference}");
    }
}
