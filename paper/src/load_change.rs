//! Load-change experiment: the paper argues from it but does not show it.
//!
//! The paper states that combined values "are susceptible to load changes" and have to be identified again,
//! and that single values are not. Here the chain is identified, a mass unknown to the firmware is fixed to
//! its third link, and the chain is identified again. The identified changes are compared with the true ones.
//!
//! ```text
//! base' = base + K p_load       K: terms of the base parameters, p_load: the load's ten parameters
//! M_load = (HX2R' - HX2R) / a   a: length of the thigh; the other links' own parts cancel
//! ```
//!
//! A known load can thus be added to the combinations without any motion. The mass of an unknown
//! load follows from their difference, although the combinations themselves do not determine it.

use nalgebra::Vector3;
use scarab::ident::Plan;
use scarab::model::{INERTIAL_PARAMETERS, Payload, RigidBody};
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_base::shard::Shard;
use scarab_base::stats::rms;
use scarab_base::table::Table;
use scarab_identify::formats::leg_file::{LegFile, LinkParameters};
use scarab_identify::leg::setup;
use scarab_identify::report::{BaseReport, RunReport};
use serde::{Deserialize, Serialize};

use super::chain::{self, ChainOptions, Fit, JOINTS, NOISE_PERCENT, ROOM, median};
use super::printed::TABLE_FIVE;
use super::runs::{RowRuns, run_rows};
use super::{Part, Section};
use crate::digits::{number, percent};

/// Pairs of runs by default.
pub const RUNS: u64 = 20;
/// Offset of the second identification's noise seed.
const SECOND_STREAM: u64 = 1_000_000;
/// Changes above this limit count as detected, standard deviations.
const TOLD: f64 = 3.0;

/// Load on the last link near the foot, beside the plane of the leg.
pub fn load() -> Payload<f64> {
    Payload { joint: JOINTS - 1, mass: 5.0, position: Vector3::new(0.0, 0.40, 0.05) }
}

/// One combination before and after the load change.
#[derive(Clone, Debug, Serialize)]
pub struct ChangeLine {
    /// Name as in Table VI.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// True value before the change.
    pub truth: Number,
    /// Change of the true value.
    pub true_change: Number,
    /// Identified change, median.
    pub found_change: Number,
    /// Standard deviation of the identified change, median.
    pub sigma: Number,
    /// Identified change over its sigma, median.
    pub found_over_sigma: Number,
    /// Root mean square of (identified - true change) over sigma.
    pub error_over_sigma: Number,
    /// Share of the runs in which the change exceeded three sigma, 0..1.
    pub told_share: f64,
}

/// Torque error of the loaded chain on the verification motion.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LoadedTorque {
    /// Name of the parameter set.
    pub parameters: &'static str,
    /// Error in percent of each joint's mean absolute noise-free torque, median.
    pub percent_of_truth: [Number; JOINTS],
}

/// Report of the experiment.
#[derive(Clone, Debug, Serialize)]
pub struct LoadReport {
    /// Mass of the load, kg.
    pub load_kg: f64,
    /// Position in the third link's frame, m.
    pub load_place_m: [f64; 3],
    /// Pairs of runs.
    pub runs: u64,
    /// Noise per logged sample.
    pub noise_percent: f64,
    /// Parameters of Table V whose true values change.
    pub changed_of_table_v: Vec<&'static str>,
    /// Every base parameter.
    pub lines: Vec<ChangeLine>,
    /// Mass from the difference of HX2R, kg: median and sigma.
    pub mass_found_kg: [Number; 2],
    /// Torque errors with three sets of parameters.
    pub torque: Vec<LoadedTorque>,
}

/// Formats the section of these runs.
pub fn section(runs: &[Vec<LoadRun>]) -> Result<Section, ToolError> {
    let report = report(runs)?;
    Section::new(Part::LoadChange, "load_change", &report, words(&report), Vec::new())
}

/// Chain before and after the load change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoadRun {
    before: RunReport,
    after: RunReport,
    /// Torque errors of the loaded chain with each set of parameters, in the order of [`SETS`].
    fits: [[Fit; JOINTS]; SETS.len()],
}

