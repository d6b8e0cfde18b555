//! Runs the whole firmware on the paper's three-joint chain: one identification, then the paper's
//! verification motion.
//!
//! A separate runner is needed because `identify` validates on its own motions, while the paper verifies on
//! Equations (31) and (32). Here these replace the first validation motion. Everything else is as in
//! `identify`: the plant of hal-sim under the firmware's servo, its logging, identification and verdict.
//!
//! Every sample has the same weight (`identify --estimator plain`), as in the paper. The data have
//! no outliers; the robust estimator would reject the servo motion of the slow first joint.
//!
//! The plant is the leg file `paper-chain`: links 2 and 3 are the real values of the paper's Table
//! V. Rotors and friction are the leg file's; the paper's tables list neither.

use std::time::Instant;

use scarab::ident::record::recorder::STILL_SPEED;
use scarab::ident::{
    Ends, Estimator, Factor, FilteredRows, LARGEST_STILL_SHARE, Plan, Record, Recorder, RowModel, Smoothed,
    prior_parameters,
};
use scarab::leg::Segment;
use scarab::motion::{MotionError, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::Second;
use scarab_base::error::ToolError;
use scarab_base::stats::rms;
use scarab_base::words::exact;
use scarab_identify::formats::leg_file::{LegFile, Switch};
use scarab_identify::leg::motions::EXCITATION_CYCLES;
use scarab_identify::leg::setup;
use scarab_identify::report::RunReport;
use scarab_identify::report::series::Series;
use scarab_rig::options::SimulationOptions;
use scarab_rig::pair::{Context, PENDING, TAPS};
use scarab_rig::simulate::{Driven, drive};
use serde::{Deserialize, Serialize};

use super::verification;

/// Joints of the chain.
pub const JOINTS: usize = 3;
/// Capacity for its base parameters, of which there are 25.
pub const ROOM: usize = 28;
/// Name of its leg file.
pub const LEG: &str = "paper-chain";
/// Noise per logged 500 Hz sample, percent of each joint's mean absolute torque on the exciting motion.
pub const NOISE_PERCENT: f64 = 7.0;
/// Both methods, in the order of all tables.
pub const PLANS: [Plan; 2] = [Plan::OneTime, Plan::Sequential];

/// The chain as plant and as model: friction without a Stribeck curve, and no search for one.
pub fn leg() -> Result<LegFile, ToolError> {
    let mut leg = LegFile::load(LEG)?;
    leg.joints.iter_mut().for_each(|joint| joint.stribeck_model = Switch::Off);
    Ok(leg)
}

/// Options of one run.
#[derive(Clone, Copy, Debug)]
pub struct ChainOptions {
    /// Seed of noise and swarm.
    pub seed: u64,
    /// Noise as in [`NOISE_PERCENT`].
    pub noise_percent: f64,
    /// One-time or sequential.
    pub plan: Plan,
    /// Cycles of the exciting motion.
    pub cycles: u32,
    /// Whether curves are recorded.
    pub with_series: bool,
}

impl ChainOptions {
    /// The default motion at the default noise.
    pub fn new(seed: u64, plan: Plan) -> Self {
        Self { seed, noise_percent: NOISE_PERCENT, plan, cycles: EXCITATION_CYCLES, with_series: false }
    }
}

/// Results of a run.
pub struct ChainRun {
    /// Report as from `identify`; its first validation motion is the paper's.
    pub report: RunReport,
    /// Identified base parameters.
    pub values: [f32; ROOM],
    /// Least squares over all rows at once, with the same weight for every joint whatever its noise.
    pub unweighted: [f32; ROOM],
    /// Sign of the joints' anatomical angles and torques relative to the model's, 1 or -1.
    pub direction: [i64; JOINTS],
    /// Terms of the base parameters.
    pub model: RowModel<f32, JOINTS, ROOM>,
    /// The verification motion.
    pub verification: Verification,
    /// Curves; empty unless requested.
    pub series: Series,
}

/// One pass over the verification motion.
pub struct Verification {
    /// Rows through the filter of the identification, with the noise-free torque.
    pub noise_free: Vec<FilteredRows<f32, JOINTS, ROOM>>,
    /// Rows with the measured torque, as a factor.
    measured: Record<f32, JOINTS, ROOM>,
    /// Measured torque of these rows, N m.
    pub filtered_nm: Vec<[f32; JOINTS]>,
    /// All samples with their unfiltered measured torque.
    samples: Samples,
}

/// Motion and torque of each sample.
type Samples = Vec<Smoothed<f32, JOINTS>>;

/// Prediction error of one joint's torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Mean absolute noise-free torque, N m; all percentages refer to it.
    #[serde(with = "exact")]
    pub mean_absolute_nm: f64,
    /// Equation (33) against the noise-free torque, N m.
    #[serde(with = "exact")]
    pub rms_nm: f64,
    /// Equation (33) against the noise-free torque, percent.
    #[serde(with = "exact")]
    pub percent_of_truth: f64,
    /// Error against the measured torque behind the same filter, percent.
    #[serde(with = "exact")]
    pub percent_filtered: f64,
    /// Error against every measured sample as logged, percent.
    #[serde(with = "exact")]
    pub percent_of_samples: f64,
    /// Share of the rows excluded because the joint was at rest.
    #[serde(with = "exact")]
    pub still_share: f64,
}

