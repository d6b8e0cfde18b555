//! A torque whose gain or sign changes midway.
//!
//! ```text
//! before   torque = Y p                after   s torque = Y p       of one joint, or of all
//! J(s)     = c1 + s^2 c2 - |b1 + s b2|^2,   |b|^2 = b' A^-1 b       least over p
//! s        = b1' A^-1 b2 / (c2 - b2' A^-1 b2),    gain = 1 / s
//! ```
//!
//! The change comes at the same share of every recording, or within one recording; the best of a grid counts.
//! sigma is that of s with the columns of the parameters: the larger of noise and segments.

use scarab::real::dot;

use crate::run::logging_errors::directions::CHANCE;
use crate::run::logging_errors::fit::Fit;
use crate::run::logging_errors::rows::{Equations, RowSource};

/// Change of the gain that is tolerated beside chance: the temperature of a drive changes it by 5 %.
const LARGEST_CHANGE: f64 = 0.05;
/// Part of the misfit that a change of sign must explain. A push changes the gain as well, but explains less.
const EXPLAINED_BY_SIGN: f64 = 0.5;
/// Part of the misfit that a change must explain.
const EXPLAINED_SHARE: f64 = 0.1;
/// Least part of the torque's power on either side of a change. With less, the gain of the whole recording is
/// wrong.
const SMALLEST_SIDE: f64 = 0.02;
/// Points of change tried in each recording.
pub(super) const POINTS: usize = 39;

/// Best change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Midway {
    /// Joint, from 0; `None` for all.
    pub(crate) joint: Option<usize>,
    /// Recording in which the torque changes; `None` for all.
    pub(crate) scope: Option<usize>,
    /// Share of the recording after which the change acts.
    pub(crate) share: f64,
    /// Relative change of the gain; -2 is a change of sign.
    pub(crate) change: f64,
    /// Standard deviation of the change.
    pub(crate) sigma: f64,
    /// Part of the misfit that the change explains.
    pub(crate) explained: f64,
}

impl Midway {
    /// Whether the change refuses the recording.
    pub(crate) fn refuses(&self) -> bool {
        self.change.abs() > self.limit()
    }

    /// Whether a row comes after the change.
    fn acts_on(&self, source: &RowSource) -> bool {
        is_after(source, self.scope, self.joint, self.share)
    }

    /// Torques without the change.
    pub(crate) fn corrected(&self, all: &Equations) -> Vec<f64> {
        let rows = all.sources.iter().zip(&all.torque);
        rows.map(|(source, torque)| if self.acts_on(source) { torque / (1.0 + self.change) } else { *torque })
            .collect()
    }

    /// Limit of the change.
    pub(crate) fn limit(&self) -> f64 {
        LARGEST_CHANGE + CHANCE * self.sigma
    }
}

/// Normal equations' right side and power of some equations.
struct Sums {
    right: Vec<f64>,
    power: f64,
}

impl Sums {
    fn new(all: &Equations, mut chosen: impl FnMut(&RowSource) -> bool) -> Self {
        let mut sums = Self { right: vec![0.0; all.active.len()], power: 0.0 };
        let rows = all.columns.rows().zip(&all.torque).zip(all.weight.iter().zip(&all.sources));
        for ((row, torque), (weight, source)) in rows {
            if chosen(source) {
                let scaled = weight * weight * torque;
                sums.power += scaled * torque;
                for (slot, element) in sums.right.iter_mut().zip(row) {
                    *slot += scaled * element;
                }
            }
        }
        sums
    }
}

fn product(fit: &Fit, one: &[f64], other: &[f64]) -> f64 {
    dot(one, &fit.inverse.times(other))
}

