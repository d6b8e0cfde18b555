//! Checks of the architecture: allowed dependencies between modules, and a few rules that no compiler checks.
//!
//! A module here is one at the top of `src/`. The table below is the design's; a change to it is a change of
//! the architecture and belongs in a commit of its own. Comments do not count as a use, unit tests do. A test
//! that needs more modules than its own may use lives in `tests/`.

mod tokens;

use std::fs;
use std::path::{Path, PathBuf};

use scarab::safety::{FaultCode, NoticeCode};
use tokens::{Token, tokens};

/// Each module and its allowed dependencies, besides itself and the open ones.
const HOUSE: [(&str, &[&str]); 19] = [
    ("units", &[]),
    ("real", &[]),
    ("place", &[]),
    ("checksum", &[]),
    ("hal", &[]),
    ("model", &[]),
    ("motion", &["model"]),
    ("swarm", &[]),
    ("ident", &["model", "motion", "swarm"]),
    ("motor", &["hal"]),
    ("safety", &["hal"]),
    ("servo", &["hal", "model", "motion", "motor", "safety"]),
    ("leg", &["hal", "model", "motion", "swarm", "ident", "motor", "safety", "servo"]),
    ("trace", &["hal", "leg"]),
    ("store", &["hal", "leg"]),
    ("bus", &["hal", "leg"]),
    ("operation", &["hal", "motor", "leg", "safety", "servo", "trace", "bus"]),
    ("board", &["hal", "motor", "leg", "bus", "task"]),
    ("task", &["hal", "motor", "leg", "operation", "safety", "servo", "trace", "store", "bus", "board"]),
];

/// Modules that every other module may use.
const OPEN: [&str; 4] = ["units", "real", "place", "checksum"];

/// Firmware modules that the simulated hardware may use. The tool and the programs may use all.
const PLANT: [&str; 2] = ["hal", "units"];

/// Files that may name the maths library, relative to the workspace.
const MATHS_DOORS: [&str; 2] = ["src/real.rs", "hal-sim/src/maths.rs"];

/// Files (and folders) that may contain `unsafe`: the hardware square root, in-place construction, the
/// boards' layers, and the two images for the emulator.
const UNSAFE_ALLOWED: [&str; 5] = [
    "src/real.rs",
    "src/place.rs",
    "src/board/",
    "hal-sim/src/bin/count-instructions/counter.rs",
    "hal-sim/src/bin/emulated/",
];

/// Absolute folders that exist on one machine only; split, so that this file does not name one itself.
const FOLDERS_OF_ONE_MACHINE: [&str; 4] =
    [concat!("/", "tmp/"), concat!("/", "work/"), concat!("/", "root/"), concat!("/", "home/")];

/// File with the list of all fault and emergency codes.
const CODE_LIST: &str = "src/safety/fault.rs";

/// Longest permitted file, lines; longer files are split by meaning.
const LARGEST_LINE_COUNT: usize = 900;

