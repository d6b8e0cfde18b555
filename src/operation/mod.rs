//! How a board is operated: what each axis does, what is known of it, and what the operator's hands may have.
//!
//! Why a room of its own: what the levels of a board decide is the same whether registers or a simulated plant lie beneath it. Here
//! it is written once, over two small traits of what a board provides; `task` gives it the microcontroller's registers and queues, the
//! fault campaign of `hal-sim` the plant and the faults. Nothing here waits.
//!
//! ```text
//! level 0  CurrentLoops, one tick of one axis: the other axis, contacts, conversion -> interlock -> stage -> bridge
//! level 1  ServoRound, around the leg's tick: begun or not, checksum, supply, temperature
//! level 1  HostSide, the same tick: orders of the bus, the operator's hand before them
//! level 5  BusRound: controller, frames, store, leg, mailboxes; Credit: how often
//! level 6  Housekeeper, 500 rounds per second: contacts -> requests; calibration, reference, reset; registers and temperatures
//! thread   Storing, when a host asks: what stands around a change of the flash
//! ```
//!
//! | from | to | what |
//! | --- | --- | --- |
//! | housekeeper | axis | [`Order`]: be off, measure, run, stand at a place, forget a fault |
//! | axis | housekeeper | [`Outcome`]: measured, refused, interrupted, a fault |
//! | anyone | anyone | the interlock's causes: one word that says why nothing may be enabled |
//!
//! An axis switches only with a calibration (or while it is measured), a target is followed only where all axes run. An axis that loses
//! its place ends the servo's ticks in its own tick; the housekeeper then forgets calibration and reference.

mod bus_round;
mod contacts;
mod credit;
mod current;
mod host_side;
mod housekeeper;
mod mailboxes;
mod servo_round;
mod stage;
mod storing;

pub use bus_round::{BusBoard, BusRound, Keep};
pub use contacts::{Ask, Operator, RATE_HZ, Situation};
pub use credit::Credit;
pub use current::{CurrentBoard, CurrentLoops, Tick};
pub use host_side::{HostBoard, HostRequest, HostSide};
pub use housekeeper::{Housekeeper, HousekeepingBoard, HousekeepingSettings};
pub use mailboxes::{Mailboxes, Speaker};
pub use servo_round::{Found, Gate, ServoRound};
pub use stage::{Order, Outcome, Stage};
pub use storing::{Storing, StoringBoard};
