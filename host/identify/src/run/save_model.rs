//! Creates a model file from the report of a run.

use std::path::Path;

use scarab::ident::Estimate;
use scarab_base::error::ToolError;
use scarab_base::files;

use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::fingerprint;
use crate::formats::model_file::{
    BaseSet, Conditions, FullSet, MODEL_SCHEMA, ModelFile, StoredBase, StoredFit, StoredJoint, StoredLeg,
    StoredParameter, StoredStribeck,
};
use crate::leg::background::Background;
use crate::report::{FitReport, ModelDetail, RunReport};

impl<const N: usize, const B: usize> Background<N, B> {
    /// Further data for a model file. The covariance is symmetric up to rounding and is made
    /// exactly symmetric.
    pub(crate) fn detail(&self, dropped: &[bool; B], estimate: &Estimate<f32, B>) -> ModelDetail {
        let base = &self.model.base;
        let kept: Vec<usize> = self.kept(dropped).collect();
        let element = |row: usize, column: usize| {
            0.5 * (f64::from(estimate.covariance[row][column]) + f64::from(estimate.covariance[column][row]))
        };
        let carriers = kept.iter().filter_map(|&index| base.independent(index));
        let parameters =
            (0..N).flat_map(|joint| scarab::model::Parameter::ALL.map(|parameter| (joint, parameter)));
        ModelDetail {
            covariance: kept
                .iter()
                .map(|&row| kept.iter().map(|&column| element(row, column)).collect())
                .collect(),
            carriers: carriers.map(|(joint, parameter)| self.name(joint, parameter)).collect(),
            not_estimated: parameters
                .filter(|&(joint, parameter)| self.is_zero(dropped, joint, parameter))
                .map(|(joint, parameter)| self.name(joint, parameter))
                .collect(),
        }
    }
}

impl BaseSet {
    /// Base parameters of a run that have a value and a sigma, without Stribeck friction.
    pub fn from_run(run: &RunReport) -> Self {
        let detail = &run.detail;
        let stored = run.base_parameters.iter().zip(&detail.carriers).enumerate();
        let (kept, parameters): (Vec<usize>, Vec<StoredBase>) = stored
            .filter_map(|(index, (base, carrier))| {
                let stored = StoredBase {
                    name: base.name.clone(),
                    carrier: carrier.clone(),
                    value: base.value.known()?,
                    sigma: base.sigma.known()?,
                    unit: base.unit.to_owned(),
                    terms: base.terms.clone(),
                };
                Some((index, stored))
            })
            .unzip();
        let row = |row: &usize| kept.iter().map(|&column| detail.covariance[*row][column]).collect();
        let mut additional_torque = run.additional_torque.clone();
        for torque in &mut additional_torque {
            torque.shift = kept.iter().map(|&base| torque.shift[base]).collect();
        }
        Self {
            covariance: kept.iter().map(row).collect(),
            parameters,
            stribeck: Vec::new(),
            additional_torque,
        }
    }
}

impl ModelFile {
    /// Model of an accepted run with its bandwidth (Hz), dated now. `None` if the run was rejected:
    /// a wrong model is not stored.
    pub fn from_run(leg: &LegFile, run: &RunReport, bandwidth_hz: f64) -> Option<Self> {
        let leg = &with_identified_constants(leg, run);
        let base_set = BaseSet::from_run(run);
        if !run.accepted() || base_set.parameters.len() != run.detail.carriers.len() {
            return None;
        }
        let joints = leg.joints.iter().map(|joint| StoredJoint {
            name: joint.name.clone(),
            dh: joint.dh,
            direction: joint.direction,
            zero_offset_deg: joint.zero_offset_deg,
            range_deg: joint.range_deg,
            speed_limit_deg_s: joint.speed_limit_deg_s,
            torque_limit_nm: joint.torque_limit_nm,
            torque_per_ampere: joint.torque_per_ampere,
        });
        let full = run.parameters.iter().map(|parameter| StoredParameter {
            name: parameter.name.clone(),
            value: parameter.value.known(),
            sigma: parameter.sigma.known(),
            unit: parameter.unit.to_owned(),
            status: parameter.status.to_owned(),
        });
        let stribeck = run.stribeck.iter().map(|found| {
            Some(StoredStribeck {
                joint: found.joint,
                surplus_nm: found.surplus_nm.known()?,
                surplus_sigma_nm: found.surplus_sigma_nm.known(),
                speed_rad_s: found.speed_rad_s.known()?,
                speed_sigma_rad_s: found.speed_sigma_rad_s.known(),
            })
        });
        let stribeck = stribeck.collect::<Option<Vec<_>>>()?;
        let now = jiff::Timestamp::from_second(jiff::Timestamp::now().as_second()).ok()?;
        let model = Self {
            schema: MODEL_SCHEMA,
            checksum: String::new(),
            fingerprint: fingerprint(leg).ok()?,
            created: now.to_string(),
            scarab: env!("CARGO_PKG_VERSION").to_owned(),
            leg: StoredLeg {
                name: leg.name.clone(),
                side: leg.side,
                gravity: leg.gravity,
                joints: joints.collect(),
            },
            conditions: conditions(run, bandwidth_hz),
            base_set: BaseSet { stribeck, ..base_set },
            full_set: FullSet { parameters: full.collect() },
        };
        Some(model.sealed())
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ToolError> {
        files::write(path, self.to_toml())
    }
}

/// Leg with the identified torque constants if a known mass determined all of them; its torques are
/// then absolute.
fn with_identified_constants(leg: &LegFile, run: &RunReport) -> LegFile {
    let mut leg = leg.clone();
    if run.scale.scale == "absolute" {
        for (joint, constant) in leg.joints.iter_mut().zip(&run.scale.torque_constant) {
            joint.torque_per_ampere = constant.identified.known().unwrap_or(joint.torque_per_ampere);
        }
    }
    leg
}

fn conditions(run: &RunReport, bandwidth_hz: f64) -> Conditions {
    let training = run.training.iter().map(|fit| stored_fit(fit, "training"));
    let validation = run.validation.iter().map(|fit| stored_fit(fit, "validation"));
    Conditions {
        source: if run.seed.is_some() { "simulation" } else { "recording" }.to_owned(),
        verdict: run.verdict.to_owned(),
        scale: run.scale.scale.to_owned(),
        prior: run.prior.clone(),
        plan: run.plan.to_owned(),
        bandwidth_hz,
        motion_s: run.simulated_s,
        seed: run.seed.map(|seed| seed.to_string()),
        swarm_seed: run.swarm_seed.to_string(),
        condition: run.condition.known(),
        temperature_c: run.temperature_c.known(),
        not_estimated: run.detail.not_estimated.clone(),
        fits: training.chain(validation).collect(),
    }
}

fn stored_fit(fit: &FitReport, role: &str) -> StoredFit {
    StoredFit {
        joint: fit.joint,
        motion: fit.motion.clone(),
        role: role.to_owned(),
        rms_nm: fit.rms_nm.known(),
        percent_of_mean_abs: fit.percent_of_mean_abs.known(),
    }
}
