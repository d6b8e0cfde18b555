//! Page of a fault campaign: the table, failures, and curves of repeated runs.

use maud::{DOCTYPE, html};
use scarab_base::table::Table;

use crate::view::figures::Figure;
use crate::view::html::table::ToHtml;
use crate::view::html::{Circumstances, drawing, page_head};

/// Results of a campaign.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Campaign<'a> {
    /// Result in a few words.
    pub(crate) verdict: &'a str,
    /// Results of each row of the catalogue.
    pub(crate) table: &'a Table,
    /// Notes, a line each.
    pub(crate) notes: &'a str,
    /// Lines about repeated runs.
    pub(crate) runs: &'a [String],
    /// Curves of repeated runs.
    pub(crate) figures: &'a [Figure],
}

/// Creates the page.
pub(crate) fn page(circumstances: &Circumstances, campaign: &Campaign<'_>) -> String {
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
                        (campaign.table.to_html())
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
