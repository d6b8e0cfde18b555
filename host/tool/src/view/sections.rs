//! Result of an experiment as sections: a page shows them, and the terminal those of assistance.

use maud::{DOCTYPE, Markup, html};
use scarab_base::table::Table;

use crate::view::figures::Figure;
use crate::view::html::table::ToHtml;
use crate::view::html::{drawing, page_head};

/// Part of a result with a title.
#[derive(Clone, Debug, Default)]
pub(crate) struct Section {
    title: String,
    explanation: String,
    table: Table,
    lines: Vec<String>,
    figures: Vec<Figure>,
}

impl Section {
    /// An empty section.
    pub(crate) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    fn is_empty(&self) -> bool {
        self.explanation.is_empty()
            && self.table.is_empty()
            && self.lines.is_empty()
            && self.figures.is_empty()
    }

    /// Adds sentences that only a page shows.
    pub(crate) fn explained(mut self, explanation: impl Into<String>) -> Self {
        self.explanation = explanation.into();
        self
    }

    /// Adds a table.
    pub(crate) fn table(mut self, table: Table) -> Self {
        self.table = table;
        self
    }

    /// Adds lines below the table.
    pub(crate) fn lines(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        self.lines = lines.into_iter().collect();
        self
    }

    /// Adds figures, which only a page shows.
    pub(crate) fn figures<'a>(mut self, figures: impl IntoIterator<Item = &'a Figure>) -> Self {
        self.figures = figures.into_iter().cloned().collect();
        self
    }
}

/// Sections for the terminal.
pub(crate) fn text(sections: &[Section]) -> String {
    let shown = sections.iter().filter(|section| !section.table.is_empty() || !section.lines.is_empty());
    let section = |section: &Section| {
        let lines: String = section.lines.iter().map(|line| format!("{line}\n")).collect();
        let table = if section.table.is_empty() { String::new() } else { section.table.to_text() };
        format!("{}\n{table}{lines}", section.title)
    };
    shown.map(section).collect::<Vec<_>>().join("\n")
}

/// Head of a page.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Head<'a> {
    /// Kind of experiment.
    pub(crate) kind: &'a str,
    /// What was examined, and the result.
    pub(crate) title: &'a str,
    /// Time, UTC.
    pub(crate) time_utc: &'a str,
    /// Command line.
    pub(crate) command: Option<&'a str>,
    /// Lines about device or seeds.
    pub(crate) lines: &'a [String],
}

/// Sections as a page.
pub(crate) fn page(head: Head<'_>, sections: &[Section]) -> String {
    let Head { kind, title, time_utc, command, lines } = head;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("{kind}: {title}")))
            body {
                main {
                    header {
                        p.over { "Scarab \u{b7} " (kind) }
                        h1 { (title) }
                        p.when { (time_utc) " (UTC)" }
                        @if let Some(command) = command { p { code { (command) } } }
                        @for line in lines { p { (line) } }
                    }
                    @for section in sections.iter().filter(|section| !section.is_empty()) { (shown(section)) }
                }
            }
        }
    };
    page.into_string()
}

fn shown(section: &Section) -> Markup {
    html! {
        section {
            h2 { (section.title) }
            @if !section.explanation.is_empty() { p { (section.explanation) } }
            @if !section.table.is_empty() { (section.table.to_html()) }
            @for line in &section.lines { p { (line) } }
            @for figure in &section.figures { (drawing(figure)) }
        }
    }
}
