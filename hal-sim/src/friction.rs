//! Joint friction: Coulomb with true sticking, viscous, Stribeck, and a constant offset.
//!
//! Why not a steep tanh: identification depends on rows near zero speed, so the plant must be realistic
//! there. A joint stays exactly at its position while less than the breakaway torque acts on it.
//!
//! ```text
//! torque(v)  = level(v) sign(v) + viscous v + offset                         v != 0
//! level(v)   = coulomb + (static - coulomb) exp(-(v / speed)^2)              Stribeck; else coulomb
//! at rest    |applied| <= static: v stays 0 and friction balances the applied torque
//! ```
//!
//! Joints are coupled: one that breaks away may drag another along or set it free. Over one time step the end
//! rates u obey A u = b - f with friction impulses f. Each joint slides (f = level sign(u)) or sticks (u = 0
//! and the magnitude of f at most static). For N <= 3 the 3^N assignments are few, so the consistent one is
//! found exactly. The search begins with the one that continues the present motion. A is the inertia matrix
//! with small additions of the order of the step, so exactly one assignment is consistent where static =
//! coulomb. With Stribeck's surplus both sticking and sliding may be consistent; then the present motion
//! continues.
//!
//! Source: Moreau's time stepping in its box-constrained form (Stewart and Trinkle, 1996); Stribeck's curve
//! in the Gaussian form of Armstrong-Helouvry et al. (1994).
//! Cost for two joints: about 30 operations while nothing changes, at most ten times that.

use crate::description::FrictionDescription;
use crate::maths::exp;

impl FrictionDescription {
    /// Level of the dry friction at a rate (rad/s), N m; the breakaway level at 0.
    #[inline(always)]
    pub(crate) fn dry_level(&self, rate: f64) -> f64 {
        match self.stribeck {
            None => self.coulomb,
            Some(stribeck) => {
                let relative = rate / stribeck.speed;
                self.coulomb + (stribeck.static_level - self.coulomb) * exp(-relative * relative)
            }
        }
    }

    /// Friction and offset of a moving joint, N m. At rest the dry part is undetermined and omitted.
    pub fn torque(&self, rate: f64) -> f64 {
        let dry = if rate == 0.0 { 0.0 } else { self.dry_level(rate) * rate.signum() };
        dry + self.viscous * rate + self.offset
    }
}

/// Friction state of one joint over a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Contact {
    Sticks,
    Forward,
    Backward,
}

impl Contact {
    /// Friction state of a joint at this rate.
    #[inline(always)]
    pub(crate) fn from_rate(rate: f64) -> Self {
        if rate > 0.0 {
            Self::Forward
        } else if rate < 0.0 {
            Self::Backward
        } else {
            Self::Sticks
        }
    }

    #[inline(always)]
    fn sign(self) -> f64 {
        match self {
            Self::Sticks => 0.0,
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }
}

/// Problem A u = b - f: find the rates u that friction within its bounds allows.
pub(crate) struct Slide<const N: usize> {
    /// A: near the inertia matrix, kg m^2.
    pub(crate) matrix: [[f64; N]; N],
    /// b: momentum the joints would have without dry friction, N m s.
    pub(crate) momentum: [f64; N],
    /// Impulse of the dry friction of a sliding joint, N m s.
    pub(crate) sliding: [f64; N],
    /// Largest impulse that dry friction can hold at a resting joint, N m s.
    pub(crate) breakaway: [f64; N],
    /// Joints whose dry friction is known in advance, because they are already moving.
    pub(crate) committed: [bool; N],
}

impl<const N: usize> Slide<N> {
    /// Solves for the rates; those of sticking joints are exactly 0. Tries `present` first; the state of
    /// committed joints is fixed.
    #[inline(always)]
    pub(crate) fn solve(&self, present: &[Contact; N]) -> [f64; N] {
        let (rates, violation) = self.attempt(present);
        if violation <= 0.0 { rates } else { self.search(present) }
    }

    /// Tries every other assignment, sticking ones first. Where rounding leaves none consistent,
    /// returns the nearest.
    #[cold]
    fn search(&self, present: &[Contact; N]) -> [f64; N] {
        const CHOICES: [Contact; 3] = [Contact::Sticks, Contact::Forward, Contact::Backward];
        let mut best = ([0.0; N], f64::INFINITY);
        for number in 0..3_usize.pow(N as u32) {
            let mut digits = number;
            let assignment = core::array::from_fn(|joint| {
                let choice = CHOICES[digits % 3];
                digits /= 3;
                if self.committed[joint] { present[joint] } else { choice }
            });
            let trial = self.attempt(&assignment);
            if trial.1 < best.1 {
                best = trial;
            }
            if best.1 <= 0.0 {
                break;
            }
        }
        best.0
    }

    /// Rates under an assignment, and the violation of its conditions (N m s); 0 where consistent.
    #[inline(always)]
    fn attempt(&self, contacts: &[Contact; N]) -> ([f64; N], f64) {
        let mut matrix = self.matrix;
        let mut right: [f64; N] =
            core::array::from_fn(|joint| self.momentum[joint] - self.sliding[joint] * contacts[joint].sign());
        for joint in 0..N {
            if contacts[joint] == Contact::Sticks {
                matrix[joint] = [0.0; N];
                matrix[joint][joint] = 1.0;
                right[joint] = 0.0;
            }
        }
        let mut rates = eliminate(matrix, right);
        let mut violation = 0.0_f64;
        for joint in 0..N {
            let excess = match contacts[joint] {
                Contact::Sticks => {
                    rates[joint] = 0.0;
                    let carried: f64 = (0..N).map(|other| self.matrix[joint][other] * rates[other]).sum();
                    (self.momentum[joint] - carried).abs() - self.breakaway[joint]
                }
                _ if self.committed[joint] => 0.0,
                sliding => {
                    let along = rates[joint] * sliding.sign();
                    if along > 0.0 { 0.0 } else { f64::MIN_POSITIVE - along * self.matrix[joint][joint] }
                }
            };
            violation = violation.max(excess);
        }
        (rates, violation)
    }
}

/// Gauss elimination without exchange of rows: a positive definite part dominates the matrices here.
#[inline(always)]
fn eliminate<const N: usize>(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> [f64; N] {
    for pivot in 0..N {
        let inverse = 1.0 / matrix[pivot][pivot];
        for row in pivot + 1..N {
            let factor = matrix[row][pivot] * inverse;
            for column in pivot..N {
                matrix[row][column] -= factor * matrix[pivot][column];
            }
            right[row] -= factor * right[pivot];
        }
        matrix[pivot][pivot] = inverse;
    }
    for row in (0..N).rev() {
        let known: f64 = (row + 1..N).map(|column| matrix[row][column] * right[column]).sum();
        right[row] = (right[row] - known) * matrix[row][row];
    }
    right
}
