//! Leg constant of an image, and the size of an image.

use crate::command::assert_contains;
use scarab::board::odrive_v3_6::settings::drives;
use scarab::motor::{AxisConfiguration, CalibrationSettings, Calibrator};
use scarab::safety::{BrakeDelays, SupplyLimits, Thermistor};
use scarab::units::{Ampere, Ohm};
use scarab_identify::formats::leg_file::{BodySide, BrakeFile, DEFAULT_LEG, EncoderFile, LegFile, Side};
use scarab_identify::leg::posture::on_side;
use scarab_rig::board::{BRAKE, axis_configuration, calibration_settings};
use scarab_rig::image::leg_source::{describe, source};
use scarab_rig::image::size::{ImageSize, MEMORY_GOAL, Section};

fn leg(name: &str) -> LegFile {
    LegFile::load(name).expect("shipped")
}

#[test]
fn the_image_constant_gives_the_configuration_of_the_simulation() {
    let left = on_side(&leg(DEFAULT_LEG), BodySide::Left).expect("parallel axes");
    let mut geared = leg(DEFAULT_LEG);
    for (joint, (pole_pairs, counts, ratio)) in
        geared.joints.iter_mut().zip([(14, 4000, 36.0), (21, 16_384, 80.0)])
    {
        (joint.encoder.counts, joint.encoder.ratio) = (counts, ratio);
        joint.motor.as_mut().expect("the default leg has motors").pole_pairs = pole_pairs;
    }
    for (name, leg) in
        [("default", leg(DEFAULT_LEG)), ("rough", leg("x2-rough")), ("left", left), ("geared", geared)]
    {
        let (description, configuration) = describe(&leg, 1).expect("two joints");
        for (joint, made) in leg.joints.iter().zip(&description.joints) {
            let motor = joint.motor.expect("each of them has motors");
            assert_eq!(u32::from(made.motor.pole_pairs), motor.pole_pairs, "{name}");
            assert_eq!(made.motor.counts_per_turn, joint.encoder.counts, "{name}");
            // Joint torque per ampere = 3/2 pole pairs flux ratio.
            let constant = 1.5
                * f64::from(motor.pole_pairs)
                * f64::from(made.motor.flux.0)
                * f64::from(made.motor.ratio);
            assert!((constant / joint.torque_per_ampere - 1.0).abs() < 1e-6, "{name}");
        }
        let made = description.configuration::<13>().expect("the constant defines a leg");
        assert_eq!(made.joints, configuration.joints, "{name}");
        assert_eq!(made.model, configuration.model, "{name}");
        assert_eq!(made.prior, configuration.prior, "{name}");
        // Every motion is compared tick by tick: equal stored bits, then one rounding.
        for (one, other) in [(made.excitation, configuration.excitation)]
            .into_iter()
            .chain(made.validation.into_iter().zip(configuration.validation))
        {
            assert_eq!(one.duration_ticks(), other.duration_ticks(), "{name}");
            for tick in (0..one.duration_ticks()).step_by(97) {
                let (one, other) = (one.state_at(tick), other.state_at(tick));
                for joint in 0..2 {
                    let apart = (one.position_rad[joint] - other.position_rad[joint]).abs();
                    assert!(apart < 1e-6, "{name}, tick {tick}: {apart}");
                }
            }
        }
    }
}

/// The axis settings of the board equal those of the simulated complete drive.
#[test]
fn the_axes_of_the_board_are_those_of_the_simulated_drive() {
    let file = leg(DEFAULT_LEG);
    let (description, _) = describe(&file, 1).expect("two joints");
    for (joint, axis) in file.joints.iter().zip(drives::axes(&description, 19.0)) {
        let motor = joint.motor.as_ref().expect("the default leg has motors");
        let simulated = axis_configuration(joint, motor);
        // The speed is converted in one step there and in two here.
        let apart = (axis.greatest_speed.0 / simulated.greatest_speed.0 - 1.0).abs();
        assert!(apart < 1e-6, "{apart}");
        let greatest_speed = simulated.greatest_speed;
        assert_eq!(AxisConfiguration { greatest_speed, ..axis }, simulated, "{}", joint.name);
        axis.check().expect("sensible");
        // The board's motors carry gear and leg.
        let CalibrationSettings { inertia, .. } = drives::CALIBRATION;
        let settings = CalibrationSettings { inertia, ..calibration_settings(&axis, motor) };
        assert_eq!(drives::CALIBRATION, settings);
    }
    assert_eq!(drives::chopper(19.0), BRAKE);
    // Also on a 24 V board.
    drives::axes(&description, 11.0).iter().for_each(|axis| axis.check().expect("sensible"));
    assert!(scarab::motor::Chopper::new(drives::chopper(11.0)[0], drives::chopper(11.0)[1]).is_some());
}

