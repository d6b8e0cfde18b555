//! Cramer-Rao bound of a simulated motion: the noise-free rows of every logged sample, Stribeck
//! friction included.
//!
//! ```text
//! bound^2 = diagonal of (sum of y' y / noise^2)^-1,   y = base columns | per joint with Stribeck friction:
//!           sign(v) g(v / vs),   d/d ln vs = S sign(v) g(v / vs) 2 (v / vs)^2
//! ```
//!
//! No unbiased estimator of these parameters has a smaller variance. Rows of a sticking joint are excluded.

use scarab::ident::record::packed::{self, LARGEST_COLUMNS, LARGEST_SIZE, Row};
use scarab::real::{exp, sign, sqrt};

use crate::leg::background::StribeckTruth;

/// Information of a motion.
#[derive(Clone, Debug)]
pub struct Information<const N: usize> {
    factor: [f64; LARGEST_SIZE],
    rank: usize,
    curves: [Option<StribeckTruth>; N],
    columns: usize,
}

impl<const N: usize> Information<N> {
    /// Information of `rank` base parameters and the joints' curves; curves beyond the capacity are
    /// omitted.
    pub fn new(rank: usize, curves: [Option<StribeckTruth>; N]) -> Self {
        let columns = rank + 2 * curves.iter().flatten().count();
        let (curves, columns) = if columns <= LARGEST_COLUMNS {
            (curves, columns)
        } else {
            ([None; N], rank.min(LARGEST_COLUMNS))
        };
        Self { factor: [0.0; LARGEST_SIZE], rank, curves, columns }
    }

    /// Column of a joint's surplus.
    fn index(&self, joint: usize) -> Option<usize> {
        self.curves[joint].map(|_| self.rank + 2 * self.curves[..joint].iter().flatten().count())
    }

    /// Adds one sample of a joint's torque with this noise, N m; `velocity` is the joint's.
    pub fn insert(&mut self, joint: usize, regressor: &[f64], velocity: f64, noise: f64) {
        let mut row: Row<f64> = [0.0; LARGEST_COLUMNS + 1];
        let weight = 1.0 / noise.max(1e-12);
        for (slot, element) in row.iter_mut().zip(regressor).take(self.rank) {
            *slot = element * weight;
        }
        if let (Some(index), Some(curve)) = (self.index(joint), self.curves[joint]) {
            let ratio = velocity / curve.speed;
            let column = weight * sign(velocity) * exp(-ratio * ratio);
            row[index] = column;
            row[index + 1] = column * curve.surplus * 2.0 * ratio * ratio;
        }
        packed::rotate(&mut self.factor, self.columns, &mut row);
    }

    /// Information with these base parameters known to be zero.
    pub fn without(&self, dropped: &[bool]) -> Self {
        let mut factor = [0.0; LARGEST_SIZE];
        for (column, kept) in packed::rows(&self.factor, self.columns) {
            let mut row: Row<f64> = [0.0; LARGEST_COLUMNS + 1];
            for (index, &element) in (column..).zip(kept) {
                row[index] = if dropped.get(index) == Some(&true) { 0.0 } else { element };
            }
            packed::rotate(&mut factor, self.columns, &mut row);
        }
        Self { factor, ..self.clone() }
    }

    /// Bounds of the base parameters and of each joint's surplus.
    pub fn bounds<const B: usize>(&self) -> ([f64; B], [Option<f64>; N]) {
        let mut variance = [0.0; LARGEST_COLUMNS];
        for unit in 0..self.columns {
            // R x = unit vector: one column of the inverse.
            let mut factor = self.factor;
            let mut end = 0;
            for column in 0..self.columns {
                end += self.columns - column + 1;
                factor[end - 1] = f64::from(u8::from(column == unit));
            }
            let inverse = packed::solve(&factor, self.columns, 0.0);
            for (sum, element) in variance.iter_mut().zip(inverse) {
                *sum += element * element;
            }
        }
        let base = core::array::from_fn(|base| if base < self.rank { sqrt(variance[base]) } else { 0.0 });
        (base, core::array::from_fn(|joint| self.index(joint).map(|index| sqrt(variance[index]))))
    }
}
