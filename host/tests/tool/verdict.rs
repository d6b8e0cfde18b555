//! Messages of a simulated run beside its parameters.

use crate::command::{Folder, scarab};

#[test]
fn what_a_blocked_joint_does_not_show_has_neither_value_nor_sigma_nor_bound() {
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
fn a_length_and_a_zero_that_hide_each_other_are_seen_beside_each_other() {
    // Their apparent misalignments cancel. In some seeds noise leaves too little of both (16 of 20 are
    // rejected).
    let folder = Folder::new();
    scarab("identify --perturb length=1.1 --perturb zero=-5 --json", &[&folder.path("run.json")])
        .ends_with(3);
    let json = folder.json("run.json");
    assert_eq!(json["reasons"], serde_json::json!(["residual"]));
}
