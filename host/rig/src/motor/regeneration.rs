//! Braking of a spinning inertia into a supply that absorbs no energy.
//!
//! The inertia is a leg joint's 2.5 kg m^2, reduced to the motor by the joint's gear, at the joint's top
//! speed. A current of 50 A brakes it to a tenth of that speed, with and without the brake chopper.

use crate::report::motor::RegenerationReport;
use hal_sim::drive::stand::Load;
use scarab::trace::words::axis_fault;
use scarab_base::error::ToolError;

use crate::motor::{Bench, PERIOD_S};

/// Inertia of the joint, kg m^2.
const INERTIA: f64 = 2.5;
/// Braking current, A, at most the axis' limit.
const CURRENT: f64 = 50.0;
/// Share of the initial speed at which braking ends.
const END: f64 = 0.1;
/// Limit of the braking time, s.
const LONGEST_S: f64 = 1.0;
/// Periods between two drawn points.
const STRIDE: usize = 24;

/// Measures with and without the chopper.
pub fn measure(bench: &Bench) -> Result<Vec<RegenerationReport>, ToolError> {
    [true, false].into_iter().map(|chopper| one(bench, chopper)).collect()
}

fn one(bench: &Bench, chopper: bool) -> Result<RegenerationReport, ToolError> {
    let inertia = INERTIA / (bench.axis.ratio * bench.axis.ratio);
    let current = bench.within_limit(CURRENT);
    let mut rig = bench.rig(bench.top_speed, 0.0)?;
    if chopper {
        rig = rig.with_chopper();
    }
    rig.hold(0.0, 0.02);
    rig.stand.set_load(Load::Free { inertia, coulomb: 0.0, viscous: 0.0, torque: 0.0 });
    let before = *rig.stand.supply().energy();
    let (mut highest, mut time_ms, mut bus_v, mut speed_rad_s) =
        (0.0_f64, Vec::new(), Vec::new(), Vec::new());
    let mut returned_j = 0.0;
    for period in 0..(LONGEST_S / PERIOD_S) as usize {
        let taken = rig.stand.supply().energy().bridges;
        rig.period(-current);
        returned_j += (taken - rig.stand.supply().energy().bridges).max(0.0);
        let (bus, speed) = (rig.stand.supply().voltage(), rig.stand.rotor().speed);
        highest = highest.max(bus);
        let ended = speed < END * bench.top_speed || rig.axis.fault().is_some();
        // The last period is included: where the axis turns off, its voltage is the highest.
        if ended || period.is_multiple_of(STRIDE) {
            time_ms.push(1e3 * period as f64 * PERIOD_S);
            bus_v.push(bus);
            speed_rad_s.push(speed);
        }
        if ended {
            break;
        }
    }
    if chopper {
        bench.must_hold(&rig, "braking", bench.top_speed)?;
    }
    let energy = rig.stand.supply().energy();
    Ok(RegenerationReport {
        chopper,
        current_a: current,
        highest_bus_v: highest,
        motion_j: 0.5 * inertia * bench.top_speed * bench.top_speed,
        returned_j,
        brake_j: energy.brake - before.brake,
        fault: rig.axis.fault().map(axis_fault),
        time_ms,
        bus_v,
        speed_rad_s,
    })
}
