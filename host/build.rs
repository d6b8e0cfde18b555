//! Fingerprint of the sources that a campaign's program is built from. Shards computed by other sources are
//! not joined (`scarab_identify::formats::shard`).
//!
//! Why not the commit: sources changed without a commit give other results, and a commit of documents gives
//! the same ones. A commit would also have everything compiled again.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Sources below the workspace's folder, besides the package's own, and the versions of all other crates.
const SOURCES: [&str; 9] = [
    "src",
    "hal-sim/src",
    "host/base/src",
    "host/client/src",
    "host/identify/src",
    "host/rig/src",
    "host/tool/src",
    "host/legs",
    "Cargo.lock",
];

fn main() {
    let package = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let workspace = package.ancestors().find(|folder| folder.join("Cargo.lock").exists());
    let mut files = BTreeMap::new();
    for source in workspace.iter().flat_map(|folder| SOURCES.map(|source| folder.join(source))) {
        println!("cargo::rerun-if-changed={}", source.display());
        collect(&source, workspace.unwrap_or(&package), &mut files);
    }
    let own = package.join("src");
    println!("cargo::rerun-if-changed={}", own.display());
    collect(&own, &package, &mut files);
    // FNV-1a, 64 bits.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for (name, content) in &files {
        for byte in name.bytes().chain([0]).chain(content.iter().copied()).chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    println!("cargo::rustc-env=SCARAB_SOURCES={hash:016x}");
}

/// Files below a path, named by their place in a folder, which is not the same on every machine.
fn collect(path: &Path, folder: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
    if let Ok(entries) = fs::read_dir(path) {
        entries.flatten().for_each(|entry| collect(&entry.path(), folder, files));
    } else if let Ok(content) = fs::read(path) {
        let name = path.strip_prefix(folder).unwrap_or(path);
        files.insert(name.to_string_lossy().replace('\\', "/"), content);
    }
}
