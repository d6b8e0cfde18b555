//! Rejections of `scarab replay`: bad input with a message and exit code 2, bad results with a
//! reason and 3.

use crate::command::{Folder, MUJOCO, reasons, scarab};
use crate::pendulum::{Motion, leg};
use std::path::Path;

/// Message for a recording, without its folder. No report may remain.
fn refusal(text: &str) -> String {
    refusal_of("", text)
}

/// Message for a recording that is read with options.
fn refusal_of(options: &str, text: &str) -> String {
    let folder = Folder::new();
    let (file, leg) = (folder.write("walk.csv", text), folder.write("leg.toml", &leg("")));
    let json = folder.path("report.json");
    let arguments = format!("replay {options}");
    let message =
        scarab(&arguments, &[&file, Path::new("--leg"), &leg, Path::new("--json"), &json]).refusal();
    assert!(!json.exists(), "a report of bad input");
    message.replace(&folder.path("").display().to_string(), "").replace(crate::PROGRAM, "scarab")
}

/// Message for a valid recording with line 102 replaced.
fn refusal_with(line: &str) -> String {
    let good = Motion::default().csv();
    let mut lines: Vec<&str> = good.lines().collect();
    lines[101] = line;
    refusal(&lines.join("\n"))
}

#[test]
fn bad_recordings_are_refused_with_file_line_and_reason() {
    assert_eq!(
        refusal("t_s,q1_rad,torque\n0,0,0\n"),
        "error: walk.csv:1: the header has no column `tau1_Nm`; its columns are: t_s, q1_rad, torque; needed \
         are: t_s, q1_rad, tau1_Nm. If these columns are meant, repeat the command with them:\n  scarab replay walk.csv --leg \
         leg.toml --json report.json --columns t=t_s,q1=q1_rad,tau1=torque --units s,rad,Nm\n  (`torque` without a unit: SI \
         is assumed, change --units if that is wrong)\n"
    );
    assert_eq!(
        refusal_with("0.2,NaN,1.0"),
        "error: walk.csv:102: `NaN` in column `q1_rad` is not finite (--skip-bad skips such rows, up to 5 %)\n"
    );
}

#[test]
fn a_wrapped_angle_is_refused_with_its_line_and_an_isolated_sample_is_not() {
    let samples = Motion::default().samples();
    let with = |change: &dyn Fn(usize) -> f64| {
        let rows: Vec<[f64; 3]> = samples
            .iter()
            .enumerate()
            .map(|(index, &[time, angle, torque])| [time, angle + change(index), torque])
            .collect();
        crate::pendulum::csv(&rows)
    };
    let message = refusal(&with(&|index| if index < 2_000 { 0.0 } else { -std::f64::consts::TAU }));
    assert!(message.starts_with("error: walk.csv:2002: q1_rad jumps by -6.2"), "{message}");
    assert!(message.contains("unwrap the angle"), "{message}");
    let folder = Folder::new();
    let leg = folder.write("leg.toml", &leg(""));
    let file =
        folder.write("walk.csv", &with(&|index| if index == 2_000 { std::f64::consts::TAU } else { 0.0 }));
    scarab("replay", &[&file, Path::new("--leg"), &leg]).ends_with(0);
}

#[test]
fn geometry_of_another_convention_gives_a_warning() {
    let folder = Folder::new();
    let recording = folder.write("walk.csv", &Motion::default().csv());
    for (line, other, words) in [
        ("a = 0.0", "a = 0.35", "`dh.a` of joint `only` is 0.35 m and has no effect"),
        ("gravity = [9.81, 0.0, 0.0]", "gravity = [0.0, 0.0, -9.81]", "gravity is along the joints' axes"),
    ] {
        let leg = folder.write("leg.toml", &leg("").replace(line, other));
        let run = scarab("replay", &[&recording, Path::new("--leg"), &leg]);
        assert!(run.errors.contains(words), "{}", run.errors);
    }
}

