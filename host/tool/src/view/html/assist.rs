//! Page of compensation and assistance.

use maud::{DOCTYPE, Markup, html};
use scarab_rig::report::assist::AssistReport;

use crate::view::assist::{notes, periodic, rows, shares, wearer_sums};
use crate::view::figures::{Figure, Group};
use crate::view::html::table::ToHtml;
use crate::view::html::{Circumstances, drawing, page_head};

/// Creates the page.
#[must_use]
pub fn page(circumstances: &Circumstances, report: &AssistReport, figures: &[Figure]) -> String {
    let failures = report.failures();
    let is_good = failures.is_empty();
    let verdict = if is_good { "no limit exceeded".to_owned() } else { failures.join(", ") };
    let group = |group: Group| -> Markup {
        html! { @for figure in figures.iter().filter(|figure| figure.group == group) { (drawing(figure)) } }
    };
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
                        section {
                            h2 { "Torques" }
                            p {
                                "Interaction torque is what the cuffs exert on the exoskeleton's joints, measured in the \
                                 simulation. All columns have the same motion of the wearer's leg. N m rms over all seeds."
                            }
                            (rows(report).to_html())
                            (group(Group::Summary))
                            (group(Group::Torque))
                        }
                    }
                    @if !report.periodic.is_empty() {
                        section {
                            h2 { "Periodic motion" }
                            p {
                                "The oscillators are locked while their phase errs by less than 5 % of a cycle. Effort is \
                                 the rms torque of both muscles in a cycle, without the three cycles in which they may \
                                 lock. Energy counts from the second cycle after a walking wearer is limp or resists. \
                                 The worst of all seeds, the mean for the effort."
                            }
                            (periodic(report).to_html())
                        }
                    }
                    @if !report.wearer_sums.is_empty() {
                        section {
                            h2 { "The wearer's leg" }
                            p {
                                "Difference of the models `worn` and `empty`. Torque determines these sums; a mass needs \
                                 an assumption besides."
                            }
                            (wearer_sums(report).to_html())
                        }
                    }
                    section {
                        h2 { "Stability" }
                        p {
                            "Share of the exoskeleton's inertia below which small vibrations on the cuffs decay. The \
                             acceleration is known late, which feeds slow vibrations; its lead feeds fast ones. \
                             The cuffs' damping takes the energy away. Largest share over five knee angles from 10 to 90 degrees, with "
                            (format!("{:.0}", 100.0 * report.stability.friction_share))
                            " % of viscous friction compensated."
                        }
                        (group(Group::Search))
                    }
                    section {
                        h2 { "Limits of these results" }
                        p {
                            "Simulated legs and wearers, off the ground: swinging, seated or hanging. No force is measured \
                             at the cuffs. Before a person wears the leg, every mode is tried on hardware with a dummy \
                             (docs)."
                        }
                    }
                }
            }
        }
    };
    page.into_string()
}
