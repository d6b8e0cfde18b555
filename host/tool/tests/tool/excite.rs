//! `scarab excite`, and `identify --excitation`: limits of a designed motion, its predictions,
//! and rejections.

use scarab_identify::formats::excitation::Excitation;
use scarab_identify::formats::leg_file::LegFile;
use scarab_tool::excitation_constant as constant;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use crate::command::{Folder, assert_contains, list, number, scarab};
use scarab::real::sqrt;
use scarab::servo::SERVO_RATE_HZ;
use serde_json::Value;

/// Constant written together with [`SHIPPED`].
#[path = "../data/excitation/x2_wearer_75kg.rs"]
mod shipped;

const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/excitation/x2_wearer_75kg.toml");
const SHIPPED_SOURCE: &str = include_str!("../data/excitation/x2_wearer_75kg.rs");

/// An eighth of the default effort: within 1 of its ln det, and faster.
const EFFORT: &str = "--evaluations 6000";

/// Design for the default leg with its truth assumed, and its report.
fn designed() -> &'static (Folder, Value) {
    static DESIGN: OnceLock<(Folder, Value)> = OnceLock::new();
    DESIGN.get_or_init(|| {
        let folder = Folder::new();
        let arguments = format!("excite --assume-truth {EFFORT} --out @motion.toml --const @motion.rs");
        let (_, report) = folder.reported(&arguments, 0);
        (folder, report)
    })
}

#[test]
fn a_design_keeps_every_limit_in_proof_and_simulation() {
    let (_, report) = designed();
    for joint in list(report, "joints") {
        let [low, high] = [0, 1].map(|end| joint["range_deg"][end].as_f64().expect("a number"));
        for seen in [&joint["angle_deg"], &joint["simulated"]["angle_deg"]] {
            assert!(seen[0].as_f64().expect("a number") >= low, "{joint}");
            assert!(seen[1].as_f64().expect("a number") <= high, "{joint}");
        }
        let (speed, torque) = (number(joint, "speed_limit_deg_s"), number(joint, "torque_limit_nm"));
        assert!(number(joint, "speed_deg_s") <= speed && number(&joint["simulated"], "speed_deg_s") <= speed);
        assert!(number(joint, "acceleration_deg_s2") <= number(joint, "acceleration_limit_deg_s2"));
        let bound = number(joint, "torque_with_margin_nm");
        assert!(bound <= torque, "{joint}");
        // Near the ends the monitor reduces the torque of a joint that could not stop; here it must not.
        assert_eq!(joint["simulated"]["limited_ticks"], 0, "{joint}");
        // The plant's own torque, with friction and position loop, stays below the bound with the margin.
        assert!(number(&joint["simulated"], "torque_nm") <= bound, "{joint}");
        // The limits are used: a design that hardly moves would also respect them.
        assert!(bound > 0.5 * torque, "{joint}");
    }
}

#[test]
fn a_design_is_far_more_informative_than_300_random_motions() {
    let (_, report) = designed();
    let own = number(report, "log_determinant");
    let random = number(&report["random"], "log_determinant");
    println!("ln det {own:.2} against {random:.2}");
    // Measured 18.3 with the default effort; 13 corresponds to every sigma at 0.6 of the random motion's.
    assert!(own > random + 13.0, "{own} {random}");
}

#[test]
#[ignore = "campaign: .ci/full"]
fn the_expected_sigma_equals_reported_sigma_and_observed_spread() {
    let (folder, report) = designed();
    const SEEDS: u32 = 40;
    let line = format!("identify --seeds 1..{SEEDS} --excitation @motion.toml --json @runs.json");
    folder.scarab(&line).ends_with(0);
    let runs = folder.json("runs.json");
    let runs = list(&runs, "runs");
    let (mut pooled, mut count) = (0.0, 0.0);
    for (index, base) in list(report, "base_parameters").iter().enumerate() {
        let sigma = number(base, "sigma");
        let of = |key: &str| -> Vec<f64> {
            runs.iter().map(|run| number(&run["base_parameters"][index], key)).collect()
        };
        let (values, reported) = (of("value"), of("sigma"));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / f64::from(SEEDS);
        let centre = mean(&values);
        let squares: f64 = values.iter().map(|value| (value - centre) * (value - centre)).sum();
        let ratio = sqrt(squares / f64::from(SEEDS - 1)) / sigma;
        let reported = mean(&reported) / sigma;
        println!("{}: spread {ratio:.3}, reported {reported:.3} of expected", base["name"]);
        // The noise of a run is estimated from 1000 rows within 3 %, the mean of 40 runs within 0.5
        // %; the tolerance is three times that.
        assert!((reported - 1.0).abs() < 0.015, "{}: {reported}", base["name"]);
        // The spread of 40 normal numbers has itself a spread of 1/sqrt(78) = 11 %; the tolerance
        // is four times that.
        assert!((ratio - 1.0).abs() < 0.45, "{}: {ratio}", base["name"]);
        pooled += ratio * ratio;
        count += 1.0;
    }
    // Thirteen values, some strongly correlated, count as six: 5 % (one standard deviation); the
    // tolerance is three times that.
    let pooled: f64 = sqrt(pooled / count);
    println!("pooled {pooled:.3}");
    assert!((pooled - 1.0).abs() < 0.15, "{pooled}");
}

