//! The catalogue of faults: what is injected, what detects it, the required reaction and its deadline.
//!
//! Each fault is stated once, here. Its runs refer to it: forks of an identification with complete drives
//! (`crate::faults::forks`), a bench of its own ([`crate::faults::bench`]), and the flash image on the
//! model of its microcontroller (`cargo chip faults`). docs/safety.md gives the reasons.

use scarab::hal::SERVO_RATE_HZ;
use scarab::safety::FaultCode;

use crate::faulty_board::PERIOD_MS;

/// Time of a servo tick, ms.
pub(crate) const TICK_MS: f64 = 1e3 / SERVO_RATE_HZ as f64;
/// Limit after a host's timeout, ms. The bus checks after every second servo tick, the servo takes the order
/// in the next tick, and its command acts one period later.
pub(crate) const BUS_MS: f64 = 3.0 * TICK_MS + PERIOD_MS;
/// PWM periods and time between two checks of an absolute encoder.
pub(crate) const ENCODER_CHECK: u64 = 192;
pub(crate) const ENCODER_CHECK_MS: f64 = ENCODER_CHECK as f64 * PERIOD_MS;
/// Time between two readings of a motor's thermistor, with two of them, ms.
pub(crate) const THERMISTOR_MS: f64 = 100.0;
/// Time between the sample of such a reading and the check that takes it, ms.
const THERMISTOR_CHECK_MS: f64 = 50.0;

/// A fault of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    /// Id in the catalogue.
    pub id: &'static str,
    /// Description of the fault.
    pub fault: &'static str,
    /// Detector of the fault.
    pub(crate) detector: &'static str,
    /// Safe state.
    pub(crate) state: &'static str,
    /// Safe state that the firmware uses besides or instead of it, where the fault removes a precondition of
    /// `state`.
    pub(crate) instead: Option<&'static str>,
    /// Time limit from the fault to the safe state's first command, ms; infinite where the limit is not a
    /// time.
    pub deadline_ms: f64,
    /// Unit of the magnitude.
    pub(crate) unit: &'static str,
    /// Fault codes that the firmware reports; empty if a bench judges by other means.
    pub(crate) codes: &'static [FaultCode],
    /// Cases that are not detected yet.
    pub(crate) lacking: Option<&'static str>,
}

impl Fault {
    /// Whether this state, or the one instead, is reached by `state`.
    pub(crate) fn leads_to(&self, reached: impl Fn(&str) -> bool) -> bool {
        reached(self.state) || self.instead.is_some_and(reached)
    }
}

/// Without a time limit, unit, code or gap.
const FAULT: Fault = Fault {
    id: "",
    fault: "",
    detector: "",
    state: "-",
    instead: None,
    deadline_ms: f64::INFINITY,
    unit: "",
    codes: &[],
    lacking: None,
};

/// Writes the faults, `name = "id" { fields that differ from FAULT }`, and their list.
macro_rules! catalogue {
    ($($name:ident = $id:literal { $($field:ident: $value:expr,)* })*) => {
        $(pub static $name: Fault = {
            let mut fault = Fault { id: $id, ..FAULT };
            $(fault.$field = $value;)*
            fault
        };)*

        /// All faults, in the catalogue's order. A fault that is run in two ways is described as its first
        /// entry.
        pub static ALL: &[&Fault] = &[$(&$name),*];
    };
}

/// Faults that need the processor: only the flash image on the model of its microcontroller runs them
/// (`cargo chip faults`), crashes also `cargo chip crashes` with all that a crash must do.
pub static ON_THE_CHIP: [&Fault; 5] = [&B6, &K2, &K4, &K5, &M1];

/// Index of a fault in the catalogue.
pub(crate) fn index_of(id: &str) -> Option<usize> {
    ALL.iter().position(|fault| fault.id == id)
}

