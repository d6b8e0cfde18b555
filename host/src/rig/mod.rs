//! Firmware and simulated hardware put together, the bus included.

pub mod board;
pub mod bus;
pub mod faulty_board;
pub mod operator;
pub mod options;
pub mod pair;
pub mod perturb;
pub mod worn;
