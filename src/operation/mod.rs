//! The work of a board at each priority level, written once for board and simulation.
//!
//! The levels share three kinds of things. [`Hardware`](crate::hal::Hardware) is the board's register access
//! and makes no decisions. [`Signals`] are words that all levels read and write, the inhibit word among them.
//! [`Queues`] and [`BusQueues`] are plain values. `task` connects the levels to the microcontroller's
//! interrupts. The fault campaign and the simulated legs of `host` call the same functions in the same
//! order. Nothing here waits.
//!
//! ```text
//! level 0  CurrentLoops         tick of one axis: other axes, contacts, conversion -> inhibit word -> axis
//!                               state -> bridge
//! level 1  ServoLevel           the leg's tick, with HostSide: the operator's requests before the bus'
//! level 5  BusRound             controller, frames, storage, leg, mailboxes; rate limited by TokenBucket
//! level 6  Housekeeper          500 rounds per second: contacts, calibration, reference, reset; registers of
//!                               the gate drivers and temperatures
//! level 6  Watch                stopped ticks, watchdog
//! thread   IdentificationLevel  events of the servo -> identification -> findings
//! thread   Storing              steps around a flash write
//! thread   Update               a new image over the bus
//! ```
//!
//! An axis switches only with a calibration, or while it is being measured. A target is followed only where
//! all axes run. An axis that loses its rotor position ends the servo's ticks in its own tick; the
//! housekeeping then discards calibration and reference.

mod assist;
mod axis_state;
mod bus_round;
mod contacts;
mod current;
mod encoders;
mod handover;
mod host_side;
mod housekeeper;
mod identify;
mod mailboxes;
mod queues;
mod servo;
mod signals;
mod status_light;
mod storing;
#[cfg(test)]
mod testing;
mod token_bucket;
mod update;
mod watch;

pub use assist::AssistLevel;
pub use axis_state::{AxisState, Order, Outcome};
pub use bus_round::{BusRound, StoreJob};
pub use contacts::RATE_HZ;
pub use current::{CurrentLoops, Tick};
pub use encoders::EncoderSettings;
pub use handover::Handover;
pub use housekeeper::{Housekeeper, HousekeepingSettings};
pub use identify::{IdentificationLevel, Slice};
pub use queues::{
    AssistEnds, AssistQueues, BusEnds, BusQueues, Calibrated, CurrentEnds, Ends, EventQueue, HostEnds,
    HousekeepingEnds, IdentificationEnds, LegEvent, Queues, ServoAssistEnds, ServoEnds,
};
pub use servo::ServoLevel;
pub use signals::{Inhibit, Signals, Statistics, Word};
pub use storing::{Purpose, Storing};
pub use update::{Begun, Update};
pub use watch::Watch;
