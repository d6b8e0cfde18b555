//! Turns the window of blocks into the record of a motion: weights, Stribeck friction, one factor per joint.
//!
//! ```text
//! blocks -> weights of each joint (reweighting) -> one packed factor per joint
//!        -> Stribeck friction found and eliminated -> Record
//! ```
//!
//! Later steps see ordinary rows: each joint's factor over the base parameters, the sum of the weights as row
//! count, and the torque's size with the same weights.

use super::choice::{Choice, Estimator};
use super::factor::Factor;
use super::motion_record::Outliers;
use super::motion_record::TorqueSize;
use super::packed::{self, LARGEST_SIZE};
use super::reweighting::{INDEPENDENT_SHARE, Weights, weigh, weighted};
use super::row_model::RowModel;
use super::stribeck::{
    JointRows, SMALLEST_GAIN, SMALLEST_SURPLUS_SHARE, StribeckFit, bank_eliminated, eliminate, strongest,
    without_bank,
};
use super::window::{LARGEST_BLOCKS, Window};
use crate::real::{self, Real};

const ROW_RATE_HZ: f64 = 50.0;
/// A block counts as disturbed when it keeps less than this share of its weight.
const DISTURBED_BELOW: f64 = 0.5;
/// Noise floor as a share of the torque's root mean square: below it single precision decides, not the data.
const SMALLEST_NOISE_SHARE: f64 = 1e-5;

/// Sums over the blocks of a motion.
pub(super) struct Assembly<T, const N: usize, const B: usize> {
    pub(crate) factors: [Factor<T, B>; N],
    pub(crate) torque: [TorqueSize<T>; N],
    pub(crate) rows: [u32; N],
    pub(crate) outliers: Outliers<T, N>,
    pub(crate) stribeck: [Option<StribeckFit<T, B>>; N],
    /// Gain and surplus of the best curve, for each joint that was searched.
    pub(crate) tried: [Option<(T, T)>; N],
}

/// Adds up a window. `information` is `m sum h^2`; `model` is `None` when nothing was recorded.
#[inline(never)]
pub(super) fn assemble<T: Real, const N: usize, const B: usize, const NUMBERS: usize>(
    window: &Window<T, N, B, NUMBERS>,
    model: Option<&Choices<N>>,
    estimator: Estimator,
    information: T,
) -> Assembly<T, N, B> {
    let mut assembly = Assembly {
        factors: core::array::from_fn(|_| Factor::new()),
        torque: [TorqueSize { mean_absolute: T::zero(), root_mean_square: T::zero(), speed: T::zero() }; N],
        rows: [0; N],
        outliers: Outliers::none(),
        stribeck: [const { None }; N],
        tried: [None; N],
    };
    let mut weights = [[T::one(); LARGEST_BLOCKS]; N];
    let mut joints = [[T::zero(); LARGEST_SIZE]; N];
    let mut noise = [T::one(); N];
    for joint in 0..N {
        if estimator == Estimator::Robust {
            weights[joint] = weigh(window, joint, information);
        }
        joints[joint] = weighted(window, joint, &weights[joint]);
        let (rows, absolute) = sums(window, joint, &weights[joint]);
        let columns = window.columns()[joint].all();
        let power = packed::cost(&joints[joint], columns, &[]);
        let divisor = real::max(rows, T::one());
        assembly.torque[joint].mean_absolute = absolute / divisor;
        assembly.torque[joint].root_mean_square = real::sqrt(power / divisor);
        assembly.rows[joint] = (rows + T::from_double(0.5)).to_count();
        assembly.outliers.whole_error_share[joint] = whole_error_share(window, joint, &joints[joint]);
        let free = rows - T::from_double(columns as f64) / real::max(information, T::from_double(1e-3));
        let variance = packed::residual(&joints[joint], columns)
            / real::max(free, T::one())
            / real::max(information, T::from_double(1e-3));
        let floor = T::from_double(SMALLEST_NOISE_SHARE) * assembly.torque[joint].root_mean_square;
        noise[joint] = real::max(real::sqrt(variance), real::max(floor, T::from_double(1e-9)));
    }
    disturbed(window, &weights, &mut assembly.outliers);

    let choices = model.map_or([Choice::Off; N], |choices| choices.stribeck);
    for joint in 0..N {
        let own =
            JointRows { factor: &joints[joint], columns: &window.columns()[joint], noise: noise[joint] };
        assembly.factors[joint] =
            if choices[joint].is_possible() { bank_eliminated(&own) } else { without_bank(&own) };
    }
    for joint in (0..N).rev().filter(|&joint| choices[joint].is_possible()) {
        let own =
            JointRows { factor: &joints[joint], columns: &window.columns()[joint], noise: noise[joint] };
        let mut others = Factor::new();
        for other in (0..N).filter(|&other| other != joint) {
            others.merge_scaled(&assembly.factors[other], T::one() / noise[other]);
        }
        let wanted = match choices[joint] {
            Choice::Auto => {
                let share = T::from_double(SMALLEST_SURPLUS_SHARE);
                (T::from_double(SMALLEST_GAIN), share * assembly.torque[joint].root_mean_square)
            }
            Choice::On | Choice::Off => (T::zero(), T::zero()),
        };
        let rank = model.map_or(0, |choices| choices.rank);
        let found = strongest(&own, &others, rank);
        assembly.tried[joint] = Some((found.gain, found.surplus));
        match eliminate(&own, &found, wanted) {
            Some((fit, factor)) => {
                assembly.stribeck[joint] = Some(fit);
                assembly.factors[joint] = factor;
            }
            None => assembly.factors[joint] = without_bank(&own),
        }
    }
    for (factor, &rows) in assembly.factors.iter_mut().zip(&assembly.rows) {
        factor.set_rows(rows);
    }
    assembly
}

