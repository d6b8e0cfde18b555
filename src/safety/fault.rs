//! Faults: permanent numbers, the safe state of each, and its row in the catalogue.
//!
//! Why one table: monitor, axes, interlock, bus and records use the same faults. The campaign that injects
//! them (docs/safety.md) reads the expected reaction here. There is no second list. Notices of a node that
//! are no fault of the leg ([`NoticeCode`]) are numbered here as well, so that no code has two meanings.
//!
//! Numbers are the error codes of CiA 402 where it defines one, else CiA 301's for manufacturers (FFxx), so a
//! host that reads object 603F understands them. The safe state is chosen per fault: a limp exoskeleton may
//! drop its wearer, a stiff one may hurt him. Damp needs a working servo, so it is used only where encoder,
//! currents and timing remain trustworthy. All other faults lead to Off.

use crate::listed::listed;

listed! {
    /// Safe state that a fault leads to.
    pub enum Reaction {
        /// All reactions, in the order of the enum.
        ALL,
        /// Word used in tables and records.
        name;
        /// Outputs off in the same tick. Requires nothing.
        Off, "Off";
        /// Velocity damped under the torque cap for at most 300 ms, then Off. Requires encoder and currents.
        Damp, "Damp";
        /// Active short circuit by the low sides, a passive brake. Requires a healthy gate driver.
        ActiveShort, "Short";
        /// Enabled with less torque than requested.
        Limit, "Limit";
        /// Never enabled, with the reason reported.
        Refuse, "Refuse";
    }
}

