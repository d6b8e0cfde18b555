//! A target that the bus voltage cannot hold, and the way back.
//!
//! On a weak supply of 12 V a rotor at the joint's top speed asks for more voltage than there is at 50 A; at 1.3 times that
//! speed the magnets alone do. 100 ms at the limit, then a target that can be held. An integral that had wound up would
//! take long to come back; the time is compared with that of the same step at 48 V, where nothing is limited.

use scarab::units::Volt;
use serde::Serialize;

use super::super::error::ToolError;
use super::{Bench, PERIOD_S};

/// A, or the axis' limit.
const BEYOND: f64 = 50.0;
/// Of it, afterwards.
const WITHIN_SHARE: f64 = 0.2;
/// V.
const WEAK: f64 = 12.0;
/// At the limit, s.
const LIMITED_S: f64 = 0.1;
/// Looked at after the way back began, periods: 10 ms.
const PERIODS: usize = 240;
/// Drawn before it, periods.
const BEFORE: usize = 24;
/// Recovered within so much of the current asked for.
const BAND_SHARE: f64 = 0.03;

/// One speed on one supply.
#[derive(Clone, Debug, Serialize)]
pub struct LimitReport {
    /// Of the rotor, rad/s.
    pub speed_rad_s: f64,
    /// Of the supply, V.
    pub supply_v: f64,
    /// Asked for at the limit, A.
    pub asked_a: f64,
    /// And then, A.
    pub target_a: f64,
    /// Quadrature current at the limit, mean of the last 10 ms, A.
    pub reached_a: f64,
    /// Direct current there, A.
    pub direct_a: f64,
    /// From the target's change until the current stays within 3 % of `asked_a` of it, ms; none where it never does.
    pub recovery_ms: Option<f64>,
    /// Beyond the new target on the way, A.
    pub overshoot_a: f64,
    /// The bridge was released by the firmware.
    pub released: bool,
    /// About the change of the target, ms.
    pub time_ms: Vec<f64>,
    /// A.
    pub quadrature_a: Vec<f64>,
    /// The direct current, A.
    pub direct_current_a: Vec<f64>,
}

/// Both speeds on both supplies.
pub fn measure(bench: &Bench) -> Result<Vec<LimitReport>, ToolError> {
    let mut reports = Vec::new();
    let asked = bench.within_limit(BEYOND);
    for (share, sign) in [(1.0, 1.0), (1.3, -1.0)] {
        for supply in [WEAK, bench.supply.voltage] {
            let currents = [asked, sign * WITHIN_SHARE * asked];
            reports.push(one(bench, share * bench.top_speed, supply, currents)?);
        }
    }
    Ok(reports)
}

fn one(bench: &Bench, speed: f64, supply: f64, [asked, target]: [f64; 2]) -> Result<LimitReport, ToolError> {
    let mut bench = bench.clone();
    bench.supply.voltage = supply;
    bench.configuration.bus[0] = Volt(8.0);
    let mut rig = bench.rig(speed, 0.0)?;
    let limited = (LIMITED_S / PERIOD_S) as usize;
    let mut currents = Vec::with_capacity(limited + PERIODS);
    for _ in 0..limited {
        currents.push(rig.period(asked));
    }
    for _ in 0..PERIODS {
        currents.push(rig.period(target));
    }
    bench.must_hold(&rig, &format!("{asked:.0} A on a supply of {supply:.0} V"), speed)?;
    let mean = |index: usize| -> f64 {
        let last = &currents[limited - PERIODS..limited];
        last.iter().map(|current| current[index]).sum::<f64>() / last.len() as f64
    };
    let after: Vec<f64> = currents[limited..].iter().map(|current| current[1]).collect();
    let outside = after
        .iter()
        .rposition(|current| (current - target).abs() > BAND_SHARE * asked)
        .map_or(0, |last| last + 1);
    let shown = limited - BEFORE..limited + PERIODS / 4;
    Ok(LimitReport {
        speed_rad_s: speed,
        supply_v: supply,
        asked_a: asked,
        target_a: target,
        reached_a: mean(1),
        direct_a: mean(0),
        recovery_ms: (outside < after.len()).then_some(1e3 * outside as f64 * PERIOD_S),
        overshoot_a: after.iter().map(|current| target - current).fold(0.0, f64::max),
        released: rig.axis.fault().is_some(),
        time_ms: shown.clone().map(|period| 1e3 * PERIOD_S * (period as f64 - limited as f64)).collect(),
        quadrature_a: shown.clone().map(|period| currents[period][1]).collect(),
        direct_current_a: shown.map(|period| currents[period][0]).collect(),
    })
}
