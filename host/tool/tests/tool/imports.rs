//! Recordings as people have them: other names, units, delimiters, packing, and rows that are skipped.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use scarab::real::sin_cos;
use scarab_identify::formats::recording::import::{Drive, Import};
use scarab_identify::formats::recording::{JointSeries, Read, Recording};

use crate::command::{Folder, Run, assert_contains, scarab};
use crate::pendulum::{Motion, finds_the_truth, leg};

const FILE: &str = "walk.csv";

/// Reading of one joint with these options.
fn import(columns: &str, units: &str) -> Import {
    let parsed = |text: &str| -> Vec<String> {
        text.split(',').filter(|part| !part.is_empty()).map(str::to_owned).collect()
    };
    let columns: Vec<_> = parsed(columns).iter().map(|part| part.parse().expect("a column")).collect();
    let units: Vec<_> = parsed(units).iter().map(|part| part.parse().expect("a unit")).collect();
    Import::plain(1).with(&columns, &units).expect("no contradiction")
}

fn read(text: &str, import: &Import) -> Result<Read, String> {
    Recording::parse_as(Path::new(FILE), text, import).map_err(|error| error.to_string())
}

fn refusal(text: &str, import: &Import) -> String {
    match read(text, import) {
        Ok(_) => panic!("accepted:\n{text}"),
        Err(message) => message,
    }
}

/// Time, angle and torque of sample `k`, in SI units.
fn sample(k: u32) -> [f64; 3] {
    let time = f64::from(k) / 64.0;
    [time, 0.5 * sin_cos(3.0 * time).0, 4.0 - 0.125 * f64::from(k % 50)]
}

/// 200 samples at 64 Hz as a text; `row` writes one.
fn text(header: &str, row: impl Fn([f64; 3]) -> String) -> String {
    let rows: Vec<String> = (0..200).map(|k| row(sample(k))).collect();
    format!("{header}{}\n", rows.join("\n"))
}

fn plain([time, angle, torque]: [f64; 3]) -> String {
    format!("{time},{angle},{torque}")
}

/// Fails unless every sample is that of [`sample`] to a few units in the last place.
fn assert_restored(recording: &Recording) {
    assert_eq!(recording.time_s.len(), 200);
    let JointSeries { position_rad, torque_nm } = &recording.joints[0];
    for (k, values) in recording.time_s.iter().zip(position_rad).zip(torque_nm).enumerate() {
        let ((time, angle), torque) = values;
        for (value, expected) in [time, angle, torque].into_iter().zip(sample(k as u32)) {
            assert!((value - expected).abs() <= 1e-14 * expected.abs(), "sample {k}: {value} {expected}");
        }
    }
}

#[test]
fn columns_are_chosen_by_name_or_number() {
    let text =
        text("torque,time,note,angle\n", |[time, angle, torque]| format!("{torque},{time},up,{angle}"));
    for columns in ["t=time,q1=angle,tau1=torque", "t=2,q1=4,tau1=1", "t=time,q1=4,tau1=torque"] {
        let read = read(&text, &import(columns, "")).expect(columns);
        assert_restored(&read.recording);
        let names: Vec<_> = read.report.columns.iter().map(|column| column.column.as_str()).collect();
        assert_eq!(names, ["time", "angle", "torque"]);
    }
    assert_eq!(
        refusal(&text, &import("t=5,q1=4,tau1=1", "")),
        "walk.csv:1: --columns t=5: the file has 4 columns"
    );
    let message = refusal(&text, &import("t=stamp,q1=4,tau1=1", ""));
    assert!(
        message.starts_with("walk.csv:1: the header has no column `stamp`; its columns are: torque,"),
        "{message}"
    );
}

#[test]
fn units_convert_to_si_and_are_reported() {
    let row =
        |[time, angle, torque]: [f64; 3]| format!("{},{},{}", 1e3 * time, angle.to_degrees(), 1e3 * torque);
    let by_name =
        read(&text("t_ms,q1_deg,tau1_mNm\n", row), &import("", "ms,deg,mNm")).expect("named by unit");
    assert_restored(&by_name.recording);
    let chosen =
        read(&text("a,b,c\n", row), &import("t=a,q1=b,tau1=c", "t=ms,q1=deg,tau1=mNm")).expect("chosen");
    assert_restored(&chosen.recording);
    let reported: BTreeMap<_, _> = chosen
        .report
        .columns
        .iter()
        .map(|column| (column.signal.as_str(), (column.unit.as_str(), column.factor)))
        .collect();
    let degree = std::f64::consts::PI / 180.0;
    assert_eq!(
        reported,
        BTreeMap::from([("t", ("ms", 1e-3)), ("q1", ("deg", degree)), ("tau1", ("mNm", 1e-3))])
    );
    assert!(chosen.report.is_notable());
    assert!(!read(&text("t_s,q1_rad,tau1_Nm\n", plain), &import("", "")).expect("plain").report.is_notable());
}

