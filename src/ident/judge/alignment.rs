//! Test of link lengths and encoder zeros: does the held-out torque indicate values other than the model's?
//!
//! Why: with a link assumed ten per cent too long, the identified model still predicts the torque
//! within two per cent. Masses and moments make up for most of the error. The rest is small but
//! points in a known direction:
//!
//! ```text
//! z_j = d tau / d ln a_j,   d tau / d q0_j           at the model's parameters, by a difference quotient
//! r   = Y nu + z delta + noise                       rows of the held-out motions, over sigma of their joint
//! R   = triangular factor of (Y, z, r)               u_j, w: the part of z_j and r below the rows of Y
//! S   = u'u,  delta = u'w / S,  sigma = 1 / sqrt S   each direction alone
//! U delta = w,   sigma_j^2 = (U'U)^-1_jj             all directions together
//! ```
//!
//! delta is the share by which a link is longer than assumed, or the angle by which a zero is off. For a
//! correct leg it is zero within sigma (score test, Rao 1948). It is computed twice: for each direction
//! alone, with the parameters free to follow, and for all directions together. The first is sharper for a
//! single error. A wrong length and a wrong zero can cancel there; only the second shows them. The motion
//! used for the identification is not tested: while it is recorded, the parameters and hence z are unknown.
//!
//! A push by the wearer is not a geometry error, but z'r would read it as one. Rows within [`HELD`] rows of
//! an unexpectedly large residual are therefore excluded. A wrong length or zero misses by a few per cent of
//! the torque, never by that much.
//!
//! Known limits: the zero of the last joint turns that link's own frame, and its first moments absorb it
//! exactly. The lengths before the first joint have no effect on torque. Neither is tested.
//! z is taken at the row's centre without filtering, because rigid-body derivatives
//! lie in the filter's passband.
//! Cost: one torque evaluation for each of 2 (N - 1) directions and one row rotated into B + 4
//! columns for each joint, 50 times a second. Memory: 561 numbers, N (B + 6) for each of [`HELD`]
//! rows and a queue of row centres.

use crate::ident::record::packed::{self, LARGEST_COLUMNS, LARGEST_SIZE};
use crate::ident::record::recorder::LARGEST_STILL_SHARE;
use crate::ident::record::row_model::RowModel;
use crate::ident::record::rows::{DECIMATION, FilteredRows};
use crate::ident::signal::smoothing::Smoothed;
use crate::model::{Chain, JointState, LegParameters, PARAMETERS_PER_JOINT, rigid_body_torques};
use crate::real::{self, Real};

/// Directions tested: the length before each joint but the first, then the zero of each joint but the last.
/// Enough for three joints.
pub(crate) const DIRECTIONS: usize = 4;
/// Rows held back, and rows excluded on either side of an unexpectedly large residual: 0.3 s. That is the
/// longer half of a push plus the filter's reach.
pub(crate) const HELD: usize = 15;
/// Smallest share of a direction's power that the parameters must leave, or the direction is not
/// reported. Single precision leaves 6e-7 of a wholly absorbed direction. The first joint's zero,
/// mostly gravity, leaves 6e-5.
const SEEN_SHARE: f64 = 1e-5;
/// Step of the difference quotients: relative for a length, rad for a zero.
const STEP: f64 = 1e-2;

/// Kind of geometry error that a direction stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Length of the link before a joint; delta is the share by which it is longer than assumed.
    Length,
    /// A joint's zero; delta is the angle by which it is too far on, rad.
    Zero,
}

/// Geometry error that the held-out motions show in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misalignment<T> {
    /// Length or zero.
    pub direction: Direction,
    /// Joint index.
    pub joint: usize,
    /// Error in the unit of [`Direction`], estimated from this direction alone.
    pub delta: T,
    /// Standard deviation of `delta`.
    pub sigma: T,
    /// Error and standard deviation, estimated together with all other directions; `None` where those absorb
    /// it.
    pub beside: Option<(T, T)>,
}

/// One entry per direction; `None` where the torque does not determine it.
pub type Misalignments<T> = [Option<Misalignment<T>>; DIRECTIONS];

/// One row of each joint, held back until it is known to be undisturbed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HeldRow<T, const N: usize, const B: usize> {
    used: [bool; N],
    columns: [[T; B]; N],
    directions: [[T; N]; DIRECTIONS],
    residual: [T; N],
}