/// With few pole pairs, first alignment and turn take more of a motor turn.
#[test]
fn a_calibration_on_the_board_may_travel_far_enough_to_pass_the_index() {
    for pole_pairs in [2, 4, 7, 21] {
        let mut file = leg(DEFAULT_LEG);
        for motor in file.joints.iter_mut().filter_map(|joint| joint.motor.as_mut()) {
            motor.pole_pairs = pole_pairs;
        }
        let (description, _) = describe(&file, 1).expect("two joints");
        let axes = drives::axes(&description, 19.0);
        for (axis, settings) in axes.iter().zip(drives::calibrations(&description)) {
            assert!(axis.index);
            assert!(Calibrator::new(axis, settings).is_ok(), "{pole_pairs} pole pairs: {settings:?}");
        }
    }
}

#[test]
fn the_shipped_constant_equals_the_default_leg() {
    let (description, _) = describe(&leg(DEFAULT_LEG), 1).expect("two joints");
    let shipped = include_str!("../../../legs/x2-wearer-75kg.rs");
    assert!(
        source(&description) == shipped,
        "the leg file changed: cargo fw --leg {DEFAULT_LEG} --source host/legs/{DEFAULT_LEG}.rs"
    );
}

#[test]
fn an_unsupported_leg_is_refused_by_name() {
    assert_contains(&describe(&leg("sp"), 1).expect_err("one joint").to_string(), "two joints");
}

#[test]
fn an_image_without_a_described_motor_is_refused() {
    let refused = |leg: &LegFile| describe(leg, 1).expect_err("no motor").to_string();
    let mut bare = leg(DEFAULT_LEG);
    bare.joints[1].motor = None;
    assert_contains(&refused(&bare), "joint `knee`: has no `[joint.motor]`");
    let mut coarse = leg(DEFAULT_LEG);
    coarse.joints[0].encoder = EncoderFile { side: Side::Joint, counts: 8192, ratio: 1.0 };
    assert_contains(&refused(&coarse), "joint `hip`: its encoder is at the joint");
}

/// Text of the default leg without the lines (of the first joint) that begin with a key.
fn without(key: &str) -> String {
    let mut left = false;
    let lines = include_str!("../../../legs/x2-wearer-75kg.toml").lines();
    let kept: Vec<&str> = lines
        .filter(|line| {
            left || {
                left = line.starts_with(key);
                !left
            }
        })
        .collect();
    assert!(left, "{key}");
    kept.join("\n")
}

#[test]
fn an_image_has_no_defaults_for_safety_relevant_keys() {
    let refused = |text: &str| {
        let file = std::env::temp_dir().join(format!("scarab-image-{}.toml", std::process::id()));
        std::fs::write(&file, text).expect("a temporary file");
        LegFile::parse(text, "leg.toml").expect("a leg, but not one for an image");
        let fault =
            LegFile::load_for_image(&file.display().to_string(), false).expect_err("a key is missing");
        std::fs::remove_file(&file).expect("the file exists");
        (fault.line, fault.reason)
    };
    for key in [
        "direction",
        "zero_offset_deg",
        "range_deg",
        "speed_limit_deg_s",
        "acceleration_limit_deg_s2",
        "torque_limit_nm",
        "prior",
    ] {
        let (line, reason) = refused(&without(key));
        assert!(reason.starts_with(&format!("joint `hip`: `{key}` is missing")), "{reason}");
        assert_eq!(line, Some(13), "the line of the joint");
    }
    let motor = include_str!("../../../legs/x2-wearer-75kg.toml");
    let (before, rest) = motor.split_once("[joint.motor]").expect("a motor");
    let (_, after) = rest.split_once("[[joint]]").expect("another joint");
    let (_, reason) = refused(&format!("{before}[[joint]]{after}"));
    assert!(reason.starts_with("joint `hip`: `motor` is missing"), "{reason}");
    // Without these keys the flux would be another motor's; the reader has no other default for a motor.
    let unmotored =
        |text: String| format!("{}[[joint]]{after}", text.split_once("[joint.motor]").expect("a motor").0);
    for key in ["torque_per_ampere", "encoder"] {
        let (_, reason) = refused(&unmotored(without(key)));
        assert_contains(&reason, &format!("`{key}`, `motor` are missing"));
    }
    let (line, reason) = refused(&without("side"));
    assert!(reason.starts_with("`side` is missing"), "{reason}");
    assert_eq!(line, None);
    for key in ["rotor_inertia", "coulomb", "viscous"] {
        let text = include_str!("../../../legs/x2-wearer-75kg.toml");
        let (before, prior) = text.split_once("\nprior").expect("a prior");
        let (first, rest) = prior.split_once(&format!("{key} = ")).expect("stated");
        let (_, rest) = rest.split_once(',').expect("another key");
        let (_, reason) = refused(&format!("{before}\nprior{first}{}", rest.trim_start()));
        assert!(reason.starts_with(&format!("joint `hip`: `prior.{key}` is missing")), "{reason}");
    }
    // The shipped exoskeleton legs state every key; the leg with an encoder at the joint does not.
    for name in [DEFAULT_LEG, "x2-rough"] {
        LegFile::load_for_image(name, false).expect("states everything");
    }
    let reason = LegFile::load_for_image("mujoco-leg", true).expect_err("no motor").reason;
    assert!(reason.starts_with("joint `hip`: `encoder.side` is \"joint\": the board commutates"), "{reason}");
    assert_contains(&reason, "`motor` are missing");
}

