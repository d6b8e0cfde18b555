//! Step to a target beyond the voltage limit, and the recovery.
//!
//! On a weak supply of 12 V, 50 A at the joint's top speed need more voltage than is available. At 1.3 times
//! that speed the back-EMF alone exceeds it. The loop is held at the limit for 100 ms, then gets a target
//! within the limit. Integrator wind-up would delay the recovery. Its time is compared with the same step at
//! 48 V, where the voltage suffices.

use crate::report::motor::LimitReport;
use scarab::units::Volt;
use scarab_base::error::ToolError;

use crate::motor::{Bench, PERIOD_S};

/// Target beyond the limit, A, at most the axis' limit.
const BEYOND: f64 = 50.0;
/// Target afterwards, as a share of the first.
const WITHIN_SHARE: f64 = 0.2;
/// Voltage of the weak supply, V.
const WEAK: f64 = 12.0;
/// Time at the limit, s.
const LIMITED_S: f64 = 0.1;
/// Recorded periods after the target changes: 10 ms.
const PERIODS: usize = 240;
/// Drawn periods before the target changes.
const BEFORE: usize = 24;
/// Band about the target that counts as recovered, as a share of the requested current.
const BAND_SHARE: f64 = 0.03;

/// Measures both speeds on both supplies.
pub fn measure(bench: &Bench) -> Result<Vec<LimitReport>, ToolError> {
    let mut reports = Vec::new();
    let requested = bench.within_limit(BEYOND);
    for (share, sign) in [(1.0, 1.0), (1.3, -1.0)] {
        for supply in [WEAK, bench.supply.voltage] {
            let currents = [requested, sign * WITHIN_SHARE * requested];
            reports.push(one(bench, share * bench.top_speed, supply, currents)?);
        }
    }
    Ok(reports)
}

fn one(
    bench: &Bench,
    speed: f64,
    supply: f64,
    [requested, target]: [f64; 2],
) -> Result<LimitReport, ToolError> {
    let mut bench = bench.clone();
    bench.supply.voltage = supply;
    bench.configuration.bus[0] = Volt(8.0);
    let mut rig = bench.rig(speed, 0.0)?;
    let limited = (LIMITED_S / PERIOD_S) as usize;
    let mut currents = Vec::with_capacity(limited + PERIODS);
    for _ in 0..limited {
        currents.push(rig.period(requested));
    }
    for _ in 0..PERIODS {
        currents.push(rig.period(target));
    }
    bench.must_hold(&rig, &format!("{requested:.0} A on a supply of {supply:.0} V"), speed)?;
    let mean = |index: usize| -> f64 {
        let last = &currents[limited - PERIODS..limited];
        last.iter().map(|current| current[index]).sum::<f64>() / last.len() as f64
    };
    let after: Vec<f64> = currents[limited..].iter().map(|current| current[1]).collect();
    let outside = after
        .iter()
        .rposition(|current| (current - target).abs() > BAND_SHARE * requested)
        .map_or(0, |last| last + 1);
    let shown = limited - BEFORE..limited + PERIODS / 4;
    Ok(LimitReport {
        speed_rad_s: speed,
        supply_v: supply,
        asked_a: requested,
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
