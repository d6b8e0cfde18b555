//! Predicts the result of an identification from a motion before anything moves.
//!
//! ```text
//! assumed leg + plant, no noise --> the firmware excites, logs, filters, excludes rows --> record
//! residual_i += v_i S (n_i - k_i / (m S))     v_i torque noise of joint i, S = sum h^2, m = 10     (I5)
//! record --> the firmware's weights, covariance, status
//! ```
//!
//! A whole run replaces a formula: the rows that count depend on where friction holds a joint, and that
//! depends on the position loop. One noise-free run with the real filter chain shows them in a tenth of a
//! second. The mean residual from noise is known ((I5) read backwards) and is added. All later steps are the
//! firmware's own code. This sigma is therefore the one that an identification reports, without its scatter.
//!
//! The run is undisturbed, so every row has the same weight (`Estimator::Plain`). Without noise the robust
//! estimator would treat each reversal as a disturbance. On data with noise only it costs less than a
//! hundredth of sigma.
//!
//! The run also shows the error without noise (`systematic`): its parameters minus the assumed ones.
//! Encoder steps, sticking and the drive's lag cause it. The value is one sample of an error that depends
//! on the motion; it is not a standard deviation, and averaging over runs does not remove it.

use hal_sim::world::TICK_S;
use scarab::hal::LegDrives;
use scarab::ident::{DECIMATION, Estimate, Estimator, Plan, Problem, Record, RowModel, Selection};
use scarab::leg::{Activity, ControlRequest, IdentifyPhase};
use scarab::motion::ExcitationTable;
use scarab::servo::{ServoOutput, TICKS_PER_LOG};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::excite::Seen;

use crate::excite::obstacle::{Limit, Obstacle, OperatingPoint};
use crate::options::SimulationOptions;
use crate::pair::{Context, Pair, start_position};

/// Limit of an excitation, s.
const LONGEST_S: f64 = 200.0;

/// Run of a motion on the assumed leg without noise.
#[derive(Clone, Debug)]
pub struct Rehearsal<const N: usize, const B: usize> {
    record: Record<f64, N, B>,
    model: RowModel<f64, N, B>,
    assumed: [f64; B],
    /// Standard deviation of each joint's logged torque according to the leg file, N m.
    pub(crate) noise_nm: [f64; N],
    /// Share of each joint's rows excluded at standstill.
    pub(crate) lost_share: [f64; N],
    /// Extremes of the plant's motion.
    pub(crate) seen: [Seen; N],
    /// Largest reduction of each joint's torque by the monitor.
    pub(crate) reduced: [Option<Obstacle>; N],
}

/// Expected result of one motion at one noise.
#[derive(Clone, Debug)]
pub(crate) struct Expectation<const N: usize, const B: usize> {
    /// Record with the mean effect of noise.
    pub(crate) record: Record<f64, N, B>,
    /// Covariance and determined parameters; values are those of the noise-free run.
    pub(crate) estimate: Estimate<f64, B>,
    /// ln det of the information of all base parameters.
    pub(crate) log_determinant: f64,
    /// Condition of the scaled, weighted problem.
    pub(crate) condition: Option<f64>,
    /// Base parameters minus those of the assumed leg, without any noise.
    pub(crate) systematic: [f64; B],
}

/// Runs a motion on the assumed leg.
///
/// # Errors
/// The leg cannot be simulated, or the drive stops.
pub fn rehearse<const N: usize, const B: usize>(
    assumed: &LegFile,
    table: &ExcitationTable<N>,
) -> Result<Rehearsal<N, B>, ToolError> {
    let options = SimulationOptions {
        estimator: Estimator::Plain,
        excitation: Some(scarab_identify::formats::excitation::Excitation::from_table(assumed, table)),
        ..SimulationOptions::with_seed(1)
    };
    let context = Context::<N, B>::new(assumed, &options)?;
    let motion = context.motions.excitation;
    let silent = Context { noise: [0.0; N], ..context.clone() };
    let mut pair = Pair::new(assumed, &silent, options.seed)?;
    stand(assumed, &context, &mut pair);
    if !pair.enable(context.gravity) {
        return Err(assumed.error("the drive refused to be enabled at the start").into());
    }
    let (mut seen, mut reduced) = ([Seen::default(); N], [None; N]);
    let mut before = pair.world.anatomical_position();
    let mut request = Some(ControlRequest::Identify);
    while pair.leg.identification().solver().is_none() {
        let servo = pair.tick(request.take(), context.gravity).servo;
        let limited = servo.decision.limited;
        let position = pair.world.anatomical_position();
        let torque = pair.world.motor_torque();
        for joint in 0..N {
            let velocity = (position[joint] - before[joint]) / TICK_S;
            seen[joint].add(position[joint], velocity, torque[joint], limited[joint].any());
            note(&mut reduced[joint], joint, &servo);
        }
        before = position;
        let exciting = matches!(
            pair.leg.control().activity(),
            Activity::Identify(IdentifyPhase::Approach | IdentifyPhase::Excite | IdentifyPhase::Settle)
        );
        if !exciting || pair.ticks as f64 * TICK_S > LONGEST_S {
            let reason = format!(
                "on the designed motion the simulated leg fails: {}; state `rotor_inertia`, `coulomb` and `viscous` of its drives \
                 in `prior`",
                pair.stop_words(assumed)
            );
            return Err(assumed.error(reason).into());
        }
    }
    let Some(solver) = pair.leg.identification().solver() else {
        return Err(assumed.error("the excitation ended without a record").into());
    };
    // The selection by the data is not known in advance: every column counts.
    let record = Record { selection: Selection::all(), ..solver.record().convert::<f64>() };
    let model = context.background.model.clone();
    let assumed = context.background.truth.map_or([0.0; B], |truth| model.base.project(&truth));
    let samples = motion.duration_ticks() as usize / TICKS_PER_LOG as usize;
    let rows = samples.saturating_sub(2 * context.smoothing.reach()).div_ceil(DECIMATION).max(1) as f64;
    let lost_share = record.rows.map(|kept| (1.0 - f64::from(kept) / rows).clamp(0.0, 1.0));
    Ok(Rehearsal { record, model, assumed, noise_nm: context.noise, lost_share, seen, reduced })
}

