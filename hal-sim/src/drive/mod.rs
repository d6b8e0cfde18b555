//! Joint drives: an ideal one, and a complete one down to switches and converter codes.
//!
//! | module | content |
//! | --- | --- |
//! | `ideal` | a current that follows its target with a lag |
//! | [`description`] | parameters of a complete drive |
//! | [`motor`] | three phases by their flux linkages: currents, torque, heat |
//! | [`bridge`] | conduction of each switch: centred pulses, dead time |
//! | [`shunts`] | amplifiers and converter: the codes that the firmware reads |
//! | [`counter`] | encoder counter with its index pulse |
//! | [`supply`] | bus capacitor, source that absorbs no energy, brake resistor |
//! | [`axis`] | motor, bridge, shunts and counter as one axis, a quarter of a PWM period at a time |
//! | [`complete`] | all axes on their supply |
//! | [`stand`] | one axis on a test stand |
//!
//! The ideal drive tests identification apart from a current loop. The complete drive tests the firmware's
//! current loop and its calibration, which use only [`scarab::hal::AxisSample`].

pub mod axis;
pub mod bridge;
pub mod complete;
pub mod counter;
pub mod description;
pub(crate) mod ideal;
pub mod motor;
pub mod shunts;
pub mod stand;
pub mod supply;

pub(crate) use ideal::Drive;
