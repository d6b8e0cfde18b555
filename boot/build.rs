//! Links the bootloader; host programs use the library only.

use std::path::Path;
use std::{env, fs};

#[expect(dead_code, reason = "the library's module; only its regions are used here")]
#[path = "src/region.rs"]
mod region;

use region::Region;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=layout.x");
    println!("cargo::rerun-if-changed=src/region.rs");
    println!("cargo::rerun-if-changed=../memory.x");
    if env::var_os("CARGO_FEATURE_BOOTLOADER").is_some() {
        let written = env::var("OUT_DIR").expect("cargo sets it");
        let memory = [("FLASH", Region::BOOTLOADER), ("STATE", Region::STATE)].map(|(name, region)| {
            format!("{name} : ORIGIN = {:#x}, LENGTH = {}\n", region.address, region.bytes())
        });
        fs::write(Path::new(&written).join("flash.x"), memory.concat())
            .expect("cargo's directory is writable");
        let here = env!("CARGO_MANIFEST_DIR");
        for folder in [written, here.to_owned(), format!("{here}/..")] {
            println!("cargo::rustc-link-search={folder}");
        }
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
    }
}
