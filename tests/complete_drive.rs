//! A leg identified through its board's current loops, motors and converters, beside the same with ideal drives.

use hal_sim::tool::identify::identify_one;
use hal_sim::tool::leg_file::{DEFAULT_LEG, LegFile};
use hal_sim::tool::pair::{Context, Pair};
use hal_sim::tool::report::RunReport;
use hal_sim::tool::simulate::{DriveModel, SimulationOptions};

fn leg() -> LegFile {
    LegFile::load(DEFAULT_LEG).expect("shipped")
}

fn options(drive: DriveModel) -> SimulationOptions {
    SimulationOptions { drive, ..SimulationOptions::of_seed(3) }
}

fn identified(drive: DriveModel) -> RunReport {
    identify_one::<2, 13>(&leg(), &options(drive), None).expect("it runs").0
}

#[test]
fn parameters_found_through_complete_drives_are_those_of_ideal_ones_within_their_sigma() {
    let (ideal, full) = (identified(DriveModel::Ideal), identified(DriveModel::Full));
    assert!(full.accepted(), "{:?}", full.reasons);
    assert_eq!((ideal.drive, full.drive), (Some("ideal"), Some("full")));
    for (one, other) in ideal.base_parameters.iter().zip(&full.base_parameters) {
        let known = |number: hal_sim::tool::report::Number| number.known().expect("solved");
        let (value, sigma) = (known(one.value), known(one.sigma));
        let deviation = (known(other.value) - value) / sigma.hypot(known(other.sigma));
        // Noise of its own in each run: thirteen normal deviations lie within 3.5 in 994 of 1000 cases.
        assert!(deviation.abs() < 3.5, "{}: {deviation}", one.name);
    }
}

#[test]
fn a_leg_with_its_board_is_one_value_that_repeats_to_the_bit() {
    let options = options(DriveModel::Full);
    let context = Context::<2, 13>::new(&leg(), &options).expect("the default leg");
    let mut pair = Pair::new(&leg(), &context, 3).expect("calibrated");
    assert!(pair.enable(context.gravity));
    for _ in 0..400 {
        pair.tick(None, context.gravity);
    }
    let mut copy = pair.clone();
    assert!(copy == pair);
    for _ in 0..400 {
        pair.tick(None, context.gravity);
        copy.tick(None, context.gravity);
    }
    assert!(copy == pair);
    let torque = pair.world.motor_torque();
    let held = pair.world.inverse_dynamics(&pair.world.anatomical_position(), &[0.0; 2], &[0.0; 2]);
    for joint in 0..2 {
        // The drive holds the leg against gravity; friction takes what it can.
        assert!((torque[joint] - held[joint]).abs() < 6.0, "{torque:?} {held:?}");
    }
    assert!(pair.board.as_ref().is_some_and(|board| board.fault().is_none()));
}