catalogue! {
    E1 = "E1" {
        fault: "encoder frozen while moving",
        detector: "back-EMF against counts, or counts that stop within a period, 8 ms",
        state: "Short",
        // A motor too fast for a short circuit is turned off.
        instead: Some("Off"),
        deadline_ms: 20.0,
        codes: &[FaultCode::EncoderFrozen],
        lacking: Some("at rest, or so slow that dead time and resistance hide the back-EMF"),
    }

    E2 = "E2" {
        fault: "wrong reading of an encoder, one or three in 10 ms",
        detector: "largest step per tick: the previous duties stay; three in 10 ms in the servo",
        state: "Limit, Damp",
        // Limit: the servo's next tick.
        deadline_ms: 7.0 * PERIOD_MS,
        unit: "counts",
        codes: &[FaultCode::EncoderStep],
    }

    E3 = "E3" {
        fault: "16-bit counter wraps, at any of 65,536 offsets",
        detector: "none: differences wrap",
    }

    E4 = "E4" {
        fault: "lost counts, missing index; a single wrong index pulse is no fault",
        detector: "two index pulses at one wrong position, two turns without a right one; largest step",
        state: "Damp",
        // Damping requires the rotor angle; otherwise as E1.
        instead: Some("Short, Off"),
        unit: "counts",
        codes: &[FaultCode::EncoderPosition],
        lacking: Some("braked (Short) instead of damped, since the rotor's angle is lost with the counts"),
    }

    E5 = "E5" {
        fault: "phases, encoder or shunts connected wrongly, not at all, or loose during a calibration",
        detector: "checks of the calibration",
        state: "Refuse",
    }

    E6 = "E6" {
        fault: "absolute encoder without a valid frame",
        detector: "parity and error flag, every 8 ms, five in a row",
        state: "Damp, Short",
        deadline_ms: 5.0 * ENCODER_CHECK_MS + 2.0 * TICK_MS + PERIOD_MS,
        unit: "checks",
        codes: &[FaultCode::AbsoluteEncoder],
    }

    E7 = "E7" {
        fault: "absolute encoder and counter contradict each other",
        detector: "comparison of both, every 8 ms, twice in a row",
        state: "Short",
        deadline_ms: 2.0 * ENCODER_CHECK_MS + 2.0 * TICK_MS + PERIOD_MS,
        unit: "steps of 2^-14 turns",
        codes: &[FaultCode::EncoderPosition],
        lacking: Some("differences below the encoders' own errors: 1 degree of the rotor, 4.4 degrees of the joint"),
    }

    C1 = "C1" {
        fault: "current offset drifts",
        detector: "mean of the residual over an electrical turn",
        state: "Refuse / Off",
        // While a joint hardly moves, a wrong or missing current looks like a frozen counter. The motors are
        // then shorted, with the speed bound of every short circuit.
        instead: Some("Short"),
        deadline_ms: 50.0,
        unit: "A",
        codes: &[FaultCode::CurrentOffset, FaultCode::OpenPhase, FaultCode::Overcurrent],
        lacking: Some("small offsets while the joint moves; below 2 A of the vector at enabling"),
    }

    C1_AT_ENABLING = "C1" {
        fault: "current offset while the bridges are off",
        detector: "offset limit at enabling",
        state: "Refuse / Off",
        deadline_ms: 10.0,
        unit: "A",
        codes: &[FaultCode::CurrentOffset],
    }

    C2 = "C2" {
        fault: "shunt amplifier or converter at its rail",
        detector: "code near the rails twice",
        state: "Off",
        deadline_ms: 2.0 * PERIOD_MS,
        codes: &[FaultCode::CurrentSense],
    }

    C3 = "C3" {
        fault: "conversion stuck or missing",
        detector: "constant code while the requested current changes; end-of-conversion flags of shunts and supply",
        state: "Off",
        // As C1.
        instead: Some("Short"),
        // Limit for a stuck conversion; a missing one is detected in its own tick.
        deadline_ms: 4.0 * PERIOD_MS,
        codes: &[FaultCode::Conversion, FaultCode::StuckConversion, FaultCode::CurrentOffset],
    }

    C4 = "C4" {
        fault: "overcurrent, gate driver's fault",
        detector: "length of the current vector; pin",
        state: "Off",
        deadline_ms: PERIOD_MS,
        unit: "A",
        codes: &[FaultCode::Overcurrent, FaultCode::GateFault],
    }

    P1 = "P1" {
        fault: "one phase open",
        detector: "voltage without current, 8 ms",
        state: "Off",
        // As C1.
        instead: Some("Short"),
        // Half an electrical turn at 0.2 rad/s takes 45 ms; a phase has hardly any current in a part of it.
        // The detection takes 8 ms more.
        deadline_ms: 55.0,
        codes: &[
            FaultCode::OpenPhase,
            FaultCode::CurrentOffset,
            FaultCode::EncoderFrozen,
            FaultCode::Overcurrent,
        ],
        lacking: Some("without a current target"),
    }

    P2 = "P2" {
        fault: "gate driver lost its configuration",
        detector: "registers read back every 8 ms",
        state: "Off",
        deadline_ms: 10.0,
        codes: &[FaultCode::GateConfiguration],
        lacking: Some("registers that change and recover between two checks"),
    }

    V1 = "V1" {
        fault: "overvoltage: reading, or a pushing supply without brake resistor",
        detector: "bus voltage in each tick, twice",
        state: "Limit, Off",
        deadline_ms: 2.0 * PERIOD_MS,
        unit: "V beyond",
        codes: &[FaultCode::BusVoltage],
    }

    V2 = "V2" {
        fault: "undervoltage: reading, or the supply cut",
        detector: "a fifth lost against the mean of a second, 1 ms: Damp; the lower limit in each tick, twice: Off",
        state: "Damp if there is energy, else Off",
        deadline_ms: 1.0,
        unit: "V beyond",
        codes: &[FaultCode::BusVoltage, FaultCode::SupplyLost],
    }

    V3 = "V3" {
        fault: "brake chopper with implausible settings, or an invalid voltage",
        detector: "check at construction; bounds of the duty",
        state: "Refuse",
        lacking: Some("an absent resistor: the bus rises until the axes turn off (V1)"),
    }

    V4 = "V4" {
        fault: "supply drawn from beyond its limit",
        detector: "current from the axes' powers: share of the torque; 1.25 times the limit for 0.2 s",
        state: "Limit, Damp",
        // 0.2 s, and the low-pass.
        deadline_ms: 210.0,
        unit: "A",
        codes: &[FaultCode::SupplyCurrent],
        lacking: Some("current of logic, gate drivers and calibration"),
    }

    V5 = "V5" {
        fault: "battery charged beyond its limit",
        detector: "current from the axes' powers: brake resistor, share of the torque; 1.25 times the limit for 0.2 s",
        state: "Limit, Short",
        // 0.2 s, and the low-pass.
        deadline_ms: 210.0,
        unit: "A",
        codes: &[FaultCode::ChargeCurrent],
        lacking: Some("a brake resistor that is built in but absent or broken"),
    }

    T1 = "T1" {
        fault: "overtemperature, thermistor open or short",
        detector: "temperature and range of the thermistor every 50 ms",
        state: "Limit, Damp",
        deadline_ms: 100.0,
        unit: "degrees",
        codes: &[FaultCode::Temperature, FaultCode::Thermistor],
        lacking: Some("a thermistor that is stuck within its range"),
    }

    T2 = "T2" {
        fault: "winding hot after long or large torque",
        detector: "thermal model of each winding, every 2 ms",
        state: "Limit, Damp",
        unit: "degrees",
        codes: &[FaultCode::WindingTemperature],
        lacking: Some("heat that the current does not show: surroundings, iron, gear"),
    }

    T3 = "T3" {
        fault: "winding hotter than its model",
        detector: "thermistor of each motor, every 100 ms, mean of eight",
        state: "Limit, Damp",
        unit: "degrees",
        codes: &[FaultCode::WindingTemperature],
        lacking: Some("a thermistor that has come off its winding"),
    }

    T4 = "T4" {
        fault: "thermistor of a motor that cannot be read",
        detector: "range and step of its readings, every 100 ms, three in a row",
        state: "Damp",
        deadline_ms: 3.0 * THERMISTOR_MS + THERMISTOR_CHECK_MS + 2.0 * TICK_MS + PERIOD_MS,
        unit: "ms",
        codes: &[FaultCode::MotorThermistor],
        lacking: Some("a thermistor that has come off its winding"),
    }

    N1 = "N1" {
        fault: "NaN or infinity in a sample, a target or the modulation",
        detector: "checks at the inputs of servo and axis",
        state: "Off",
        deadline_ms: PERIOD_MS,
        codes: &[FaultCode::NotFinite],
        lacking: Some("cost of the search, which no port reaches (I1)"),
    }

    B1 = "B1" {
        fault: "host's heartbeat, targets or SYNC no longer come",
        detector: "heartbeat consumer, event timer of the received PDO",
        state: "Damp",
        deadline_ms: BUS_MS,
        unit: "ms of the host's timeout",
        codes: &[FaultCode::Heartbeat, FaultCode::LatePdo],
    }

    B2 = "B2" {
        fault: "bus off, error passive",
        detector: "status of the controller",
        state: "Damp",
        deadline_ms: 10.0,
        codes: &[FaultCode::BusOff, FaultCode::BusPassive],
    }

    B3 = "B3" {
        fault: "malformed and hostile frames, transfers cut and mixed",
        detector: "lengths, ranges, states; the operator's switch",
    }

    B4 = "B4" {
        fault: "a node that sends without pause, bus at 100 %",
        detector: "bus level below the servo's; host timeouts",
        // A host whose frames are blocked by others counts as lost.
        instead: Some("Damp"),
        codes: &[FaultCode::Heartbeat, FaultCode::LatePdo],
    }

    B5 = "B5" {
        fault: "host without heartbeat falls silent",
        detector: "cycles of SYNC, received PDOs and controlword",
        state: "Damp",
        deadline_ms: BUS_MS,
        unit: "ms of the host's cycle",
        codes: &[FaultCode::HostSilent],
    }

    B6 = "B6" {
        fault: "a host takes over an enabled leg, in each mode",
        detector: "limits, and targets that are void until written again",
        state: "as commanded",
    }

    B7 = "B7" {
        fault: "random host sessions",
        detector: "limits, and targets that are void until written again",
        state: "as commanded, or safe",
    }

    X1 = "X1" {
        fault: "emergency stop",
        detector: "sense pin in each tick",
        state: "Off",
        deadline_ms: PERIOD_MS,
        codes: &[FaultCode::EmergencyStop],
    }

    X1_EARLY = "X1" {
        fault: "emergency stop at boot or in a calibration",
        detector: "sense pin in each tick",
        state: "Off",
        deadline_ms: PERIOD_MS,
        codes: &[FaultCode::EmergencyStop],
    }

    X2 = "X2" {
        fault: "bouncing emergency stop, closed again, other contacts operated",
        detector: "latch; operator's edges",
        state: "Off",
        deadline_ms: PERIOD_MS,
        codes: &[FaultCode::EmergencyStop],
    }

    X3 = "X3" {
        fault: "supply cut while moving, then back",
        detector: "nothing is calibrated after a boot; the store",
        state: "Refuse until reset",
    }

    K1 = "K1" {
        fault: "current ticks or the servo late or missed",
        detector: "time between ticks; the servo's counter",
        state: "Damp",
        // Without an answering servo, damping is impossible.
        instead: Some("Off"),
        deadline_ms: 1.0,
        codes: &[FaultCode::CurrentTicks, FaultCode::ServoTicks],
        lacking: Some("a servo that does not answer cannot damp, nor an axis that misses three ticks at once: Off"),
    }

    K2 = "K2" {
        fault: "search without end, unread records, full wire",
        detector: "interrupts preempt the thread",
    }

    K3 = "K3" {
        fault: "a current loop or both, the servo or the housekeeping hangs",
        detector: "watchdog, fed only if all of them ran since",
        state: "reset, boots Refuse with the reason",
        // 4 ms until the next check, and 512 cycles of an oscillator of 17 kHz.
        deadline_ms: 4.0 + 512.0 / 17.0 + PERIOD_MS,
        codes: &[FaultCode::Watchdog],
        lacking: Some("a hang of the task that feeds the watchdog: also detected, but not run here"),
    }

    K4 = "K4" {
        fault: "panic, hard fault, unhandled interrupt",
        detector: "handlers of the processor",
        state: "Off",
        deadline_ms: 0.01,
    }

    K5 = "K5" {
        fault: "crystal stops",
        detector: "clock security system",
        state: "Off",
    }

    M1 = "M1" {
        fault: "stack overflow",
        detector: "memory below the stack",
        state: "Off",
    }

    M2 = "M2" {
        fault: "a bit flips in gains or limits of an axis or the servo",
        detector: "checksum over them, every 64 ms",
        state: "Damp",
        // An axis with changed gains cannot damp.
        instead: Some("Off"),
        deadline_ms: 100.0,
        codes: &[FaultCode::Parameters],
        lacking: Some("motions, models and filters, which the checksum does not cover"),
    }

    F1 = "F1" {
        fault: "power cut at any byte of a write or erase",
        detector: "records are complete or absent",
        state: "Refuse only if both are lost",
        unit: "bytes",
    }

    F2 = "F2" {
        fault: "corrupt or foreign parameters",
        detector: "checksum, schema, ranges, fingerprint",
        state: "Refuse",
    }

    F3 = "F3" {
        fault: "store requested while the drive is on; processor stalled during a write",
        detector: "permit of a drive that is off, interlock",
    }

    J1 = "J1" {
        fault: "joint limit approached too fast: by a push, by command",
        detector: "stopping-distance clamp",
        state: "Limit, Damp",
        unit: "N m",
        codes: &[FaultCode::PositionLimit, FaultCode::Overspeed],
        lacking: Some("pushes above half of the torque cap, which no torque-limited drive can stop"),
    }

    J1_COMMANDED = "J1" {
        fault: "joint commanded beyond its range, at any speed",
        detector: "stopping-distance clamp",
        state: "Limit, Damp",
        unit: "N m",
    }

    J2 = "J2" {
        fault: "overspeed by a kick",
        detector: "estimated speed above 1.1 times the limit",
        state: "Damp",
        // A kick may also drive current or bus voltage beyond their bounds.
        instead: Some("Off"),
        deadline_ms: 6.0,
        unit: "N m",
        codes: &[FaultCode::Overspeed],
    }

    J3 = "J3" {
        fault: "leg rests outside its range and is enabled",
        detector: "bounds of the return into the range",
        state: "Limit, Damp, Refuse",
        unit: "degrees",
    }

    H1 = "H1" {
        fault: "wearer holds or pushes the leg",
        detector: "torque cap; speed",
        state: "Limit",
        // Duration of torque above the cap, without interruption.
        deadline_ms: 50.0,
        unit: "N m",
        codes: &[FaultCode::Overspeed],
    }

    H2 = "H2" {
        fault: "wearer pushes during identification",
        detector: "weights of the residuals; held-out motions",
        state: "Limit",
        // Push and foot contact: the result is refused if the disturbed rows cannot be excluded.
        instead: Some("refused"),
        unit: "N m",
    }

    H4 = "H4" {
        fault: "foot touches the ground during identification",
        detector: "residual against the open chain",
        state: "refused: contact",
        // As H2.
        instead: Some("Limit, refused"),
        unit: "s",
    }

    H3 = "H3" {
        fault: "other leg, other load, other wiring",
        detector: "residual of the model, bounds, held-out motions",
        state: "result refused, never applied",
    }

    I1 = "I1" {
        fault: "search cancelled, stopped by a fault or the emergency stop, or with an invalid result",
        detector: "cancelled between two candidates; verdict",
        state: "old parameters stay",
        unit: "ticks of search",
    }
}
