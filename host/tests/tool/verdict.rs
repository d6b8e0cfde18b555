//! Messages of a simulated run beside its parameters.

use crate::command::{Folder, scarab};

#[test]
fn parameters_of_a_blocked_joint_have_neither_value_nor_sigma() {
    let folder = Folder::new();
    let json = folder.path("run.json");
    scarab("identify --perturb stuck=knee --json", &[&json]).ends_with(3);
    let run = folder.json("run.json");
    let all = run["base_parameters"].as_array().expect("a list");
    let unknown: Vec<_> = all.iter().filter(|base| base["sigma"].is_null()).collect();
    assert!(!unknown.is_empty() && unknown.len() < all.len(), "{all:?}");
    for base in unknown {
        assert!(base["value"].is_null() && base["cramer_rao"].is_null(), "{base}");
    }
    for base in all.iter().filter(|base| base["sigma"].is_number()) {
        assert!(base["cramer_rao"].as_f64().is_some_and(|bound| bound > 0.0), "{base}");
    }
}

#[test]
fn compensating_errors_of_length_and_zero_are_detected_together() {
    // Their apparent misalignments cancel. In some seeds noise leaves too little of both (16 of 20 are
    // rejected).
    let folder = Folder::new();
    scarab("identify --perturb length=1.1 --perturb zero=-5 --json", &[&folder.path("run.json")])
        .ends_with(3);
    let json = folder.json("run.json");
    assert_eq!(json["reasons"], serde_json::json!(["residual"]));
}
