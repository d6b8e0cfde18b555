//! Judges the fitted directions for report and verdict.

use scarab_base::number::Number;

use crate::report::NEGLIGIBLE_PERCENT;
use crate::report::doubt::{CauseReport, DirectionReport};
use crate::run::logging_errors::Question;
use crate::run::logging_errors::directions::{
    CHANCE, Drifting, EXPLAINED_SHARE, Found, Kind, SMALLEST_SYSTEMATIC, TOLERATED_SHIFT, label,
};

impl DirectionReport {
    /// Judges a direction. `sigma` is that of the parameters, `systematic` the part of the misfit that is not
    /// noise.
    pub fn new(found: &Found, sigma: &[f64], systematic: f64, question: &Question) -> Self {
        let (unit, mut factor) = found.kind.unit();
        if let Kind::Drift(Drifting::Offset, joint) = found.kind {
            // The offset of the logged torque, which a reversed joint counts the other way.
            factor *= question.anatomy[joint].from_chain(1.0).signum();
        }
        let shifts = found.shift.iter().zip(sigma).filter(|(_, sigma)| **sigma > 0.0);
        let largest = shifts.map(|(shift, sigma)| (shift / sigma).abs()).fold(0.0, f64::max);
        let needed = EXPLAINED_SHARE * systematic.max(SMALLEST_SYSTEMATIC);
        let known = |value: f64| if found.seen { Number::from(value) } else { Number::UNKNOWN };
        let estimate = |value: f64| if found.at_limit { Number::UNKNOWN } else { known(value) };
        let accepted = question.accepted_error;
        let matters = match found.kind {
            Kind::Drift(..) => found.torque_share > accepted,
            Kind::Spring(_) => largest > TOLERATED_SHIFT && 100.0 * found.torque_share > NEGLIGIBLE_PERCENT,
            _ => largest > TOLERATED_SHIFT,
        };
        let refused = found.significance() > CHANCE && matters && found.explained() > needed;
        Self {
            name: found.kind.name(),
            joint: found.kind.joint().map(|joint| joint + 1),
            value: estimate(factor * found.value),
            at_limit: found.at_limit,
            sigma: estimate(factor.abs() * found.sigma()),
            sigma_from: if found.noise_sigma >= found.segment_sigma { "noise" } else { "segments" },
            unit,
            limit: estimate(factor.abs() * CHANCE * found.sigma()),
            explained: known(found.explained()),
            explained_limit: needed.into(),
            largest_shift: known(largest),
            torque_share: if matches!(found.kind, Kind::Drift(..) | Kind::Spring(_)) {
                estimate(found.torque_share)
            } else {
                Number::UNKNOWN
            },
            accepted_share: if matches!(found.kind, Kind::Drift(..)) {
                accepted.into()
            } else {
                Number::UNKNOWN
            },
            passed: !refused,
            alike: found.alike.clone(),
        }
    }
}

impl CauseReport {
    /// A direction as a cause.
    pub(crate) fn direction(found: &Found, direction: &DirectionReport) -> Self {
        let mut words = direction.words();
        if !found.alike.is_empty() {
            words +=
                &format!(" ({} cannot be distinguished from {})", label(found.kind), found.alike.join(", "));
        }
        let DirectionReport { joint, value, sigma, .. } = *direction;
        Self { name: found.kind.name(), joint, value, sigma, words, ..Self::default() }
    }
}