#[test]
fn the_noise_is_that_of_the_sensors_for_any_assumed_leg() {
    let folder = Folder::new();
    let report = |arguments: &str| {
        // The motion was designed for the truth, so no margin is added for the prior.
        let arguments = format!("excite --torque-margin 0 {arguments} --excitation {SHIPPED}");
        folder.reported(&arguments, 0).1
    };
    let noise = |report: &Value| -> Vec<f64> {
        list(report, "joints").iter().map(|joint| number(joint, "torque_noise_nm")).collect()
    };
    let (prior, truth) = (report(""), report("--assume-truth"));
    assert_eq!(noise(&prior), noise(&truth));
    assert_eq!((&prior["torque_noise_of"], &prior["assumed"]), (&"truth".into(), &"prior".into()));
    // Standstill depends slightly on the assumed friction; noise as a share of the assumed torque changed it
    // by 8 %.
    for (prior, truth) in list(&prior, "base_parameters").iter().zip(list(&truth, "base_parameters")) {
        let ratio = number(prior, "sigma") / number(truth, "sigma");
        println!("{}: sigma expected of the prior over that of the truth {ratio:.3}", prior["name"]);
        assert!((ratio - 1.0).abs() < 0.05, "{}: {ratio}", prior["name"]);
    }
    let stated = report("--torque-noise-nm 2,1.5");
    let [hip, knee] = noise(&stated)[..] else { panic!("two joints") };
    // Converted to amperes and back.
    assert!((hip - 2.0).abs() < 1e-12 && (knee - 1.5).abs() < 1e-12, "{hip} {knee}");
    let doubled = report("--torque-noise-nm 4,3");
    for (one, two) in list(&stated, "base_parameters").iter().zip(list(&doubled, "base_parameters")) {
        // The noise-free residual is added to it.
        assert!((number(two, "sigma") / number(one, "sigma") - 2.0).abs() < 0.05, "{one} {two}");
    }
    // The run has the stated noise: its sigma is the expected one.
    let (_, run) = folder.reported(&format!("identify --torque-noise-nm 2,1.5 --excitation {SHIPPED}"), 0);
    for (expected, found) in list(&stated, "base_parameters").iter().zip(list(&run, "base_parameters")) {
        let ratio = number(found, "sigma") / number(expected, "sigma");
        // One run determines a noise within 3 %; the tolerance is three times that, plus the prior
        // friction's effect on stillness.
        assert!((ratio - 1.0).abs() < 0.12, "{}: {ratio}", expected["name"]);
    }
}

#[test]
fn a_motion_is_checked_with_the_carried_mass() {
    let message = scarab(&format!("identify --payload 30@knee:0.35 --excitation {SHIPPED}")).refusal();
    assert_contains(&message, "the motion needs");
    assert_contains(&message, "limit 85.0 N m");
    scarab(&format!("identify --load 30@knee:0.35 --excitation {SHIPPED}")).refuses("the motion needs");
}

#[test]
fn a_written_motion_is_read_back_unchanged() {
    let (folder, report) = designed();
    let motion = Excitation::load(&folder.path("motion.toml")).expect("just written");
    assert_eq!(folder.read("motion.toml"), motion.to_toml());
    assert_eq!(folder.read("motion.rs"), constant::source(&motion));
    let expected = motion.expected.expect("a design states its expectation");
    assert_eq!(expected.assumed, "truth");
    assert_eq!(expected.base_parameter.len(), list(report, "base_parameters").len());
    // Checking the same motion gives an identical report.
    folder.scarab("excite --assume-truth --excitation @motion.toml --json @again.json").ends_with(0);
    assert_eq!(folder.json("again.json")["base_parameters"], report["base_parameters"]);
}

