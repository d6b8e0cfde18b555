//! Page of compensation and assistance.

use maud::{DOCTYPE, Markup, html};
use scarab_rig::report::assist::AssistReport;

use crate::view::assist::{notes, periodic, rows, shares, wearer_sums};
use crate::view::figures::{Figure, Group};
use crate::view::html::table::ToHtml;
use crate::view::html::{Circumstances, drawing, page_head};

const TORQUES: &str = "Interaction torque is what the cuffs exert on the exoskeleton's joints, measured in the \
    simulation. All columns have the same motion of the wearer's leg. N m rms over all seeds.";
const PERIODIC_MOTION: &str = "The oscillators are locked while their phase errs by less than 5 % of a cycle. Effort is \
    the rms torque of both muscles in a cycle, without the three cycles in which they may \
    lock. Energy counts from the second cycle after a walking wearer is limp or resists. \
    The worst of all seeds, the mean for the effort.";
const WEARER_SUMS: &str = "Difference of the models `worn` and `empty`. Torque determines these sums; a mass needs \
    an assumption besides.";
/// Sentences about stability, up to the share of compensated friction.
const STABILITY: &str = "Share of the exoskeleton's inertia below which small vibrations on the cuffs decay. The \
    acceleration is known late, which feeds slow vibrations; its lead feeds fast ones. \
    The cuffs' damping takes the energy away. Largest share over five knee angles from 10 to 90 degrees, with ";
const LIMITS: &str = "Simulated legs and wearers, off the ground: swinging, seated or hanging. No force is measured \
    at the cuffs. No person may wear the leg; on hardware every mode is to be tried with a dummy leg \
    (docs/assist.md).";

/// Section of the page: its title, its sentences, and its tables and figures.
fn section(title: &str, words: &str, shown: &Markup) -> Markup {
    html! { section { h2 { (title) } p { (words) } (shown) } }
}

/// Creates the page.
pub(crate) fn page(circumstances: &Circumstances, report: &AssistReport, figures: &[Figure]) -> String {
    let failures = report.failures();
    let is_good = failures.is_empty();
    let verdict = if is_good { "no limit exceeded".to_owned() } else { failures.join(", ") };
    let group = |group: Group| -> Markup {
        html! { @for figure in figures.iter().filter(|figure| figure.group == group) { (drawing(figure)) } }
    };
    let stability = format!(
        "{STABILITY}{:.0} % of viscous friction compensated.",
        100.0 * report.stability.friction_share
    );
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("Assistance of {}: {verdict}", report.leg)))
            body {
                main {
                    header {
                        p.over { "Scarab \u{b7} the identified model at work" }
                        h1 { (report.leg) ": " (verdict) }
                        p.when { (circumstances.time_utc) " (UTC)" }
                    }
                    section {
                        h2 { "What was run" }
                        p { code { (circumstances.command) } }
                        p { "Seeds " (report.seeds[0]) " to " (report.seeds[1]) ". Shares of the models' torques:" }
                        (shares(report).to_html())
                        @for note in notes(report) { p { (note) } }
                    }
                    @if !report.rows.is_empty() {
                        (section("Torques", TORQUES, &html! {
                            (rows(report).to_html()) (group(Group::Summary)) (group(Group::Torque))
                        }))
                    }
                    @if !report.periodic.is_empty() {
                        (section("Periodic motion", PERIODIC_MOTION, &periodic(report).to_html()))
                    }
                    @if !report.wearer_sums.is_empty() {
                        (section("The wearer's leg", WEARER_SUMS, &wearer_sums(report).to_html()))
                    }
                    (section("Stability", &stability, &group(Group::Search)))
                    (section("Limits of these results", LIMITS, &html! {}))
                }
            }
        }
    };
    page.into_string()
}
