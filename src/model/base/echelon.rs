//! Regressor rows collected in a triangular factor, and its reduction to reduced echelon form.
//!
//! Orthogonal rotations only: the normal matrix would square the condition number, and `f32` has no digits to
//! spare. The columns are eliminated in an order of preference. Of two dependent columns the preferred one
//! stays, and the other is expressed through it.
//!
//! ```text
//! collect: | R |  rotated to | R' |        column by column in the order of preference
//!          | y |             | 0  |
//! reduce:  each column's part below the retained rows is rotated into one; retained if its share of the
//!          column exceeds the tolerance; then back-substitution makes the retained columns unit vectors
//! ```
//!
//! Source: G. H. Golub and C. F. Van Loan, Matrix Computations, 4th ed. 2013, sections 5.1.8 and 5.2.
//! Cost: 14 N rotations of 14 N columns per row collected; the factor takes (14 N)^2 numbers.

use super::super::parameter::{LegParameters, PARAMETERS_PER_JOINT, Parameter, RegressorRow};
use crate::real::{Real, abs, max, min, sqrt};

/// Order of preference: class by class, within a class from the proximal joint on.
const PREFERENCE: [&[Parameter]; 4] = [
    &[
        Parameter::XX,
        Parameter::XY,
        Parameter::XZ,
        Parameter::YZ,
        Parameter::ZZ,
        Parameter::HX,
        Parameter::HY,
    ],
    &[Parameter::FC, Parameter::FV, Parameter::OFF],
    &[Parameter::IA],
    &[Parameter::YY, Parameter::HZ, Parameter::M],
];

/// All columns of a leg of `N` joints, the preferred first: joint and parameter.
fn in_order_of_preference<const N: usize>() -> impl Iterator<Item = (usize, Parameter)> {
    PREFERENCE.iter().flat_map(|class| {
        (0..N).flat_map(move |joint| class.iter().map(move |parameter| (joint, *parameter)))
    })
}

/// Square factor of all collected rows; row k belongs to the k-th preferred column.
pub(super) struct Factor<T, const N: usize> {
    rows: [[RegressorRow<T, N>; PARAMETERS_PER_JOINT]; N],
}

/// Result of the reduction.
pub(super) struct Echelon<T> {
    /// Number of retained columns; the first `rank` rows of the factor belong to them.
    pub(crate) rank: usize,
    /// Smallest share of a retained column that earlier ones do not explain.
    pub(crate) smallest_retained: T,
    /// Largest such share of a dropped column.
    pub(crate) largest_dropped: T,
}

impl<T: Real, const N: usize> Factor<T, N> {
    pub fn new() -> Self {
        Self { rows: [[[[T::zero(); PARAMETERS_PER_JOINT]; N]; PARAMETERS_PER_JOINT]; N] }
    }

    /// Rows, in the order of preference of their columns.
    pub(crate) fn rows(&self) -> &[RegressorRow<T, N>] {
        self.rows.as_flattened()
    }

    /// Euclidean norms of the columns over all rows; rotations do not change them.
    pub(crate) fn column_norms(&self) -> LegParameters<T, N> {
        let mut norms = [[T::zero(); PARAMETERS_PER_JOINT]; N];
        for row in self.rows() {
            for (norm, value) in norms.iter_mut().flatten().zip(row.iter().flatten()) {
                *norm += *value * *value;
            }
        }
        norms.map(|joint| joint.map(sqrt))
    }

    /// Rotates one more row in.
    pub(crate) fn collect(&mut self, mut row: RegressorRow<T, N>) {
        for (own, (joint, parameter)) in
            self.rows.as_flattened_mut().iter_mut().zip(in_order_of_preference::<N>())
        {
            rotate(own, &mut row, joint, parameter);
        }
    }

    /// Brings the factor to echelon form; calls `retained` with each column that is
    /// independent of those before it.
    ///
    /// A column is dependent if its part beyond the retained ones is at most `tolerance` of its entry in
    /// `lengths`, all of which are positive.
    pub(crate) fn reduce(
        &mut self,
        tolerance: T,
        lengths: &LegParameters<T, N>,
        mut retained: impl FnMut(usize, usize, Parameter),
    ) -> Echelon<T> {
        let rows = self.rows.as_flattened_mut();
        let mut echelon = Echelon { rank: 0, smallest_retained: T::LARGEST, largest_dropped: T::zero() };
        for (joint, parameter) in in_order_of_preference::<N>() {
            let Some((pivot_row, below)) =
                rows.get_mut(echelon.rank..).and_then(<[RegressorRow<T, N>]>::split_first_mut)
            else {
                break;
            };
            for row in below {
                rotate(pivot_row, row, joint, parameter);
            }
            let share = abs(entry(pivot_row, joint, parameter)) / entry(lengths, joint, parameter);
            if share > tolerance {
                echelon.smallest_retained = min(echelon.smallest_retained, share);
                retained(echelon.rank, joint, parameter);
                echelon.rank += 1;
            } else {
                echelon.largest_dropped = max(echelon.largest_dropped, share);
            }
        }
        echelon
    }

    /// Back-substitution for one retained column: divides its row by the pivot and
    /// clears the column in earlier rows.
    pub(crate) fn substitute(&mut self, index: usize, joint: usize, parameter: Parameter) {
        let Some((pivot_row, before)) =
            self.rows.as_flattened_mut().get_mut(..=index).and_then(<[RegressorRow<T, N>]>::split_last_mut)
        else {
            return;
        };
        let pivot = entry(pivot_row, joint, parameter);
        for value in pivot_row.iter_mut().flatten() {
            *value /= pivot;
        }
        for row in before {
            let factor = entry(row, joint, parameter);
            for (value, own) in row.iter_mut().flatten().zip(pivot_row.iter().flatten()) {
                *value -= factor * *own;
            }
        }
    }
}

/// Rotates two rows so that the second one's entry in the column becomes zero.
fn rotate<T: Real, const N: usize>(
    into: &mut RegressorRow<T, N>,
    from: &mut RegressorRow<T, N>,
    joint: usize,
    parameter: Parameter,
) {
    let (retained, lost) = (entry(into, joint, parameter), entry(from, joint, parameter));
    if lost == T::zero() {
        return;
    }
    let length = sqrt(retained * retained + lost * lost);
    let (cosine, sine) = (retained / length, lost / length);
    for (one, other) in into.iter_mut().flatten().zip(from.iter_mut().flatten()) {
        (*one, *other) = (cosine * *one + sine * *other, cosine * *other - sine * *one);
    }
    if let Some(block) = from.get_mut(joint) {
        block[parameter.index()] = T::zero();
    }
}

/// Entry of a row in one column; zero for a joint that does not exist.
pub(super) fn entry<T: Real, const N: usize>(
    row: &RegressorRow<T, N>,
    joint: usize,
    parameter: Parameter,
) -> T {
    row.get(joint).map_or(T::zero(), |block| block[parameter.index()])
}
