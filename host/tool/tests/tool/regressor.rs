//! `scarab regressor` compared with an independent rigid-body library.

use crate::command::{Folder, Table};
use scarab::real::sin_cos;
use serde_json::Value;
use std::io::Read;
use std::process::{Command, Stdio};

const REFERENCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/planar_hip_knee");
const ELEMENTS: [&str; 10] = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "HX", "HY", "HZ", "M"];

fn states() -> String {
    format!("{REFERENCE}/torque.csv")
}

/// Leg file of the reference: inertias about the centre of mass, with rotors, friction and offsets
/// that must have no effect.
fn leg(key: &str) -> String {
    let text = std::fs::read_to_string(format!("{REFERENCE}/truth.json")).expect("the reference");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    let mut leg = String::from("name = \"reference\"\ngravity = [9.81, 0.0, 0.0]\n");
    for (joint, link) in truth["links"].as_array().expect("links").iter().enumerate() {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] =
            ELEMENTS.map(|symbol| link[symbol].as_f64().expect("a number"));
        let [x, y, z] = [hx, hy, hz].map(|moment| moment / mass);
        // Parallel-axis theorem; the tensor's products are negative integrals.
        let inertia = [
            xx - mass * (y * y + z * z),
            xy + mass * x * y,
            xz + mass * x * z,
            yy - mass * (x * x + z * z),
            yz + mass * y * z,
            zz - mass * (x * x + y * y),
        ];
        let a = truth["dh"][joint]["a"].as_f64().expect("a number");
        leg += &format!(
            "[[joint]]\nname = \"joint {joint}\"\ndh = {{ alpha = 0.0, a = {a:?}, d = 0.0 }}\ndirection = -1\n\
             zero_offset_deg = 20.0\n{key} = {{ mass = {mass:?}, com = [{x:?}, {y:?}, {z:?}], inertia_com = \
             {inertia:?}, rotor_inertia = 0.5, coulomb = 3.0, viscous = 1.2, offset = 2.0 }}\n"
        );
    }
    leg
}

fn header() -> String {
    let mut names = vec!["k".to_owned(), "tau1".into(), "tau2".into()];
    for row in 1..=2 {
        for link in 1..=2 {
            names.extend(ELEMENTS.map(|symbol| format!("y{row}_{symbol}{link}")));
        }
    }
    names.join(",")
}

/// Largest errors of torques and of regressor elements, relative to the largest of each.
fn errors(table: &Table) -> (f64, f64) {
    let expected = Table::read(&states());
    let (mut error, mut largest) = (0.0_f64, 0.0_f64);
    for joint in ["1", "2"] {
        let torque = expected.column(&format!("tau_rigid{joint}"));
        for (ours, theirs) in table.column(&format!("tau{joint}")).iter().zip(torque) {
            error = error.max((ours - theirs).abs());
            largest = largest.max(theirs.abs());
        }
    }
    let torque_error = error / largest;
    (error, largest) = (0.0, 0.0);
    // The reference has a row per state and joint: k, joint, twenty elements.
    let expected = Table::read(&format!("{REFERENCE}/regressor.csv"));
    for (number, theirs) in expected.rows.iter().enumerate() {
        let ours = &table.rows[number / 2][3 + 20 * (number % 2)..][..20];
        for (ours, theirs) in ours.iter().zip(&theirs[2..]) {
            error = error.max((ours - theirs).abs());
            largest = largest.max(theirs.abs());
        }
    }
    (torque_error, error / largest)
}

#[test]
fn torque_and_regressor_are_those_of_the_reference_without_rotor_friction_and_offset() {
    let folder = Folder::new();
    folder.write("leg.toml", leg("truth"));
    let run = folder.scarab(&format!("regressor --dh --states {} --leg @leg.toml", states())).ends_with(0);
    assert_eq!(run.errors, "");
    let table = Table::parse(&run.printed);
    assert_eq!(table.header.join(","), header());
    assert_eq!(
        table.column("k"),
        (0..50).map(f64::from).collect::<Vec<_>>(),
        "the rows are numbered, not copied"
    );
    // The reference's files have 15 digits.
    let (torque, elements) = errors(&table);
    assert!(torque < 1e-12 && elements < 1e-12, "torque {torque:e}, regressor {elements:e}");

    // The device's arithmetic rounds about ten times, at 6e-8; a visible difference proves that it
    // was used.
    let arguments = format!("regressor --dh --f32 --states {} --leg @leg.toml", states());
    let run = folder.scarab(&arguments).ends_with(0);
    let (torque, elements) = errors(&Table::parse(&run.printed));
    assert!((1e-9..1e-6).contains(&torque), "torque {torque:e}");
    assert!((1e-9..1e-6).contains(&elements), "regressor {elements:e}");
}

