//! Tables of plain text.

use comfy_table::{CellAlignment, ColumnConstraint, Table, presets};

/// Empty table without frames.
#[must_use]
pub fn headed(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.to_vec());
    table
}

/// Formats a table without the columns that are unknown, one line per row.
pub fn text(mut table: Table, unknown: &[usize]) -> String {
    for &index in unknown {
        if let Some(column) = table.column_mut(index) {
            column.set_constraint(ColumnConstraint::Hidden);
        }
    }
    table.trim_fmt() + "\n"
}

/// Aligns these columns to the right.
pub fn align_numbers(table: &mut Table, columns: impl IntoIterator<Item = usize>) {
    for index in columns {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}
