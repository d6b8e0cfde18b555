//! Tables, rendered as plain text and Markdown here, and as HTML by the tool's pages.
//!
//! A column states once what its cells are and whether it is shown; a row gives one cell per column. Cells
//! are plain text; HTML typesets minus signs and units.

use unicode_width::UnicodeWidthStr;

/// Least width of a Markdown column: its rule needs three characters.
const LEAST_RULE: usize = 3;

/// Content of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Name of the row.
    Label,
    /// Words.
    Text,
    /// Aligned to the right.
    Number,
    /// Unit of the numbers beside it.
    Unit,
}

/// Column of a table.
#[derive(Clone, Debug)]
pub struct Column {
    /// Text of the header.
    pub head: String,
    /// Content of the cells.
    pub kind: Kind,
    /// Style of the cells in HTML.
    pub class: Option<&'static str>,
    is_shown: bool,
    is_html_only: bool,
}

/// Cell of a table.
#[derive(Clone, Debug)]
pub enum Cell {
    /// Words or a number.
    Text(String),
    /// Words with numbers, whose minus signs HTML typesets.
    Typeset(String),
    /// Words, and the HTML that a page shows instead.
    Html(String, String),
}

impl Cell {
    fn text(&self) -> &str {
        match self {
            Self::Text(text) | Self::Typeset(text) | Self::Html(text, _) => text,
        }
    }
}

macro_rules! plain_cells {
    ($($type:ty),*) => {$(
        impl From<$type> for Cell {
            fn from(value: $type) -> Self {
                Self::Text(value.to_string())
            }
        }
    )*};
}
plain_cells!(String, &String, &str, usize, u32, u64);

/// Cells of one row, each of its own type.
#[macro_export]
macro_rules! cells {
    ($($cell:expr),* $(,)?) => { [$($crate::table::Cell::from($cell)),*] };
}
pub use cells;

/// Row of a table.
#[derive(Clone, Debug)]
pub struct Row {
    /// Whether a page marks the row.
    pub is_failed: bool,
    cells: Vec<Cell>,
}

/// A table; see the module.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Style in HTML.
    pub class: Option<&'static str>,
    columns: Vec<Column>,
    rows: Vec<Row>,
}

impl Table {
    /// Table with a style in HTML.
    pub fn with_class(class: &'static str) -> Self {
        Self { class: Some(class), ..Self::default() }
    }

    fn columns<H: Into<String>>(mut self, kind: Kind, heads: impl IntoIterator<Item = H>) -> Self {
        let class = (kind == Kind::Number).then_some("n");
        let column = |head: H| Column { head: head.into(), kind, class, is_shown: true, is_html_only: false };
        self.columns.extend(heads.into_iter().map(column));
        self
    }

    /// Adds a column with the names of the rows.
    pub fn label(self, head: impl Into<String>) -> Self {
        self.columns(Kind::Label, [head])
    }

    /// Adds columns of words.
    pub fn text(self, heads: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.columns(Kind::Text, heads)
    }

    /// Adds columns of numbers.
    pub fn numbers(self, heads: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.columns(Kind::Number, heads)
    }

    /// Adds columns of numbers that are shown under a condition; rows have their cells in any case.
    pub fn numbers_if(mut self, is_shown: bool, heads: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let before = self.columns.len();
        self = self.numbers(heads);
        self.columns[before..].iter_mut().for_each(|column| column.is_shown = is_shown);
        self
    }

    /// Adds a column of units.
    pub fn unit(self) -> Self {
        self.columns(Kind::Unit, ["unit"])
    }

    /// Shows the last column in HTML only.
    pub fn html_only(mut self) -> Self {
        if let Some(column) = self.columns.last_mut() {
            column.is_html_only = true;
        }
        self
    }

    /// Style of the last column's cells in HTML.
    pub fn styled(mut self, class: &'static str) -> Self {
        if let Some(column) = self.columns.last_mut() {
            column.class = Some(class);
        }
        self
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<Cell>>) {
        self.marked_row(false, cells);
    }

    /// Adds a row that HTML marks if it failed.
    pub fn marked_row(&mut self, is_failed: bool, cells: impl IntoIterator<Item = impl Into<Cell>>) {
        self.rows.push(Row { is_failed, cells: cells.into_iter().map(Into::into).collect() });
    }

