//! What a simulated run says of itself beside its parameters.
#![cfg(feature = "tool")]

mod command;

use command::{Folder, scarab};

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
