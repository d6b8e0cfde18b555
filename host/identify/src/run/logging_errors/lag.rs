//! Torque that lags behind the angle: by a delay or by a filter.
//!
//! ```text
//! filter   tau        = LP(Y) p    LP: first-order low-pass of time constant T, corner 1 / (2 pi T)
//! delay    tau(t + d) = Y p        of all joints together; of one joint it is a direction
//! ```
//!
//! Why: both look alike where the motion is slow against 1 / T, but they need different corrections. Each is
//! fitted with the parameters eliminated. The columns are filtered; inverting the filter on the torque would
//! amplify its noise, and the best time would come out too short. The time comes from a scan and a search
//! between its best points. Runs after a refusal and for an accepted misfit. Cost: about 25 fits of the rows
//! for each joint and for all.

use scarab_base::number::Number;

use crate::report::doubt::CauseReport;
use crate::run::logging_errors::fit::Fit;
use crate::run::logging_errors::rows::{Equations, RowSource};
use crate::run::logging_errors::table::Table;
use crate::run::logging_errors::{Refitted, joint_words};

/// Times tried by the scan, s.
const SCAN_S: [f64; 8] = [0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128];
/// Steps of the search between two points of the scan. Each step leaves 0.62 of the interval.
const STEPS: usize = 16;
/// Shortest time that is searched, s.
const SHORTEST_S: f64 = 1e-4;
/// Share of the time constant by which the difference quotient changes it.
const DIFFERENCE: f64 = 1e-2;
/// Factor by which a low-pass must leave less of the misfit than a delay. On a real arm, whose misfit is many
/// times its noise, a low-pass leaves 1.25 times less although the torque is delayed by 60 ms.
const CLEARER: f64 = 1.3;
/// Share of the longest time from which a search ended there.
const AT_END: f64 = 0.98;
/// Golden section.
const SECTION: f64 = 0.618_033_988_749_895;

/// Kind of a lag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Delay,
    Filter,
}

/// Delay of all torques, then the low-pass of all and of each joint where it fits better than a delay.
pub(crate) fn all(equations: &Equations) -> Vec<Refitted> {
    let search = Search { equations, every_row: equations.every_row() };
    let mut found = Vec::new();
    let joints = equations.joints();
    for joint in (0..joints).map(Some).chain((joints > 1).then_some(None)) {
        let [(delay, delay_cost), (filter, filter_cost)] =
            [Kind::Delay, Kind::Filter].map(|kind| search.one(kind, joint));
        let is_clearer = CLEARER * CLEARER * filter_cost < delay_cost;
        // The delay of one joint is one of the directions.
        found.extend(joint.is_none().then_some(delay));
        found.extend(is_clearer.then_some(filter));
    }
    found
}

struct Search<'a> {
    equations: &'a Equations,
    every_row: Vec<Table>,
}

