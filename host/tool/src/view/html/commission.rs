//! Page of a commissioning.

use maud::{DOCTYPE, html};
use scarab_base::number::Number;
use scarab_base::precision;
use scarab_base::table::{Table, cells};
use scarab_client::report::{CommissionReport, ParameterRead};

use crate::view::html::table::ToHtml;
use crate::view::html::{page_head, parameters, time_utc};

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
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("Commissioning of {:08X}: {verdict}", report.serial)))
            body {
                main {
                    header {
                        p.over { "Scarab \u{b7} commissioning" }
                        h1 { (report.device) " " (format!("{:08X}", report.serial)) ": " (verdict) }
                        p.when { (time_utc()) " (UTC)" }
                        p {
                            "Firmware " (report.firmware)
                            @if report.image != 0 { ", image with check sum " (format!("{:08X}", report.image)) }
                            ", supply " (places(report.supply_v, 1)) " V"
                        }
                    }
                    section { h2 { "Steps" } (steps.to_html()) }
                    section { h2 { "Joints" } (joints(report).to_html()) }
                    @if report.verdict.is_some() {
                        section {
                            h2 { "Base parameters" }
                            p { "SI units, as in the leg file. What torque determines: single parameters, and sums of grouped ones, named after one of them." }
                            (table(&report.base).to_html())
                        }
                        section {
                            h2 { "All parameters" }
                            (parameters::statuses(true))
                            @for (name, joint) in ["hip", "knee"].into_iter().zip(&report.joints) {
                                h3 { "Parameters of the " (name) }
                                (table(&joint.parameters).to_html())
                            }
                        }
                        @if !report.reasons.is_empty() { p { "Refused because of: " (report.reasons.join(", ")) } }
                    }
                }
            }
        }
    };
    page.into_string()
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