#[test]
fn a_unit_in_a_name_that_contradicts_the_one_in_use_is_refused() {
    let text = text("t_s,angle_deg,tau1_Nm\n", plain);
    let message = refusal(&text, &import("q1=angle_deg", ""));
    assert_eq!(
        message,
        "walk.csv:1: column `angle_deg` is in deg by its name or type, but q1 is read in rad. If these columns are meant, \
         repeat the command with them:\n  cargo sim replay --columns t=t_s,q1=angle_deg,tau1=tau1_Nm --units s,deg,Nm"
    );
    // Stated on the command line, the user's word counts.
    assert_restored(&read(&text, &import("q1=angle_deg", "rad")).expect("stated").recording);
}

#[test]
fn times_in_another_unit_are_refused_with_the_complete_command() {
    let since_1970 = 1.7e9;
    for (from_s, unit, per_s) in [
        (since_1970, "ms", 1e3),
        (since_1970, "us", 1e6),
        (since_1970, "ns", 1e9),
        // In range until ten seconds.
        (9.0, "ns", 1e9),
    ] {
        let text = text("t_s,q1_rad,tau1_Nm\n", |[time, angle, torque]| {
            format!("{:.0},{angle},{torque}", per_s * (from_s + time))
        });
        let skipping = Import { skip_bad: true, ..import("", "") };
        for import in [&import("", ""), &skipping] {
            let message = refusal(&text, import);
            let command =
                format!("cargo sim replay --columns t=t_s,q1=q1_rad,tau1=tau1_Nm --units {unit},rad,Nm");
            assert_contains(&message, &format!(": is the time in {unit}? Then it would be 6"));
            assert!(message.ends_with(&command), "{unit}: {message}");
        }
        let read = read(&text, &import("t=t_s,q1=q1_rad,tau1=tau1_Nm", &format!("{unit},rad,Nm")));
        assert_eq!(read.expect(unit).recording.time_s.len(), 200);
    }
    // A damaged first row is one row's.
    let damaged = with_bad(&[(1, "1e300,0,4")]);
    assert!(
        refusal(&damaged, &import("", ""))
            .starts_with("walk.csv:2: 1e300 in column `t_s` exceeds 1e10: is it in")
    );
    let skipping = Import { skip_bad: true, ..import("", "") };
    assert_eq!(read(&damaged, &skipping).expect("one row").report.skipped, 1);
}

#[test]
fn fields_between_any_number_of_spaces_are_read() {
    let spaced = |[time, angle, torque]: [f64; 3]| format!("  {time}   {angle} {torque}");
    let named = text("t_s  q1_rad  tau1_Nm\n", spaced);
    assert_restored(&read(&named, &import("", "")).expect("a header of words").recording);
    let numbers = text("", |values| spaced(values).replace('.', ","));
    let numbered = import("t=1,q1=2,tau1=3", "");
    let read = read(&numbers, &numbered).expect("numbers with decimal commas");
    assert_eq!(read.report.format, "CSV with spaces, decimal commas");
    assert_restored(&read.recording);
}

#[test]
fn rows_without_times_are_read_at_a_stated_rate() {
    let untimed = |[_, angle, torque]: [f64; 3]| format!("{angle},{torque}");
    for (header, columns) in [("pos,effort\n", "q1=pos,tau1=effort"), ("", "q1=1,tau1=2")] {
        let text = text(header, untimed);
        let message = refusal(&text, &import("", ""));
        let words = if header.is_empty() { "If only the time is missing" } else { "has no column of time" };
        assert_contains(&message, words);
        assert!(
            message
                .lines()
                .any(|line| line.ends_with(&format!("--columns {columns} --units rad,Nm --rate HZ"))),
            "{message}"
        );
        let stated = Import { rate_hz: Some(64.0), ..import(columns, "") };
        assert_restored(&read(&text, &stated).expect("a rate").recording);
        // A skipped row leaves its time out.
        let damaged = text.replacen('\n', "\n-,-\n", 2);
        let skipping = Import { skip_bad: true, ..stated };
        let recording = read(&damaged, &skipping).expect("two damaged rows").recording;
        assert!(recording.duration_s() > 199.0 / 64.0, "{header}");
    }
    let timed = text("t_s,q1_rad,tau1_Nm\n", plain);
    let stated = Import { rate_hz: Some(64.0), ..import("", "") };
    assert_contains(&refusal(&timed, &stated), "the file has the column of time `t_s`: leave out --rate");
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let stated = Import { rate_hz: Some(rate), ..Import::plain(1) };
        assert!(stated.with(&[], &[]).is_err(), "{rate}");
    }
}

