//! `scarab leg --new` and `--check`: answers become a file, missing keys become lines to paste.

use scarab_identify::formats::leg_file::LegFile;

use crate::command::{Folder, Run, assert_contains, run, scarab};
use crate::robots::SIMPLE;

/// Gravity, two joints and their numbers; empty lines take the value in brackets.
const ANSWERS: &str = "my-arm\n2\n\nhip\n\n\n\n\n\nknee\n\n0.45\n\n-1\n10\n";

/// Creates `arm.toml` from these answers on the tool's standard input.
fn answered(folder: &Folder, answers: &str) -> Run {
    let out = folder.path("arm.toml").display().to_string();
    run(["leg", "--new", "--out", &out].map(str::to_owned).into(), answers)
}

/// Report of the check of this leg file.
fn checked(folder: &Folder, name: &str) -> String {
    folder.scarab(&format!("leg --check @{name}")).ends_with(0).printed
}

/// Writes `pasted.toml`: the file with the lines that its check asks for in a section. Returns its report.
fn paste(folder: &Folder, name: &str, section: &str) -> String {
    let text = pasted(&folder.read(name), &checked(folder, name), section);
    folder.write("pasted.toml", &text);
    checked(folder, "pasted.toml")
}

#[test]
fn piped_answers_become_a_leg_file_that_the_check_accepts() {
    let folder = Folder::new();
    let out = folder.path("arm.toml");
    let run = answered(&folder, ANSWERS).ends_with(0);
    run.prints("or its three numbers (x): ");
    let next = format!("\nnext: {} leg --check {}\n", crate::PROGRAM, out.display());
    assert!(run.printed.ends_with(&next), "{}", run.printed);
    let leg = LegFile::load(&out.display().to_string()).expect("a leg file");
    assert_eq!((leg.name.as_str(), leg.gravity), ("my-arm", [9.81, 0.0, 0.0]));
    let knee = &leg.joints[1];
    assert_eq!((knee.dh.a, knee.direction, knee.zero_offset_deg), (0.45, -1, 10.0));
    let checked = checked(&folder, "arm.toml");
    for line in ["replay: ready", "simulation: keys are missing", "image: keys are missing"] {
        assert_contains(&checked, &format!("\n{line}\n"));
    }
}

#[test]
fn an_ended_input_or_an_existing_file_writes_nothing() {
    let folder = Folder::new();
    answered(&folder, "my-arm\n2\nx\n")
        .ends_with(2)
        .warns("the input ended before answer 4 (name of joint 1); nothing was written");
    assert!(!folder.path("arm.toml").exists());
    folder.write("arm.toml", "mine\n");
    answered(&folder, ANSWERS).refuses("exists and is not overwritten");
    assert_eq!(folder.read("arm.toml"), "mine\n");
}

/// Values for the words in capitals of a line to paste.
fn filled(line: &str) -> String {
    let line = line.split("  # ").next().unwrap_or(line);
    let known = [
        ("side = SIDE,", "side = \"motor\","),
        ("side = SIDE", "side = \"right\""),
        ("[X_M, Y_M, Z_M]", "[0.2, 0.0, 0.0]"),
        ("[XX, XY, XZ, YY, YZ, ZZ]", "[0.02, 0.0, 0.0, 0.1, 0.0, 0.11]"),
        ("[LOWER, UPPER]", "[0.0, 60.0]"),
        ("DEG_S2", "2000.0"),
        ("DEG_S", "180.0"),
        ("KG_M2", "0.2"),
        ("KG", "5.0"),
        ("NM_S_RAD", "1.0"),
        ("NM_A", "1.5"),
        ("NM", "60.0"),
        ("COUNTS", "8192"),
        ("RATIO", "50.0"),
        ("PAIRS", "7"),
        ("OHM", "0.039"),
        ("UH", "16.0"),
    ];
    known.iter().fold(line.to_owned(), |line, (word, value)| line.replace(word, value))
}

/// Leg file with the lines that the section of a report asks for.
fn pasted(text: &str, report: &str, section: &str) -> String {
    let begin = report.find(&format!("\n{section}: keys are missing\n")).expect("keys are missing");
    let lines = report[begin..].lines().skip(2).take_while(|line| line.starts_with("  "));
    let (mut top, mut joints): (String, Vec<(String, String)>) = (String::new(), Vec::new());
    for line in lines {
        match line.strip_prefix("    ") {
            Some(line) if joints.is_empty() => top += &format!("{}\n", filled(line)),
            Some(line) => joints.last_mut().expect("a joint").1 += &format!("{}\n", filled(line)),
            None => match line.trim().strip_prefix("[[joint]] ") {
                Some(name) => joints.push((name.to_owned(), String::new())),
                None => assert_eq!(line, "  before the first [[joint]]"),
            },
        }
    }
    let mut text = format!("{top}{text}");
    for (name, lines) in joints {
        // After the joint's last key, which is the comment for its motor.
        let begin = text.find(&format!("name = \"{name}\"")).expect("the joint");
        let end = text[begin..].find("\n[[joint]]").map_or(text.len(), |end| begin + end);
        text.insert_str(end, &format!("\n{lines}"));
    }
    text
}

