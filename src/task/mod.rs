//! What runs on the board, at which priority, and how values pass from one to the other.
//!
//! ```text
//! level 0  current     24 kHz, both axes half a period apart: converter, current loop, bridge       never masked
//! level 1  servo        4 kHz: both joints' samples, leg::Control, targets                                     never masked
//! level 4  CAN1_RX0     frames out of the bus' controller                                                              masked
//! level 5  bus          at every frame and 2 kHz: nodes, axes, what is kept                                       masked
//! level 6  housekeeping 500 Hz: operator, gate drivers, temperatures, calibration, watchdog                 executor
//! thread   identify     the rest of the time: leg::Identification, records to the probe                     executor
//! ```
//!
//! | from | to | by |
//! | --- | --- | --- |
//! | current | servo | queue of joint samples, one in six periods; the servo is pended after the second axis' |
//! | servo | current | one atomic word for each axis: the target, or released |
//! | housekeeping | current | queue of orders: a calibrator, an axis, a place, a cleared fault |
//! | current | housekeeping | queue of how calibrations ended |
//! | housekeeping | servo | queue of requests |
//! | servo | housekeeping | queue of drive states |
//! | servo | identify | one queue of samples and events, in their order |
//! | identify | servo | queue of findings |
//! | housekeeping | identify | queue of records |
//! | bus, servo, identify, keep | each other | [`bus`] |
//! | anyone | anyone | the [`interlock`]: one word that says why nothing may be enabled |
//!
//! Queues are lock-free with one producer and one consumer each; nobody waits for anybody. No critical section masks levels 0 and 1,
//! so the longest that delays them is none; the longest that delays anything else is one record's, some 5,000 instructions.
//! What each level works on lies behind a lock that is only tried: a handler that would interrupt itself finds it taken.

pub mod bus;
#[cfg(feature = "board-odrive-v3-6")]
mod composition;
#[cfg(feature = "board-odrive-v3-6")]
pub mod current;
pub mod host;
#[cfg(feature = "board-odrive-v3-6")]
pub mod housekeeping;
pub mod identify;
pub mod interlock;
#[cfg(feature = "board-odrive-v3-6")]
pub mod keep;
pub mod leg;
pub mod links;
pub mod servo;
pub mod statistics;
pub mod surroundings;

#[cfg(feature = "board-odrive-v3-6")]
pub use composition::run;
