//! Whole firmware on the emulated microcontroller, compared with the host.
//!
//! Needs QEMU and a compiler for the microcontroller, and takes minutes:
//! `cargo test -p scarab-host --test tool emulated -- --ignored`.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::command::{Folder, scarab};
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

/// Lock of the only image; every test that builds and runs it holds this.
pub fn the_image() -> MutexGuard<'static, ()> {
    static IMAGE: Mutex<()> = Mutex::new(());
    IMAGE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Leg file that differs from the shipped one: 1.5 times the knee's viscous friction.
pub fn changed_leg(folder: &Folder) -> PathBuf {
    let text = include_str!("../../legs/x2-wearer-75kg.toml");
    let changed = text.replacen("coulomb = 4.67, viscous = 3.26", "coulomb = 4.67, viscous = 4.89", 1);
    assert_ne!(text, changed);
    folder.write("changed.toml", &changed)
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller: a step of .ci/run"]
fn the_emulated_leg_agrees_with_the_simulated_one_and_repeats_its_bytes() {
    let _image = the_image();
    let folder = Folder::new();
    let leg = changed_leg(&folder);
    let [json, once, again, host] =
        ["emulated.json", "once", "again", "host.json"].map(|name| folder.path(name));
    // In parallel: the second thread finds the image built.
    std::thread::scope(|scope| {
        scope.spawn(|| scarab("emulate --leg", &[&leg, Path::new("--trace"), &again]).ends_with(0));
        let run = scarab("emulate --leg", &[&leg, Path::new("--json"), &json, Path::new("--trace"), &once])
            .ends_with(0);
        assert!(run.printed.contains("verdict: accepted"), "{}", run.printed);
    });
    let bytes = std::fs::read(&once).expect("written");
    assert!(bytes == std::fs::read(&again).expect("written"), "two runs send different bytes");

    let emulated = folder.json("emulated.json");
    assert_eq!(emulated["missed_ticks"], 0);
    assert_eq!(emulated["trace_bytes"], bytes.len());
    let instructions = &emulated["instructions"];
    assert!(number(&instructions["servo_tick_worst"]) < number(&instructions["servo_period"]));
    // The search ran while ticks continued: every 500 Hz sample was taken.
    assert_eq!(emulated["trace"]["loops"]["samples_lost"], 0);
    assert_eq!(emulated["trace"]["lost_records"], 0);

    scarab("identify --leg", &[&leg, Path::new("--json"), &host]).ends_with(0);
    let simulated = folder.json("host.json");
    for (one, other) in base(&emulated).iter().zip(base(&simulated)) {
        assert_eq!(one.0, other.0);
        // Equal samples and precision; another compiler may change the order of sums.
        assert!((one.1 - other.1).abs() < 1e-3 * other.2, "{one:?} {other:?}");
    }
    assert_eq!(emulated["bso"]["iterations"], simulated["bso"]["iterations"]);

    let (_, value, sigma, truth) =
        base(&emulated).into_iter().find(|entry| entry.0 == "FV2").expect("the knee's");
    assert!((truth - 4.89).abs() < 1e-9 && (value - truth).abs() < 4.0 * sigma, "{value} {sigma} {truth}");
}
