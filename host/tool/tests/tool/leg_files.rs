//! Leg files: the shipped ones, their meaning, and every error with its line and message.

use hal_sim::mechanism::Mechanism;
use hal_sim::world::World;
use scarab::hal::LegDrives;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, EncoderFile, LegFile, SHIPPED_LEGS, Side, Switch};
use scarab_identify::leg::x2;

const MINIMAL: &str = "name = \"small\"
gravity = [9.81, 0.0, 0.0]

[[joint]]
name = \"hip\"
dh = { alpha = 0.0, a = 0.0, d = 0.0 }
";

const TRUTH: &str = "truth = { mass = 2.0, com = [0.2, 0.0, 0.0], inertia_com = [0.01, 0.0, 0.0, 0.05, 0.0, 0.05], coulomb = 3.0 }";

const MOTOR: &str = "[joint.motor]
pole_pairs = 7
resistance_ohm = 0.039
inductance_d_uh = 15.0
inductance_q_uh = 17.0
";

#[test]
fn every_shipped_leg_loads_under_its_name_and_survives_a_round_trip() {
    for (name, _) in SHIPPED_LEGS {
        let leg = LegFile::load(name).unwrap_or_else(|fault| panic!("{fault}"));
        assert_eq!(leg.name, name);
        assert!(leg.joints.iter().all(|joint| joint.prior.is_some()), "{name} has priors");
        assert_eq!(LegFile::parse(&leg.to_toml(), name).as_ref(), Ok(&leg));
    }
}

#[test]
fn the_shipped_default_leg_equals_its_derivation() {
    assert_eq!(LegFile::load(DEFAULT_LEG), Ok(x2::leg_file(x2::DEFAULT_WEARER_KG)));
}

#[test]
fn a_complete_drive_makes_the_torque_of_the_ideal_one_per_ampere() {
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let drives = leg.complete_description::<2>().expect("both joints have motors");
    for (joint, axis) in leg.joints.iter().zip(drives.axes) {
        let torque = 1.5 * f64::from(axis.motor.pole_pairs) * axis.motor.flux * axis.ratio;
        assert!((torque / joint.torque_per_ampere - 1.0).abs() < 1e-12, "{torque}");
        // A D5065 with 270 rpm/V has 8.27/270 N m/A; the leg's round figure is 2 % below.
        assert!((torque / axis.ratio / (8.27 / 270.0) - 1.0).abs() < 0.03);
    }
    let bare = LegFile::parse(&format!("{MINIMAL}{TRUTH}"), "small.toml").expect("without a motor");
    let fault = bare.complete_description::<1>().expect_err("nothing to simulate").to_string();
    assert_eq!(fault, "small: joint `hip` has no `[joint.motor]`: its complete drive cannot be simulated");
}

#[test]
fn missing_keys_have_the_documented_defaults() {
    let leg = LegFile::parse(MINIMAL, "small.toml").expect("minimal");
    assert_eq!((leg.torque_noise_percent, leg.pushes), (0.0, None));
    let joint = &leg.joints[0];
    assert_eq!((joint.direction, joint.zero_offset_deg, joint.range_deg), (1, 0.0, [-90.0, 90.0]));
    assert_eq!((joint.speed_limit_deg_s, joint.acceleration_limit_deg_s2), (180.0, 2000.0));
    assert_eq!((joint.torque_limit_nm, joint.torque_per_ampere, joint.drive_lag_s), (100.0, 1.5, 5e-4));
    assert_eq!(joint.encoder, EncoderFile { side: Side::Motor, counts: 8192, ratio: 50.0 });
    assert_eq!((joint.current_noise_a, joint.current_offset_a, joint.current_step_a), (0.0, 0.0, 0.0));
    assert_eq!((joint.offset, joint.rotor), (Switch::On, Switch::On));
    assert!((joint.current_limit() - 100.0 / 1.5).abs() < 1e-12);
    assert!(joint.truth.is_none() && joint.prior.is_none() && joint.stribeck.is_none());
    let with_truth = LegFile::parse(&format!("{MINIMAL}{TRUTH}"), "small.toml").expect("with truth");
    let truth = with_truth.joints[0].truth.expect("given");
    assert_eq!((truth.rotor_inertia, truth.coulomb, truth.viscous, truth.offset), (0.0, 3.0, 0.0, 0.0));
}

