//! Results of compensation and assistance as data.
//!
//! The names of the fields are an interface. Root mean squares (rms) are pooled over all seeds.

use serde::Serialize;

use scarab_base::number::Number;

/// Results of all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct AssistReport {
    /// Version of the JSON.
    pub(crate) schema: u32,
    /// Name in the leg file.
    pub leg: String,
    /// First and last seed.
    pub seeds: [u64; 2],
    /// Seeds whose identification was refused, with the reasons; they have no other result.
    pub refused: Vec<RefusedReport>,
    /// Shares that each mode requests.
    pub shares: Vec<SharesReport>,
    /// One row for each mode, motion and joint.
    pub rows: Vec<AssistRow>,
    /// Sessions with the identified model that ended by themselves.
    pub ended: usize,
    /// Energy given to limp and resisting wearers.
    pub energy: EnergyReport,
    /// Legs that oscillated at rest.
    pub limit_cycles: usize,
    /// Legs that were observed at rest.
    pub legs_at_rest: usize,
    /// Injected faults without the reaction that the catalogue demands; `null` if none were injected.
    pub missed: Option<usize>,
    /// Injected faults.
    pub faults: usize,
    /// Periodic assistance, one for each seed and cadence.
    pub periodic: Vec<PeriodicReport>,
    /// Differences of the two models against anthropometry: the wearer's leg.
    pub wearer_sums: Vec<WearerSum>,
    /// Body mass from those sums.
    pub body_mass: Option<BodyMassReport>,
    /// Stability limit of the inertia's share.
    pub stability: StabilityReport,
    /// Interaction torque over time, first seed.
    pub curves: Vec<InteractionCurve>,
}

/// A seed without accepted models.
#[derive(Clone, Debug, Serialize)]
pub struct RefusedReport {
    /// The seed.
    pub seed: u64,
    /// `empty` or `worn`.
    pub model: &'static str,
    /// Failed tests.
    pub reasons: Vec<&'static str>,
}

/// Shares of one mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SharesReport {
    /// `transparent`, `weight` or `periodic`.
    pub mode: &'static str,
    /// Share of friction's lower bound.
    pub friction: f64,
    /// Share of the inertia's lower bound.
    pub inertia: f64,
    /// Share of the wearer's weight.
    pub weight: f64,
    /// Share of the wearer's periodic torque; negative resists.
    pub periodic: f64,
}

/// Torques of one joint in one mode and motion.
///
/// Interaction torque: of the cuffs on the exoskeleton's joint, at the same motion of the wearer's leg.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AssistRow {
    /// `transparent`, `weight` or `periodic`.
    pub mode: &'static str,
    /// `gait 0.8 Hz`, `kicking`, `extension`, `reaching`.
    pub motion: String,
    /// Name of the joint.
    pub joint: String,
    /// Interaction torque with the drives off, N m rms.
    pub drives_off_rms_nm: Number,
    /// Only the empty leg's weight carried.
    pub gravity_only_rms_nm: Number,
    /// Compensation by the true parameters.
    pub true_model_rms_nm: Number,
    /// Compensation by the model that the firmware identified.
    pub identified_rms_nm: Number,
    /// Compensation by the prior of the leg file.
    pub prior_rms_nm: Number,
    /// Torque of the wearer's muscles in this mode, N m rms.
    pub wearer_rms_nm: Number,
    /// Torque of the wearer's muscles without the mode's assistance, N m rms: with the drives off in mode
    /// `transparent`, with that mode's shares in the others.
    pub wearer_without_rms_nm: Number,
    /// Share of the gravity torque of the wearer's leg that the muscles give, mode `weight` only.
    pub wearer_gravity_share: Number,
    /// That share without the mode's assistance.
    pub wearer_gravity_share_without: Number,
}

/// Energy that the exoskeleton gave to wearers who did nothing or resisted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyReport {
    /// Permitted energy, J.
    pub budget_j: f64,
    /// Most energy in a run, J.
    pub worst_j: Number,
    /// Random wearers, couplings, delays, models and payloads.
    pub runs: usize,
    /// Runs above the budget.
    pub exceeded: usize,
}

