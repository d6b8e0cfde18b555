//! The firmware's library: whole legs in simulated hardware, identification on synthetic motion, storage,
//! registers of the board, tables of the swarm. One program, so that the library and the host crates are
//! linked once.

mod board_registers;
mod bus;
mod complete_drive;
mod floor;
mod held_out;
mod holding_brake;
mod identification;
mod model_reference;
mod planar_leg;
mod store;
mod swarm_document;
mod swarm_invariance;
mod swarm_tables;
#[path = "../../src/testing.rs"]
mod testing;
mod whole_leg;
