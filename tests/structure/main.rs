//! Checks of the architecture: allowed dependencies between modules, and a few rules that no compiler checks.
//!
//! A module here is one at the top of a crate, or a folder of `src/ident/`. Which crate may use which is in
//! their manifests. The tables below are the design's. A change to them is a change of the architecture and
//! belongs in a commit of its own. Comments do not count as a use, unit tests do. A test that needs more
//! modules than its own may use belongs in `tests/`.

mod tokens;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use scarab::safety::{FaultCode, NoticeCode};
use tokens::{Token, tokens};

/// Modules of the firmware; the open ones are allowed to all.
const FIRMWARE: [(&str, &[&str]); 22] = [
    ("units", &[]),
    ("real", &[]),
    ("in_place", &[]),
    ("listed", &[]),
    ("checksum", &[]),
    ("testing", &[]),
    ("hal", &[]),
    ("model", &[]),
    ("motion", &["model"]),
    ("swarm", &[]),
    ("ident", &["model", "motion", "swarm"]),
    ("motor", &["hal"]),
    ("safety", &["hal"]),
    ("servo", &["hal", "model", "motion", "motor", "safety"]),
    ("assist", &["model", "servo"]),
    ("leg", &["hal", "model", "motion", "swarm", "ident", "motor", "safety", "servo", "assist"]),
    ("trace", &["hal", "leg"]),
    ("store", &["hal", "leg"]),
    ("bus", &["hal", "leg"]),
    ("operation", &["hal", "motor", "leg", "safety", "servo", "trace", "bus"]),
    ("board", &["hal", "motor", "leg", "safety"]),
    ("task", &["hal", "motor", "leg", "operation", "safety", "servo", "trace", "store", "bus", "board"]),
];

/// Folders of `ident`: each uses only folders above it.
const IDENT: [(&str, &[&str]); 5] = [
    ("signal", &[]),
    ("record", &["signal"]),
    ("solve", &["signal", "record"]),
    ("judge", &["signal", "record", "solve"]),
    ("monitor", &["signal", "record", "solve", "judge"]),
];

/// Modules of the host's crates in layers: each uses its own layer and those before it.
const HOST: [(&str, &[&[&str]]); 4] = [
    (
        "host/client/src",
        &[
            &["bus", "slcan", "candump", "alarms", "wire", "report", "activity_words"],
            &["adapter"],
            &["master", "words"],
            &["other_hosts"],
            &["commission", "node_ids", "update"],
        ],
    ),
    ("host/identify/src", &[&["report"], &["formats"], &["leg"], &["run"]]),
    (
        "host/rig/src",
        &[
            &["image", "parameter_file", "report", "trace"],
            &["board", "faulty_board", "operator", "options", "pair", "perturb", "worn"],
            &["bus", "excite", "identified"],
            &["run_state", "scale", "shaking", "simulate", "watch"],
            &["assist", "identify", "monitor", "motor"],
            &["faults", "traced"],
        ],
    ),
    ("host/tool/src", &[&["battery", "eds", "excitation_constant", "live"], &["view"], &["cli"]]),
];

/// Firmware modules that every other firmware module may use.
const OPEN: [&str; 6] = ["units", "real", "in_place", "listed", "checksum", "testing"];

/// Source folders of all crates.
const SOURCES: [&str; 13] = [
    "src",
    "boot/src",
    "hal-sim/src",
    "host/base/src",
    "host/client/src",
    "host/identify/src",
    "host/rig/src",
    "host/tool/src",
    "paper/src",
    "chip/src",
    "chip/drivers/src",
    "readers/src",
    "python/src",
];

/// Firmware modules that the simulated hardware may use. The other crates may use all.
const PLANT: [&str; 2] = ["hal", "units"];

/// Files that may name the maths library, relative to the workspace.
const MATHS_MODULES: [&str; 2] = ["src/real.rs", "hal-sim/src/maths.rs"];

/// Files (and folders) that may contain `unsafe`: the hardware square root, in-place construction, the
/// boards' layers, the flash image's memory sections and interrupt vectors, the bootloader, and the program
/// that checks the chip model.
const UNSAFE_ALLOWED: [&str; 8] = [
    "src/real.rs",
    "src/in_place.rs",
    "src/board/",
    "src/task/memory.rs",
    "src/task/vectors.rs",
    "boot/src/main.rs",
    "chip/drivers/src/main.rs",
    "chip/drivers/src/processor.rs",
];

