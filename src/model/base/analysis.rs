//! Combinations of parameters that the torques of a leg determine: rank and null space, numerically.
//!
//! The closed form of [`super::regrouping`] ignores gravity, parallel axes and disabled friction columns.
//! This module therefore examines the regressor itself: many states, all joints, one factor. A column is
//! independent by the part that remains after the columns preferred to it are removed.
//!
//! ```text
//! torque = Y p = Y_B beta          beta_b = p_b + sum of terms(b) times dependent parameters
//! ```
//!
//! | symbol | meaning |
//! | --- | --- |
//! | p | the 14 N parameters |
//! | Y, Y_B | regressor; its independent columns |
//! | beta | base parameters, as many as the rank |
//!
//! Order of preference, so that the base set reads as in the literature: XX XY XZ YZ ZZ HX HY of all links,
//! then FC FV OFF, then IA, then YY HZ M. A link's XX thereby carries its -YY.
//!
//! Source: M. Gautier, Numerical calculation of the base inertial parameters of robots, 1991.
//! Cost: 64 states; once per leg, gravity and mask. For two joints in `f32` on a Cortex-M4F: 1.5
//! million instructions, 12 ms at 8 ns, and 6.2 kB of stack; the result takes about 60 N B bytes.
//! Limits: a column that is independent here may still be weak in a given motion; the statistics show that.

use nalgebra::Vector3;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

use super::super::chain::Chain;
use super::super::newton_euler::JointState;
use super::super::parameter::{LegParameters, PARAMETERS_PER_JOINT, Parameter, RegressorRow};
use super::super::regressor::{regressor, row_torque};
use super::echelon::{Factor, entry};
use crate::real::{Real, abs, is_finite, max, sqrt};

/// Mask of the 14 N parameters that are estimated at all; the columns of the others are disabled.
pub type ColumnMask<const N: usize> = [[bool; PARAMETERS_PER_JOINT]; N];

/// Number of random states. Each gives one row per joint, so there are at least four rows per column.
const STATES: usize = 64;

/// Bounds of the states' speeds, rad/s, and accelerations, rad/s2: gravity, inertia and
/// friction columns of like size.
const SPEED_BOUND: f64 = 3.0;
const ACCELERATION_BOUND: f64 = 10.0;

/// Reason why there is no base set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseError {
    /// The rank exceeds the capacity of the type.
    TooMany {
        /// Capacity needed.
        rank: usize,
    },
    /// No enabled parameter has an effect on any torque.
    NothingSeen,
    /// Gravity or a number of the chain is NaN or too large.
    NotFinite,
}

/// Identifiability of one parameter from the torques.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Determined by itself: it is this base parameter.
    Alone(usize),
    /// Determined only together with others. The number is the first base parameter that contains it;
    /// [`BaseParameters::carriers`] lists all.
    Grouped(usize),
    /// No torque depends on it.
    Unseen,
    /// Disabled by the mask.
    Off,
}

/// Gap between retained and dropped columns, as shares of a column's length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation<T> {
    /// Smallest share of a retained column that earlier ones do not explain; above the tolerance.
    pub smallest_retained: T,
    /// Largest such share of a dropped column; below the tolerance. If the gap is wide, it is pure rounding.
    pub largest_dropped: T,
}

/// Base parameters of a leg of `N` joints, at most `B`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseParameters<T, const N: usize, const B: usize> {
    rank: usize,
    /// Joint and parameter of the independent columns; the first `rank` entries are valid.
    independent: [(usize, Parameter); B],
    /// Rows of the reduced echelon form: 1 on their own independent column, 0 on all others'. The first
    /// `rank` are valid.
    terms: [LegParameters<T, N>; B],
    /// All-zero terms, for an index beyond the rank.
    nothing: LegParameters<T, N>,
    mask: ColumnMask<N>,
    separation: Separation<T>,
}

