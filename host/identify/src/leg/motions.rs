//! Motions of a run: an exciting one to identify from, and three to predict.
//!
//! The exciting motion is the most informative of some hundred random Fourier series within the
//! leg's proved limits. Its information matrix of the base parameters has the largest determinant.

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::ident::{Factor, RowModel, Smoothed};
use scarab::leg::VALIDATION_MOTIONS;
use scarab::motion::gait::{self, GaitJoint};
use scarab::motion::{Fourier, HARMONICS, JointEnvelope, Motion, MotionError, Periodic, Phase};
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::{Radian, Second};
use scarab_base::error::FileError;

use crate::formats::leg_file::{JointFile, LegFile};

const EXCITATION_PERIOD: Second = Second(10.0);
/// Cycles of the default exciting motion.
pub const EXCITATION_CYCLES: u32 = 2;
const UNUSED_PERIOD: Second = Second(8.0);
const BLEND: Second = Second(1.0);
/// Harmonics of the exciting motion; the curve has capacity for one more.
const EXCITED_HARMONICS: usize = 5;
const CANDIDATES: u64 = 300;
const INSTANTS: u32 = 100;
/// Share of the range left free at both ends.
const RANGE_MARGIN: f32 = 0.06;
/// Shares of the range into which a gait is mapped, the first one that fits.
const GAIT_SHARES: [f32; 3] = [1.0, 0.3, 0.1];
/// First seed of the candidates for excitation, and of the predicted motion.
const EXCITATION_SEED: u64 = 1_000;
const UNUSED_SEED: u64 = 900_000;

/// All motions of a run in the model's angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motions<const N: usize> {
    /// Motion identified from.
    pub excitation: Periodic<N>,
    /// Predicted motions; see [`scarab_base::names::VALIDATION_NAMES`].
    pub validation: [Periodic<N>; VALIDATION_MOTIONS],
}

/// Motions for a leg within `limits`; `gait` selects the joints that walk as hip and knee.
pub fn motions<const N: usize, const B: usize>(
    leg: &LegFile,
    model: &RowModel<f64, N, B>,
    limits: &[JointEnvelope; N],
) -> Result<Motions<N>, FileError> {
    let joint = |joint: &JointFile| {
        let [low, high] = joint.range_deg;
        let (speed, acceleration) = (joint.speed_limit_deg_s, joint.acceleration_limit_deg_s2);
        format!(
            "`{}` {speed:.1} degrees/s, {acceleration:.1} degrees/s2, {low:.1} to {high:.1} degrees",
            joint.name
        )
    };
    let limits_of_all: Vec<_> = leg.joints.iter().map(joint).collect();
    let refuse = |motion: &str| {
        leg.error(format!(
            "no {motion} motion fits the limits ({}): raise `speed_limit_deg_s` or `acceleration_limit_deg_s2`, or widen \
             `range_deg`. A run moves along a Fourier series and, to validate, a gait of 3 s",
            limits_of_all.join("; ")
        ))
    };
    let excitation = random_excitation(model, limits, EXCITATION_PERIOD, EXCITATION_CYCLES)
        .ok_or_else(|| refuse("exciting"))?;
    let unused = most_informative(model, limits, UNUSED_PERIOD, 1, UNUSED_SEED, 20)
        .ok_or_else(|| refuse("Fourier"))?;
    let slow = walk(leg, limits, Second(6.5), 1).ok_or_else(|| refuse("gait"))?;
    let fast = walk(leg, limits, Second(3.0), 3).ok_or_else(|| refuse("gait"))?;
    Ok(Motions { excitation, validation: [slow, fast, unused] })
}

/// Default exciting motion: the most informative of 300 random ones.
pub fn random_excitation<const N: usize, const B: usize>(
    model: &RowModel<f64, N, B>,
    limits: &[JointEnvelope; N],
    period: Second,
    cycles: u32,
) -> Option<Periodic<N>> {
    most_informative(model, limits, period, cycles, EXCITATION_SEED, CANDIDATES)
}

/// Most informative of `candidates` random motions with seeds from `seed` on.
pub fn most_informative<const N: usize, const B: usize>(
    model: &RowModel<f64, N, B>,
    limits: &[JointEnvelope; N],
    period: Second,
    cycles: u32,
    seed: u64,
    candidates: u64,
) -> Option<Periodic<N>> {
    let mut best: Option<(f64, Periodic<N>)> = None;
    for candidate in seed..seed + candidates {
        let Some(curve) = random_curve(limits, period, candidate).ok() else { continue };
        let Some(motion) = slowed_into(curve, limits, cycles) else { continue };
        let information = log_determinant(model, motion.curve());
        if best.as_ref().is_none_or(|(most, _)| information > *most) {
            best = Some((information, motion));
        }
    }
    best.map(|(_, motion)| motion)
}

