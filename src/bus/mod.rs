//! CANopen bus: one node per joint, without I/O. Frames and time in, frames out.
//!
//! Why CANopen: software for exoskeletons and robots uses CiA 402 and can control such a joint unchanged.
//! Why an own node: docs/decisions.md. For host programmers: docs/bus.md.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Frame`], [`NodeId`] | classic CAN frame; node number |
//! | [`table`], [`dictionary`] | all objects: index, type, access, mapping, default, name |
//! | [`Objects`] | interface to the values of the drive's objects |
//! | [`Node`] | network management, heartbeat, emergency, SYNC, SDO, PDO; stored objects |
//! | [`identification`] | the leg's identification and its log, as objects of every node |
//! | [`drive`] | CiA 402 for one joint; coupling of the joints of one leg |
//! | [`commissioning`] | steps of commissioning and telemetry of the board |
//! | [`program`] | a new image over the bus |
//! | [`device`] | one board: nodes, axes, stored parameters, control source of the drive |
//!
//! No frame can cause a panic, an endless loop or an allocation. The cost per frame is stated at [`Node`].

mod abort;
mod access;
pub mod commissioning;
mod communication;
pub mod device;
pub mod dictionary;
pub mod drive;
mod emergency;
mod heartbeat;
pub mod identification;
mod lss;
mod nmt;
mod node;
mod node_id;
mod objects;
mod pdo;
pub mod program;
mod sdo;
mod silence;
mod stored_parameters;
pub mod table;

pub use crate::hal::{Controller, Frame};
pub use abort::Abort;
pub use communication::Identity;
pub use nmt::{NmtState, Reset};
pub use node::{FrameEffect, Node, Storing};
pub use node_id::NodeId;
pub use objects::{Lost, Objects};
pub use stored_parameters::{LONGEST, StoredNode, stored_entries, stored_objects, write_stored};

#[cfg(test)]
pub(crate) mod tests;