impl<T: Real, const N: usize, const B: usize> BaseParameters<T, N, B> {
    /// Analyses the chain under `gravity` (m/s2, base frame) for the parameters that `mask` enables.
    ///
    /// # Errors
    /// See [`BaseError`].
    pub fn analyse(
        chain: &Chain<T, N>,
        gravity: &Vector3<T>,
        mask: &ColumnMask<N>,
    ) -> Result<Self, BaseError> {
        let mut factor = Factor::new();
        collect(&mut factor, chain, gravity, mask);
        let norms = factor.column_norms();
        let largest = norms.iter().flatten().fold(T::zero(), |largest, norm| max(largest, *norm));
        if norms.iter().flatten().any(|norm| !is_finite(*norm)) {
            return Err(BaseError::NotFinite);
        }
        if largest == T::zero() {
            return Err(BaseError::NothingSeen);
        }

        let tolerance = tolerance();
        let shortest = largest * tolerance * T::from_double(ROUNDINGS);
        let lengths = norms.map(|joint| joint.map(|norm| max(norm, shortest)));
        let mut independent = [(0, Parameter::XX); B];
        let echelon = factor.reduce(tolerance, &lengths, |index, joint, parameter| {
            if let Some(slot) = independent.get_mut(index) {
                *slot = (joint, parameter);
            }
        });
        let rank = echelon.rank;
        if rank > B {
            return Err(BaseError::TooMany { rank });
        }
        for (index, (joint, parameter)) in independent.iter().enumerate().take(rank).rev() {
            factor.substitute(index, *joint, *parameter);
        }

        let mut base = Self {
            rank,
            independent,
            terms: [[[T::zero(); PARAMETERS_PER_JOINT]; N]; B],
            nothing: [[T::zero(); PARAMETERS_PER_JOINT]; N],
            mask: *mask,
            separation: Separation {
                smallest_retained: echelon.smallest_retained,
                largest_dropped: echelon.largest_dropped,
            },
        };
        for (index, (terms, row)) in base.terms.iter_mut().zip(factor.rows()).enumerate().take(rank) {
            let columns = base.independent.get(..rank).unwrap_or_default();
            let own =
                columns.get(index).map_or(T::zero(), |(joint, parameter)| entry(&norms, *joint, *parameter));
            *terms = cleaned(
                row,
                index,
                columns,
                own,
                &lengths.map(|joint| joint.map(|length| tolerance * length)),
            );
        }
        Ok(base)
    }

    /// Number of base parameters.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Gap between retained and dropped columns: the margin of the rank.
    pub fn separation(&self) -> Separation<T> {
        self.separation
    }

    /// Joint (from 0) and parameter whose column stands for base parameter `b`; `None` from the rank on.
    pub fn independent(&self, b: usize) -> Option<(usize, Parameter)> {
        self.columns().get(b).copied()
    }

    /// Factors by which parameters sum up to base parameter `b`: 1 on its independent
    /// column. All zero from the rank on.
    pub fn terms(&self, b: usize) -> &LegParameters<T, N> {
        self.terms.get(b).unwrap_or(&self.nothing)
    }

    /// Selects the independent columns of a regressor row, so that `out` . beta = row . parameters (without
    /// masked ones). Entries from the rank on become 0.
    pub(crate) fn select(&self, row: &RegressorRow<T, N>, out: &mut [T; B]) {
        *out = [T::zero(); B];
        for (value, (joint, parameter)) in out.iter_mut().zip(self.columns()) {
            *value = entry(row, *joint, *parameter);
        }
    }

    /// Base values of full parameters; 0 from the rank on.
    pub fn project(&self, parameters: &LegParameters<T, N>) -> [T; B] {
        core::array::from_fn(|b| row_torque(self.terms(b), parameters))
    }

    /// Full parameters with these base values. Starts from `others` and changes the independent
    /// columns' parameters until the projection fits. With zero `others` the independent columns'
    /// parameters are the base values.
    pub(crate) fn complete(&self, values: &[T; B], others: &LegParameters<T, N>) -> LegParameters<T, N> {
        let present = self.project(others);
        let mut parameters = *others;
        for ((joint, parameter), (wanted, present)) in self.columns().iter().zip(values.iter().zip(&present))
        {
            if let Some(block) = parameters.get_mut(*joint) {
                block[parameter.index()] += *wanted - *present;
            }
        }
        parameters
    }