#[test]
fn angles_are_anatomical_unless_the_option_dh_is_given() {
    let folder = Folder::new();
    // Direction -1, zero at 20 degrees.
    folder.write("leg.toml", leg("truth"));
    let zero = 20.0_f64.to_radians();
    let anatomical = [[0.4, 1.1], [-0.7, 0.9], [3.0, -5.0]];
    let [angles, speeds, accelerations] = anatomical;
    let chain = [angles.map(|angle| zero - angle), speeds.map(|v| -v), accelerations.map(|a| -a)];
    let printed = |option: &str, header: &str, numbers: [[f64; 2]; 3]| {
        let numbers: Vec<String> =
            numbers.as_flattened().iter().map(|number| format!("{number:e}")).collect();
        folder.write("states.csv", format!("{header}\n{}\n", numbers.join(",")));
        let run = folder.scarab(&format!("regressor {option} --leg @leg.toml --states @states.csv"));
        Table::parse(&run.ends_with(0).printed)
    };
    let short = "q1,q2,qd1,qd2,qdd1,qdd2";
    let dh = printed("--dh", short, chain);
    // A first moment along the first link hangs straight down at a D-H angle of 0.
    let gravity = 9.81 * sin_cos(zero - angles[0]).0;
    assert!((dh.column("y1_HX1")[0] - gravity).abs() < 1e-12, "{gravity}");
    // Column names of a recording are accepted too.
    for header in [short, "q1_rad,q2_rad,qd1_radps,qd2_radps,qdd1_radps2,qdd2_radps2"] {
        let own = printed("", header, anatomical);
        assert_eq!(own.header, dh.header);
        for (name, (own, dh)) in own.header.iter().zip(own.rows[0].iter().zip(&dh.rows[0])).skip(1) {
            // Torque and regressor row change sign with the angle; the angle is equal except for
            // its last bit.
            assert!((own + dh).abs() < 1e-12 * 60.0, "{name}: {own} {dh}");
        }
        assert!(own.column("tau1")[0].abs() > 1.0);
    }
}

#[test]
fn single_precision_rounds_the_states_too() {
    let folder = Folder::new();
    // 0.1 is not exact in either precision; the element is a copy of the acceleration.
    folder.write("states.csv", "q1,qd1,qdd1\n0,0,0.1\n");
    let element = |arguments: &str| {
        let run = folder.scarab(&format!("regressor --leg sp {arguments} --states @states.csv")).ends_with(0);
        Table::parse(&run.printed).column("y1_ZZ1")[0]
    };
    assert_eq!(element(""), 0.1);
    assert_eq!(element("--f32"), f64::from(0.1_f32));
}

#[test]
fn torque_uses_the_truth_else_the_prior_else_is_empty() {
    let folder = Folder::new();
    let states = states();
    let printed = |text: &str| {
        folder.write("leg.toml", text);
        folder.scarab(&format!("regressor --dh --states {states} --leg @leg.toml")).ends_with(0).printed
    };
    let truth = printed(&leg("truth"));
    assert_eq!(printed(&leg("prior")), truth);
    let with_both = leg("truth").replace(
        "[[joint]]",
        "[[joint]]\nprior = { mass = 1.0, com = [0.1, 0.0, 0.0], inertia_com = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1] }",
    );
    assert_eq!(printed(&with_both), truth);
    let bare: Vec<String> =
        leg("truth").lines().filter(|line| !line.starts_with("truth")).map(str::to_owned).collect();
    let bare = printed(&bare.join("\n"));
    for (bare, full) in bare.lines().zip(truth.lines()).skip(1) {
        let mut fields: Vec<&str> = full.split(',').collect();
        (fields[1], fields[2]) = ("", "");
        assert_eq!(bare, fields.join(","));
    }
}

#[test]
fn columns_are_found_by_name_for_any_number_of_joints() {
    let folder = Folder::new();
    let printed = |leg: &str, states: &str| {
        folder.write("states.csv", states);
        folder.scarab(&format!("regressor --leg {leg} --states @states.csv")).ends_with(0).printed
    };
    let plain = printed("sp", "q1,qd1,qdd1\n0.3,-1.5,20\n0.4,2,-3e1\n");
    let mixed = printed("sp", "note,qdd1,q2,q1,k,qd1\r\na,20,9,0.3,7,-1.5\r\n\r\nb,-30,9,0.4,8,2\r\n");
    assert_eq!(plain, mixed);
    assert_eq!(plain.lines().count(), 3);
    let states = "q1,q2,q3,qd1,qd2,qd3,qdd1,qdd2,qdd3\n0.1,0.2,0.3,1,2,3,4,5,6\n";
    let table = Table::parse(&printed("paper-chain", states));
    assert_eq!(table.header.len(), 1 + 3 + 3 * 30);
    assert!(table.rows[0].iter().all(|number| number.is_finite()));
}

#[test]
fn bad_states_are_refused_with_file_line_and_reason() {
    let folder = Folder::new();
    let refusal = |text: &str| {
        let states = folder.write("states.csv", text);
        let message = folder.scarab("regressor --leg sp --states @states.csv").refusal();
        message.replace(&states.display().to_string(), "states.csv")
    };
    assert_eq!(
        refusal("q1,qd1\n0,0\n"),
        "error: states.csv:1: the header has no column `qdd1`; its columns are: q1, qd1; needed are: q1, qd1, qdd1\n"
    );
    // Nothing is written before all states are valid; blank lines count.
    folder.write("states.csv", "q1,qd1,qdd1\n0,0,1e30\n\n0,0,1e39\n");
    let message = folder.scarab("regressor --leg sp --f32 --states @states.csv").refusal();
    let reason = ":4: the torque of this state exceeds the range of double precision\n";
    assert!(message.ends_with(reason), "{message}");
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let folder = Folder::new();
    // A megabyte: more than the capacity of any pipe.
    let text = "q1,qd1,qdd1\n".to_owned() + &"0.1,0.2,0.3\n".repeat(20_000);
    let states = folder.write("states.csv", &text);
    let mut tool = Command::new(env!("CARGO_BIN_EXE_scarab"))
        .args(["regressor", "--leg", "sp", "--states"])
        .arg(&states)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the tool runs");
    let mut first = [0; 5];
    tool.stdout.take().expect("piped").read_exact(&mut first).expect("some output");
    let output = tool.wait_with_output().expect("it ends");
    assert_eq!((&first, output.status.code()), (b"k,tau", Some(0)));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}
