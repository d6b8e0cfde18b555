//! Torque from the identified model: a leg that is transparent, carries weight and assists.
//!
//! ```text
//! torque = G(q)                                             weight of the empty leg
//!        + s_i k (M(q) q'' + C(q, q') q')                   share of its inertia, at most the lower bound k
//!        + s_f (FC_low c(q') + FV_low q')                   share of its friction's lower bounds
//!        + s_w G_w(q)                                       share of the wearer's weight
//!        + s_p e tau_n(q*, q*', q*'')                       share of the wearer's torque, predicted
//!        - b q'                                             damping, once too much energy was given
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | G, M, C | gravity, mass matrix and centrifugal terms of the model `empty`, rotors included | |
//! | G_w | gravity of the difference `worn` - `empty`: the wearer's leg | N m |
//! | tau_n | torque that the wearer of the leg gives without this share, see `periodic` | N m |
//! | FC_low, FV_low, k | value - 2 sigma of friction; the same bound of the mass matrix, relative | |
//! | q* | motion that the oscillators predict | rad |
//! | e | gate of the periodic assist, 0..1: periodic motion and effort of the wearer | |
//!
//! Why bounds: torque in the direction of the motion feeds the motion. Only what friction and inertia
//! certainly take away may be given, so their uncertainty decides how much.
//!
//! | module | content | rate |
//! | --- | --- | --- |
//! | [`shares`] | the shares s, and which are refused | |
//! | [`model`] | parameters with bounds; torques and kinetic energy | |
//! | [`differentiator`] | velocity and acceleration of the measured angles | 500 Hz |
//! | `oscillator` | phase, frequency and waveform of a periodic motion | 500 Hz |
//! | `periodic` | assistance of a periodic motion, and its gate | 500 Hz |
//! | [`energy`] | energy given to the wearer, and the damping that bounds it | 500 Hz |
//! | [`law`] | all of it: one sample in, one torque out | 500 Hz |
//! | [`tick`] | interpolation, friction, fading in and out | 4 kHz |
//!
//! Sources: Kucuktabak, Wen, Kim, Short, Lynch and Pons, Haptic transparency and interaction force control
//! for a lower limb exoskeleton, IEEE Transactions on Robotics 2024; Ronsse et al., Oscillator-based
//! assistance of cyclical movements, Medical and Biological Engineering and Computing 2011; Hannaford and
//! Ryu, Time-domain passivity control of haptic interfaces, IEEE Transactions on Robotics and Automation
//! 2002.
//!
//! Known limits: no force is measured at the cuffs; every statement about the wearer rests on the two models.
//! No ground contact: swing, seated or standing exercise, hanging. Friction at rest is not compensated.

pub mod differentiator;
pub mod energy;
pub mod law;
pub mod model;
pub(crate) mod oscillator;
pub(crate) mod periodic;
pub mod shares;
pub mod tick;

pub use law::AssistLaw;
pub(crate) use law::{AssistSession, AssistTorque};
pub use model::{Assured, CompensationModel};
pub use oscillator::Oscillator;
pub use periodic::PeriodicAssist;
pub use shares::AssistShares;
pub use tick::AssistEnd;
pub(crate) use tick::{AssistDemand, AssistTick};
