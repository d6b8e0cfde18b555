//! Report of scale and load.

use scarab::model::Payload;
use scarab_base::number::Number;
use scarab_base::precision::{exact, sigma, value};
use scarab_base::words::{Word, word};
use serde::{Deserialize, Serialize};

use crate::report::RunReport;

/// Units of a run's parameters, and the load of the leg.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScaleReport {
    /// `relative` to the assumed torque constants, or `absolute`.
    #[serde(deserialize_with = "word")]
    pub scale: Word,
    /// Torque constants, one per joint; empty in a replay without a known mass, whose recordings contain
    /// torques.
    pub(crate) torque_constant: Vec<TorqueConstantReport>,
    /// Known mass of the second run.
    pub(crate) payload: Option<MassReport>,
    /// Known load in every run; the parameters exclude it.
    pub(crate) load: Option<MassReport>,
}

/// Torque constant of one joint, N m/A at the joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TorqueConstantReport {
    /// Joint, from 1.
    pub(crate) joint: usize,
    /// Constant assumed by the firmware.
    pub(crate) used: Number,
    /// Constant from the known mass; unknown if the joint is not loaded by it.
    pub(crate) identified: Number,
    /// Standard deviation of the identified constant.
    pub(crate) sigma: Number,
    /// Whether the two runs differ by the stated mass at the stated position, as far as this joint shows.
    pub(crate) consistent: Option<bool>,
    /// Whether the mass is heavy enough to determine this constant.
    #[serde(skip)]
    pub(crate) determined: bool,
}

/// A known mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MassReport {
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Joint whose link carries it, from 1.
    pub(crate) joint: usize,
    /// Position in the joint's frame, m.
    pub(crate) place: [f64; 3],
}

impl From<&Payload<f64>> for MassReport {
    fn from(payload: &Payload<f64>) -> Self {
        Self { mass: payload.mass, joint: payload.joint + 1, place: payload.position.into() }
    }
}

impl Default for ScaleReport {
    fn default() -> Self {
        Self { scale: "relative", torque_constant: Vec::new(), payload: None, load: None }
    }
}

/// Scale and load of a run in words, a line each; a replay has constants only with a known mass.
pub fn lines(run: &RunReport) -> Vec<String> {
    let scale = &run.scale;
    let mut lines = if scale.torque_constant.is_empty() { Vec::new() } else { constant_lines(scale) };
    if let Some(load) = &scale.load {
        lines.push(format!(
            "load: {} kg on link {} at x {}, y {} m subtracted; the parameters are those of the leg without it",
            load.mass, load.joint, load.place[0], load.place[1]
        ));
    }
    lines
}

fn constant_lines(scale: &ScaleReport) -> Vec<String> {
    let mut lines = Vec::new();
    let joints: Vec<String> = scale.torque_constant.iter().map(constant).collect();
    lines.push(format!("torque constants, N m/A: {}", joints.join("; ")));
    lines.push(match (scale.scale, &scale.payload) {
        ("absolute", _) => "scale: absolute, every torque corrected; sigma includes the constants' own".into(),
        (_, None) => "scale: relative to the torque constants used; a wrong constant scales every parameter and does not \
                      show in one run (--payload determines it)"
            .into(),
        (_, Some(_)) if scale.torque_constant.iter().any(|joint| joint.consistent == Some(false)) => {
            "scale: relative to the torque constants used; the two runs do not differ by the stated mass at the stated \
             position of a leg with these lengths and zeros, so the constants are not used"
                .into()
        }
        (_, Some(mass)) if scale.torque_constant.iter().any(|joint| joint.consistent.is_some() && !joint.determined) => format!(
            "scale: relative to the torque constants used; {} kg at that position are too light to determine the constants",
            mass.mass
        ),
        (_, Some(mass)) => format!(
            "scale: relative to the torque constants used; a mass on link {} does not load every joint",
            mass.joint
        ),
    });
    lines
}

fn constant(joint: &TorqueConstantReport) -> String {
    let used = exact(joint.used);
    match (joint.identified.known(), joint.consistent) {
        (Some(_), Some(consistent)) => format!(
            "joint {} used {used}, identified {} +- {}{}",
            joint.joint,
            value(joint.identified, joint.sigma),
            sigma(joint.sigma),
            match (consistent, joint.determined) {
                (false, _) => " (contradicted)",
                (true, false) => " (mass too light)",
                (true, true) => "",
            }
        ),
        _ => format!("joint {} used {used}", joint.joint),
    }
}

/// Constants of many runs, a line per joint; empty without a known mass.
pub fn summary(runs: &[RunReport]) -> Vec<String> {
    let joints = runs.first().map_or(0, |run| run.scale.torque_constant.len());
    (0..joints)
        .filter_map(|joint| {
            let found: Vec<&TorqueConstantReport> =
                runs.iter().filter_map(|run| run.scale.torque_constant.get(joint)).collect();
            let values: Vec<f64> = found.iter().filter_map(|joint| joint.identified.known()).collect();
            let (least, most) = values
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(*value), most.max(*value)));
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            let deviation = found.iter().filter_map(|joint| joint.sigma.known()).sum::<f64>() / values.len().max(1) as f64;
            let contradicted = found.iter().filter(|joint| joint.consistent == Some(false)).count();
            (!values.is_empty()).then(|| {
                format!(
                    "torque constant of joint {}, N m/A: identified {} on average ({} to {} in {} runs), sigma {}; used \
                     {}; contradicted in {contradicted}",
                    joint + 1,
                    value(mean.into(), deviation.into()),
                    value(least.into(), deviation.into()),
                    value(most.into(), deviation.into()),
                    values.len(),
                    sigma(deviation.into()),
                    exact(found.first().map_or(Number::UNKNOWN, |joint| joint.used)),
                )
            })
        })
        .collect()
}