fn joint(lines: &str) -> String {
    format!("{MINIMAL}{lines}\n")
}

/// Texts, each with the line and the words of its error.
fn are_refused(cases: &[(String, Option<usize>, &str)]) {
    for (text, line, words) in cases {
        let fault = LegFile::parse(text, "bad.toml").expect_err(text);
        assert_eq!(fault.line, *line, "{fault}\n{text}");
        assert!(fault.reason.contains(words), "{fault}\nexpected: {words}");
        assert!(fault.to_string().starts_with(&format!("bad.toml:{}: ", line.unwrap_or(0))), "{fault}");
    }
}

/// Lines above the joints, each with the words of its error.
const LEG_ERRORS: [(&str, &str); 8] = [
    (
        "segments = { shank_m = 0.4, foot_m = 0.27, wearer_kg = 75.0, prior_wearer_kg = 70.0 }",
        "`segments` needs two joints, a hip and a knee",
    ),
    (
        "segments = { shank_m = 40.0, foot_m = 0.27, wearer_kg = 75.0, prior_wearer_kg = 70.0 }",
        "`segments.shank_m` is 40, outside 0.1..1",
    ),
    (
        "segments = { shank_m = 0.4, foot_m = 0.27, wearer_kg = 7500.0, prior_wearer_kg = 70.0 }",
        "`segments.wearer_kg` is 7500, outside 10..300",
    ),
    ("side = \"middle\"", "unknown variant `middle`"),
    (
        "supply = { voltage_v = 480.0, resistance_ohm = 0.05, capacitance_uf = 1500.0, brake_ohm = 2.0 }",
        "`supply.voltage_v` is 480, outside 22..50",
    ),
    ("supply_current_a = 0.1", "`supply_current_a` is 0.1, outside 0.5..500"),
    ("charge_current_a = 501.0", "`charge_current_a` is 501, outside 0.5..500"),
    ("brake = { release_ms = 60.0, engage_ms = 501.0 }", "`brake.engage_ms` is 501, outside 0..500"),
];

/// Lines of a joint, each with the words of its error.
const JOINT_ERRORS: [(&str, &str); 10] = [
    ("colour = \"red\"", "unknown field `colour`"),
    ("direction = 2", "joint `hip`: `direction` is 2; it must be 1 or -1"),
    ("range_deg = [-inf, 2.0]", "`range_deg` is -inf, outside -3600..3600"),
    ("speed_limit_deg_s = 0.0", "`speed_limit_deg_s` is 0; it must be above 0 and at most 2800"),
    ("torque_limit_nm = 1e6", "`torque_limit_nm` is 1000000; it must be above 0"),
    ("torque_per_ampere = nan", "`torque_per_ampere` is NaN"),
    ("encoder = { side = \"motor\", counts = 0, ratio = 50.0 }", "`encoder.counts` is 0"),
    ("encoder = { side = \"motor\", counts = 8192, ratio = 0.0 }", "`encoder.ratio` is 0"),
    ("encoder = { side = \"shaft\", counts = 8192, ratio = 1.0 }", "unknown variant `shaft`"),
    ("offset = \"maybe\"", "unknown variant `maybe`"),
];

