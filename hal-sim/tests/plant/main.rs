//! Simulated hardware against the textbook.

mod common;
mod complete_drive;
mod friction;
mod integration;
mod mechanism;
mod world;
