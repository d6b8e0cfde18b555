//! Faults of sensors, contacts, timing and commands, injected into the ports of a board.
//!
//! The injector stands between the ports, so world and firmware stay unchanged. Every value that crosses a
//! port passes through an [`Injector`], and leaves unchanged unless an [`Injection`] names its channel at
//! that tick. An injector is a value: it is cloned with its world, and the same seed changes the same bits.
//!
//! ```text
//! world -- AxisSample --> injector --> axis -- JointSample --> injector --> servo
//!   ^--- brake duty <---- injector <----- target current <---- injector <-----'
//! ```
//!
//! Failed supplies and phases, a kicking wearer and a foot on the floor are not signals; the world simulates
//! them ([`crate::drive`], [`crate::wearer`], the floor). Time is counted in PWM periods. Cost without
//! an injection: one comparison per channel.

pub(crate) mod form;
pub(crate) mod injector;

pub use form::{Form, Timing};
pub use injector::{Channel, Injection, Injector};
