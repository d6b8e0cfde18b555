//! Page of a fault campaign: the table, failures, and curves of repeated runs.

use maud::{DOCTYPE, html};

use super::super::faults::report::CampaignReport;
use super::super::figures::Figure;
use super::{Circumstances, drawing, page_head};

/// Whether a cell holds a number, a share or two numbers, which stay on one line.
fn is_number(cell: &str) -> bool {
    cell.chars().all(|letter| letter.is_ascii_digit() || " -/.%".contains(letter))
}

/// Creates the page; `told` are lines about single runs.
#[must_use]
pub fn page(
    circumstances: &Circumstances,
    report: &CampaignReport,
    told: &[String],
    figures: &[Figure],
) -> String {
    let verdict = if report.is_good() { "nothing missed" } else { "failures" };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("Faults injected: {verdict}")))
            body {
                main {
                    header {
                        p.over { "Scarab \u{b7} fault campaign" }
                        h1 { (circumstances.leg.name) ": " (verdict) }
                        p.when { (circumstances.time_utc) " (UTC)" }
                    }
                    section {
                        h2 { "What was run" }
                        p { code { (circumstances.command) } }
                        div.wide { table.any {
                            thead { tr { @for name in report.head() { th scope="col" { (name) } } } }
                            tbody {
                                @for row in &report.rows {
                                    tr { @for cell in row.cells() { td.n[is_number(&cell)] { (cell) } } }
                                }
                            }
                        } }
                    }
                    section {
                        h2 { "Notes" }
                        @for line in report.notes().lines() { p { (line) } }
                    }
                    @if !told.is_empty() {
                        section {
                            h2 { "Runs" }
                            @for line in told { p { (line) } }
                            @for figure in figures { (drawing(figure)) }
                        }
                    }
                }
            }
        }
    };
    page.into_string()
}
