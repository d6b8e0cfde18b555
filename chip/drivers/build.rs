//! Links the program for the microcontroller; a host needs no settings.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=layout.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        // The linker finds the workspace's memory.x first, which includes this folder's layout.x.
        println!("cargo::rerun-if-changed=../../memory.x");
        println!("cargo::rustc-link-search={}/../..", env!("CARGO_MANIFEST_DIR"));
        println!("cargo::rustc-link-search={}", env!("CARGO_MANIFEST_DIR"));
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
    }
}
