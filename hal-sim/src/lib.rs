//! Scarab's simulated hardware: the physical world of a leg's drive board, in double precision.
//!
//! Why separate mathematics: a test of firmware against its own equations proves nothing. So the plant uses
//! another formulation: Lagrange instead of Newton-Euler. Its frames are axes and points in the world instead
//! of Denavit-Hartenberg frames, and it has its own access to `libm`. From the firmware it imports only
//! `scarab::hal` and `scarab::units`.
//!
//! | module | content |
//! | --- | --- |
//! | [`description`] | parameters of a world, as plain numbers |
//! | [`conventions`] | modified Denavit-Hartenberg to world frame; anatomical to joint angles and back |
//! | [`mechanism`] | rigid bodies: inertia matrix, Christoffel symbols, gravity, energies |
//! | [`friction`] | Coulomb that sticks, viscous, Stribeck, offset; which joint sticks and which slides |
//! | [`leg`] | time integration of mechanism and friction |
//! | [`end_stop`], `floor` | a joint's mechanical end stops; contact under the foot |
//! | [`drive`] | ideal: a current with lag; complete: motor, bridge, shunts, counter, supply |
//! | [`faults`] | faults injected into a board's ports at given ticks |
//! | [`flash`] | flash memory with a power cut at any byte |
//! | [`sensors`], `pushes` | encoder and current sensor; pushes of the wearer |
//! | [`wearer`] | a wearer with a body of their own: limb, cuffs, muscles, intended motions |
//! | [`world`] | all of it as one seeded value that serves as the firmware's [`scarab::hal::LegDrives`] |

pub mod conventions;
pub mod description;
pub mod drive;
pub mod end_stop;
pub mod faults;
pub mod flash;
pub(crate) mod floor;
pub mod friction;
pub(crate) mod grip;
pub mod leg;
mod maths;
pub mod mechanism;
pub(crate) mod pushes;
pub mod sensors;
pub mod wearer;
pub mod world;
