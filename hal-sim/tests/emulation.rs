//! The whole firmware on the emulated microcontroller against the same on the host.
//!
//! Needs QEMU and a compiler for the microcontroller, and takes minutes: `cargo test -p hal-sim --test emulation -- --ignored`.
#![cfg(feature = "tool")]

mod command;

use command::{Folder, scarab};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number: {value}"))
}

fn base(report: &Value) -> Vec<(String, f64, f64, f64)> {
    let entries = report["base_parameters"].as_array().expect("a list");
    let entry = |entry: &Value| {
        let name = entry["name"].as_str().expect("a name").to_owned();
        (name, number(&entry["value"]), number(&entry["sigma"]), number(&entry["truth"]))
    };
    entries.iter().map(entry).collect()
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller"]
fn the_emulated_leg_finds_what_the_simulated_one_does_bit_by_bit_the_same_every_time() {
    let folder = Folder::new();
    let [json, once, again, host] =
        ["emulated.json", "once", "again", "host.json"].map(|name| folder.path(name));
    let run = scarab("emulate --json", &[&json, "--trace".as_ref(), &once]).ends_with(0);
    assert!(run.printed.contains("verdict: accepted"), "{}", run.printed);
    scarab("emulate --trace", &[&again]).ends_with(0);
    let bytes = std::fs::read(&once).expect("written");
    assert!(bytes == std::fs::read(&again).expect("written"), "two runs tell different bytes");

    let emulated = folder.json("emulated.json");
    assert_eq!(emulated["missed_ticks"], 0);
    assert_eq!(emulated["trace_bytes"], bytes.len());
    let instructions = &emulated["instructions"];
    assert!(number(&instructions["servo_tick_worst"]) < number(&instructions["servo_period"]));
    // The search ran below ticks that went on: all of the 500 Hz samples were taken.
    assert_eq!(emulated["trace"]["loops"]["samples_lost"], 0);
    assert_eq!(emulated["trace"]["lost_records"], 0);

    scarab("identify --json", &[&host]).ends_with(0);
    let simulated = folder.json("host.json");
    for (one, other) in base(&emulated).iter().zip(base(&simulated)) {
        assert_eq!(one.0, other.0);
        // The same samples in the same precision; sums may be taken in another order by another compiler.
        assert!((one.1 - other.1).abs() < 1e-3 * other.2, "{one:?} {other:?}");
    }
    assert_eq!(emulated["bso"]["iterations"], simulated["bso"]["iterations"]);
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller"]
fn parameters_follow_a_leg_file_that_was_changed() {
    let folder = Folder::new();
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/legs/x2-wearer-75kg.toml");
    let text = std::fs::read_to_string(shipped).expect("shipped");
    // The knee's viscous friction half as large again.
    let changed = text.replacen("viscous = 3.26", "viscous = 4.89", 1);
    assert_ne!(text, changed);
    let leg = folder.path("changed.toml");
    std::fs::write(&leg, changed).expect("written");
    let json = folder.path("changed.json");
    scarab("emulate --leg", &[&leg, "--json".as_ref(), &json]).ends_with(0);
    let found = base(&folder.json("changed.json"));
    let (_, value, sigma, truth) = found.iter().find(|entry| entry.0 == "FV2").expect("the knee's");
    assert!((truth - 4.89).abs() < 1e-9 && (value - truth).abs() < 4.0 * sigma, "{value} {sigma} {truth}");
}
