//! Legs on a CANopen bus, simulated to the bit, for host software that exists.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`board`] | firmware and plant of a leg behind its nodes |
//! | [`wire`], [`network`] | arbitration and bits; several legs and a host on one wire |
//! | [`host`] | a host that moves a leg, and falls silent where it is told to |
//! | [`slcan`], [`server`] | the port at which host software speaks to it |
//! | [`adapter`], [`effect`] | the queue between port and wire; which of its frames may be carried out late |
//! | [`pace`] | the clock, and how far the simulation is behind it |
//! | [`memory`], [`storing`] | what a board remembers, and how it is changed |
//! | [`serve`] | all of it, at the pace of a clock |

pub mod adapter;
pub mod board;
pub mod effect;
pub mod host;
pub mod memory;
pub mod network;
pub mod pace;
pub mod serve;
pub mod server;
pub mod slcan;
pub mod storing;
pub mod wire;
