//! Shards of the paper's runs: joined, their tables and JSON equal the undivided ones to the last digit.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{Folder, Run, scarab};

/// What a run prints, and its JSON.
fn outcome(arguments: &str, files: &[PathBuf], folder: &Folder, name: &str) -> (String, String) {
    let path = folder.path(name);
    let mut paths: Vec<&Path> = vec![Path::new("--json"), &path];
    paths.extend(files.iter().map(PathBuf::as_path));
    let run: Run = scarab(arguments, &paths).ends_with(0);
    (run.printed, fs::read_to_string(&path).expect("written"))
}

fn shard(arguments: &str, folder: &Folder, index: u64) -> PathBuf {
    let path = folder.path(&format!("{index}.json"));
    scarab(&format!("{arguments} --shard {index}/2 --json"), &[&path]).ends_with(0);
    path
}

/// All divided parts and one that is not. Of three runs one shard has one and the other two.
#[test]
fn joined_tables_equal_the_undivided_ones_to_the_last_digit() {
    for arguments in [
        "--table III --table IV --algorithm bso --algorithm pso --seeds 3",
        "--table V --table load-change --seeds 3",
        "--figure 7 --table convergence --seeds 2",
    ] {
        let folder = Folder::new();
        let files = [2, 1].map(|index| shard(arguments, &folder, index));
        let whole = outcome(arguments, &[], &folder, "whole.json");
        let joined = outcome("merge", &files, &folder, "joined.json");
        assert_eq!(joined, whole, "{arguments}");
    }
}

#[test]
fn shards_that_do_not_make_one_campaign_are_refused() {
    let folder = Folder::new();
    let first = shard("--table IV --algorithm bas --seeds 2", &folder, 1);
    let second = shard("--table IV --algorithm bas --seeds 3", &folder, 2);
    let (written, whole) = (folder.path("joined.json"), folder.write("whole.json", "{\"schema\":1}"));
    let message = scarab("merge --json", &[&written, &first, &second]).refusal();
    assert!(message.contains("--seeds is `3`") && message.contains("`2`"), "{message}");
    let message = scarab("merge", &[&first]).refusal();
    assert!(message.contains("1 of 2 shards given, missing: 2"), "{message}");
    let message = scarab("merge", &[&whole]).refusal();
    assert!(message.contains("whole.json: is no shard of a campaign"), "{message}");
    let message = scarab("merge --json", &[&first, &first, &second]).refusal();
    assert!(message.contains("which the command reads and would overwrite"), "{message}");
    let message = scarab("--table III --figure 5 --shard 1/2 --json", &[&written]).refusal();
    assert!(message.contains("--shard: table III and figure 5"), "{message}");
    assert!(!written.exists());
}
