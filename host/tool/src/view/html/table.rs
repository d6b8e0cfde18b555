//! Tables as HTML.

use maud::{Markup, PreEscaped, Render, html};
use scarab_base::table::{Cell, Kind, Table, typeset};

/// A table that a page shows.
pub(crate) trait ToHtml {
    /// Renders the table; without a header if all heads are empty.
    fn to_html(&self) -> Markup;
}

impl ToHtml for Table {
    fn to_html(&self) -> Markup {
        html! {
            div.wide { table class=[self.class] {
                @if self.shown().any(|column| !column.head.is_empty()) {
                    thead { tr { @for column in self.shown() {
                        th class=[(column.kind == Kind::Number).then_some("n")] scope="col" { (column.head) }
                    } } }
                }
                tbody { @for (row, cells) in self.shown_rows() {
                    tr class=[row.is_failed.then_some("failed")] { @for (column, cell) in cells {
                        @if column.kind == Kind::Label { th scope="row" { (content(column.kind, cell)) } }
                        @else { td class=[column.class] { (content(column.kind, cell)) } }
                    } }
                } }
            } }
        }
    }
}

/// Cell that only a page shows.
pub(crate) fn html_cell(markup: Markup) -> Cell {
    Cell::Html(String::new(), markup.into_string())
}

fn content(kind: Kind, cell: &Cell) -> Markup {
    match (kind, cell) {
        (_, Cell::Html(_, html)) => PreEscaped(html.clone()),
        (Kind::Number, Cell::Text(text)) | (_, Cell::Typeset(text)) => typeset(text).render(),
        (Kind::Unit, Cell::Text(text)) => text.replace("m2", "m\u{b2}").replace(' ', "\u{a0}").render(),
        (_, Cell::Text(text)) => text.render(),
    }
}

#[cfg(test)]
mod tests {
    use scarab_base::table::cells;

    use super::*;

    #[test]
    fn numbers_units_and_marked_rows_are_typeset_and_text_is_escaped() {
        let mut table = Table::with_class("c")
            .label("name")
            .numbers(["value"])
            .numbers_if(false, ["hidden"])
            .unit()
            .text(["bar"])
            .html_only()
            .text(["why"])
            .styled("words");
        table.row(cells!["a<b", "-1.5", "x", "kg m2", html_cell(html! { b { "!" } }), ""]);
        table.marked_row(true, cells!["\u{817f}", 20_u32, "x", "N m", html_cell(html! {}), "so-so"]);
        assert_eq!(
            table.to_html().into_string(),
            "<div class=\"wide\"><table class=\"c\"><thead><tr><th scope=\"col\">name</th>\
             <th class=\"n\" scope=\"col\">value</th><th scope=\"col\">unit</th><th scope=\"col\">bar</th>\
             <th scope=\"col\">why</th></tr></thead><tbody><tr><th scope=\"row\">a&lt;b</th>\
             <td class=\"n\">\u{2212}1.5</td><td>kg\u{a0}m\u{b2}</td><td><b>!</b></td><td class=\"words\"></td></tr>\
             <tr class=\"failed\"><th scope=\"row\">\u{817f}</th><td class=\"n\">20</td><td>N\u{a0}m</td><td></td>\
             <td class=\"words\">so-so</td></tr></tbody></table></div>"
        );
    }

    #[test]
    fn a_table_without_heads_has_no_header() {
        let mut table = Table::default().label("").text([""]);
        table.row(["key", "value"]);
        assert!(!table.to_html().into_string().contains("thead"));
    }
}
