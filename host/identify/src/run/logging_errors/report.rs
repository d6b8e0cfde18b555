//! Judges the fitted directions for report and verdict.

use scarab_base::number::Number;

use crate::report::doubt::{CauseReport, DirectionReport};
use crate::run::logging_errors::directions::{
    CHANCE, EXPLAINED_SHARE, Found, Kind, SMALLEST_SYSTEMATIC, TOLERATED_SHIFT,
};

impl DirectionReport {
    /// Judges a direction. `sigma` is that of the parameters, `systematic` the part of the misfit that is not
    /// noise, `accepted` the share of the torque by which it may be wrong.
    pub fn new<const B: usize>(found: &Found<B>, sigma: &[f64; B], systematic: f64, accepted: f64) -> Self {
        let (unit, factor) = found.kind.unit();
        let shifts = found.shift.iter().zip(sigma).filter(|(_, sigma)| **sigma > 0.0);
        let largest = shifts.map(|(shift, sigma)| (shift / sigma).abs()).fold(0.0, f64::max);
        let needed = EXPLAINED_SHARE * systematic.max(SMALLEST_SYSTEMATIC);
        let known = |value: f64| if found.seen { Number::from(value) } else { Number::UNKNOWN };
        let estimate = |value: f64| if found.at_limit { Number::UNKNOWN } else { known(value) };
        let matters = found.end_share().map_or(largest > TOLERATED_SHIFT, |share| share > accepted);
        let refused = found.significance() > CHANCE && matters && found.explained() > needed;
        Self {
            name: found.kind.name(),
            joint: found.kind.joint().map(|joint| joint + 1),
            value: estimate(factor * found.value),
            at_limit: found.at_limit,
            sigma: estimate(factor * found.sigma()),
            sigma_from: if found.noise_sigma >= found.segment_sigma { "noise" } else { "segments" },
            unit,
            limit: estimate(factor * CHANCE * found.sigma()),
            explained: known(found.explained()),
            explained_limit: needed.into(),
            largest_shift: known(largest),
            passed: !refused,
            alike: found.alike.clone(),
        }
    }
}

impl CauseReport {
    /// A direction as the likely cause.
    pub(crate) fn direction(kind: Kind, direction: &DirectionReport) -> Self {
        Self {
            name: kind.name(),
            joint: direction.joint,
            value: direction.value,
            sigma: direction.sigma,
            words: format!(
                "{}; fitted, it explains {:.0} % of the misfit",
                direction.words(),
                100.0 * direction.explained.known().unwrap_or(0.0)
            ),
            reads: Vec::new(),
        }
    }
}
