//! Interrupts and tasks of the board around the levels of `operation`.
//!
//! ```text
//! level 0  current      24 kHz, both axes half a period apart: converter, current loop, bridge                 never masked
//! level 1  servo        4 kHz: both joints' samples, leg::Control, targets                                     never masked
//! level 4  CAN1_RX0     frames out of the bus' controller                                                      masked
//! level 5  bus          at every frame and 2 kHz: nodes, axes, what is stored                                  masked
//! level 6  housekeeping 500 Hz: operator, gate drivers, temperatures, calibration, watchdog                    executor
//! thread   identify     the rest of the time: leg::Identification, records to the probe                        executor
//! ```
//!
//! Values pass between the levels through the queues and words of `operation` ([`SIGNALS`], `operation::Queues`). Queues are lock-free
//! with one producer and one consumer each; no level waits for another. No critical section masks levels 0 and 1 but the few
//! instructions in which a bridge is enabled; the longest that delays anything else is one record's, some 5,000 instructions.
//! What each level works on lies behind a lock that is only tried: a handler that would interrupt itself finds it taken.

use self::leg::JOINTS;
use crate::operation::Signals;
use crate::safety::Cause;

pub use crate::operation::EventQueue;
pub use crate::safety::stays_active;

pub mod bus;
#[cfg(feature = "board-odrive-v3-6")]
mod composition;
#[cfg(feature = "board-odrive-v3-6")]
pub mod current;
#[cfg(feature = "board-odrive-v3-6")]
pub mod housekeeping;
pub mod identify;
#[cfg(feature = "board-odrive-v3-6")]
pub mod keep;
pub mod leg;
pub mod servo;
pub mod surroundings;

#[cfg(feature = "board-odrive-v3-6")]
pub use composition::run;

/// Words that all levels share.
pub static SIGNALS: Signals<JOINTS> = Signals::new();

/// The emergency stop's contact opened: nothing is enabled from now on.
pub fn stop() {
    SIGNALS.inhibit.raise(Cause::EmergencyStop);
}
