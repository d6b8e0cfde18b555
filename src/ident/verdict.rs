//! Accepted or refused, and why: the last word before a model may move anybody.
//!
//! | reason | refused when |
//! | --- | --- |
//! | `input` | too few rows, samples that are not finite, a joint whose torque never differs from zero |
//! | `unexcited` | a joint hardly moved, base parameters are not determined, or the problem is ill-conditioned |
//! | `unphysical` | negative friction, rotor inertia or kinetic energy, by more than three standard deviations; or the data contradict every leg that the prior allows |
//! | `residual` | the motion identified from is not explained itself |
//! | `validation` | torque on a motion that was not used is predicted worse than the training's noise explains |
//!
//! `not_a_measurement`, `outliers` and `contact` complete the closed list; nothing raises them yet.
//! Every threshold is a field of [`Thresholds`] with the reason for its default.

use nalgebra::{SMatrix, Vector3};

use super::completion::is_weak;
use super::estimate::{Estimate, Stage};
use super::record::{Record, RowModel};
use crate::model::{JointState, PARAMETERS_PER_JOINT, Parameter, mass_matrix, regressor};
use crate::real::{self, Real};

/// Why a result is refused; a closed list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// No body can have these parameters.
    Unphysical,
    /// The motion did not show what was asked for.
    Unexcited,
    /// What the model leaves unexplained is not noise.
    Residual,
    /// Another motion is predicted badly.
    Validation,
    /// The torque was computed, not measured.
    NotAMeasurement,
    /// Too many outliers.
    Outliers,
    /// The leg touched something.
    Contact,
    /// The data cannot be used.
    Input,
}

impl Reason {
    /// All reasons, in the order of their bits.
    pub const ALL: [Self; 8] = [
        Self::Unphysical,
        Self::Unexcited,
        Self::Residual,
        Self::Validation,
        Self::NotAMeasurement,
        Self::Outliers,
        Self::Contact,
        Self::Input,
    ];

    /// The word used in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unphysical => "unphysical",
            Self::Unexcited => "unexcited",
            Self::Residual => "residual",
            Self::Validation => "validation",
            Self::NotAMeasurement => "not_a_measurement",
            Self::Outliers => "outliers",
            Self::Contact => "contact",
            Self::Input => "input",
        }
    }
}

/// The reasons against a result; none means accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict(u8);

impl Verdict {
    /// Nothing speaks against it.
    pub const ACCEPTED: Self = Self(0);

    /// Refused for one reason.
    #[must_use]
    pub const fn refused(reason: Reason) -> Self {
        Self(1 << reason as u8)
    }

    /// The reasons of both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// No reason against it.
    #[must_use]
    pub const fn is_accepted(self) -> bool {
        self.0 == 0
    }

    /// Whether this is one of the reasons.
    #[must_use]
    pub const fn has(self, reason: Reason) -> bool {
        self.0 & (1 << reason as u8) != 0
    }

    /// The reasons, in the order of [`Reason::ALL`].
    pub fn reasons(self) -> impl Iterator<Item = Reason> {
        Reason::ALL.into_iter().filter(move |reason| self.has(*reason))
    }

    fn note(&mut self, reason: Reason, applies: bool) {
        if applies {
            self.0 |= 1 << reason as u8;
        }
    }
}

/// What a result must keep to be accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds<T> {
    /// Rows for each base parameter, at least: with five rows each, overlapping as they do, the residual still has
    /// a degree of freedom or more for each parameter.
    pub rows_per_parameter: u32,
    /// Root mean square speed of every joint, rad/s: below, the sign of the speed is the encoder's noise and
    /// Coulomb friction cannot be told from an offset.
    pub smallest_speed: T,
    /// Condition number of the scaled problem: above, an error of 0.1 % in the rows moves the result by its size.
    pub largest_condition: T,
    /// Standard deviations by which a quantity that cannot be negative may be so.
    pub largest_negative_sigmas: T,
    /// Spreads of chi-square by which the result in the prior's box may be worse than least squares: five are not noise.
    pub largest_excess_spreads: T,
    /// Error on an unused motion over that on the training motion: noise alone gives one; twice leaves room for
    /// friction that depends on speed and load.
    pub largest_error_ratio: T,
    /// Error that is never held against a model, as a share of the motion's root mean square torque.
    pub harmless_error_share: T,
    /// Error that is never accepted, as a share of the motion's root mean square torque: such a model explains less
    /// than half of the power of the torque.
    pub largest_error_share: T,
}

