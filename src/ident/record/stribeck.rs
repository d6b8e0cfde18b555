//! Stribeck friction from one record, without a second pass over the samples.
//!
//! Near standstill friction is higher by a surplus that fades with speed. The surplus is a linear parameter,
//! its speed is not, and the rows are gone when the search for the speed begins. The rows therefore carry
//! three columns of fixed speeds beside the others; any other speed's column is a combination of these.
//!
//! ```text
//! torque     ... + FC sign(v) + S sign(v) g(v / vs),   g(x) = exp(-x^2)                             (S1)
//! bank       sign(v) g(v / v_k),   v_k = 0.06, 0.12, 0.24 rad/s: each the fourth power of the next
//! g(v / vs)  = sum_k w_k(vs) g(v / v_k) + a + b v,   least squares over speeds from 0 to 1.5 rad/s  (S2)
//! gain(vs)   = max(0, u z)^2 / (u u),   u = R w(vs)                                                 (S3)
//! ```
//!
//! R and z are the last three rows of the factor of all joints, with every other parameter eliminated. The
//! search over vs therefore works on three numbers. All later steps use the factor with S and ln vs
//! *eliminated*, not held. Its cost is the least over both, and the covariance of all other parameters
//! includes their estimation.
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | S, vs | surplus FS - FC; speed at which it has fallen to 1/e | N m, rad/s |
//! | gain | chi-square that S explains | 1 |
//!
//! Sources: Stribeck's curve in Gaussian form: Armstrong-Helouvry, Dupont and Canudas de Wit (1994);
//! elimination of linear parameters: Golub and Pereyra, variable projection (1973). The error of (S2) is at
//! most 3.2 % of the surplus within 0.06..0.24 rad/s, and 14 % (root mean square 7 %) up to 1 rad/s. A wide
//! curve found so is far better than none: with vs = 0.6 rad/s Coulomb friction of the simulated knee is off
//! by at most 3.5 of its standard deviations in 20 runs, and by 21 to 30 where the search ends at 0.3. The
//! constant and the line come from the columns of Coulomb and viscous friction and make the error orthogonal
//! to these columns. Without them 1.7 % of the surplus went into Coulomb friction, two of its standard
//! deviations on the simulated leg; with them 0.2 %. Cost: one exponential per joint and sample; the search
//! about 60 small solutions per joint, once per motion.
//! Limits: the rows contain no speeds below 0.03 rad/s (standstill rule), so a vs below 0.05 rad/s is
//! reported as 0.05. A curve as wide as the speeds of the motion is part of Coulomb and viscous friction.

mod curve;

pub(crate) use curve::bank_columns;
pub use curve::{Combination, combination};

use curve::slope;

use super::factor::Factor;
use super::packed::{self, LARGEST_COLUMNS, LARGEST_SIZE, Row};
use super::window::Columns;
use crate::real::{self, Real, dot};

/// Stribeck columns of a joint.
pub(crate) const BANK: usize = 3;
/// Speed of the slowest column, rad/s; each is twice the one before.
pub(crate) const SLOWEST_RAD_S: f64 = 0.06;
/// Range of the search, rad/s.
pub(crate) const SPEEDS_RAD_S: (f64, f64) = (0.05, 1.0);
/// Largest pulse of an encoder's count, rad/s, with which a search under `auto` makes sense: a quarter of the
/// slowest vs.
pub(crate) const LARGEST_PULSE: f64 = SPEEDS_RAD_S.0 / 4.0;
/// Least chi-square of a surplus under `auto`. Without a surplus the gain stays below the chi-square of the
/// bank's three columns, which exceeds 30 in 1.4 of a million motions. In 200 undisturbed runs of the default
/// leg it was at most 8.7.
pub const SMALLEST_GAIN: f64 = 30.0;
/// Least surplus as a share of the torque's root mean square, however little noise there is. Errors of the
/// model and of the encoder cause smaller ones.
pub const SMALLEST_SURPLUS_SHARE: f64 = 0.02;
/// Prior standard deviation of ln vs: keeps an undetermined speed from corrupting the other parameters.
const LOG_SPEED_SIGMA: f64 = 0.5;
const GRID: usize = 37;

