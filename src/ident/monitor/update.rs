//! Cause of a change, found from gait alone with the rest of the model unchanged.
//!
//! Why not a new identification: it needs an exciting motion, which a wearer cannot repeat whenever a bag is
//! hung on the shank. Walking determines a few parameters if all others are held at the accepted model's
//! values.
//!
//! ```text
//! beta = beta_0 + sum_k theta_k d_k          d_k: base values of one unit of parameter k alone
//! payload:   parameters M, HX, HY, HZ, ZZ, XX, YY, XY, XZ, YZ of one link, as far as separable
//! friction:  FC and FV of every joint
//! ```
//!
//! Payload and friction are fitted to the rows collected after the alarm ([`hypothesis`]), the payload of
//! each link by itself. A hypothesis explains the change when
//!
//! ```text
//! chi2 <= f + 5 sqrt(2 f)         f = rank - k degrees of freedom, as in the verdict                    (W6)
//! E_i  <= rho ln rho / (rho - 1)  energy of every joint's residual: no alarm at this value              (W7)
//! ```
//!
//! and it is physically possible: no negative parameter that cannot be negative, and for the payload
//! `M ZZ >= HX^2 + HY^2` within three standard deviations. That holds for every body added and, with both
//! signs reversed, for every body removed. Of several valid hypotheses the one with the smallest `chi2 + 2 k`
//! (Akaike 1974) is chosen.
//!
//! Nothing changed if the old model passes both tests and no hypothesis improves on it by more than
//! `k + 5 sqrt(2 k)`. The alarm was then false, or its cause has passed. Without any explanation a full
//! identification is needed.
//!
//! Cost: some `2 B^3 + 20 B^2` multiplications, once after an alarm. Memory: N + 1 hypotheses and an
//! estimate.
//! Limits: payloads on two links, or one together with other friction, are not among the hypotheses and are
//! refused. For a payload on the first link torque determines the moment but not the mass. A payload
//! parameter that the motion did not excite (its inertia, in slow gait) has a large sigma.

pub(crate) mod hypothesis;

use super::baseline::Baseline;
use crate::ident::judge::verdict::{Evidence, Reason, Thresholds, Verdict, VerdictBuilder};
use crate::ident::record::factor::Factor;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::estimate::Estimate;
use crate::model::Parameter;
use crate::real::{self, Real};
use hypothesis::{Comparison, DIRECTIONS, Explanation, Hypothesis};

/// Parameters of the payload, most important first: where the motion cannot separate all, the later ones are
/// dropped.
pub const PAYLOAD_PARAMETERS: [Parameter; DIRECTIONS] = [
    Parameter::M,
    Parameter::HX,
    Parameter::HY,
    Parameter::HZ,
    Parameter::ZZ,
    Parameter::XX,
    Parameter::YY,
    Parameter::XY,
    Parameter::XZ,
    Parameter::YZ,
];

/// Cause of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Mass was added to a link or removed.
    Payload {
        /// Link, counted from 0.
        link: usize,
    },
    /// Friction of the joints changed.
    Friction,
    /// No change: the old model explains the rows. The alarm was false, or its cause has passed.
    Nothing,
    /// Cause unknown: a full identification is needed.
    Unexplained,
}

/// An updated model, or the refusal of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Update<T, const N: usize, const B: usize> {
    /// Most probable cause.
    pub cause: Cause,
    /// Accepted where a cause explains the rows.
    pub verdict: Verdict,
    /// Chi-square and degrees of freedom of the old model.
    pub unchanged: (T, T),
    /// Parameter changes of each link, in the order of [`PAYLOAD_PARAMETERS`].
    pub payload: [Hypothesis<T>; N],
    /// Friction changes: FC1, FV1, FC2, FV2, ...
    pub friction: Hypothesis<T>,
    /// Energy of each joint's residual over that at acceptance, with the old model.
    pub energy_before: [T; N],
    /// Energy of each joint's residual over that at acceptance, with the values of `estimate`.
    pub energy_after: [T; N],
    /// Base values after the change; the accepted ones without a change or an explanation.
    pub(crate) estimate: Estimate<T, B>,
}

