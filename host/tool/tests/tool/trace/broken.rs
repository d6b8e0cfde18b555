//! Traces from the field: late, with gaps, truncated, with a logger's text around them, of another leg, with
//! faults.

use std::path::Path;

use scarab_rig::traced::run::StreamReader;
use scarab_rig::traced::run_report;

use super::session::{RecordWriter, accepted, default_leg, quiet, read, text};
use crate::command::{Folder, assert_contains};
use scarab::trace::Record;

#[test]
fn a_truncated_trace_reports_how_far_it_went() {
    const CUTS: usize = 200;
    let (whole, leg) = (text(&quiet()), default_leg());
    let result_end = whole.find("\nend n=").expect("an end");
    let mut words = std::collections::BTreeSet::new();
    for cut in 0..CUTS {
        let length = whole.len() * cut / CUTS;
        let mut reader = StreamReader::new(None);
        reader.feed(&whole.as_bytes()[..length]).expect("nothing is written");
        let reported = reader.finish(Path::new("cut")).and_then(|trace| run_report(&trace, &leg));
        let complete = length > result_end + "\nend n=1000 records=999".len();
        match reported {
            Ok(run) => assert!(complete && run.verdict == "accepted", "{length}"),
            Err(error) => {
                assert!(!complete, "{length}: {error}");
                assert_eq!(error.exit_code(), 2);
                let text = error.to_string();
                let kind = [
                    "contains no trace record",
                    "holds no result",
                    "ends while searching at iteration",
                    "breaks off",
                ];
                let kind = kind.iter().find(|kind| text.contains(**kind));
                words.insert(*kind.unwrap_or_else(|| panic!("{length}: {text}")));
            }
        }
    }
    assert_eq!(words.len(), 4, "not every way to end occurred: {words:?}");
}

#[test]
fn the_beginning_of_an_overlong_line_is_not_a_record() {
    let read = |lines: &[String]| {
        let mut reader = StreamReader::new(None);
        reader.feed(text(lines).as_bytes()).expect("nothing is written");
        reader.finish(Path::new("trace")).expect("records")
    };
    let mut lines = quiet();
    let whole = read(&lines);
    let last = lines.last_mut().expect("a record");
    *last = format!("{last} {}", "x".repeat(64 * 1024));
    let trace = read(&lines);
    assert_eq!((trace.records, trace.lines), (whole.records - 1, whole.lines));
}

#[test]
fn lost_records_are_reported_by_number_and_invalidate_a_result() {
    let lines = quiet();
    // Gap before the result: the gap is reported, and the result is valid.
    let mut gap = lines.clone();
    gap.drain(5..8);
    let trace = read(&gap);
    assert_eq!((trace.lost(), trace.gaps[0].first, trace.gaps[0].last), (3, 5, 7));
    assert!(trace.warnings().iter().any(|words| words.contains("3 records are LOST (n = 5-7)")));
    assert_eq!(run_report(&trace, &default_leg()).expect("complete").trace.expect("a trace").lost_records, 3);
    // Without any one record of the result, the result is not reported.
    let begin = lines.iter().position(|line| line.starts_with("solver ")).expect("a solver");
    let end = lines.iter().position(|line| line.starts_with("end ")).expect("an end");
    for lost in (begin..=end).step_by(7).chain([begin, end]) {
        let mut gap = lines.clone();
        gap.remove(lost);
        let trace = read(&gap);
        assert_eq!((trace.lost(), trace.results.len()), (1, 0), "{}", lines[lost]);
        let error = run_report(&trace, &default_leg()).expect_err("incomplete").to_string();
        assert_contains(&error, "holds no complete result");
    }
    // Listener that joined late.
    let trace = read(&lines[4..]);
    assert_eq!((trace.unheard, trace.lost(), trace.results.len()), (4, 0, 1));
}

#[test]
fn an_unreadable_line_is_reported_with_its_number() {
    let mut lines = quiet();
    lines.insert(3, "state n=3 tick=1x drive=a activity=b phase=c motion=0".into());
    lines.insert(4, "later_kind n=4 anything=1".into());
    lines.insert(5, "state n=5 tick=12 drive=".into());
    lines.insert(6, "state n=6 tick=12 drive=a activity=b".into());
    let trace = read(&lines);
    let reported = trace.problems.join("\n");
    for words in [
        "line 4: `state`: the value of `tick` cannot be read",
        "line 6: `state`: `drive=` is not key=value",
        "line 7: `state`: `phase` is missing",
    ] {
        assert_contains(&reported, words);
    }
    assert_eq!(trace.unknown, 1);
}