/// Names of the parameter sets.
const SETS: [&str; 3] = ["before the change", "before the change, the known load added", "identified again"];

/// Identifies the chain before and after the change, for each seed.
pub fn runs(runs: u64, shard: Shard) -> Result<RowRuns<LoadRun>, ToolError> {
    let leg = chain::leg()?;
    let load = load();
    let heavier = loaded(&leg, &load)?;
    let model = setup::row_model::<JOINTS, ROOM>(&leg)?;
    let added = model.base.project(&load.parameters::<JOINTS>()).map(|value| value as f32);
    run_rows("load change", &[()], runs, shard, |(), seed| {
        let options = |seed| ChainOptions::new(seed, Plan::OneTime);
        let before = chain::run(&leg, &leg, &options(seed.search()))?;
        let after = chain::run(&heavier, &leg, &options(seed.search() + SECOND_STREAM))?;
        let with_load = core::array::from_fn(|base| before.values[base] + added[base]);
        let sets = [before.values, with_load, after.values];
        let fits = sets.map(|values| after.verification.fit(&after.model, &values));
        Ok(LoadRun { before: before.report, after: after.report, fits })
    })
}

/// Reports these runs.
pub fn report(runs: &[Vec<LoadRun>]) -> Result<LoadReport, ToolError> {
    let (leg, load) = (chain::leg()?, load());
    let pairs = runs.first().map_or(&[][..], Vec::as_slice);
    let names = pairs.first().map(|pair| pair.before.base_parameters.clone()).unwrap_or_default();
    let thigh = leg.joints[JOINTS - 1].dh.a;
    let masses = differences(pairs, "HX2R");
    let mass = |of: fn(&Difference) -> f64| median(masses.iter().map(of)).map(|value| value / thigh).into();
    Ok(LoadReport {
        load_kg: load.mass,
        load_place_m: load.position.into(),
        runs: pairs.len() as u64,
        noise_percent: NOISE_PERCENT,
        changed_of_table_v: changed(pairs),
        lines: names.iter().map(|base| change_line(base, pairs)).collect(),
        mass_found_kg: [mass(|change| change.found), mass(|change| change.sigma)],
        torque: torque(pairs),
    })
}

/// Leg with a mass fixed to a link.
fn loaded(leg: &LegFile, load: &Payload<f64>) -> Result<LegFile, ToolError> {
    let links = setup::links::<JOINTS>(leg, |joint| joint.truth.as_ref());
    let link = links.and_then(|links| links.get(load.joint).copied());
    let link = link.ok_or_else(|| leg.error("has no truth to load"))?;
    let mut sum = link.body.to_parameters();
    let added = load.parameters::<JOINTS>();
    for (value, added) in sum.iter_mut().zip(added[load.joint].iter().take(INERTIAL_PARAMETERS)) {
        *value += added;
    }
    let body = RigidBody::from_parameters(&sum).ok_or_else(|| leg.error("has no mass"))?;
    let mut loaded = leg.clone();
    if let Some(truth) = loaded.joints[load.joint].truth.as_mut() {
        let inertia = &body.inertia;
        *truth = LinkParameters {
            mass: body.mass,
            com: body.centre_of_mass.into(),
            inertia_com: [inertia.m11, inertia.m12, inertia.m13, inertia.m22, inertia.m23, inertia.m33],
            ..*truth
        };
    }
    Ok(loaded)
}

/// Identified change of one run.
struct Difference {
    found: f64,
    sigma: f64,
    truth: f64,
}

fn differences(pairs: &[LoadRun], name: &str) -> Vec<Difference> {
    let named = |run: &RunReport| run.base_parameters.iter().find(|base| base.name == name).cloned();
    let of = |pair: &LoadRun| -> Option<Difference> {
        let (before, after) = (named(&pair.before)?, named(&pair.after)?);
        Some(Difference {
            found: after.value.known()? - before.value.known()?,
            sigma: after.sigma.known()?.hypot(before.sigma.known()?),
            truth: after.truth.known()? - before.truth.known()?,
        })
    };
    pairs.iter().filter_map(of).collect()
}

