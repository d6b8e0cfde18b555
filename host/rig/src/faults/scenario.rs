//! Rows of a campaign and their runs: injected fault, onset, required reaction, thresholds.
//!
//! Magnitudes are drawn over the whole range of a fault, so that the smallest detected one is a result.
//! Faults below a detector's threshold are marked in advance from the firmware's settings ([`Bounds`]). A
//! fault with an onset condition ([`Onset`]) is judged by the machine's motion before that.

use hal_sim::faults::Injection;
use scarab_base::random::Random;

use crate::faults::catalogue::Fault;

/// Required reaction of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Expected {
    /// Both bridges off, permanently.
    Off,
    /// Both bridges off, even during the reaction to another fault.
    Released,
    /// Reset by the watchdog; the new start refuses to enable.
    Restarted,
    /// Velocity damped, then bridges off.
    Damp,
    /// Damped, without another state, because the bus has enough energy.
    Damped,
    /// Active short circuit by the low sides: the motors brake.
    Brake,
    /// The reading is rejected and the motion continues.
    Rejected,
    /// Noise: the machine continues bit for bit as without the injection.
    Ignored,
    /// The motion continues within its limits, or is damped.
    Kept,
}

/// Condition at which the fault begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Onset {
    /// At the injection.
    Injection,
    /// Some periods after the injection.
    After(u64),
    /// When the servo next reads the faulted channel.
    ServoTick,
    /// When the bus has risen above this voltage, V.
    BusAbove(f64),
    /// When the bus has fallen below this voltage, V.
    BusBelow(f64),
    /// When a joint turns faster than this multiple of its limit.
    Speed(f64),
    /// While the joint of the first injection turns faster than a speed and more current is requested. The
    /// onset is the last time at which this began.
    Driven {
        /// Speed, rad/s.
        speed: f64,
        /// Increase of the speed per requested ampere, rad/s.
        per_ampere: f64,
        /// Requested current, A.
        current: f64,
        /// Speed at the injection from which on the fault shows at once, whatever follows, rad/s.
        sudden: f64,
    },
    /// While the requested current of the phase with the faulted shunt differs from that at the injection by
    /// more than this, A.
    Requested(f64),
}

/// Event in the same period, besides the injections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Nothing.
    None,
    /// New supply voltage, V; 0 if the supply is cut.
    Supply(f64),
    /// Kick of the wearer: joint, peak in N m, seconds.
    Kick(usize, f64, f64),
    /// Broken wire of a joint's output (A, B, C from 0).
    OpenPhase(usize, usize),
    /// Push of the wearer, not stronger than the drive: joint, peak in N m, seconds.
    Push(usize, f64, f64),
    /// A hand that holds a joint: joint, strength in N m, seconds.
    Hold(usize, f64, f64),
    /// Foot contact with the floor: seconds.
    Touch(f64),
    /// Frequency of the watchdog's oscillator, Hz.
    Oscillator(f64),
    /// A bit flip in a constant of an axis or of the servo's joint (`Axis::flip_bit`, `Servo::flip_bit`).
    Upset {
        /// True for the axis, false for the servo.
        of_axis: bool,
        /// Joint, from 0.
        joint: usize,
        /// Number of the constant.
        number: u8,
        /// Bit, from the lowest.
        bit: u8,
    },
    /// Modulation of a joint's axis with NaN (`Axis::spoil_modulation`).
    Modulation(usize),
    /// Random contacts of the operator after the emergency stop; see [`crate::faults::run`].
    Hands,
}

/// One run of a row before its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Injections; their periods count from the injection's.
    pub(crate) injections: [Option<Injection>; 2],
    /// Event besides the injections.
    pub(crate) event: Event,
    /// Condition under which the fault exists.
    pub(crate) onset: Onset,
    /// Required reaction.
    pub(crate) expected: Expected,
    /// Size of the fault in the row's unit.
    pub(crate) magnitude: Option<f64>,
    /// Undetectable by design: too small, and harmless.
    pub(crate) by_design: bool,
    /// Longest wait for the onset, periods.
    pub(crate) patience: u64,
    /// Replaces the row's deadline, ms.
    pub(crate) within_ms: Option<f64>,
    /// Rotor turns within which the fault is detected, for a row without a deadline.
    pub(crate) turns: f64,
}

/// How a fault of the catalogue is run as forks.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The fault.
    pub(crate) fault: &'static Fault,
    /// Draws a run for a board with these thresholds.
    pub(crate) draw: fn(&mut Random, &Bounds) -> Scenario,
}

/// Detection thresholds of the firmware for the simulated leg.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Counts per period that no motor exceeds: the lower of both joints, then the higher.
    pub(crate) greatest_step: [i32; 2],
    /// Rotor counts per turn.
    pub(crate) counts_per_turn: u32,
    /// Overcurrent bound of the axes, A.
    pub(crate) overcurrent_a: f64,
    /// Bus-voltage range of the axes, V.
    pub(crate) bus_v: [f64; 2],
    /// Joint speed, rad/s, and its increase per ampere, above which back-EMF exceeds dead time and warm
    /// copper; the higher of both joints.
    pub(crate) frozen_speed: [f64; 2],
    /// Joint speed from which a counter that stops at once shows, rad/s; the higher of both joints.
    pub(crate) stopped_speed: f64,
    /// Joint speed at which an electrical turn takes 25 ms, rad/s.
    pub(crate) judged_speed: f64,
    /// Phase-current change, A, that may leave the code unchanged, because dead time outweighs the current
    /// loop.
    pub(crate) stuck_a: f64,
    /// Shunt offset, A, whose voltage exceeds that of dead time and of changes within a turn.
    pub(crate) smallest_offset_a: f64,
}
