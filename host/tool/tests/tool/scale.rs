//! Known masses on the command line: results, messages, rejections.

use crate::command::{Folder, list, reasons, scarab};

#[test]
fn without_a_known_mass_the_report_states_relative_scale() {
    let folder = Folder::new();
    let (run, json) = folder.reported("identify", 0);
    run.prints("scale: relative to the torque constants used");
    assert_eq!(json["scale"], "relative");
    assert!(json["payload"].is_null() && json["load"].is_null());
    for (joint, constant) in list(&json, "torque_constant").iter().enumerate() {
        assert_eq!(constant["joint"], joint + 1);
        assert_eq!(constant["used"], 1.5);
        assert!(constant["identified"].is_null() && constant["sigma"].is_null());
    }
}

#[test]
fn a_known_mass_makes_the_report_absolute_and_widens_sigma() {
    let folder = Folder::new();
    let (_, relative) = folder.reported("identify", 0);
    let (run, absolute) = folder.reported("identify --payload 5@knee:0.2", 0);
    run.prints("scale: absolute");
    assert_eq!(absolute["scale"], "absolute");
    assert_eq!(absolute["payload"]["mass"], 5.0);
    assert_eq!(absolute["payload"]["joint"], 2);
    for constant in list(&absolute, "torque_constant") {
        let (found, sigma) = (constant["identified"].as_f64(), constant["sigma"].as_f64());
        // Sigma is at most 0.3 %; the tolerance is four times that.
        assert!((found.expect("found") - 1.5).abs() < 0.018 && sigma.expect("known") < 0.0045);
        assert_eq!(constant["consistent"], true);
    }
    let sigma = |json: &serde_json::Value, base: usize| json["base_parameters"][base]["sigma"].as_f64();
    for base in 0..13 {
        let (narrow, wide) = (sigma(&relative, base).expect("known"), sigma(&absolute, base).expect("known"));
        // The records differ by less than a percent.
        assert!(wide > 0.98 * narrow, "{base}");
    }
    // HX2 is known to 0.17 %, the constants to 0.16 and 0.22 %: the effect must be visible.
    assert!(sigma(&absolute, 4) > sigma(&relative, 4).map(|sigma| 1.2 * sigma));
}

#[test]
fn implausible_masses_are_refused_with_option_and_reason() {
    for (arguments, reason) in [
        ("identify --payload 5@ankle:0.2", "--payload: `ankle` is not a joint of `x2-wearer-75kg`"),
        ("identify --load 5@hip:0.5", "--load: x 0.5 m, y 0 m lies outside the link of `hip`"),
    ] {
        scarab(arguments).refuses(reason);
    }
}

#[test]
fn geometry_is_also_tested_with_corrected_torques() {
    // Without a known mass each of them is refused; a constant that compensates a wrong length must not hide
    // it.
    for options in [
        "--perturb length=1.1 --payload 5@knee:0.2",
        "--perturb length=1.05 --payload 5@knee:0.2",
        "--perturb zero=5 --payload 5@knee:0.2",
        "--perturb length=1.1 --load 3@knee:0.2",
        "--perturb zero=5 --load 3@knee:0.2",
    ] {
        let folder = Folder::new();
        let (_, json) = folder.reported(&format!("identify {options}"), 3);
        assert!(reasons(&json).contains(&"residual"), "{options}: {:?}", reasons(&json));
        assert_eq!(json["scale"], "relative", "{options}");
        let findings = list(&json, "findings");
        assert!(findings.iter().any(|finding| finding["test"] == "encoder_zero"), "{options}");
    }
}

#[test]
fn a_mass_too_light_for_the_constants_is_reported() {
    let run = scarab("identify --payload 0.001@knee:0.2").ends_with(0);
    assert!(
        run.printed.contains("too light to determine") && !run.printed.contains("contradicted"),
        "{}",
        run.printed
    );
}

#[test]
fn deliberate_errors_and_a_known_mass_exclude_each_other() {
    for mass in ["--payload 5@knee:0.2", "--load 3@knee:0.2"] {
        for tampering in ["inertia=0.7", "com=0.8"] {
            scarab(&format!("identify --perturb {tampering} {mass}")).refuses("give one of the two");
        }
    }
}
