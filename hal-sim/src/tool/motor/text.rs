//! What `motor` measured, as tables.

use super::super::tables::headed;
use super::MotorReport;

/// All tables.
#[must_use]
pub fn tables(report: &MotorReport) -> String {
    let mut text = format!(
        "{}, {}: current loop of {:.0} Hz at 24 kHz\n\nsteps of the quadrature current, 5 to 25 A\n",
        report.leg, report.joint, report.bandwidth_hz
    );
    let mut table =
        headed(&["speed, rad/s", "feedforward", "rise, ms", "overshoot, %", "coupling, %", "error, A"]);
    let designed = &report.designed;
    table.add_row(vec![
        "designed".to_owned(),
        String::new(),
        format!("{:.3}", designed.rise_ms),
        format!("{:.1}", designed.overshoot_percent),
        "0.0".into(),
        "0.00".into(),
    ]);
    for step in &report.steps {
        table.add_row(vec![
            format!("{:.0}", step.speed_rad_s),
            yes(step.feedforward),
            format!("{:.3}", step.shape.rise_ms),
            format!("{:.1}", step.shape.overshoot_percent),
            format!("{:.1}", step.coupling_percent),
            format!("{:+.2}", step.error_a),
        ]);
    }
    text += &format!("{}\n\ntorque ripple at 20 A, no cogging\n", table.trim_fmt());
    let mut table = headed(&[
        "speed, rad/s",
        "sensor noise",
        "dead time given back",
        "sine",
        "torque, % rms",
        "6th harmonic, %",
        "mean, %",
        "direct, A rms",
    ]);
    for ripple in &report.ripple {
        table.add_row(vec![
            format!("{:.0}", ripple.speed_rad_s),
            yes(ripple.noise),
            yes(ripple.compensated),
            ripple.sine.into(),
            format!("{:.3}", ripple.torque_percent),
            format!("{:.3}", ripple.sixth_percent),
            format!("{:+.3}", ripple.mean_error_percent),
            format!("{:.3}", ripple.direct_a),
        ]);
    }
    text += &format!(
        "{}\n\nvoltage limit: 50 A asked for 100 ms, then 10 A against the limit\n",
        table.trim_fmt()
    );
    let mut table = headed(&[
        "speed, rad/s",
        "supply, V",
        "reached, A",
        "direct, A",
        "recovery, ms",
        "overshoot, A",
        "released",
    ]);
    for limit in &report.limit {
        table.add_row(vec![
            format!("{:.0}", limit.speed_rad_s),
            format!("{:.0}", limit.supply_v),
            format!("{:.1}", limit.reached_a),
            format!("{:+.2}", limit.direct_a),
            limit.recovery_ms.map_or("never".into(), |time| format!("{time:.2}")),
            format!("{:.2}", limit.overshoot_a),
            yes(limit.released),
        ]);
    }
    text += &format!("{}\n\nbraking with 50 A from the joint's top speed\n", table.trim_fmt());
    let mut table = headed(&[
        "chopper",
        "highest bus, V",
        "motion, J",
        "given back, J",
        "brake resistor, J",
        "released by",
    ]);
    for braking in &report.regeneration {
        table.add_row(vec![
            yes(braking.chopper),
            format!("{:.1}", braking.highest_bus_v),
            format!("{:.1}", braking.motion_j),
            format!("{:.1}", braking.returned_j),
            format!("{:.1}", braking.brake_j),
            braking.fault.unwrap_or("-").into(),
        ]);
    }
    text + &table.trim_fmt() + "\n"
}

fn yes(value: bool) -> String {
    if value { "yes" } else { "no" }.into()
}