#[test]
fn messages_in_rows_of_their_own_are_joined_by_time() {
    // The torque is sent a third of a sample later.
    let line = |time: f64| 1.0 + 0.25 * time;
    let separate = text("t_s,q1_rad,tau1_Nm\n", |[time, angle, _]| {
        format!("{time},{angle},\n{},,{}", time + 1.0 / 192.0, line(time + 1.0 / 192.0))
    });
    let message = refusal(&separate, &import("", ""));
    assert_contains(&message, "angles and torques are in different rows");
    assert_contains(&message, "--merge-rows");
    let merging = Import { merge_rows: true, ..import("", "") };
    let read = read(&separate, &merging).expect("every signal is there").recording;
    // Before the first torque nothing is known.
    assert_eq!(read.time_s.len(), 199);
    for (index, (time, torque)) in read.time_s.iter().zip(&read.joints[0].torque_nm).enumerate() {
        let [at, angle, _] = sample(index as u32 + 1);
        assert_eq!((*time, read.joints[0].position_rad[index]), (at, angle));
        assert!((torque - line(at)).abs() < 1e-12, "{at}");
    }
    // One joint's torque is lost for a second: a gap.
    let holed: Vec<&str> = separate
        .lines()
        .enumerate()
        .filter(|(row, _)| !(101..230).contains(row) || row % 2 == 1)
        .map(|(_, line)| line)
        .collect();
    assert_contains(&refusal(&holed.join("\n"), &merging), "without a sample before this line");
}

#[test]
fn repeated_rows_and_rounded_stamps_are_named_with_their_option() {
    let twice = text("t_s,q1_rad,tau1_Nm\n", |values| format!("{0}\n{0}", plain(values)));
    assert_eq!(
        refusal(&twice, &import("", "")),
        "walk.csv:3: the row repeats the one before it; --skip-bad keeps one of repeated rows"
    );
    let skipping = Import { skip_bad: true, ..import("", "") };
    let kept = read(&twice, &skipping).expect("one of each");
    assert_eq!(kept.report.skipped, 200);
    assert_restored(&kept.recording);
    let rounded = text("t_s,q1_rad,tau1_Nm\n", |[time, angle, torque]| {
        format!("{:.2},{angle},{torque}", (20.0 * time).floor() / 20.0)
    });
    assert_contains(&refusal(&rounded, &import("", "")), "--even-stamps");
    let even = Import { even_stamps: true, ..import("", "") };
    let recording = read(&rounded, &even).expect("an even clock").recording;
    assert_eq!(recording.time_s.len(), 200);
    let steps: Vec<f64> = recording.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(steps.iter().all(|step| (step - 3.1 / 199.0).abs() < 1e-12), "{steps:?}");
}

#[test]
fn one_column_for_two_signals_is_refused() {
    let text = text("t,a,b\n", plain);
    for columns in ["t=t,q1=a,tau1=a", "t=t,q1=2,tau1=a", "t=1,q1=2,tau1=2"] {
        assert_eq!(
            refusal(&text, &import(columns, "")),
            "walk.csv:1: --columns: q1 and tau1 are both read from column `a`: give every signal its own column"
        );
    }
}

#[test]
fn a_misspelt_column_is_answered_with_the_nearest_name() {
    let text = text("stamp,hip_angle,hip_torque\n", plain);
    let message = refusal(&text, &import("t=stamp,q1=hip_angel,tau1=hip_torque", "s,rad,Nm"));
    assert!(
        message.ends_with(
            ". The nearest name is `hip_angle`. If it is meant, repeat the command with it:\n  cargo sim replay --columns \
             t=stamp,q1=hip_angle,tau1=hip_torque --units s,rad,Nm"
        ),
        "{message}"
    );
    let message = refusal(&text, &import("t=stamp,q1=zzz,tau1=hip_torque", ""));
    assert!(!message.contains("nearest"), "{message}");
}

