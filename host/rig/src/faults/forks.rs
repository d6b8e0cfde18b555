//! Rows that are forks of an identification with complete drives: how their faults are drawn.

pub mod board;
pub mod current;
pub mod encoder;
pub mod joint;
pub mod memory;
pub mod model;
pub mod number;
pub mod stop;
pub mod supply;
pub mod timing;
pub mod wearer;

use crate::faults::scenario::Row;

/// All rows, in the catalogue's order.
pub fn rows() -> impl Iterator<Item = &'static Row> {
    let groups: [&'static [Row]; 11] = [
        &encoder::ROWS,
        &current::ROWS,
        &model::ROWS,
        &board::ROWS,
        &supply::ROWS,
        &number::ROWS,
        &stop::ROWS,
        &timing::ROWS,
        &memory::ROWS,
        &joint::ROWS,
        &wearer::ROWS,
    ];
    groups.into_iter().flatten()
}