fn change_line(base: &BaseReport, pairs: &[LoadRun]) -> ChangeLine {
    let changes = differences(pairs, &base.name);
    let of = |value: fn(&Difference) -> f64| -> Number { median(changes.iter().map(value)).into() };
    let count = changes.len().max(1) as f64;
    let scores = changes.iter().map(|change| (change.found - change.truth) / change.sigma);
    let told = changes.iter().filter(|change| change.found.abs() > TOLD * change.sigma).count();
    // Rounding error between two sums of the same numbers.
    let rounding = 1e-12 * base.truth.known().map_or(1.0, f64::abs).max(1.0);
    let truth = changes.first().map(|change| if change.truth.abs() < rounding { 0.0 } else { change.truth });
    ChangeLine {
        name: base.name.clone(),
        unit: base.unit,
        truth: base.truth,
        true_change: truth.into(),
        found_change: of(|change| change.found),
        sigma: of(|change| change.sigma),
        found_over_sigma: of(|change| change.found / change.sigma),
        error_over_sigma: rms(scores).into(),
        told_share: told as f64 / count,
    }
}

fn changed(pairs: &[LoadRun]) -> Vec<&'static str> {
    let Some(pair) = pairs.first() else { return Vec::new() };
    let truth = |run: &RunReport, name: &str| {
        run.parameters.iter().find(|found| found.name == name).and_then(|found| found.truth.known())
    };
    let moves = |name: &&str| match (truth(&pair.before, name), truth(&pair.after, name)) {
        (Some(before), Some(after)) => (after - before).abs() > 1e-9,
        _ => false,
    };
    TABLE_FIVE.iter().map(|line| line.name).filter(moves).collect()
}

fn torque(pairs: &[LoadRun]) -> Vec<LoadedTorque> {
    let percent_of = |set: usize| -> [Number; JOINTS] {
        let of = |joint: usize| pairs.iter().map(move |pair| pair.fits[set][joint].percent_of_truth);
        core::array::from_fn(|joint| median(of(joint)).into())
    };
    let sets = SETS.into_iter().enumerate();
    sets.map(|(set, parameters)| LoadedTorque { parameters, percent_of_truth: percent_of(set) }).collect()
}

fn words(report: &LoadReport) -> String {
    let mut changes = Table::default().label("").numbers([
        "truth before",
        "true change",
        "found change",
        "sigma",
        "found/sigma",
        "error/sigma",
        "beyond 3 sigma, % of runs",
    ]);
    for line in &report.lines {
        changes.row([
            line.name.clone(),
            number(line.truth),
            number(line.true_change),
            number(line.found_change),
            number(line.sigma),
            percent(line.found_over_sigma.known()),
            percent(line.error_over_sigma.known()),
            format!("{:.0}", 100.0 * line.told_share),
        ]);
    }
    let mut torques =
        Table::default().label("parameters").numbers(["joint 1, %", "joint 2, %", "joint 3, %"]);
    for set in &report.torque {
        let cells = set.percent_of_truth.map(|value| percent(value.known()));
        torques.row(core::iter::once(set.parameters.to_owned()).chain(cells));
    }
    let [x, y, z] = report.load_place_m;
    let changing = report.lines.iter().filter(|line| line.true_change.known() != Some(0.0)).count();
    format!(
        "{} kg at x {x}, y {y}, z {z} m of the third link, unknown to the firmware; {} pairs of runs, {} % noise, one-time, \
         medians. Of Table V's 20 parameters {} change ({}), of the {} base parameters {changing}; SI units.\n\n{}\n\
         The mass by the difference of HX2R: {} \u{b1} {} kg.\n\n\
         Torque of the loaded chain on the verification motion, error against the noise-free torque in percent of its mean \
         size:\n\n{}",
        report.load_kg,
        report.runs,
        report.noise_percent,
        report.changed_of_table_v.len(),
        report.changed_of_table_v.join(" "),
        report.lines.len(),
        changes.to_markdown(),
        number(report.mass_found_kg[0]),
        number(report.mass_found_kg[1]),
        torques.to_markdown(),
    )
}