#[test]
fn options_that_contradict_each_other_are_refused() {
    let column = |text: &str| text.parse::<scarab_identify::formats::recording::import::ColumnChoice>();
    assert!(column("q1").expect_err("no column").contains("must be SIGNAL=COLUMN"));
    assert!(column("w1=2").expect_err("no signal").contains("`w1` is not a signal"));
    assert!(column("q1=0").expect_err("no number").contains("count from 1"));
    let unit = |text: &str| text.parse::<scarab_identify::formats::recording::import::UnitChoice>();
    assert!(
        unit("furlong")
            .expect_err("no unit")
            .contains("`furlong` is not a unit; units are s, ms, us, ns, rad")
    );
    assert!(unit("q1=ms").expect_err("wrong").contains("`ms` is not a unit of the signal q1"));
    assert!(unit("tau1=A").expect_err("current").contains("a motor current is the signal i1"));
    let with = |columns: &[&str], units: &[&str]| {
        let columns: Vec<_> = columns.iter().map(|text| column(text).expect("valid")).collect();
        let units: Vec<_> = units.iter().map(|text| unit(text).expect("valid")).collect();
        Import::plain(1).with(&columns, &units).expect_err("a contradiction")
    };
    assert!(with(&["q1=a", "motor1=b"], &[]).contains("same quantity of joint 1"));
    assert!(with(&["q2=a"], &[]).contains("--columns q2: the leg has 1 joint"));
    assert!(with(&["t=a", "t=b"], &[]).contains("t is named twice"));
    assert!(with(&[], &["ms", "us"]).contains("`us` is a second unit"));
}

#[test]
fn a_folder_is_answered_with_what_to_name() {
    scarab("replay --leg sp tests").refuses("is a folder: name the recording in it");
}

#[test]
fn well_known_names_give_the_complete_command_and_are_not_read() {
    for (header, options) in [
        ("time,position_0,effort_0", "t=time,q1=position_0,tau1=effort_0 --units s,rad,Nm"),
        ("timestamp_ns,q_only,tau_only", "t=timestamp_ns,q1=q_only,tau1=tau_only --units ns,rad,Nm"),
        (
            "Time [ms],JointAngle1(deg),Torque1 [N m]",
            "'t=Time [ms],q1=JointAngle1(deg),tau1=Torque1 [N m]' --units ms,deg,Nm",
        ),
        ("t_s,q1_deg_s,q1_deg,tau1_Nm", "t=t_s,q1=q1_deg,tau1=tau1_Nm --units s,deg,Nm"),
        ("T_s,q1_rda,tau1_nm", "t=T_s,q1=q1_rda,tau1=tau1_nm --units s,rad,Nm"),
        (
            "t,velocity_1,position_1,position_cmd_1,current_1_mA",
            "t=t,q1=position_1,i1=current_1_mA --units s,rad,mA",
        ),
    ] {
        let fields = header.split(',').count();
        let text = text(&format!("{header}\n"), |[time, ..]| vec![time.to_string(); fields].join(","));
        let message = refusal(&text, &import("", ""));
        let command = format!("repeat the command with them:\n  cargo sim replay --columns {options}");
        assert_contains(&message, &command);
    }
    // The unit in a name is proposed even where another one is stated.
    let message = refusal(&text("t_s,q1_deg,tau1_Nm\n", plain), &import("", "ms,deg"));
    assert_contains(&message, "no column `t_ms`");
    assert_contains(&message, "tau1=tau1_Nm --units s,deg,Nm");
    let message = refusal(&text("a,b,c\n", plain), &import("", ""));
    assert_contains(&message, "No name resembles t, q1, tau1. Name the columns by --columns");
}

#[test]
fn several_joints_are_proposed_by_number_or_name() {
    let mut import = Import::plain(2);
    import.drives[0].joint = "hip".to_owned();
    import.drives[1].joint = "knee".to_owned();
    for (header, columns) in [
        (
            "t,pos[4],pos[5],eff,effort[4],effort[5]",
            "'t=t,q1=pos[4],q2=pos[5],tau1=effort[4],tau2=effort[5]'",
        ),
        ("t,q_knee,q_hip,tau_knee,tau_hip,x", "t=t,q1=q_hip,q2=q_knee,tau1=tau_hip,tau2=tau_knee"),
    ] {
        let message = refusal(&format!("{header}\n0,0,0,0,0,0\n"), &import);
        assert_contains(&message, &format!("--columns {columns} --units s,rad,Nm"));
    }
}