#[test]
fn an_unknown_value_is_null_not_zero() {
    let lines: Vec<String> = quiet()
        .into_iter()
        .map(|line| match line.split_once(" symbol=FV ") {
            Some((before, after)) if line.starts_with("parameter ") => {
                let rest = after.split_once(' ').expect("more keys").1;
                format!("{before} symbol=FV value=NaN {rest}")
            }
            _ => line,
        })
        .collect();
    let run = run_report(&read(&lines), &default_leg()).expect("complete");
    let known =
        |name: &str| run.parameters.iter().find(|found| found.name == name).expect(name).value.known();
    assert_eq!((known("FV1"), known("FV2")), (None, None));
    assert!(known("FC1").is_some());
}

#[test]
fn faults_and_crashes_are_printed_before_tables_and_after_verdict() {
    let mut writer = RecordWriter { lines: quiet() };
    writer.write(&Record::Fault { tick: 400_000, code: 0x8400, name: "overspeed", joint: 2 });
    writer.write(&Record::AxisFault { tick: 400_004, joint: 0, name: "brake_resistor" });
    writer.loops(3);
    let boot = writer.lines.len();
    let mut after = RecordWriter::default();
    after.boot();
    after.write(&Record::Crash {
        cause: "panic",
        pc: 0x0800_1234,
        lr: 0x0800_0420,
        status: 0,
        address: u32::MAX,
        line: 77,
        file: "control.rs",
        released: 1_000,
        kept: 1_300,
    });
    let lines = [writer.lines, after.lines].concat();
    assert!(boot < lines.len());
    let folder = Folder::new();
    folder.write("trace.txt", text(&lines));
    let (run, report) = folder.reported("trace @trace.txt --report @reported.html", 0);
    let page = folder.read("reported.html");
    let alarm = page.find("3 faults of the drive").expect("the page begins with the faults");
    assert!(alarm < page.find("The model explains").expect("a verdict"));
    let (before, behind) = run.printed.split_once("verdict: accepted").expect("a verdict");
    for words in [
        "FAULT 0x8400 overspeed: joint 2",
        "FAULT of the axis, brake resistor: the board",
        "the image CRASHED before this start: panic in control.rs line 77, at 0x08001234",
        "bridges off 300 cycles before the record was complete",
    ] {
        assert!(before.contains(words) && behind.contains(words), "{words}\n{}", run.printed);
    }
    assert_contains(behind, "ATTENTION, 3 faults");
    assert_contains(behind, "3 servo ticks were MISSED");
    let reported = &report["trace"];
    assert_eq!(reported["faults"].as_array().map(Vec::len), Some(3), "{reported}");
    assert_eq!(
        (&reported["loops"]["servo_missed"], &reported["loops"]["servo_worst"]),
        (&3.into(), &21_000.into())
    );
    assert_contains(before, "worst servo tick 21000 of 42000 cycles (50.0 %)");
}

#[test]
fn bad_input_is_refused_with_its_reason() {
    let folder = Folder::new();
    folder.write("trace.txt", text(&quiet()));
    folder.write("empty.txt", "nothing here\n");
    // Image of another leg under this leg's name: joints or base parameters differ.
    let other: Vec<String> =
        quiet().iter().map(|line| line.replace("symbol=FC grouped", "symbol=FV grouped")).collect();
    folder.write("other.txt", text(&other));
    // Trace that does not name its leg.
    folder.write("nameless.txt", text(&quiet()[1..]));
    for (arguments, words) in [
        ("@trace.txt --leg sp", "the image is built for the leg `x2-wearer-75kg`"),
        ("@trace.txt --leg none-such", "not the name of a shipped leg"),
        ("@trace.txt --csv @log.csv", "holds no log of a motion"),
        ("@empty.txt", "contains no trace record"),
        ("@none.txt", "cannot be read"),
        ("@other.txt", "its base parameter"),
        ("@nameless.txt", "--leg"),
    ] {
        folder.scarab(&format!("trace {arguments}")).ends_with(2).warns(words);
    }
    folder.scarab("trace @nameless.txt --leg x2-wearer-75kg").ends_with(0);
    assert!(accepted().len() > quiet().len());
}
