//! Reading of recordings: accepted data, and the message for every rejection.
//!
//! `SCARAB_RECORDINGS` names the folder with recordings of real machines; without it they are skipped.

use crate::command::assert_contains;
use std::env;
use std::path::{Path, PathBuf};

use scarab_identify::formats::recording::import::Import;
use scarab_identify::formats::recording::{JointSeries, Recording};
use scarab_identify::run::resample::{GRID_RATE_HZ, Method, Resampled};

const HEADER: &str = "t_s,q1_rad,q2_rad,tau1_Nm,tau2_Nm";

/// 200 samples at 100 Hz; sample k is on line k + 2.
fn rows() -> Vec<String> {
    (0..200)
        .map(|k| format!("{:.3},{:.4},{:.4},{:.3},{:.3}", f64::from(k) * 0.01, 0.1, -0.2, 3.0, -4.0))
        .collect()
}

fn text(header: &str, rows: &[String]) -> String {
    format!("{header}\n{}\n", rows.join("\n"))
}

/// Message for a text read with two joints.
fn refusal(text: &str) -> String {
    match Recording::parse(Path::new("walk.csv"), text, 2) {
        Ok(_) => panic!("accepted:\n{text}"),
        Err(error) => error.to_string(),
    }
}

/// Message for a recording with line 102 (sample 100, 1 s) replaced, without the option that skips it.
fn refusal_with(line: &str) -> String {
    let mut rows = rows();
    line.clone_into(&mut rows[100]);
    damaged(&text(HEADER, &rows))
}

/// Message for a damaged row, without the option that skips it.
fn damaged(text: &str) -> String {
    let message = refusal(text);
    message.strip_suffix(" (--skip-bad skips such rows, up to 5 %)").expect("an option to skip it").to_owned()
}

#[test]
fn columns_are_found_by_name_and_others_ignored() {
    let rows: Vec<String> =
        (0..100).map(|k| format!(" 7 ,{k}e-3, up, 1.5,{:.2},-2.5,9", f64::from(k) * 0.02)).collect();
    let text =
        text("\u{feff}tau1_cmd_Nm,\"q1_rad\",note,tau2_Nm,t_s, tau1_Nm,q2_rad", &rows).replace('\n', "\r\n");
    let recording = Recording::parse(Path::new("walk.csv"), &text, 2).expect("a recording");
    assert_eq!(recording.time_s.len(), 100);
    assert_eq!(recording.time_s[99], 1.98);
    assert_eq!(recording.joints[0].position_rad[42], 0.042);
    assert_eq!((recording.joints[0].torque_nm[42], recording.joints[1].torque_nm[42]), (-2.5, 1.5));
    assert_eq!(recording.joints[1].position_rad[42], 9.0);
}

#[test]
fn a_part_of_the_joints_of_a_file_can_be_read() {
    let recording = Recording::parse(Path::new("walk.csv"), &text(HEADER, &rows()), 1).expect("a recording");
    assert_eq!((recording.joints.len(), recording.joints_in_file), (1, 2));
}

#[test]
fn a_file_that_cannot_be_read_is_refused() {
    let missing = Path::new("no-such-folder").join("walk.csv");
    let message = Recording::read(&missing, &Import::plain(2)).expect_err("no such file").to_string();
    assert_contains(&message, "walk.csv: cannot be read (No such file");
}

#[test]
fn an_empty_file_is_refused() {
    assert_eq!(refusal(""), "walk.csv: the file is empty");
    assert_eq!(refusal("\n \n"), "walk.csv: the file is empty");
}

#[test]
fn lines_that_begin_with_a_number_sign_are_skipped_and_counted() {
    let mut lines = vec!["# walked on a Monday".to_owned(), HEADER.to_owned(), "# second".to_owned()];
    lines.extend(rows());
    let commented = Recording::parse(Path::new("walk.csv"), &lines.join("\n"), 2).expect("a recording");
    let plain = Recording::parse(Path::new("walk.csv"), &text(HEADER, &rows()), 2).expect("a recording");
    assert_eq!(commented, plain);
    lines[3] = "0,1".to_owned();
    assert!(refusal(&lines.join("\n")).starts_with("walk.csv:4: 2 fields, but the header has 5"));
    assert_eq!(refusal("# nothing\n"), "walk.csv: the file is empty");
}