#[test]
fn a_file_without_header_needs_columns_by_number() {
    let text = text("# time, angle, torque\n", plain);
    let message = refusal(&text, &import("", ""));
    assert!(
        message.starts_with("walk.csv:2: the file has no header: its first row has 3 numbers (0, 0, 4)."),
        "{message}"
    );
    assert!(message.ends_with("cargo sim replay --columns t=1,q1=2,tau1=3 --units s,rad,Nm"), "{message}");
    let read = read(&text, &import("t=1,q1=2,tau1=3", "")).expect("by number");
    assert_restored(&read.recording);
    assert!(!read.report.header);
    assert!(refusal(&text, &import("t=time,q1=2,tau1=3", "")).contains("the file has no header"));
}

#[test]
fn a_file_with_too_few_columns_names_how_many_the_leg_needs() {
    let too_few = "The leg needs 5 columns, the time and each joint's angle and torque, and the file has 4; for a recording of \
                   fewer joints give a leg file of those joints";
    let message = refusal("t_s,q1_rad,q2_rad,tau1_Nm\n0,0,0,4\n", &Import::plain(2));
    assert!(message.ends_with(&format!("No name resembles tau2. {too_few}")), "{message}");
    let message = refusal("0,0,0,4\n", &Import::plain(2));
    assert_contains(
        &message,
        &format!("its first row has 4 numbers (0, 0, 0, 4). {too_few}. If only the time"),
    );
}

#[test]
fn semicolons_tabs_and_decimal_commas_are_found_and_reported() {
    let expected = [
        (",", ".", "CSV with commas"),
        (";", ".", "CSV with semicolons"),
        ("\t", ".", "CSV with tabs"),
        (";", ",", "CSV with semicolons, decimal commas"),
        ("\t", ",", "CSV with tabs, decimal commas"),
    ];
    for (delimiter, decimal, words) in expected {
        let row = |sample| plain(sample).replace(',', delimiter).replace('.', decimal);
        let named = text(&"t_s,q1_rad,tau1_Nm\n".replace(',', delimiter), row);
        let named = read(&named, &import("", "")).expect(words);
        assert_restored(&named.recording);
        assert_eq!(named.report.format, words);
        let bare = read(&text("", row), &import("t=1,q1=2,tau1=3", "")).expect(words);
        assert_restored(&bare.recording);
        assert_eq!(bare.report.format, words);
    }
}

#[test]
fn ambiguous_delimiters_and_decimals_are_refused_with_the_option() {
    let two = text("t_s;a,q1_rad;tau1_Nm\n", |[time, angle, torque]| format!("{time};1,{angle};{torque}"));
    let message = refusal(&two, &import("", ""));
    assert!(message.ends_with("--delimiter comma or --delimiter semicolon"), "{message}");
    let mixed = text("t_s;q1_rad;tau1_Nm\n", |[time, angle, _]| format!("{time:.3};{angle:.3};1,5"));
    assert_contains(&refusal(&mixed, &import("", "")), "`1,5` has a comma and `0.000` a point");
    let thousands = text("t_s;q1_rad;tau1_Nm\n", |_| "1;2;3,250".to_owned());
    let message = refusal(&thousands, &import("", ""));
    assert_contains(&message, "`3,250` may have a decimal comma or a separator of thousands");
    let stated = Import {
        decimal: Some(scarab_identify::formats::recording::dialect::Decimal::Comma),
        ..import("", "")
    };
    let row = |[time, ..]: [f64; 3]| format!("{time};2;3,250").replace('.', ",");
    assert_eq!(
        read(&text("t_s;q1_rad;tau1_Nm\n", row), &stated).expect("stated").recording.joints[0].torque_nm[7],
        3.25
    );
}

/// Text with these lines, counted from 1 below the header, replaced.
fn with_bad(lines: &[(usize, &str)]) -> String {
    let good = text("t_s,q1_rad,tau1_Nm\n", plain);
    let mut rows: Vec<&str> = good.lines().collect();
    for (line, bad) in lines {
        rows[*line] = bad;
    }
    rows.join("\n")
}

