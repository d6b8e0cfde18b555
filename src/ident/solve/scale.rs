//! Torque constants from two runs of one leg, without and with a known mass.
//!
//! Why: torque is current times a constant that is assumed, not measured. A wrong constant scales every
//! parameter and fits as well as the right one. Only a known torque reveals it. With k_b the assumed
//! constant, k_t the true one and c = k_b / k_t, the logged torque of joint i is c_i times its real torque:
//!
//! ```text
//! run without: tau_i = Y_i b_i                      b_i = c_i beta
//! run with:    tau_i = Y_i b_i + c_i Y_i delta      delta = base parameters of the known mass
//!
//! from the two factors of joint i:   | R  0       | | b_i |   | z  |
//!                                    | R' R'delta | | c_i | = | z' |
//! w = (0, R'delta), v = (z, z'), both without the part that the columns (R; R') explain:
//! c_i = w.v / w.w        sigma(c_i) = s_i / |w|        k_t = k_b / c_i
//! J_i(both) - J_i(without) - J_i(with)                 chi-square, one degree of freedom less than columns
//! ```
//!
//! The problem is linear, each joint by itself: no result depends on another joint's constant or on the
//! geometry between them. A mass on the knee's link loads both joints. On the hip's link it loads the hip
//! alone, and the knee's constant stays unknown.
//!
//! The last line tests whether the two runs differ by this mass at this position. A wrong
//! *position* bends `delta` and shows. A wrong *mass* only scales it: an error of 10 % in the
//! stated mass gives 10 % in c, undetected.
//!
//! With the constants known, [`Record::corrected`] converts a record to right constants without the load.
//! Solving it again gives absolute parameters, and [`widen`] adds the effect of the constants' own errors.
//!
//! Source: M. Gautier and S. Briot, Global identification of joint drive gains and dynamic parameters of
//! robots, 2014; there with total least squares over all joints at once.
//! Cost: one factor of B columns on the stack, 4 B^3 multiplications a joint.
//! Limits: friction must not depend on the load; the constant must not change between the runs. A motor 50 K
//! warmer has 5 % less, with ferrite magnets 10 %.

use super::estimate::Estimate;
use crate::ident::record::factor::Factor;
use crate::ident::record::motion_record::Record;
use crate::real::{self, Real};

/// Estimate of one joint's torque constant from two runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantRatio<T> {
    /// Assumed over true constant.
    pub ratio: T,
    /// Standard deviation of the ratio.
    pub sigma: T,
    /// Chi-square of the difference between the two runs that the stated mass does not explain.
    pub(crate) mismatch: T,
    /// Degrees of freedom of `mismatch`.
    pub(crate) freedom: u32,
}

/// Largest credible mismatch in spreads of chi-square: as for the prior's box, five are not noise.
const LARGEST_MISMATCH_SPREADS: f64 = 5.0;
/// Largest sigma for a correction of torques, as a share of the ratio. Above it the mass is too light.
const LARGEST_SIGMA_SHARE: f64 = 0.05;

impl<T: Real> ConstantRatio<T> {
    /// True if the two runs differ by the stated mass at the stated position, within noise; only noise is
    /// tolerated. A link assumed 5 % too long makes a constant 4.5 % wrong and adds at most 90 units of
    /// chi-square, where correct runs have eight.
    pub fn is_consistent(&self) -> bool {
        let freedom = T::from_double(f64::from(self.freedom));
        let spread = real::sqrt(freedom + freedom);
        self.mismatch <= freedom + T::from_double(LARGEST_MISMATCH_SPREADS) * spread
    }

    /// True if the mass is heavy enough to determine this joint's constant.
    pub fn is_determined(&self) -> bool {
        self.ratio > T::zero() && self.sigma <= T::from_double(LARGEST_SIGMA_SHARE) * self.ratio
    }
}