#[test]
fn the_constant_for_an_image_compiles_and_is_the_motion_of_the_file() {
    let motion = Excitation::load(Path::new(SHIPPED)).expect("shipped with the tests");
    assert_eq!(constant::source(&motion), SHIPPED_SOURCE);
    let from_image = shipped::EXCITATION.motion(SERVO_RATE_HZ).expect("a motion");
    assert_eq!(motion.motion::<2>().expect("a motion"), from_image);
}

#[test]
fn every_parameter_has_a_status_before_anything_moves() {
    let (_, report) = designed();
    let status = |name: &str| {
        let entry = list(report, "parameters").iter().find(|entry| entry["name"] == name);
        entry.unwrap_or_else(|| panic!("{name}"))["status"].clone()
    };
    assert_eq!(list(report, "parameters").len(), 28);
    for (name, expected) in [
        ("ZZ2", "identified"),
        ("FC1", "identified"),
        ("IA1", "grouped"),
        ("M2", "grouped"),
        ("YY1", "prior"),
    ] {
        assert_eq!(status(name), expected, "{name}");
    }
    // A hip that cannot hang straight hardly separates an offset from a mass in front of it; the status shows
    // that.
    assert_eq!(status("OFF1"), "weak");
    let warnings = list(report, "warnings");
    assert!(warnings.iter().any(|line| line.as_str().is_some_and(|line| line.starts_with("OFF1: weak"))));
}

#[test]
fn a_leg_without_truth_is_designed_from_its_prior() {
    let folder = Folder::new();
    let arguments = format!("excite --leg sp --torque-noise 5 --duration 12 {EFFORT} --out @motion.toml");
    let (_, report) = folder.reported(&arguments, 0);
    assert_eq!(report["assumed"], "prior");
    assert!(number(&list(&report, "joints")[0], "torque_with_margin_nm") <= 12.0);
    assert!(number(&report, "duration_s") <= 12.01);
    scarab("excite --leg sp --assume-truth").refuses("needs a `truth`");
}

#[test]
fn a_motion_of_another_leg_or_beyond_limits_is_refused() {
    let folder = Folder::new();
    let text = fs::read_to_string(SHIPPED).expect("shipped with the tests");
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    let cases = [
        (with("cycles = 6", "cycles = 0"), "at least one cycle"),
        (with("cycles = 6", "cycles = 4000000000"), "at most 120 s"),
        (with("schema = 1", "schema = 2"), "`schema` is 2"),
        (with("period_s = ", "period_s = nan # "), "`period_s` is NaN"),
        (with("period_s = ", "period_s = 1.5 # "), "speed reaches"),
        (with("blend_s = 1.0", "blend_s = 0.1"), "acceleration reaches"),
        (with("blend_s = 1.0", "blend_s = -1.0"), "`blend_s` is -1"),
        (with("sine_rad = [", "sine_rad = [inf, "), "7 sines and 6 cosines"),
        (with("centre_rad = ", "centre_rad = nan # "), "a coefficient is NaN"),
        (with("centre_rad = ", "centre_rad = 1.2 # "), "joint hip: a motion's angle reaches"),
        (with("name = \"hip\"", "name = \"knee\""), "not the same leg"),
        (with("geometry = \"", "geometry = \"0"), "lengths, axes or zero differ"),
        (with("cycles = 6", "cycles = 6\ncolour = 3"), "unknown field `colour`"),
        (text[..text.len() / 3].to_owned(), "motion.toml"),
        (String::new(), "missing field"),
    ];
    let default = cases.map(|(text, reason)| ("x2-wearer-75kg", text, reason));
    let others = [
        ("mujoco-leg", text.clone(), "lengths, axes or zero differ"),
        ("sp", text.clone(), "the motion has 2 joints, the leg `sp` has 1"),
    ];
    for (leg, text, reason) in default.into_iter().chain(others) {
        folder.write("motion.toml", &text);
        for command in ["identify", "excite"] {
            let message =
                folder.scarab(&format!("{command} --leg {leg} --excitation @motion.toml")).refusal();
            assert_contains(&message, reason);
            assert_contains(&message, "motion.toml");
        }
    }
    folder.scarab("identify --excitation @none.toml").refuses("cannot be read");
}

#[test]
fn a_motion_above_the_torque_limit_is_refused_and_none_is_designed() {
    let folder = Folder::new();
    limited(&folder, 55.0, 55.0);
    let message = folder.scarab(&format!("identify --excitation {SHIPPED} --leg @limited.toml")).refusal();
    assert_contains(&message, "the motion needs");
    assert_contains(&message, "limit 55.0 N m");
    limited(&folder, 5.0, 85.0);
    let message = folder.scarab(&format!("excite {EFFORT} --leg @limited.toml")).refusal();
    for word in [
        "no exciting motion fits the limits: joint `hip`: ",
        "limit 5.000 N m (`torque_limit_nm`)",
        ": raise it, ",
    ] {
        assert_contains(&message, word);
    }
}