#[test]
fn bad_rows_are_skipped_on_request_counted_and_explained() {
    let text = with_bad(&[(10, "1,2"), (20, "x,0,0"), (21, "nan,0,0"), (30, "0,0,0"), (40, "x,0,0")]);
    assert!(refusal(&text, &import("", "")).starts_with("walk.csv:11: 2 fields, but the header has 3"));
    let skipping = Import { skip_bad: true, ..import("", "") };
    let read = read(&text, &skipping).expect("five of two hundred");
    assert_eq!((read.recording.time_s.len(), read.report.samples, read.report.skipped), (195, 195, 5));
    let why: Vec<_> = read.report.skipped_why.iter().map(|why| (why.line, why.rows)).collect();
    assert_eq!(why, [(11, 1), (21, 2), (22, 1), (31, 1)]);
    assert!(read.report.skipped_why[1].reason.contains("`x` in column `t_s` is not a number"));
}

#[test]
fn more_than_a_twentieth_of_bad_rows_is_refused() {
    let lines = |count: usize| -> Vec<(usize, &str)> { (0..count).map(|k| (5 + 10 * k, "x,0,0")).collect() };
    let skipping = Import { skip_bad: true, ..import("", "") };
    assert_eq!(read(&with_bad(&lines(10)), &skipping).expect("5 %").report.skipped, 10);
    let message = refusal(&with_bad(&lines(11)), &skipping);
    assert!(
        message.starts_with(
            "walk.csv: 11 of 200 rows are invalid, --skip-bad skips at most 5 %; the first: line 6: `x`"
        ),
        "{message}"
    );
    // A gap that skipping causes remains a gap, at its line in the file.
    let gap: Vec<(usize, &str)> = (100..109).map(|line| (line, "x")).collect();
    let mut text = with_bad(&gap);
    text = text
        .lines()
        .enumerate()
        .filter(|(line, _)| !(109..120).contains(line))
        .map(|(_, row)| format!("{row}\n"))
        .collect();
    assert!(
        refusal(&text, &skipping).starts_with("walk.csv:110: 0.328 s without a sample"),
        "{}",
        refusal(&text, &skipping)
    );
}

#[test]
fn currents_and_motor_angles_become_torques_and_joint_angles() {
    let drive = Drive { joint: "hip".to_owned(), torque_per_ampere: Some(-1.5), motor_ratio: Some(-50.0) };
    let import = Import { drives: vec![drive], ..import("", "") };
    let row = |[time, angle, torque]: [f64; 3]| format!("{time},{},{}", -50.0 * angle, -torque / 1.5);
    let read = read(&text("t_s,motor1_rad,i1_A\n", row), &import).expect("of the motor");
    assert_restored(&read.recording);
    let by: Vec<_> = read.report.columns.iter().map(|column| (column.factor, column.by)).collect();
    assert_eq!(by, [(1.0, None), (-0.02, Some("encoder.ratio")), (-1.5, Some("torque_per_ampere"))]);
    let unknown = Import::plain(1);
    let message = refusal(&text("t_s,q1_rad,i1_A\n", plain), &unknown);
    assert_contains(&message, "`i1_A` is of the motor, but the leg file states no `torque_per_ampere`");
    let message = refusal(&text("t_s,motor1_rad,tau1_Nm\n", plain), &unknown);
    assert_contains(&message, "the leg file states no `encoder` at the motor for joint `1`");
}

fn packed(text: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(text).expect("memory");
    encoder.finish().expect("memory")
}

#[test]
fn gzip_is_unpacked_while_reading_and_bombs_are_refused() {
    let folder = Folder::new();
    let path = folder.path("walk.csv.gz");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a temporary file");
        Recording::read(&path, &import("", "")).map_err(|error| error.to_string())
    };
    let good = packed(text("t_s,q1_rad,tau1_Nm\n", plain).as_bytes());
    let whole = read(&good).expect("gzip");
    assert_restored(&whole.recording);
    assert_eq!(whole.report.format, "CSV with commas, gzip");
    assert_contains(&read(&good[..good.len() / 2]).expect_err("cut"), "walk.csv.gz: damaged gzip data");
    let bomb = packed(&[b"t_s,q1_rad,tau1_Nm\n".as_slice(), &b"#\n".repeat(60_000_000)].concat());
    assert_contains(&read(&bomb).expect_err("a bomb"), "unpack to more than 200 times their size");
}

/// Replays the pendulum from a CSV that is written as stated.
fn replayed(
    folder: &Folder,
    header: &str,
    row: impl Fn([f64; 3]) -> String,
    more: &str,
    options: &str,
) -> Run {
    let rows: Vec<String> = Motion::default().samples().into_iter().map(row).collect();
    folder.write("run.csv", format!("{header}\n{}\n", rows.join("\n")));
    folder.write("leg.toml", leg(more));
    folder.scarab(&format!("replay {options} @run.csv --leg @leg.toml --json @report.json"))
}

