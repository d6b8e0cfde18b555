//! Safety layer between controller and bridge: limits, drive states, and the monitor that decides last.
//!
//! Why a module of its own: it knows no controller, no model and no motion, so no error there can bypass the
//! limits. Once per servo tick it receives the measurements and the request and returns the drive command.
//! The result depends only on its state and these two inputs.
//!
//! | part | purpose |
//! | --- | --- |
//! | [`Limits`] | bounds of each joint; implausible values are refused by name |
//! | [`DriveState`] | the states of CiA 402, one for the whole leg, and their transitions |
//! | [`FaultCode`], [`Fault`], [`NoticeCode`] | faults with fixed numbers and the safe state of each |
//! | `StepGate` | rejection of impossible encoder steps |
//! | [`Barrier`] | torque bounds that stop a joint before its range or speed limit |
//! | [`DeratingRamps`], [`LimitCode`] | derating by temperature and bus voltage; codes of active limits |
//! | `Winding` | temperature of a motor's winding, from its current |
//! | [`Thermistor`] | temperature of a motor's winding, from a thermistor in it |
//! | `SupplyWatch` | detection of a failing supply |
//! | `SupplyCurrent` | estimate and limits of the current from the supply and into it |
//! | `Monitor` | all of the above, once per tick |
//! | `HoldingBrake` | command of a spring-applied brake |
//! | [`RefusalReason`] | reasons why enabling is refused |
//! | [`InhibitReason`], [`TickWatch`], `ServoWatch` | inhibit reasons; checks of every current tick |
//! | `CheckIns`, `TickGuard` | check-ins that the watchdog requires; stopped current ticks |
//! | `CheckClock` | periodic checks: gate drivers' registers, temperatures |
//!
//! Safe states: *Off* turns the bridges' outputs off in the same tick. *Damp* opposes every joint's velocity
//! under its torque cap for at most 300 ms, then goes to Off. *Limit* stays enabled with less torque than
//! requested. A limp exoskeleton may drop its wearer and a stiff one may hurt him, so the state is chosen per
//! fault ([`FaultCode::reaction`]). A fault stays latched until its cause is gone, the drive is off and a
//! reset is requested. Then the operator enables in three steps: shutdown, switch on, enable operation.
//!
//! The monitor detects values that are not finite (N1), range (J1), overspeed (J2) and encoder steps (E2),
//! and enforces the torque and current caps. The axes detect their own faults (`motor::Axis`), the interlock
//! the board's. docs/safety.md lists what is not detected, docs/results/faults.md the measurements. No
//! conformity with any safety standard is claimed.

pub(crate) mod barrier;
pub(crate) mod check_in;
pub mod derating;
pub mod fault;
pub(crate) mod holding_brake;
pub(crate) mod interlock;
pub mod limits;
pub(crate) mod monitor;
pub(crate) mod periodic_checks;
pub(crate) mod refusal;
pub mod state;
pub(crate) mod step_gate;
pub(crate) mod supply_current;
pub mod thermistor;
pub mod winding;

pub use barrier::{Barrier, Limited};
pub(crate) use barrier::{RETURN_SPEED, RETURN_TORQUE};
pub use check_in::GUARD_RATE_HZ;
pub(crate) use check_in::{CheckIns, TickGuard};
pub(crate) use derating::{Derating, SupplyWatch};
pub use derating::{DeratingRamps, JointShares, LimitCode, LimitCodes};
pub use fault::{Fault, FaultCode, NO_ERROR, NoticeCode, Reaction};
pub use holding_brake::BrakeDelays;
pub(crate) use holding_brake::HoldingBrake;
pub(crate) use interlock::ServoWatch;
pub use interlock::{Bridges, InhibitReason, TickState, TickWatch, stays_active};
pub(crate) use limits::LimitsError;
pub use limits::{JointLimits, LimitQuantity, Limits};
pub use monitor::{Decision, RANGE_TOLERANCE};
pub(crate) use monitor::{Monitor, Observation, Request};
pub(crate) use periodic_checks::{BoardFault, CheckClock, of_temperature};
pub use refusal::{Refusal, RefusalReason};
pub(crate) use state::Event;
pub use state::{DriveState, Permission, PowerRequest};
pub(crate) use step_gate::{Reading, StepGate};
pub(crate) use supply_current::SupplyCurrent;
pub use supply_current::SupplyLimits;
pub use thermistor::Thermistor;
pub(crate) use winding::Winding;
pub use winding::WindingRating;