/// Result for one joint's Stribeck friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StribeckFit<T, const B: usize> {
    /// Speed vs, rad/s.
    pub speed: T,
    /// Standard deviation of the speed, rad/s.
    pub speed_sigma: T,
    /// Standard deviation of the surplus, N m.
    pub sigma: T,
    /// Chi-square that the surplus explains.
    pub gain: T,
    /// Best surplus for given base parameters: constant - slope . base.
    constant: T,
    slope: [T; B],
}

impl<T: Real, const B: usize> StribeckFit<T, B> {
    /// Surplus FS - FC for these base parameters, N m.
    pub fn surplus(&self, base: &[T; B]) -> T {
        self.slope.iter().zip(base).fold(self.constant, |sum, (&slope, &value)| sum - slope * value)
    }

    /// Converts the fit to torque over `ratio`, less that of base parameters `load`.
    pub(in crate::ident) fn correct(&mut self, ratio: T, load: &[T; B]) {
        self.constant = self
            .slope
            .iter()
            .zip(load)
            .fold(self.constant / ratio, |sum, (&slope, &value)| sum - slope * value);
        self.sigma /= ratio;
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> StribeckFit<U, B> {
        let convert = |value: T| U::from_double(value.to_double());
        StribeckFit {
            speed: convert(self.speed),
            speed_sigma: convert(self.speed_sigma),
            sigma: convert(self.sigma),
            gain: convert(self.gain),
            constant: convert(self.constant),
            slope: self.slope.map(convert),
        }
    }
}

/// One joint's packed rows, bank columns after the base columns, and the standard deviation of a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointRows<'a, T, const B: usize> {
    /// Packed factor.
    pub(crate) factor: &'a [T; LARGEST_SIZE],
    /// Columns of the factor.
    pub(crate) columns: &'a Columns<B>,
    /// Standard deviation of an independent row, N m.
    pub(crate) noise: T,
}

/// Rotates the factor so that the `front` combinations of the bank precede the base columns.
fn reordered<T: Real, const B: usize, const K: usize>(
    joint: &JointRows<'_, T, B>,
    front: &[Combination<T>; K],
) -> [T; LARGEST_SIZE] {
    let mut result = [T::zero(); LARGEST_SIZE];
    let (base, all) = (joint.columns.base().len(), joint.columns.all());
    for (column, stored) in packed::rows(joint.factor, all) {
        let mut row: Row<T> = [T::zero(); LARGEST_COLUMNS + 1];
        let at = |number: usize| number.checked_sub(column).and_then(|number| stored.get(number)).copied();
        for (slot, combination) in row.iter_mut().zip(front) {
            for (index, &weight) in combination.bank.iter().enumerate() {
                *slot += weight * at(base + index).unwrap_or(T::zero());
            }
            for (number, &weight) in joint.columns.friction.iter().zip(&combination.friction) {
                *slot += weight * number.and_then(at).unwrap_or(T::zero());
            }
        }
        for (number, slot) in row.iter_mut().skip(K).take(base).enumerate() {
            *slot = at(number).unwrap_or(T::zero());
        }
        if let (Some(slot), Some(&right)) = (row.get_mut(K + base), stored.last()) {
            *slot = right;
        }
        packed::rotate(&mut result, K + base, &mut row);
    }
    let residual = packed::residual(joint.factor, all);
    if let Some(sum) = result.get_mut(packed::size(K + base) - 1) {
        *sum += residual;
    }
    result
}