/// Places a leg at the begin of its motion if it cannot hold its weight where it usually begins.
fn stand<const N: usize, const B: usize>(leg: &LegFile, context: &Context<N, B>, pair: &mut Pair<N, B>) {
    let needed = pair.world.inverse_dynamics(&start_position(leg), &[0.0; N], &[0.0; N]);
    if needed.iter().zip(&leg.joints).all(|(needed, joint)| needed.abs() <= joint.torque_cap()) {
        return;
    }
    let start = context.motions.excitation.state_at(0).position_rad;
    let anatomy = context.configuration.joints.map(|joint| joint.scale.anatomy);
    pair.world
        .move_to(&core::array::from_fn(|joint| f64::from(anatomy[joint].angle_from_chain(start[joint]))));
    pair.sample = pair.world.sample();
}

/// Keeps the largest reduction of a joint's torque by the monitor.
fn note<const N: usize>(largest: &mut Option<Obstacle>, joint: usize, servo: &ServoOutput<N>) {
    let limited = servo.decision.limited[joint];
    if !limited.any() {
        return;
    }
    let point = OperatingPoint {
        position_rad: f64::from(servo.position[joint].0),
        velocity_rad_s: f64::from(servo.velocity[joint].0),
    };
    let limit = if limited.range {
        Limit::Stop(point)
    } else if limited.speed {
        Limit::Speed(point)
    } else {
        Limit::Loop(point)
    };
    let [value, allowed] =
        [servo.wanted_torque[joint], servo.decision.torque[joint]].map(|torque| f64::from(torque.0));
    let by = |one: &Obstacle| (one.value - one.allowed).abs();
    let found = Obstacle { joint, limit, value, allowed };
    if largest.as_ref().is_none_or(|before| by(&found) > by(before)) {
        *largest = Some(found);
    }
}

impl<const N: usize, const B: usize> Rehearsal<N, B> {
    /// Expected identification at this noise of each joint's logged torque, N m.
    pub(crate) fn at_noise(&self, noise_nm: &[f64; N]) -> Expectation<N, B> {
        let mut record = self.record.clone();
        add_noise(&mut record, noise_nm);
        let problem = Problem::new(&record, &self.model);
        let (estimate, condition) = (problem.least_squares(Plan::OneTime), problem.whole().condition());
        let weighted = problem.weighted();
        let log_determinant = (0..self.model.base.rank())
            .map(|base| 2.0 * weighted.triangle()[base][base].abs().max(1e-300).ln())
            .sum();
        let systematic = core::array::from_fn(|base| estimate.values[base] - self.assumed[base]);
        Expectation { record, estimate, log_determinant, condition, systematic }
    }
}

/// Adds the mean effect of white noise to the residual, so that the firmware's own estimate of the noise
/// finds it.
fn add_noise<const N: usize, const B: usize>(record: &mut Record<f64, N, B>, noise_nm: &[f64; N]) {
    let information = record.row_information;
    for joint in 0..N {
        let factor = &mut record.factors[joint];
        let fitted = (0..B).filter(|&column| factor.triangle()[column][column] != 0.0).count();
        let free = (f64::from(record.rows[joint]) - fitted as f64 / information).max(1.0);
        let variance = noise_nm[joint] * noise_nm[joint] * information / DECIMATION as f64;
        // No parameter explains a row of zeros: its right-hand side is residual.
        factor.insert(&[0.0; B], (variance * free).sqrt());
    }
}
