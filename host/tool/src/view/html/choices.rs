//! Sections on the model terms and why, and on excluded data.

use maud::{Markup, html};
use scarab_base::number::Number;
use scarab_base::table::{Table, cells};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::{ComparisonReport, RunReport};

use crate::view::html::table::ToHtml;
use crate::view::html::{exact, joint_name, measured, number, sigma, signed};

/// Terms of each joint's model, with identified Stribeck and directional friction.
pub(crate) fn model(run: &RunReport, leg: &LegFile) -> Markup {
    let mut terms = Table::with_class("choices")
        .text(["joint", "term", "leg file", "used"])
        .numbers(["explains, chi-square units", "limit"])
        .text(["why"])
        .styled("words");
    for choice in &run.model_choice {
        terms.row(cells![
            joint_name(leg, choice.joint),
            term(choice.option),
            asked(choice.asked),
            if choice.used == "on" { "yes" } else { "no" },
            number(choice.gain_chi2),
            exact(choice.limit_chi2),
            &choice.why,
        ]);
    }
    html! { @if !run.model_choice.is_empty() {
        section {
            h2 { "What the model includes" }
            p { "The leg file rules a term in or out, or leaves it to the data: then it is used if it explains at least as many \
                chi-square units as the limit; a spring or friction by load, if the misfit names it." }
            (terms.to_html())
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
        "spring" => "spring beside the drive",
        "load_friction" => "friction by load",
        other => other,
    }
}

fn asked(choice: &str) -> &str {
    match choice {
        "auto" => "by the data",
        "on" => "always",
        "within" => "always, known within a tolerance",
        "off" => "never",
        other => other,
    }
}

/// Outliers and disturbances of the motion identified from.
pub(crate) fn outliers(run: &RunReport, leg: &LegFile) -> Markup {
    let found = &run.outliers;
    let percent = |share: Option<&Number>| {
        number(Number(share.and_then(|share| share.known()).map(|share| 100.0 * share)))
    };
    let mut table = Table::with_class("outliers").text(["joint"]).numbers([
        "samples replaced",
        "rows disturbed, %",
        "longest stretch, s",
    ]);
    for (index, replaced) in found.replaced.iter().enumerate() {
        table.row(cells![
            joint_name(leg, index + 1),
            *replaced,
            percent(found.disturbed_share.get(index)),
            number(found.longest_s.get(index).copied().unwrap_or(Number::UNKNOWN)),
        ]);
    }
    html! {
        section {
            h2 { "Outliers and disturbances" }
            @if found.estimator == "plain" {
                p { "Plain least squares: no sample was replaced and no row excluded." }
            } @else {
                p { "Of " (found.samples) " samples of the motion identified from. Isolated outliers are replaced before the \
                    filter. Rows count as disturbed if the robust estimator gives them less than half of their weight. All joints \
                    were disturbed at once for at most " (number(found.longest_common_s)) " s." }
                (table.to_html())
            }
        }
    }
}

/// Comparison with a stored model; empty if none was given.
pub(crate) fn comparison(run: &RunReport) -> Markup {
    html! { @if let Some(compared) = &run.compared {
        section {
            h2 { "Compared with a stored model" }
            p { code { (compared.model) } " of " (compared.created) ": " (compared.line) ". Squared distance "
                (number(compared.chi2.into())) " chi-square units, limit " (number(compared.chi2_limit.into())) "." }
            @if let Some(warning) = &compared.warning { p { strong { "Warning: " } (warning) "." } }
            (differences(compared).to_html())
            @if !compared.not_compared.is_empty() {
                p { "In one of the two only: " (compared.not_compared.join(", ")) "." }
            }
        }
    } }
}

fn differences(compared: &ComparisonReport) -> Table {
    let mut table =
        Table::default().label("base parameter").numbers(["stored", "found", "difference / sigma"]);
    for difference in &compared.differences {
        table.row(cells![
            &difference.name,
            number(difference.stored.into()),
            number(difference.found.into()),
            signed(difference.sigmas),
        ]);
    }
    table
}