macro_rules! faults {
    ($( $(#[doc = $doc:literal])* $code:ident = $number:literal, $id:literal, $name:literal, $reaction:ident, $words:literal; )*) => {
        /// A kind of fault. New kinds get new numbers; a number is never used again.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u16)]
        pub enum FaultCode {
            $( $(#[doc = $doc])* $code = $number, )*
        }

        impl FaultCode {
            /// All faults, in the table's order.
            pub const ALL: [Self; [$( $number, )*].len()] = [$( Self::$code, )*];

            /// Row in the catalogue of docs/safety.md; `-` for faults that prevent the board's start.
            pub const fn catalogue(self) -> &'static str {
                match self { $( Self::$code => $id, )* }
            }

            /// Word used in records.
            pub const fn name(self) -> &'static str {
                match self { $( Self::$code => $name, )* }
            }

            /// Safe state that this fault leads to.
            pub const fn reaction(self) -> Reaction {
                match self { $( Self::$code => Reaction::$reaction, )* }
            }

            /// Description of the fault, as the end of a sentence about a joint or the board.
            pub const fn words(self) -> &'static str {
                match self { $( Self::$code => $words, )* }
            }
        }
    };
}

faults! {
    /// The encoder moved farther than the joint can, three times in 10 ms (7305: incremental sensor 1).
    EncoderStep = 0x7305, "E2", "encoder_step", Damp, "its encoder jumped";
    /// Counts were lost, so the rotor angle is unknown until the next calibration.
    EncoderPosition = 0xFF02, "E4", "encoder_place", ActiveShort, "its counts jumped or the index came at another place";
    /// The counter is constant although the motor's voltage shows that it turns.
    EncoderFrozen = 0xFF09, "E1", "encoder_frozen", ActiveShort, "its encoder stopped while the motor turned";
    /// An absolute encoder sends no valid frame (7320: position sensor).
    AbsoluteEncoder = 0x7320, "E6", "absolute_encoder", Damp, "an absolute encoder does not answer";
    /// A phase with voltage carries no current.
    OpenPhase = 0xFF0A, "P1", "open_phase", Off, "a phase does not conduct";
    /// The offset of a current sensor drifted.
    CurrentOffset = 0xFF0B, "C1", "current_zero", Off, "the zero of its current drifted";
    /// A shunt's code stays constant although its phase's current target changes.
    StuckConversion = 0xFF0C, "C3", "stuck_conversion", Off, "a conversion is stuck";
    /// A shunt amplifier at its rail, two ticks in a row or too often in a short time (5210: measuring
    /// circuits).
    CurrentSense = 0x5210, "C2", "current_sense", Off, "a shunt amplifier stayed at its rail";
    /// One shunt's conversion ended without the other's.
    Conversion = 0xFF03, "C3", "conversion", Off, "a conversion is missing";
    /// The current vector is longer than the bound (2310: continuous overcurrent).
    Overcurrent = 0x2310, "C4", "overcurrent", Off, "its current went beyond the bound";
    /// A gate driver reports a fault (5410: output stages).
    GateFault = 0x5410, "C4", "gate_fault", Off, "a gate driver reports a fault";
    /// A gate driver does not hold its configuration (5400: power section).
    GateConfiguration = 0x5400, "P2", "gate_configuration", Off, "a gate driver lost its configuration";
    /// Bus voltage out of range, two ticks in a row or too often in a short time (3200: voltage inside the
    /// device).
    BusVoltage = 0x3200, "V1", "bus_voltage", Off, "the bus voltage left its range";
    /// The processor's supply was too low for a flash write (5110: low voltage supply).
    ProcessorSupply = 0x5110, "F3", "processor_supply", Refuse, "the processor's supply was too low to write the flash";
    /// The supply fails while energy is left (3220: DC link undervoltage).
    SupplyLost = 0x3220, "V2", "supply_lost", Damp, "its supply went away";
    /// More current from the supply than its limit, by the estimate.
    SupplyCurrent = 0xFF10, "V4", "supply_current", Damp, "its supply current was too large";
    /// More current into the supply than its limit. Shorted motors return nothing.
    ChargeCurrent = 0xFF11, "V5", "charge_current", ActiveShort, "it charged its supply with too much current";
    /// A bridge is too hot (4210: excess temperature of the device).
    Temperature = 0x4210, "T1", "temperature", Damp, "a bridge is too hot";
    /// A thermistor is open or shorted.
    Thermistor = 0xFF04, "T1", "thermistor", Damp, "a thermistor is open or shorted";
    /// A winding reached its limit by its thermal model (2350: load level, thermal state).
    WindingTemperature = 0x2350, "T2", "winding", Damp, "its winding is too hot";
    /// The thermistor of a motor is open, shorted or not converted.
    MotorThermistor = 0xFF12, "T4", "motor_thermistor", Damp, "the thermistor of its motor cannot be read";
    /// A measured or requested value is NaN or infinite.
    NotFinite = 0xFF01, "N1", "not_finite", Off, "a signal was not a number";
    /// The emergency stop's contact is open (9000: external error).
    EmergencyStop = 0x9000, "X1", "emergency_stop", Off, "the emergency stop was pressed";
    /// Three current ticks were missed, at once or without one in time between them.
    CurrentTicks = 0xFF05, "K1", "current_ticks", Damp, "its current ticks came late";
    /// The servo did not answer three times in a row.
    ServoTicks = 0xFF06, "K1", "servo_ticks", Off, "the servo did not answer";
    /// The watchdog reset the board (6010: software reset).
    Watchdog = 0x6010, "K3", "watchdog", Refuse, "the watchdog bit";
    /// The firmware crashed before this start (6100: internal software).
    Crash = 0x6100, "K4", "crash", Refuse, "the firmware crashed";
    /// Farther than 0.5 degrees beyond the range while enabled (8500: position controller).
    PositionLimit = 0x8500, "J1", "position_limit", Damp, "it left its range";
    /// Faster than 1.1 times the speed limit while enabled (8400: speed controller).
    Overspeed = 0x8400, "J2", "overspeed", Damp, "it was faster than 1.1 times its speed limit";
    /// Gains or limits changed in memory (6310: loss of parameters). Damping depends on them, so the drive
    /// turns off.
    Parameters = 0x6310, "M2", "parameters", Off, "its gains or limits changed in memory";
    /// Position error larger than the following window (8611: following error).
    FollowingError = 0x8611, "B1", "following_error", Damp, "it did not follow where it was commanded";
    /// The host's heartbeat is missed.
    Heartbeat = 0x8130, "B1", "heartbeat", Damp, "the host's heartbeat is missed";
    /// The host's cyclic PDO came late (8250: RPDO timeout).
    LatePdo = 0x8250, "B1", "late_pdo", Damp, "what the host sends in every cycle came late";
    /// A host with cyclic commands fell silent.
    HostSilent = 0xFF0F, "B5", "host_silent", Damp, "its host fell silent";
    /// The CAN controller is bus-off.
    BusOff = 0x8140, "B2", "bus_off", Damp, "the controller left the bus";
    /// The CAN controller is error-passive.
    BusPassive = 0x8120, "B2", "bus_passive", Damp, "the controller sees too many errors on the bus";
    /// The bridges' timers are not in phase.
    Timers = 0xFF07, "-", "timers", Refuse, "the bridges' timers are not in phase";
    /// The board version read at the factory does not determine the divider of the bus voltage.
    BoardVersion = 0xFF08, "-", "board_version", Refuse, "the board's version is not known";
    /// The constants of an axis or of the leg are invalid (6320: parameters).
    Configuration = 0x6320, "-", "configuration", Refuse, "the configuration makes no sense";
}

impl FaultCode {
    /// The number on the bus and in every record.
    pub const fn number(self) -> u16 {
        self as u16
    }
}

/// Code of an emergency message that reports the end of an error.
pub const NO_ERROR: u16 = 0;

listed! {
    /// Emergency code of a node that is no fault of the leg. A number is never used again.
    #[repr(u16)]
    pub enum NoticeCode {
        /// All notices, in the table's order.
        ALL;
        /// Received frames were lost (8110: CAN overrun).
        Overrun = 0x8110;
        /// A received PDO was shorter than its mapping (8210: PDO not processed).
        ShortPdo = 0x8210;
        /// A SYNC had no counter although 1019 expects one (8240: unexpected SYNC data length).
        SyncLength = 0x8240;
        /// Objects could not be stored or read back (5530: data storage).
        StoreFailed = 0x5530;
        /// A flash write begins: the node may be silent for seconds, heartbeats included.
        Storing = 0xFF0D;
        /// A step towards enabled was refused: joint (from 1; 0 the leg), reason (bit of 60FD), inhibit
        /// reasons.
        NotEnabled = 0xFF0E;
    }
}

impl NoticeCode {
    /// The number on the bus.
    pub const fn number(self) -> u16 {
        self as u16
    }
}

/// A fault and the joint where it was detected; it stops the whole leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Kind of fault.
    pub code: FaultCode,
    /// Joint, counted from 0.
    pub joint: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Repeats the table on purpose: changing a number requires a change here too, and must not happen.
    #[test]
    fn fault_numbers_are_fixed() {
        let numbers = [
            (FaultCode::EncoderStep, 0x7305),
            (FaultCode::EncoderPosition, 0xFF02),
            (FaultCode::EncoderFrozen, 0xFF09),
            (FaultCode::AbsoluteEncoder, 0x7320),
            (FaultCode::OpenPhase, 0xFF0A),
            (FaultCode::CurrentOffset, 0xFF0B),
            (FaultCode::StuckConversion, 0xFF0C),
            (FaultCode::CurrentSense, 0x5210),
            (FaultCode::Conversion, 0xFF03),
            (FaultCode::Overcurrent, 0x2310),
            (FaultCode::GateFault, 0x5410),
            (FaultCode::GateConfiguration, 0x5400),
            (FaultCode::BusVoltage, 0x3200),
            (FaultCode::ProcessorSupply, 0x5110),
            (FaultCode::SupplyLost, 0x3220),
            (FaultCode::SupplyCurrent, 0xFF10),
            (FaultCode::ChargeCurrent, 0xFF11),
            (FaultCode::Temperature, 0x4210),
            (FaultCode::Thermistor, 0xFF04),
            (FaultCode::WindingTemperature, 0x2350),
            (FaultCode::MotorThermistor, 0xFF12),
            (FaultCode::NotFinite, 0xFF01),
            (FaultCode::EmergencyStop, 0x9000),
            (FaultCode::CurrentTicks, 0xFF05),
            (FaultCode::ServoTicks, 0xFF06),
            (FaultCode::Watchdog, 0x6010),
            (FaultCode::Crash, 0x6100),
            (FaultCode::PositionLimit, 0x8500),
            (FaultCode::Overspeed, 0x8400),
            (FaultCode::Parameters, 0x6310),
            (FaultCode::FollowingError, 0x8611),
            (FaultCode::Heartbeat, 0x8130),
            (FaultCode::LatePdo, 0x8250),
            (FaultCode::HostSilent, 0xFF0F),
            (FaultCode::BusOff, 0x8140),
            (FaultCode::BusPassive, 0x8120),
            (FaultCode::Timers, 0xFF07),
            (FaultCode::BoardVersion, 0xFF08),
            (FaultCode::Configuration, 0x6320),
        ];
        assert_eq!(numbers.map(|(code, _)| code), FaultCode::ALL);
        for (code, number) in numbers {
            assert_eq!(code.number(), number, "{code:?}");
        }
        assert_eq!(NoticeCode::ALL.map(NoticeCode::number), [0x8110, 0x8210, 0x8240, 0x5530, 0xFF0D, 0xFF0E]);
    }

    #[test]
    fn no_code_has_two_meanings() {
        let faults = FaultCode::ALL.into_iter().map(FaultCode::number);
        let all = || faults.clone().chain(NoticeCode::ALL.map(NoticeCode::number)).chain([NO_ERROR]);
        for code in all() {
            assert_eq!(all().filter(|other| *other == code).count(), 1, "{code:04X} means two things");
        }
    }

    #[test]
    fn every_fault_has_a_unique_word() {
        for (index, code) in FaultCode::ALL.iter().enumerate() {
            assert!(code.name().bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_'), "{code:?}");
            assert!(FaultCode::ALL[..index].iter().all(|other| other.name() != code.name()), "{code:?}");
        }
    }
}