impl<T: Real, const N: usize, const B: usize> Update<T, N, B> {
    /// Analyses the rows collected after the alarm; `silent_energy` is the right-hand side of (W7).
    pub fn new(
        model: &RowModel<T, N, B>,
        baseline: &Baseline<T, N, B>,
        record: &Record<T, N, B>,
        thresholds: &Thresholds<T>,
        silent_energy: T,
    ) -> Self {
        let mut rows = Factor::new();
        for (joint, factor) in record.factors.iter().enumerate() {
            rows.merge_scaled(factor, T::one() / baseline.noise(joint));
        }
        let comparison = Comparison::new(&rows, &baseline.estimate, model.base.rank());
        let mut update = Self {
            cause: Cause::Unexplained,
            verdict: Verdict::refused(Reason::Residual),
            unchanged: comparison.unchanged(),
            payload: [Hypothesis::nothing(); N],
            friction: Hypothesis::nothing(),
            energy_before: energy(baseline, record, &baseline.estimate.values),
            energy_after: energy(baseline, record, &baseline.estimate.values),
            estimate: baseline.estimate.clone(),
        };
        let mut best = None;
        let (mut gain, mut freed) = (T::zero(), T::zero());
        for candidate in 0..=N {
            let explanation = if candidate < N {
                comparison.explain(model, &PAYLOAD_PARAMETERS.map(|parameter| (candidate, parameter)))
            } else {
                comparison.explain(model, &friction_parameters::<N>())
            };
            let hypothesis = explanation.hypothesis;
            let cause = if let Some(slot) = update.payload.get_mut(candidate) {
                *slot = hypothesis;
                Cause::Payload { link: candidate }
            } else {
                update.friction = hypothesis;
                Cause::Friction
            };
            let energy = energy(baseline, record, &explanation.estimate.values);
            let ignore = &mut |_: &Evidence<T>| {};
            let mut builder = VerdictBuilder::new(ignore);
            thresholds.judge_physics(model, record, &explanation.estimate, &mut builder);
            let possible = (cause == Cause::Friction || payload_can_exist(&explanation, thresholds))
                && builder.verdict().is_accepted();
            let explained =
                hypothesis.explains(thresholds) && energy.iter().all(|&energy| energy <= silent_energy);
            if possible && explained && best.is_none_or(|least| hypothesis.score() < least) {
                best = Some(hypothesis.score());
                gain = update.unchanged.0 - hypothesis.chi_square;
                freed = update.unchanged.1 - hypothesis.freedom;
                (update.cause, update.verdict) = (cause, Verdict::ACCEPTED);
                (update.energy_after, update.estimate) = (energy, explanation.estimate);
            }
        }
        let (chi_square, freedom) = update.unchanged;
        let unchanged = chi_square <= thresholds.chance(freedom)
            && update.energy_before.iter().all(|&energy| energy <= silent_energy);
        if unchanged && gain <= thresholds.chance(freed) {
            (update.cause, update.verdict) = (Cause::Nothing, Verdict::ACCEPTED);
            (update.energy_after, update.estimate) = (update.energy_before, baseline.estimate.clone());
        }
        update
    }

    /// True if the updated model replaces the old one.
    pub fn is_change(&self) -> bool {
        self.verdict.is_accepted() && self.cause != Cause::Nothing
    }

    /// Updated model with its uncertainty, if a change explains the rows; the noise is the old model's.
    pub(crate) fn baseline(&self, before: &Baseline<T, N, B>) -> Option<Baseline<T, N, B>> {
        self.is_change().then(|| Baseline { estimate: self.estimate.clone(), ..before.clone() })
    }
}

/// FC and FV of the joints, up to the array's length. Spare entries repeat the
/// first and drop out as dependent.
fn friction_parameters<const N: usize>() -> [(usize, Parameter); DIRECTIONS] {
    core::array::from_fn(|index| {
        let parameter = if index % 2 == 0 { Parameter::FC } else { Parameter::FV };
        if index / 2 < N { (index / 2, parameter) } else { (0, Parameter::FC) }
    })
}

/// Mean square of each joint's residual over the variance of a row.
fn energy<T: Real, const N: usize, const B: usize>(
    baseline: &Baseline<T, N, B>,
    record: &Record<T, N, B>,
    values: &[T; B],
) -> [T; N] {
    core::array::from_fn(|joint| {
        let error = record.torque_error(joint, values).unwrap_or(T::zero());
        error * error / baseline.row_variance[joint]
    })
}

/// True unless `M ZZ - HX^2 - HY^2` is negative beyond the allowed standard
/// deviations, with all four determined.
fn payload_can_exist<T: Real, const B: usize>(
    explanation: &Explanation<T, B>,
    thresholds: &Thresholds<T>,
) -> bool {
    let payload = &explanation.hypothesis;
    let find = |wanted: Parameter| PAYLOAD_PARAMETERS.iter().position(|&parameter| parameter == wanted);
    let (Some(m), Some(x), Some(y), Some(zz)) =
        (find(Parameter::M), find(Parameter::HX), find(Parameter::HY), find(Parameter::ZZ))
    else {
        return true;
    };
    if ![m, x, y, zz].iter().all(|&index| payload.determined[index]) {
        return true;
    }
    let value = |index: usize| payload.values[index];
    let surplus = value(m) * value(zz) - value(x) * value(x) - value(y) * value(y);
    let mut gradient = [T::zero(); DIRECTIONS];
    (gradient[m], gradient[zz]) = (value(zz), value(m));
    (gradient[x], gradient[y]) = (-T::from_double(2.0) * value(x), -T::from_double(2.0) * value(y));
    // Near zero mass the gradient vanishes too; the curvature of the product then dominates.
    let curvature = payload.sigma(m).unwrap_or(T::zero()) * payload.sigma(zz).unwrap_or(T::zero());
    let spread = real::sqrt(explanation.variance_of(&gradient) + curvature * curvature);
    surplus >= -thresholds.largest_negative_sigmas * spread
}

#[cfg(test)]
mod tests;