/// Random amplitudes that decrease with the harmonic, stretched into the range minus its margins.
fn random_curve<const N: usize>(
    limits: &[JointEnvelope; N],
    period: Second,
    seed: u64,
) -> Result<Fourier<N>, MotionError> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut amplitudes = || -> [[f32; HARMONICS]; N] {
        core::array::from_fn(|_| {
            core::array::from_fn(|order| {
                let uniform = (random.next_u64() >> 40) as f32 / (1_u64 << 23) as f32 - 1.0;
                if order < EXCITED_HARMONICS { uniform / (order + 1) as f32 } else { 0.0 }
            })
        })
    };
    let curve = Fourier::new(period, [0.0; N], amplitudes(), amplitudes())?;
    gait::mapped_into(curve, inner_ranges(limits))
}

fn inner_ranges<const N: usize>(limits: &[JointEnvelope; N]) -> [(Radian, Radian); N] {
    limits.map(|joint| {
        let margin = (joint.high - joint.low) * RANGE_MARGIN;
        (joint.low + margin, joint.high - margin)
    })
}

/// Motion with rest at both ends; its period is stretched until the limits are proved.
fn slowed_into<const N: usize>(
    curve: Fourier<N>,
    limits: &[JointEnvelope; N],
    cycles: u32,
) -> Option<Periodic<N>> {
    let mut period = curve.period();
    for _ in 0..20 {
        let curve = curve.with_period(period).ok()?;
        let motion = Periodic::new(curve, BLEND, cycles, SERVO_RATE_HZ).ok()?;
        if Motion::Periodic(motion).prove(limits).is_ok() {
            return Some(motion);
        }
        period = period * 1.1;
    }
    None
}

/// Logarithm of the determinant of the information matrix over one period.
fn log_determinant<const N: usize, const B: usize>(model: &RowModel<f64, N, B>, curve: &Fourier<N>) -> f64 {
    let mut factor = Factor::<f64, B>::new();
    for index in 0..INSTANTS {
        let state = curve.state_at(&Phase::steady(index as f32 / INSTANTS as f32));
        let rows = model.rows(&Smoothed {
            position: state.position_rad.map(f64::from),
            velocity: state.velocity_rad_per_s.map(f64::from),
            acceleration: state.acceleration_rad_per_s2.map(f64::from),
            torque: [0.0; N],
        });
        for row in &rows.regressor {
            factor.insert(row, 0.0);
        }
    }
    (0..model.base.rank()).map(|base| factor.triangle()[base][base].abs().max(1e-30).ln()).sum()
}

/// Gait of the paper, hip then knee; a third joint before them moves with the hip. The leg's own
/// range replaces the paper's where they differ.
fn walk<const N: usize>(
    leg: &LegFile,
    limits: &[JointEnvelope; N],
    period: Second,
    cycles: u32,
) -> Option<Periodic<N>> {
    let is_knee = |joint: usize| N > 1 && joint + 1 == N;
    let walking = core::array::from_fn(|joint| if is_knee(joint) { GaitJoint::Knee } else { GaitJoint::Hip });
    let anatomical = gait::curve(walking, period).ok()?;
    let scale = core::array::from_fn(|joint| if leg.joints[joint].direction < 0 { -1.0 } else { 1.0 });
    let offset = core::array::from_fn(|joint| Radian(leg.joints[joint].zero_offset_deg.to_radians() as f32));
    let curve = anatomical.mapped(scale, offset).ok()?;
    let fits = curve
        .envelope()
        .iter()
        .zip(limits)
        .all(|(motion, limit)| motion.low >= limit.low && motion.high <= limit.high);
    if fits {
        return slowed_into(curve, limits, cycles);
    }
    // A wide range of a slow joint has no gait in all of it.
    GAIT_SHARES.into_iter().find_map(|share| {
        let ranges = inner_ranges(limits).map(|(low, high)| {
            let (middle, half) = ((low + high) * 0.5, (high - low) * (0.5 * share));
            (middle - half, middle + half)
        });
        slowed_into(gait::mapped_into(curve, ranges).ok()?, limits, cycles)
    })
}
