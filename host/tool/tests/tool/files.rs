//! Files of every command: no input is overwritten, no file is written twice, and unwritable files
//! are reported before any computation.

use std::fs;
use std::path::PathBuf;

use scarab_rig::parameter_file::memory::BYTES;

use crate::command::{Folder, assert_contains, scarab};

/// Content of a file that a command must not modify.
const CONTENT: &str = "not to be touched";

/// Command with the options of its input files (empty: positional) and of its output files.
const COMMANDS: [(&str, &[&str], &[&str]); 16] = [
    (
        "replay",
        &["", "--leg", "--validate", "--compare-model"],
        &["--json", "--csv", "--report", "--save-model", "--figures"],
    ),
    (
        "identify",
        &["--leg", "--excitation", "--compare-model"],
        &["--json", "--log", "--report", "--save-model", "--figures"],
    ),
    (
        "trace",
        &["", "--image", "--leg", "--compare-model"],
        &["--json", "--csv", "--report", "--text", "--save-model", "--figures"],
    ),
    ("predict --states none.csv", &["--model", "--leg"], &["--out"]),
    ("predict --model none.toml", &["--states"], &["--out"]),
    ("export", &["--model", "--leg"], &["--urdf"]),
    ("excite", &["--leg", "--excitation"], &["--out", "--const", "--json"]),
    ("monitor", &["--leg"], &["--json"]),
    ("motor", &["--leg"], &["--json", "--figures"]),
    ("faults", &["--leg"], &["--json", "--report", "--docs"]),
    ("merge", &[""], &["--json", "--report", "--figures", "--docs"]),
    ("fw", &["--leg"], &["--json", "--source"]),
    ("serve --slcan 127.0.0.1:0", &["--leg"], &["--flash"]),
    ("kept export", &[""], &["--out"]),
    ("kept import", &["", ""], &[]),
    ("eds", &[], &["--out"]),
];

#[test]
fn no_command_overwrites_what_it_reads() {
    let folder = Folder::new();
    let file = folder.write("data.csv", CONTENT);
    let mut tried = 0;
    for (command, inputs, outputs) in COMMANDS {
        for (input, output) in
            inputs.iter().flat_map(|input| outputs.iter().map(move |output| (input, output)))
        {
            // `replay` and `export` need further files, which need not exist.
            let further = match (command, *input) {
                ("replay", "") => "--leg sp",
                ("replay", "--leg") => "none.csv",
                ("replay", _) => "--leg sp none.csv",
                ("trace", "--image" | "--leg" | "--compare-model") => "none.trace",
                ("export", "--leg") => "--model none.toml",
                ("predict --states none.csv", "--leg") => "--model none.toml",
                _ => "",
            };
            let line = format!("{command} {output} @data.csv {input} @data.csv {further}");
            let message = folder.scarab(&line).refusal();
            let expected = format!("error: {output} {}: ", file.display());
            assert!(message.starts_with(&expected), "{command} {input}: {message}");
            assert_contains(&message, "which the command reads");
            assert_eq!(folder.read("data.csv"), CONTENT, "{command} {input} {output}");
            tried += 1;
        }
    }
    println!("{tried} pairs of an input and an output");
    // Both files are positional.
    folder.scarab("kept import @data.csv @data.csv").refuses("which the command reads");
    assert_eq!(folder.read("data.csv"), CONTENT);
}

#[test]
fn no_command_writes_one_file_twice() {
    let folder = Folder::new();
    for (command, _, outputs) in COMMANDS {
        let pairs = outputs
            .iter()
            .enumerate()
            .flat_map(|(index, one)| outputs[index + 1..].iter().map(move |other| (*one, *other)));
        for (one, other) in pairs {
            let further = match command {
                "replay" => "--leg sp none.csv",
                "trace" => "none.trace",
                "merge" => "none.json",
                _ => "",
            };
            let line = format!("{command} {one} @result {other} @result {further}");
            let message = folder.scarab(&line).refusal();
            assert_contains(&message, "which the command writes as well");
            assert_contains(&message, one);
            assert_contains(&message, other);
            assert!(!folder.path("result").exists(), "{command} {one} {other}");
        }
    }
}

#[cfg(unix)]
#[test]
fn other_spellings_and_links_count_as_the_same_file() {
    use std::os::unix::fs::symlink;
    let folder = Folder::new();
    let file = folder.write("data.csv", CONTENT);
    fs::create_dir(folder.path("inner")).expect("a folder");
    symlink(&file, folder.path("link.csv")).expect("a link");
    symlink(folder.path(""), folder.path("inner/around")).expect("a link");
    fs::hard_link(&file, folder.path("hard.csv")).expect("a link");
    // Neither of them exists yet.
    symlink(folder.path("new.json"), folder.path("dangling.json")).expect("a link");
    let refused = |json: &str, csv: &str, what: &str| {
        folder.scarab(&format!("replay @data.csv --leg sp --json @{json} --csv @{csv}")).refuses(what);
        assert_eq!(folder.read("data.csv"), CONTENT);
    };
    for name in
        ["data.csv", "./data.csv", "inner/../data.csv", "inner/around/data.csv", "link.csv", "hard.csv"]
    {
        refused(name, "torque.csv", "which the command reads");
    }
    for name in ["new.json", "./new.json", "inner/../new.json", "inner/around/new.json", "dangling.json"] {
        refused(name, "new.json", "which the command writes as well");
    }
}

