//! Designs the exciting motion: the beetle swarm over Fourier coefficients, once for each pace.
//!
//! ```text
//! for each number of cycles that fits the duration:
//!     swarm over (amplitudes, share of the range, position)  ->  least  -ln det A + torque penalty   (score)
//!     rounded to a microradian, shrunk until the torque of every tick keeps its limit               (demand)
//!     run on the assumed leg through the firmware's filters                                    (expectation)
//! the most informative of them is the design
//! ```
//!
//! Where no pace gives a motion, the swarm repeats with the torque penalty alone, of curves at the smallest
//! size that the shrinking reaches. It shows whether a motion exists, and what the limits lack, whatever the
//! noise and the requested effort.
//!
//! Several paces are tried, because the best speed is a trade-off of inertia, friction, limits and rows lost
//! at reversals. A slow and a fast motion have different costs, and the swarm need not jump between them.
//! Cost: [`DesignOptions::evaluations`] curves of about 0.2 ms in all; one run on the assumed leg per pace.
//!
//! Known limits: the search ends by count, not at a proved optimum; another seed gives a similar
//! motion, not an identical one.

use indicatif::ProgressBar;
use rayon::prelude::*;
use scarab::motion::{ExcitationTable, Fourier, HARMONICS, JointEnvelope, Motion, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab::swarm::{Bso, BsoSettings, Objective, Search};
use scarab::units::{Radian, Second};
use scarab_base::error::ToolError;

use crate::excite::bench::Bench;
use crate::excite::candidate::{self, PER_JOINT};
use crate::excite::demand::{Demand, demand};
use crate::excite::obstacle::Obstacle;

/// Duration of a blend between rest and full speed, s.
pub(crate) const BLEND_S: f32 = 1.0;
/// Shortest cycle, s: its highest harmonic lies at a third of the position loop's 6 Hz, so the leg
/// can follow.
const SHORTEST_PERIOD_S: f64 = 3.0;
/// Largest share of the rows' bandwidth for the highest harmonic: products of two harmonics still lie in the
/// flat band, 0.55 of the bandwidth.
const BANDWIDTH_SHARE: f64 = 0.275;
/// Longest cycle, s; slower ones hardly move.
const LONGEST_PERIOD_S: f64 = 12.0;
/// Limit of the paces tried.
const MOST_PACES: usize = 6;
const BEETLES: usize = 20;
/// Coordinates of three joints.
const CAPACITY: usize = 3 * PER_JOINT;
/// Cost of exceeding the torque limit by 100 %, or of an equal reduction by the monitor, in units
/// of ln det.
const TORQUE_PENALTY: f64 = 1e3;
/// Weight of torque below its limit where the least torque is searched.
const LEAST_SHARE: f64 = 1e-2;
/// Evaluations between two updates of the progress bar.
const SLICE: u32 = 100;
/// Rounding of the coefficients, rad: the file contains exactly the proved values.
const GRID_RAD: f64 = 1e-6;
/// Factor per reduction of a motion with too much torque, and limit of the steps.
pub(crate) const SHRINK: f32 = 0.98;
const SHRINKINGS: u32 = 60;

/// Options of a design.
#[derive(Clone, Copy, Debug)]
pub struct DesignOptions {
    /// Duration with blends, s.
    pub duration_s: f64,
    /// Seed of the swarm.
    pub seed: u64,
    /// Scored curves, all paces together.
    pub evaluations: u32,
}

/// What the swarm looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Most information within the limits.
    Information,
    /// Least torque above its limit, by the smallest motions.
    LeastTorque,
}

/// A motion within all limits.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<const N: usize> {
    /// Table as written to the file.
    pub(crate) table: ExcitationTable<N>,
    /// The motion of the table.
    pub(crate) motion: Periodic<N>,
    /// Torque of each joint.
    pub(crate) demand: [Demand; N],
}