    /// Identifiability of a parameter; [`Standing::Off`] for a joint that does not exist.
    pub fn standing(&self, joint: usize, parameter: Parameter) -> Standing {
        if !self.mask.get(joint).is_some_and(|block| block[parameter.index()]) {
            return Standing::Off;
        }
        let Some(first) = self.carriers(joint, parameter).next() else {
            return Standing::Unseen;
        };
        let members = self.terms(first).iter().flatten().filter(|factor| **factor != T::zero()).count();
        let own = self.independent(first) == Some((joint, parameter));
        if own && members == 1 { Standing::Alone(first) } else { Standing::Grouped(first) }
    }

    /// Base parameters that contain a parameter, ascending.
    pub fn carriers(&self, joint: usize, parameter: Parameter) -> impl Iterator<Item = usize> + '_ {
        (0..self.rank).filter(move |b| entry(self.terms(*b), joint, parameter) != T::zero())
    }

    fn columns(&self) -> &[(usize, Parameter)] {
        self.independent.get(..self.rank).unwrap_or_default()
    }
}

/// Rounding of an entry, in units of the last place of the largest column's. Terms that cancel in a short
/// column leave their rounding in it. A column therefore counts as at least `ROUNDINGS` tolerances of the
/// longest one long.
const ROUNDINGS: f64 = 4.0;

/// Share of a column below which others explain it, and below which a contribution counts as zero.
///
/// Halfway, in digits, between 1 and rounding: 3.5e-4 in `f32`, 1.5e-8 in `f64`.
fn tolerance<T: Real>() -> T {
    sqrt(T::EPSILON)
}

/// Collects the regressor rows of many states in the factor; every call uses equal states.
fn collect<T: Real, const N: usize>(
    factor: &mut Factor<T, N>,
    chain: &Chain<T, N>,
    gravity: &Vector3<T>,
    mask: &ColumnMask<N>,
) {
    let mut random = Xoshiro128PlusPlus::seed_from_u64(1);
    // From the middle of all integers, so that single precision suffices.
    let mut within = |bound: f64| {
        let number = random.next_u32() ^ (1 << 31);
        T::from_double(f64::from(number.cast_signed()))
            * (T::from_double(bound) / T::from_double(2_147_483_648.0))
    };
    for _ in 0..STATES {
        let state = JointState {
            q: core::array::from_fn(|_| within(core::f64::consts::PI)),
            qd: core::array::from_fn(|_| within(SPEED_BOUND)),
            qdd: core::array::from_fn(|_| within(ACCELERATION_BOUND)),
        };
        for mut row in regressor(chain, &state, gravity) {
            for (value, on) in row.iter_mut().flatten().zip(mask.iter().flatten()) {
                if !on {
                    *value = T::zero();
                }
            }
            factor.collect(row);
        }
    }
}

/// Cleans an echelon row: exact ones and zeros on the independent columns, no factors that are only rounding.
///
/// `own` is the norm of the row's independent column. A factor times `own` is the contribution to a dependent
/// column; up to that column's entry in `least` it is rounding.
fn cleaned<T: Real, const N: usize>(
    row: &RegressorRow<T, N>,
    index: usize,
    independent: &[(usize, Parameter)],
    own: T,
    least: &LegParameters<T, N>,
) -> LegParameters<T, N> {
    let mut terms = *row;
    for (factor, least) in terms.iter_mut().flatten().zip(least.iter().flatten()) {
        if abs(*factor) * own <= *least {
            *factor = T::zero();
        }
    }
    for (other, (joint, parameter)) in independent.iter().enumerate() {
        if let Some(block) = terms.get_mut(*joint) {
            block[parameter.index()] = if other == index { T::one() } else { T::zero() };
        }
    }
    terms
}

#[cfg(test)]
mod tests;