#[test]
fn a_header_without_a_needed_column_is_refused() {
    let present = "its columns are: time,q1_rad,q2_rad,tau1_Nm,tau2_Nm".replace(',', ", ");
    let header = HEADER.replace("t_s", "time");
    let message = refusal(&text(&header, &rows()));
    assert!(
        message.starts_with(&format!(
            "walk.csv:1: the header has no column `t_s`; {present}; needed are: t_s, q1_rad, tau1_Nm, q2_rad, tau2_Nm."
        )),
        "{message}"
    );
    let header = HEADER.replace("q2_rad", "q2_deg");
    assert!(refusal(&text(&header, &rows())).starts_with("walk.csv:1: the header has no column `q2_rad`;"));
    let header = HEADER.replace("tau1_Nm", "torque");
    assert!(refusal(&text(&header, &rows())).starts_with("walk.csv:1: the header has no column `tau1_Nm`;"));
    let header = HEADER.replace("q2_rad", "q1_rad");
    assert_eq!(refusal(&text(&header, &rows())), "walk.csv:1: the header has the column `q1_rad` twice");
}

#[test]
fn a_damaged_row_is_refused_with_line_and_reason() {
    for (line, reason) in [
        (
            "1.0,\"0,1\",-0.2,3,-4",
            "`0,1` in column `q1_rad` is not a number (if the comma is a decimal comma: --decimal comma)",
        ),
        ("1.0,0,1,-0,2,3,-4", "7 fields, but the header has 5: are these decimal commas?"),
        ("1.0,0.1,-0.2,three,-4", "`three` in column `tau1_Nm` is not a number"),
        ("1.0,0.1,,3,-4", "`` in column `q2_rad` is not a number"),
        ("1.0,NaN,-0.2,3,-4", "`NaN` in column `q1_rad` is not finite"),
        ("1.0,0.1,-0.2,3,-inf", "`-inf` in column `tau2_Nm` is not finite"),
        ("1e999,0.1,-0.2,3,-4", "`1e999` in column `t_s` is not finite"),
        ("0.9,0.1,-0.2,3,-4", "time 0.9 s does not exceed the previous 0.99 s"),
        (
            "0.990,0.1,-0.2,3,-5",
            "time 0.99 s does not exceed the previous 0.99 s; if the times are rounded, --even-stamps replaces them",
        ),
        ("1.0,8192,-0.2,3,-4", "8192 in column `q1_rad` exceeds 1000: is it in another unit?"),
        ("1.0,0.1,-0.2,3,-4e5", "-400000 in column `tau2_Nm` exceeds 100000: is it in another unit?"),
        ("1.0,1e300,-0.2,3,-4", "1e300 in column `q1_rad` exceeds 1000: is it in another unit?"),
        // Unix time in milliseconds.
        ("1.79e12,0.1,-0.2,3,-4", "1.79e12 in column `t_s` exceeds 1e10: is it in another unit?"),
    ] {
        assert_eq!(refusal_with(line), format!("walk.csv:102: {reason}"));
    }
}

#[test]
fn decimal_commas_and_truncated_lines_are_named() {
    let lines: Vec<String> = rows().iter().map(|row| row.replace('.', ",")).collect();
    assert_eq!(
        refusal(&text(HEADER, &lines)),
        "walk.csv:2: 10 fields, but the header has 5: are these decimal commas?"
    );
    let whole = text(HEADER, &rows());
    let cut = &whole[..whole.len() - "0,-4.000\n".len() - ",3.00".len()];
    assert_eq!(damaged(cut), "walk.csv:201: 3 fields, but the header has 5: is the line truncated?");
}

#[test]
fn a_message_does_not_repeat_the_file() {
    let lines = "7v{1k2J\n".repeat(1_500_000);
    for (garbage, begin) in [
        ("\0".repeat(10_000_000), "walk.csv:1: the line is longer than 1 MB: not a recording"),
        ("\0".repeat(10_000), "walk.csv:1: not a text file"),
        (lines, "walk.csv:1: the header has no column `t_s`; its columns are: 7v{1k2J; needed"),
        ("c,".repeat(400_000), "walk.csv:1: the header has no column `t_s`; its columns are: c, c, "),
    ] {
        let message = refusal(&garbage);
        assert!(message.starts_with(begin), "{message}");
        assert!(message.len() < 1400 && message.lines().count() <= 2, "{} characters", message.len());
    }
    let message = refusal_with(&format!("1.0,{},-0.2,3,-4", "x".repeat(1_000_000)));
    assert!(message.starts_with("walk.csv:102: `xxx") && message.len() < 300, "{} characters", message.len());
}