impl<T: Real> Default for Thresholds<T> {
    fn default() -> Self {
        Self {
            rows_per_parameter: 5,
            smallest_speed: T::of(0.05),
            largest_condition: T::of(1000.0),
            largest_negative_sigmas: T::of(3.0),
            largest_excess_spreads: T::of(5.0),
            largest_error_ratio: T::of(2.0),
            harmless_error_share: T::of(0.05),
            largest_error_share: T::of(0.7),
        }
    }
}

impl<T: Real> Thresholds<T> {
    /// Whether a motion can be identified from at all.
    #[must_use]
    pub fn judge_input<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
    ) -> Verdict {
        let mut verdict = Verdict::ACCEPTED;
        let needed = (model.base.rank() as u32).saturating_mul(self.rows_per_parameter);
        let silent = record.torque.iter().any(|size| !(size.root_mean_square > T::zero()));
        verdict.note(
            Reason::Input,
            record.rows.iter().any(|&rows| rows < needed) || record.rejected > 0 || silent,
        );
        let still = record.torque.iter().any(|size| !(size.speed >= self.smallest_speed));
        verdict.note(Reason::Unexcited, still && record.rows.iter().any(|&rows| rows > 0));
        verdict
    }

    /// Whether a motion told all base parameters apart, in all rows together (`stage`) and in the plan that was followed,
    /// which found `determined` of them.
    #[must_use]
    pub fn judge_excitation<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        stage: &Stage<T, B>,
        determined: usize,
    ) -> Verdict {
        let mut verdict = Verdict::ACCEPTED;
        let singular = stage.columns().len() < model.base.rank() || determined < model.base.rank();
        let ill = stage.condition().is_none_or(|condition| !(condition <= self.largest_condition));
        verdict.note(Reason::Unexcited, singular || ill);
        verdict
    }

    /// Whether a body with these parameters can exist, as far as the base parameters tell.
    #[must_use]
    pub fn judge_physics<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
        estimate: &Estimate<T, B>,
    ) -> Verdict {
        let mut verdict = Verdict::ACCEPTED;
        for base in 0..model.base.rank() {
            let never_negative =
                model.base.independent(base).is_some_and(|(_, parameter)| parameter.is_never_negative());
            let sigma = estimate.sigma(base).unwrap_or(T::zero());
            let negative = estimate.values[base] < -self.largest_negative_sigmas * sigma;
            verdict.note(Reason::Unphysical, never_negative && negative && !is_weak(record, estimate, base));
            verdict.note(Reason::Unphysical, !real::is_finite(estimate.values[base]));
        }
        verdict.note(Reason::Unphysical, !self.kinetic_energy_is_positive(model, estimate));
        verdict
    }

    /// Kinetic energy `v' M(q) v / 2`, at postures all over the circle, is in no direction `v` negative by more than
    /// the allowed number of standard deviations.
    fn kinetic_energy_is_positive<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        estimate: &Estimate<T, B>,
    ) -> bool {
        let parameters = model.base.complete(&estimate.values, &[[T::zero(); PARAMETERS_PER_JOINT]; N]);
        (0..POSTURES).all(|index| {
            let q = posture(index);
            let mass = mass_matrix(&model.chain, &parameters, &q);
            let Some((direction, energy)) = negative_direction(&mass) else { return true };
            let weights = energy_weights(model, q, &direction);
            energy >= -self.largest_negative_sigmas * estimate.sigma_of(&weights)
        })
    }

    /// Whether the motion identified from is explained at all.
    #[must_use]
    pub fn judge_residual<const N: usize, const B: usize>(
        &self,
        training: &Record<T, N, B>,
        values: &[T; B],
    ) -> Verdict {
        let mut verdict = Verdict::ACCEPTED;
        for (joint, size) in training.torque.iter().enumerate() {
            let error = training.torque_error(joint, values);
            let explained =
                error.is_some_and(|error| error <= self.largest_error_share * size.root_mean_square);
            verdict.note(Reason::Residual, !explained);
        }
        verdict
    }

    /// Whether what was found in the box explains the data as well as least squares does, up to what noise makes of
    /// `rank` parameters: if not, the data contradict every leg that the prior allows.
    #[must_use]
    pub fn judge_box(&self, excess: T, rank: usize) -> Verdict {
        let rank = T::of(rank as f64);
        let spread = real::sqrt(rank + rank); // of chi-square with `rank` degrees of freedom
        let mut verdict = Verdict::ACCEPTED;
        verdict.note(Reason::Unphysical, !(excess <= rank + self.largest_excess_spreads * spread));
        verdict
    }

    /// Whether unused motions are predicted as well as the training motion lets expect.
    #[must_use]
    pub fn judge_validation<'a, const N: usize, const B: usize>(
        &self,
        training: &Record<T, N, B>,
        motions: impl Iterator<Item = &'a Record<T, N, B>>,
        values: &[T; B],
    ) -> Verdict {
        let mut verdict = Verdict::ACCEPTED;
        for motion in motions {
            for joint in 0..N {
                let (Some(expected), Some(error)) =
                    (training.torque_error(joint, values), motion.torque_error(joint, values))
                else {
                    verdict.note(Reason::Validation, true);
                    continue;
                };
                let size = motion.torque[joint].root_mean_square;
                let allowed = self.largest_error_ratio * expected + self.harmless_error_share * size;
                verdict.note(
                    Reason::Validation,
                    !(error <= real::min(allowed, self.largest_error_share * size)),
                );
            }
        }
        verdict
    }
}