#[test]
fn every_error_names_file_line_and_reason() {
    let above = |line: &str| MINIMAL.replace("[[joint]]", &format!("{line}\n[[joint]]"));
    are_refused(&LEG_ERRORS.map(|(line, words)| (above(line), Some(4), words)));
    are_refused(&JOINT_ERRORS.map(|(line, words)| (joint(line), Some(7), words)));
    are_refused(&[
        ("name = \"x\"\ngravity = [9.81, 0.0]\n".to_owned(), Some(2), "length 2"),
        ("name = \"x\"\ngravity = [9.81, 0.0, 0.0\n".to_owned(), Some(2), "array"),
        (MINIMAL.replace("name = \"small\"\n", ""), Some(1), "missing field `name`"),
        (MINIMAL.replace("gravity = [9.81, 0.0, 0.0]\n", ""), Some(1), "missing field `gravity`"),
        (MINIMAL.replace("dh = { alpha = 0.0, a = 0.0, d = 0.0 }\n", ""), Some(4), "missing field `dh`"),
        (MINIMAL.replace(", d = 0.0", ""), Some(6), "missing field `d`"),
        (MINIMAL.replace("\"small\"", "\"\""), Some(1), "`name` must be one line that is not empty"),
        (MINIMAL.replace("9.81", "nan"), Some(2), "`gravity` is NaN, outside -30..30"),
        (MINIMAL.replace("9.81", "981.0"), Some(2), "`gravity` is 981, outside -30..30"),
        (
            "name = \"x\"\ngravity = [0.0, 0.0, 0.0]\njoint = []\n".to_owned(),
            Some(3),
            "`joint` occurs 0 times; a leg has 1 to 3",
        ),
        (
            joint(&"[[joint]]\nname = \"a\"\ndh = { alpha = 0.0, a = 0.0, d = 0.0 }\n".repeat(3)),
            Some(4),
            "`joint` occurs 4 times",
        ),
        (
            joint("[[joint]]\nname = \"hip\"\ndh = { alpha = 0.0, a = 0.4, d = 0.0 }"),
            Some(8),
            "joint `hip`: `name` is the name of an earlier joint",
        ),
        (joint("\nrange_deg = [50.0, 2.0]"), Some(8), "`range_deg` is inverted or empty: 50 to 2"),
        (
            joint("dh.a = 9.0")
                .replace("dh = { alpha = 0.0, a = 0.0, d = 0.0 }", "dh.alpha = 0.0\ndh.d = 0.0"),
            Some(8),
            "`dh.a` is 9, outside -5..5",
        ),
        (
            format!("torque_noise_percent = -1.0\n{MINIMAL}"),
            Some(1),
            "`torque_noise_percent` is -1, outside 0..100",
        ),
        (
            format!("pushes = {{ per_minute = 0.0, torque_nm = 5.0, duration_s = 0.3 }}\n{MINIMAL}"),
            Some(1),
            "`pushes.per_minute` is 0",
        ),
    ]);
}

#[test]
fn every_error_of_a_motor_names_file_line_and_reason() {
    let motor = |key: &str, value: &str| {
        let (name, _) = key.split_once(" = ").expect("a key with its value");
        joint(&MOTOR.replace(key, &format!("{name} = {value}")))
    };
    are_refused(&[
        (joint("[joint.motor]\npoles = 7"), Some(8), "unknown field `poles`"),
        (joint("[joint.motor]\npole_pair = 7"), Some(8), "did you mean `pole_pairs`?"),
        (motor("resistance_ohm = 0.039", "39.0"), Some(9), "`motor.resistance_ohm` is 39, outside 0.001..10"),
        (motor("inductance_d_uh = 15.0", "1.5"), Some(10), "its time constant is below 0.08 ms"),
        (motor("pole_pairs = 7", "0"), Some(8), "`motor.pole_pairs` is 0, outside 1..64"),
        (
            joint(&format!("{MOTOR}calibration_turns = 2.1")),
            Some(12),
            "`motor.calibration_turns` is 2.1, outside 1.21..2",
        ),
        (
            joint(&format!("{MOTOR}winding_limit_c = 60.0")),
            Some(12),
            "`motor.winding_limit_c` is 60, outside 70..250",
        ),
        (
            joint(&format!(
                "{MOTOR}thermistor = {{ pull_up_ohm = 3300.0, r25_ohm = 10000.0, beta_k = 343.5 }}"
            )),
            Some(12),
            "`motor.thermistor` has `beta_k` 343.5, outside 1000..6000",
        ),
        (
            joint(&format!("{MOTOR}thermistor = {{ pull_up_ohm = 5e4, r25_ohm = 1e3, beta_k = 3435.0 }}")),
            Some(12),
            "`motor.thermistor` reads -102 to 44 degrees, needs -20 to 120: choose a smaller pull-up",
        ),
        (
            joint(&format!("{MOTOR}thermistor = {{ pull_up_ohm = 1e3, r25_ohm = 5e4, beta_k = 3435.0 }}")),
            Some(12),
            "choose a larger pull-up",
        ),
        (
            joint(&format!("encoder = {{ side = \"joint\", counts = 8192, ratio = 1.0 }}\n{MOTOR}")),
            Some(8),
            "joint `hip`: `motor` needs an encoder at the motor",
        ),
        (joint(&format!("torque_per_ampere = 0.01\n{MOTOR}")), Some(8), "has a flux of 0.000019 V s"),
    ]);
}