#[test]
fn blank_lines_are_skipped_but_counted() {
    let mut rows = rows();
    rows[50] += "\n\n\r\n";
    assert_eq!(
        Recording::parse(Path::new("walk.csv"), &text(HEADER, &rows), 2).expect("a recording").time_s.len(),
        200
    );
    rows[50] = "0.5,0.1,x,3,-4".to_owned();
    rows[49] += "\n\n";
    assert_eq!(damaged(&text(HEADER, &rows)), "walk.csv:54: `x` in column `q2_rad` is not a number");
}

#[test]
fn a_median_step_above_a_tenth_of_a_second_is_refused() {
    let sampled = |rate_hz: f64| {
        let rows: Vec<String> = (0..60).map(|k| format!("{},0,0,0,{k}", f64::from(k) / rate_hz)).collect();
        Recording::parse(Path::new("walk.csv"), &text(HEADER, &rows), 2).map_err(|error| error.to_string())
    };
    assert!(sampled(10.0).is_ok());
    assert_contains(&sampled(9.9).expect_err("too slow"), "which is 9.9 Hz; at least 10 Hz are needed");
    // A gap does not change the median.
    assert!(sampled(1.0).expect_err("too slow").contains("1 Hz"));
}

#[test]
fn a_gap_is_refused_where_it_ends() {
    let mut rows = rows();
    rows.drain(100..125);
    assert_eq!(
        refusal(&text(HEADER, &rows)),
        "walk.csv:102: 0.260 s without a sample before this line; at most 0.200 s are bridged: cut the file before this line \
         and give both parts"
    );
    // A gap of 20 median steps of 10 ms is accepted.
    rows.insert(100, "1.1,0.1,-0.2,3,-4".to_owned());
    assert!(Recording::parse(Path::new("walk.csv"), &text(HEADER, &rows), 2).is_ok());
}

#[test]
fn too_few_samples_are_refused() {
    assert_eq!(
        refusal(&text(HEADER, &rows()[..30])),
        "walk.csv: too short: 30 samples over 0.290 s, but at least 50 over 1 s are needed"
    );
    assert!(refusal(&text(HEADER, &rows()[..100])).contains("100 samples over 0.990 s"));
    assert!(refusal(HEADER).contains("too short: 0 samples over 0.000 s"));
}

#[test]
fn bytes_that_are_not_text_are_refused() {
    let file = env::temp_dir().join(format!("scarab-not-text-{}.csv", std::process::id()));
    std::fs::write(&file, [0x74, 0xff, 0xfe, 0x00]).expect("a temporary file");
    let message = Recording::read(&file, &Import::plain(1)).expect_err("not a text").to_string();
    std::fs::remove_file(&file).expect("the file exists");
    assert!(message.ends_with(".csv:1: not a text file"), "{message}");
}

#[test]
fn a_written_recording_reads_back_bit_by_bit() {
    let value = |k: u32| f64::from(k).mul_add(1.0 / 3.0, -20.0);
    let joint = |scale: f64| JointSeries {
        position_rad: (0..600).map(|k| scale * value(k)).collect(),
        torque_nm: (0..600).map(|k| -scale * value(k)).collect(),
    };
    let recording = Recording {
        file: PathBuf::from("walk.csv"),
        time_s: (0..600_u32).map(|k| f64::from(k) / GRID_RATE_HZ).collect(),
        joints: vec![joint(1.0), joint(1e-7), joint(2.0)],
        joints_in_file: 3,
    };
    let mut written = Vec::new();
    recording.write(&mut written).expect("memory");
    let text = String::from_utf8(written).expect("text");
    assert!(text.starts_with("t_s,q1_rad,q2_rad,q3_rad,tau1_Nm,tau2_Nm,tau3_Nm\n"));
    assert_eq!(Recording::parse(&recording.file, &text, 3).expect("a recording"), recording);
}