/// Periodic assistance of one seed at one cadence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PeriodicReport {
    /// The seed.
    pub(crate) seed: u64,
    /// Strides per second before the change of cadence.
    pub cadence_hz: f64,
    /// Cycles until the phase error stays below 5 % of a cycle.
    pub lock_cycles: f64,
    /// Cycles until it does so again after a change of cadence by 20 %.
    pub relock_cycles: f64,
    /// Phase error while locked, percent of a cycle rms.
    pub phase_error_percent: f64,
    /// Torque of the muscles over that without assistance, mean of the cycles outside of locking.
    pub mean_effort: f64,
    /// Largest such ratio of a cycle.
    pub largest_effort: f64,
    /// Energy given to a wearer who walked and then is limp, from the second cycle on, J.
    pub given_limp_j: f64,
    /// Energy given to one who then resists.
    pub given_resisting_j: f64,
}

/// Base sum of the wearer's leg: `worn` minus `empty`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WearerSum {
    /// `HX1R`, `ZZ2`.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Identified difference, mean of the seeds.
    pub value: Number,
    /// Its standard deviation for one seed, as reported by both models.
    pub sigma: Number,
    /// Standard deviation of the difference over the seeds.
    pub spread: Number,
    /// Sum of the wearer's segments by anthropometry.
    pub anthropometry: Number,
}

/// Body mass of the wearer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BodyMassReport {
    /// Estimate, kg.
    pub kg: f64,
    /// Its standard deviation, kg, without that of the assumption.
    pub sigma_kg: f64,
    /// What must be assumed: torque determines products of mass and distance only.
    pub assumption: &'static str,
}

/// Stability limits of the inertia's share.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StabilityReport {
    /// Share of viscous friction that is compensated too.
    pub friction_share: f64,
    /// Stiffness of the wearer's cuffs across the segment, N/m.
    pub stiffness_n_per_m: f64,
    /// Their damping, N s/m.
    pub damping_n_s_per_m: f64,
    /// Limit with these cuffs on a limp limb; 1 if no share is unstable.
    pub largest_share_limp: f64,
    /// Limit on a limb that is held still.
    pub largest_share_held: f64,
    /// Limits over the cuffs' stiffness.
    pub curves: Vec<StabilityCurve>,
}

/// Limit over stiffness at one damping.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StabilityCurve {
    /// `limp` or `held`.
    pub limb: &'static str,
    /// Damping across the segment, N s/m.
    pub damping_n_s_per_m: f64,
    /// Stiffness across the segment, N/m.
    pub stiffness_n_per_m: Vec<f64>,
    /// Largest stable share of inertia.
    pub largest_share: Vec<f64>,
}

/// Interaction torque of one joint over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InteractionCurve {
    /// As in [`AssistRow`].
    pub motion: String,
    /// Name of the joint.
    pub joint: String,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Drives off, N m.
    pub drives_off_nm: Vec<f64>,
    /// Only the empty leg's weight carried.
    pub gravity_only_nm: Vec<f64>,
    /// Transparent with the identified model.
    pub identified_nm: Vec<f64>,
}

impl AssistReport {
    /// What failed: refused models, energy, rest, faults, stability; empty if nothing did.
    pub fn failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        if let Some(refused) = self.refused.first() {
            failures.push(format!("model `{}` refused", refused.model));
        }
        let limit = self.stability.largest_share_held;
        if let Some(shares) = self.shares.iter().find(|shares| shares.inertia > limit) {
            let share = shares.inertia;
            failures.push(format!("inertia share {share:.2} above the largest stable one, {limit:.2}"));
        }
        if self.energy.exceeded > 0 {
            failures.push(format!("energy budget exceeded in {} runs", self.energy.exceeded));
        }
        if self.limit_cycles > 0 {
            failures.push(format!("limit cycles of {} legs at rest", self.limit_cycles));
        }
        if let Some(missed) = self.missed.filter(|missed| *missed > 0) {
            failures.push(format!("{missed} injected faults missed"));
        }
        failures
    }
}
