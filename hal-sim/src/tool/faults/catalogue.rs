//! The rows of the fault catalogue that a campaign runs: what is done to the machine, and what has to follow.
//!
//! A row is in this table once its detector exists; what is missing of it stands in [`Row::lacking`], and docs/safety.md lists the
//! rows that are not here. Magnitudes are drawn over all that a fault can be, so that the smallest one that is seen is a result.
//! What lies below a detector's threshold is told apart beforehand, from the numbers the firmware is set to ([`Bounds`]); what
//! is a fault only while something holds ([`Onset`]) is judged by what the spoilt machine did until then.

pub mod board;
pub mod current;
pub mod encoder;
pub mod joint;
pub mod memory;
pub mod model;
pub mod number;
pub mod stop;
pub mod supply;
pub mod timing;
pub mod wearer;

use scarab::safety::FaultCode;

use super::dice::Dice;
use crate::faults::Injection;

/// What becomes of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// Both bridges released, and they stay so.
    Off,
    /// The same, whatever else is being reacted to.
    Released,
    /// Reset by the watchdog; what boots refuses.
    Restarted,
    /// Velocity damped, then released.
    Damp,
    /// The same, and nothing else: there is the energy for it.
    Damped,
    /// Low sides on: the motors brake themselves.
    Brake,
    /// The reading is not believed, the motion goes on.
    Rejected,
    /// Noise: the machine goes on to the bit as without it.
    Ignored,
    /// The motion goes on within its limits, or is damped.
    Kept,
}

/// When the fault begins to be one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Onset {
    /// At the injection.
    Injection,
    /// So many periods after the injection.
    After(u64),
    /// When the servo next reads the channel that is spoilt.
    ServoTick,
    /// When the bus has risen above this, V.
    BusAbove(f64),
    /// When the bus has fallen below this, V.
    BusBelow(f64),
    /// When a joint turns faster than this multiple of its limit.
    Speed(f64),
    /// While the joint of the first injection turns faster than this, rad/s, and is asked for more current, A: only as long as it
    /// does, and so from the last time at which it began to.
    Driven {
        /// rad/s.
        speed: f64,
        /// And so much more for each ampere that is asked for, rad/s.
        per_ampere: f64,
        /// A.
        current: f64,
    },
    /// While the joint of the first injection turns faster than this, or from when more and less was asked of it since, A.
    Uncounted {
        /// rad/s.
        speed: f64,
        /// And so much more for each ampere that is asked for, rad/s.
        per_ampere: f64,
        /// Between the most and the least, A.
        swing: f64,
    },
    /// While the current that is asked of the phase whose shunt is spoilt differs from that at the injection by more, A.
    Asked(f64),
}

/// What is done beside what is injected, at the same period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Nothing.
    None,
    /// The supply now gives this voltage, V; 0 is a supply that is cut.
    Supply(f64),
    /// The wearer kicks: joint, peak in N m, seconds.
    Kick(usize, f64, f64),
    /// The wire of a joint's output (A, B, C from 0) breaks.
    OpenPhase(usize, usize),
    /// The wearer pushes, no harder than the drive holds: joint, peak in N m, seconds.
    Push(usize, f64, f64),
    /// A hand holds a joint where it is: joint, strength in N m, seconds.
    Hold(usize, f64, f64),
    /// The foot stands on the floor: seconds.
    Touch(f64),
    /// The watchdog's oscillator runs at this, Hz.
    Oscillator(f64),
    /// A bit flips in a number that never changes, of an axis or of the servo's joint (`Axis::upset`, `Servo::upset`).
    Upset {
        /// Of the axis, else of the servo.
        of_axis: bool,
        /// From 0.
        joint: usize,
        /// Which.
        number: u8,
        /// From the lowest.
        bit: u8,
    },
    /// What a joint's axis modulates with is no number (`Axis::spoil_modulation`).
    Modulation(usize),
    /// The operator's hands go on as they like after the emergency stop: see [`super::run`].
    Hands,
}

/// One run of a row, not yet begun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// What is injected; periods counted from the injection's.
    pub injections: [Option<Injection>; 2],
    /// What happens beside.
    pub event: Event,
    /// When the fault begins to be one.
    pub onset: Onset,
    /// What has to follow.
    pub expected: Expected,
    /// How large the fault is, in the row's unit.
    pub magnitude: Option<f64>,
    /// Nobody could see it: too small, and harmless.
    pub by_design: bool,
    /// Longest that is waited for the onset, periods.
    pub patience: u64,
    /// Instead of the row's deadline, ms.
    pub within_ms: Option<f64>,
    /// Turns of the rotor within which it is seen, of a row that has no deadline.
    pub turns: f64,
}

/// A row of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its id.
    pub id: &'static str,
    /// What goes wrong.
    pub fault: &'static str,
    /// What sees it.
    pub detector: &'static str,
    /// Where it leads, as the catalogue says.
    pub state: &'static str,
    /// What the firmware says then.
    pub codes: &'static [FaultCode],
    /// From the fault to the safe state's first command, ms; infinite for one turn of the rotor.
    pub deadline_ms: f64,
    /// Unit of the magnitude.
    pub unit: &'static str,
    /// What the detector does not see yet.
    pub lacking: Option<&'static str>,
    /// Draws a run for a board whose encoder steps more than so many counts in no period.
    pub draw: fn(&mut Dice, &Bounds) -> Scenario,
}

/// What the firmware is set to, of the leg that is simulated.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Counts per period that no motor exceeds; the lower of both joints, and the higher.
    pub greatest_step: [i32; 2],
    /// Rotor counts per turn.
    pub counts_per_turn: u32,
    /// Of the axes, A.
    pub overcurrent_a: f64,
    /// Of the axes, V.
    pub bus_v: [f64; 2],
    /// Of a joint, rad/s, and rad/s for each ampere: above, back-EMF is more than dead time and warm copper; the higher of both joints.
    pub frozen_speed: [f64; 2],
    /// Change of the current that no rotor takes without moving, A; the higher of both joints.
    pub frozen_swing_a: f64,
    /// Of a joint, rad/s: an electrical turn takes 25 ms.
    pub judged_speed: f64,
    /// Of a phase, A: what a change of less may leave where it is, since dead time outweighs the current loop.
    pub stuck_a: f64,
    /// Offset of a shunt whose voltage is more than that of dead time and of what changes within a turn, A.
    pub smallest_offset_a: f64,
}

/// Joints of the legs that a campaign runs.
pub const JOINTS: usize = 2;

/// All rows, in the catalogue's order.
pub fn rows() -> impl Iterator<Item = &'static Row> {
    let groups: [&'static [Row]; 11] = [
        &encoder::ROWS,
        &current::ROWS,
        &model::ROWS,
        &board::ROWS,
        &supply::ROWS,
        &number::ROWS,
        &stop::ROWS,
        &timing::ROWS,
        &memory::ROWS,
        &joint::ROWS,
        &wearer::ROWS,
    ];
    groups.into_iter().flatten()
}

/// The row with this id.
#[must_use]
pub fn row(id: &str) -> Option<&'static Row> {
    rows().find(|row| row.id == id)
}