#[test]
fn a_replay_of_currents_in_milliampere_prints_and_writes_every_conversion() {
    let folder = Folder::new();
    let keys = "torque_per_ampere = 2.0\nencoder = { side = \"motor\", counts = 4096, ratio = 40.0 }\n";
    let row = |[time, angle, torque]: [f64; 3]| {
        format!("{:.4};{:.7};{:.6}", 1e3 * time, 40.0 * angle.to_degrees(), 500.0 * torque).replace('.', ",")
    };
    let options = "--columns t=time,motor1=pos,i1=cur --units ms,deg,mA";
    let run = replayed(&folder, "time;pos;cur", row, keys, options).ends_with(0);
    let report = folder.json("report.json");
    finds_the_truth(&report);
    let read = &report["read"][0];
    assert_eq!(read["format"], "CSV with semicolons, decimal commas");
    assert_eq!(
        (&read["columns"][2]["factor"], &read["columns"][2]["by"]),
        (&0.002.into(), &"torque_per_ampere".into())
    );
    for line in
        ["i1 ", "torque_per_ampere", "encoder.ratio", "CSV with semicolons, decimal commas; 5000 rows"]
    {
        run.prints(line);
    }
}

#[test]
fn close_names_end_a_replay_with_exit_code_two_and_a_command_that_works() {
    let folder = Folder::new();
    let row = |[time, angle, torque]: [f64; 3]| format!("{time:.7},{:.7},{torque:.6}", angle.to_degrees());
    let message = replayed(&folder, "Time,position_0_deg,effort_0", row, "", "").refusal();
    let command = message.lines().nth(1).expect("a command").trim();
    let arguments = command.strip_prefix(crate::PROGRAM).expect("this program").trim_start();
    assert!(arguments.starts_with("replay "), "{message}");
    scarab(arguments).ends_with(0).prints("position_0_deg");
}