/// Absolute folders that exist on one machine only; split, so that this file does not name one itself.
const FOLDERS_OF_ONE_MACHINE: [&str; 4] =
    [concat!("/", "tmp/"), concat!("/", "work/"), concat!("/", "root/"), concat!("/", "home/")];

/// File with the list of all fault and emergency codes.
const CODE_LIST: &str = "src/safety/fault.rs";

/// Longest permitted file, lines; longer files are split by meaning.
const LARGEST_LINE_COUNT: usize = 900;

#[test]
fn every_module_uses_only_permitted_modules() {
    let mut offences = Vec::new();
    for (folder, root, table, open) in
        [("src", "crate", &FIRMWARE[..], &OPEN[..]), ("src/ident", "ident", &IDENT, &[])]
    {
        let modules: Vec<&str> = table.iter().map(|(name, _)| *name).collect();
        for file in source_files(folder) {
            let inside = &file.path[folder.len() + 1..];
            let module = module_of(inside);
            if ["lib", "main", "mod"].contains(&module) {
                continue;
            }
            let Some((_, allowed)) = table.iter().find(|(name, _)| *name == module) else {
                offences.push(format!("{}: module `{module}` is not in the table", file.path));
                continue;
            };
            for used in modules_used(&file.text, module_depth(inside), root, &modules) {
                if used.text != module && !open.contains(&used.text) && !allowed.contains(&used.text) {
                    offences
                        .push(format!("{}:{}: `{module}` may not use `{}`", file.path, used.line, used.text));
                }
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn folders_of_ident_are_listed_below_those_they_use() {
    for (index, (module, allowed)) in IDENT.iter().enumerate() {
        for used in *allowed {
            assert!(IDENT[..index].iter().any(|(name, _)| name == used), "`{module}` uses `{used}` below it");
        }
    }
}

#[test]
fn modules_of_the_host_use_their_layer_and_those_before_it() {
    let mut offences = Vec::new();
    for (folder, layers) in HOST {
        let modules = layers.concat();
        for file in source_files(folder) {
            let inside = &file.path[folder.len() + 1..];
            let module = module_of(inside);
            if ["lib", "main"].contains(&module) {
                continue;
            }
            let Some(layer) = layers.iter().position(|layer| layer.contains(&module)) else {
                offences.push(format!("{}: module `{module}` is not in the table", file.path));
                continue;
            };
            let allowed = layers[..=layer].concat();
            for used in modules_used(&file.text, module_depth(inside), "crate", &modules) {
                if !allowed.contains(&used.text) {
                    offences
                        .push(format!("{}:{}: `{module}` may not use `{}`", file.path, used.line, used.text));
                }
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn the_swarm_uses_only_the_maths_module_of_the_crate() {
    let modules = FIRMWARE.map(|(name, _)| name);
    let mut offences = Vec::new();
    for file in source_files("src/swarm") {
        for used in modules_used(&file.text, module_depth(&file.path["src/".len()..]), "crate", &modules) {
            if !["swarm", "real"].contains(&used.text) {
                offences.push(format!("{}:{}: `swarm` may not use `{}`", file.path, used.line, used.text));
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn the_plant_uses_only_ports_and_units_of_the_firmware() {
    let mut offences = Vec::new();
    for file in source_files("hal-sim/src") {
        let all = tokens(&file.text);
        for used in named_below(&all, "scarab").into_iter().filter(|used| !PLANT.contains(&used.text)) {
            offences
                .push(format!("{}:{}: the plant may not use `scarab::{}`", file.path, used.line, used.text));
        }
    }
    assert_none(&offences);
}

#[test]
fn only_listed_files_name_the_maths_library_or_unsafe_code() {
    let mut offences = Vec::new();
    for file in SOURCES.into_iter().flat_map(source_files) {
        for token in tokens(&file.text) {
            let doors: &[&str] = match token.text {
                "libm" => &MATHS_MODULES,
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

/// Elsewhere an output could be an input of the same command, or remain incomplete.
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
    for file in source_files("host").into_iter().chain(source_files("paper/src")) {
        let is_elsewhere = ["host/base/src/files/", "host/tool/tests/", "host/build.rs"]
            .iter()
            .any(|path| file.path.starts_with(path));
        let all = tokens(&file.text);
        for three in all.windows(3).filter(|_| !is_elsewhere) {
            let names = [three[0].text, three[1].text, three[2].text];
            if WRITERS.contains(&names) {
                offences.push(format!("{}:{}: {} outside files/", file.path, three[0].line, names.concat()));
            }
        }
    }
    assert_none(&offences);
}

#[test]
fn fault_and_emergency_codes_are_written_in_one_file_only() {
    let faults = FaultCode::ALL.map(FaultCode::number).into_iter();
    let codes: Vec<u16> = faults.chain(NoticeCode::ALL.map(NoticeCode::number)).collect();
    let mut offences = Vec::new();
    for file in SOURCES.into_iter().flat_map(source_files) {
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
fn a_hexadecimal_number_is_found_with_its_line() {
    assert_eq!(hexadecimals("let a = 0x8130;\n// 0x2310\nf(0xFF_01_u16, x81)"), [(0x8130, 1), (0xFF01, 3)]);
}

#[test]
fn no_source_file_is_longer_than_nine_hundred_lines() {
    let offences: Vec<String> = SOURCES
        .into_iter()
        .flat_map(source_files)
        .map(|file| (file.text.lines().count(), file.path))
        .filter(|(lines, _)| *lines > LARGEST_LINE_COUNT)
        .map(|(lines, path)| format!("{path}: {lines} lines, split it by meaning"))
        .collect();
    assert_none(&offences);
}

/// A file that no `mod` names is not compiled, and its tests look as if they passed.
#[test]
fn every_source_file_is_compiled() {
    let tests = ["tests", "hal-sim/tests", "host/tool/tests/tool", "paper/tests", "chip/tests"];
    let folders = SOURCES.into_iter().chain(tests);
    let files: Vec<_> = folders.flat_map(source_files).collect();
    let mut named = BTreeSet::new();
    for file in &files {
        let path = Path::new(&file.path);
        let folder = path.parent().unwrap_or(path);
        // A file's modules are beside it or in a folder of its name.
        let is_root = ["lib.rs", "main.rs", "mod.rs"].iter().any(|name| path.ends_with(name));
        let parent = if is_root { folder.to_owned() } else { path.with_extension("") };
        let modules = file.text.lines().filter_map(|line| {
            let line = line.trim().strip_suffix(';')?;
            Some(line.rsplit_once("mod ")?.1.to_owned())
        });
        for module in modules {
            named.insert(parent.join(format!("{module}.rs")));
            named.insert(parent.join(&module).join("mod.rs"));
        }
        let quoted = file.text.split("path = \"").skip(1).filter_map(|rest| rest.split_once('"'));
        named.extend(quoted.map(|(path, _)| folder.join(path)));
    }
    // Roots of crates, and programs of one file.
    let is_root = |path: &Path| {
        path.file_name().is_some_and(|name| name == "lib.rs" || name == "main.rs")
            || path.ends_with("chip/tests/processor.rs")
    };
    let offences: Vec<String> = files
        .iter()
        .map(|file| Path::new(&file.path))
        .filter(|path| !is_root(path) && !named.contains(*path))
        .map(|path| format!("{}: no `mod` names it", path.display()))
        .collect();
    assert_none(&offences);
}

/// First words of a comment that states no subject.
const VAGUE_BEGINNINGS: [&str; 6] = ["Of", "It", "The same", "Who", "They", "What of"];

/// Longest permitted comment line, columns.
const LARGEST_COMMENT_WIDTH: usize = 110;

#[test]
fn comments_begin_with_their_subject_and_are_at_most_110_columns_wide() {
    let mut offences = Vec::new();
    for folder in ["src", "hal-sim", "host", "paper", "chip", "readers", "python", "tests", "examples"] {
        for file in source_files(folder) {
            for (number, line) in file.text.lines().enumerate() {
                if let Some(why) = comment_offence(line) {
                    offences.push(format!("{}:{}: {why}", file.path, number + 1));
                }
            }
        }
    }
    assert_none(&offences);
}

/// Reason why a line is a bad comment; `None` for other lines.
fn comment_offence(line: &str) -> Option<String> {
    let text = line.trim_start().strip_prefix("//")?;
    let width = line.chars().count();
    if width > LARGEST_COMMENT_WIDTH {
        return Some(format!("{width} columns, at most {LARGEST_COMMENT_WIDTH}"));
    }
    let text = text.strip_prefix(['/', '!']).unwrap_or(text);
    let words = text.strip_prefix(' ')?.trim_start();
    let begins_with = |beginning: &&str| {
        words
            .strip_prefix(*beginning)
            .is_some_and(|rest| !rest.starts_with(|next: char| next.is_alphanumeric()))
    };
    let beginning = VAGUE_BEGINNINGS.into_iter().find(begins_with)?;
    Some(format!("begins with `{beginning}`: name the subject"))
}

#[test]
fn a_comment_with_a_vague_beginning_or_a_long_line_is_found() {
    assert!(comment_offence("    /// Of its noise.").is_some());
    assert!(comment_offence("//! It's fast.").is_some());
    assert!(comment_offence("//   The same for the knee").is_some());
    assert!(comment_offence(&format!("// {}", "x".repeat(108))).is_some());
    assert_eq!(comment_offence(&format!("// {}", "x".repeat(107))), None);
    assert_eq!(comment_offence("/// Offset, rad. Itself constant."), None);
    assert_eq!(comment_offence("/// Iteration of the search."), None);
    assert_eq!(comment_offence("let a = 1; // It is one."), None);
}

/// Longest permitted sentence in README and docs, words.
const LARGEST_SENTENCE: usize = 35;

/// Folder of measured results, which may have longer sentences.
const LONG_SENTENCES_ALLOWED: &[&str] = &["docs/results/"];

#[test]
fn sentences_in_documents_have_at_most_35_words() {
    let mut documents = Vec::new();
    collect(&workspace().join("docs"), &["md"], &mut documents);
    for name in ["README.md", "CONTRIBUTING.md"] {
        read(&workspace().join(name), &mut documents);
    }
    assert!(documents.len() > 2, "no documents");
    let mut offences = Vec::new();
    for document in documents {
        if LONG_SENTENCES_ALLOWED.iter().any(|allowed| document.path.starts_with(allowed)) {
            continue;
        }
        for (line, words) in long_sentences(&document.text) {
            offences.push(format!("{}:{line}: a sentence of {words} words", document.path));
        }
    }
    assert_none(&offences);
}

/// The pages of bus and safety name tests in backticks: five or more words joined by underscores.
#[test]
fn tests_of_promises_exist() {
    let mut documents = Vec::new();
    for name in ["docs/bus.md", "docs/safety.md"] {
        read(&workspace().join(name), &mut documents);
    }
    let sources: Vec<File> = ["src", "tests", "host"].into_iter().flat_map(source_files).collect();
    let is_test = |name: &&str| {
        name.matches('_').count() > 3
            && name.chars().all(|letter| letter == '_' || letter.is_ascii_lowercase())
    };
    let mut named = 0;
    for document in &documents {
        for name in document.text.split('`').filter(is_test) {
            named += 1;
            let head = format!("fn {name}(");
            let exists = sources.iter().any(|source| source.text.contains(&head));
            assert!(exists, "{} names `{name}`, which does not exist", document.path);
        }
    }
    assert!(named > 10, "{named} tests named");
}

/// First line of the paragraph and word count of each sentence that is too long. Tables, headings and code
/// are skipped.
fn long_sentences(text: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let (mut begin, mut paragraph, mut in_code) = (1, String::new(), false);
    for (number, line) in text.lines().chain([""]).enumerate() {
        let line = line.trim();
        let is_fence = line.starts_with("```");
        in_code ^= is_fence;
        let is_apart = in_code || is_fence || line.is_empty() || line.starts_with(['|', '#', '<']);
        let item = line.split_once(' ').filter(|(mark, _)| {
            matches!(*mark, "-" | "*")
                || mark.strip_suffix('.').is_some_and(|number| number.parse::<u8>().is_ok())
        });
        if is_apart || item.is_some() {
            let counts = sentences(&paragraph).into_iter().filter(|words| *words > LARGEST_SENTENCE);
            found.extend(counts.map(|words| (begin, words)));
            paragraph.clear();
            begin = number + if is_apart { 2 } else { 1 };
        }
        if !is_apart {
            paragraph.push_str(item.map_or(line, |(_, rest)| rest));
            paragraph.push(' ');
        }
    }
    found
}

/// Word counts of a paragraph's sentences. A code span is a word.
fn sentences(paragraph: &str) -> Vec<usize> {
    let mut counts = vec![0];
    let spans = paragraph.split('`').enumerate();
    let plain: String = spans.map(|(index, text)| if index % 2 == 0 { text } else { "code" }).collect();
    for word in plain.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)) {
        *counts.last_mut().expect("never empty") += 1;
        if word.trim_end_matches([')', '*', '_', '"']).ends_with(['.', '!', '?', ':', ';']) {
            counts.push(0);
        }
    }
    counts
}

#[test]
fn a_long_sentence_is_found_across_lines_and_not_in_tables_or_code() {
    let words = "word ".repeat(18);
    assert_eq!(long_sentences(&format!("# Title\n\nFirst.\n{words}\n{words}end.\n")), [(3, 37)]);
    assert_eq!(
        long_sentences(&format!("{words}end.\n{words}end: {words}end.\n\n- {words}\n- {words}\n")),
        []
    );
    assert_eq!(long_sentences(&format!("| {words} {words} |\n```text\n{words} {words}\n```\n")), []);
    assert_eq!(long_sentences(&format!("{words} `{words} {words}` {words}\n")), [(1, 37)]);
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
fn a_use_is_found_in_groups_paths_and_through_super() {
    let used = |source: &str, depth| -> Vec<String> {
        modules_used(source, depth, "crate", &FIRMWARE.map(|(name, _)| name))
            .iter()
            .map(|token| token.text.to_owned())
            .collect()
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
fn uses_inside_ident_are_found_by_folder_and_by_item() {
    let used = |source: &str, depth| -> Vec<String> {
        modules_used(source, depth, "ident", &IDENT.map(|(name, _)| name))
            .iter()
            .map(|token| token.text.to_owned())
            .collect()
    };
    assert_eq!(used("use crate::ident::{judge::verdict, solve}; use crate::model;", 2), ["judge", "solve"]);
    assert_eq!(used("use crate::{ident::record::rows::Ends, leg};", 2), ["record"]);
    assert_eq!(
        used("use super::super::super::ident::solve; use super::super::monitor;", 2),
        ["solve", "monitor"]
    );
    assert_eq!(used("use super::factor::Factor; use super::judge::held_out;", 2), [""; 0]);
    assert_eq!(used("use super::judge::held_out;", 1), ["judge"]);
    assert_eq!(used("use crate::ident::Verdict; use super::super::Factor;", 2), ["Verdict", "Factor"]);
}

#[test]
fn a_machine_path_is_distinguished_from_a_web_address() {
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

/// Rust files below a folder of the workspace; fails if there are none, because nothing would be checked.
fn source_files(folder: &str) -> Vec<File> {
    let mut files = Vec::new();
    collect(&workspace().join(folder), &["rs"], &mut files);
    assert!(!files.is_empty(), "no Rust file below {folder}");
    files
}

/// Files that people read or run: sources, documents, settings and scripts.
fn text_files() -> Vec<File> {
    let mut files = Vec::new();
    for folder in ["src", "hal-sim", "host", "paper", "tests", "docs", "scripts", ".cargo"] {
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
fn module_of(inside: &str) -> &str {
    inside.split(['/', '.']).next().unwrap_or(inside)
}

/// Depth of a file's module below the root of its table: 1 for a module of the table, 2 for a file in it. The
/// path begins below the root's folder.
fn module_depth(inside: &str) -> usize {
    inside.split('/').count() - usize::from(inside.ends_with("/mod.rs"))
}

/// Every one of these modules that a file at `depth` names below `root`, by `root::` or by enough `super::`.
fn modules_used<'a>(source: &'a str, depth: usize, root: &str, modules: &[&str]) -> Vec<Token<'a>> {
    let all = tokens(source);
    let mut used = named_below(&all, root);
    for start in 0..all.len() {
        let supers = all[start..].chunks(2).take_while(|pair| {
            pair.first().is_some_and(|t| t.text == "super") && pair.get(1).is_some_and(|t| t.text == "::")
        });
        if supers.count() == depth {
            let after = start + 2 * depth;
            used.extend(names_at(&all[after..]).into_iter().filter(|name| !["*", root].contains(&name.text)));
        }
    }
    // The crate's own items (macros, constants) are not modules. In an inline module `super` may
    // mean the module itself, so there only a module's name counts. `crate::*` would allow
    // everything and always counts. An item that `ident` re-exports may come from any of its folders,
    // so every name below `ident` counts.
    if root == "crate" {
        used.retain(|name| name.text == "*" || modules.contains(&name.text));
    }
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
