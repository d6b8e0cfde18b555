//! Whether held-out torque asks for other link lengths or encoder zeros than the model has.
//!
//! Why: a leg whose link is believed ten per cent too long is predicted within two per cent of its torque, since masses
//! and moments make up for most of it. What they cannot make up for is small but points in a known direction:
//!
//! ```text
//! z_j = d tau / d ln a_j,   d tau / d q0_j                   at the model's parameters, by a difference quotient
//! r   = Y nu + z delta + noise                               rows of the held-out motions
//! L'L = sum R'R / s^2 of these motions,   u = L^-T Y'z,   w = L^-T Y'r
//! S   = z'z - u'u,      delta = (z'r - u'w) / S,      sigma = 1 / sqrt S
//! ```
//!
//! delta is the share by which a link is longer than believed, or the angle by which a zero is off: of each alone, the
//! parameters free to follow. It is zero within sigma for a leg as believed (score test, Rao 1948). The motion
//! identified from cannot take part: while it streams by the parameters are not known, and z with them.
//!
//! What torque cannot tell: the zero of the last joint turns that link's own frame and is absorbed exactly by its first
//! moments, and the lengths before the first joint move nothing; there S vanishes beside z'z and nothing is said.
//! Derivatives are rigid-body ones, which lie in the filter's passband, so z is taken at the row's centre unfiltered.
//! Cost: one torque evaluation for each of up to 2 N directions, 50 times a second. Memory: N (2 N (B + 2 N + 1) + B)
//! numbers and a queue of row centres.

use super::factor::Factor;
use super::record::{LARGEST_STILL_SHARE, RowModel};
use super::rows::{DECIMATION, FilteredRows};
use super::smoothing::Smoothed;
use crate::model::{Chain, JointState, LegParameters, PARAMETERS_PER_JOINT, rigid_body_torques};
use crate::real::{self, Real};

/// Directions looked at: the length before each joint, then each joint's zero; room for three joints.
pub const DIRECTIONS: usize = 6;
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
    /// See [`Direction`].
    pub delta: T,
    /// Its standard deviation.
    pub sigma: T,
}

/// Of every direction that is seen.
pub type Misalignments<T> = [Option<Misalignment<T>>; DIRECTIONS];

/// Sums over the rows of one joint.
#[derive(Clone, Debug, PartialEq)]
struct Sums<T, const B: usize> {
    /// z'z of each direction alone.
    power: [T; DIRECTIONS],
    /// z'r.
    with_residual: [T; DIRECTIONS],
    /// Y'z.
    with_columns: [[T; B]; DIRECTIONS],
    /// Y'r.
    residual: [T; B],
}