/// Base columns of a packed factor with its first `front` columns eliminated.
fn without_front<T: Real, const B: usize>(
    packed: &[T; LARGEST_SIZE],
    front: usize,
    columns: &Columns<B>,
) -> Factor<T, B> {
    let mut factor = Factor::new();
    let count = front + columns.base().len();
    for (column, stored) in packed::rows(packed, count).skip(front) {
        let Some((&right, elements)) = stored.split_last() else { continue };
        let mut row = [T::zero(); B];
        for (&element, &base) in elements.iter().zip(columns.base().iter().skip(column - front)) {
            row[base] = element;
        }
        factor.absorb(&row, right);
    }
    factor.add_residual(packed::residual(packed, count));
    factor
}

/// Base columns without Stribeck friction: the part that the bank would explain stays in the residual.
pub(crate) fn without_bank<T: Real, const B: usize>(joint: &JointRows<'_, T, B>) -> Factor<T, B> {
    without_front(&reordered::<T, B, 0>(joint, &[]), 0, joint.columns)
}

/// Base columns with the whole bank eliminated: unbiased with and without Stribeck friction.
pub(crate) fn bank_eliminated<T: Real, const B: usize>(joint: &JointRows<'_, T, B>) -> Factor<T, B> {
    let unit = core::array::from_fn(|row| Combination {
        bank: core::array::from_fn(|column| if row == column { T::one() } else { T::zero() }),
        friction: [T::zero(); 2],
    });
    without_front(&reordered::<T, B, BANK>(joint, &unit), BANK, joint.columns)
}

/// Bank's part of all rows with every base parameter eliminated, chi-square units.
struct Reduced<T> {
    rows: [[T; BANK]; BANK],
    right: [T; BANK],
}

impl<T: Real> Reduced<T> {
    fn new<const B: usize>(joint: &JointRows<'_, T, B>, others: &Factor<T, B>, rank: usize) -> Self {
        let mut all = [T::zero(); LARGEST_SIZE];
        let columns = (rank + BANK).min(LARGEST_COLUMNS);
        for (elements, &right) in others.triangle().iter().zip(others.right()) {
            let mut row: Row<T> = [T::zero(); LARGEST_COLUMNS + 1];
            for (slot, &element) in row.iter_mut().zip(elements).take(rank) {
                *slot = element;
            }
            row[columns] = right;
            packed::rotate(&mut all, columns, &mut row);
        }
        let (base, own) = (joint.columns.base(), joint.columns.all());
        for (column, stored) in packed::rows(joint.factor, own) {
            let mut row: Row<T> = [T::zero(); LARGEST_COLUMNS + 1];
            for (number, &element) in (column..own).zip(stored) {
                let target = base.get(number).copied().unwrap_or(rank + number - base.len());
                if let Some(slot) = row.get_mut(target) {
                    *slot = element / joint.noise;
                }
            }
            row[columns] = stored.last().copied().unwrap_or(T::zero()) / joint.noise;
            packed::rotate(&mut all, columns, &mut row);
        }
        let mut reduced = Self { rows: [[T::zero(); BANK]; BANK], right: [T::zero(); BANK] };
        for (index, (_, stored)) in packed::rows(&all, columns).skip(columns - BANK).enumerate() {
            for (slot, &element) in reduced.rows[index].iter_mut().skip(index).zip(stored) {
                *slot = element;
            }
            reduced.right[index] = stored.last().copied().unwrap_or(T::zero());
        }
        reduced
    }

    fn image(&self, weights: &[T; BANK]) -> [T; BANK] {
        self.rows.map(|row| dot(&row, weights))
    }

    /// (S3) and the surplus at its optimum.
    fn gain(&self, speed: T) -> (T, T) {
        let image = self.image(&combination(speed).bank);
        let power = dot(&image, &image);
        let along = dot(&image, &self.right);
        if power > T::zero() && along > T::zero() {
            (along * along / power, along / power)
        } else {
            (T::zero(), T::zero())
        }
    }

