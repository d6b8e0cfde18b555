//! Faults of sensors, contacts, time and commands, laid over the ports of a board.
//!
//! Why as middleware: world and firmware stay as they are. What crosses a port passes through an [`Injector`] on its way,
//! and comes out as it went in unless an [`Injection`] names its channel at that tick. An injector is a value: it is cloned with
//! the world it belongs to, and the same seed spoils the same bits.
//!
//! ```text
//! world -- AxisSample --> injector --> axis -- JointSample --> injector --> servo
//!   ^--- brake duty <---- injector <----- target current <---- injector <-----'
//! ```
//!
//! Broken supplies and phases, a wearer who kicks, a foot on the floor are not signals: they are the world's own
//! ([`crate::drive`], [`crate::wearer`], [`crate::floor`]). Time is counted in PWM periods. Cost where nothing is injected: one
//! comparison per channel.

pub mod form;
pub mod injector;

pub use form::{Form, Timing};
pub use injector::{Channel, Injection, Injector};
