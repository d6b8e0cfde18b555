//! Formats the measurements of `motor` as tables.

use scarab_base::table::{Table, cells};
use scarab_rig::report::motor::MotorReport;

/// Formats all tables.
pub fn tables(report: &MotorReport) -> String {
    let MotorReport { leg, joint, bandwidth_hz, .. } = report;
    let head = format!("{leg}, {joint}: current loop of {bandwidth_hz:.0} Hz at 24 kHz\n");
    [head, steps(report), ripple(report), limit(report), braking(report)].join("\n")
}

/// Step responses at several speeds, after the designed one.
fn steps(report: &MotorReport) -> String {
    let [from, to] = report.steps.first().map_or([0.0; 2], |step| [step.from_a, step.to_a]);
    let mut table = Table::default().numbers(["speed, rad/s"]).text(["feedforward"]).numbers([
        "rise, ms",
        "overshoot, %",
        "coupling, %",
        "error, A",
    ]);
    let designed = &report.designed;
    table.row(cells![
        "designed",
        "",
        rise(designed.rise_ms),
        format!("{:.1}", designed.overshoot_percent),
        "0.0",
        "0.00",
    ]);
    for step in &report.steps {
        table.row(cells![
            format!("{:.0}", step.speed_rad_s),
            yes(step.feedforward),
            rise(step.shape.rise_ms),
            format!("{:.1}", step.shape.overshoot_percent),
            format!("{:.1}", step.coupling_percent),
            format!("{:+.2}", step.error_a),
        ]);
    }
    format!("steps of the quadrature current, {} to {} A\n{}", ampere(from), ampere(to), table.to_text())
}

/// Torque ripple with and without sensor noise and the compensation of dead time.
fn ripple(report: &MotorReport) -> String {
    let current = report.ripple.first().map_or(0.0, |ripple| ripple.current_a);
    let mut table = Table::default()
        .numbers(["speed, rad/s"])
        .text(["sensor noise", "dead time given back"])
        .numbers(["torque, % rms", "6th harmonic, %", "mean, %", "direct, A rms"]);
    for ripple in &report.ripple {
        table.row(cells![
            format!("{:.0}", ripple.speed_rad_s),
            yes(ripple.noise),
            yes(ripple.compensated),
            format!("{:.3}", ripple.torque_percent),
            format!("{:.3}", ripple.sixth_percent),
            format!("{:+.3}", ripple.mean_error_percent),
            format!("{:.3}", ripple.direct_a),
        ]);
    }
    format!("torque ripple at {} A, no cogging\n{}", ampere(current), table.to_text())
}

/// Currents at the voltage limit, and the recovery from it.
fn limit(report: &MotorReport) -> String {
    let asked = report.limit.first().map_or(0.0, |limit| limit.asked_a);
    let mut table = Table::default()
        .numbers([
            "speed, rad/s",
            "supply, V",
            "reached, A",
            "then, A",
            "direct, A",
            "recovery, ms",
            "overshoot, A",
        ])
        .text(["released"]);
    for limit in &report.limit {
        table.row(cells![
            format!("{:.0}", limit.speed_rad_s),
            format!("{:.0}", limit.supply_v),
            format!("{:.1}", limit.reached_a),
            ampere(limit.target_a),
            format!("{:+.2}", limit.direct_a),
            limit.recovery_ms.map_or("never".into(), |time| format!("{time:.2}")),
            format!("{:.2}", limit.overshoot_a),
            yes(limit.released),
        ]);
    }
    format!("voltage limit: {} A asked for 100 ms, and then less\n{}", ampere(asked), table.to_text())
}

/// Regenerative braking with and without the brake chopper.
fn braking(report: &MotorReport) -> String {
    let current = report.regeneration.first().map_or(0.0, |braking| braking.current_a);
    let mut table = Table::default()
        .text(["chopper"])
        .numbers(["highest bus, V", "motion, J", "given back, J", "brake resistor, J"])
        .text(["released by"]);
    for braking in &report.regeneration {
        table.row(cells![
            yes(braking.chopper),
            format!("{:.1}", braking.highest_bus_v),
            format!("{:.1}", braking.motion_j),
            format!("{:.1}", braking.returned_j),
            format!("{:.1}", braking.brake_j),
            braking.fault.unwrap_or("-"),
        ]);
    }
    format!("braking with {} A from the joint's top speed\n{}", ampere(current), table.to_text())
}

/// Formats whole amperes without decimals.
fn ampere(current: f64) -> String {
    if current.fract() == 0.0 { format!("{current:.0}") } else { format!("{current:.2}") }
}

fn rise(ms: Option<f64>) -> String {
    ms.map_or("never".into(), |ms| format!("{ms:.3}"))
}

const fn yes(value: bool) -> &'static str {
    if value { "yes" } else { "no" }
}
