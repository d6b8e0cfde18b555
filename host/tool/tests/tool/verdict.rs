//! Messages of a simulated run beside its parameters.

use crate::command::{Folder, list};

#[test]
fn parameters_of_a_blocked_joint_have_neither_value_nor_sigma() {
    let folder = Folder::new();
    let (_, run) = folder.reported("identify --perturb stuck=knee", 3);
    let all = list(&run, "base_parameters");
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
    let (_, json) = folder.reported("identify --perturb length=1.1 --perturb zero=-5", 3);
    assert_eq!(json["reasons"], serde_json::json!(["residual"]));
}

/// Hip and knee with Coulomb friction alone.
const WITHOUT_VISCOUS: &str = r#"name = "exo"
gravity = [9.81, 0.0, 0.0]
[[joint]]
name = "hip"
dh = { alpha = 0.0, a = 0.0, d = 0.0 }
range_deg = [-20.0, 120.0]
speed_limit_deg_s = 229.0
torque_limit_nm = 80.0
truth = { mass = 8.5, com = [0.2, 0.0, -0.01], inertia_com = [0.02, 0.0, 0.0, 0.16, 0.0, 0.165], rotor_inertia = 0.12, coulomb = 1.0 }
[[joint]]
name = "knee"
dh = { alpha = 0.0, a = 0.42, d = 0.0 }
direction = -1
range_deg = [0.0, 120.0]
speed_limit_deg_s = 286.0
torque_limit_nm = 60.0
truth = { mass = 4.8, com = [0.18, 0.0, 0.0], inertia_com = [0.01, 0.0, 0.0, 0.095, 0.0, 0.098], rotor_inertia = 0.08, coulomb = 1.0 }
"#;

#[test]
fn exact_torque_is_accepted_without_a_bound_of_its_error() {
    let folder = Folder::new();
    folder.write("exo.toml", WITHOUT_VISCOUS);
    for (noise, has_bound) in [("--torque-noise 1", true), ("", false)] {
        let (_, json) = folder.reported(&format!("identify --leg @exo.toml {noise}"), 0);
        let base = json["base_parameters"].as_array().expect("a list");
        assert!(base.iter().all(|base| base["cramer_rao"].is_number() == has_bound), "{base:?}");
    }
}
