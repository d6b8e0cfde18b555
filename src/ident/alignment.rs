//! Whether held-out torque asks for other link lengths or encoder zeros than the model has.
//!
//! Why: a leg whose link is believed ten per cent too long is predicted within two per cent of its torque, since masses
//! and moments make up for most of it. What they cannot make up for is small but points in a known direction:
//!
//! ```text
//! z_j = d tau / d ln a_j,   d tau / d q0_j                   at the model's parameters, by a difference quotient
//! r   = Y nu + z delta + noise                               rows of the held-out motions, over sigma of their joint
//! R   = triangular factor of (Y, z, r);  u_j, w: what of z_j and r lies below the rows of Y
//! S   = u'u,      delta = u'w / S,      sigma = 1 / sqrt S                   each direction alone
//! U delta = w,    sigma_j^2 = (U'U)^-1_jj                                     all directions together
//! ```
//!
//! delta is the share by which a link is longer than believed, or the angle by which a zero is off: of each alone, the
//! parameters free to follow, and of each beside the others. Alone is the sharper question where one thing is wrong; a
//! length and a zero that are both off resemble each other enough to cancel in it, and show only beside each other. It is zero within sigma for a leg as believed (score test, Rao 1948). The motion
//! identified from cannot take part: while it streams by the parameters are not known, and z with them.
//!
//! A push of the wearer asks for nothing, but z'r would take it for geometry: rows within [`HELD`] rows of one that misses by
//! more than is expected are left out. A wrong length or zero misses by a few per cent of the torque, never by so much.
//!
//! What torque cannot tell: the zero of the last joint turns that link's own frame and is absorbed exactly by its first
//! moments, and the lengths before the first joint move nothing: neither is looked at.
//! Derivatives are rigid-body ones, which lie in the filter's passband, so z is taken at the row's centre unfiltered.
//! Cost: one torque evaluation for each of 2 (N - 1) directions and one row rotated into B + 4 columns for each joint, 50
//! times a second. Memory: 561 numbers, N (B + 6) for each of [`HELD`] rows and a queue of row centres.

use super::packed::{self, LARGEST_COLUMNS, LARGEST_SIZE};
use super::record::{LARGEST_STILL_SHARE, RowModel};
use super::rows::{DECIMATION, FilteredRows};
use super::smoothing::Smoothed;
use crate::model::{Chain, JointState, LegParameters, PARAMETERS_PER_JOINT, rigid_body_torques};
use crate::real::{self, Real};

/// Directions looked at: the length before each joint but the first, then the zero of each joint but the last; room for
/// three joints.
pub const DIRECTIONS: usize = 4;
/// Rows held back, and left out beside one that misses by more than is expected: 0.3 s, the longer half of a push with the
/// filter's reach.
pub const HELD: usize = 15;
/// A direction of which the parameters absorb all but this share of its power says nothing: single precision leaves 6e-7
/// of one that is absorbed wholly; of the first joint's zero, most of which is gravity's, 6e-5 remain.
const SEEN_SHARE: f64 = 1e-5;
/// Step of the difference quotients: of the length, and rad.
const STEP: f64 = 1e-2;

/// What a direction is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Length of the link before a joint; delta is the share by which it is longer than believed.
    Length,
    /// A joint's zero; delta is the angle by which it is further than believed, rad.
    Zero,
}

/// What held-out motions say of one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misalignment<T> {
    /// Length or zero.
    pub direction: Direction,
    /// Of this joint.
    pub joint: usize,
    /// See [`Direction`]; of this direction alone.
    pub delta: T,
    /// Its standard deviation.
    pub sigma: T,
    /// The same beside all other directions, and its standard deviation; `None` where they leave nothing of it.
    pub beside: Option<(T, T)>,
}

/// Of every direction that is seen.
pub type Misalignments<T> = [Option<Misalignment<T>>; DIRECTIONS];

