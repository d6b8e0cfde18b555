//! A leg identified through its board's current loops, motors and converters, compared with ideal drives.

use scarab_base::number::Number;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_identify::report::RunReport;
use scarab_rig::identify::{identify_many, identify_one};
use scarab_rig::options::{DriveModel, SimulationOptions};
use scarab_rig::pair::{Context, Pair};
use scarab_rig::perturb::Perturbation;

fn leg() -> LegFile {
    LegFile::load(DEFAULT_LEG).expect("shipped")
}

fn options(drive: DriveModel) -> SimulationOptions {
    SimulationOptions { drive, ..SimulationOptions::with_seed(3) }
}

fn identified(options: &SimulationOptions) -> RunReport {
    identify_one(&leg(), options, None).expect("it runs").0
}

/// Name of each base parameter, and its deviation from that of ideal drives in sigma of the latter.
fn deviations(ideal: &RunReport, full: &RunReport) -> Vec<(String, f64)> {
    let known = |number: Number| number.known().expect("solved");
    let pairs = ideal.base_parameters.iter().zip(&full.base_parameters);
    let found: Vec<_> = pairs
        .map(|(one, other)| (one.name.clone(), (known(other.value) - known(one.value)) / known(one.sigma)))
        .collect();
    assert_eq!(found.len(), 13);
    found
}

fn largest(deviations: &[(String, f64)]) -> f64 {
    deviations.iter().fold(0.0, |most, (_, deviation)| most.max(deviation.abs()))
}

#[test]
fn complete_drives_agree_with_ideal_ones_within_half_a_sigma() {
    let (ideal, full) = (identified(&options(DriveModel::Ideal)), identified(&options(DriveModel::Full)));
    assert!(full.accepted(), "{:?}", full.reasons);
    assert_eq!((ideal.drive, full.drive), (Some("ideal"), Some("full")));
    // The noise of the logged torque is identical in both runs: only drives and sensors differ.
    let found = deviations(&ideal, &full);
    assert!(largest(&found) < 0.5, "{found:?}");
}

/// Run: `cargo test --release --test firmware twenty -- --ignored --nocapture`, some two minutes.
#[test]
#[ignore = "campaign: .ci/full"]
fn twenty_complete_drives_agree_with_ideal_ones_within_half_a_sigma() {
    let runs = |drive, perturbations: &[Perturbation]| {
        let perturbed = |seed| SimulationOptions {
            drive,
            perturbations: perturbations.to_vec(),
            ..SimulationOptions::with_seed(seed)
        };
        let options: Vec<_> = (1..=20).map(perturbed).collect();
        identify_many(&leg(), &options).expect("they run")
    };
    let ideal = runs(DriveModel::Ideal, &[]);
    let compared = |full: &[RunReport]| -> Vec<(String, f64)> {
        ideal.iter().zip(full).flat_map(|(ideal, full)| deviations(ideal, full)).collect()
    };
    let full = runs(DriveModel::Full, &[]);
    let accepted = full.iter().filter(|run| run.accepted()).count();
    let found = compared(&full);
    println!("accepted {accepted} of 20, largest deviation of {}: {:.3} sigma", found.len(), largest(&found));
    // A trigger before the middle of the zero vector appears as viscous friction of the knee.
    let early = compared(&runs(DriveModel::Full, &[Perturbation::Trigger(-40.0)]));
    let friction =
        early.iter().filter(|(name, _)| name == "FV2").map(|(_, deviation)| deviation).sum::<f64>();
    println!("trigger 40 clocks before the middle: FV2 wrong by {:.2} sigma on average", friction / 20.0);
    assert_eq!(accepted, 20);
    assert!(largest(&found) < 0.5);
    assert!((3.0..6.0).contains(&(friction / 20.0)));
}

#[test]
fn a_leg_with_its_board_repeats_bit_for_bit() {
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
        // The drive holds the leg against gravity; friction may carry a part.
        assert!((torque[joint] - held[joint]).abs() < 6.0, "{torque:?} {held:?}");
    }
    assert!(pair.board.as_ref().is_some_and(|board| board.fault().is_none()));
}
