//! Robust weights: least squares reweighted block by block, so that disturbed stretches count less.
//!
//! A push lasts some tenths of a second. Sample by sample it looks like noise, and after the filter it is
//! smooth. But the mean square residual of its blocks is many times that of the others. Each joint is judged
//! by its own rows and columns alone: residuals need a prediction, not parameters, and a disturbed knee
//! implies nothing for the hip.
//!
//! ```text
//! r_b^2 = sum of squared residuals of block b, n_b rows, nu_b = n_b m sum h^2 degrees of freedom
//! rounds 1..6     w_b = 1 / max(sqrt(r_b^2 / n_b), s)               sum of block norms, from any start
//! rounds 7..12    u_b = ((r_b^2 / n_b s^2)^(1/3) - (1 - 2 / 9 nu_b)) / sqrt(2 / 9 nu_b)   normal if chi^2
//!                 t_b = (u_b - median u) / max(1, spread of u),   w_b = 1 to t = 2.5, falling to 0 at t = 4
//! ```
//!
//! s^2 is the median of `r_b^2 / n_b`, so up to half of the blocks may be disturbed. The spread of u is its
//! median absolute deviation over 0.6745. A model of a real machine has a small error everywhere, so blocks
//! differ by more than chance. Only an excess over *that* is a disturbance. Only too large residuals lose
//! weight. In clean data 0.6 % of the blocks lie beyond 2.5, so the efficiency lost is below one per cent.
//! Beside a block with zero weight the limits are 0.5 and 2: the tail of a push lies there.
//!
//! Sources: iteratively reweighted least squares, redescending weights: Huber and Ronchetti, Robust
//! Statistics, 2009; the cube root: Wilson and Hilferty (1931).
//! Cost: at most twelve times blocks times columns row rotations and solutions of
//! each joint, once per motion.
//! Limits: a disturbance below the noise of a block stays. One that lasts for more than half of the motion
//! counts as normal (the verdict sees the residual). A block is excluded as a whole.

use super::packed::{self, LARGEST_SIZE};
use super::window::{LARGEST_BLOCKS, Window};
use crate::real::{self, Real};

/// Fewest blocks for a credible majority.
const FEWEST_BLOCKS: usize = 8;
/// Fewest independent rows for each column. With fewer a block that a poorly known parameter explains
/// easily looks like a disturbance. The simple pendulum's 3 s, 22 independent rows for 6 columns,
/// were predicted 1.5 times worse.
const INDEPENDENT_ROWS_PER_COLUMN: f64 = 10.0;
const NORM_ROUNDS: usize = 6;
const ROUNDS: usize = 12;
/// Scores at which a block's weight begins to fall and reaches zero, in standard deviations.
const LIMITS: (f64, f64) = (2.5, 4.0);
/// Limits for a neighbour of a block with zero weight: a disturbance does not end at a block's edge.
const LIMITS_BESIDE: (f64, f64) = (0.5, 2.0);
/// Largest harmless residual, as a share of the torque's root mean square: never a disturbance.
const HARMLESS_SHARE: f64 = 2e-3;
/// A column with a smaller independent share does not help to predict.
pub(super) const INDEPENDENT_SHARE: f64 = 1e-4;

/// Weight of each block's squares, 0..1.
pub(crate) type Weights<T> = [T; LARGEST_BLOCKS];

/// Factor of all rows of one joint, each block's squares times its weight.
pub(crate) fn weighted<T: Real, const N: usize, const B: usize, const NUMBERS: usize>(
    window: &Window<T, N, B, NUMBERS>,
    joint: usize,
    weights: &Weights<T>,
) -> [T; LARGEST_SIZE] {
    let mut all = [T::zero(); LARGEST_SIZE];
    let columns = window.columns()[joint].all();
    for (block, &weight) in weights.iter().enumerate().take(window.blocks()) {
        if weight > T::zero()
            && let Some(part) = window.part(block, joint)
        {
            packed::merge(&mut all, part.factor, columns, real::sqrt(weight));
        }
    }
    all
}