impl Search<'_> {
    /// Columns and torques with the lag of a joint, or of all.
    fn system(&self, kind: Kind, joint: Option<usize>, time_s: f64) -> (Table, Vec<f64>) {
        let all = self.equations;
        match kind {
            Kind::Delay => {
                let late =
                    |source: &RowSource| joint.is_none_or(|joint| joint == source.joint).then_some(time_s);
                (all.columns.clone(), all.delayed(late))
            }
            Kind::Filter => (all.low_passed(&self.every_row, joint, time_s), all.torque.clone()),
        }
    }

    fn fit(&self, kind: Kind, joint: Option<usize>, time_s: f64) -> Fit {
        let (columns, torque) = self.system(kind, joint, time_s);
        self.equations.fit(&columns, &torque, false)
    }

    /// A lag with the parameters fitted beside it, and the cost of the equations of the lagging joints.
    fn one(&self, kind: Kind, joint: Option<usize>) -> (Refitted, f64) {
        let all = self.equations;
        let largest_s = all.largest_delay_s();
        let cost = |time_s: f64| self.fit(kind, joint, time_s).cost;
        let times: Vec<f64> = SCAN_S.into_iter().filter(|&time_s| time_s < largest_s).collect();
        let costs: Vec<f64> = times.iter().map(|&time_s| cost(time_s)).collect();
        let best = (0..costs.len()).min_by(|&one, &other| costs[one].total_cmp(&costs[other])).unwrap_or(0);
        let first = best.checked_sub(1).map_or(SHORTEST_S, |before| times[before]);
        let time_s = least(first, times.get(best + 1).copied().unwrap_or(largest_s), cost);

        let plain = all.fit(&all.columns, &all.torque, false).cost;
        let (columns, torque) = self.system(kind, joint, time_s);
        let fit = all.fit(&columns, &torque, false);
        // A later torque is the same change as an earlier prediction.
        let step_s = DIFFERENCE * time_s;
        let predicted = fit.predictions(&columns);
        let slope: Vec<f64> = match kind {
            Kind::Delay => all.rate_of(&predicted).into_iter().map(|rate| -rate).collect(),
            Kind::Filter => {
                let beside = fit.predictions(&self.system(kind, joint, time_s + step_s).0);
                beside.iter().zip(&predicted).map(|(beside, here)| (beside - here) / step_s).collect()
            }
        };
        let scored = all.score(&fit, &columns, &torque, &slope);
        let remaining = (fit.cost / plain.max(1e-300)).min(1.0);
        let cost = all.cost_of_joints(&fit.residuals(&columns, &torque));
        let own_cost = joint.map_or_else(|| cost.iter().sum(), |joint| cost[joint]);
        let sigma_s = (remaining.sqrt() * scored.noise_sigma).max(scored.segment_sigma);
        let refitted = Refitted {
            cause: if time_s > AT_END * largest_s {
                at_end(kind, joint, time_s)
            } else {
                cause(kind, joint, time_s, sigma_s)
            },
            values: fit.values,
            columns,
            torque,
            significance: time_s / sigma_s.max(1e-12),
        };
        (refitted, own_cost)
    }
}

/// Value of the least cost between two values, by golden section.
pub(super) fn least(mut low: f64, mut high: f64, cost: impl Fn(f64) -> f64) -> f64 {
    let (mut one, mut other) = (high - SECTION * (high - low), low + SECTION * (high - low));
    let (mut at_one, mut at_other) = (cost(one), cost(other));
    for _ in 0..STEPS {
        if at_one < at_other {
            (high, other, at_other) = (other, one, at_one);
            one = high - SECTION * (high - low);
            at_one = cost(one);
        } else {
            (low, one, at_one) = (one, other, at_other);
            other = low + SECTION * (high - low);
            at_other = cost(other);
        }
    }
    0.5 * (low + high)
}

/// A lag longer than the search: no estimate.
fn at_end(kind: Kind, joint: Option<usize>, time_s: f64) -> CauseReport {
    let words = format!(
        "torque of {} lags by {:.0} ms or more; not determined, the search ended there",
        joint_words(joint),
        1e3 * time_s
    );
    let none = Number::UNKNOWN;
    CauseReport { value: none, sigma: none, words, ..cause(kind, joint, time_s, 0.0) }
}

fn cause(kind: Kind, joint: Option<usize>, time_s: f64, sigma_s: f64) -> CauseReport {
    let joints = joint_words(joint);
    let (time_ms, sigma_ms) = (1e3 * time_s, 1e3 * sigma_s);
    let (name, words) = match kind {
        Kind::Delay => ("delay", format!("torque of {joints}: {time_ms:.1} +- {sigma_ms:.1} ms late")),
        Kind::Filter => (
            "torque_filter",
            format!(
                "torque of {joints} behind a low-pass of {:.1} Hz (time constant {time_ms:.1} +- {sigma_ms:.1} ms): log it \
                 before the filter, or filter the angle alike",
                1.0 / (std::f64::consts::TAU * time_s)
            ),
        ),
    };
    CauseReport {
        name,
        joint: joint.map(|joint| joint + 1),
        value: time_ms.into(),
        sigma: sigma_ms.into(),
        words,
        ..CauseReport::default()
    }
}

#[cfg(test)]
mod tests {
    use super::least;

    #[test]
    fn the_search_finds_a_minimum_inside_and_at_an_end() {
        assert!((least(0.0, 2.0, |x| (x - 0.7).powi(2)) - 0.7).abs() < 1e-3);
        assert!(least(0.5, 2.0, |x| x) < 0.501);
    }
}