/// The directions' sums over all held-out motions of one identification.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment<T, const N: usize, const B: usize, const PENDING: usize> {
    sums: [Sums<T, B>; N],
    /// Directions at the centres of rows that are not finished yet.
    queue: [[[T; N]; DIRECTIONS]; PENDING],
    next: usize,
    waiting: usize,
    /// Smoothed instants since the motion began.
    instants: usize,
    rows: u32,
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> Alignment<T, N, B, PENDING> {
    /// Nothing seen.
    #[must_use]
    pub fn new() -> Self {
        let zero = T::zero();
        Self {
            sums: core::array::from_fn(|_| Sums {
                power: [zero; DIRECTIONS],
                with_residual: [zero; DIRECTIONS],
                with_columns: [[zero; B]; DIRECTIONS],
                residual: [zero; B],
            }),
            queue: [[[zero; N]; DIRECTIONS]; PENDING],
            next: 0,
            waiting: 0,
            instants: 0,
            rows: 0,
        }
    }

    /// Forgets all motions.
    pub fn clear(&mut self) {
        for sums in &mut self.sums {
            sums.power = [T::zero(); DIRECTIONS];
            sums.with_residual = [T::zero(); DIRECTIONS];
            sums.with_columns = [[T::zero(); B]; DIRECTIONS];
            sums.residual = [T::zero(); B];
        }
        self.rows = 0;
        self.break_off();
    }

    /// Another motion begins, or the samples that follow do not continue those before.
    pub fn break_off(&mut self) {
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
                self.add(values, rows, &centre);
            }
        }
    }

    fn add(&mut self, values: &[T; B], rows: &FilteredRows<T, N, B>, centre: &[[T; N]; DIRECTIONS]) {
        self.rows = self.rows.saturating_add(1);
        for (joint, sums) in self.sums.iter_mut().enumerate() {
            if rows.still[joint] > T::of(LARGEST_STILL_SHARE) {
                continue;
            }
            let row = &rows.regressor[joint];
            let fitted = row.iter().zip(values).fold(T::zero(), |sum, (&y, &p)| sum + y * p);
            let residual = rows.torque[joint] - fitted;
            for (sum, &element) in sums.residual.iter_mut().zip(row) {
                *sum += element * residual;
            }
            for (direction, z) in centre.iter().enumerate() {
                let z = z[joint];
                sums.power[direction] += z * z;
                sums.with_residual[direction] += z * residual;
                for (sum, &element) in sums.with_columns[direction].iter_mut().zip(row) {
                    *sum += element * z;
                }
            }
        }
    }

    /// What the motions say, given their rows' information on the parameters, weighted, and each joint's standard
    /// deviation of an independent row. `None` for directions that parameters absorb.
    #[must_use]
    pub fn misalignments(&self, information: &Factor<T, B>, noise: &[T; N]) -> Misalignments<T> {
        let mut total = Sums {
            power: [T::zero(); DIRECTIONS],
            with_residual: [T::zero(); DIRECTIONS],
            with_columns: [[T::zero(); B]; DIRECTIONS],
            residual: [T::zero(); B],
        };
        for (sums, &sigma) in self.sums.iter().zip(noise) {
            let weight = T::one() / (sigma * sigma);
            add_scaled(&mut total.power, &sums.power, weight);
            add_scaled(&mut total.with_residual, &sums.with_residual, weight);
            add_scaled(&mut total.residual, &sums.residual, weight);
            for (to, from) in total.with_columns.iter_mut().zip(&sums.with_columns) {
                add_scaled(to, from, weight);
            }
        }
        let residual = whitened(information, &total.residual);
        core::array::from_fn(|index| {
            let columns = whitened(information, &total.with_columns[index]);
            let power = total.power[index];
            let seen = power - dot(&columns, &columns);
            if !(power > T::zero() && seen > T::of(SEEN_SHARE) * power) {
                return None;
            }
            let (direction, joint) =
                if index < N { (Direction::Length, index) } else { (Direction::Zero, index - N) };
            Some(Misalignment {
                direction,
                joint,
                delta: (total.with_residual[index] - dot(&columns, &residual)) / seen,
                sigma: T::one() / real::sqrt(seen),
            })
        })
    }
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> Default for Alignment<T, N, B, PENDING> {
    fn default() -> Self {
        Self::new()
    }
}

fn add_scaled<T: Real, const K: usize>(sum: &mut [T; K], terms: &[T; K], weight: T) {
    for (sum, &term) in sum.iter_mut().zip(terms) {
        *sum += weight * term;
    }
}

fn dot<T: Real, const K: usize>(one: &[T; K], other: &[T; K]) -> T {
    one.iter().zip(other).fold(T::zero(), |sum, (&left, &right)| sum + left * right)
}

/// `R^-T vector`: forward substitution; zero in a column without information.
fn whitened<T: Real, const B: usize>(factor: &Factor<T, B>, vector: &[T; B]) -> [T; B] {
    let mut solved = [T::zero(); B];
    for column in 0..B {
        let mut rest = vector[column];
        for (row, &value) in factor.triangle().iter().zip(&solved).take(column) {
            rest -= row[column] * value;
        }
        let diagonal = factor.triangle()[column][column];
        solved[column] = if diagonal == T::zero() { T::zero() } else { rest / diagonal };
    }
    solved
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
        *slot = if let Some(joint) = index.checked_sub(N).filter(|&joint| joint < N) {
            let mut turned = state;
            turned.q[joint] += T::of(STEP);
            slope(torques(&model.chain, &turned))
        } else if index < N && model.chain.has_length(index) {
            slope(torques(&model.chain.with_length(index, T::of(1.0 + STEP)), &state))
        } else {
            [T::zero(); N]
        };
    }
}
