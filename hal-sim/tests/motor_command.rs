//! `motor`: the board's current loop against the simulated motor, by what the command reports.
#![cfg(feature = "tool")]

mod command;

use std::sync::OnceLock;

use command::{Folder, scarab};
use serde_json::Value;

/// The report of the default leg's first motor.
fn report() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| {
        let folder = Folder::new();
        let run = scarab("motor --json", &[&folder.path("motor.json")]).ends_with(0);
        assert!(run.printed.contains("hip: current loop of 1000 Hz"), "{}", run.printed);
        folder.json("motor.json")
    })
}

fn number(entry: &Value, key: &str) -> f64 {
    entry[key].as_f64().unwrap_or_else(|| panic!("{key}: {entry}"))
}

fn entries(key: &str) -> &'static [Value] {
    report()[key].as_array().expect("a list")
}

#[test]
fn steps_of_current_rise_as_designed_at_every_speed() {
    let designed = &report()["designed"];
    assert_eq!(entries("steps").len(), 8);
    for step in entries("steps") {
        let (rise, overshoot) = (number(step, "rise_ms"), number(step, "overshoot_percent"));
        // Inductance is measured to 2 %; at the top speed the axis turns by 9 degrees while the step rises.
        let tolerance = if step["feedforward"] == true { 0.08 } else { 0.15 };
        assert!((rise / number(designed, "rise_ms") - 1.0).abs() < tolerance, "{rise} {designed}");
        assert!(overshoot < number(designed, "overshoot_percent") + 6.0, "{overshoot} {designed}");
        assert!(number(step, "error_a").abs() < 0.3, "{}", step["error_a"]);
    }
}

#[test]
fn feedforward_takes_the_coupling_off_a_step_at_speed() {
    let fast: Vec<_> =
        entries("steps").iter().rev().take(2).map(|step| number(step, "coupling_percent")).collect();
    let [without, with] = fast[..] else { panic!("{fast:?}") };
    assert!(with < 0.7 * without, "{with} {without}");
}

#[test]
fn giving_dead_time_back_takes_its_sixth_harmonic_off_the_torque() {
    let sixth = |compensated: bool, speed: usize| {
        let quiet = entries("ripple").iter().filter(|entry| entry["noise"] == false);
        let of: Vec<_> = quiet
            .filter(|entry| entry["compensated"] == compensated && entry["sine"] == "exact")
            .map(|entry| number(entry, "sixth_percent"))
            .collect();
        of[speed]
    };
    assert!(sixth(true, 1) < 0.6 * sixth(false, 1), "{} {}", sixth(true, 1), sixth(false, 1));
}

#[test]
fn the_fast_sine_costs_less_torque_than_the_sensors_noise() {
    for entry in entries("ripple") {
        assert!(number(entry, "mean_error_percent").abs() < 1.0, "{entry}");
        assert!(number(entry, "torque_percent") < 5.0, "{entry}");
    }
    let rms = |sine: &str| {
        let of = entries("ripple")
            .iter()
            .find(|entry| entry["noise"] == false && entry["compensated"] == true && entry["sine"] == sine);
        number(of.expect("measured"), "torque_percent")
    };
    let noisy = entries("ripple").iter().find(|entry| entry["noise"] == true).expect("measured");
    assert!((rms("fast") - rms("exact")).abs() < number(noisy, "torque_percent"));
}

#[test]
fn a_voltage_limit_costs_no_more_than_a_step_to_come_back_from() {
    for pair in entries("limit").chunks(2) {
        let [weak, strong] = pair else { panic!("pairs") };
        assert!(number(weak, "reached_a") < 47.0, "limited: {weak}");
        assert!((number(strong, "reached_a") - 50.0).abs() < 0.5, "not limited: {strong}");
        for entry in pair {
            assert_eq!(entry["released"], false);
        }
        let (limited, free) = (number(weak, "recovery_ms"), number(strong, "recovery_ms"));
        // A wound-up integral of 100 ms would take many milliseconds.
        assert!(limited < free + 1.0, "{limited} {free}");
        // The field stays where it belongs while the quadrature current gives way.
        assert!(number(weak, "direct_a").abs() < 5.0, "{weak}");
    }
}

#[test]
fn the_chopper_keeps_the_bus_within_bounds_and_without_it_the_firmware_lets_go() {
    let [with, without] = entries("regeneration") else { panic!("two brakings") };
    assert!(number(with, "highest_bus_v") < 54.0 && with["fault"].is_null(), "{}", with["highest_bus_v"]);
    // The rest raised the capacitor's voltage and is drawn from it again at the end.
    let burnt = number(with, "brake_j") / number(with, "returned_j");
    assert!((0.8..1.0).contains(&burnt), "what comes back is burnt, and only that: {burnt}");
    assert!(number(with, "returned_j") < number(with, "motion_j"));
    assert_eq!(without["fault"], "bus_voltage");
    // Beyond 58 V the bridge is released within two ticks.
    assert!((57.0..60.0).contains(&number(without, "highest_bus_v")), "{}", without["highest_bus_v"]);
}

#[test]
fn figures_are_drawn_and_wrong_joints_refused() {
    let folder = Folder::new();
    scarab("motor --joint knee --figures", &[&folder.path("figures")]).ends_with(0);
    for file in ["current-steps", "torque-ripple", "voltage-limit", "regeneration"] {
        let svg = std::fs::read_to_string(folder.path(&format!("figures/{file}.svg"))).expect("drawn");
        let document = roxmltree::Document::parse(&svg).expect("well-formed");
        assert!(document.descendants().count() > 50, "{file}");
    }
    let refusal = scarab("motor --joint ankle", &[]).refusal();
    assert!(refusal.contains("`ankle` is no joint of x2-wearer-75kg: hip, knee or 1 to 2"), "{refusal}");
    let refusal = scarab("motor --leg sp", &[]).refusal();
    assert!(refusal.contains("sp: the joint has no `[joint.motor]`"), "{refusal}");
}