/// The directions' factor over all held-out motions of one identification.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment<T, const N: usize, const B: usize, const PENDING: usize> {
    /// Packed: base columns, directions, residual.
    factor: [T; LARGEST_SIZE],
    outlier_bound: [T; N],
    weight: [T; N],
    /// Columns that are not estimated.
    dropped: [bool; B],
    held: [HeldRow<T, N, B>; HELD],
    /// Rows since the motion began, and how many of these have left [`Self::held`].
    rows: usize,
    left: usize,
    /// Index of each joint's last row with an unexpectedly large residual.
    last_outlier: [Option<usize>; N],
    /// Directions at the centres of unfinished rows.
    queue: [[[T; N]; DIRECTIONS]; PENDING],
    next: usize,
    waiting: usize,
    /// Smoothed instants since the motion began.
    instants: usize,
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> Alignment<T, N, B, PENDING> {
    /// Starts without data.
    pub fn new() -> Self {
        let zero = T::zero();
        let row = HeldRow {
            used: [false; N],
            columns: [[zero; B]; N],
            directions: [[zero; N]; DIRECTIONS],
            residual: [zero; N],
        };
        Self {
            factor: [zero; LARGEST_SIZE],
            outlier_bound: [T::LARGEST; N],
            weight: [zero; N],
            dropped: [false; B],
            held: [row; HELD],
            rows: 0,
            left: 0,
            last_outlier: [None; N],
            queue: [[[zero; N]; DIRECTIONS]; PENDING],
            next: 0,
            waiting: 0,
            instants: 0,
        }
    }

    /// Discards all motions.
    pub fn clear(&mut self) {
        self.break_off();
        self.factor.fill(T::zero());
    }

    /// Starts another motion. A residual above `outlier_bound` (N m) marks a row as disturbed; `noise` is
    /// the standard deviation of an independent row of each joint, N m. Columns that were
    /// `dropped` are not free to follow.
    pub(crate) fn begin(&mut self, outlier_bound: &[T; N], noise: &[T; N], dropped: &[bool; B]) {
        self.break_off();
        (self.outlier_bound, self.weight, self.dropped) =
            (*outlier_bound, noise.map(|noise| T::one() / noise), *dropped);
    }

    /// Ends a continuous stretch of samples: all rows that are held back enter the factor.
    pub(crate) fn break_off(&mut self) {
        while self.left < self.rows {
            self.release();
        }
        (self.rows, self.left, self.last_outlier) = (0, 0, [None; N]);
        (self.next, self.waiting, self.instants) = (0, 0, 0);
    }

    /// Takes a smoothed instant and the rows that it finished, if any. `reach` is that of the low-pass: a row
    /// is centred that many instants before the instant that finishes it (whole windows only).
    pub(crate) fn take(
        &mut self,
        model: &RowModel<T, N, B>,
        values: &[T; B],
        reach: usize,
        instant: &Smoothed<T, N>,
        rows: Option<&FilteredRows<T, N, B>>,
    ) {
        if self.instants >= reach
            && (self.instants - reach).is_multiple_of(DECIMATION)
            && self.waiting < PENDING
        {
            let slot = (self.next + self.waiting) % PENDING.max(1);
            if let Some(slot) = self.queue.get_mut(slot) {
                directions(model, values, instant, slot);
                self.waiting += 1;
            }
        }
        self.instants += 1;
        if let Some(rows) = rows
            && self.waiting > 0
        {
            let centre = self.queue.get(self.next).copied();
            self.next = (self.next + 1) % PENDING.max(1);
            self.waiting -= 1;
            if let Some(centre) = centre.filter(|_| rows.is_finite()) {
                self.hold(values, rows, centre);
            }
        }
    }

    fn hold(&mut self, values: &[T; B], rows: &FilteredRows<T, N, B>, directions: [[T; N]; DIRECTIONS]) {
        let used = rows.still.map(|still| !(still > T::from_double(LARGEST_STILL_SHARE)));
        let mut residual = rows.torque;
        for joint in 0..N {
            residual[joint] -= real::dot(&rows.regressor[joint], values);
            if used[joint] && real::abs(residual[joint]) > self.outlier_bound[joint] {
                self.last_outlier[joint] = Some(self.rows);
            }
        }
        if let Some(slot) = self.held.get_mut(self.rows % HELD) {
            *slot = HeldRow { used, columns: rows.regressor, directions, residual };
        }
        self.rows += 1;
        if self.rows - self.left >= HELD {
            self.release();
        }
    }

    /// Moves the oldest held row into the factor, unless it is too near to a disturbance.
    fn release(&mut self) {
        let row = self.left;
        self.left += 1;
        let Some(held) = self.held.get(row % HELD).copied() else { return };
        for joint in (0..N).filter(|&joint| held.used[joint]) {
            if self.last_outlier[joint].is_some_and(|outlier| outlier + HELD >= row) {
                continue;
            }
            let mut entering = [T::zero(); LARGEST_COLUMNS + 1];
            let directions = held.directions.iter().map(|torque| torque[joint]);
            let columns = held.columns[joint].iter().zip(&self.dropped);
            let columns = columns.map(|(&element, &dropped)| if dropped { T::zero() } else { element });
            let elements = columns.chain(directions);
            let elements = elements.chain(core::iter::once(held.residual[joint]));
            for (slot, element) in entering.iter_mut().zip(elements) {
                *slot = element * self.weight[joint];
            }
            packed::rotate(&mut self.factor, Self::COLUMNS, &mut entering);
        }
    }

    /// Base columns and directions; checked at compile time against the packed factor's capacity.
    const COLUMNS: usize = {
        assert!(B + DIRECTIONS <= LARGEST_COLUMNS, "no room for the directions");
        B + DIRECTIONS
    };

    /// Errors found so far; call `Self::break_off` first to end the last motion. `None` for a direction
    /// that does not exist or that the parameters absorb.
    pub fn misalignments(&self) -> Misalignments<T> {
        let (mut power, mut seen, mut along) =
            ([T::zero(); DIRECTIONS], [T::zero(); DIRECTIONS], [T::zero(); DIRECTIONS]);
        for (column, row) in packed::rows(&self.factor, Self::COLUMNS) {
            let right = row.last().copied().unwrap_or(T::zero());
            for direction in 0..DIRECTIONS {
                let element = (B + direction).checked_sub(column).and_then(|position| row.get(position));
                let element = element.copied().unwrap_or(T::zero());
                power[direction] += element * element;
                if column >= B {
                    seen[direction] += element * element;
                    along[direction] += element * right;
                }
            }
        }
        let beside = self.beside(&power);
        core::array::from_fn(|index| {
            let (direction, joint) = subject::<N>(index)?;
            if !(power[index] > T::zero() && seen[index] > T::from_double(SEEN_SHARE) * power[index]) {
                return None;
            }
            Some(Misalignment {
                direction,
                joint,
                delta: along[index] / seen[index],
                sigma: T::one() / real::sqrt(seen[index]),
                beside: beside[index],
            })
        })
    }

    /// Solves all directions together: `U delta = w` by back substitution. An absorbed direction stays 0.
    fn beside(&self, power: &[T; DIRECTIONS]) -> [Option<(T, T)>; DIRECTIONS] {
        let mut triangle = [[T::zero(); DIRECTIONS]; DIRECTIONS];
        // Columns: the unit matrix, whose solution is U^-1, then the right-hand side.
        let mut solved = [[T::zero(); DIRECTIONS + 1]; DIRECTIONS];
        for (column, row) in packed::rows(&self.factor, Self::COLUMNS) {
            let Some(direction) = column.checked_sub(B).filter(|&direction| direction < DIRECTIONS) else {
                continue;
            };
            for (slot, &element) in triangle[direction].iter_mut().skip(direction).zip(row) {
                *slot = element;
            }
            solved[direction][direction] = T::one();
            solved[direction][DIRECTIONS] = row.last().copied().unwrap_or(T::zero());
        }
        let mut seen = [false; DIRECTIONS];
        for direction in (0..DIRECTIONS).rev() {
            let pivot = triangle[direction][direction];
            seen[direction] = pivot * pivot > T::from_double(SEEN_SHARE) * power[direction];
            let mut rest = solved[direction];
            for later in direction + 1..DIRECTIONS {
                for (element, &known) in rest.iter_mut().zip(&solved[later]) {
                    *element -= triangle[direction][later] * known;
                }
            }
            solved[direction] = if seen[direction] {
                rest.map(|element| element / pivot)
            } else {
                [T::zero(); DIRECTIONS + 1]
            };
        }
        core::array::from_fn(|direction| {
            let row = &solved[direction];
            let variance =
                row.iter().take(DIRECTIONS).fold(T::zero(), |sum, &element| sum + element * element);
            seen[direction].then(|| (row[DIRECTIONS], real::sqrt(variance)))
        })
    }
}

