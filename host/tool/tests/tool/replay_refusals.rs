//! Rejections of `scarab replay`: bad input with a message and exit code 2, bad results with a
//! reason and 3.

use crate::command::{Folder, MUJOCO, assert_contains, reasons, scarab};
use crate::pendulum::{Motion, leg};

/// Message for a recording, without its folder. No report may remain.
fn refusal(text: &str) -> String {
    refusal_of("", text)
}

/// Message for a recording that is read with options.
fn refusal_of(options: &str, text: &str) -> String {
    let folder = Folder::new();
    folder.write("walk.csv", text);
    folder.write("leg.toml", leg(""));
    let line = format!("replay {options} @walk.csv --leg @leg.toml --json @report.json");
    let message = folder.scarab(&line).refusal();
    assert!(!folder.path("report.json").exists(), "a report of bad input");
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
    assert_contains(&message, "unwrap the angle");
    let folder = Folder::new();
    folder.write("leg.toml", leg(""));
    folder.write("walk.csv", with(&|index| if index == 2_000 { std::f64::consts::TAU } else { 0.0 }));
    folder.scarab("replay @walk.csv --leg @leg.toml").ends_with(0);
}

#[test]
fn geometry_of_another_convention_gives_a_warning() {
    let folder = Folder::new();
    folder.write("walk.csv", Motion::default().csv());
    for (line, other, words) in [
        ("a = 0.0", "a = 0.35", "`dh.a` of joint `only` is 0.35 m and has no effect"),
        ("gravity = [9.81, 0.0, 0.0]", "gravity = [0.0, 0.0, -9.81]", "gravity is along the joints' axes"),
    ] {
        folder.write("leg.toml", leg("").replace(line, other));
        folder.scarab("replay @walk.csv --leg @leg.toml").warns(words);
    }
}

#[test]
fn implausible_options_are_refused_with_their_limits() {
    let refused =
        |arguments: &str| scarab(&format!("replay {MUJOCO} --leg mujoco-leg {arguments}")).refusal();
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
    assert_contains(&refused("--split 0.001"), "fourier.csv: too short: 15 samples over 0.028 s");
    assert_contains(&refused("--split 0.001"), "before --split: choose a larger share");
    assert!(refused(&format!("--split 0.5 --validate {MUJOCO}")).contains("cannot be used with"));
    assert!(refused("--validate no-such-file.csv").contains("no-such-file.csv: cannot be read"));
    assert!(refused("--prior wrong:200").contains("is not a percentage"));
}

#[test]
fn a_replay_without_a_leg_is_refused_with_an_example() {
    let message = scarab(&format!("replay {MUJOCO}")).refusal();
    assert_contains(&message, "--leg is missing");
    // The program's name is the one by which it was called.
    let example = format!("{} replay run.csv --leg my-leg.toml", crate::PROGRAM);
    assert_contains(&message, &example);
    assert_contains(&message, "x2-wearer-75kg, x2-rough, mujoco-leg");
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
    assert_contains(&refused, "is the time in s? Then it would be 500 Hz");
    assert_contains(&refused, "--columns t=t_ms,q1=q1_rad,tau1=tau1_Nm --units s,rad,Nm");
}

/// Reasons of the verdict for a recording of the MuJoCo leg with a replaced header.
fn reasons_with_header(header: &str, arguments: &str) -> Vec<String> {
    let folder = Folder::new();
    let text = std::fs::read_to_string(MUJOCO).expect("the recording");
    let (_, rows) = text.split_once('\n').expect("lines");
    folder.write("walk.csv", format!("{header}\n{rows}"));
    let (_, report) = folder.reported(&format!("replay --leg mujoco-leg @walk.csv {arguments}"), 3);
    reasons(&report).into_iter().map(str::to_owned).collect()
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
            assert!(reasons.iter().any(|reason| reason == "unphysical"), "{reasons:?}");
        }
    }
}

#[test]
fn a_motionless_joint_is_refused_as_unexcited() {
    let folder = Folder::new();
    folder.write("leg.toml", leg(""));
    // A flickering encoder bit and a drifting torque change nothing.
    let still: Vec<[f64; 3]> = (0..5000)
        .map(|k| [f64::from(k) * 0.002, 0.3 + 3.8e-4 * f64::from(k % 7 / 6), 1.5 + 1e-4 * f64::from(k)])
        .collect();
    folder.write("still.csv", crate::pendulum::csv(&still));
    let (run, report) = folder.reported("replay @still.csv --leg @leg.toml", 3);
    // Said once, as the cause.
    assert_eq!(run.printed.matches("joint 1 hardly moved").count(), 1, "{}", run.printed);
    run.prints("likely cause: motion: joint 1 hardly moved");
    assert!(reasons(&report).contains(&"unexcited"));
}

#[test]
fn a_torque_that_is_always_zero_is_refused() {
    let folder = Folder::new();
    let samples: Vec<[f64; 3]> =
        Motion::default().samples().into_iter().map(|[time, angle, _]| [time, angle, 0.0]).collect();
    folder.write("walk.csv", crate::pendulum::csv(&samples));
    folder.write("leg.toml", leg(""));
    let (_, report) = folder.reported("replay @walk.csv --leg @leg.toml", 3);
    assert!(reasons(&report).contains(&"input"));
}

#[test]
fn a_held_out_motion_of_another_machine_is_refused() {
    let folder = Folder::new();
    let other: Vec<[f64; 3]> = Motion { centre: 0.1, seed: 5, ..Motion::default() }
        .samples()
        .into_iter()
        .map(|[time, angle, torque]| [time, angle, 1.3 * torque])
        .collect();
    folder.write("a.csv", Motion::default().csv());
    folder.write("b.csv", crate::pendulum::csv(&other));
    folder.write("leg.toml", leg(""));
    let (_, report) = folder.reported("replay @a.csv --leg @leg.toml --validate @b.csv", 3);
    assert_eq!(reasons(&report), ["validation"]);
}
