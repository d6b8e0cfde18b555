//! What stands between a command and the bridge: limits, drive states and the monitor that decides last.
//!
//! Why a room of its own: it knows no controller, no model and no motion, so nothing that goes wrong there can talk
//! it out of its limits. Once per servo tick it is shown what was measured and what is wanted; it answers what the
//! drives are told. It is a pure function of its state and those two.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Limits`] | what each joint may do; absurd ones are refused by name |
//! | [`DriveState`] | the states of CiA 402, one for the whole leg, and their transitions |
//! | [`FaultCode`], [`Fault`], [`NoticeCode`] | what can go wrong, with fixed numbers and the safe state each leads to |
//! | [`StepGate`] | encoder steps that no joint can make |
//! | [`Barrier`] | torque bounds that stop a joint before its range and speed end |
//! | [`DeratingRamps`], [`LimitCode`] | less before nothing, by temperature and bus voltage; codes that are no faults |
//! | [`SupplyWatch`] | a supply that dies |
//! | [`Monitor`] | all of it, once per tick |
//! | [`RefusalReason`] | what stands against enabling |
//! | [`Cause`], [`TickWatch`], [`ServoWatch`] | why nothing may be enabled, and what every current tick looks at |
//! | [`CheckIns`], [`TickGuard`] | who has to have run before the watchdog is fed; current ticks that stop |
//! | [`UpkeepClock`] | what is looked at every few milliseconds: gate drivers' registers, temperatures |
//!
//! Safe states: *Off* releases the bridges in the same tick. *Damp* opposes every joint's velocity under its torque
//! cap for at most 300 ms, then Off. *Limit* stays enabled with less than was asked for. An exoskeleton that goes limp
//! may drop its wearer and one that holds may hurt him: the state is chosen per fault ([`FaultCode::reaction`]).
//! Faults are latched until a reset is asked for, the drive is off and the cause is gone; the way back to a moving
//! leg is shutdown, switch on, enable operation, each asked for by the operator.
//!
//! The monitor sees numbers that are not finite (N1), the range (J1), overspeed (J2), encoder steps (E2), and holds the torque
//! and current caps; the axes see their own faults (`motor::Axis`), the interlock the board's. What is not built yet, and what
//! was measured of the rest: docs/safety.md. No conformity with any safety standard is claimed.

pub mod barrier;
pub mod check_in;
pub mod derating;
pub mod fault;
pub mod interlock;
pub mod limits;
pub mod monitor;
pub mod refusal;
pub mod state;
pub mod step_gate;
pub mod upkeep;

pub use barrier::{Barrier, Limited, RETURN_SPEED, RETURN_TORQUE};
pub use check_in::{CheckIns, GUARD_RATE_HZ, TickGuard};
pub use derating::{Derating, DeratingRamps, LimitCode, LimitCodes, Ramp, SupplyWatch};
pub use fault::{Fault, FaultCode, NO_ERROR, NoticeCode, Reaction};
pub use interlock::{Bridges, Cause, ServoWatch, TickState, TickWatch, stays_active};
pub use limits::{JointLimits, LimitQuantity, Limits, LimitsError};
pub use monitor::{Decision, Monitor, Observation, RANGE_TOLERANCE, Request};
pub use refusal::{Refusal, RefusalReason};
pub use state::{DriveState, Event, Permission, PowerRequest};
pub use step_gate::{Reading, StepGate};
pub use upkeep::{BoardFault, UpkeepClock, of_gate_driver, of_temperature};
