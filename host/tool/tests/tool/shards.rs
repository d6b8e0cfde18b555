//! Campaigns divided into shards: joined, they equal the undivided ones to the last digit.

use std::sync::OnceLock;

use serde_json::{Value, json};

use crate::command::{Folder, Run, assert_contains, scarab};

/// Everything that a campaign prints and writes, but for times.
#[derive(Debug, PartialEq)]
struct Outcome {
    code: Option<i32>,
    printed: String,
    json: String,
    page: String,
}

/// Lines that say how long computing took.
const TIMES: [&str; 3] = ["\"wall_s\"", "simulated time over time on one core", "time needed: "];

fn timeless(text: &str) -> String {
    let is_kept = |line: &&str| !TIMES.iter().any(|words| line.contains(words));
    text.lines().filter(is_kept).map(|line| format!("{line}\n")).collect()
}

fn outcome(folder: &Folder, run: &Run, name: &str) -> Outcome {
    let read = |extension: &str| folder.read(&format!("{name}.{extension}"));
    let page = read("html");
    let (before, rest) = page.split_once("<p class=\"when\">").expect("a time");
    let (_, after) = rest.split_once("</p>").expect("its end");
    let printed = run.printed.replace(&format!("{name}.html"), "page.html");
    Outcome {
        code: run.code,
        printed: timeless(&printed),
        json: timeless(&read("json")),
        page: format!("{before}{after}"),
    }
}

/// Runs the program with outputs of this name.
fn with_outputs(folder: &Folder, arguments: &str, name: &str) -> Outcome {
    let run = folder.scarab(&format!("{arguments} --json @{name}.json --report @{name}.html"));
    assert!(matches!(run.code, Some(0 | 3)), "{arguments}: {}{}", run.printed, run.errors);
    outcome(folder, &run, name)
}

/// Runs the shard of this number and writes `NUMBER.json`.
fn shard(folder: &Folder, arguments: &str, number: usize, count: usize) {
    folder.scarab(&format!("{arguments} --shard {number}/{count} --json @{number}.json")).ends_with(0);
}

/// Arguments of one campaign; the order of the options does not matter.
const IDENTIFY: [&str; 2] =
    ["identify --seeds 4..6 --prior wrong:40", "identify --prior wrong:40 --seeds 4..6"];

/// Texts of the two shards of that campaign, and of its undivided JSON.
fn texts() -> &'static [String; 3] {
    static TEXTS: OnceLock<[String; 3]> = OnceLock::new();
    TEXTS.get_or_init(|| {
        let folder = Folder::new();
        shard(&folder, IDENTIFY[0], 1, 2);
        shard(&folder, IDENTIFY[1], 2, 2);
        let whole = with_outputs(&folder, IDENTIFY[0], "whole");
        let joined = with_outputs(&folder, "merge @2.json @1.json", "joined");
        assert_eq!(joined, whole);
        assert!(
            whole.page.contains("cargo sim identify --prior wrong:40 --seeds 4..6</code>"),
            "its command"
        );
        ["1.json", "2.json", "whole.json"].map(|name| folder.read(name))
    })
}

#[test]
fn joined_identifications_equal_the_undivided_ones_to_the_last_digit() {
    let [first, second, whole] = texts().each_ref().map(|text| {
        serde_json::from_str::<Value>(text).expect("JSON")["runs"].as_array().expect("a list").clone()
    });
    assert_eq!((first.len(), second.len(), whole.len()), (1, 2, 3));
}

#[test]
#[ignore = "campaign: .ci/full"]
fn joined_fault_campaigns_equal_the_undivided_ones_to_the_last_digit() {
    for (arguments, shards) in [
        (
            "faults --seconds 0.2 --fault X1 --fault E4 --fault E3 --seeds 5 --sweep 4 --pairs 2 --every-tick --hours 0.0005",
            3,
        ),
        ("faults --seconds 1 --fault C2 --fault H1 --fault T1 --seeds 3 --blind", 2),
    ] {
        let folder = Folder::new();
        (1..=shards).for_each(|number| shard(&folder, arguments, number, shards));
        let files: String = (1..=shards).map(|number| format!(" @{number}.json")).collect();
        let whole = with_outputs(&folder, arguments, "whole");
        let joined = with_outputs(&folder, &format!("merge{files}"), "joined");
        assert_eq!(joined, whole, "{arguments}");
    }
}

