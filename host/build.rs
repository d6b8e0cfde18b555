//! Fingerprint of the sources that a campaign's program is built from. Shards computed by other sources are
//! not joined (`formats::shard`).
//!
//! Why not the commit: sources changed without a commit give other results, and a commit of documents gives
//! the same ones. A commit would also have everything compiled again.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Sources of the package itself, of the crates below it, and the versions of all others. Folders that a
/// packaged crate lacks are skipped.
const SOURCES: [&str; 7] =
    ["src", "legs", "../src", "../hal-sim/src", "../host/src", "../host/legs", "../Cargo.lock"];

fn main() {
    let mut files = BTreeMap::new();
    for source in SOURCES.map(Path::new) {
        if source.exists() {
            println!("cargo::rerun-if-changed={}", source.display());
            collect(source, &mut files);
        }
    }
    // FNV-1a, 64 bits.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for (name, content) in &files {
        for byte in name.bytes().chain([0]).chain(content.iter().copied()).chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    println!("cargo::rerun-if-changed={}", own_path().display());
    println!("cargo::rustc-env=SCARAB_SOURCES={hash:016x}");
}

/// This file, as seen from the package that uses it.
fn own_path() -> PathBuf {
    let beside = PathBuf::from("build.rs");
    if beside.exists() { beside } else { PathBuf::from("../host/build.rs") }
}

fn collect(path: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
    if let Ok(entries) = fs::read_dir(path) {
        entries.flatten().for_each(|entry| collect(&entry.path(), files));
    } else if let Ok(content) = fs::read(path) {
        files.insert(path.to_string_lossy().replace('\\', "/"), content);
    }
}
