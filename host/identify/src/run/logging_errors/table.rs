//! Rows of equal width, one after the other in memory.

use core::ops::{Index, IndexMut};
use core::slice::{ChunksExact, ChunksExactMut};

/// Rows of equal width.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    width: usize,
    elements: Vec<f64>,
}

impl Table {
    /// Table without rows.
    pub(crate) fn new(width: usize) -> Self {
        Self { width, elements: Vec::new() }
    }

    /// Table of zeros.
    pub(crate) fn zeros(rows: usize, width: usize) -> Self {
        Self { width, elements: vec![0.0; rows * width] }
    }

    /// Copies rows of this width.
    pub(crate) fn of_rows<R: AsRef<[f64]>>(width: usize, rows: impl IntoIterator<Item = R>) -> Self {
        let mut table = Self::new(width);
        rows.into_iter().for_each(|row| table.push(row.as_ref()));
        table
    }

    /// Rows of columns; ends with the shortest.
    pub(crate) fn of_columns<'a>(columns: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let columns: Vec<&[f64]> = columns.into_iter().collect();
        let rows = columns.iter().map(|column| column.len()).min().unwrap_or(0);
        Self::of_rows(
            columns.len(),
            (0..rows).map(|row| columns.iter().map(|column| column[row]).collect::<Vec<_>>()),
        )
    }

    /// Appends a row of at least this width; a longer one is cut.
    pub(crate) fn push(&mut self, row: &[f64]) {
        self.elements.extend_from_slice(&row[..self.width]);
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.elements.len() / self.width.max(1)
    }

    /// All rows in order.
    pub(crate) fn rows(&self) -> ChunksExact<'_, f64> {
        self.elements.chunks_exact(self.width.max(1))
    }

    /// All rows in order, to be changed.
    pub(crate) fn rows_mut(&mut self) -> ChunksExactMut<'_, f64> {
        self.elements.chunks_exact_mut(self.width.max(1))
    }

    /// All elements, row by row.
    pub(crate) fn elements(&self) -> impl Iterator<Item = f64> + '_ {
        self.elements.iter().copied()
    }

    /// All elements, row by row, to be changed.
    pub(crate) fn elements_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.elements.iter_mut()
    }

    /// Elements of a column, from the first row to the last.
    pub(crate) fn column(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        self.rows().map(move |row| row[column])
    }

    /// Product with a column vector.
    pub(crate) fn times(&self, vector: &[f64]) -> Vec<f64> {
        self.rows().map(|row| scarab::real::dot(row, vector)).collect()
    }
}

impl Index<usize> for Table {
    type Output = [f64];

    fn index(&self, row: usize) -> &[f64] {
        &self.elements[row * self.width..(row + 1) * self.width]
    }
}

impl IndexMut<usize> for Table {
    fn index_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.elements[row * self.width..(row + 1) * self.width]
    }
}