/// Weights of one joint's blocks; `information` is `m sum h^2`.
pub(crate) fn weigh<T: Real, const N: usize, const B: usize, const NUMBERS: usize>(
    window: &Window<T, N, B, NUMBERS>,
    joint: usize,
    information: T,
) -> Weights<T> {
    let mut weights = [T::one(); LARGEST_BLOCKS];
    let columns = window.columns()[joint].all();
    let used = (0..window.blocks())
        .filter(|&block| window.part(block, joint).is_some_and(|part| part.rows > T::zero()))
        .count();
    if used < FEWEST_BLOCKS {
        return weights;
    }
    let mut all = weighted(window, joint, &weights);
    let (mut power, mut rows) = (T::zero(), T::zero());
    for part in (0..window.blocks()).filter_map(|block| window.part(block, joint)) {
        power += packed::cost(part.factor, columns, &[]);
        rows += part.rows;
    }
    if !(rows * information >= T::from_double(INDEPENDENT_ROWS_PER_COLUMN) * T::from_double(columns as f64)) {
        return weights;
    }
    let harmless = T::from_double(HARMLESS_SHARE * HARMLESS_SHARE) * power / rows;
    for round in 0..ROUNDS {
        let parameters = packed::solve(&all, columns, T::from_double(INDEPENDENT_SHARE));
        let blocks = Residuals::new(window, joint, &parameters);
        let scale = real::max(real::median(blocks.means().pushed()), harmless);
        let before = weights;
        if round < NORM_ROUNDS {
            for (weight, block) in weights.iter_mut().zip(&blocks.blocks) {
                *weight = real::sqrt(scale / real::max(block.mean, scale));
            }
        } else {
            redescend(&mut weights, &blocks, scale, information);
        }
        let moved =
            weights.iter().zip(&before).any(|(new, old)| real::abs(*new - *old) > T::from_double(1e-3));
        if round > NORM_ROUNDS && !moved {
            break;
        }
        all = weighted(window, joint, &weights);
    }
    weights
}

/// Mean square residual of a block and its rows.
#[derive(Clone, Copy)]
struct Block<T> {
    mean: T,
    rows: T,
}

struct Residuals<T> {
    blocks: [Block<T>; LARGEST_BLOCKS],
    count: usize,
}

impl<T: Real> Residuals<T> {
    fn new<const N: usize, const B: usize, const NUMBERS: usize>(
        window: &Window<T, N, B, NUMBERS>,
        joint: usize,
        parameters: &[T],
    ) -> Self {
        let mut blocks = [Block { mean: T::zero(), rows: T::zero() }; LARGEST_BLOCKS];
        let count = window.blocks();
        for (block, slot) in blocks.iter_mut().enumerate().take(count) {
            let Some(part) = window.part(block, joint).filter(|part| part.rows > T::zero()) else { continue };
            let cost = packed::cost(part.factor, window.columns()[joint].all(), parameters);
            *slot = Block { mean: cost / part.rows, rows: part.rows };
        }
        Self { blocks, count }
    }

    fn with_rows(&self) -> impl Iterator<Item = &Block<T>> {
        self.blocks.iter().take(self.count).filter(|block| block.rows > T::zero())
    }

    fn means(&self) -> List<T> {
        let mut list = List::new();
        self.with_rows().for_each(|block| list.push(block.mean));
        list
    }
}

/// List of at most one number per block.
struct List<T> {
    values: [T; LARGEST_BLOCKS],
    count: usize,
}

impl<T: Real> List<T> {
    fn new() -> Self {
        Self { values: [T::zero(); LARGEST_BLOCKS], count: 0 }
    }

    fn push(&mut self, value: T) {
        if let Some(slot) = self.values.get_mut(self.count) {
            *slot = value;
            self.count += 1;
        }
    }

    fn pushed(&mut self) -> &mut [T] {
        self.values.get_mut(..self.count).unwrap_or_default()
    }
}

/// Score of a block: standard normal if its residuals are noise of variance `scale`.
fn normal_score<T: Real>(block: &Block<T>, scale: T, information: T) -> T {
    let freedom = real::max(block.rows * information, T::one());
    let spread = T::from_double(2.0 / 9.0) / freedom;
    let ratio = real::max(block.mean / scale, T::from_double(1e-9));
    (real::exp(real::ln(ratio) / T::from_double(3.0)) - (T::one() - spread)) / real::sqrt(spread)
}

fn redescend<T: Real>(weights: &mut Weights<T>, blocks: &Residuals<T>, scale: T, information: T) {
    let mut scores = List::new();
    blocks.with_rows().for_each(|block| scores.push(normal_score(block, scale, information)));
    let centre = real::median(scores.pushed());
    for score in &mut scores.values {
        *score = real::abs(*score - centre);
    }
    let spread = real::max(real::median(scores.pushed()) / T::from_double(0.6745), T::one());
    let score = |block: Option<&Block<T>>| {
        let block = block.filter(|block| block.rows > T::zero());
        block.map_or(T::zero(), |block| (normal_score(block, scale, information) - centre) / spread)
    };
    for (index, weight) in weights.iter_mut().enumerate().take(blocks.count) {
        let lost = |index: Option<usize>| {
            index.is_some_and(|index| score(blocks.blocks.get(index)) > T::from_double(LIMITS.1))
        };
        let beside = lost(index.checked_sub(1)) || lost(index.checked_add(1));
        let (full, nothing) = if beside { LIMITS_BESIDE } else { LIMITS };
        let fallen = (score(blocks.blocks.get(index)) - T::from_double(full))
            / (T::from_double(nothing) - T::from_double(full));
        let fallen = real::clamp(fallen, T::zero(), T::one());
        let remaining = T::one() - fallen * fallen;
        *weight = remaining * remaining;
    }
}

#[cfg(test)]
mod tests;