/// Writes `limited.toml`: the default leg with these torque limits of hip and knee, N m.
fn limited(folder: &Folder, hip: f64, knee: f64) {
    let mut leg = LegFile::load("x2-wearer-75kg").expect("shipped");
    (leg.joints[0].torque_limit_nm, leg.joints[1].torque_limit_nm) = (hip, knee);
    folder.write("limited.toml", leg.to_toml());
}

#[test]
#[ignore = "campaign: .ci/full"]
fn a_design_for_a_leg_with_little_torque_respects_its_limit() {
    let folder = Folder::new();
    limited(&folder, 55.0, 55.0);
    // Half the torque limit: the hip of the assumed leg alone needs 53 N m at the end of its range.
    let arguments = format!("excite {EFFORT} --torque-margin 5 --leg @limited.toml");
    for joint in list(&folder.reported(&arguments, 0).1, "joints") {
        assert!(number(joint, "torque_with_margin_nm") <= 55.0, "{joint}");
    }
    limited(&folder, 5.0, 85.0);
    let checked = folder.scarab("leg --check @limited.toml").ends_with(0).printed;
    assert_contains(&checked, "\nexcite: not possible: ");
    assert_contains(&checked, "joint `hip`");
}

/// The check searches less than the design: only the search for the least torque, equal in both, decides.
#[test]
#[ignore = "campaign: .ci/full"]
fn check_and_design_agree_on_a_leg_with_too_little_torque() {
    let folder = Folder::new();
    let body = "com = [0.15, 0.0, 0.0], inertia_com = [0.002, 0.0, 0.0, 0.01, 0.0, 0.011], rotor_inertia = 0.02, \
                coulomb = 0.3, viscous = 0.1";
    let (mut ready, mut refused) = (0, 0);
    for limit in [1.2, 0.9, 0.3] {
        let joint = |name: &str, a: f64, mass: f64, range: &str| {
            format!(
                "[[joint]]\nname = \"{name}\"\ndh = {{ alpha = 0.0, a = {a:?}, d = 0.0 }}\nrange_deg = {range}\n\
                 torque_limit_nm = {limit:?}\nprior = {{ mass = {mass:?}, {body} }}\n"
            )
        };
        let (hip, knee) = (joint("hip", 0.0, 2.0, "[-60, 60]"), joint("knee", 0.3, 1.5, "[0, 100]"));
        folder.write("leg.toml", format!("name = \"leg\"\ngravity = [9.81, 0.0, 0.0]\n{hip}{knee}"));
        let checked = folder.scarab("leg --check @leg.toml").ends_with(0).printed;
        for noise in ["0.1", "0.1,0.5"] {
            let run = folder.scarab(&format!("excite {EFFORT} --torque-noise-nm {noise} --leg @leg.toml"));
            if checked.contains("\nexcite: ready\n") {
                ready += 1;
                assert_eq!(run.code, Some(0), "{limit}: {}", run.errors);
            } else {
                refused += 1;
                let reason = run.refusal().trim_start_matches("error: ").trim_end().to_owned();
                assert_contains(&checked, &format!("\nexcite: not possible: {reason}\n"));
            }
        }
    }
    assert!(ready >= 2 && refused >= 2, "{ready} {refused}");
}

/// Two links that turn about y, as robot descriptions state them: mass, centre below the joint, moments; the
/// length of the first link; and the limits of each joint.
fn description(links: [(f64, f64, f64); 2], length: f64, limits: [&str; 2]) -> String {
    let body = |name: &str, (mass, centre, moment): (f64, f64, f64)| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0 0 -{centre}\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" izz=\"{}\"/></inertial></link>",
            0.1 * moment
        )
    };
    let joint = |name: &str, parent: &str, child: &str, at: f64, limit: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"0 0 {at}\"/><axis xyz=\"0 1 0\"/><limit {limit}/><dynamics damping=\"0\" friction=\"0\"/></joint>"
        )
    };
    format!(
        "<robot name=\"arm\"><link name=\"base\"/>{}{}{}{}</robot>",
        body("upper", links[0]),
        body("lower", links[1]),
        joint("shoulder", "base", "upper", 0.0, limits[0]),
        joint("elbow", "upper", "lower", -length, limits[1])
    )
}