/// One of the campaign's files and changes of its JSON.
type Changed = (usize, Vec<(&'static str, Value)>);

/// Merges these files; returns the message.
fn refusal(shards: &[Changed], further: &str) -> String {
    let folder = Folder::new();
    let mut line = format!("merge {further}");
    for (number, (shard, changes)) in shards.iter().enumerate() {
        let mut value: Value = serde_json::from_str(&texts()[*shard]).expect("JSON");
        for (pointer, new) in changes {
            *value.pointer_mut(pointer).unwrap_or_else(|| panic!("no {pointer}")) = new.clone();
        }
        folder.write(&format!("{number}.json"), value.to_string());
        line += &format!(" @{number}.json");
    }
    folder.scarab(&line).refusal()
}

#[test]
fn shards_that_do_not_make_one_campaign_are_refused_with_what_differs() {
    let whole = |shard: usize| -> Changed { (shard, Vec::new()) };
    let with =
        |shard: usize, pointer: &'static str, value: Value| -> Changed { (shard, vec![(pointer, value)]) };
    let sources = |shard: usize| with(shard, "/campaign/program/sources", json!("2"));
    let one = "shards of one campaign differ in --shard only";
    for (shards, words) in [
        (
            vec![whole(0)],
            "1 of 2 shards given, missing: 2: name their files, or compute them with --shard 2/2",
        ),
        (vec![whole(0), whole(0), whole(1)], "both are shard 1 of 2: name each shard once"),
        (vec![whole(0), with(1, "/campaign/arguments/1/values/0", json!("4..7"))], one),
        (vec![whole(0), with(1, "/campaign/arguments/0/name", json!("--plan"))], one),
        (vec![whole(0), sources(1)], "compute all shards with one commit"),
        (vec![sources(0), sources(1)], "this program has the sources"),
        (vec![whole(0), with(1, "/shard/count", json!(3))], "is shard 2 of 3, "),
        (vec![whole(0), with(1, "/shard/index", json!(3))], "shard 3 of 2; shards are numbered from 1 to 2"),
        (vec![whole(0), with(1, "/schema", json!(2))], "schema 2, this program reads 1"),
        (
            vec![with(0, "/runs", json!([])), whole(1)],
            "runs: 0 runs, 1 are due, which are not the results of shard 1 of 2",
        ),
        (vec![with(0, "/runs/0/seed", json!(9)), whole(1)], "a run of seed 9, 4 is due"),
        (vec![with(0, "/runs/0/rank", json!("many")), whole(1)], "its results cannot be read"),
        (vec![with(0, "/campaign/command", json!("paper")), whole(1)], "join it with `cargo paper merge`"),
        (vec![whole(2), whole(1)], "is no shard of a campaign: missing field `shard`"),
    ] {
        let message = refusal(&shards, "");
        assert_contains(&message, words);
        let is_named = message.contains(".json: ") || words.contains("given") || words.contains("both");
        assert!(is_named, "{message}");
    }
    let message = refusal(&[whole(0), whole(1)], "--docs README.md");
    assert_contains(&message, "merge: shards of `identify`: unexpected argument '--docs");
}

#[test]
fn a_shard_that_does_not_exist_or_has_no_file_is_refused() {
    let folder = Folder::new();
    for (arguments, words) in [
        ("identify --seeds 1..2 --shard 0/2 --json", "shard 0 of 2; shards are numbered from 1 to 2"),
        ("identify --seeds 1..2 --shard 3/2 --json", "shard 3 of 2"),
        ("identify --seeds 1..2 --shard 1/0 --json", "0 shards"),
        ("faults --seeds 2 --shard two --json", "`two` is not I/N, for example 2/8"),
        ("identify --shard 1/2 --json", "--seeds"),
        ("identify --seeds 1..2 --shard 1/2 --report", "cannot be used with"),
        ("faults --replay 1 --shard 1/2 --json", "cannot be used with"),
        ("faults --shard 1/2 --docs", "cannot be used with"),
        ("merge", "cannot be read"),
    ] {
        folder.scarab(&format!("{arguments} @shard.json")).refuses(words);
    }
    scarab("identify --seeds 1..2 --shard 1/2").refuses("--json");
    assert!(!folder.path("shard.json").exists());
}
