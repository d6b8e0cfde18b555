//! Firmware and simulated hardware put together, the bus included, and what runs on them.
//!
//! | module | contents |
//! | --- | --- |
//! | [`board`], [`faulty_board`], [`operator`], [`worn`] | the board's levels, its wearer and its operator |
//! | [`pair`], [`options`], [`perturb`] | leg and plant ticked together |
//! | [`bus`] | boards on a simulated bus, also behind a port |
//! | [`parameter_file`] | stored data of a board |
//! | [`trace`], [`traced`] | records of a trace; the run that they tell of |
//! | [`simulate`], [`run_state`], [`watch`], [`scale`] | a simulated leg is identified |
//! | [`identify`], [`identified`] | one or many such runs |
//! | [`excite`], [`shaking`] | design of an exciting motion |
//! | [`monitor`], [`assist`], [`motor`] | a watched model, an assisted wearer, a motor stand |
//! | [`report`] | results of assistance, monitor and motor stand |
//! | [`image`] | the flash image is built and read |
//! | [`faults`] | the fault catalogue, injected into the whole firmware |

#![expect(missing_docs, reason = "part of a program: names and units are stated where they are not obvious")]
#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod assist;
pub mod board;
pub mod bus;
pub mod excite;
pub mod faults;
pub mod faulty_board;
pub mod identified;
pub mod identify;
pub mod image;
pub mod monitor;
pub mod motor;
pub mod operator;
pub mod options;
pub mod pair;
pub mod parameter_file;
pub mod perturb;
pub mod report;
pub mod run_state;
pub mod scale;
pub mod shaking;
pub mod simulate;
pub mod trace;
pub mod traced;
pub mod watch;
pub mod worn;
