//! Sections on the model terms and why, and on excluded data.

use maud::{Markup, html};

use crate::base::number::Number;
use crate::formats::leg_file::LegFile;
use crate::report::RunReport;
use crate::report::model_choice::ModelChoiceReport;
use crate::view::html::{exact, joint_name, measured, number, sigma};

/// Terms of each joint's model, with identified Stribeck and directional friction.
pub fn model(run: &RunReport, leg: &LegFile) -> Markup {
    let row = |choice: &ModelChoiceReport| {
        html! { tr {
            td { (joint_name(leg, choice.joint)) } td { (term(choice.option)) } td { (asked(choice.asked)) }
            td { (if choice.used == "on" { "yes" } else { "no" }) }
            td.n { (number(choice.gain_chi2)) } td.n { (exact(choice.limit_chi2)) } td.words { (choice.why) }
        } }
    };
    html! { @if !run.model_choice.is_empty() {
        section {
            h2 { "What the model includes" }
            p { "The leg file rules a term in or out, or leaves it to the data: then it is used if it explains at least as many \
                chi-square units as the limit." }
            div.wide { table.choices {
                thead { tr {
                    th scope="col" { "joint" } th scope="col" { "term" } th scope="col" { "leg file" } th scope="col" { "used" }
                    th.n scope="col" { "explains, chi-square units" } th.n scope="col" { "limit" } th scope="col" { "why" }
                } }
                tbody { @for choice in &run.model_choice { (row(choice)) } }
            } }
            @for found in &run.stribeck {
                p { "Stribeck friction of the " (joint_name(leg, found.joint)) ": static friction exceeds Coulomb friction by "
                    (measured(found.surplus_nm, found.surplus_sigma_nm)) " \u{b1} " (sigma(found.surplus_sigma_nm))
                    " N\u{a0}m; the excess falls to 1/e at " (measured(found.speed_rad_s, found.speed_sigma_rad_s)) " \u{b1} "
                    (sigma(found.speed_sigma_rad_s)) " rad/s. It explains " (number(found.gain_chi2)) " chi-square units." }
            }
            @for found in &run.asymmetric_coulomb {
                p { "Coulomb friction of the " (joint_name(leg, found.joint)) ": "
                    (measured(found.forward_nm, found.forward_sigma_nm)) " \u{b1} " (sigma(found.forward_sigma_nm))
                    " N\u{a0}m while the D-H angle grows, " (measured(found.backward_nm, found.backward_sigma_nm)) " \u{b1} "
                    (sigma(found.backward_sigma_nm)) " N\u{a0}m while it falls." }
            }
        }
    } }
}

fn term(option: &str) -> &str {
    match option {
        "rotor" => "rotor inertia",
        "offset" => "torque offset",
        "stribeck" => "Stribeck friction",
        "asymmetric_coulomb" => "Coulomb friction by direction",
        other => other,
    }
}

fn asked(choice: &str) -> &str {
    match choice {
        "auto" => "by the data",
        "on" => "always",
        "off" => "never",
        other => other,
    }
}

/// Outliers and disturbances of the motion identified from.
pub fn outliers(run: &RunReport, leg: &LegFile) -> Markup {
    let found = &run.outliers;
    let percent = |share: Option<&Number>| {
        number(Number(share.and_then(|share| share.known()).map(|share| 100.0 * share)))
    };
    html! {
        section {
            h2 { "Outliers and disturbances" }
            @if found.estimator == "plain" {
                p { "Plain least squares: no sample was replaced and no row set aside." }
            } @else {
                p { "Of " (found.samples) " samples of the motion identified from. Isolated outliers are replaced before the \
                    filter. Rows count as disturbed if the robust estimator gives them less than half of their weight. All joints \
                    were disturbed at once for at most " (number(found.longest_common_s)) " s." }
                div.wide { table.outliers {
                    thead { tr {
                        th scope="col" { "joint" } th.n scope="col" { "samples replaced" }
                        th.n scope="col" { "rows disturbed, %" } th.n scope="col" { "longest stretch, s" }
                    } }
                    tbody { @for (index, replaced) in found.replaced.iter().enumerate() { tr {
                        td { (joint_name(leg, index + 1)) } td.n { (replaced) }
                        td.n { (percent(found.disturbed_share.get(index))) }
                        td.n { (number(found.longest_s.get(index).copied().unwrap_or(Number::UNKNOWN))) }
                    } } }
                } }
            }
        }
    }
}

/// Comparison with a stored model; empty if none was given.
pub fn comparison(run: &RunReport) -> Markup {
    html! { @if let Some(compared) = &run.compared {
        section {
            h2 { "Compared with a stored model" }
            p { code { (compared.model) } " of " (compared.created) ": " (compared.line) ". Squared distance "
                (number(compared.chi2.into())) " chi-square units, limit " (number(compared.chi2_limit.into())) "." }
            @if let Some(warning) = &compared.warning { p { strong { "Warning: " } (warning) "." } }
            div.wide { table {
                thead { tr {
                    th scope="col" { "base parameter" } th.n scope="col" { "stored" } th.n scope="col" { "found" }
                    th.n scope="col" { "difference / sigma" }
                } }
                tbody { @for difference in &compared.differences { tr {
                    th scope="row" { (difference.name) } td.n { (number(difference.stored.into())) }
                    td.n { (number(difference.found.into())) } td.n { (crate::view::html::signed(difference.sigmas)) }
                } } }
            } }
            @if !compared.not_compared.is_empty() {
                p { "In one of the two only: " (compared.not_compared.join(", ")) "." }
            }
        }
    } }
}
