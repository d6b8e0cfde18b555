//! Scarab: firmware of an exoskeleton leg's joint drive board that identifies the leg it moves.
//!
//! All code is `no_std` and without heap. The same crate runs on the board and, against the simulated
//! hardware of `hal-sim`, on the host.
//!
//! | module | content |
//! | --- | --- |
//! | [`real`], [`units`] | the only access to `libm`; unit newtypes |
//! | [`hal`] | the ports a board provides |
//! | [`model`] | serial chain, Newton-Euler, regressor, friction, base parameters |
//! | [`motion`] | Fourier excitation, gait, ramps, and the proof that they stay within limits |
//! | [`swarm`] | beetle antennae search, particle swarm, beetle swarm |
//! | [`ident`] | filter chain, information factor, least squares, statistics, verdict |
//! | [`motor`] | field-oriented current control of one axis, 24 kHz, and its calibration |
//! | [`safety`], [`servo`] | monitor and drive states; the 4 kHz tick |
//! | [`assist`] | torque from the identified model: transparency, weight support, periodic assistance |
//! | [`leg`] | one leg: the activity machine, a control half and an identification half |
//! | [`operation`] | work of each axis, signals between tasks, rights of the operator's contacts |
//! | `in_place`, `listed` | large values built in place; enums with the list of their variants |
//! | [`trace`] | output of the board: records, one line each |
//! | [`store`] | nonvolatile store: configuration, calibrations, the accepted model |
//! | [`bus`] | a CANopen node per joint, and a board's device with its nodes, without I/O |
//! | [`board`], `task` | one board's registers and interrupts; tasks and priorities (microcontroller only) |
#![cfg_attr(not(test), no_std)]

pub mod assist;
pub mod board;
pub mod bus;
pub mod checksum;
pub mod hal;
pub mod ident;
mod in_place;
pub mod leg;
mod listed;
pub mod model;
pub mod motion;
pub mod motor;
pub mod operation;
pub mod real;
pub mod safety;
pub mod servo;
pub mod store;
pub mod swarm;
#[cfg(all(feature = "board-odrive-v3-6", target_os = "none"))]
pub mod task;
#[cfg(test)]
mod testing;
pub mod trace;
pub mod units;
