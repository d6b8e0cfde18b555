//! Page of many runs of one leg: verdicts, distribution of parameters about the truth, margins of
//! the tests.

use crate::view::spread::Spread;
use maud::{DOCTYPE, Markup, html};
use scarab_base::error::ToolError;
use scarab_base::table::{Table, cells};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::findings::FindingReport;

use crate::view::figures::Figure;
use crate::view::html::table::ToHtml;
use crate::view::html::{
    Circumstances, count, drawing, head, joint_name, measured, number, page_head, sigma, signed, verdict,
};

/// Creates the page of runs that differ in their seed.
pub(crate) fn page(
    circumstances: &Circumstances,
    runs: &[RunReport],
    spreads: &[Spread],
    figure: &Figure,
) -> Result<String, ToolError> {
    let [first, ..] = runs else { return Err(ToolError::input("no run to report")) };
    let findings: Vec<FindingReport> = runs.iter().flat_map(|run| run.findings.clone()).collect();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("{} of {}", count(runs.len(), "run"), first.leg)))
            body {
                main {
                    header {
                        p.over { "Scarab \u{b7} identification report \u{b7} " (count(runs.len(), "simulated run")) }
                        h1 { (first.leg) }
                        p.when { (circumstances.time_utc) " (UTC)" }
                    }
                    (verdicts(runs))
                    section {
                        h2 { "What was run" }
                        dl.facts {
                            div { dt { "Noise seeds" } dd { (seeds(runs)) } }
                            div { dt { "Prior" } dd { (head::prior(&first.prior)) } }
                            div { dt { "Plan" } dd { (first.plan) } }
                            @if let Some(drive) = first.drive { div { dt { "Drive" } dd { (head::drive(drive)) } } }
                            div.command { dt { "Command" } dd { code { (circumstances.command) } } }
                        }
                    }
                    section { h2 { "Parameters" } (parameters(spreads)) (drawing(figure)) }
                    section { h2 { "Torque on unused motions" } (torque(runs, &circumstances.leg)) }
                    (verdict::tests(&findings, &circumstances.leg))
                    footer { p { "Made by Scarab " (env!("CARGO_PKG_VERSION")) ". Values are SI; sigma is one standard deviation, of \
                        the torque's noise alone." } }
                }
            }
        }
    };
    Ok(page.into_string())
}

fn seeds(runs: &[RunReport]) -> String {
    let all = || runs.iter().filter_map(|run| run.seed);
    match (all().min(), all().max()) {
        (Some(first), Some(last)) => format!("{first} to {last}"),
        _ => "\u{2013}".into(),
    }
}

/// Number of accepted runs, and the reasons of the rejected ones.
fn verdicts(runs: &[RunReport]) -> Markup {
    let accepted = runs.iter().filter(|run| run.accepted()).count();
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for run in runs {
        for reason in &run.reasons {
            let seed = run.seed.map_or_else(String::new, |seed| seed.to_string());
            match reasons.iter_mut().find(|(name, _)| name == reason) {
                Some((_, seeds)) => seeds.push(seed),
                None => reasons.push((reason, vec![seed])),
            }
        }
    }
    let all = accepted == runs.len();
    html! {
        section.verdict.accepted[all].refused[!all] {
            p.word { (accepted) " of " (runs.len()) " accepted" }
            @if !reasons.is_empty() { ul { @for (reason, seeds) in &reasons {
                li {
                    strong { (reason.replace('_', " ")) } ": " (count(seeds.len(), "run")) ", seed"
                    @if seeds.len() > 1 { "s" } " " (seeds.iter().take(SEEDS_SHOWN).cloned().collect::<Vec<_>>().join(", "))
                    @if seeds.len() > SEEDS_SHOWN { " .." }
                }
            } } }
        }
    }
}

/// Limit of the seeds listed for one reason.
const SEEDS_SHOWN: usize = 20;

fn parameters(spreads: &[Spread]) -> Markup {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let mut table = Table::with_class("spread").label("name").numbers(["truth", "sigma"]).unit().numbers([
        "mean",
        "spread",
        "within 1",
        "within 3",
        "rms error / Cram\u{e9}r-Rao",
        "runs",
    ]);
    for spread in spreads {
        table.row(cells![
            &spread.name,
            measured(spread.truth.into(), spread.sigma.into()),
            sigma(spread.sigma.into()),
            spread.unit,
            signed(spread.mean()),
            format!("{:.2}", spread.deviation()),
            percent(spread.within(1.0)),
            percent(spread.within(3.0)),
            spread.over_bound.map_or("\u{2013}".into(), |ratio| format!("{ratio:.2}")),
            spread.errors.len(),
        ]);
    }
    html! {
        p { "Each error is in units of the sigma that its own run reported. Where sigma is what it claims to be the mean is \
            near 0, the spread near 1, and 68 and 99.7 % lie within one and three." }
        (table.to_html())
    }
}

/// Median and worst error of each joint on each motion, against the noise-free torque.
fn torque(runs: &[RunReport], leg: &LegFile) -> Markup {
    let mut cases: Vec<(&str, usize)> = Vec::new();
    for fit in runs.iter().flat_map(|run| &run.validation) {
        if !cases.contains(&(fit.motion.as_str(), fit.joint)) {
            cases.push((&fit.motion, fit.joint));
        }
    }
    let errors = |(motion, joint): (&str, usize)| -> Vec<f64> {
        let fits = runs.iter().flat_map(|run| &run.validation);
        let own = fits.filter(|fit| fit.motion == motion && fit.joint == joint);
        let mut errors: Vec<f64> = own.filter_map(|fit| fit.percent_of_mean_abs_vs_truth.known()).collect();
        errors.sort_by(f64::total_cmp);
        errors
    };
    let mut table = Table::default().label("motion").text(["joint"]).numbers(["median", "worst"]);
    for case in cases {
        let errors = errors(case);
        table.row(cells![
            case.0,
            joint_name(leg, case.1),
            number(errors.get(errors.len() / 2).copied().into()),
            number(errors.last().copied().into()),
        ]);
    }
    html! {
        p { "Error of the filtered torque against the noise-free one, percent of the motion's mean absolute torque." }
        (table.to_html())
    }
}
