//! `motor`: the board's current loop with the simulated motor, as reported by the command.

use std::sync::OnceLock;

use crate::command::{Folder, assert_contains, list, number, scarab};
use serde_json::Value;

/// Report of the default leg's first motor.
fn report() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| {
        let (run, report) = Folder::new().reported("motor", 0);
        run.prints("hip: current loop of 1000 Hz");
        report
    })
}

fn entries(key: &str) -> &'static [Value] {
    list(report(), key)
}

#[test]
fn steps_of_current_rise_as_designed_at_every_speed() {
    let designed = &report()["designed"];
    assert_eq!(entries("steps").len(), 8);
    for step in entries("steps") {
        let (rise, overshoot) = (number(step, "rise_ms"), number(step, "overshoot_percent"));
        // Inductance is measured to 0.7 %. Without feedforward, the integral compensates the
        // back-EMF of a rotor that keeps turning.
        let tolerance = if step["feedforward"] == true { 0.02 } else { 0.06 };
        assert!((rise / number(designed, "rise_ms") - 1.0).abs() < tolerance, "{rise} {designed}");
        assert!(overshoot < number(designed, "overshoot_percent") + 1.0, "{overshoot} {designed}");
        assert!(number(step, "error_a").abs() < 0.1, "{}", step["error_a"]);
    }
}

#[test]
fn feedforward_removes_the_coupling_of_a_step_at_speed() {
    let fast: Vec<_> =
        entries("steps").iter().rev().take(2).map(|step| number(step, "coupling_percent")).collect();
    let [without, with] = fast[..] else { panic!("{fast:?}") };
    assert!(with < 0.45 * without && with < 7.0, "{with} {without}");
}

#[test]
fn dead_time_compensation_removes_its_sixth_harmonic() {
    let sixth = |compensated: bool, speed: usize| {
        let quiet = entries("ripple").iter().filter(|entry| entry["noise"] == false);
        let of: Vec<_> = quiet
            .filter(|entry| entry["compensated"] == compensated)
            .map(|entry| number(entry, "sixth_percent"))
            .collect();
        of[speed]
    };
    assert!(sixth(true, 1) < 0.3 * sixth(false, 1), "{} {}", sixth(true, 1), sixth(false, 1));
}

#[test]
fn torque_ripple_and_mean_stay_small() {
    for entry in entries("ripple") {
        assert!(number(entry, "mean_error_percent").abs() < 0.1, "{entry}");
        assert!(number(entry, "torque_percent") < 0.4, "{entry}");
    }
}

#[test]
fn recovery_from_a_voltage_limit_is_as_fast_as_a_step() {
    for pair in entries("limit").chunks(2) {
        let [weak, strong] = pair else { panic!("pairs") };
        assert!(number(weak, "reached_a") < 47.0, "limited: {weak}");
        assert!((number(strong, "reached_a") - 50.0).abs() < 0.5, "not limited: {strong}");
        for entry in pair {
            assert_eq!(entry["released"], false);
        }
        let (limited, free) = (number(weak, "recovery_ms"), number(strong, "recovery_ms"));
        // Wind-up over 100 ms would delay the recovery by many milliseconds.
        assert!(limited < free + 0.1 && limited < 0.35, "{limited} {free}");
        // The direct current stays at its target while the quadrature current falls.
        assert!(number(weak, "direct_a").abs() < 0.1, "{weak}");
    }
}

#[test]
fn the_chopper_limits_the_bus_and_without_it_the_bridge_turns_off() {
    let [with, without] = entries("regeneration") else { panic!("two brakings") };
    assert!(number(with, "highest_bus_v") < 51.0 && with["fault"].is_null(), "{}", with["highest_bus_v"]);
    // The rest charged the capacitor and is drawn from it again at the end.
    let burnt = number(with, "brake_j") / number(with, "returned_j");
    assert!((0.8..1.0).contains(&burnt), "dissipated share of the returned energy: {burnt}");
    assert!(number(with, "returned_j") < number(with, "motion_j"));
    assert_eq!(without["fault"], "bus_voltage");
    // The curve includes the time at which the bridge is switched off.
    let last = without["bus_v"].as_array().and_then(|curve| curve.last()).and_then(Value::as_f64);
    assert!(last.is_some_and(|volts| volts > 57.8), "{last:?}");
    // Above 58 V the bridge is switched off within two ticks.
    assert!((58.0..58.6).contains(&number(without, "highest_bus_v")), "{}", without["highest_bus_v"]);
}

#[test]
fn figures_are_drawn_and_wrong_joints_refused() {
    let folder = Folder::new();
    folder.scarab("motor --joint knee --figures @figures").ends_with(0);
    for file in ["current-steps", "torque-ripple", "voltage-limit", "regeneration"] {
        let svg = folder.read(&format!("figures/{file}.svg"));
        let document = roxmltree::Document::parse(&svg).expect("well-formed");
        assert!(document.descendants().count() > 50, "{file}");
    }
    scarab("motor --joint ankle").refuses("`ankle` is not a joint of x2-wearer-75kg: hip, knee or 1 to 2");
    scarab("motor --leg sp").refuses("sp: the joint has no `[joint.motor]`");
}

