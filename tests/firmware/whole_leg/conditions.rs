//! Legs that differ from the firmware's assumptions, and moving wearers.

use scarab::ident::Reason;
use scarab_base::number::Number;
use scarab_identify::formats::leg_file::PushesFile;

use super::*;

/// Runs the firmware of the default leg on another leg.
fn outcome(leg: &LegFile) -> (Option<Verdict>, DriveState) {
    let mut pair = enabled(leg, 1);
    let verdict = identify(&mut pair);
    let reasons: Vec<_> = verdict.iter().flat_map(|verdict| verdict.reasons()).map(Reason::name).collect();
    println!("verdict {reasons:?}, drive {:?}", pair.leg.control().state());
    assert_eq!(pair.leg.control().model(), None);
    (verdict, pair.leg.control().state())
}

#[test]
fn a_dead_motor_is_never_accepted() {
    for joint in 0..JOINTS {
        let mut leg = default_leg();
        leg.joints[joint].torque_per_ampere = 1e-3;
        let (verdict, state) = outcome(&leg);
        assert!(verdict.map_or(state.fault().is_some(), |verdict| !verdict.is_accepted()), "joint {joint}");
    }
}

#[test]
fn a_joint_with_a_third_of_its_torque_missing_is_refused() {
    for joint in 0..JOINTS {
        let mut leg = default_leg();
        leg.joints[joint].torque_per_ampere = 1.0;
        let (verdict, _) = outcome(&leg);
        assert!(verdict.is_some_and(|verdict| !verdict.is_accepted()), "joint {joint}");
    }
}

fn pushed(per_minute: f64, torque_nm: f64) -> RunReport {
    let pushes = Some(PushesFile { per_minute, torque_nm, duration_s: 0.5 });
    simulated(&LegFile { pushes, ..default_leg() }, &SimulationOptions::with_seed(1))
}

#[test]
fn hard_pushes_are_refused_with_every_number_known() {
    let report = pushed(60.0, 60.0);
    // With a push every second, too much of the training motion is excluded, but not of the held-out motions.
    assert_eq!(report.reasons, ["outliers"]);
    let known = |number: &Number| number.known().is_some();
    for base in &report.base_parameters {
        assert!([base.value, base.sigma, base.truth, base.cramer_rao].iter().all(known), "{}", base.name);
    }
    for fit in report.training.iter().chain(&report.validation) {
        let numbers =
            [fit.rms_nm, fit.percent_of_mean_abs, fit.percent_of_rms, fit.percent_of_mean_abs_vs_truth];
        assert!(numbers.iter().all(known), "{} {}", fit.motion, fit.joint);
    }
    assert!(known(&report.condition) && known(&report.bso.excess_chi2));
    // Without a model there is no tracking with it.
    assert!(report.tracking.iter().all(|joint| !known(&joint.rms_deg_with_model)));
}

#[test]
fn pushes_above_the_drive_s_torque_cause_a_reported_fault() {
    let report = pushed(200.0, 400.0);
    assert_eq!(report.reasons, ["input"]);
    let words = &report.findings.first().expect("the stop is reported").words;
    assert!(words.contains("the drive stopped during identification with fault 0x8400: joint "), "{words}");
}

#[test]
fn a_leg_outside_the_prior_is_refused_not_clamped() {
    let mut leg = default_leg();
    // The box reaches 5 times the prior's Coulomb friction of 4 N m.
    leg.joints[1].truth.as_mut().expect("simulated").offset = 25.0;
    let options = SimulationOptions::with_seed(1);
    assert_eq!(simulated(&leg, &options).reasons, ["unphysical"]);
    leg.joints[1].truth.as_mut().expect("simulated").offset = 9.0;
    assert!(simulated(&leg, &options).accepted());
}