/// Assumed over true torque constant of one joint, from a record without and one with a load of base
/// parameters `load`; `None` where the load has no effect on the joint.
#[inline(never)]
pub fn torque_constant_ratio<T: Real, const N: usize, const B: usize>(
    without: &Record<T, N, B>,
    with: &Record<T, N, B>,
    joint: usize,
    load: &[T; B],
) -> Option<ConstantRatio<T>> {
    let (first, second) = (without.factors.get(joint)?, with.factors.get(joint)?);
    let mut both = Eliminated::<T, B>::new();
    both.take(first, &[T::zero(); B]);
    both.take(second, load);
    if !(both.load_squared > T::zero()) {
        return None;
    }
    let ratio = both.product / both.load_squared;
    let scaled_load = load.map(|element| ratio * element);

    // Both runs again with the load's torque subtracted: noise and mismatch remain.
    let mut together = first.clone();
    together.merge(&second.with_right(T::one(), &scaled_load));
    let columns = (0..B).filter(|&column| together.triangle()[column][column] != T::zero()).count();
    let information = real::max(without.row_information, T::from_double(1e-3));
    let apart = first.residual() + second.residual();
    let rows = without.rows[joint].saturating_add(with.rows[joint]);
    let free = T::from_double(f64::from(rows)) - T::from_double((2 * columns) as f64) / information;
    let floor = T::from_double(1e-5) * without.torque[joint].root_mean_square;
    let variance = apart / real::max(free, T::one()) / information;
    let noise = real::max(real::sqrt(variance), real::max(floor, T::from_double(1e-9)));
    Some(ConstantRatio {
        ratio,
        sigma: noise / real::sqrt(both.load_squared),
        mismatch: real::max(together.residual() - apart, T::zero()) / (noise * noise),
        freedom: columns.saturating_sub(1) as u32,
    })
}

/// Torque and the load's torque as right-hand sides, with the part that the columns explain rotated away.
struct Eliminated<T, const B: usize> {
    triangle: [[T; B]; B],
    torque: [T; B],
    load: [T; B],
    /// Sums w.w and w.v over the remaining parts.
    load_squared: T,
    product: T,
}

impl<T: Real, const B: usize> Eliminated<T, B> {
    fn new() -> Self {
        Self {
            triangle: [[T::zero(); B]; B],
            torque: [T::zero(); B],
            load: [T::zero(); B],
            load_squared: T::zero(),
            product: T::zero(),
        }
    }

    fn take(&mut self, factor: &Factor<T, B>, load: &[T; B]) {
        for (row, &torque) in factor.triangle().iter().zip(factor.right()) {
            self.rotate(*row, torque, real::dot(row, load));
        }
    }

    #[inline(never)]
    fn rotate(&mut self, mut row: [T; B], mut torque: T, mut load: T) {
        for column in 0..B {
            let (entering, diagonal) = (row[column], self.triangle[column][column]);
            let length = real::sqrt(diagonal * diagonal + entering * entering);
            if entering == T::zero() || !(length > T::zero()) {
                continue;
            }
            let (cosine, sine) = (diagonal / length, entering / length);
            let turn = |old: &mut T, new: &mut T| {
                (*old, *new) = (cosine * *old + sine * *new, cosine * *new - sine * *old);
            };
            let stored = &mut self.triangle[column];
            stored.iter_mut().zip(row.iter_mut()).skip(column).for_each(|(old, new)| turn(old, new));
            turn(&mut self.torque[column], &mut torque);
            turn(&mut self.load[column], &mut load);
        }
        self.load_squared += load * load;
        self.product += load * torque;
    }
}

impl<T: Real, const N: usize, const B: usize> Record<T, N, B> {
    /// Converts the record to true torque constants without the load of base parameters `load`: torque over
    /// `ratios` (assumed over true constant of each joint), less the load's. A record stores only the value
    /// of the mean absolute torque; it is assumed to change in proportion to the root mean square.
    pub fn corrected(&self, ratios: &[T; N], load: &[T; B]) -> Self {
        let mut record = self.clone();
        for (joint, (factor, &ratio)) in record.factors.iter_mut().zip(ratios).enumerate() {
            *factor = factor.with_right(T::one() / ratio, load);
            let size = &mut record.torque[joint];
            let rows = T::from_double(f64::from(self.rows[joint].max(1)));
            let squared = factor.right().iter().fold(factor.residual(), |sum, &right| sum + right * right);
            let root_mean_square = real::sqrt(squared / rows);
            if size.root_mean_square > T::zero() {
                size.mean_absolute *= root_mean_square / size.root_mean_square;
            }
            size.root_mean_square = root_mean_square;
            record.noise[joint] /= ratio;
            if let Some(fit) = &mut record.stribeck[joint] {
                fit.correct(ratio, load);
            }
        }
        record
    }
}

/// Adds the effect of one more uncertain number to an estimate's covariance. `moved` is the estimate for that
/// number one standard deviation larger.
pub(crate) fn widen<T: Real, const B: usize>(estimate: &mut Estimate<T, B>, moved: &Estimate<T, B>) {
    let mut step = [T::zero(); B];
    for (base, element) in step.iter_mut().enumerate() {
        if estimate.determined[base] && moved.determined[base] {
            *element = moved.values[base] - estimate.values[base];
        }
    }
    for (row, &left) in estimate.covariance.iter_mut().zip(&step) {
        for (element, &right) in row.iter_mut().zip(&step) {
            *element += left * right;
        }
    }
}

#[cfg(test)]
mod tests;