#[test]
fn implausible_options_are_refused_with_their_limits() {
    let refused =
        |arguments: &str| scarab(&format!("replay {MUJOCO} --leg mujoco-leg {arguments}"), &[]).refusal();
    for (bandwidth, reason) in [
        ("0", "must be a positive number"),
        ("-3", "must be a positive number"),
        ("nan", "must be a positive number"),
        ("inf", "at most"),
        ("0.01", "at least 1 Hz"),
        ("240", "at most"),
        ("1e9", "at most"),
    ] {
        let message = refused(&format!("--bandwidth {bandwidth}"));
        assert!(message.starts_with("error: --bandwidth ") && message.contains(reason), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    assert!(refused("--bandwidth fast").contains("invalid value 'fast' for '--bandwidth"));
    for split in ["0", "1", "-0.5", "1.5", "nan"] {
        let message = refused(&format!("--split {split}"));
        assert_eq!(message, "error: --split: must be above 0 and below 1\n");
    }
    let message = refused("--split 0.001");
    assert!(message.contains("fourier.csv: too short: 15 samples over 0.028 s"), "{message}");
    assert!(refused(&format!("--split 0.5 --validate {MUJOCO}")).contains("cannot be used with"));
    assert!(refused("--validate no-such-file.csv").contains("no-such-file.csv: cannot be read"));
    assert!(refused("--prior wrong:200").contains("is not a percentage"));
}

#[test]
fn a_replay_without_a_leg_is_refused_with_an_example() {
    let message = scarab("replay", &[Path::new(MUJOCO)]).refusal();
    assert!(message.contains("--leg is missing"), "{message}");
    // The program's name is the one by which it was called.
    let example = format!("{} replay run.csv --leg my-leg.toml", crate::PROGRAM);
    assert!(message.contains(&example), "{message}");
    assert!(message.contains("x2-wearer-75kg, x2-rough, mujoco-leg"), "{message}");
}

#[test]
fn time_in_another_unit_is_refused_by_the_rate_with_the_likely_unit() {
    let motion = Motion::default().samples();
    let refused = |factor: f64| {
        let samples: Vec<[f64; 3]> = motion.iter().map(|[t, q, tau]| [factor * t, *q, *tau]).collect();
        refusal(&crate::pendulum::csv(&samples))
    };
    assert_eq!(
        refused(1e3),
        "error: walk.csv: the median step of the time is 2 s, which is 0.5 Hz; at least 10 Hz are needed: is the time in \
         ms? Then it would be 500 Hz over 9.998 s. If so, repeat the command with it:\n  scarab replay walk.csv \
         --leg leg.toml --json report.json --columns t=t_s,q1=q1_rad,tau1=tau1_Nm --units ms,rad,Nm\n"
    );
    assert!(refused(1e6).contains("is the time in us? Then it would be 500 Hz"));
    // Sample numbers instead of times.
    assert!(refused(500.0).contains("is the time in ms or sample numbers?"));
    // Seconds that are read as milliseconds.
    let seconds = crate::pendulum::csv(&motion).replacen("t_s", "t_ms", 1);
    let refused = refusal_of("--units ms", &seconds);
    assert!(refused.contains("is the time in s? Then it would be 500 Hz"), "{refused}");
    assert!(refused.contains("--columns t=t_ms,q1=q1_rad,tau1=tau1_Nm --units s,rad,Nm"), "{refused}");
}

/// Reasons of the verdict for a recording of the MuJoCo leg with a replaced header.
fn reasons_with_header(header: &str, arguments: &str) -> Vec<String> {
    let folder = Folder::new();
    let text = std::fs::read_to_string(MUJOCO).expect("the recording");
    let (_, rows) = text.split_once('\n').expect("lines");
    let file = folder.write("walk.csv", &format!("{header}\n{rows}"));
    let json = folder.path("report.json");
    let run = scarab(&format!("replay --leg mujoco-leg {arguments}"), &[&file, Path::new("--json"), &json]);
    run.ends_with(3);
    reasons(&folder.json("report.json")).into_iter().map(str::to_owned).collect()
}

#[test]
#[ignore = "campaign: .ci/full"]
fn swapped_columns_are_refused_with_and_without_prior_and_held_out_motion() {
    for header in [
        "t_s,q2_rad,q1_rad,tau1_Nm,tau2_Nm",
        "t_s,q1_rad,q2_rad,tau2_Nm,tau1_Nm",
        "t_s,q2_rad,q1_rad,tau2_Nm,tau1_Nm",
        "t_s,tau1_Nm,q2_rad,q1_rad,tau2_Nm",
    ] {
        for arguments in ["", "--split 0.66", "--prior none", "--prior none --split 0.66"] {
            let reasons = reasons_with_header(header, arguments);
            assert!(reasons.contains(&"unphysical".to_owned()), "{header} {arguments}: {reasons:?}");
        }
    }
}

#[test]
fn a_motionless_joint_is_refused_as_unexcited() {
    let folder = Folder::new();
    let leg = folder.write("leg.toml", &leg(""));
    let json = folder.path("report.json");
    // A flickering encoder bit and a drifting torque change nothing.
    let still: Vec<[f64; 3]> = (0..5000)
        .map(|k| [f64::from(k) * 0.002, 0.3 + 3.8e-4 * f64::from(k % 7 / 6), 1.5 + 1e-4 * f64::from(k)])
        .collect();
    let still = folder.write("still.csv", &crate::pendulum::csv(&still));
    let run = scarab("replay", &[&still, Path::new("--leg"), &leg, Path::new("--json"), &json]).ends_with(3);
    // Said once, as the cause.
    assert_eq!(run.printed.matches("joint 1 hardly moved").count(), 1, "{}", run.printed);
    assert!(run.printed.contains("likely cause: motion: joint 1 hardly moved"), "{}", run.printed);
    assert!(reasons(&folder.json("report.json")).contains(&"unexcited"));
}

#[test]
fn a_torque_that_is_always_zero_is_refused() {
    let folder = Folder::new();
    let samples: Vec<[f64; 3]> =
        Motion::default().samples().into_iter().map(|[time, angle, _]| [time, angle, 0.0]).collect();
    let (file, leg) =
        (folder.write("walk.csv", &crate::pendulum::csv(&samples)), folder.write("leg.toml", &leg("")));
    let json = folder.path("report.json");
    scarab("replay", &[&file, Path::new("--leg"), &leg, Path::new("--json"), &json]).ends_with(3);
    assert!(reasons(&folder.json("report.json")).contains(&"input"));
}

#[test]
fn a_held_out_motion_of_another_machine_is_refused() {
    let folder = Folder::new();
    let other: Vec<[f64; 3]> = Motion { centre: 0.1, seed: 5, ..Motion::default() }
        .samples()
        .into_iter()
        .map(|[time, angle, torque]| [time, angle, 1.3 * torque])
        .collect();
    let (train, held_out) = (
        folder.write("a.csv", &Motion::default().csv()),
        folder.write("b.csv", &crate::pendulum::csv(&other)),
    );
    let (leg, json) = (folder.write("leg.toml", &leg("")), folder.path("report.json"));
    let options =
        [&train, Path::new("--leg"), &leg, Path::new("--json"), &json, Path::new("--validate"), &held_out];
    scarab("replay", &options).ends_with(3);
    assert_eq!(reasons(&folder.json("report.json")), ["validation"]);
}
