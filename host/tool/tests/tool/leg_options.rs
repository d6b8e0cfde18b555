//! Leg with a wearer, on either side, below a leaning trunk: invariants and rejections.

use crate::command::{Folder, base, list, number, scarab};
use serde_json::Value;

/// Report of a run with these options.
fn identified(options: &str) -> Value {
    let folder = Folder::new();
    folder.reported(&format!("identify {options}"), 0).1
}

fn bases(run: &Value) -> &[Value] {
    list(run, "base_parameters")
}

/// Checks that all base parameters are within four sigma of the simulated leg's.
fn assert_true(run: &Value) {
    for base in bases(run) {
        let off = (number(base, "value") - number(base, "truth")).abs();
        assert!(off < 4.0 * number(base, "sigma"), "{} of {}", base["name"], run["leg"]);
    }
}

#[test]
fn left_and_right_leg_have_the_same_anatomical_parameters() {
    let folder = Folder::new();
    let run = |side: &str| {
        // Without noise: equal draws would have opposite signs relative to the motion on one side.
        let line = format!("identify --torque-noise 0 --side {side} --log @log.csv");
        (folder.reported(&line, 0).1, folder.read("log.csv"))
    };
    let ((right, right_log), (left, left_log)) = (run("right"), run("left"));
    assert_eq!(left["leg"], "x2-wearer-75kg --side left");
    // Counts and currents are exact negatives of each other, so the anatomical results agree to the
    // last bit.
    assert_eq!(bases(&right), bases(&left));
    assert!(right_log.lines().count() > 1000 && right_log == left_log);
}

#[test]
fn a_known_trunk_pitch_turns_gravity_and_keeps_the_base_set() {
    let upright = identified("");
    for pitch in ["5", "-10"] {
        let leaning = identified(&format!("--trunk-pitch {pitch}"));
        for (one, other) in bases(&upright).iter().zip(bases(&leaning)) {
            assert_eq!(one["name"], other["name"]);
            // Rounding of the analysis differs; factors and values are near 1.
            assert!((number(one, "truth") - number(other, "truth")).abs() < 1e-9);
            for (name, factor) in one["terms"].as_object().expect("terms") {
                assert!((number(&other["terms"], name) - factor.as_f64().expect("known")).abs() < 1e-9);
            }
        }
        assert_true(&leaning);
        // Equal parameters under another gravity need another torque.
        let size = |run: &Value| {
            100.0 * number(&run["training"][0], "rms_nm") / number(&run["training"][0], "percent_of_rms")
        };
        assert!((size(&leaning) / size(&upright) - 1.0).abs() > 0.01);
    }
}

#[test]
fn legs_of_any_size_are_identified_and_named_by_size() {
    for options in
        ["--thigh 0.505 --shank 0.506", "--wearer 95,1.95", "--wearer 55,1.65 --side left --trunk-pitch 5"]
    {
        let run = identified(options);
        assert_eq!(run["leg"], format!("x2-wearer-75kg {options}"));
        assert_true(&run);
    }
    // The heavier and taller leg is heavier and longer.
    let of = |run: &Value, name: &str| base(run, name, "value");
    let (default, tall) = (identified(""), identified("--wearer 95,1.95"));
    assert!(of(&tall, "HX2") > 1.3 * of(&default, "HX2") && of(&tall, "ZZ2") > 1.5 * of(&default, "ZZ2"));
}

#[test]
fn impossible_leg_options_are_refused_with_option_and_reason() {
    for (options, reason) in [
        ("--thigh 0.3", "--thigh 0.3 is outside 0.402..0.505 m"),
        ("--shank -1", "--shank -1 is outside 0.397..0.506 m"),
        ("--wearer 60,1.55", "--wearer 60,1.55: a thigh of 0.380 m is outside 0.402..0.505 m"),
        ("--wearer 60", "is not KG,M"),
        ("--wearer 60,170", "a height of 170 m"),
        (
            "--leg sp --thigh 0.45",
            "sp: --thigh, --shank and --wearer need the key `segments` in the leg file",
        ),
        ("--leg paper-chain --side left", "only legs with parallel axes can be mirrored"),
        ("--trunk-pitch 91", "--trunk-pitch 91: degrees forward, from -90 to 90"),
        ("--trunk-pitch nan", "--trunk-pitch NaN: degrees forward"),
        ("--side middle", "invalid value 'middle'"),
    ] {
        scarab(&format!("identify {options}")).refuses(reason);
    }
}