/// Factor of the torques in `after` that leaves least of the misfit over the torque, and the share it
/// explains.
fn change(plain: &Fit, whole: &Sums, after: &Sums) -> (f64, f64) {
    let share = |cost: f64, power: f64| cost / power.max(1e-300);
    let pairs = || whole.right.iter().zip(&after.right);
    let right: Vec<f64> = pairs().map(|(whole, after)| whole - after).collect();
    let own = after.power - product(plain, &after.right, &after.right);
    let factor = product(plain, &right, &after.right) / own.max(1e-300);
    let power = whole.power - after.power + factor * factor * after.power;
    let total: Vec<f64> = pairs().map(|(whole, after)| whole - after + factor * after).collect();
    let cost = power - product(plain, &total, &total);
    (factor, 1.0 - share(cost, power) / share(plain.cost, whole.power))
}

/// Searches the change that explains most; `None` where none explains a tenth of the misfit.
///
/// Searches once with the robust weights, which ignore a push, and once with every row: after a change of
/// sign, robust weights exclude the rows after it.
pub(crate) fn find(all: &Equations) -> Option<Midway> {
    let robust = strongest(all);
    let whole = strongest(&all.with_equal_weights())
        .filter(|found| found.refuses() && found.change < -1.0 && found.explained > EXPLAINED_BY_SIGN);
    match (robust, whole) {
        (Some(robust), Some(whole)) if robust.refuses() && robust.explained > whole.explained => Some(robust),
        (robust, whole) => whole.or(robust),
    }
}

fn strongest(all: &Equations) -> Option<Midway> {
    let plain = all.fit(&all.columns, &all.torque, false);
    let whole = Sums::new(all, |_| true);
    let motions = all.sources.iter().map(|source| source.motion).max()? + 1;
    let scopes = std::iter::once(None).chain((0..motions).filter(|_| motions > 1).map(Some));
    let mut best: Option<Midway> = None;
    for scope in scopes {
        for joint in (0..all.joints()).map(Some).chain((all.joints() > 1).then_some(None)) {
            let own = Sums::new(all, |source| is_after(source, scope, joint, -1.0));
            // A gain of the whole recording is another error: a torque scale, or another machine.
            let always = if own.power < 0.999 * whole.power { change(&plain, &whole, &own).1 } else { 0.0 };
            for point in 1..=POINTS {
                let share = point as f64 / (POINTS + 1) as f64;
                let after = Sums::new(all, |source| is_after(source, scope, joint, share));
                if !(SMALLEST_SIDE..1.0 - SMALLEST_SIDE).contains(&(after.power / own.power.max(1e-300))) {
                    continue;
                }
                let (factor, explained) = change(&plain, &whole, &after);
                if explained > always + EXPLAINED_SHARE && best.is_none_or(|best| explained > best.explained)
                {
                    best = Some(Midway {
                        joint,
                        scope,
                        share,
                        change: 1.0 / factor - 1.0,
                        sigma: 0.0,
                        explained,
                    });
                }
            }
        }
    }
    let mut found = best?;
    // Uncertainty of the factor: the torque after the change as a further column.
    let is_changed = |source: &RowSource| found.acts_on(source);
    let torque = found.corrected(all);
    let fit = all.fit(&all.columns, &torque, false);
    let predicted = fit.predictions(&all.columns);
    let column = |(source, torque): (&RowSource, &f64)| if is_changed(source) { *torque } else { 0.0 };
    let z: Vec<f64> = all.sources.iter().zip(&predicted).map(column).collect();
    let scored = all.score(&fit, &all.columns, &torque, &z);
    // Chi-square of one for each independent row, independent of the previous misfit.
    let rows = all.sources.len() as f64 * all.information().min(1.0) - fit.rank as f64;
    let noise = scored.noise_sigma * (fit.cost / rows.max(1.0)).sqrt();
    // The change is 1 / s - 1, and the column has the size of s times the torque.
    found.sigma = noise.max(scored.segment_sigma) * (1.0 + found.change).abs();
    Some(found)
}

pub(super) fn is_after(source: &RowSource, scope: Option<usize>, joint: Option<usize>, share: f64) -> bool {
    source.share > share
        && scope.is_none_or(|motion| source.motion == motion)
        && joint.is_none_or(|joint| source.joint == joint)
}