    /// Speed of the largest gain: a grid in ln vs, then two finer ones around the best point.
    fn best_speed(&self) -> T {
        let (slowest, fastest) = (T::from_double(SPEEDS_RAD_S.0), T::from_double(SPEEDS_RAD_S.1));
        let mut step = real::ln(fastest / slowest) / T::from_double((GRID - 1) as f64);
        let (mut low, mut count, mut best) = (slowest, GRID, (T::zero(), slowest));
        for _ in 0..3 {
            for index in 0..count {
                let speed = low * real::exp(step * T::from_double(index as f64));
                let speed = real::clamp(speed, slowest, fastest);
                let (gain, _) = self.gain(speed);
                if gain > best.0 {
                    best = (gain, speed);
                }
            }
            low = best.1 * real::exp(-step);
            step /= T::from_double(4.0);
            count = 9;
        }
        best.1
    }
}

/// Stribeck curve that explains most of one joint's rows.
pub(crate) struct Strongest<T> {
    reduced: Reduced<T>,
    speed: T,
    /// Chi-square that the curve explains.
    pub(crate) gain: T,
    /// Surplus, N m.
    pub(crate) surplus: T,
}

/// Searches for Stribeck friction of one joint. `others` holds the rows of the other joints, weighted to
/// chi-square units; `rank` is the number of base parameters.
pub(crate) fn strongest<T: Real, const B: usize>(
    joint: &JointRows<'_, T, B>,
    others: &Factor<T, B>,
    rank: usize,
) -> Strongest<T> {
    let reduced = Reduced::new(joint, others, rank);
    let speed = reduced.best_speed();
    let (gain, surplus) = reduced.gain(speed);
    Strongest { reduced, speed, gain, surplus }
}

/// Returns the fit and the joint's factor with surplus and speed eliminated. `None` where gain and surplus
/// are not both above `least`, or the problem is degenerate.
pub(crate) fn eliminate<T: Real, const B: usize>(
    joint: &JointRows<'_, T, B>,
    found: &Strongest<T>,
    least: (T, T),
) -> Option<(StribeckFit<T, B>, Factor<T, B>)> {
    let Strongest { reduced, speed, gain, surplus } = found;
    let (speed, gain, surplus) = (*speed, *gain, *surplus);
    if !(gain > least.0 && surplus > least.1 && real::is_finite(gain)) {
        return None;
    }
    let curve = combination(speed);
    let slope = slope(speed).scaled(surplus);
    // Information matrix of surplus and ln vs, the latter with its prior.
    let (one, other) = (reduced.image(&curve.bank), reduced.image(&slope.bank));
    let belief = T::one() / T::from_double(LOG_SPEED_SIGMA * LOG_SPEED_SIGMA);
    let (a, b, c) = (dot(&one, &one), dot(&one, &other), dot(&other, &other) + belief);
    let determinant = a * c - b * b;
    if !(determinant > T::zero()) {
        return None;
    }

    let mut front = reordered(joint, &[curve, slope]);
    let count = 2 + joint.columns.base().len();
    let mut prior: Row<T> = [T::zero(); LARGEST_COLUMNS + 1];
    prior[1] = joint.noise / T::from_double(LOG_SPEED_SIGMA);
    packed::rotate(&mut front, count, &mut prior);
    let mut rows = packed::rows(&front, count).map(|(_, row)| row);
    let (first, second) = (rows.next()?, rows.next()?);
    let ([own, passed, first @ .., right], [turned, second @ .., second_right]) = (first, second) else {
        return None;
    };
    // own S + passed dln(vs) + first . base = right,   turned dln(vs) + second . base = second_right
    let share = *passed / *turned;
    let mut slope = [T::zero(); B];
    for ((&one, &other), &base) in first.iter().zip(second).zip(joint.columns.base()) {
        slope[base] = (one - share * other) / *own;
    }
    let constant = (*right - share * *second_right) / *own;
    let fit = StribeckFit {
        speed,
        speed_sigma: speed * real::sqrt(a / determinant),
        sigma: real::sqrt(c / determinant),
        gain,
        constant,
        slope,
    };
    (real::is_finite(constant) && slope.iter().all(|&value| real::is_finite(value)))
        .then(|| (fit, without_front(&front, 2, joint.columns)))
}

#[cfg(test)]
mod tests;
