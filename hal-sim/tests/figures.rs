//! Figures of a run: all there, small, and about that run.

use std::path::Path;

use hal_sim::tool::identify::identify_one;
use hal_sim::tool::leg_file::LegFile;
use hal_sim::tool::report::RunReport;
use hal_sim::tool::setup::PriorChoice;
use hal_sim::tool::simulate::SimulationOptions;
use scarab::ident::Plan;

fn drawn(directory: &Path) -> RunReport {
    let leg = LegFile::load("x2-wearer-75kg").expect("shipped");
    let options = SimulationOptions {
        seed: 1,
        swarm_seed: 1,
        torque_noise_percent: None,
        plan: Plan::OneTime,
        prior: PriorChoice::Default,
        payload: None,
        load: None,
        with_series: false,
    };
    identify_one::<2, 13>(&leg, &options, None, Some(directory)).expect("it runs")
}

#[test]
fn a_run_is_drawn_completely_and_small() {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("figures");
    let report = drawn(&directory);
    let read = |name: &str| std::fs::read_to_string(directory.join(name)).expect("drawn");
    for name in
        ["torque-1.svg", "torque-2.svg", "base-parameters.svg", "search.svg", "motions.svg", "identify.svg"]
    {
        let svg = read(name);
        assert!(svg.starts_with("<svg width=\"900\"") && svg.trim_end().ends_with("</svg>"), "{name}");
        assert!(!svg.contains("NaN") && !svg.contains("inf,"), "{name}");
        // What a repository should hold.
        assert!(svg.len() < 200_000, "{name}: {} bytes", svg.len());
    }
    for base in &report.base_parameters {
        assert!(
            read("base-parameters.svg").contains(&base.name) && read("identify.svg").contains(&base.name)
        );
    }
    for motion in ["gait-6.5", "gait-3", "fourier"] {
        assert!(read("torque-2.svg").contains(motion) && read("motions.svg").contains(motion));
    }
    // Three curves and two residuals on each of three motions, and the legend's lines.
    let curves = |svg: &str| svg.matches("<polyline").count();
    assert!(curves(&read("torque-1.svg")) >= 15);
}
