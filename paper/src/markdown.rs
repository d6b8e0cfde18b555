//! Markdown tables with aligned columns, readable in a terminal and in a document.

use core::fmt;

use scarab_host::base::number::{self, Number};

/// Table with a left-aligned first column; the others are right-aligned.
#[derive(Clone, Debug)]
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Creates a table with a header row.
    #[must_use]
    pub fn new(heads: &[&str]) -> Self {
        Self { rows: vec![heads.iter().map(|&head| head.to_owned()).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl fmt::Display for Table {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = self.rows.first().map_or(0, Vec::len);
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0).max(3)
        };
        let widths: Vec<_> = (0..columns).map(width).collect();
        for (index, row) in self.rows.iter().enumerate() {
            for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                match column {
                    0 => write!(out, "| {cell:<width$} ")?,
                    _ => write!(out, "| {cell:>width$} ")?,
                }
            }
            writeln!(out, "|")?;
            if index == 0 {
                for (column, &width) in widths.iter().enumerate() {
                    match column {
                        0 => write!(out, "| {} ", "-".repeat(width))?,
                        _ => write!(out, "| {}: ", "-".repeat(width - 1))?,
                    }
                }
                writeln!(out, "|")?;
            }
        }
        Ok(())
    }
}

/// Formats a number with four digits; a dash if unknown.
#[must_use]
pub fn number(value: Number) -> String {
    match value.known() {
        Some(value) if value != 0.0 && value.abs() < 1e-3 => format!("{value:.1e}"),
        _ => number::number(value),
    }
}

/// Formats a percentage: two decimals below ten, fewer above; a dash if unknown.
#[must_use]
pub fn percent(value: Option<f64>) -> String {
    match value {
        None => "-".into(),
        Some(value) if value.abs() < 9.995 => format!("{value:.2}"),
        Some(value) if value.abs() < 99.95 => format!("{value:.1}"),
        Some(value) => format!("{value:.0}"),
    }
}
