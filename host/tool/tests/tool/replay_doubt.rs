//! Errors of a logging chain are estimated, refused and named by `scarab replay`.

use crate::command::{Folder, MUJOCO, Run, Table, assert_contains, base, reasons, recordings, scarab};
use serde_json::Value;
use std::fmt::Write as _;

/// Recording of the MuJoCo leg: time, angles and torques of both joints.
fn samples() -> Vec<[f64; 5]> {
    let table = Table::read(MUJOCO);
    table.rows.iter().map(|row| core::array::from_fn(|column| row[column])).collect()
}

fn csv(samples: &[[f64; 5]]) -> String {
    let mut text = String::from("t_s,q1_rad,q2_rad,tau1_Nm,tau2_Nm\n");
    for [time, q1, q2, tau1, tau2] in samples {
        writeln!(text, "{time:.7},{q1:.9},{q2:.9},{tau1:.9},{tau2:.9}").expect("memory");
    }
    text
}

/// Recording whose torque of a joint (from 0) is this many samples late.
fn late(joint: usize, by: usize) -> Vec<[f64; 5]> {
    let right = samples();
    let mut late = right.clone();
    for (index, row) in late.iter_mut().enumerate() {
        row[3 + joint] = right[index.saturating_sub(by)][3 + joint];
    }
    late
}

/// Identifies from two thirds of the samples.
fn replay(samples: &[[f64; 5]], arguments: &str, code: i32) -> (Value, Run) {
    let folder = Folder::new();
    folder.write("walk.csv", csv(samples));
    let arguments = format!("replay --leg mujoco-leg --split 0.666666 {arguments} @walk.csv");
    let (run, report) = folder.reported(&arguments, code);
    (report, run)
}