/// Kind and joint of a direction: the lengths before joints 1.., then the zeros of joints ..N-1.
fn subject<const N: usize>(index: usize) -> Option<(Direction, usize)> {
    let others = N.checked_sub(1)?;
    match index.checked_sub(others) {
        None => Some((Direction::Length, index + 1)),
        Some(joint) if joint < others => Some((Direction::Zero, joint)),
        Some(_) => None,
    }
}

/// Change of the torques with each direction at one instant; zero for a direction that does not exist.
fn directions<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    values: &[T; B],
    instant: &Smoothed<T, N>,
    slots: &mut [[T; N]; DIRECTIONS],
) {
    let parameters: LegParameters<T, N> =
        model.base.complete(values, &[[T::zero(); PARAMETERS_PER_JOINT]; N]);
    let state = JointState { q: instant.position, qd: instant.velocity, qdd: instant.acceleration };
    let torques = |chain: &Chain<T, N>, state: &JointState<T, N>| {
        rigid_body_torques(chain, &parameters, state, &model.gravity)
    };
    let here = torques(&model.chain, &state);
    let slope =
        |there: [T; N]| core::array::from_fn(|joint| (there[joint] - here[joint]) / T::from_double(STEP));
    for (index, slot) in slots.iter_mut().enumerate() {
        *slot = match subject::<N>(index) {
            Some((Direction::Zero, joint)) => {
                let mut turned = state;
                turned.q[joint] += T::from_double(STEP);
                slope(torques(&model.chain, &turned))
            }
            Some((Direction::Length, joint)) if model.chain.has_length(joint) => {
                slope(torques(&model.chain.with_length(joint, T::from_double(1.0 + STEP)), &state))
            }
            _ => [T::zero(); N],
        };
    }
}
