//! What a board does at each of its levels, written once for board and simulation.
//!
//! The levels share three kinds of things. What only a board can do is [`Hardware`](crate::hal::Hardware): registers, no decisions.
//! [`Signals`] are words that all levels may read and write, the inhibit word among them. [`Queues`] and [`BusQueues`] are plain
//! values. `task` connects the levels to the interrupts of the microcontroller; the fault campaign and the simulated legs of
//! `hal-sim` call the same functions in the same order. Nothing here waits.
//!
//! ```text
//! level 0  CurrentLoops        one tick of one axis: the other axis, contacts, conversion -> inhibit word -> stage -> bridge
//! level 1  ServoLevel          the leg's tick, with HostSide: the bus' orders behind the operator's
//! level 5  BusRound            controller, frames, storage, leg, mailboxes; Credit: how often
//! level 6  Housekeeper         500 rounds per second: contacts, calibration, reference, reset; registers and temperatures
//! level 6  Watch               ticks that stop, watchdog
//! thread   IdentificationLevel events of the servo -> identification -> findings
//! thread   Storing             steps around a change of the flash
//! ```
//!
//! An axis switches only with a calibration (or while it is measured); a target is followed only where all axes run. An axis that
//! loses its rotor position ends the servo's ticks in its own tick; the housekeeping then forgets calibration and reference.

mod bus_round;
mod contacts;
mod credit;
mod current;
mod handover;
mod host_side;
mod housekeeper;
mod identify;
mod mailboxes;
mod queues;
mod servo;
mod signals;
mod stage;
mod storing;
#[cfg(test)]
mod testing;
mod watch;

pub use bus_round::{BusRound, Keep};
pub use contacts::{Ask, Operator, RATE_HZ, Situation};
pub use credit::Credit;
pub use current::{CurrentLoops, Tick};
pub use handover::Handover;
pub use host_side::{HostRequest, HostSide};
pub use housekeeper::{Housekeeper, HousekeepingSettings};
pub use identify::{IdentificationLevel, Slice};
pub use mailboxes::Speaker;
pub use queues::{
    BusEnds, BusQueues, Calibrated, CurrentEnds, Ends, EventQueue, HostEnds, HousekeepingEnds,
    IdentificationEnds, LegEvent, Queues, ServoEnds,
};
pub use servo::ServoLevel;
pub use signals::{Inhibit, Signals, Statistics, Word};
pub use stage::{Order, Outcome, Stage};
pub use storing::Storing;
pub use watch::Watch;
