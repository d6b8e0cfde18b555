//! The bus: one CANopen node per joint, without I/O; frames and time in, frames out.
//!
//! Why CANopen: the software that drives exoskeletons and robots speaks it, and a joint drive that speaks CiA 402 is driven
//! by it unchanged. Why an own node: docs/bus.md.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Frame`], [`NodeId`] | classic CAN as far as a node sees it |
//! | [`table`], [`dictionary`] | every object once: index, type, access, mapping, default, name |
//! | [`Objects`] | the seam to whoever has the values |
//! | [`Node`] | network management, heartbeat, emergency, SYNC, SDO, PDO; what of its objects outlives the power |
//! | [`identification`] | the leg's identification and its log, told by every node |
//! | [`drive`] | CiA 402 for one joint, and how several joints share one leg's drive |
//! | [`station`] | all of it for one board: nodes, axes, what is kept, who has the drive |
//!
//! No frame makes it panic, loop or allocate: every frame costs at most what is written at [`Node`].

mod abort;
mod access;
mod communication;
pub mod dictionary;
pub mod drive;
mod emergency;
mod heartbeat;
pub mod identification;
mod kept;
mod nmt;
mod node;
mod node_id;
mod objects;
mod pdo;
mod sdo;
mod silence;
pub mod station;
pub mod table;

pub use crate::hal::{Controller, Frame};
pub use abort::Abort;
pub use communication::Identity;
pub use emergency::ErrorReport;
pub use kept::{KeptNode, LONGEST, kept_bit_rate, kept_entries, kept_node_id, kept_objects, write_kept};
pub use nmt::{NmtState, Reset};
pub use node::{Heard, Node, Storing};
pub use node_id::NodeId;
pub use objects::{Lost, Objects};

#[cfg(test)]
mod tests;