#[test]
fn a_folder_of_drawings_must_not_contain_other_outputs() {
    let folder = Folder::new();
    folder
        .scarab("identify --figures @drawn --report @drawn/identify.svg")
        .refuses("could overwrite --report");
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_the_input_is_read() {
    let folder = Folder::new();
    let file = folder.write("file", CONTENT);
    let locked = folder.write("locked.json", CONTENT);
    let mut permissions = fs::metadata(&locked).expect("there").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&locked, permissions).expect("own file");
    let mut cases: Vec<(&str, PathBuf, &str)> = vec![
        ("--json", folder.path("missing/run.json"), "does not exist"),
        ("--csv", folder.path("file/torque.csv"), "is not a folder"),
        ("--report", folder.path(""), "it is a folder"),
        ("--save-model", locked.clone(), "it is write-protected"),
        ("--figures", file.clone(), "it is a file, not a folder"),
        ("--figures", folder.path("file/drawn"), "is not a folder"),
    ];
    // Folder in which not even the superuser can create a file.
    if cfg!(target_os = "linux") {
        cases.push(("--json", PathBuf::from("/proc/run.json"), "no file can be created in the folder /proc"));
        cases.push(("--figures", PathBuf::from("/proc/drawn"), "no file can be created in the folder /proc"));
    }
    for (option, path, reason) in cases {
        // The recording does not exist: the output is checked first.
        let message = scarab(&format!("replay none.csv --leg sp {option} {}", path.display())).refusal();
        let expected = format!("error: {option} {}: cannot be written: ", path.display());
        assert!(message.starts_with(&expected) && message.contains(reason), "{message}");
    }
    for kept in ["file", "locked.json"] {
        assert_eq!(folder.read(kept), CONTENT);
    }
    assert_eq!(fs::read_dir(folder.path("")).expect("a folder").count(), 2, "a temporary file remains");
}

/// Flash of a board without stored data.
fn erased_flash(folder: &Folder) {
    fs::write(folder.path("flash.bin"), vec![0xFF; BYTES]).expect("a temporary file");
}

#[cfg(unix)]
#[test]
fn a_file_is_replaced_as_a_whole_and_links_remain() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = Folder::new();
    erased_flash(&folder);
    let file = folder.write("kept.toml", CONTENT);
    fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).expect("own file");
    // The other hard link still has the old content: the file was replaced, not overwritten.
    fs::hard_link(&file, folder.path("old.toml")).expect("a link");
    symlink(&file, folder.path("link.toml")).expect("a link");
    folder.scarab("kept export --out @link.toml @flash.bin").ends_with(0);
    let text = folder.read("kept.toml");
    assert!(text != CONTENT && !text.is_empty(), "{text}");
    assert_eq!(folder.read("old.toml"), CONTENT);
    assert!(folder.path("link.toml").is_symlink());
    assert_eq!(fs::metadata(&file).expect("there").permissions().mode() & 0o777, 0o640);
    let names: Vec<_> = fs::read_dir(folder.path("")).expect("a folder").flatten().collect();
    assert_eq!(names.len(), 4, "a temporary file remains: {names:?}");
}

#[test]
fn a_failed_run_does_not_change_its_output_file() {
    let folder = Folder::new();
    folder.write("kept.toml", CONTENT);
    folder.write("flash.bin", "too short");
    folder.scarab("kept export --out @kept.toml @flash.bin").refuses("flash.bin");
    assert_eq!(folder.read("kept.toml"), CONTENT);
}

#[cfg(target_os = "linux")]
#[test]
fn a_stream_is_written_to_and_not_replaced() {
    let folder = Folder::new();
    erased_flash(&folder);
    let printed = folder.scarab("kept export @flash.bin").ends_with(0).printed;
    let streamed = folder.scarab("kept export --out /dev/stdout @flash.bin").ends_with(0).printed;
    assert!(!printed.is_empty());
    assert_eq!(streamed, printed);
}

#[test]
fn a_created_folder_may_contain_other_outputs() {
    let folder = Folder::new();
    folder.scarab("eds --out @new/sheets").ends_with(0);
    assert_eq!(fs::read_dir(folder.path("new/sheets")).expect("made").count(), 2);
    // The drawings' folder does not exist yet, and the report lies in it: only the recording is missing.
    folder
        .scarab("replay none.csv --leg sp --figures @drawn --report @drawn/report.html")
        .refuses("none.csv: cannot be read");
    assert!(!folder.path("drawn").exists());
}
