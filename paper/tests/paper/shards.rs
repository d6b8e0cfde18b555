//! Shards of the paper's runs: joined, their tables and JSON equal the undivided ones to the last digit.

use crate::command::Folder;

/// What a run prints, and its JSON.
fn outcome(arguments: &str, folder: &Folder) -> (String, String) {
    let run = folder.scarab(&format!("{arguments} --json @joined.json")).ends_with(0);
    (run.printed, folder.read("joined.json"))
}

/// Writes `INDEX.json`.
fn shard(arguments: &str, folder: &Folder, index: u64) {
    folder.scarab(&format!("{arguments} --shard {index}/2 --json @{index}.json")).ends_with(0);
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
        [2, 1].into_iter().for_each(|index| shard(arguments, &folder, index));
        let whole = outcome(arguments, &folder);
        assert_eq!(outcome("merge @2.json @1.json", &folder), whole, "{arguments}");
    }
}

#[test]
fn shards_that_do_not_make_one_campaign_are_refused() {
    let folder = Folder::new();
    shard("--table IV --algorithm bas --seeds 2", &folder, 1);
    shard("--table IV --algorithm bas --seeds 3", &folder, 2);
    folder.write("whole.json", "{\"schema\":1}");
    let message = folder.scarab("merge --json @joined.json @1.json @2.json").refusal();
    assert!(message.contains("--seeds is `3`") && message.contains("`2`"), "{message}");
    for (arguments, words) in [
        ("merge @1.json", "1 of 2 shards given, missing: 2"),
        ("merge @whole.json", "whole.json: is no shard of a campaign"),
        ("merge --json @1.json @1.json @2.json", "which the command reads and would overwrite"),
        ("--table III --figure 5 --shard 1/2 --json @joined.json", "--shard: table III and figure 5"),
    ] {
        folder.scarab(arguments).refuses(words);
    }
    assert!(!folder.path("joined.json").exists());
}
