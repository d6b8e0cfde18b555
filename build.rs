//! Selects the leg of an image and links the flash image: memory layout, vector table, records. Host programs
//! need none of this.

use std::path::Path;
use std::{env, fs};

use scarab_boot::Region;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed=src/board/odrive_v3_6/layout.x");
    let target = env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    if target != "none" || env::var_os("CARGO_FEATURE_BOARD_ODRIVE_V3_6").is_none() {
        return;
    }
    // The leg the image is for: a constant that `cargo fw --source` writes from a leg file.
    let leg = env::var("SCARAB_LEG").unwrap_or_else(|_| {
        println!("cargo::warning=SCARAB_LEG names no leg: the image is for the leg x2-wearer-75kg alone");
        concat!(env!("CARGO_MANIFEST_DIR"), "/host/legs/x2-wearer-75kg.rs").to_owned()
    });
    println!("cargo::rerun-if-env-changed=SCARAB_LEG");
    println!("cargo::rerun-if-env-changed=SCARAB_TRACE_LOG");
    println!("cargo::rerun-if-env-changed=SCARAB_BRAKE_RESISTOR");
    println!("cargo::rerun-if-env-changed=SCARAB_BOARD_VOLTS");
    println!("cargo::rerun-if-changed={leg}");
    println!("cargo::rustc-env=SCARAB_LEG_SOURCE={leg}");
    let written = env::var("OUT_DIR").expect("cargo sets it");
    let memory =
        format!("FLASH : ORIGIN = {:#x}, LENGTH = {}\n", Region::IMAGE.address, Region::IMAGE.bytes());
    fs::write(Path::new(&written).join("flash.x"), memory).expect("cargo's directory is writable");
    println!("cargo::rustc-link-search={written}");
    println!("cargo::rustc-link-search={}", env!("CARGO_MANIFEST_DIR"));
    println!("cargo::rustc-link-search={}/src/board/odrive_v3_6", env!("CARGO_MANIFEST_DIR"));
    for script in ["link.x", "defmt.x"] {
        println!("cargo::rustc-link-arg-bins=-T{script}");
    }
}