impl Verification {
    /// Torque predicted by these base parameters against the actual one, Equation (33). Rows with the joint
    /// at rest are excluded, because friction at rest is undetermined.
    pub fn fit(&self, model: &RowModel<f32, JOINTS, ROOM>, values: &[f32; ROOM]) -> [Fit; JOINTS] {
        core::array::from_fn(|joint| {
            let moving =
                self.noise_free.iter().filter(|row| f64::from(row.still[joint]) <= LARGEST_STILL_SHARE);
            let (mut squared, mut absolute, mut used) = (0.0, 0.0, 0_usize);
            for row in moving {
                let torque = f64::from(row.torque[joint]);
                squared += (predicted(&row.regressor[joint], values) - torque).powi(2);
                absolute += torque.abs();
                used += 1;
            }
            let (rms_nm, mean_absolute_nm) =
                ((squared / used.max(1) as f64).sqrt(), absolute / used.max(1) as f64);
            let percent = |of: f64| 100.0 * of / mean_absolute_nm;
            let filtered = self.measured.torque_error(joint, values).map_or(f64::NAN, f64::from);
            Fit {
                mean_absolute_nm,
                rms_nm,
                percent_of_truth: percent(rms_nm),
                percent_filtered: percent(filtered),
                percent_of_samples: percent(self.sample_error(model, joint, values)),
                still_share: 1.0 - used as f64 / self.noise_free.len().max(1) as f64,
            }
        })
    }

    /// Root mean square error over the samples in which the joint moves.
    fn sample_error(&self, model: &RowModel<f32, JOINTS, ROOM>, joint: usize, values: &[f32; ROOM]) -> f64 {
        let moving =
            self.samples.iter().filter(|sample| f64::from(sample.velocity[joint].abs()) >= STILL_SPEED);
        rms(moving.map(|sample| {
            let rows = model.rows(sample);
            predicted(&rows.regressor[joint], values) - f64::from(sample.torque[joint])
        }))
    }
}

/// Torque of a regressor row with these base parameters, N m.
pub fn predicted(row: &[f32; ROOM], values: &[f32; ROOM]) -> f64 {
    row.iter().zip(values).map(|(&element, &value)| f64::from(element) * f64::from(value)).sum()
}