#[test]
#[ignore = "campaign: .ci/full"]
fn converted_robots_without_friction_and_with_wide_limits_get_a_motion() {
    let turn = |range: &str, effort: f64, velocity: f64| {
        let (low, high) = range.split_once("..").expect("two ends");
        format!("lower=\"{low}\" upper=\"{high}\" effort=\"{effort}\" velocity=\"{velocity}\"")
    };
    // Numbers of UR5 (shoulder lift, elbow), Solo12 (hip, knee) and an exoskeleton's knee with ankle.
    let ur5 = [
        turn("-6.28318530718..6.28318530718", 150.0, 3.15),
        turn("-3.14159265359..3.14159265359", 150.0, 3.15),
    ];
    let solo = [turn("-10..10", 1000.0, 1000.0), turn("-10..10", 1000.0, 1000.0)];
    let exoskeleton = [turn("0..2.0", 40.0, 6.0), turn("-0.6..0.4", 30.0, 6.0)];
    for (name, links, length, limits, remark) in [
        ("ur5", [(8.393, 0.28, 0.227), (5.9, 0.4, 0.25)], 0.425, &ur5, ""),
        (
            "solo12",
            [(0.1485, 0.079, 4.1e-4), (0.0376, 0.09, 1.5e-4)],
            0.16,
            &solo,
            "`limit` is -573.0 to 573.0 degrees, narrowed to -360.0 to 360.0",
        ),
        ("exoskeleton", [(3.5, 0.18, 0.06), (1.1, 0.07, 0.008)], 0.42, &exoskeleton, ""),
    ] {
        let folder = Folder::new();
        folder.write("robot.urdf", description(links, length, [&limits[0], &limits[1]]));
        let converted = folder.scarab("leg --urdf @robot.urdf --out @leg.toml").ends_with(0).printed;
        assert_contains(&converted, remark);
        let checked = folder.scarab("leg --check @leg.toml").ends_with(0).printed;
        assert_contains(&checked, "\nexcite: ready\n  the option --torque-noise-nm NM");
        let arguments = "excite --torque-noise-nm 0.1 --evaluations 1800 --leg @leg.toml";
        for joint in list(&folder.reported(arguments, 0).1, "joints") {
            assert_eq!(joint["simulated"]["limited_ticks"], 0, "{name}: {joint}");
        }
    }
}

#[test]
fn implausible_options_are_refused_with_a_reason() {
    for (arguments, reason) in [
        ("excite --duration 0", "--duration"),
        ("excite --duration nan", "--duration"),
        ("excite --duration 1e9", "--duration"),
        ("excite --duration 3", "leave no room for a cycle"),
        ("excite --torque-noise -1", "--torque-noise"),
        ("excite --torque-margin inf", "--torque-margin"),
        ("excite --torque-noise-nm 1,2,3", "3 numbers, but the leg `x2-wearer-75kg` has 2 joints"),
        ("excite --torque-noise-nm -1", "-1 N m is outside 0..1000"),
        ("identify --torque-noise-nm nan", "NaN N m is outside 0..1000"),
        ("identify --torque-noise-nm 1 --torque-noise 7", "cannot be used with"),
        ("excite --evaluations 1", "evaluations"),
        ("excite --leg none-such", "none-such"),
    ] {
        scarab(arguments).refuses(reason);
    }
}

#[test]
#[ignore = "campaign: .ci/full"]
fn the_paper_s_chain_has_no_motion_within_its_limits() {
    scarab("excite --leg paper-chain --evaluations 600")
        .refuses("no exciting motion fits the limits: joint `hip rotation`: ");
}

#[test]
fn no_sigma_is_expected_without_stated_noise() {
    for arguments in [
        "--leg sp",
        "--leg sp --torque-noise-nm 0",
        "--leg sp --torque-noise 0",
        &format!("--leg @silent.toml --excitation {SHIPPED}"),
    ] {
        let folder = Folder::new();
        // Leg with its own motion but without stated noise.
        let mut silent = LegFile::load("x2-wearer-75kg").expect("shipped");
        silent.torque_noise_percent = 0.0;
        folder.write("silent.toml", silent.to_toml());
        let message = folder.scarab(&format!("excite {arguments} --json @report.json")).refusal();
        for word in
            ["is not stated", "`current_noise_a`", "`torque_noise_percent`", "--torque-noise-nm", "joint `"]
        {
            assert_contains(&message, word);
        }
        assert!(!folder.path("report.json").exists());
    }
}