#[test]
fn every_error_of_a_body_names_file_line_and_reason() {
    let body = "[0.01, 0.0, 0.0, 0.05, 0.0, 0.05]";
    let truth = |mass: &str, inertia: &str| {
        joint(&format!(
            "direction = 1\ntruth = {{ mass = {mass}, com = [0.1, 0.0, 0.0], inertia_com = {inertia} }}"
        ))
    };
    are_refused(&[
        (truth("0.0", body), Some(8), "joint `hip`: `truth.mass` is 0; it must be above 0"),
        (truth("-1.0", body), Some(8), "`truth.mass` is -1"),
        (
            truth("2.0", "[0.01, 0.0, 0.0, 0.05, 0.0, -0.05]"),
            Some(8),
            "`truth.inertia_com` is not positive definite",
        ),
        (
            truth("2.0", "[0.01, 0.0, 0.0, 0.05, 0.0, 0.09]"),
            Some(8),
            "`truth.inertia_com` is impossible: a principal moment of 0.090000 is not below the sum 0.060000",
        ),
        (truth("2.0", "[0.01, 0.0, 0.0, 0.05, 0.0]"), Some(8), "length 5"),
        (truth("2.0", body).replace("truth", "prior").replace("2.0", "nan"), Some(8), "`prior.mass` is NaN"),
        (
            joint(&format!("{TRUTH}\nstribeck = {{ static_nm = 2.0, speed_rad_s = 0.1 }}")),
            Some(8),
            "`stribeck.static_nm` is 2, outside 3..1000",
        ),
    ]);
}

#[test]
fn the_error_of_a_missing_file_lists_the_shipped_legs() {
    let fault = LegFile::load("no-such-leg").expect_err("there is none").to_string();
    assert!(fault.starts_with("no-such-leg: cannot be read") && fault.contains("mujoco-leg"), "{fault}");
}

#[test]
fn a_leg_without_truth_or_with_another_number_of_joints_cannot_be_simulated() {
    let arm = LegFile::load("dp-a0").expect("shipped");
    let fault = arm.description::<2>().expect_err("no truth").to_string();
    assert_eq!(
        fault,
        "dp-a0: joint `shoulder` has no `truth`: the leg cannot be simulated; `replay` identifies from a recording"
    );
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let fault = leg.description::<3>().expect_err("two joints").to_string();
    assert_eq!(fault, "x2-wearer-75kg: has 2 joints, not 3");
}

#[test]
fn the_mujoco_leg_has_the_torques_of_its_simulation() {
    // Rows 0 and 1 of MuJoCo's noise-free record: joint angles, rates, accelerations and torques.
    let rows = [
        [0.099828014, -0.85715392, -0.05294382, 0.26802728, 0.11948001, 1.4387463, -3.6427595, -3.5831597],
        [0.099304697, -0.85439826, -0.051797402, 0.28239112, 0.10702225, 1.4421343, -3.6719179, -3.5637578],
    ];
    let description = LegFile::load("mujoco-leg").expect("shipped").description::<2>().expect("truth");
    let world = World::new(&description, 1);
    for [q1, q2, v1, v2, a1, a2, tau1, tau2] in rows {
        // Knee flexion is positive at the ports.
        let torque = world.inverse_dynamics(&[q1, -q2], &[v1, -v2], &[a1, -a2]);
        // The record has eight digits.
        assert!(
            (torque[0] - tau1).abs() < 1e-7 && (torque[1] + tau2).abs() < 1e-7,
            "{torque:?} {tau1} {tau2}"
        );
    }
}

#[test]
fn legs_hang_straight_down_at_their_anatomical_zero() {
    let chain = LegFile::load("paper-chain").expect("shipped").description::<3>().expect("truth");
    let mut world = World::new(&chain, 1);
    assert!(world.sample().joints.iter().all(|joint| joint.encoder_counts == 0));
    let at_zero = chain.joints.map(|joint| joint.zero_offset);
    let mechanism = Mechanism::new(&chain);
    let energy = |knee: f64| mechanism.potential_energy(&[at_zero[0], at_zero[1], at_zero[2] + knee]);
    // The knee's lowest position is off only by its centre of mass: atan(1.532 / 10.636) = 8.2 degrees.
    assert!(energy(0.0) < energy(0.3) && energy(0.0) < energy(-0.3));
    // Axis 1 lies along gravity: turning it does not change the potential energy.
    let turned = mechanism.potential_energy(&[0.5, at_zero[1], at_zero[2]]);
    assert!((turned - energy(0.0)).abs() < 1e-9);
}
