//! Rows that are forks of an identification with complete drives: how their faults are drawn.

pub mod board;
pub(crate) mod current;
pub(crate) mod encoder;
pub mod joint;
pub mod memory;
pub(crate) mod model;
pub(crate) mod number;
pub(crate) mod stop;
pub(crate) mod supply;
pub(crate) mod timing;
pub mod wearer;

use crate::faults::catalogue;
use crate::faults::scenario::Row;

/// All rows, in the catalogue's order.
pub(crate) static ROWS: [Row; 21] = [
    Row { fault: &catalogue::E2, draw: encoder::glitch },
    Row { fault: &catalogue::E4, draw: encoder::lost_counts },
    Row { fault: &catalogue::C2, draw: current::rail },
    Row { fault: &catalogue::C3, draw: current::conversion },
    Row { fault: &catalogue::C4, draw: current::overcurrent },
    Row { fault: &catalogue::E1, draw: model::frozen },
    Row { fault: &catalogue::C1, draw: model::drift },
    Row { fault: &catalogue::P1, draw: model::open_phase },
    Row { fault: &catalogue::P2, draw: board::registers },
    Row { fault: &catalogue::T1, draw: board::temperature },
    Row { fault: &catalogue::V1, draw: supply::overvoltage },
    Row { fault: &catalogue::V2, draw: supply::undervoltage },
    Row { fault: &catalogue::N1, draw: number::not_finite },
    Row { fault: &catalogue::X1, draw: stop::emergency_stop },
    Row { fault: &catalogue::X2, draw: stop::bouncing_stop },
    Row { fault: &catalogue::K1, draw: timing::late_ticks },
    Row { fault: &catalogue::K3, draw: timing::hang },
    Row { fault: &catalogue::M2, draw: memory::upset },
    Row { fault: &catalogue::J1, draw: joint::pushed },
    Row { fault: &catalogue::J2, draw: joint::overspeed },
    Row { fault: &catalogue::H1, draw: wearer::held },
];
