//! Links images for the emulated microcontroller; host programs need no settings.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    println!("cargo::rustc-link-search={}/..", env!("CARGO_MANIFEST_DIR"));
    let emulated = env::var_os("CARGO_FEATURE_EMULATED").is_some();
    let drivers = env::var_os("CARGO_FEATURE_DRIVERS").is_some();
    let image = if emulated { "emulated" } else { "count-instructions" };
    let image = if drivers { "drivers" } else { image };
    println!("cargo::rerun-if-changed=src/bin/{image}/layout.x");
    println!("cargo::rustc-link-search={}/src/bin/{image}", env!("CARGO_MANIFEST_DIR"));
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    if emulated {
        println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
        // The plant as a constant, which `cargo emulate` writes from a leg file.
        println!("cargo::rerun-if-env-changed=SCARAB_PLANT");
        if let Ok(plant) = env::var("SCARAB_PLANT") {
            println!("cargo::rerun-if-changed={plant}");
            println!("cargo::rustc-env=SCARAB_PLANT_SOURCE={plant}");
        }
    }
}