#[test]
fn a_split_shares_no_sample_and_refuses_a_part_that_is_too_short() {
    let whole = Recording::parse(Path::new("walk.csv"), &text(HEADER, &rows()), 2).expect("a recording");
    let refused = whole.split(0.9).expect_err("0.2 s are left").to_string();
    assert!(refused.starts_with("walk.csv: too short: 20 samples"), "{refused}");
    let long: Vec<String> = (0..=400).map(|k| format!("{},0,0,0,{k}", f64::from(k) * 0.01)).collect();
    let whole = Recording::parse(Path::new("walk.csv"), &text(HEADER, &long), 2).expect("a recording");
    let (first, second) = whole.split(0.5).expect("two parts");
    assert_eq!((first.time_s.len(), second.time_s.len()), (200, 201));
    assert_eq!(second.joints[1].torque_nm[0], 200.0);
}

/// Recordings of real machines: samples, duration (s) and resampling method.
const REAL: [(&str, usize, usize, f64, Method); 12] = [
    ("dp_A0/00.csv", 2, 4997, 9.999_871, Method::CatmullRom),
    ("dp_A0/01.csv", 2, 4997, 9.998_365, Method::CatmullRom),
    ("dp_A0/02.csv", 2, 4997, 9.999_241, Method::CatmullRom),
    ("dp_A0/03.csv", 2, 4997, 9.999_554, Method::CatmullRom),
    ("dp_A0/04.csv", 2, 4997, 9.998_948, Method::CatmullRom),
    ("dp_A0/05.csv", 2, 4997, 9.999_104, Method::CatmullRom),
    ("dp_A0/11.csv", 2, 3857, 5.997_122, Method::BinMean),
    ("dp_A0/12.csv", 2, 4997, 9.999_583, Method::CatmullRom),
    ("dp_A0/13.csv", 2, 4997, 9.999_401, Method::CatmullRom),
    ("sp/ddp.csv", 1, 3000, 5.999_162, Method::CatmullRom),
    ("sp/energy.csv", 1, 4000, 19.996_302, Method::CatmullRom),
    ("sp/gravcomp.csv", 1, 30000, 30.020_033, Method::BinMean),
];

#[test]
fn recordings_of_real_machines_are_read_and_resampled() {
    let Some(folder) = crate::command::recordings("recordings of real machines") else { return };
    for (name, joints, samples, duration, method) in REAL {
        let recording = Recording::read(&folder.join(name), &Import::plain(joints))
            .unwrap_or_else(|error| panic!("{error}"));
        let recording = recording.recording;
        assert_eq!((recording.time_s.len(), recording.joints_in_file), (samples, joints), "{name}");
        assert!((recording.duration_s() - duration).abs() < 1e-6, "{name}: {} s", recording.duration_s());
        let resampled = Resampled::new(&recording);
        assert_eq!(resampled.method, method, "{name}");
        let expected = (duration * GRID_RATE_HZ) as usize;
        assert!(
            (expected - 1..=expected + 1).contains(&resampled.len()),
            "{name}: {} points",
            resampled.len()
        );
        // Averaging and the cubic move a point by a few encoder counts of 3.8e-4 rad: 0.2 to 3.7
        // counts measured.
        let worst = largest_distance(&recording, &resampled);
        println!("{name}: {} points, at most {worst:.1e} rad from the straight lines", resampled.len());
        assert!(worst < 2e-3, "{name}: {worst:e} rad");
    }
}

/// Largest distance of the resampled first joint from straight lines between the samples, rad.
fn largest_distance(recording: &Recording, resampled: &Resampled) -> f64 {
    let (time, angle) = (&recording.time_s, &recording.joints[0].position_rad);
    (0..resampled.len())
        .map(|point| {
            let now = resampled.time_s(point);
            let right = time.partition_point(|&stamp| stamp <= now).clamp(1, time.len() - 1);
            let share = (now - time[right - 1]) / (time[right] - time[right - 1]);
            let line = angle[right - 1] + share * (angle[right] - angle[right - 1]);
            (resampled.joints[0].position_rad[point] - line).abs()
        })
        .fold(0.0, f64::max)
}