#[test]
fn curves_of_one_frame_differ_in_colour_or_dashes_and_the_legend_has_each() {
    let folder = Folder::new();
    folder.scarab("motor --figures @figures").ends_with(0);
    for (file, frames, names) in [
        ("current-steps", 4, &["q with feedforward", "q without", "d with feedforward", "d without"][..]),
        ("voltage-limit", 2, &["48 V: quadrature", "12 V: quadrature", "48 V: direct", "12 V: direct"]),
        ("regeneration", 2, &["with chopper", "without, until the outputs are off"]),
    ] {
        let svg = folder.read(&format!("figures/{file}.svg"));
        let document = roxmltree::Document::parse(&svg).expect("well-formed");
        let words: Vec<_> = document.descendants().filter_map(|node| node.text().map(str::trim)).collect();
        for name in names {
            assert!(words.contains(name), "{file}: no {name} in the legend");
        }
        // Solid curves only; a dash has few points.
        let mut styles = std::collections::BTreeMap::new();
        for node in document.descendants().filter(|node| node.has_tag_name("polyline")) {
            let points = node.attribute("points").map_or(0, |points| points.split_whitespace().count());
            if points > 20 {
                *styles.entry((node.attribute("stroke"), node.attribute("stroke-width"))).or_insert(0) += 1;
            }
        }
        assert!(!styles.is_empty() && styles.values().all(|curves| *curves <= frames), "{file}: {styles:?}");
    }
}

/// Writes `leg.toml`: the default leg with replaced words.
fn changed(folder: &Folder, changes: &[(&str, &str)]) {
    let mut text = include_str!("../../../legs/x2-wearer-75kg.toml").to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    folder.write("leg.toml", &text);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn weak_and_slow_motors_are_measured_within_their_limits() {
    for changes in [
        // Limit of 3.3 A.
        &[("torque_limit_nm = 85.0", "torque_limit_nm = 5.0")][..],
        &[("speed_limit_deg_s = 257.8", "speed_limit_deg_s = 0.5")],
        &[
            ("resistance_ohm = 0.039", "resistance_ohm = 0.25"),
            ("_d_uh = 15.0", "_d_uh = 40.0"),
            ("_q_uh = 17.0", "_q_uh = 45.0"),
        ],
        &[
            ("_d_uh = 15.0", "_d_uh = 1000.0"),
            ("_q_uh = 17.0", "_q_uh = 1000.0"),
            ("speed_limit_deg_s = 257.8", "speed_limit_deg_s = 85.9"),
            ("torque_limit_nm = 85.0", "torque_limit_nm = 40.0"),
        ],
    ] {
        let folder = Folder::new();
        changed(&folder, changes);
        let (run, report) = folder.reported("motor --leg @leg.toml", 0);
        assert!(!run.printed.contains("NaN"), "{}", run.printed);
        let limit = changes[0].1.ends_with("5.0").then_some(5.0 / 1.5);
        for step in list(&report, "steps") {
            // 1 mH takes 0.7 ms at the voltage limit; without feedforward the integral has not
            // settled after 2 ms.
            assert!(number(step, "error_a").abs() < 0.3, "{changes:?}: {} A", step["error_a"]);
            assert!(number(step, "to_a") <= limit.unwrap_or(25.0) + 1e-5);
            assert!((0.0..2.5).contains(&number(step, "rise_ms")), "{changes:?} {}", step["rise_ms"]);
        }
    }
}

#[test]
fn an_axis_turned_off_and_a_failing_supply_are_named() {
    let folder = Folder::new();
    let weak = "supply = { voltage_v = 24.0, resistance_ohm = 1.0, capacitance_uf = 50.0, brake_ohm = 2.0 }\nsegments =";
    changed(&folder, &[("segments =", weak)]);
    let run = folder.scarab("motor --leg @leg.toml").ends_with(3);
    run.warns("axis `hip` turned its bridge off (steps");
    run.warns("the bus voltage left 20 V..58 V (`supply`)");
    // With a leg the servo detects the falling supply before an axis does.
    let run = folder.scarab("identify --drive full --leg @leg.toml").ends_with(3);
    let words = "fault 0x3220: joint hip, its supply went away";
    assert!(format!("{}{}", run.printed, run.errors).contains(words), "{}{}", run.printed, run.errors);
}

#[test]
fn configuration_errors_name_the_key_that_corrects_them() {
    let refusal = |changes: &[(&str, &str)]| {
        let folder = Folder::new();
        changed(&folder, changes);
        folder.scarab("motor --leg @leg.toml").refusal()
    };
    let supply = |volts: &str| {
        let line = format!(
            "supply = {{ voltage_v = {volts}, resistance_ohm = 0.05, capacitance_uf = 1500.0, brake_ohm = 2.0 }}\nsegments ="
        );
        refusal(&[("segments =", &line)])
    };
    for volts in ["12.0", "55.0"] {
        assert_contains(&supply(volts), "outside 22..50: the board's bridges");
    }
    let strong = refusal(&[
        ("torque_per_ampere = 1.5", "torque_per_ampere = 15.0"),
        ("torque_limit_nm = 85.0", "torque_limit_nm = 400.0"),
    ]);
    assert_contains(&strong, "the back-EMF of a motor with its bridge off");
    assert_contains(&strong, "`speed_limit_deg_s`");
    let cogging = refusal(&[("cogging_nm = 0.017", "cogging_nm = 0.5")]);
    assert_contains(&cogging, "did not follow the field evenly");
    assert_contains(&cogging, "cogging_nm");
    let limit = refusal(&[("torque_limit_nm = 85.0", "torque_limit_nm = 100.0")]);
    assert_contains(&limit, "its current limit (`current_limit_a`");
}

#[test]
#[ignore = "campaign: .ci/full"]
fn encoder_counts_that_do_not_divide_the_counter_range_work() {
    for counts in ["10000", "30000"] {
        let folder = Folder::new();
        changed(&folder, &[("counts = 8192", &format!("counts = {counts}"))]);
        folder.scarab("identify --drive full --leg @leg.toml").ends_with(0).prints("verdict: accepted");
    }
}
