//! CANopen master, and the procedures on it.
//!
//! | module | contents |
//! | --- | --- |
//! | [`bus`] | frames and a clock, behind an adapter or simulated |
//! | [`adapter`], [`slcan`], [`candump`] | line to an adapter; its frames; logs of frames |
//! | [`master`] | reads and writes objects of nodes, and keeps their emergency messages |
//! | [`alarms`], [`wire`] | what emergency messages and frames on the wire mean |
//! | [`activity_words`], [`words`] | what a leg does and waits for, in words |
//! | [`other_hosts`] | another host that uses the bus |
//! | [`commission`], [`node_ids`], [`update`] | a board is brought up, numbered, updated |
//! | [`report`] | result of a commissioning |

pub mod activity_words;
pub mod adapter;
pub mod alarms;
pub mod bus;
pub mod candump;
pub mod commission;
pub mod master;
pub mod node_ids;
pub mod other_hosts;
pub mod report;
pub mod slcan;
pub mod update;
pub mod wire;
pub mod words;