/// One row of each joint, held back.
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
    wild: [T; N],
    weight: [T; N],
    /// Columns that are not estimated.
    dropped: [bool; B],
    held: [HeldRow<T, N, B>; HELD],
    /// Rows since the motion began, and of them those that left [`Self::held`].
    rows: usize,
    left: usize,
    /// The last row of each joint that missed by more than is expected.
    last_wild: [Option<usize>; N],
    /// Directions at the centres of rows that are not finished yet.
    queue: [[[T; N]; DIRECTIONS]; PENDING],
    next: usize,
    waiting: usize,
    /// Smoothed instants since the motion began.
    instants: usize,
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> Alignment<T, N, B, PENDING> {
    /// Nothing seen.
    #[must_use]
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
            wild: [T::LARGEST; N],
            weight: [zero; N],
            dropped: [false; B],
            held: [row; HELD],
            rows: 0,
            left: 0,
            last_wild: [None; N],
            queue: [[[zero; N]; DIRECTIONS]; PENDING],
            next: 0,
            waiting: 0,
            instants: 0,
        }
    }

    /// Forgets all motions.
    pub fn clear(&mut self) {
        self.break_off();
        self.factor.fill(T::zero());
    }

    /// Another motion begins: a row that misses by more than `wild` N m is disturbed, `noise` is the standard deviation of an
    /// independent row of each joint, N m. Columns that were `dropped` are not free to follow.
    pub fn begin(&mut self, wild: &[T; N], noise: &[T; N], dropped: &[bool; B]) {
        self.break_off();
        (self.wild, self.weight, self.dropped) = (*wild, noise.map(|noise| T::one() / noise), *dropped);
    }

    /// The samples that follow do not continue those before: what was held back is taken.
    pub fn break_off(&mut self) {
        while self.left < self.rows {
            self.release();
        }
        (self.rows, self.left, self.last_wild) = (0, 0, [None; N]);
        (self.next, self.waiting, self.instants) = (0, 0, 0);
    }

    /// Takes a smoothed instant, and the rows that were finished with it. `reach` is that of the low-pass: the row that
    /// an instant finishes is centred so many instants earlier (whole windows only).
    pub fn take(
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
        let used = rows.still.map(|still| !(still > T::of(LARGEST_STILL_SHARE)));
        let mut residual = rows.torque;
        for joint in 0..N {
            let row = rows.regressor[joint].iter().zip(values);
            residual[joint] -= row.fold(T::zero(), |sum, (&y, &p)| sum + y * p);
            if used[joint] && real::abs(residual[joint]) > self.wild[joint] {
                self.last_wild[joint] = Some(self.rows);
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

    /// The oldest row that is held leaves: into the factor, unless it is too near to a disturbance.
    fn release(&mut self) {
        let row = self.left;
        self.left += 1;
        let Some(held) = self.held.get(row % HELD).copied() else { return };
        for joint in (0..N).filter(|&joint| held.used[joint]) {
            if self.last_wild[joint].is_some_and(|wild| wild + HELD >= row) {
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

    /// Base columns and directions; all shipped sizes have room for both.
    const COLUMNS: usize = {
        assert!(B + DIRECTIONS <= LARGEST_COLUMNS, "no room for the directions");
        B + DIRECTIONS
    };

    /// What the motions say, once [`Self::break_off`] has ended the last one. `None` for directions that are not there or that
    /// parameters absorb.
    #[must_use]
    pub fn misalignments(&self) -> Misalignments<T> {
        let (mut power, mut seen, mut along) =
            ([T::zero(); DIRECTIONS], [T::zero(); DIRECTIONS], [T::zero(); DIRECTIONS]);
        for (column, row) in packed::rows(&self.factor, Self::COLUMNS) {
            let right = row.last().copied().unwrap_or(T::zero());
            for direction in 0..DIRECTIONS {
                let element = (B + direction).checked_sub(column).and_then(|place| row.get(place));
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
            if !(power[index] > T::zero() && seen[index] > T::of(SEEN_SHARE) * power[index]) {
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

    /// All directions together: `U delta = w` from below upwards. A direction that those before it leave nothing of stays 0.
    fn beside(&self, power: &[T; DIRECTIONS]) -> [Option<(T, T)>; DIRECTIONS] {
        let mut triangle = [[T::zero(); DIRECTIONS]; DIRECTIONS];
        // The right-hand side, and the columns of the unit matrix: their solution is U^-1.
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
            seen[direction] = pivot * pivot > T::of(SEEN_SHARE) * power[direction];
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

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> Default for Alignment<T, N, B, PENDING> {
    fn default() -> Self {
        Self::new()
    }
}

/// What a direction is about: the lengths before joints 1.., then the zeros of joints ..N-1.
fn subject<const N: usize>(index: usize) -> Option<(Direction, usize)> {
    let others = N.checked_sub(1)?;
    match index.checked_sub(others) {
        None => Some((Direction::Length, index + 1)),
        Some(joint) if joint < others => Some((Direction::Zero, joint)),
        Some(_) => None,
    }
}

/// Change of the torques with each direction at one instant; zero where there is no such direction.
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
    let slope = |there: [T; N]| core::array::from_fn(|joint| (there[joint] - here[joint]) / T::of(STEP));
    for (index, slot) in slots.iter_mut().enumerate() {
        *slot = match subject::<N>(index) {
            Some((Direction::Zero, joint)) => {
                let mut turned = state;
                turned.q[joint] += T::of(STEP);
                slope(torques(&model.chain, &turned))
            }
            Some((Direction::Length, joint)) if model.chain.has_length(joint) => {
                slope(torques(&model.chain.with_length(joint, T::of(1.0 + STEP)), &state))
            }
            _ => [T::zero(); N],
        };
    }
}