/// Identifies `plant` with a firmware configured for `believed`; the two differ if a load is
/// unknown to the firmware.
pub fn run(plant: &LegFile, believed: &LegFile, options: &ChainOptions) -> Result<ChainRun, ToolError> {
    let started = Instant::now();
    let simulation = SimulationOptions {
        torque_noise_percent: Some(options.noise_percent),
        plan: options.plan,
        estimator: Estimator::Plain,
        with_series: options.with_series,
        ..SimulationOptions::with_seed(options.seed)
    };
    let mut context = Context::<JOINTS, ROOM>::new(believed, &simulation)?;
    let truth = setup::links::<JOINTS>(plant, |joint| joint.truth.as_ref());
    context.background.truth = truth.map(|truth| prior_parameters(&truth));
    let unfit = |error| ToolError::input(format!("{}: no such exciting motion: {error:?}", believed.name));
    let excitation = repeated(&context.motions.excitation, options.cycles).map_err(unfit)?;
    (context.motions.excitation, context.configuration.excitation) = (excitation, excitation);
    let verifying = verification::motion(believed)?;
    (context.motions.validation[0], context.configuration.validation[0]) = (verifying, verifying);
    let Driven { pair, watch, stopped, .. } = drive(believed, plant, &context, &simulation, &mut ())?;
    let identification = pair.leg.identification();
    let found = identification.solver().zip(identification.validation().first().cloned().flatten());
    let Some((solver, measured)) = found.filter(|_| stopped.is_none()) else {
        let words = stopped.unwrap_or_else(|| "nothing was recorded".into());
        return Err(ToolError::input(format!("{}, seed {}: {words}", plant.name, options.seed)));
    };
    let model = identification.model().clone();
    let samples = watch.logged(Segment::Validation(0));
    let samples = samples.map(|logged| (logged.sample.position_rad, logged.sample.torque_nm));
    let (samples, filtered_nm) = smoothed(&model, context.configuration.bandwidth_hz, samples)?;
    let noise_free = watch.noise_free(0).to_vec();
    let verification = Verification { noise_free, measured, filtered_nm, samples };
    let (values, unweighted) = (solver.values(), unweighted(solver.record(), model.base.rank()));
    let (report, series, _) = watch.report(&pair, &simulation, Vec::new(), None, started)?;
    Ok(ChainRun {
        report,
        values,
        unweighted,
        direction: core::array::from_fn(|joint| believed.joints[joint].direction),
        model,
        verification,
        series,
    })
}

/// Repeats a motion for a number of cycles.
fn repeated(motion: &Periodic<JOINTS>, cycles: u32) -> Result<Periodic<JOINTS>, MotionError> {
    let blend = Second(motion.blend_ticks() as f32 / SERVO_RATE_HZ as f32);
    Periodic::new(*motion.curve(), blend, cycles, SERVO_RATE_HZ)
}

/// Least squares with the same weight for all joints.
fn unweighted(record: &Record<f32, JOINTS, ROOM>, rank: usize) -> [f32; ROOM] {
    let mut all = Factor::<f64, ROOM>::new();
    for factor in &record.factors {
        all.merge(&factor.convert());
    }
    all.solve(rank).map(|value| value as f32)
}

/// Motion and torque of every sample with complete windows, and the filtered torque of the rows.
fn smoothed(
    model: &RowModel<f32, JOINTS, ROOM>,
    bandwidth_hz: f32,
    samples: impl Iterator<Item = ([f32; JOINTS], [f32; JOINTS])>,
) -> Result<(Samples, Vec<[f32; JOINTS]>), ToolError> {
    let mut recorder = Box::new(
        Recorder::<f32, JOINTS, ROOM, TAPS, PENDING>::new(bandwidth_hz)
            .map_err(|_| ToolError::input("the filter does not fit the device"))?,
    );
    recorder.set_estimator(Estimator::Plain);
    recorder.clear(Ends::Whole);
    let (mut instants, mut filtered) = (Vec::new(), Vec::new());
    for (position, torque) in samples {
        let Some(progress) = recorder.push(model, &position, &torque) else { continue };
        instants.push(progress.instant);
        filtered.extend(progress.rows.map(|rows| rows.torque));
    }
    Ok((instants, filtered))
}

/// Median: the mean of the two middle values if their number is even.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<_> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        odd if odd % 2 == 1 => values.get(middle).copied(),
        _ => Some(0.5 * (values.get(middle - 1)? + values.get(middle)?)),
    }
}
