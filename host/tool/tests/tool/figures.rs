//! Figures of a run: complete, small, and consistent with the run.

use scarab_base::stats::rms;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::series::{Role, Series};
use scarab_rig::identify::identify_one;
use scarab_rig::options::SimulationOptions;
use scarab_rig::perturb::Perturbation;
use scarab_tool::view::figures;

use crate::command::{Folder, MUJOCO};
use scarab::model::Payload;

fn identified() -> (RunReport, Series) {
    let leg = LegFile::load("x2-wearer-75kg").expect("shipped");
    let options = SimulationOptions { with_series: true, ..SimulationOptions::with_seed(1) };
    identify_one(&leg, &options, None).expect("it runs")
}

#[test]
fn a_run_is_drawn_completely_and_small() {
    let (report, series) = identified();
    let drawn = figures::all(&["hip", "knee"], &report, &series).expect("it can be drawn");
    let read = |name: &str| {
        let figure = drawn.iter().find(|figure| figure.file == name);
        &figure.unwrap_or_else(|| panic!("no {name}")).svg
    };
    for name in [
        "identify.svg",
        "motions.svg",
        "torque-1.svg",
        "torque-2.svg",
        "residuals.svg",
        "search.svg",
        "base-parameters.svg",
    ] {
        let svg = read(name);
        roxmltree::Document::parse(svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(svg.starts_with("<svg width=\"900\""), "{name}");
        assert!(!svg.contains("NaN") && !svg.contains("inf,"), "{name}");
        // Suitable size for a repository.
        assert!(svg.len() < 200_000, "{name}: {} bytes", svg.len());
    }
    for base in &report.base_parameters {
        assert!(
            read("base-parameters.svg").contains(&base.name) && read("identify.svg").contains(&base.name)
        );
    }
    for motion in ["excitation (identified from)", "gait-6.5 (unused", "gait-3 (unused", "fourier (unused"] {
        assert!(read("torque-2.svg").contains(motion) && read("motions.svg").contains(motion), "{motion}");
    }
    // The knee deviates by half a degree: an axis with a zero label only has no scale.
    assert!(read("motions.svg").contains("\u{2212}0."), "the axis of the deviation has no labels");
    assert!(read("identify.svg").contains("kg m\u{b2}") && !read("identify.svg").contains("kg m2"));
    let curves = |svg: &str| svg.matches("<polyline").count();
    // Each of four motions has three torques and two residuals, and for two joints two angles and a
    // deviation.
    assert!(curves(read("torque-1.svg")) >= 20 && curves(read("motions.svg")) >= 24);
}

/// Overlaid curves refer to the same instant: each is compared with the one it must follow.
#[test]
fn curves_of_one_motion_share_their_time_base() {
    let (report, series) = identified();
    assert_eq!(series.motions.len(), 4);
    for motion in &series.motions {
        for (joint, curves) in motion.joints.iter().enumerate() {
            let points = motion.time_s.len();
            let lengths =
                [&curves.measured_deg, &curves.commanded_deg, &curves.noise_free_nm, &curves.predicted_nm];
            assert!(lengths.iter().all(|values| values.len() == points) && points > 300, "{}", motion.name);
            // The loop follows to 0.13 deg rms; the knee moves at 60 deg/s rms in places, so 20 ms
            // would be visible.
            let deviation =
                curves.measured_deg.iter().zip(&curves.commanded_deg).map(|(one, other)| one - other);
            assert!(rms(deviation) < 0.2, "{} {joint}", motion.name);
            // The table's error against the noise-free torque is below 1.3 %; a shift of a row by
            // 20 ms gives tens of percent.
            let moving = |still: &bool| !still;
            let error = curves.noise_free_nm.iter().zip(&curves.predicted_nm).zip(&curves.still);
            let error = error.filter(|(_, still)| moving(still)).map(|((one, other), _)| one - other);
            let size = rms(curves.noise_free_nm.iter().copied());
            assert!(rms(error) < 0.02 * size, "{} {joint}", motion.name);
            // The drawn residual equals the one in the table; training uses whole windows there,
            // cut ones here.
            let residual = rms(curves.residual_nm().flatten());
            let fits = if motion.role == Role::Training { &report.training } else { &report.validation };
            let name = if motion.role == Role::Training { "fourier" } else { motion.name.as_str() };
            let fit =
                fits.iter().find(|fit| fit.motion == name && fit.joint == joint + 1).expect("in the table");
            let table = fit.rms_nm.known().expect("known");
            assert!((residual / table - 1.0).abs() < 0.05, "{} {joint}: {residual}, {table}", motion.name);
        }
    }
    // Noise of 7 % of the mean torque behind the filter, as in the training's residual.
    for (joint, sigma) in series.noise_nm.iter().enumerate() {
        let training = report.training[joint].rms_nm.known().expect("known");
        assert!((sigma / training - 1.0).abs() < 0.03, "{sigma}, {training}");
    }
    assert!(series.excess.first().expect("a search").1 > 10.0, "a cold start is far from the optimum");
    assert!(series.excess.last().expect("a search").1 < 0.5);
}

#[test]
fn torques_corrected_by_a_known_mass_are_drawn_corrected() {
    let leg = LegFile::load("x2-wearer-75kg").expect("shipped");
    let options = SimulationOptions {
        with_series: true,
        perturbations: vec![Perturbation::TorqueConstant(1.2)],
        payload: Some(Payload { joint: 1, mass: 5.0, position: [0.2, 0.0, 0.0].into() }),
        ..SimulationOptions::with_seed(1)
    };
    let (report, series) = identify_one(&leg, &options, None).expect("it runs");
    for motion in &series.motions {
        let fits = if motion.role == Role::Training { &report.training } else { &report.validation };
        let name = if motion.role == Role::Training { "fourier" } else { motion.name.as_str() };
        for (joint, curves) in motion.joints.iter().enumerate() {
            let residual = rms(curves.residual_nm().flatten());
            let fit =
                fits.iter().find(|fit| fit.motion == name && fit.joint == joint + 1).expect("in the table");
            // Tolerance as above without a mass; a ratio on the wrong side gives 44 % of the
            // torque, 30 times that.
            let table = fit.rms_nm.known().expect("known");
            assert!((residual / table - 1.0).abs() < 0.05, "{} {joint}: {residual}, {table}", motion.name);
        }
    }
}

#[test]
fn a_recording_is_drawn_into_the_same_set_of_files() {
    let folder = Folder::new();
    let arguments = format!("replay {MUJOCO} --leg mujoco-leg --split 0.7 --figures @figures");
    folder.scarab(&arguments).ends_with(0);
    let read = |name: &str| folder.read(&format!("figures/{name}"));
    assert!(read("torque-1.svg").contains("fourier.csv (unused, predicted)"));
    assert!(!read("torque-1.svg").contains("noise-free"), "a recording has no noise-free torque");
    assert!(!read("motions.svg").contains("commanded"), "a recording has no commands");
    for name in ["torque-2.svg", "residuals.svg", "search.svg", "base-parameters.svg", "identify.svg"] {
        assert!(read(name).len() > 2000, "{name}");
    }
}
