//! The constant that an image holds of a leg, and the size of an image.

use hal_sim::tool::board::{BRAKE, axis_configuration, calibration_settings};
use hal_sim::tool::image::leg_source::{describe, source};
use hal_sim::tool::image::size::{ImageSize, Section};
use hal_sim::tool::leg_file::{DEFAULT_LEG, LegFile};
use scarab::board::odrive_v3_6::settings::drives;
use scarab::motor::AxisConfiguration;

fn leg(name: &str) -> LegFile {
    LegFile::load(name).expect("shipped")
}

#[test]
fn the_board_makes_of_the_constant_the_configuration_the_simulation_runs_with() {
    for name in [DEFAULT_LEG, "x2-rough", "mujoco-leg"] {
        let (description, configuration) = describe(&leg(name), 1).expect("two joints");
        let made = description.configuration::<13>().expect("the constant makes a leg");
        assert_eq!(made.joints, configuration.joints, "{name}");
        assert_eq!(made.model, configuration.model, "{name}");
        assert_eq!(made.prior, configuration.prior, "{name}");
        // Every motion tick by tick, to the last bit of the numbers that are stored and then one rounding.
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

/// What the board is told of its axes is what the simulation of the complete drive runs with.
#[test]
fn the_board_s_axes_are_those_of_the_simulated_drive() {
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
        assert_eq!(drives::CALIBRATION, calibration_settings(&axis, motor));
    }
    assert_eq!(drives::chopper(19.0), BRAKE);
    // On a board of 24 V too.
    drives::axes(&description, 11.0).iter().for_each(|axis| axis.check().expect("sensible"));
    assert!(scarab::motor::Chopper::new(drives::chopper(11.0)[0], drives::chopper(11.0)[1]).is_some());
}

#[test]
fn the_shipped_constant_is_the_default_leg_s() {
    let (description, _) = describe(&leg(DEFAULT_LEG), 1).expect("two joints");
    let shipped = include_str!("../legs/x2-wearer-75kg.rs");
    assert!(
        source(&description) == shipped,
        "the leg file changed: cargo fw --leg {DEFAULT_LEG} --source hal-sim/legs/{DEFAULT_LEG}.rs"
    );
}

#[test]
fn a_leg_that_no_image_holds_is_refused_by_name() {
    let refused = describe(&leg("sp"), 1).expect_err("one joint").to_string();
    assert!(refused.contains("two joints"), "{refused}");
}

#[test]
fn an_image_above_a_goal_is_named() {
    let section =
        |flash, memory, core_coupled| Section { name: ".x".into(), bytes: 0, flash, memory, core_coupled };
    let size = |sections| ImageSize { sections, code: Vec::new(), variables: Vec::new(), stack: 0 };
    assert!(size(vec![section(202 * 1024, 48 * 1024, 64 * 1024)]).missed().is_empty());
    let missed = size(vec![section(120_000, 40_000, 0), section(100_000, 10_000, 70_000)]).missed();
    assert_eq!(missed.len(), 3, "{missed:?}");
    assert!(missed[0].starts_with("flash: 220000 bytes"), "{missed:?}");
}
