//! Residual of a known model while a motion streams by: its size, its slow part, its duration.
//!
//! Why: a factor gives the size of the residual of any parameters, but not its order in time. Noise is
//! uncorrelated in time; the errors of a wrong model, a foot on the floor or a changed load are not. In
//! predicted motions the parameters are known, so the residual can be examined row by row in constant memory.
//!
//! ```text
//! r_k    = tau_k - y_k p                          filtered rows at 50 Hz, without those of a joint at rest
//! b_j    = mean of r over half a second           one block of 25 rows, at least 12 of them used
//! slow^2 = sum b_j b_(j+1) / pairs                power of what lasts longer than a block; with disturbances
//!                                                 forgiven, of pairs without an outlier row
//! chance = q var b / sqrt(pairs)                  limit of slow^2 for noise alone, q standard normal
//! ```
//!
//! Neighbouring blocks share only the noise that the filter's reach carries across (0.12 s at 16 Hz). The
//! mean product of neighbours is therefore free of noise and needs no noise level. Source: lag-one
//! autocovariance of block means; its spread after Bartlett (1946).
//! Cost: B multiplications for each joint and row. Memory: 11 numbers for each joint. Known limits: a
//! residual that changes sign within half a second, as friction's does at fast reversals, does not show.

use crate::ident::record::recorder::LARGEST_STILL_SHARE;
use crate::ident::record::rows::{DECIMATION, FilteredRows};
use crate::ident::record::stretch::ROW_S;
use crate::real::{self, Real};

/// Rows of a block: half a second.
pub(crate) const BLOCK_ROWS: u32 = 25;
/// Fewest used rows of a valid block.
const LEAST_FILLED: u32 = 12;
/// Outlier rows are a minority up to one in this many.
const LARGEST_OUTLIER_PART: u64 = 3;

/// Products of neighbouring blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Neighbours<T> {
    pairs: u32,
    products: T,
    before: Option<T>,
}

impl<T: Real> Neighbours<T> {
    fn new() -> Self {
        Self { pairs: 0, products: T::zero(), before: None }
    }

    fn take(&mut self, mean: Option<T>) {
        if let (Some(before), Some(mean)) = (self.before, mean) {
            self.products += before * mean;
            self.pairs = self.pairs.saturating_add(1);
        }
        self.before = mean;
    }
}

/// One joint's residual on one motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointResidual<T> {
    /// Rows used.
    pub(crate) rows: u32,
    /// Rows with an error above the limit.
    pub(crate) outliers: u32,
    all: Neighbours<T>,
    /// Statistics over blocks without an error above the limit.
    undisturbed: Neighbours<T>,
    block: T,
    age: u32,
    filled: u32,
    is_disturbed: bool,
}

impl<T: Real> JointResidual<T> {
    fn new() -> Self {
        Self {
            rows: 0,
            outliers: 0,
            all: Neighbours::new(),
            undisturbed: Neighbours::new(),
            block: T::zero(),
            age: 0,
            filled: 0,
            is_disturbed: false,
        }
    }

    /// Statistics to judge by. Disturbed blocks are excluded where they are `forgiven` and outlier rows are a
    /// minority. An error that is everywhere is not a disturbance.
    fn judged(&self, forgiven: bool) -> &Neighbours<T> {
        let minority = u64::from(self.outliers) * LARGEST_OUTLIER_PART <= u64::from(self.rows);
        if forgiven && minority { &self.undisturbed } else { &self.all }
    }

    /// Pairs of neighbouring blocks.
    pub fn pairs(&self, forgiven: bool) -> u32 {
        self.judged(forgiven).pairs
    }

    /// Root mean square of the residual slower than half a second, N m; zero
    /// without correlation of neighbours.
    pub fn slow(&self, forgiven: bool) -> T {
        let judged = self.judged(forgiven);
        let mean = judged.products / T::from_double(f64::from(judged.pairs.max(1)));
        real::sqrt(real::max(mean, T::zero()))
    }

    /// Limit of [`Self::slow`] for noise alone, at a quantile of the standard normal distribution. `noise` is
    /// the standard deviation of a 500 Hz sample.
    pub fn slow_by_chance(&self, quantile: T, noise: T, forgiven: bool) -> T {
        let judged = self.judged(forgiven);
        let pairs = T::from_double(f64::from(judged.pairs.max(1)));
        let variance = noise * noise / T::from_double(f64::from(LEAST_FILLED) * DECIMATION as f64);
        real::sqrt(quantile * variance / real::sqrt(pairs))
    }

    /// Ends the stretch: the next block has no neighbour before it.
    fn break_off(&mut self) {
        (self.block, self.age, self.filled, self.is_disturbed) = (T::zero(), 0, 0, false);
        (self.all.before, self.undisturbed.before) = (None, None);
    }

    /// Skips an excluded row: the block continues without it.
    fn skip(&mut self) {
        self.age += 1;
        self.close();
    }

    fn take(&mut self, residual: T, outlier_bound: T) {
        let is_outlier = real::abs(residual) > outlier_bound;
        self.rows = self.rows.saturating_add(1);
        self.outliers = self.outliers.saturating_add(u32::from(is_outlier));
        self.is_disturbed |= is_outlier;
        self.block += residual;
        self.filled += 1;
        self.age += 1;
        self.close();
    }

    fn close(&mut self) {
        if self.age < BLOCK_ROWS {
            return;
        }
        let mean = (self.filled >= LEAST_FILLED).then(|| self.block / T::from_double(f64::from(self.filled)));
        self.all.take(mean);
        self.undisturbed.take(mean.filter(|_| !self.is_disturbed));
        (self.block, self.age, self.filled, self.is_disturbed) = (T::zero(), 0, 0, false);
    }
}

/// All joints' residuals on one motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual<T, const N: usize> {
    /// Residual of each joint.
    pub joints: [JointResidual<T>; N],
    /// Longest stretch in which some joint exceeded its limit and no moving joint was within it, s.
    pub longest_common_s: T,
    common: u32,
}

impl<T: Real, const N: usize> Residual<T, N> {
    /// Starts without data.
    pub fn new() -> Self {
        Self { joints: [JointResidual::new(); N], longest_common_s: T::zero(), common: 0 }
    }

    /// Ends a continuous stretch of rows.
    pub(crate) fn break_off(&mut self) {
        self.joints.iter_mut().for_each(JointResidual::break_off);
        self.common = 0;
    }

    /// Takes one row of each joint; an error above `outlier_bound` (N m) is part of a stretch.
    pub(crate) fn take<const B: usize>(
        &mut self,
        rows: &FilteredRows<T, N, B>,
        values: &[T; B],
        outlier_bound: &[T; N],
    ) {
        if !rows.is_finite() {
            self.break_off();
            return;
        }
        let mut missed = 0;
        let mut expected = 0;
        for joint in 0..N {
            if rows.still[joint] > T::from_double(LARGEST_STILL_SHARE) {
                self.joints[joint].skip();
                continue;
            }
            let row = rows.regressor[joint].iter().zip(values);
            let residual = row.fold(rows.torque[joint], |rest, (&element, &value)| rest - element * value);
            self.joints[joint].take(residual, outlier_bound[joint]);
            if real::abs(residual) > outlier_bound[joint] { missed += 1 } else { expected += 1 }
        }
        self.common = if missed > 0 && expected == 0 { self.common.saturating_add(1) } else { 0 };
        self.longest_common_s =
            real::max(self.longest_common_s, T::from_double(f64::from(self.common)) * T::from_double(ROW_S));
    }
}