#[test]
fn a_leg_file_limits_the_travel_of_a_calibration() {
    let mut file = leg(DEFAULT_LEG);
    file.joints[1].motor.as_mut().expect("the default leg has motors").calibration_turns = Some(1.6);
    let (description, _) = describe(&file, 1).expect("two joints");
    let turns = drives::calibrations(&description).map(|settings| settings.travel_turns);
    assert_eq!(turns, [1.25, 1.6]);
}

#[test]
fn a_leg_file_limits_the_supply_current_of_image_and_simulation() {
    let mut file = leg(DEFAULT_LEG);
    assert_eq!((file.supply_limits().draw, file.supply_limits().charge), (None, None));
    (file.supply_current_a, file.charge_current_a, file.supply.brake_ohm) = (Some(20.0), Some(5.0), 3.0);
    let (description, _) = describe(&file, 1).expect("two joints");
    let limits = SupplyLimits { draw: Some(Ampere(20.0)), charge: Some(Ampere(5.0)), brake: Ohm(3.0) };
    assert_eq!((description.supply, file.supply_limits()), (limits, limits));
    assert!(source(&description).contains("supply: SupplyLimits {"));
    // Only a stated limit makes the simulated supply a battery.
    let takes = |file: &LegFile| file.complete_description::<2>().expect("motors").supply.takes_charge;
    assert_eq!([takes(&file), takes(&leg(DEFAULT_LEG))], [true, false]);
}

#[test]
fn a_leg_file_states_the_delays_of_a_holding_brake() {
    let mut file = leg(DEFAULT_LEG);
    let (description, _) = describe(&file, 1).expect("two joints");
    assert!(description.holding_brake.is_none() && !source(&description).contains("BrakeDelays"));
    file.brake = Some(BrakeFile { release_ms: 59.5, engage_ms: 40.0 });
    let (description, _) = describe(&file, 1).expect("two joints");
    let delays = BrakeDelays { release_ms: 60, engage_ms: 40 };
    assert_eq!((description.holding_brake, file.brake_delays()), (Some(delays), Some(delays)));
    assert!(source(&description).contains("use crate::safety::{BrakeDelays, SupplyLimits, WindingRating};"));
}

#[test]
fn a_leg_file_states_the_thermistors_of_its_motors() {
    let mut file = leg(DEFAULT_LEG).with_thermistors();
    file.joints[0].motor.as_mut().expect("a motor").thermistor = None;
    let (description, _) = describe(&file, 1).expect("two joints");
    let expected = Thermistor { pull_up: Ohm(3300.0), at_25_c: Ohm(10_000.0), beta_k: 3435.0 };
    assert_eq!(description.joints.map(|joint| joint.motor.thermistor), [None, Some(expected)]);
    let source = source(&description);
    assert!(source.contains("use crate::safety::{SupplyLimits, Thermistor, WindingRating};"));
    assert_contains(&source, "thermistor: None,");
    assert_contains(&source, "beta_k: 3435.0,");
}

#[test]
fn the_memory_goal_is_what_the_stack_leaves() {
    let layout = include_str!("../../../../src/board/odrive_v3_6/layout.x");
    let stack = format!("STACK_BYTES = {}K;", 128 - MEMORY_GOAL / 1024);
    assert!(layout.contains(&stack), "{stack}");
}

#[test]
fn an_image_above_a_goal_is_named() {
    let section =
        |flash, memory, core_coupled| Section { name: ".x".into(), bytes: 0, flash, memory, core_coupled };
    let size = |sections| ImageSize { sections, code: Vec::new(), variables: Vec::new(), stack: 0 };
    assert!(size(vec![section(384 * 1024, 72 * 1024, 64 * 1024)]).missed().is_empty());
    let missed = size(vec![section(300_000, 70_000, 0), section(100_000, 10_000, 70_000)]).missed();
    assert_eq!(missed.len(), 3, "{missed:?}");
    assert!(missed[0].starts_with("flash: 400000 bytes"), "{missed:?}");
    let warnings = [353_000, 354_000].map(|bytes| size(vec![section(bytes, 0, 0)]).warning());
    assert_eq!(warnings.map(|warning| warning.is_some()), [false, true]);
}
