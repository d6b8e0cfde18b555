//! Report of a motion in words and tables.

use scarab_base::number::number;
use scarab_base::table::{Table, cells};
use scarab_identify::report::excite::ExciteReport;

/// Formats the report for standard output.
pub fn report(report: &ExciteReport) -> String {
    let mut lines = vec![
        format!(
            "{}: {:.1} s: {} cycles of {} s between blends of {} s",
            report.leg,
            report.duration_s,
            report.cycles,
            number(report.period_s.into()),
            number(report.blend_s.into())
        ),
        format!(
            "assumed: the leg file's {}, torque noise {}; each base parameter may be {} % off in the torque's bound",
            report.assumed,
            noise(report),
            number(report.margin_percent.into()),
        ),
        String::new(),
        joints(report),
        base_parameters(report),
        parameters(report),
        information(report),
    ];
    lines.extend(report.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.join("\n") + "\n"
}

fn noise(report: &ExciteReport) -> String {
    if report.torque_noise_percent == 0.0 {
        return "as stated in N m".into();
    }
    let whose = if report.torque_noise_of == "truth" { "the simulated leg's" } else { "the assumed leg's" };
    let percent = number(report.torque_noise_percent.into());
    format!("{percent} % of {whose} mean absolute torque on the default motion")
}

fn joints(report: &ExciteReport) -> String {
    let mut table = Table::default().label("joint").numbers([
        "angle deg",
        "of",
        "deg/s",
        "of",
        "deg/s2",
        "of",
        "torque N m",
        "with margin",
        "of",
        "noise N m",
        "rows lost %",
    ]);
    let range = |[low, high]: [f64; 2]| format!("{low:.1}..{high:.1}");
    for joint in &report.joints {
        table.row(cells![
            &joint.name,
            range(joint.angle_deg),
            range(joint.range_deg),
            format!("{:.0}", joint.speed_deg_s),
            format!("{:.0}", joint.speed_limit_deg_s),
            format!("{:.0}", joint.acceleration_deg_s2),
            format!("{:.0}", joint.acceleration_limit_deg_s2),
            range(joint.torque_nm),
            format!("{:.1}", joint.torque_with_margin_nm),
            format!("{:.1}", joint.torque_limit_nm),
            number(joint.torque_noise_nm.into()),
            format!("{:.1}", 100.0 * joint.lost_share),
        ]);
    }
    table.to_text()
}

fn base_parameters(report: &ExciteReport) -> String {
    let mut table = Table::default()
        .label("base parameter")
        .numbers(["assumed", "expected sigma"])
        .unit()
        .numbers(["systematic", "over a random motion's"]);
    for base in &report.base_parameters {
        let expected = &base.expected;
        table.row(cells![
            &expected.name,
            number(expected.assumed.into()),
            number(expected.sigma.into()),
            &expected.unit,
            number(expected.systematic.into()),
            base.ratio_to_random.known().map_or_else(|| "-".into(), |ratio| format!("{ratio:.2}")),
        ]);
    }
    table.to_text()
}

fn parameters(report: &ExciteReport) -> String {
    let mut table = Table::default()
        .label("parameter")
        .text(["status"])
        .numbers(["expected sigma"])
        .unit()
        .text(["grouped with"]);
    for parameter in &report.parameters {
        table.row(cells![
            &parameter.name,
            parameter.status,
            number(parameter.sigma),
            parameter.unit,
            parameter.grouped_with.join(" "),
        ]);
    }
    table.to_text()
}

fn information(report: &ExciteReport) -> String {
    let count = report.base_parameters.len().max(1) as f64;
    let mut text = format!(
        "information: ln det {}, condition {}",
        number(report.log_determinant),
        number(report.condition)
    );
    for (random, what) in [
        (report.random, "the best of 300 random motions of two cycles"),
        (report.random_same_pace, "the best of 300 of as many cycles"),
    ] {
        let limits = if random.keeps_torque_limits {
            ""
        } else {
            " (that one takes too much torque, or is too fast near the ends)"
        };
        if let Some((own, other)) = report.log_determinant.known().zip(random.log_determinant.known()) {
            let sigma = ((other - own) / (2.0 * count)).exp();
            text += &format!(
                "\n  {:+.2} over {what}: a mean sigma {sigma:.2} times as large{limits}",
                own - other
            );
        }
    }
    text
}