/// Returns the best motion found at each pace.
///
/// # Errors
/// No pace fits the duration, or no motion fits the limits.
pub fn candidates<const N: usize, const B: usize>(
    bench: &Bench<N, B>,
    options: &DesignOptions,
    goal: Goal,
    progress: &ProgressBar,
) -> Result<Vec<Candidate<N>>, ToolError> {
    let paces = paces(options.duration_s, bench.leg.bandwidth_hz);
    if paces.is_empty() {
        return Err(ToolError::input(format!(
            "--duration: {} s leave no room for a cycle of {SHORTEST_PERIOD_S} to {LONGEST_PERIOD_S} s between two \
             blends of {BLEND_S} s",
            options.duration_s
        )));
    }
    let share = (options.evaluations / paces.len() as u32).max(SLICE);
    progress.set_length(u64::from(share) * paces.len() as u64);
    let searched: Vec<_> = paces
        .into_par_iter()
        .map(|(period_s, cycles)| {
            let cost = Cost::new(bench, goal, Second(period_s as f32), cycles);
            search(&cost, options.seed, share, progress)
        })
        .collect();
    let mut found = Vec::with_capacity(searched.len());
    let mut obstacles = Vec::new();
    for searched in searched {
        match searched {
            Ok(candidate) => found.push(candidate),
            Err(obstacle) => obstacles.extend(obstacle),
        }
    }
    if found.is_empty() {
        return Err(bench.refusal(obstacles));
    }
    Ok(found)
}

impl<const N: usize, const B: usize> Bench<N, B> {
    /// Refusal of a design that names the obstacle which comes nearest to its limit.
    pub(crate) fn refusal(&self, obstacles: Vec<Obstacle>) -> ToolError {
        let nearest = obstacles.into_iter().min_by(|one, other| one.excess().total_cmp(&other.excess()));
        let words = nearest.map_or(String::new(), |obstacle| {
            let joints = &self.context.configuration.joints;
            let inertia = joints.get(obstacle.joint).map_or(0.0, |joint| joint.inertia.0);
            format!(": {}", obstacle.words(&self.leg, f64::from(inertia), self.scorer.margin))
        });
        self.leg.error(format!("no exciting motion fits the limits{words}")).into()
    }
}

/// Periods and numbers of cycles that fill a duration, slow ones first.
fn paces(duration_s: f64, bandwidth_hz: f64) -> Vec<(f64, u32)> {
    let steady = duration_s - 2.0 * f64::from(BLEND_S);
    let shortest = SHORTEST_PERIOD_S.max(HARMONICS as f64 / (BANDWIDTH_SHARE * bandwidth_hz));
    let all: Vec<_> = (1_u32..)
        .map(|cycles| (steady / f64::from(cycles), cycles))
        .take_while(|(period, _)| *period >= shortest)
        .filter(|(period, _)| *period <= LONGEST_PERIOD_S)
        .collect();
    let (Some(first), Some(last)) = (all.first(), all.last()) else { return Vec::new() };
    // Even ratios from the slowest to the fastest.
    let ratio = (f64::from(last.1) / f64::from(first.1)).ln() / (MOST_PACES - 1) as f64;
    let mut paces: Vec<(f64, u32)> = Vec::new();
    for step in 0..MOST_PACES {
        let cycles = (f64::from(first.1) * (ratio * step as f64).exp()).round() as u32;
        if paces.last().is_none_or(|pace| pace.1 < cycles) {
            paces.push((steady / f64::from(cycles), cycles));
        }
    }
    paces
}

/// Cost for the swarm.
struct Cost<'a, const N: usize, const B: usize> {
    bench: &'a Bench<N, B>,
    goal: Goal,
    envelope: [JointEnvelope; N],
    period: Second,
    cycles: u32,
}

impl<'a, const N: usize, const B: usize> Cost<'a, N, B> {
    fn new(bench: &'a Bench<N, B>, goal: Goal, period: Second, cycles: u32) -> Self {
        Self { bench, goal, envelope: bench.context.configuration.envelope(), period, cycles }
    }

    fn curve(&self, coordinates: &[f64]) -> Option<Fourier<N>> {
        candidate::curve(coordinates, self.period, Second(BLEND_S), &self.envelope)
    }
}

