//! Interrupts and tasks of the board around the levels of `operation`.
//!
//! ```text
//! level 0  current      24 kHz, both axes half a period apart: converter, current loop, bridge  never masked
//! level 1  servo        4 kHz: both joints' samples, leg::Control, targets                      never masked
//! level 4  CAN1_RX0     frames from the CAN controller                                          masked
//! level 5  bus          at every frame and 2 kHz: nodes, axes, stored parameters                masked
//! level 5  assist       500 Hz in a session: law of the assistance                               masked
//! level 6  housekeeping 500 Hz: operator, gate drivers, temperatures, calibration, watchdog     executor
//! thread   identify     the rest of the time: leg::Identification, records to the probe         executor
//! ```
//!
//! Values pass between the levels through the queues and words of `operation` ([`SIGNALS`],
//! `operation::Queues`). Queues are lock-free with one producer and one consumer each; no level waits for
//! another. Levels 0 and 1 are masked only for the few instructions that enable a bridge. The longest
//! critical section for all other levels is one record's, some 5,000 instructions. The state of each level
//! lies behind a lock that is only tried: a handler that would interrupt itself finds it taken.

use self::leg::JOINTS;
use crate::operation::Signals;

pub mod assist;
pub mod bus;
mod composition;
pub mod current;
pub mod housekeeping;
pub mod identify;
pub mod leg;
mod memory;
pub mod servo;
pub mod storage;
mod vectors;

pub use composition::run;

/// Words that all levels share.
pub static SIGNALS: Signals<JOINTS> = Signals::new();