fn direction<'a>(report: &'a Value, name: &str, joint: usize) -> &'a Value {
    let all = report["directions"].as_array().expect("a list");
    let found = all.iter().find(|one| one["name"] == name && one["joint"] == joint);
    found.unwrap_or_else(|| panic!("{name} {joint}: {all:?}"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

const NAMES: [&str; 13] =
    ["ZZ1R", "HX1R", "HY1", "FC1", "FV1", "OFF1", "ZZ2", "HX2", "HY2", "IA2", "FC2", "FV2", "OFF2"];

/// Recording whose angles are those of an encoder at the joint with this many bits.
fn quantised(bits: i32) -> Vec<[f64; 5]> {
    let step = core::f64::consts::TAU / f64::from(1 << bits);
    samples()
        .into_iter()
        .map(|[time, q1, q2, tau1, tau2]| {
            let [q1, q2] = [q1, q2].map(|angle| (angle / step + 1e-6).floor() * step);
            [time, q1, q2, tau1, tau2]
        })
        .collect()
}

#[test]
fn coarse_encoders_widen_sigma_or_are_refused_with_a_lower_bandwidth() {
    let (clean, _) = replay(&samples(), "--bandwidth 8", 0);
    let (coarse, _) = replay(&quantised(12), "--bandwidth 8", 0);
    let widened = |name: &str| base(&coarse, name, "sigma") / base(&clean, name, "sigma");
    assert!(NAMES.into_iter().map(widened).fold(0.0, f64::max) > 1.5, "{:?}", NAMES.map(widened));
    let difference = |one: &Value, name: &str| {
        let [right, wrong] = [&clean, one].map(|report| base(report, name, "value"));
        (wrong - right).abs() / base(one, name, "sigma")
    };
    for name in NAMES {
        assert!(difference(&coarse, name) < 3.0, "{name}: {:.1} sigma", difference(&coarse, name));
    }
    let (refused, run) = replay(&quantised(10), "--bandwidth 16", 3);
    assert_eq!(refused["likely_cause"]["name"], "encoder_steps");
    run.prints("encoder too coarse at this bandwidth");
    let (chosen, _) = replay(&quantised(10), "--bandwidth auto", 0);
    assert_eq!(chosen["bandwidth_chosen"], true);
    assert!(number(&chosen["bandwidth_hz"]) < 8.0);
    for name in NAMES {
        assert!(difference(&chosen, name) < 3.0, "{name}: {:.1} sigma", difference(&chosen, name));
    }
}

/// Samples on another clock: interpolated at `rate_hz`, or with every second stamp a twentieth late.
fn on_another_clock(samples: &[[f64; 5]], rate_hz: Option<f64>) -> Vec<[f64; 5]> {
    let Some(rate_hz) = rate_hz else {
        let period = samples[1][0] - samples[0][0];
        let late = |(index, row): (usize, &[f64; 5])| {
            let mut row = *row;
            row[0] += if index % 2 == 1 { 0.05 * period } else { 0.0 };
            row
        };
        return samples.iter().enumerate().map(late).collect();
    };
    let (first, last) = (samples[0][0], samples[samples.len() - 1][0]);
    let count = ((last - first) * rate_hz).floor() as usize;
    let at = |index: usize| {
        let time = first + index as f64 / rate_hz;
        let right = samples.partition_point(|row| row[0] < time).clamp(1, samples.len() - 1);
        let (before, after) = (samples[right - 1], samples[right]);
        let share = (time - before[0]) / (after[0] - before[0]);
        core::array::from_fn(|column| before[column] + share * (after[column] - before[column]))
    };
    (0..=count).map(at).collect()
}

#[test]
#[ignore = "campaign: .ci/full"]
fn verdict_and_sigma_do_not_depend_on_the_time_stamps() {
    let samples = samples();
    let (even, _) = replay(&samples, "", 0);
    for rate_hz in [None, Some(400.0), Some(500.0), Some(1_000.0), Some(5_000.0)] {
        let (other, _) = replay(&on_another_clock(&samples, rate_hz), "", 0);
        for name in NAMES {
            let ratio = base(&other, name, "sigma") / base(&even, name, "sigma");
            assert!((0.9..1.1).contains(&ratio), "{rate_hz:?}, {name}: {ratio:.3}");
        }
    }
}

#[test]
#[ignore = "campaign: .ci/full"]
fn a_larger_bandwidth_is_proposed_where_the_encoders_allow_it() {
    let (at_5_hz, run) = replay(&samples(), "--bandwidth 5", 0);
    let proposed = number(&at_5_hz["bandwidth_proposed_hz"]);
    assert!(proposed > 5.0);
    run.prints(&format!("`--bandwidth {proposed}`"));
    let (there, _) = replay(&samples(), &format!("--bandwidth {proposed}"), 0);
    assert!(there["bandwidth_proposed_hz"].is_null());
    let (chosen, _) = replay(&samples(), "--bandwidth auto", 0);
    // The proposal stays where Stribeck friction is searched for.
    assert!(number(&chosen["bandwidth_hz"]) >= proposed && chosen["bandwidth_proposed_hz"].is_null());
}

/// A search at a bandwidth where one count's pulse looks like a Stribeck curve would find the encoder.
#[test]
fn encoders_too_coarse_for_the_stribeck_search_are_reported_with_its_bandwidth() {
    let (coarse, run) = replay(&quantised(14), "--bandwidth 8", 0);
    let proposed = number(&coarse["bandwidth_for_stribeck_hz"]);
    assert!(proposed < 8.0 && coarse["bandwidth_proposed_hz"].is_null(), "{proposed}");
    run.prints(&format!("`--bandwidth {proposed}` searches for it"));
    run.prints("not searched: the encoder is too coarse");
    let (there, _) = replay(&quantised(14), &format!("--bandwidth {proposed}"), 0);
    assert!(there["bandwidth_for_stribeck_hz"].is_null());
}

/// Without a held-out excitation the limit of the test of lengths is wide.
#[test]
fn lengths_that_a_recording_hardly_tests_are_reported() {
    let (report, run) = replay(&samples(), "", 0);
    let tests = report["findings"].as_array().expect("a list");
    let wide = tests.iter().any(|test| test["test"] == "link_length" && number(&test["limit"]) > 0.1);
    let words = "length of the link before joint 2: this recording shows only errors above";
    assert_eq!(run.printed.contains(words), wide, "{}", run.printed);
}

#[test]
fn sigma_states_its_parts_by_noise_and_by_misfit() {
    let (report, run) = replay(&samples(), "", 0);
    run.prints("of noise");
    run.prints("of misfit");
    for name in NAMES {
        let [sigma, noise, misfit] =
            ["sigma", "sigma_noise", "sigma_misfit"].map(|part| base(&report, name, part));
        assert!(
            noise > 0.0 && misfit > 0.0 && sigma >= noise.max(misfit),
            "{name}: {sigma} {noise} {misfit}"
        );
    }
}

/// Where nothing touches the leg, other damage is not reported as contact.
#[test]
#[ignore = "campaign: .ci/full"]
fn damage_of_the_recording_is_not_called_contact() {
    let right = samples();
    let changed = |change: &dyn Fn(usize, &mut [f64; 5])| {
        let mut rows = right.clone();
        rows.iter_mut().enumerate().for_each(|(index, row)| change(index, row));
        rows
    };
    let half = right.len() / 2;
    let clipped = changed(&|_, row| row[3] = row[3].clamp(-8.0, 8.0));
    let flipped = changed(&|index, row| {
        if index > half {
            row[3] = -row[3];
        }
    });
    for (name, rows) in
        [("10 bits", quantised(10)), ("12 bits", quantised(12)), ("clipped", clipped), ("flipped", flipped)]
    {
        for bandwidth in ["8", "16"] {
            let folder = Folder::new();
            folder.write("walk.csv", csv(&rows));
            let options = format!("--split 0.666666 --bandwidth {bandwidth} --json @report.json");
            folder.scarab(&format!("replay --leg mujoco-leg @walk.csv {options}"));
            let report = folder.json("report.json");
            assert!(!reasons(&report).contains(&"contact"), "{name} at {bandwidth} Hz: {report}");
        }
    }
}

#[test]
fn a_right_recording_is_accepted_and_reports_every_direction() {
    let (report, run) = replay(&samples(), "", 0);
    assert!(report["likely_cause"].is_null());
    for (name, joint, unit) in [
        ("delay", 1, "ms"),
        ("delay", 2, "ms"),
        ("encoder_scale", 1, "%"),
        ("encoder_scale", 2, "%"),
        ("torque_scale", 2, "%"),
    ] {
        let found = direction(&report, name, joint);
        assert_eq!((found["unit"].as_str(), found["passed"].as_bool()), (Some(unit), Some(true)));
        assert!(number(&found["value"]).abs() < 4.0 * number(&found["sigma"]), "{found}");
    }
    for ratio in report["misfit_over_noise"].as_array().expect("a list") {
        // The model is right, so the misfit is the noise, within the scatter of its estimate.
        assert!((number(ratio) - 1.0).abs() < 0.2, "{ratio}");
    }
    run.prints("torque of joint 1: ");
    run.prints(" ms ");
    run.prints("misfit over noise: joint 1: ");
}

#[test]
fn a_torque_20_ms_late_is_refused_with_its_joint_and_size() {
    for joint in [1, 2] {
        let (report, run) = replay(&late(joint - 1, 10), "", 3);
        assert!(reasons(&report).contains(&"residual"));
        let cause = &report["likely_cause"];
        assert_eq!((cause["name"].as_str(), cause["joint"].as_u64()), (Some("delay"), Some(joint as u64)));
        let (value, sigma) = (number(&cause["value"]), number(&cause["sigma"]));
        assert!((value - 20.0).abs() < 4.0 * sigma && sigma < 3.0, "{value} +- {sigma}");
        run.prints("likely cause: delay: torque of joint");
    }
}

#[test]
fn a_removed_delay_restores_the_parameters() {
    let (right, _) = replay(&samples(), "", 0);
    let (corrected, _) = replay(&late(1, 10), "--torque-delay 0,20", 0);
    for name in NAMES {
        let difference = base(&corrected, name, "value") - base(&right, name, "value");
        // The last 20 ms are missing.
        assert!(difference.abs() < 0.5 * base(&right, name, "sigma"), "{name}: {difference}");
    }
}

#[test]
fn small_stamp_errors_change_neither_verdict_nor_sigma() {
    let (right, _) = replay(&samples(), "", 0);
    let mut moved = samples();
    moved.iter_mut().step_by(2).for_each(|row| row[0] += 20e-6);
    for arguments in ["", "--even-stamps"] {
        let (report, _) = replay(&moved, arguments, 0);
        assert_eq!(report["reasons"], right["reasons"]);
        for name in NAMES {
            let ratio = base(&report, name, "sigma") / base(&right, name, "sigma");
            assert!((ratio - 1.0).abs() < 0.1, "{arguments} {name}: {ratio}");
        }
    }
}

#[test]
fn a_torque_of_the_wrong_sign_or_unit_is_named_and_is_not_called_computed() {
    for (name, factor) in [("torque_sign", -1.0), ("torque_unit", 1000.0)] {
        let mut wrong = samples();
        wrong.iter_mut().flat_map(|row| &mut row[3..]).for_each(|torque| *torque *= factor);
        let (report, run) = replay(&wrong, "", 3);
        assert_eq!(report["likely_cause"]["name"], name);
        assert!(factor > 0.0 || reasons(&report).contains(&"unphysical"), "{report}");
        assert!(!run.printed.contains("computed from the angle"), "{}", run.printed);
    }
}

/// Options that read the documented columns, with the torques as these signals.
fn reading(torques: &str, units: &str) -> String {
    format!("--columns t=t_s,q1=q1_rad,q2=q2_rad,{torques} --units {units}")
}

#[test]
#[ignore = "campaign: .ci/full"]
fn a_wrong_unit_is_named_once_with_the_options_that_read_it() {
    let mut torques = samples();
    torques.iter_mut().flat_map(|row| &mut row[3..]).for_each(|torque| *torque *= 1000.0);
    let mut angles = samples();
    angles.iter_mut().flat_map(|row| &mut row[1..3]).for_each(|angle| *angle = angle.to_degrees());
    let right = "tau1=tau1_Nm,tau2=tau2_Nm";
    for (samples, options, words) in [
        (torques, reading(right, "s,rad,mNm"), "is it in mN m?"),
        (angles, reading(right, "s,deg,Nm"), "read as degrees"),
    ] {
        let (report, run) = replay(&samples, "", 3);
        let cause = report["likely_cause"]["words"].as_str().expect("words");
        assert!(cause.ends_with(&format!("; read it so by {options}")), "{cause}");
        assert_eq!(run.printed.matches(words).count(), 1, "{}", run.printed);
        let explained = |reason: &&str| run.printed.contains(&format!("\n  {reason}: "));
        assert!(reasons(&report).iter().all(explained), "{}", run.printed);
        replay(&samples, &options, 0);
    }
}

#[test]
#[ignore = "campaign: .ci/full"]
fn two_wrong_units_are_named_together_with_the_options_that_read_them() {
    let folder = Folder::new();
    let leg = include_str!("../../../legs/mujoco-leg.toml");
    let encoder = "encoder = { side = \"joint\", counts = 16384, ratio = 1.0 }";
    let geared = leg.replace(encoder, "encoder = { side = \"motor\", counts = 8192, ratio = 30.0 }");
    let driven = leg.replacen("torque_per_ampere = 1.5", "torque_per_ampere = 2.5", 1);
    let driven = driven.replacen("torque_per_ampere = 1.5", "torque_per_ampere = 12.0", 1);
    let unknown = leg.replace("torque_per_ampere = 1.5\n", "");
    assert!(geared != leg && driven != leg && unknown != leg);
    let (degrees, motor_turns) = (1_f64.to_degrees(), 30.0 / core::f64::consts::TAU);
    let angles =
        |motor: bool| if motor { "t=t_s,motor1=q1_rad,motor2=q2_rad" } else { "t=t_s,q1=q1_rad,q2=q2_rad" };
    let torques = |current: bool| if current { "i1=tau1_Nm,i2=tau2_Nm" } else { "tau1=tau1_Nm,tau2=tau2_Nm" };
    let milli = 1000.0;
    for (leg, angle, factors, name, columns, units) in [
        (leg, degrees, [milli; 2], "units", (false, false), "s,deg,mNm"),
        (&geared, motor_turns, [1.0; 2], "angle_unit", (true, false), "s,turn,Nm"),
        (&geared, motor_turns, [milli; 2], "units", (true, false), "s,turn,mNm"),
        (&driven, 1.0, [milli / 2.5, milli / 12.0], "torque_current", (false, true), "s,rad,mA"),
        (&driven, degrees, [milli / 2.5, milli / 12.0], "torque_current", (false, true), "s,deg,mA"),
        (&unknown, 1.0, [milli / 2.5, milli / 12.0], "torque_current", (false, true), "s,rad,mA"),
    ] {
        let mut wrong = samples();
        for row in &mut wrong {
            row[1..3].iter_mut().for_each(|value| *value *= angle);
            row[3..].iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
        }
        folder.write("walk.csv", csv(&wrong));
        folder.write("leg.toml", leg);
        let report = |options: &str, code: i32| {
            let arguments = format!("replay --split 0.666666 {options} --leg @leg.toml @walk.csv");
            folder.reported(&arguments, code).1
        };
        let torque_report = report("", 3);
        let cause = &torque_report["likely_cause"];
        assert_eq!(cause["name"], name, "{units}: {cause}");
        let options = format!("--columns {},{} --units {units}", angles(columns.0), torques(columns.1));
        let words = cause["words"].as_str().expect("words");
        assert!(words.ends_with(&format!("; read it so by {options}")), "{units}: {words}");
        if !words.contains("Then state each joint") {
            report(&options, 0);
        }
    }
}

#[test]
#[ignore = "campaign: .ci/full"]
fn currents_that_were_read_as_torques_are_suspected_by_the_scale_of_the_prior() {
    const CONSTANT: f64 = 40.0;
    let folder = Folder::new();
    let leg = include_str!("../../../legs/mujoco-leg.toml");
    let stated = leg.replace("torque_per_ampere = 1.5", &format!("torque_per_ampere = {CONSTANT:?}"));
    let unknown = leg.replace("torque_per_ampere = 1.5\n", "");
    assert!(stated != leg && unknown != leg);
    let mut currents = samples();
    currents.iter_mut().flat_map(|row| &mut row[3..]).for_each(|torque| *torque /= CONSTANT);
    let run = |leg: &str, samples: &[[f64; 5]], arguments: &str| {
        folder.write("walk.csv", csv(samples));
        folder.write("leg.toml", leg);
        folder.scarab(&format!("replay --split 0.666666 {arguments} --leg @leg.toml @walk.csv"))
    };
    let options = reading("i1=tau1_Nm,i2=tau2_Nm", "s,rad,A");
    for (leg, words) in [
        (&stated, "and `torque_per_ampere` of the leg file explains it: is it a current?"),
        (
            &unknown,
            "in its shape: is it a current? Then state each joint's `torque_per_ampere` (by the prior about 3",
        ),
    ] {
        let suspected = run(leg, &currents, "");
        let all = format!("{}{}", suspected.printed, suspected.errors);
        for word in [words, &options] {
            assert_eq!(all.matches(word).count(), 1, "{word}: {all}");
        }
    }
    let read = run(&stated, &currents, &options).ends_with(0);
    assert!(!read.errors.contains("is it a current?"), "{}", read.errors);
    // Torques are not suspected, whatever constant the leg file states.
    let run = run(&stated, &samples(), "").ends_with(0);
    assert!(!run.errors.contains("is it a current?"), "{}", run.errors);
}

#[test]
fn impossible_torque_delays_are_refused() {
    let refused =
        |value: &str| scarab(&format!("replay {MUJOCO} --leg mujoco-leg --torque-delay {value}")).refusal();
    let message = refused("1,2,3");
    assert_contains(&message, "--torque-delay: 3 values; give one for all joints, or one for each of 2");
    assert!(refused("nan").contains("the limit is a tenth of the recording"));
    assert!(refused("9000").contains("the limit is a tenth of the recording"));
    assert!(refused("late").contains("invalid value 'late'"));
}

#[test]
fn a_real_arm_with_misfit_far_above_its_noise_is_accepted() {
    let Some(recordings) = recordings("the real arm") else { return };
    let folder = Folder::new();
    let file = |number: &str| recordings.join(format!("dp_A0/{number}.csv")).display().to_string();
    let files = ["00", "01", "03", "05", "13"].map(file).join(" ");
    let held_out = ["02", "04", "12"].map(file).join(" ");
    let arguments = format!("replay --leg dp-a0 --bandwidth 5 {files} --validate {held_out}");
    let (_, report) = folder.reported(&arguments, 0);
    let ratios = report["misfit_over_noise"].as_array().expect("a list");
    assert!(ratios.iter().all(|ratio| number(ratio) > 3.0), "{ratios:?}");
    // The shoulder's torque is really late, and its scale differs from the elbow's.
    let delay = direction(&report, "delay", 1);
    assert!((2.0..9.0).contains(&number(&delay["value"])), "{delay}");
    let scale = direction(&report, "torque_scale", 2);
    assert!(number(&scale["value"]) > 5.0 && scale["passed"] == true, "{scale}");
}

/// Recording with a torque added at the first joint: by the share of the recording, and the row.
fn added(torque: impl Fn(f64, &[f64; 5]) -> f64) -> Vec<[f64; 5]> {
    let mut samples = samples();
    let count = samples.len() as f64;
    for (index, row) in samples.iter_mut().enumerate() {
        row[3] += torque(index as f64 / count, row);
    }
    samples
}

#[test]
fn a_misfit_within_the_accepted_error_is_a_verdict_of_its_own() {
    let vibrating = |size: f64| added(move |_, row| size * scarab::real::sin_cos(6.0 * row[0]).0);
    let (clean, _) = replay(&samples(), "", 0);
    assert_eq!(clean["verdict"], "accepted");
    let (report, run) = replay(&vibrating(0.5), "", 0);
    assert_eq!(report["verdict"], "accepted_with_misfit");
    run.prints("verdict: accepted, with a misfit of ");
    run.prints("an error of 5 % of the rms torque is accepted");
    for name in NAMES {
        assert!(base(&report, name, "sigma") > 0.9 * base(&clean, name, "sigma"), "{name}");
    }
    assert!(report["likely_cause"].is_null(), "{}", report["likely_cause"]);
    let (report, run) = replay(&added(|share, _| 0.8 * (share - 0.5)), "", 0);
    assert_eq!(report["verdict"], "accepted_with_misfit");
    assert_eq!(report["likely_cause"]["name"], "offset_drift", "{}", report["likely_cause"]);
    run.prints("likely cause: offset drift: offset of joint 1 grows by 0.7");
    let (report, _) = replay(&vibrating(0.5), "--accept-error 0.5", 3);
    assert_eq!(report["verdict"], "refused");
    let (report, _) = replay(&vibrating(6.0), "", 3);
    assert!(reasons(&report).contains(&"validation"), "{:?}", reasons(&report));
    let (report, _) = replay(&vibrating(6.0), "--accept-error 60", 0);
    assert_eq!(report["verdict"], "accepted_with_misfit");
    let message = scarab(&format!("replay {MUJOCO} --leg mujoco-leg --accept-error 101")).refusal();
    assert_contains(&message, "--accept-error: must be 0 to 70 percent");
}

/// Recording with friction by this share of the load at the knee.
fn loaded(share: f64) -> Vec<[f64; 5]> {
    let right = samples();
    let mut loaded = right.clone();
    for (row, pair) in loaded.iter_mut().skip(1).zip(right.windows(3)) {
        let speed = (pair[2][2] - pair[0][2]) / (pair[2][0] - pair[0][0]);
        // Friction of the plant's knee.
        let load = row[4] - (2.0 * speed.signum() + 0.8 * speed);
        row[4] += share * speed.signum() * load.abs();
    }
    loaded
}

/// Recording with a spring of this stiffness at the knee, N m/rad, at rest at 0.8 rad.
fn sprung(stiffness: f64) -> Vec<[f64; 5]> {
    let mut samples = samples();
    samples.iter_mut().for_each(|row| row[4] += stiffness * (row[2] - 0.8));
    samples
}

#[test]
fn a_spring_or_friction_by_load_is_estimated_where_it_explains_the_misfit() {
    let (clean, _) = replay(&samples(), "", 0);
    assert!(clean.get("additional_torque").is_none());
    for (samples, kind, joint, size, line) in [
        (sprung(6.0), "spring", 2, 6.0, "model, joint 2: spring on (auto): "),
        (loaded(0.12), "load_friction", 2, 0.12, "model, joint 2: load_friction on (auto): "),
    ] {
        let folder = Folder::new();
        folder.write("walk.csv", csv(&samples));
        let arguments = "replay --split 0.666666 --csv @torque.csv --save-model @model.toml @walk.csv --leg";
        let (run, report) = folder.reported(&format!("{arguments} mujoco-leg"), 0);
        run.prints(line);
        let found = &report["additional_torque"][0];
        assert_eq!((found["kind"].as_str(), found["joint"].as_u64()), (Some(kind), Some(joint)));
        let [value, sigma] = ["value", "sigma"].map(|key| number(&found[key]));
        assert!((value - size).abs() < 4.0 * sigma, "{kind}: {value} +- {sigma}");
        for name in NAMES.into_iter().filter(|name| *name != "OFF2") {
            let [value, sigma, before] = [(&report, "value"), (&report, "sigma"), (&clean, "value")]
                .map(|(report, key)| base(report, name, key));
            assert!((value - before).abs() < 4.0 * sigma, "{kind}: {name} {value} +- {sigma}, not {before}");
        }
        // The model's torque contains it.
        folder.write(
            "states.csv",
            "q1,q2,qd1,qd2,qdd1,qdd2\n0.5,0.8,0,0,0,0\n0.6,0.9,0,0,0,0\n0.5,0.8,1e-3,1e-3,0,0\n0.5,0.8,-1e-3,-1e-3,0,0\n",
        );
        folder.scarab("predict --model @model.toml --states @states.csv --out @predicted.csv").ends_with(0);
        let predicted = folder.table("predicted.csv");
        let torque = predicted.column(&format!("tau{joint}_Nm"));
        if kind == "spring" {
            // Its error is made good by that of the offset and the weight.
            let band = predicted.column(&format!("tau{joint}_sigma_Nm"))[0];
            assert!(band < 0.5 * sigma * 0.8, "{band} N m, stiffness +- {sigma} N m/rad");
        }
        let change = if kind == "spring" {
            // The shank's posture is the same.
            (torque[1] - torque[0]) / 0.1
        } else {
            (0.5 * (torque[2] - torque[3]) - base(&report, "FC2", "value")) / torque[0].abs()
        };
        assert!((change / size - 1.0).abs() < 0.2, "{kind}: {change}");
        let leg = include_str!("../../../legs/mujoco-leg.toml")
            .replace("[[joint]]", "[[joint]]\nspring = \"off\"\nload_friction = \"off\"");
        folder.write("off.toml", leg);
        let run = folder.scarab("replay --split 0.666666 @walk.csv --leg @off.toml");
        run.prints(&format!("likely cause: {}", kind.replace('_', " ")));
    }
}

/// Damage of a size from 0 to 1.
type Damage = fn(f64) -> Vec<[f64; 5]>;

#[test]
#[ignore = "campaign: .ci/full"]
fn more_damage_is_never_judged_milder() {
    let kinds: [(&str, Damage); 7] = [
        ("offset drift", |size| added(|share, _| 30.0 * size * share)),
        ("torque drift", |size| added(|share, row| size * share * row[3])),
        ("step", |size| added(|share, _| if share > 0.5 { 20.0 * size } else { 0.0 })),
        ("vibration", |size| added(|_, row| 10.0 * size * scarab::real::sin_cos(6.0 * row[0]).0)),
        ("drive of the knee at the base", |size| added(|_, row| -size * row[4])),
        ("torque scale", |size| added(|_, row| 0.5 * size * row[3])),
        ("encoder scale", |size| {
            let mut samples = samples();
            samples.iter_mut().for_each(|row| row[2] *= 1.0 + 0.2 * size);
            samples
        }),
    ];
    let folder = Folder::new();
    for (kind, damaged) in kinds {
        let verdict = |step: i32| {
            folder.write("walk.csv", csv(&damaged(f64::from(1 << step) / 512.0)));
            let printed = folder.scarab("replay --leg mujoco-leg --split 0.666666 @walk.csv").printed;
            ["verdict: accepted (", "verdict: accepted, with a misfit", "verdict: refused"]
                .iter()
                .position(|verdict| printed.contains(verdict))
                .unwrap_or_else(|| panic!("{kind}: {printed}"))
        };
        let verdicts: Vec<usize> = (0..10).map(verdict).collect();
        assert!(verdicts.is_sorted() && verdicts[9] == 2, "{kind}: {verdicts:?}");
    }
}