    /// Whether the table has no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Renders plain text: the header, then one line per row.
    pub fn to_text(&self) -> String {
        let columns = self.widths(0);
        let mut text = String::new();
        for cells in self.lines() {
            let padded =
                cells.iter().zip(&columns).map(|(cell, column)| format!(" {} ", padded(cell, *column)));
            text += padded.collect::<String>().trim_end();
            text.push('\n');
        }
        text
    }

    /// Renders Markdown with aligned columns, which a terminal shows well too.
    pub fn to_markdown(&self) -> String {
        let columns = self.widths(LEAST_RULE);
        let rule = |(kind, width): &(Kind, usize)| match kind {
            Kind::Number => format!("{}:", "-".repeat(width - 1)),
            _ => "-".repeat(*width),
        };
        let rules: Vec<String> = columns.iter().map(rule).collect();
        let mut lines = self.lines();
        lines.insert(1, rules.iter().map(String::as_str).collect());
        let line = |cells: Vec<&str>| {
            let padded =
                cells.iter().zip(&columns).map(|(cell, column)| format!("| {} ", padded(cell, *column)));
            padded.collect::<String>() + "|\n"
        };
        lines.into_iter().map(line).collect()
    }

    /// Columns that a page shows.
    pub fn shown(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().filter(|column| column.is_shown)
    }

    /// Rows with their cells in the columns that a page shows.
    pub fn shown_rows(&self) -> impl Iterator<Item = (&Row, Vec<(&Column, &Cell)>)> {
        self.rows.iter().map(|row| {
            (row, self.columns.iter().zip(&row.cells).filter(|(column, _)| column.is_shown).collect())
        })
    }

    /// Columns of a text, with their places.
    fn of_text(&self) -> impl Iterator<Item = (usize, &Column)> {
        self.columns.iter().enumerate().filter(|(_, column)| column.is_shown && !column.is_html_only)
    }

    /// Texts of header and rows; a missing cell is empty.
    fn lines(&self) -> Vec<Vec<&str>> {
        let heads = self.of_text().map(|(_, column)| column.head.as_str()).collect();
        let cells = |row| self.of_text().map(|(index, _)| cell(row, index)).collect();
        core::iter::once(heads).chain(self.rows.iter().map(cells)).collect()
    }

    /// Kind and width of each column of a text.
    fn widths(&self, least: usize) -> Vec<(Kind, usize)> {
        let width = |(index, column): (usize, &Column)| {
            let cells = self.rows.iter().map(|row| cell(row, index).width());
            (column.kind, cells.fold(column.head.width().max(least), usize::max))
        };
        self.of_text().map(width).collect()
    }
}

fn cell(row: &Row, index: usize) -> &str {
    row.cells.get(index).map_or("", Cell::text)
}

/// Fills a cell up to the width of its column.
fn padded(cell: &str, (kind, width): (Kind, usize)) -> String {
    let space = " ".repeat(width.saturating_sub(cell.width()));
    if kind == Kind::Number { space + cell } else { cell.to_owned() + &space }
}

/// Gives digits a true minus sign; an unknown number becomes a dash.
pub fn typeset(digits: &str) -> String {
    match digits {
        "-" => "\u{2013}".into(),
        known => known.replace('-', "\u{2212}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::default()
            .label("name")
            .numbers(["value"])
            .numbers_if(false, ["hidden"])
            .unit()
            .text(["bar"])
            .html_only()
            .text(["why"])
            .styled("words");
        table.row(cells!["a<b", "-1.5", "x", "kg m2", "!", ""]);
        table.row(cells!["\u{817f}", 20_u32, "x", "N m", "", "so-so"]);
        table
    }

    #[test]
    fn one_table_is_rendered_as_text_and_markdown() {
        assert_eq!(
            table().to_text(),
            " name  value  unit   why\n a<b    -1.5  kg m2\n \u{817f}       20  N m    so-so\n"
        );
        assert_eq!(
            table().to_markdown(),
            "| name | value | unit  | why   |\n| ---- | ----: | ----- | ----- |\n| a<b  |  -1.5 | kg m2 |       |\n\
             | \u{817f}   |    20 | N m   | so-so |\n"
        );
    }
}
