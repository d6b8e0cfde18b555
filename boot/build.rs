//! Links the bootloader; host programs use the library only.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=layout.x");
    println!("cargo::rerun-if-changed=../memory.x");
    if env::var_os("CARGO_FEATURE_BOOTLOADER").is_some() {
        println!("cargo::rustc-link-search={}", env!("CARGO_MANIFEST_DIR"));
        println!("cargo::rustc-link-search={}/..", env!("CARGO_MANIFEST_DIR"));
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
    }
}
