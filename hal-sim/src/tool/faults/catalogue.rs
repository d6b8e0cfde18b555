//! The rows of the fault catalogue that a campaign runs: what is done to the machine, and what has to follow.
//!
//! A row is in this table once its detector exists; what is missing of it stands in [`Row::lacking`], and docs/safety.md lists the
//! rows that are not here. Magnitudes are drawn over all that a fault can be, so that the smallest one that is seen is a result.

use scarab::safety::FaultCode;

use super::dice::Dice;
use super::draw;
use super::rig::PERIOD_MS;
use crate::faults::Injection;

/// What becomes of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// Both bridges released, and they stay so.
    Off,
    /// Velocity damped, then released.
    Damp,
    /// The reading is not believed, the motion goes on.
    Rejected,
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
}

/// Joints of the legs that a campaign runs.
pub const JOINTS: usize = 2;

/// All rows, in the catalogue's order.
pub static ROWS: [Row; 12] = [
    Row {
        id: "E2",
        fault: "wrong reading of an encoder, one or three in 10 ms",
        detector: "greatest step per tick: the duties of the tick before are kept; three in 10 ms in the servo",
        state: "Limit, Damp",
        codes: &[FaultCode::EncoderStep],
        // The servo's next tick.
        deadline_ms: 7.0 * PERIOD_MS,
        unit: "counts",
        lacking: None,
        draw: draw::glitch,
    },
    Row {
        id: "E4",
        fault: "lost counts",
        detector: "index against counts; greatest step",
        state: "Damp",
        codes: &[FaultCode::EncoderPlace],
        deadline_ms: f64::INFINITY,
        unit: "counts",
        lacking: Some("released instead of damped, since the rotor's angle is lost with the counts"),
        draw: draw::lost_counts,
    },
    Row {
        id: "C2",
        fault: "shunt amplifier or converter at its rail",
        detector: "code near the rails twice",
        state: "Off",
        codes: &[FaultCode::CurrentSense],
        deadline_ms: 2.0 * PERIOD_MS,
        unit: "",
        lacking: None,
        draw: draw::rail,
    },
    Row {
        id: "C3",
        fault: "conversion missing",
        detector: "end of conversion",
        state: "Off",
        codes: &[FaultCode::Conversion],
        deadline_ms: PERIOD_MS,
        unit: "",
        lacking: Some("a conversion that is stuck at a code within the range"),
        draw: draw::conversion,
    },
    Row {
        id: "C4",
        fault: "overcurrent, gate driver's fault",
        detector: "length of the current vector; pin",
        state: "Off",
        codes: &[FaultCode::Overcurrent, FaultCode::GateFault],
        deadline_ms: PERIOD_MS,
        unit: "A",
        lacking: None,
        draw: draw::overcurrent,
    },
    Row {
        id: "V1",
        fault: "overvoltage: reading, or a pushing supply without brake resistor",
        detector: "bus voltage in each tick, twice",
        state: "Limit, Off",
        codes: &[FaultCode::BusVoltage],
        deadline_ms: 2.0 * PERIOD_MS,
        unit: "V beyond",
        lacking: None,
        draw: draw::overvoltage,
    },
    Row {
        id: "V2",
        fault: "undervoltage: reading, or the supply cut",
        detector: "bus voltage in each tick, twice",
        state: "Damp if there is energy, else Off",
        codes: &[FaultCode::BusVoltage],
        deadline_ms: 1.0,
        unit: "V beyond",
        lacking: Some("the slope: at the lower border there is no energy left to damp with"),
        draw: draw::undervoltage,
    },
    Row {
        id: "N1",
        fault: "NaN or infinity in a sample or a target",
        detector: "borders of the servo and of the axis",
        state: "Off",
        codes: &[FaultCode::NotFinite],
        deadline_ms: PERIOD_MS,
        unit: "",
        lacking: Some("modulation and fitness, which no port reaches"),
        draw: draw::not_finite,
    },
    Row {
        id: "X1",
        fault: "emergency stop",
        detector: "sense pin in each tick",
        state: "Off",
        codes: &[FaultCode::EmergencyStop],
        deadline_ms: PERIOD_MS,
        unit: "",
        lacking: None,
        draw: draw::emergency_stop,
    },
    Row {
        id: "X2",
        fault: "bouncing emergency stop, released, hands at the contacts",
        detector: "latch; operator's edges",
        state: "Off",
        codes: &[FaultCode::EmergencyStop],
        deadline_ms: PERIOD_MS,
        unit: "",
        lacking: None,
        draw: draw::bouncing_stop,
    },
    Row {
        id: "K1",
        fault: "current ticks or the servo late or missed",
        detector: "time between ticks; the servo's counter",
        state: "Damp",
        codes: &[FaultCode::CurrentTicks, FaultCode::ServoTicks],
        deadline_ms: 1.0,
        unit: "",
        lacking: Some("a servo that does not answer cannot damp: Off"),
        draw: draw::late_ticks,
    },
    Row {
        id: "J2",
        fault: "overspeed by a kick",
        detector: "estimated speed above 1.1 times the limit",
        state: "Damp",
        codes: &[FaultCode::Overspeed],
        deadline_ms: 6.0,
        unit: "N m",
        lacking: None,
        draw: draw::overspeed,
    },
];

/// The row with this id.
#[must_use]
pub fn row(id: &str) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.id == id)
}