/// Choices of the row model that the assembly needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Choices<const N: usize> {
    rank: usize,
    stribeck: [Choice; N],
}

impl<const N: usize> Choices<N> {
    /// Takes the rank and the Stribeck choices from a model.
    pub(super) fn from_model<T: Real, const B: usize>(model: &RowModel<T, N, B>) -> Self {
        Self { rank: model.base.rank(), stribeck: core::array::from_fn(|joint| model.stribeck_choice(joint)) }
    }

    /// Disables Stribeck friction for all joints.
    pub(super) fn without_stribeck(self) -> Self {
        Self { stribeck: [Choice::Off; N], ..self }
    }
}

/// Weighted rows and absolute torques of one joint.
fn sums<T: Real, const N: usize, const B: usize, const NUMBERS: usize>(
    window: &Window<T, N, B, NUMBERS>,
    joint: usize,
    weights: &Weights<T>,
) -> (T, T) {
    let (mut rows, mut absolute) = (T::zero(), T::zero());
    for (block, &weight) in weights.iter().enumerate().take(window.blocks()) {
        if let Some(part) = window.part(block, joint) {
            rows += weight * part.rows;
            absolute += weight * part.absolute_torque;
        }
    }
    (rows, absolute)
}

/// Error of all rows of one joint with the weighted solution, over the torque of
/// all rows; zero without torque.
fn whole_error_share<T: Real, const N: usize, const B: usize, const NUMBERS: usize>(
    window: &Window<T, N, B, NUMBERS>,
    joint: usize,
    weighted: &[T; LARGEST_SIZE],
) -> T {
    let columns = window.columns()[joint].all();
    let parameters = packed::solve(weighted, columns, T::from_double(INDEPENDENT_SHARE));
    let parts = (0..window.blocks()).filter_map(|block| window.part(block, joint));
    let (error, power) = parts.fold((T::zero(), T::zero()), |(error, power), part| {
        let of = |parameters: &[T]| packed::cost(part.factor, columns, parameters);
        (error + of(&parameters), power + of(&[]))
    });
    if power > T::zero() { real::sqrt(error / power) } else { T::zero() }
}

/// Shares and longest stretches of disturbed rows. A block without usable rows inherits the state before it.
fn disturbed<T: Real, const N: usize, const B: usize, const NUMBERS: usize>(
    window: &Window<T, N, B, NUMBERS>,
    weights: &[Weights<T>; N],
    outliers: &mut Outliers<T, N>,
) {
    let (mut all, mut hit) = ([T::zero(); N], [T::zero(); N]);
    let (mut state, mut stretch, mut common) = ([false; N], [T::zero(); N], T::zero());
    for block in 0..window.blocks() {
        let seconds = T::from_double(f64::from(window.outputs(block))) / T::from_double(ROW_RATE_HZ);
        for joint in 0..N {
            let rows = window.part(block, joint).map_or(T::zero(), |part| part.rows);
            all[joint] += rows;
            if rows > T::zero() {
                state[joint] = weights[joint][block] < T::from_double(DISTURBED_BELOW);
            }
            if state[joint] {
                hit[joint] += rows;
                stretch[joint] += seconds;
                outliers.longest_s[joint] = real::max(outliers.longest_s[joint], stretch[joint]);
            } else {
                stretch[joint] = T::zero();
            }
        }
        common = if state.iter().all(|&state| state) { common + seconds } else { T::zero() };
        outliers.longest_common_s = real::max(outliers.longest_common_s, common);
    }
    for joint in 0..N {
        outliers.disturbed_share[joint] = hit[joint] / real::max(all[joint], T::one());
    }
}
