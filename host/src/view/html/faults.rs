//! Page of a fault campaign: the table, failures, and curves of repeated runs.

use maud::{DOCTYPE, html};

use crate::view::figures::Figure;
use crate::view::html::{Circumstances, drawing, page_head};

/// Whether a cell holds a number, a share or two numbers, which stay on one line.
fn is_number(cell: &str) -> bool {
    cell.chars().all(|letter| letter.is_ascii_digit() || " -/.%".contains(letter))
}

/// Results of a campaign.
#[derive(Clone, Copy, Debug)]
pub struct Campaign<'a> {
    /// Result in a few words.
    pub verdict: &'a str,
    /// Names of the table's columns.
    pub head: &'a [&'static str],
    /// Cells of the table's rows.
    pub rows: &'a [Vec<String>],
    /// Notes, a line each.
    pub notes: &'a str,
    /// Lines about repeated runs.
    pub runs: &'a [String],
    /// Curves of repeated runs.
    pub figures: &'a [Figure],
}

/// Creates the page.
#[must_use]
pub fn page(circumstances: &Circumstances, campaign: &Campaign<'_>) -> String {
    let verdict = campaign.verdict;
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
                            thead { tr { @for name in campaign.head { th scope="col" { (name) } } } }
                            tbody {
                                @for row in campaign.rows {
                                    tr { @for cell in row { td.n[is_number(cell)] { (cell) } } }
                                }
                            }
                        } }
                    }
                    section {
                        h2 { "Notes" }
                        @for line in campaign.notes.lines() { p { (line) } }
                    }
                    @if !campaign.runs.is_empty() {
                        section {
                            h2 { "Runs" }
                            @for line in campaign.runs { p { (line) } }
                            @for figure in campaign.figures { (drawing(figure)) }
                        }
                    }
                }
            }
        }
    };
    page.into_string()
}