impl<const N: usize, const B: usize> Objective<f64> for Cost<'_, N, B> {
    fn dimension(&self) -> usize {
        N * PER_JOINT
    }

    fn bounds(&self, _: usize) -> (f64, f64) {
        (-1.0, 1.0)
    }

    fn evaluate(&self, position: &[f64]) -> f64 {
        let Some(curve) = self.curve(position).and_then(|curve| match self.goal {
            Goal::Information => Some(curve),
            Goal::LeastTorque => shrunk(curve, SHRINK.powi(SHRINKINGS as i32 - 1)),
        }) else {
            return f64::INFINITY;
        };
        let score = self.bench.scorer.score(&curve, self.cycles);
        let shares = (0..N).map(|joint| {
            let limit = self.bench.torque_limit[joint];
            (score.torque[joint] / limit, score.cut[joint] / limit)
        });
        let excess: f64 = shares.clone().map(|(torque, cut)| (torque - 1.0).max(0.0) + cut).sum();
        match self.goal {
            Goal::Information => excess * TORQUE_PENALTY - score.merit,
            // Below the limits, the rest leaves room for friction and the position loop.
            Goal::LeastTorque => excess + LEAST_SHARE * shares.map(|(torque, _)| torque).sum::<f64>(),
        }
    }
}

/// Curve shrunk by a factor about its centre.
fn shrunk<const N: usize>(curve: Fourier<N>, factor: f32) -> Option<Fourier<N>> {
    let offset = curve.centre_rad().map(|centre| Radian((1.0 - factor) * centre));
    curve.mapped([factor; N], offset).ok()
}

fn search<const N: usize, const B: usize>(
    cost: &Cost<'_, N, B>,
    seed: u64,
    evaluations: u32,
    progress: &ProgressBar,
) -> Result<Candidate<N>, Option<Obstacle>> {
    let mut swarm =
        Bso::<f64, BEETLES, CAPACITY>::new(cost, BsoSettings::default(), seed).map_err(|_| None)?;
    while swarm.evaluations() < evaluations {
        swarm.advance(cost, SLICE.min(evaluations - swarm.evaluations()));
        progress.inc(u64::from(SLICE));
    }
    let curve = swarm.best().and_then(|best| cost.curve(best.position)).ok_or(None)?;
    within_limits(cost.bench, &curve, cost.cycles, 1.0)
}

/// Motion shrunk by a factor about its centre.
///
/// # Errors
/// The limit that the smallest motion exceeds.
pub(crate) fn smaller<const N: usize, const B: usize>(
    bench: &Bench<N, B>,
    candidate: &Candidate<N>,
    factor: f32,
) -> Result<Candidate<N>, Option<Obstacle>> {
    within_limits(bench, candidate.motion.curve(), candidate.table.cycles, factor)
}

/// Rounds the curve as in the file and shrinks it about its centre until everything is proved.
fn within_limits<const N: usize, const B: usize>(
    bench: &Bench<N, B>,
    curve: &Fourier<N>,
    cycles: u32,
    first_scale: f32,
) -> Result<Candidate<N>, Option<Obstacle>> {
    let (mut scale, mut obstacle) = (first_scale, None);
    let configuration = &bench.context.configuration;
    for _ in 0..SHRINKINGS {
        let table = rounded(curve, scale, cycles);
        scale *= SHRINK;
        let Ok(motion) = table.motion(SERVO_RATE_HZ) else { continue };
        if let Err(violation) = Motion::Periodic(motion).prove(&configuration.envelope()) {
            obstacle = Some(Obstacle::from_motion(&violation));
            continue;
        }
        let demand = demand(&bench.scorer, configuration, &motion);
        let exceeded = |joint: usize| demand[joint].obstacle(joint, bench.torque_limit[joint]);
        let worst = (0..N).filter_map(exceeded).max_by(|one, other| one.excess().total_cmp(&other.excess()));
        if worst.is_none() {
            return Ok(Candidate { table, motion, demand });
        }
        obstacle = worst;
    }
    Err(obstacle)
}

fn rounded<const N: usize>(curve: &Fourier<N>, scale: f32, cycles: u32) -> ExcitationTable<N> {
    let round = |value: f32| ((f64::from(value) / GRID_RAD).round() * GRID_RAD) as f32;
    let scaled =
        |amplitudes: [[f32; HARMONICS]; N]| amplitudes.map(|joint| joint.map(|value| round(scale * value)));
    ExcitationTable {
        period_s: (f64::from(curve.period().0) * 1e3).round() as f32 / 1e3,
        blend_s: BLEND_S,
        cycles,
        centre_rad: curve.centre_rad().map(round),
        sine_rad: scaled(curve.sine_rad()),
        cosine_rad: scaled(curve.cosine_rad()),
    }
}
