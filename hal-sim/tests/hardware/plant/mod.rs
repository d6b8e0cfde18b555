//! Simulated hardware against textbook formulas.

pub mod common;
mod complete_drive;
mod end_stop;
mod friction;
mod integration;
mod mechanism;
mod wearer;
mod world;
