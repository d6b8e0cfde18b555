//! Scarab's simulated hardware: the physical world a leg's drive board meets, in double precision.
//!
//! Why it is written this way: a firmware tested against its own equations proves nothing. The plant
//! therefore uses another formulation (Lagrange instead of Newton-Euler), other frames (axes and points in
//! the world instead of Denavit-Hartenberg frames) and its own door to `libm`; of the firmware it knows
//! `scarab::hal` and `scarab::units` only.
//!
//! | module | what lives there |
//! | --- | --- |
//! | [`description`] | everything a world is made from, as plain numbers |
//! | [`conventions`] | modified Denavit-Hartenberg to world frame; anatomical to joint angles and back |
//! | [`mechanism`] | rigid bodies: inertia matrix, Christoffel symbols, gravity, energies |
//! | [`friction`] | Coulomb that sticks, viscous, Stribeck, offset; which joint sticks and which slides |
//! | [`leg`] | mechanism and friction moved through time |
//! | [`end_stop`], [`floor`] | a joint's mechanical end stops; contact under the foot |
//! | [`drive`] | ideal: a current with lag; complete: motor, bridge, shunts, counter, supply |
//! | [`faults`] | what crosses a board's ports, spoilt at a tick |
//! | [`flash`] | a flash memory whose power fails at any byte |
//! | [`gear`], [`sensors`], [`wearer`] | ratio; encoder and current sensor; pushes |
//! | [`world`] | all of it as one seeded value that serves as the firmware's [`scarab::hal::LegDrives`] |
//!
//! The plant needs neither `std` nor a heap; the host tool and its crates are behind the feature `tool`.
#![cfg_attr(not(feature = "tool"), no_std)]

pub mod conventions;
pub mod description;
pub mod drive;
pub mod end_stop;
pub mod faults;
pub mod flash;
pub mod floor;
pub mod friction;
pub mod gear;
pub mod grip;
pub mod leg;
mod maths;
pub mod mechanism;
pub mod sensors;
#[cfg(feature = "tool")]
pub mod tool;
pub mod wearer;
pub mod world;
