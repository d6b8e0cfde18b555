//! Simulated legs on a CANopen bus, exact to the bit, for existing host software.
//!
//! | part | content |
//! | --- | --- |
//! | [`board`] | firmware and plant of a leg, with its nodes |
//! | [`scarab_client::wire`], [`network`] | arbitration and bit timing; several legs and a host on one bus |
//! | [`host`] | a host that moves a leg and can stop sending |
//! | [`server`] | TCP port for host software |
//! | `adapter`, `effect` | queue between port and bus; which frames may be sent late |
//! | [`pace`] | real-time pace and the report of delays |
//! | [`scarab_client::alarms`] | lines about faults and emergency messages |
//! | `storing` | the writing of a board's flash |
//! | [`serve`] | the complete server, in real time |

pub(crate) mod adapter;
pub mod board;
pub(crate) mod effect;
pub mod host;
pub mod network;
pub mod pace;
pub mod serve;
pub mod server;
pub(crate) mod storing;
