//! Sections of a commissioning.

use scarab_base::number::Number;
use scarab_base::precision;
use scarab_base::table::{Table, cells};
use scarab_client::report::{CommissionReport, ParameterRead};

use crate::view::html::time_utc;
use crate::view::sections::{self, Head, Section};

const BASE: &str = "SI units, as in the leg file. What torque determines: single parameters, and sums of grouped ones, named after one of \
    them.";
const STATUSES: &str = "identified: measured alone; grouped: only sums with the parameters beside it are measured, and the prior splits them; \
    weak: measured, hardly distinguishable from others; prior: does not show in the torque.";

/// Value with some decimal places, or a dash. A number that rounds to zero has no sign.
fn places(value: Number, count: usize) -> String {
    let Some(value) = value.known() else { return "-".into() };
    let text = format!("{value:.count$}");
    if text.contains(|digit| ('1'..='9').contains(&digit)) {
        text
    } else {
        text.trim_start_matches('-').into()
    }
}

fn table(read: &[ParameterRead]) -> Table {
    let mut table = Table::default().label("parameter").numbers(["value", "sigma"]).text(["status"]);
    for parameter in read {
        table.row(cells![
            &parameter.name,
            precision::value(parameter.value, parameter.sigma),
            precision::sigma(parameter.sigma),
            parameter.status,
        ]);
    }
    table
}

fn joints(report: &CommissionReport) -> Table {
    let mut table = Table::default().label("joint").numbers([
        "node",
        "bridge, °C",
        "winding, °C",
        "angle, rad",
        "worst predicted rms, N m",
    ]);
    for (name, joint) in ["hip", "knee"].into_iter().zip(&report.joints) {
        let worst = joint.predicted_rms_nm.iter().filter_map(|rms| rms.known()).reduce(f64::max);
        table.row(cells![
            name,
            joint.node.to_string(),
            places(joint.bridge_c, 1),
            places(joint.winding_c, 1),
            places(joint.position_rad, 3),
            places(worst.into(), 2),
        ]);
    }
    table
}

/// Creates the page, with the present time.
pub(crate) fn page(report: &CommissionReport) -> String {
    let verdict = match (report.verdict, report.stored) {
        (Some("accepted"), true) => "accepted and stored",
        (Some("accepted"), false) => "accepted, not stored",
        (Some(_), _) => "refused",
        (None, _) => "not identified",
    };
    let mut steps = Table::default().label("step").numbers(["s"]).text(["result"]);
    for step in &report.steps {
        steps.row(cells![step.step, format!("{:.1}", step.seconds), &step.result]);
    }
    let mut sections = vec![Section::new("Steps").table(steps), Section::new("Joints").table(joints(report))];
    if report.verdict.is_some() {
        sections.push(Section::new("Base parameters").explained(BASE).table(table(&report.base)));
        sections.push(Section::new("All parameters").explained(STATUSES));
        for (name, joint) in ["hip", "knee"].into_iter().zip(&report.joints) {
            let section = Section::new(format!("Parameters of the {name}"));
            sections.push(section.table(table(&joint.parameters)));
        }
    }
    if !report.reasons.is_empty() {
        sections.push(Section::new("Refused because of").lines([report.reasons.join(", ")]));
    }
    let image = match report.image {
        0 => String::new(),
        sum => format!(", image with check sum {sum:08X}"),
    };
    let firmware = format!("Firmware {}{image}, supply {} V", report.firmware, places(report.supply_v, 1));
    let head = Head {
        kind: "commissioning",
        title: &format!("{} {:08X}: {verdict}", report.device, report.serial),
        time_utc: &time_utc(),
        command: None,
        lines: &[firmware],
    };
    sections::page(head, &sections)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_rounds_to_zero_has_no_sign() {
        let cases = [(-0.0002, 3, "0.000"), (-0.0006, 3, "-0.001"), (f64::NAN, 1, "-"), (-12.26, 1, "-12.3")];
        for (value, count, expected) in cases {
            assert_eq!(places(value.into(), count), expected);
        }
    }
}