#[test]
fn every_room_uses_only_the_rooms_the_design_allows() {
    let mut offences = Vec::new();
    for file in source_files("src") {
        let room = room_of(&file.path);
        if room == "lib" || room == "main" {
            continue;
        }
        let Some((_, allowed)) = HOUSE.iter().find(|(name, _)| *name == room) else {
            offences.push(format!("{}: room `{room}` is not in the table", file.path));
            continue;
        };
        for used in rooms_used(&file.text, module_depth(&file.path)) {
            if used.text != room && !OPEN.contains(&used.text) && !allowed.contains(&used.text) {
                offences.push(format!("{}:{}: `{room}` may not use `{}`", file.path, used.line, used.text));
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn the_swarm_needs_the_maths_door_and_nothing_else_of_the_crate() {
    let mut offences = Vec::new();
    for file in source_files("src/swarm") {
        for used in rooms_used(&file.text, module_depth(&file.path)) {
            if !["swarm", "real"].contains(&used.text) {
                offences.push(format!("{}:{}: `swarm` may not use `{}`", file.path, used.line, used.text));
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn the_plant_sees_only_the_ports_and_the_units_of_the_firmware() {
    let mut offences = Vec::new();
    for file in source_files("hal-sim/src") {
        if ["tool/", "bin/", "lib.rs"].iter().any(|free| file.path["hal-sim/src/".len()..].starts_with(free))
        {
            continue;
        }
        let all = tokens(&file.text);
        for used in named_below(&all, "scarab").into_iter().filter(|used| !PLANT.contains(&used.text)) {
            offences
                .push(format!("{}:{}: the plant may not use `scarab::{}`", file.path, used.line, used.text));
        }
        for used in named_below(&all, "crate").into_iter().filter(|used| used.text == "tool") {
            offences.push(format!("{}:{}: the plant may not use the tool", file.path, used.line));
        }
    }
    assert_none(&offences);
}

#[test]
fn only_the_doors_name_the_maths_library_and_unsafe_code() {
    let mut offences = Vec::new();
    for file in source_files("src").into_iter().chain(source_files("hal-sim/src")) {
        for token in tokens(&file.text) {
            let doors: &[&str] = match token.text {
                "libm" | "micromath" => &MATHS_DOORS,
                "unsafe" => &UNSAFE_ALLOWED,
                _ => continue,
            };
            if !doors.iter().any(|door| file.path.starts_with(door)) {
                offences.push(format!("{}:{}: `{}` outside {doors:?}", file.path, token.line, token.text));
            }
        }
    }
    assert_none(&offences);
}

/// Elsewhere an output could be an input of the same command, or be left half written.
#[test]
fn only_one_module_of_the_tool_writes_files() {
    const WRITERS: [[&str; 3]; 8] = [
        ["fs", "::", "write"],
        ["fs", "::", "rename"],
        ["fs", "::", "copy"],
        ["fs", "::", "create_dir"],
        ["fs", "::", "create_dir_all"],
        ["File", "::", "create"],
        ["File", "::", "options"],
        ["OpenOptions", "::", "new"],
    ];
    let mut offences = Vec::new();
    for file in source_files("hal-sim/src") {
        let all = tokens(&file.text);
        for three in all.windows(3).filter(|_| !file.path.starts_with("hal-sim/src/tool/files/")) {
            let names = [three[0].text, three[1].text, three[2].text];
            if WRITERS.contains(&names) {
                offences.push(format!("{}:{}: {} outside files/", file.path, three[0].line, names.concat()));
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn no_file_but_the_list_writes_a_fault_or_emergency_code() {
    let faults = FaultCode::ALL.map(FaultCode::number).into_iter();
    let codes: Vec<u16> = faults.chain(NoticeCode::ALL.map(NoticeCode::number)).collect();
    let mut offences = Vec::new();
    for file in source_files("src").into_iter().chain(source_files("hal-sim/src")) {
        if file.path == CODE_LIST || file.path.contains("/tests/") || file.path.ends_with("/tests.rs") {
            continue;
        }
        let sources = file.text.split("#[cfg(test)]").next().unwrap_or_default();
        for (number, line) in hexadecimals(sources) {
            if u16::try_from(number).is_ok_and(|number| codes.contains(&number)) {
                offences.push(format!("{}:{line}: the code {number:04X} outside {CODE_LIST}", file.path));
            }
        }
    }
    assert_none(&offences);
}

/// Hexadecimal numbers of a source, with their lines.
fn hexadecimals(source: &str) -> Vec<(u32, usize)> {
    let digits = |pair: &[Token<'_>]| {
        let text = pair[1].text.strip_prefix('x').filter(|_| pair[0].text == "0")?;
        let number: String = text.chars().filter(|c| *c != '_').take_while(char::is_ascii_hexdigit).collect();
        Some((u32::from_str_radix(&number, 16).ok()?, pair[1].line))
    };
    tokens(source).windows(2).filter_map(digits).collect()
}

#[test]
fn a_hexadecimal_number_is_seen_with_its_line() {
    assert_eq!(hexadecimals("let a = 0x8130;\n// 0x2310\nf(0xFF_01_u16, x81)"), [(0x8130, 1), (0xFF01, 3)]);
}

#[test]
fn no_source_file_is_longer_than_nine_hundred_lines() {
    let offences: Vec<String> = source_files("src")
        .into_iter()
        .chain(source_files("hal-sim/src"))
        .map(|file| (file.text.lines().count(), file.path))
        .filter(|(lines, _)| *lines > LARGEST_LINE_COUNT)
        .map(|(lines, path)| format!("{path}: {lines} lines, split it by meaning"))
        .collect();
    assert_none(&offences);
}

#[test]
fn no_file_names_a_path_of_one_machine() {
    let mut offences = Vec::new();
    for file in text_files() {
        for (number, line) in file.text.lines().enumerate() {
            if let Some(found) = machine_path(line) {
                offences.push(format!("{}:{}: {found}", file.path, number + 1));
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn a_use_is_seen_in_a_group_in_a_path_and_through_super() {
    let used = |source: &str, depth| -> Vec<String> {
        rooms_used(source, depth).iter().map(|token| token.text.to_owned()).collect()
    };
    assert_eq!(
        used("use crate::{leg::Leg, model::{chain, servo as s}, swarm};", 1),
        ["leg", "model", "swarm"]
    );
    assert_eq!(used("fn f() -> crate::ident::Report { crate::motion() }", 1), ["ident", "motion"]);
    assert_eq!(used("use super::super::safety::Limits; use super::servo;", 2), ["safety"]);
    assert_eq!(used("use super::{leg, super::x};", 1), ["leg"]);
    assert_eq!(
        used("//! [`crate::leg`]\nuse heapless::Vec; // crate::ident\nlet s = \"crate::bus\";", 1),
        [""; 0]
    );
}

#[test]
fn a_machine_path_is_told_from_an_address() {
    let path = |folder: &str| ["/", folder, "/x"].concat();
    assert_eq!(machine_path(&format!("see {}", path("tmp"))), Some(FOLDERS_OF_ONE_MACHINE[0]));
    assert_eq!(machine_path(&format!("\"{}\"", path("root"))), Some(FOLDERS_OF_ONE_MACHINE[2]));
    assert_eq!(machine_path(&format!("https://example.org{}", path("home"))), None);
}

/// A text file and its path relative to the workspace, with forward slashes.
struct File {
    path: String,
    text: String,
}

/// Rust files below a folder of the workspace; at least one, or the test would check nothing.
fn source_files(folder: &str) -> Vec<File> {
    let mut files = Vec::new();
    collect(&workspace().join(folder), &["rs"], &mut files);
    assert!(!files.is_empty(), "no Rust file below {folder}");
    files
}

/// Files that people read or run: sources, documents, settings and scripts.
fn text_files() -> Vec<File> {
    let mut files = Vec::new();
    for folder in ["src", "hal-sim", "tests", "docs", "scripts", ".cargo"] {
        collect(&workspace().join(folder), &["rs", "md", "toml", "py", "sh", ""], &mut files);
    }
    for name in [
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "CITATION.cff",
        "Cargo.toml",
        "clippy.toml",
        "rust-toolchain.toml",
        "build.rs",
    ] {
        read(&workspace().join(name), &mut files);
    }
    files
}

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn collect(folder: &Path, extensions: &[&str], files: &mut Vec<File>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("");
        if path.is_dir() && !path.ends_with("target") {
            collect(&path, extensions, files);
        } else if path.is_file() && extensions.contains(&extension) {
            read(&path, files);
        }
    }
}

fn read(path: &Path, files: &mut Vec<File>) {
    if let Ok(text) = fs::read_to_string(path) {
        let relative = path.strip_prefix(workspace()).unwrap_or(path);
        files.push(File { path: relative.to_string_lossy().replace('\\', "/"), text });
    }
}

/// Module of a file: `src/model/chain.rs` and `src/model/mod.rs` belong to `model`, `src/hal.rs` to `hal`.
fn room_of(path: &str) -> &str {
    let inside = path.strip_prefix("src/").unwrap_or(path);
    inside.split(['/', '.']).next().unwrap_or(inside)
}

/// Depth of a file's module below the crate's root: 1 for a top module, 2 for a file in it.
fn module_depth(path: &str) -> usize {
    path.split('/').count() - if path.ends_with("/mod.rs") { 2 } else { 1 }
}

/// Every module that a file at `depth` names from the crate's root, by `crate::` or by enough `super::`.
fn rooms_used(source: &str, depth: usize) -> Vec<Token<'_>> {
    let all = tokens(source);
    let mut used = named_below(&all, "crate");
    for start in 0..all.len() {
        let supers = all[start..].chunks(2).take_while(|pair| {
            pair.first().is_some_and(|t| t.text == "super") && pair.get(1).is_some_and(|t| t.text == "::")
        });
        if supers.count() >= depth {
            let after = start + 2 * depth;
            used.extend(names_at(&all[after..]).into_iter().filter(|name| name.text != "*"));
        }
    }
    // The crate's own items (macros, constants) are not modules. In an inline module `super` may
    // mean the module itself, so there only a module's name counts. `crate::*` would allow
    // everything and always counts.
    used.retain(|name| name.text == "*" || HOUSE.iter().any(|(room, _)| *room == name.text));
    used
}

/// Names that follow `root::` anywhere: one, or each at the top level of a group in braces.
fn named_below<'a>(all: &[Token<'a>], root: &str) -> Vec<Token<'a>> {
    (0..all.len().saturating_sub(2))
        .filter(|&at| all[at].text == root && all[at + 1].text == "::")
        .flat_map(|at| names_at(&all[at + 2..]))
        .collect()
}

/// Name at the beginning of `rest`, or the first name of each member of a group there.
fn names_at<'a>(rest: &[Token<'a>]) -> Vec<Token<'a>> {
    if rest.first().is_none_or(|first| first.text != "{") {
        return rest.first().copied().into_iter().collect();
    }
    let (mut names, mut depth, mut begins) = (Vec::new(), 0, false);
    for token in rest {
        match token.text {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ if begins => names.push(*token),
            _ => {}
        }
        if depth == 0 {
            break;
        }
        begins = depth == 1 && (token.text == "{" || token.text == ",");
    }
    names
}

/// First folder in a line that exists on one machine only, unless it is part of an address.
fn machine_path(line: &str) -> Option<&'static str> {
    FOLDERS_OF_ONE_MACHINE.into_iter().find(|folder| {
        line.match_indices(folder)
            .any(|(at, _)| !line[..at].ends_with(|before: char| before.is_alphanumeric()))
    })
}

fn assert_none(offences: &[String]) {
    assert!(offences.is_empty(), "\n{}", offences.join("\n"));
}
