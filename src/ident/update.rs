//! After a change: what changed, found from gait alone while the rest of the model is kept.
//!
//! Why not a new identification: nobody lies down for an exciting motion because a bag was hung on the shank. A few
//! parameters can be told from walking if all others are held at the accepted model's values.
//!
//! ```text
//! beta = beta_0 + sum_k theta_k d_k          d_k: base values of one unit of parameter k alone
//! payload:   parameters M, HX, HY, HZ, ZZ, XX, YY, XY, XZ, YZ of one link, as far as the motion tells them apart
//! friction:  FC and FV of every joint
//! ```
//!
//! Each link's payload and friction are fitted to the rows collected after the alarm ([`hypothesis`]). A hypothesis explains the change when
//!
//! ```text
//! chi2 <= f + 5 sqrt(2 f)                    f = rank - k degrees of freedom, as in [`super::verdict`]             (W6)
//! E_i  <= rho ln rho / (rho - 1)             energy of every joint's residual: where the monitor would stay silent (W7)
//! ```
//!
//! and it can exist: nothing negative that cannot be, and for the payload `M ZZ >= HX^2 + HY^2` within three standard
//! deviations, which holds of every body put on, and with both signs turned of every body taken off. Of several that
//! explain it the one with the smaller `chi2 + 2 k` (Akaike 1974) is meant. Where the model as it was explains the rows by the
//! same two tests, and no change explains them better by more than `k + 5 sqrt(2 k)`, nothing changed: the alarm was false, or
//! what caused it has passed. None of them: a full identification is needed.
//!
//! Cost: some `2 B^3 + 20 B^2` multiplications, once after an alarm. Memory: N + 1 hypotheses and an estimate.
//! Limits: payloads on two links, or one together with other friction, are not among the hypotheses and are refused. Of a
//! payload on the first link torque tells the moment but not the mass. What the motion did not show of the payload (its inertia, on slow gait) has a large sigma.

pub mod hypothesis;

use super::baseline::Baseline;
use super::estimate::Estimate;
use super::factor::Factor;
use super::record::{Record, RowModel};
use super::verdict::{Docket, Evidence, Reason, Thresholds, Verdict};
use crate::model::Parameter;
use crate::real::{self, Real};
use hypothesis::{Comparison, DIRECTIONS, Explanation, Hypothesis};

/// Parameters of the payload, those that are worth most first: where the motion cannot tell all apart, the later go.
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

/// What explains a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Mass was put on a link or taken off.
    Payload {
        /// Counted from 0.
        link: usize,
    },
    /// Friction of the joints.
    Friction,
    /// The model as it was explains the rows: the alarm was false, or what caused it has passed.
    Nothing,
    /// None of these: a full identification is needed.
    Unexplained,
}

/// A model brought up to date, or the refusal to.
#[derive(Clone, Debug, PartialEq)]
pub struct Update<T, const N: usize, const B: usize> {
    /// What is meant.
    pub cause: Cause,
    /// Accepted where something explains the rows.
    pub verdict: Verdict,
    /// chi-square and degrees of freedom of the model as it was.
    pub unchanged: (T, T),
    /// Parameter changes of each link, in the order of [`PAYLOAD_PARAMETERS`].
    pub payload: [Hypothesis<T>; N],
    /// Friction changes: FC1, FV1, FC2, FV2, ...
    pub friction: Hypothesis<T>,
    /// Energy of each joint's residual over that at acceptance, before.
    pub energy_before: [T; N],
    /// The same with the values of `estimate`.
    pub energy_after: [T; N],
    /// Base values after the change; the accepted ones where there was none or nothing explains it.
    pub estimate: Estimate<T, B>,
}

impl<T: Real, const N: usize, const B: usize> Update<T, N, B> {
    /// From the rows collected after the alarm; `silent_energy` is the right-hand side of (W7).
    #[must_use]
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
            let mut docket = Docket::new(ignore);
            thresholds.judge_physics(model, record, &explanation.estimate, &mut docket);
            let possible = (cause == Cause::Friction || payload_can_exist(&explanation, thresholds))
                && docket.verdict().is_accepted();
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

    /// Whether another model than before is to be used.
    #[must_use]
    pub fn is_change(&self) -> bool {
        self.verdict.is_accepted() && self.cause != Cause::Nothing
    }

    /// The model with its uncertainty, if a change explains the rows; its noise is the old one's.
    #[must_use]
    pub fn baseline(&self, before: &Baseline<T, N, B>) -> Option<Baseline<T, N, B>> {
        self.is_change().then(|| Baseline { estimate: self.estimate.clone(), ..before.clone() })
    }
}

/// FC and FV of the joints, as many as there is room for; the rest repeats the first and is dropped as not told apart.
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

/// `M ZZ - HX^2 - HY^2` not negative by more than the allowed standard deviations, where all four are told.
fn payload_can_exist<T: Real, const B: usize>(
    explanation: &Explanation<T, B>,
    thresholds: &Thresholds<T>,
) -> bool {
    let payload = &explanation.hypothesis;
    let place = |wanted: Parameter| PAYLOAD_PARAMETERS.iter().position(|&parameter| parameter == wanted);
    let (Some(m), Some(x), Some(y), Some(zz)) =
        (place(Parameter::M), place(Parameter::HX), place(Parameter::HY), place(Parameter::ZZ))
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
    (gradient[x], gradient[y]) = (-T::of(2.0) * value(x), -T::of(2.0) * value(y));
    // Where the mass is about zero the gradient is too: the curvature of the product counts then.
    let curvature = payload.sigma(m).unwrap_or(T::zero()) * payload.sigma(zz).unwrap_or(T::zero());
    let spread = real::sqrt(explanation.variance_of(&gradient) + curvature * curvature);
    surplus >= -thresholds.largest_negative_sigmas * spread
}

#[cfg(test)]
mod tests;