const POSTURES: usize = 16;

/// A direction `v` in which `v' M v` is negative, and that number; `None` for a positive matrix.
///
/// With `M = L D L'` and a negative pivot `D_k`, `v = L^-T e_k` gives `v' M v = D_k`.
fn negative_direction<T: Real, const N: usize>(matrix: &SMatrix<T, N, N>) -> Option<([T; N], T)> {
    let mut lower = [[T::zero(); N]; N];
    let mut pivots = [T::zero(); N];
    for column in 0..N {
        let mut pivot = matrix[(column, column)];
        for inner in 0..column {
            pivot -= lower[column][inner] * lower[column][inner] * pivots[inner];
        }
        if !(pivot > T::zero()) {
            let mut direction = [T::zero(); N];
            direction[column] = T::one();
            for row in (0..column).rev() {
                for inner in row + 1..=column {
                    direction[row] -= lower[inner][row] * direction[inner];
                }
            }
            return Some((direction, pivot));
        }
        pivots[column] = pivot;
        for row in column + 1..N {
            let mut element = matrix[(row, column)];
            for inner in 0..column {
                element -= lower[row][inner] * lower[column][inner] * pivots[inner];
            }
            lower[row][column] = element / pivot;
        }
    }
    None
}

/// Low-discrepancy postures over the whole circle of every joint.
fn posture<T: Real, const N: usize>(index: usize) -> [T; N] {
    core::array::from_fn(|joint| {
        // Multiples of the golden ratio's powers (Kronecker sequence).
        let step = [0.618_033_988_749_895, 0.381_966_011_250_105, 0.236_067_977_499_790][joint % 3];
        let turn = (index + 1) as f64 * step;
        T::of((turn - (turn as u32) as f64 - 0.5) * 2.0 * core::f64::consts::PI)
    })
}

/// Twice the kinetic energy of unit base parameters at speed `direction`: its weights.
fn energy_weights<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    q: [T; N],
    direction: &[T; N],
) -> [T; B] {
    let moving = JointState { q, qd: [T::zero(); N], qdd: *direction };
    let rows = regressor(&model.chain, &moving, &Vector3::zeros());
    let mut weights = [T::zero(); B];
    for (row, &share) in rows.iter().zip(direction) {
        let mut selected = [T::zero(); B];
        model.base.select(row, &mut selected);
        for (base, (weight, &element)) in weights.iter_mut().zip(&selected).enumerate() {
            let at_rest = !matches!(model.base.independent(base), Some((_, Parameter::OFF)));
            if at_rest {
                *weight += share * element;
            }
        }
    }
    weights
}