#[test]
fn random_bytes_with_any_options_are_refused_by_name_or_read() {
    let config = Config { cases: 300, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let letters = prop::sample::select(&b"0123456789.,;\t\n\r-+eE#\"t_sq1radtau1Nm \xff\0"[..]);
    let columns = prop::sample::select(&["", "t=1,q1=2,tau1=3", "t=t,tau1=2", "q1=3"][..]);
    let strategy = (prop::collection::vec(letters, 0..2000), columns, any::<bool>());
    let folder = Folder::new();
    let path = folder.path(FILE);
    let result = runner.run(&strategy, |(bytes, columns, skip_bad)| {
        let import = Import { skip_bad, ..import(columns, "") };
        let begins: [&[u8]; 3] = [b"", b"t_s,q1_rad,tau1_Nm\n", &[0x1F, 0x8B, 8, 0]];
        for begin in begins {
            std::fs::write(&path, [begin, &bytes].concat()).expect("a temporary file");
            if let Err(error) = Recording::read(&path, &import) {
                prop_assert!(error.to_string().contains(FILE), "{error}");
            }
        }
        Ok(())
    });
    if let Err(failure) = result {
        panic!("{failure}");
    }
}

/// File of `readers/tests/data`.
fn foreign(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../readers/tests/data").join(name)
}

#[test]
fn files_of_other_kinds_are_refused_with_the_way_to_one_that_is_read() {
    let folder = Folder::new();
    for (begin, words) in [
        (&b"SQLite format 3\0...."[..], "rosbags-convert --src BAG --dst NEW --dst-storage mcap"),
        (b"#ROSBAG V2.0\n", "a bag of ROS 1: convert it to MCAP"),
        (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
        (b"PK\x03\x04", "a ZIP archive, as .xlsx and .npz are"),
        (b"\x93NUMPY\x01", "numpy.savetxt"),
        (b"\x28\xB5\x2F\xFD", "zstd -d"),
    ] {
        let path = folder.path("run");
        std::fs::write(&path, begin).expect("a temporary file");
        let message = Recording::read(&path, &import("", "")).expect_err("not a recording").to_string();
        assert_contains(&message, words);
    }
    let message = Recording::read(&foreign("level5.mat"), &import("", "")).expect_err("SciPy's").to_string();
    assert_contains(&message, "level5.mat: a MAT file");
    assert_contains(&message, "writetable(table(t, q1, tau1)");
}

#[cfg(not(feature = "readers"))]
#[test]
fn parquet_and_mcap_name_the_command_that_reads_them() {
    for name in ["snappy.parquet", "plain.mcap"] {
        let message =
            Recording::read(&foreign(name), &import("", "")).expect_err("built without").to_string();
        assert_contains(&message, "give the same command with `cargo sim-readers` instead of `");
    }
}

#[cfg(feature = "readers")]
#[test]
fn a_parquet_file_in_nanoseconds_is_read_once_its_columns_and_units_are_stated() {
    let read = |columns: &str, units: &str, skip_bad: bool| {
        let import = Import { skip_bad, ..import(columns, units) };
        Recording::read(&foreign("snappy.parquet"), &import).map_err(|error| error.to_string())
    };
    let message = read("t=stamp", "", false).expect_err("in seconds by default");
    assert_contains(&message, "column `stamp` is in ns by its name or type, but t is read in s");
    assert_contains(&message, "--columns t=stamp,q1=q1_rad,tau1=tau1_Nm --units ns,rad,Nm");
    let message = read("t=stamp", "ns", false).expect_err("a missing value");
    assert_contains(&message, "snappy.parquet:8: `NaN` in column `tau1_Nm` is not finite");
    let Read { recording, report } = read("t=stamp", "ns", true).expect("119 samples");
    assert_eq!((recording.time_s.len(), report.skipped, report.format.as_str()), (119, 1, "Parquet"));
    // 100 is after the skipped sample 7.
    let (time, torque) = (recording.time_s[100], recording.joints[0].torque_nm[100]);
    assert_eq!((time, torque), (101.0 / 64.0, 4.0 - 101.0 / 8.0));
}

#[cfg(feature = "readers")]
#[test]
fn joints_of_a_bag_are_chosen_by_name_and_proposed_by_the_names_of_the_leg() {
    let mut unnamed = Import::plain(2);
    unnamed.drives[0].joint = "knee".to_owned();
    unnamed.drives[1].joint = "hip".to_owned();
    let message =
        Recording::read(&foreign("zstd.mcap"), &unnamed).expect_err("no documented names").to_string();
    let columns = "t=time,q1=position[knee_joint],q2=position[hip_joint],tau1=effort[knee_joint],tau2=effort[hip_joint]";
    assert_contains(&message, &format!("--columns '{columns}' --units s,rad,Nm"));
    let choices: Vec<_> = columns.split(',').map(|choice| choice.parse().expect("a column")).collect();
    let Read { recording, report } =
        Recording::read(&foreign("zstd.mcap"), &unnamed.with(&choices, &[]).expect("valid")).expect("a bag");
    assert_eq!(report.format, "MCAP, sensor_msgs/msg/JointState");
    let torques: Vec<f64> = recording.joints.iter().map(|joint| joint.torque_nm[100]).collect();
    assert_eq!(torques, [2.0 * (4.0 - 100.0 / 8.0), 4.0 - 100.0 / 8.0]);
}

#[test]
fn the_folder_of_a_bag_is_read_as_a_whole() {
    let folder = Folder::new();
    let bag = folder.path("bag");
    std::fs::create_dir(&bag).expect("a temporary folder");
    std::fs::write(bag.join("metadata.yaml"), "").expect("a file");
    std::fs::copy(foreign("plain.mcap"), bag.join("bag_0.mcap")).expect("a file");
    let columns = "t=time,q1=position[hip_joint],tau1=effort[hip_joint]";
    let read = |path: &Path| {
        let choices: Vec<_> = columns.split(',').map(|choice| choice.parse().expect("a column")).collect();
        let import = Import::plain(1).with(&choices, &[]).expect("valid");
        Recording::read(path, &import).map_err(|error| error.to_string())
    };
    if cfg!(feature = "readers") {
        let whole = read(&bag).expect("a bag").recording;
        let file = read(&foreign("plain.mcap")).expect("its only file").recording;
        assert_eq!((whole.time_s, whole.joints), (file.time_s, file.joints));
        // Messages that come twice do not continue the recording.
        std::fs::copy(foreign("plain.mcap"), bag.join("bag_1.mcap")).expect("a file");
        assert!(read(&bag).expect_err("time goes back").contains("does not exceed the previous"));
    } else {
        assert!(read(&bag).expect_err("built without").contains("`cargo sim-readers`"));
    }
    // A bag of the older storage is refused with the way to convert it.
    let old = folder.path("old");
    std::fs::create_dir(&old).expect("a temporary folder");
    std::fs::write(old.join("old_0.db3"), "").expect("a file");
    assert!(read(&old).expect_err("SQLite").contains("rosbags-convert"));
}