#[test]
#[ignore = "campaign: .ci/full"]
fn pasted_lines_make_a_new_leg_ready_for_simulation_and_image() {
    let folder = Folder::new();
    answered(&folder, ANSWERS).ends_with(0);
    assert_contains(&paste(&folder, "arm.toml", "simulation"), "\nsimulation: ready\n");
    assert_contains(&paste(&folder, "pasted.toml", "image"), "\nimage: ready\n");
    // The other commands agree with the check.
    folder.scarab("fw --leg @pasted.toml --source @leg.rs").ends_with(0);
    let run = folder.scarab("identify --leg @pasted.toml");
    assert!([Some(0), Some(3)].contains(&run.code), "{}", run.errors);
}

#[test]
fn the_check_says_what_excite_needs() {
    ready_for_excite(&Folder::new());
}

#[test]
#[ignore = "campaign: .ci/full"]
fn a_leg_that_is_ready_for_excite_gets_a_motion() {
    let folder = Folder::new();
    ready_for_excite(&folder);
    folder.scarab("excite --torque-noise-nm 0.5 --evaluations 1800 --leg @pasted.toml").ends_with(0);
}

/// Writes `pasted.toml` with the lines that the check asks for.
fn ready_for_excite(folder: &Folder) {
    answered(folder, ANSWERS).ends_with(0);
    assert_contains(
        &checked(folder, "arm.toml"),
        "\nexcite: keys are missing\n  before the first [[joint]]\n    # no key: the option --torque-noise-nm NM",
    );
    assert_contains(&paste(folder, "arm.toml", "excite"), "\nexcite: ready\n");
}

#[test]
fn a_simulated_leg_without_rotor_and_friction_that_shakes_is_named() {
    let folder = Folder::new();
    // The upper arm of a robot as its description states it: a light link behind a heavy one.
    let body = "mass = 2.6, com = [0.05, 0.0, 0.0], inertia_com = [0.003, 0.0, 0.0, 0.005, 0.0, 0.005]";
    let tip = "mass = 1.9, com = [0.16, 0.0, 0.0], inertia_com = [0.002, 0.0, 0.0, 0.004, 0.0, 0.004]";
    let leg = |drive: &str| {
        format!(
            "name = \"arm\"\ngravity = [9.81, 0.0, 0.0]\n[[joint]]\nname = \"shoulder\"\n\
             dh = {{ alpha = 0.0, a = 0.0, d = 0.0 }}\ntruth = {{ {body}{drive} }}\n[[joint]]\nname = \"elbow\"\n\
             dh = {{ alpha = 0.0, a = 0.35, d = 0.0 }}\ntruth = {{ {tip}{drive} }}\n"
        )
    };
    folder.write("bare.toml", leg(""));
    let run = folder.scarab("identify --leg @bare.toml").ends_with(3);
    run.prints("input: the simulated leg shakes: for a second the speed of joint");
    run.prints("`rotor_inertia`, `coulomb` and `viscous` are 0");
    assert!(!run.printed.contains("something held the leg"), "{}", run.printed);
    folder.write("driven.toml", leg(", rotor_inertia = 0.1, coulomb = 0.5, viscous = 0.5"));
    folder.scarab("identify --leg @driven.toml").ends_with(0);
}

#[test]
fn a_forgotten_word_in_capitals_is_refused_with_its_line() {
    let folder = Folder::new();
    answered(&folder, ANSWERS).ends_with(0);
    let text = folder.read("arm.toml");
    for line in text.lines().filter_map(|line| line.strip_prefix("# ")).filter(|line| line.contains(" = ")) {
        folder.write("forgotten.toml", text.replacen(&format!("# {line}"), line, 1));
        folder.scarab("leg --check @forgotten.toml").refuses("forgotten.toml:");
    }
}

#[test]
fn the_check_of_a_robot_offers_its_prior_as_truth() {
    let folder = Folder::new();
    folder.write("robot.urdf", SIMPLE);
    folder.scarab("leg --urdf @robot.urdf --out @leg.toml").ends_with(0);
    let report = checked(&folder, "leg.toml");
    assert_contains(&report, "\nreplay: ready\n\nsimulation: keys are missing\n");
    assert_contains(&report, "    truth = { mass = 5.0, com = [0.2, 0.0, 0.0]");
    assert_contains(&report, "    # within `prior = { .. }`: rotor_inertia = KG_M2\n");
    let report = paste(&folder, "leg.toml", "simulation");
    assert_contains(
        &report,
        "\nsimulation: ready\n  its torque has no noise, unlike a real one: --torque-noise 7",
    );
    for (leg, words) in
        [("none.toml", "cannot be read"), ("sp", "image: not possible: an image supports two joints")]
    {
        let run = scarab(&format!("leg --check {leg}"));
        assert!(run.printed.contains(words) || run.errors.contains(words), "{}{}", run.printed, run.errors);
    }
}
