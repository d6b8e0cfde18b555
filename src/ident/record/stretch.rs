//! Durations of disturbances on the motion identified from, by the times of its rows.
//!
//! Why: blocks of a long motion are long ([`super::window`]). After 40 minutes a block lasts 41 s, so a push
//! of 0.6 s would count as 41 s of contact with the floor. Once the parameters are known, a second pass over
//! the rows gives the duration itself. Weights stay those of the blocks.
//!
//! ```text
//! e_k    = |tau_k - y_k p|                               filtered rows at 50 Hz
//! start  = 3 rms e + 0.025 rms tau                       over the weighted rows of the motion
//! stretch of a joint   consecutive rows with e > start / 2, at least one of them with e > start
//! common stretch       consecutive rows with e > start / 2 in all moving joints, some e > start among them
//! ```
//!
//! Friction at rest takes any value up to breakaway. A joint at rest therefore counts only where its error
//! exceeds start + 2 FC, FC by the share of its window at rest. Otherwise its own stretch goes on, and in a
//! common one the moving joints decide. Two limits keep a stretch whole where the error of a push changes its
//! sign. Cost: B multiplications for each joint and row. Known limits: needs the rows a second time, so it
//! serves recordings. The drive's own record has blocks of 0.64 s at most in its first 44 s.

use super::motion_record::Record;
use super::recorder::LARGEST_STILL_SHARE;
use super::row_model::RowModel;
use super::rows::FilteredRows;
use crate::model::Parameter;
use crate::real::{self, Real};

/// Time between two rows, s.
pub(in crate::ident) const ROW_S: f64 = 0.02;
/// Error at which a stretch counts, in root mean square errors of the undisturbed rows: noise stays below.
const START_ERRORS: f64 = 3.0;
/// Its share of the torque: half of the systematic error that is harmless.
const START_TORQUE_SHARE: f64 = 0.025;
/// Error that continues a stretch, as a share of the start's.
const CONTINUED_SHARE: f64 = 0.5;

/// Disturbed stretches of one motion, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretches<T, const N: usize, const B: usize> {
    values: [T; B],
    start: [T; N],
    /// Largest error of a row at rest by friction, N m.
    friction: [T; N],
    /// Rows of the joint's present stretch.
    own: [u32; N],
    has_started: [bool; N],
    common: u32,
    has_common_started: bool,
    /// Longest stretch of each joint, s.
    pub(crate) longest_s: [T; N],
    /// Longest stretch of all joints at once, s.
    pub longest_common_s: T,
}

impl<T: Real, const N: usize, const B: usize> Stretches<T, N, B> {
    /// Starts without rows; `values` are the base parameters found from this record.
    pub fn new(model: &RowModel<T, N, B>, record: &Record<T, N, B>, values: &[T; B]) -> Self {
        let start = core::array::from_fn(|joint| {
            let size = record.torque[joint].root_mean_square;
            let error = record.torque_error(joint, values).unwrap_or(size);
            T::from_double(START_ERRORS) * error + T::from_double(START_TORQUE_SHARE) * size
        });
        Self {
            values: *values,
            start,
            friction: core::array::from_fn(|joint| {
                let coulomb = model.drive(joint, Parameter::FC).map_or(T::zero(), |base| values[base]);
                T::from_double(2.0) * real::abs(coulomb) * (T::one() + model.stribeck[joint].excess)
            }),
            own: [0; N],
            has_started: [false; N],
            common: 0,
            has_common_started: false,
            longest_s: [T::zero(); N],
            longest_common_s: T::zero(),
        }
    }

    /// Ends a continuous stretch of rows.
    pub fn break_off(&mut self) {
        (self.own, self.has_started) = ([0; N], [false; N]);
        (self.common, self.has_common_started) = (0, false);
    }

    /// Takes one row of each joint.
    pub fn take(&mut self, rows: &FilteredRows<T, N, B>) {
        if !rows.is_finite() {
            self.break_off();
            return;
        }
        let (mut missed, mut expected, mut beyond) = (false, false, false);
        for joint in 0..N {
            let row = rows.regressor[joint].iter().zip(&self.values);
            let error = row.fold(rows.torque[joint], |rest, (&element, &value)| rest - element * value);
            let is_at_rest = rows.still[joint] > T::from_double(LARGEST_STILL_SHARE);
            let start = self.start[joint];
            let (continued, start) = if is_at_rest {
                let start = start + rows.still[joint] * self.friction[joint];
                (start, start)
            } else {
                (T::from_double(CONTINUED_SHARE) * start, start)
            };
            let error = real::abs(error);
            if error > continued {
                missed = true;
                beyond |= error > start;
                self.own[joint] = self.own[joint].saturating_add(1);
                self.has_started[joint] |= error > start;
            } else if is_at_rest {
                self.own[joint] += u32::from(self.own[joint] > 0);
            } else {
                expected = true;
                (self.own[joint], self.has_started[joint]) = (0, false);
            }
            if self.has_started[joint] {
                self.longest_s[joint] = real::max(self.longest_s[joint], seconds(self.own[joint]));
            }
        }
        if expected {
            (self.common, self.has_common_started) = (0, false);
        } else if missed || self.common > 0 {
            self.common = self.common.saturating_add(1);
            self.has_common_started |= beyond;
        }
        if self.has_common_started {
            self.longest_common_s = real::max(self.longest_common_s, seconds(self.common));
        }
    }
}

fn seconds<T: Real>(rows: u32) -> T {
    T::from_double(f64::from(rows)) * T::from_double(ROW_S)
}
