//! `cargo sim faults` as its users run it.

use serde_json::Value;

use crate::command::{Folder, scarab};

/// Within the first second: the approach to the exciting motion, so the tests stay short.
fn report(arguments: &str, code: i32) -> Value {
    let folder = Folder::new();
    let line = format!("faults --seconds 1 {arguments} --json");
    scarab(&line, &[&folder.path("faults.json")]).ends_with(code);
    folder.json("faults.json")
}

#[test]
fn the_json_is_that_of_the_interface_and_its_numbers_add_up() {
    let report = report("--seeds 4", 0);
    assert_eq!((report["schema"].as_u64(), report["invariants_broken"].as_u64()), (Some(1), Some(0)));
    assert_eq!(report["failures"], Value::Array(vec![]));
    let rows = report["rows"].as_array().expect("a list");
    assert!(rows.len() >= 12, "{}", rows.len());
    for row in rows {
        let count = |name: &str| row[name].as_u64().unwrap_or_else(|| panic!("{name}: {row}"));
        assert_eq!(count("runs"), 4);
        assert_eq!(count("runs"), count("detected") + count("missed") + count("undetectable_by_design"));
        assert!(count("state_reached") <= count("runs") && count("false_alarms") == 0, "{row}");
        let (worst, deadline) = (&row["worst_ms"], &row["deadline_ms"]);
        // One turn of a rotor is no time.
        assert_eq!(deadline.is_null(), row["fault"] == "E4", "{row}");
        if let (Some(worst), Some(deadline)) = (worst.as_f64(), deadline.as_f64()) {
            assert!(worst <= deadline + 1e-9, "{row}");
        }
        assert!(row["state"].is_string());
    }
}

#[test]
fn the_same_seeds_leave_the_same_trace_and_one_of_them_is_repeated_alone() {
    let rows = "--fault X1 --fault C2 --fault E4";
    let [one, other] = [(); 2].map(|()| report(&format!("{rows} --seeds 3"), 0));
    assert_eq!(one, other);
    let alone = scarab("faults --seconds 1 --fault C2 --replay 2", &[]).ends_with(0);
    let all = scarab("faults --seconds 1 --fault C2 --seeds 2", &[]).ends_with(0);
    assert!(
        alone.printed.contains("C2 seed 2: seen, after 0.083 ms, state Off, code current_sense"),
        "{}",
        alone.printed
    );
    assert!(all.printed.contains("trace hash"), "{}", all.printed);
}

#[test]
fn a_detector_that_is_switched_off_is_noticed() {
    let rows = ["E4", "C2", "C3", "C4", "V1", "V2", "N1", "X1", "X2", "K1"];
    let named: String = rows.iter().map(|row| format!("--fault {row} ")).collect();
    let report = report(&format!("{named}--seeds 4 --blind"), 0);
    for row in report["rows"].as_array().expect("a list") {
        assert!(row["missed"].as_u64() > Some(0), "nobody misses {}", row["fault"]);
    }
}

#[test]
fn bad_input_names_the_option() {
    for (arguments, words) in [
        ("--fault Z9", "--fault Z9: is none of E2"),
        ("--seconds 0", "--seconds: 0"),
        ("--fault C2 --every-tick", "--every-tick: is about the emergency stop"),
        ("--leg mujoco-leg", "has no [joint.motor]"),
    ] {
        let message = scarab(&format!("faults {arguments}"), &[]).refusal();
        assert!(message.contains(words), "{arguments}: {message}");
    }
}
