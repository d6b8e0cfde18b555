//! What can go wrong: numbers that never change, the safe state of each, the catalogue's row it belongs to.
//!
//! Why one table: monitor, axes, interlock, bus and records speak of the same faults, and a campaign that injects them
//! (docs/safety.md) asks here what has to follow. There is no second list. What a node reports on the bus without a fault of
//! the leg ([`NoticeCode`]) has its numbers here as well, so that no code means two things.
//!
//! Numbers are the error codes of CiA 402 where it has one, else CiA 301's for manufacturers (FFxx), so a host that reads
//! object 603F understands them. The safe state is chosen per fault: an exoskeleton that goes limp may drop its wearer, one
//! that holds may hurt him. What only a working servo can do (Damp) is left to faults that leave encoder, currents and time
//! to be trusted; all else is Off.

/// The safe state a fault leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Bridges released in the same tick. Needs nothing to work.
    Off,
    /// Velocity damped under the torque cap for at most 300 ms, then Off. Needs encoder and currents.
    Damp,
    /// Low sides on, a passive brake. Needs a healthy gate driver.
    Short,
    /// Enabled with less than was asked for.
    Limit,
    /// Never becomes enabled, and says why.
    Refuse,
}

impl Reaction {
    /// The word in tables and records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "Off",
            Self::Damp => "Damp",
            Self::Short => "Short",
            Self::Limit => "Limit",
            Self::Refuse => "Refuse",
        }
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
            /// All of them, in the table's order.
            pub const ALL: [Self; [$( $number, )*].len()] = [$( Self::$code, )*];

            /// Its row of the catalogue of docs/safety.md; `-` for what a board refuses to start with.
            #[must_use]
            pub const fn catalogue(self) -> &'static str {
                match self { $( Self::$code => $id, )* }
            }

            /// The word in records.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Self::$code => $name, )* }
            }

            /// Where this fault leads.
            #[must_use]
            pub const fn reaction(self) -> Reaction {
                match self { $( Self::$code => Reaction::$reaction, )* }
            }

            /// What happened, as the end of a sentence about a joint or the board.
            #[must_use]
            pub const fn words(self) -> &'static str {
                match self { $( Self::$code => $words, )* }
            }
        }
    };
}

faults! {
    /// The encoder moved farther than the joint can, three times in 10 ms (7305: incremental sensor 1).
    EncoderStep = 0x7305, "E2", "encoder_step", Damp, "its encoder jumped";
    /// Counts were lost, and with them the rotor's angle: only a new calibration helps.
    EncoderPlace = 0xFF02, "E4", "encoder_place", Short, "its counts jumped or the index came at another place";
    /// The counter stands still while the motor's voltage says that it turns.
    EncoderFrozen = 0xFF09, "E1", "encoder_frozen", Short, "its encoder stopped while the motor turned";
    /// A phase takes voltage and no current.
    OpenPhase = 0xFF0A, "P1", "open_phase", Off, "a phase does not conduct";
    /// A shunt shows a current that does not flow.
    CurrentZero = 0xFF0B, "C1", "current_zero", Off, "the zero of its current drifted";
    /// A shunt's code stays while its phase is asked for another current.
    StuckConversion = 0xFF0C, "C3", "stuck_conversion", Off, "a conversion is stuck";
    /// A shunt amplifier at its rail, two ticks in a row or too many of a few (5210: measuring circuits).
    CurrentSense = 0x5210, "C2", "current_sense", Off, "a shunt amplifier stayed at its rail";
    /// One shunt's conversion ended without the other's.
    Conversion = 0xFF03, "C3", "conversion", Off, "a conversion is missing";
    /// The current vector is longer than the bound (2310: continuous overcurrent).
    Overcurrent = 0x2310, "C4", "overcurrent", Off, "its current went beyond the bound";
    /// A gate driver reports a fault (5410: output stages).
    GateFault = 0x5410, "C4", "gate_fault", Off, "a gate driver reports a fault";
    /// A gate driver does not hold its configuration (5400: power section).
    GateConfiguration = 0x5400, "P2", "gate_configuration", Off, "a gate driver lost its configuration";
    /// Bus voltage out of its range, as the amplifiers (3200: voltage inside the device).
    BusVoltage = 0x3200, "V1", "bus_voltage", Off, "the bus voltage left its range";
    /// The supply dies while there is still energy (3220: DC link undervoltage).
    SupplyLost = 0x3220, "V2", "supply_lost", Damp, "its supply went away";
    /// A bridge is too hot (4210: excess temperature of the device).
    Temperature = 0x4210, "T1", "temperature", Damp, "a bridge is too hot";
    /// A thermistor is open or shorted.
    Thermistor = 0xFF04, "T1", "thermistor", Damp, "a thermistor is open or shorted";
    /// Something measured or wanted is NaN or infinite.
    NotFinite = 0xFF01, "N1", "not_finite", Off, "a signal was not a number";
    /// The emergency stop's contact is open (9000: external error).
    EmergencyStop = 0x9000, "X1", "emergency_stop", Off, "the emergency stop was pressed";
    /// Current ticks were missed three times, at once or with none in time between.
    CurrentTicks = 0xFF05, "K1", "current_ticks", Damp, "its current ticks came late";
    /// The servo did not answer three times in a row.
    ServoTicks = 0xFF06, "K1", "servo_ticks", Off, "the servo did not answer";
    /// The watchdog bit (6010: software reset).
    Watchdog = 0x6010, "K3", "watchdog", Refuse, "the watchdog bit";
    /// The image before this one crashed (6100: internal software).
    Crash = 0x6100, "K4", "crash", Refuse, "the firmware crashed";
    /// Farther than 0.5 degrees beyond the range while enabled (8500: position controller).
    PositionLimit = 0x8500, "J1", "position_limit", Damp, "it left its range";
    /// Faster than 1.1 times the speed limit while enabled (8400: speed controller).
    Overspeed = 0x8400, "J2", "overspeed", Damp, "it was faster than 1.1 times its speed limit";
    /// Gains or limits are not what they were (6310: loss of parameters). Nothing that reckons with them is to be trusted to damp.
    Parameters = 0x6310, "M2", "parameters", Off, "its gains or limits changed in memory";
    /// Farther than the window from where the host commands it to be (8611: following error).
    FollowingError = 0x8611, "B1", "following_error", Damp, "it did not follow where it was commanded";
    /// The host's heartbeat is missed.
    Heartbeat = 0x8130, "B1", "heartbeat", Damp, "the host's heartbeat is missed";
    /// What the host sends in every cycle came late (8250: RPDO timeout).
    LatePdo = 0x8250, "B1", "late_pdo", Damp, "what the host sends in every cycle came late";
    /// A host that spoke in every cycle fell silent.
    HostSilent = 0xFF0F, "B5", "host_silent", Damp, "its host fell silent";
    /// The controller left the bus.
    BusOff = 0x8140, "B2", "bus_off", Damp, "the controller left the bus";
    /// The controller counts so many errors that it may no longer disturb others.
    BusPassive = 0x8120, "B2", "bus_passive", Damp, "the controller sees too many errors on the bus";
    /// The bridges' timers are not in phase.
    Timers = 0xFF07, "-", "timers", Refuse, "the bridges' timers are not in phase";
    /// The factory's version does not tell the divider of the bus voltage.
    BoardVersion = 0xFF08, "-", "board_version", Refuse, "the board's version is not known";
    /// The constants of an axis or of the leg make no sense (6320: parameters).
    Configuration = 0x6320, "-", "configuration", Refuse, "the configuration makes no sense";
}

impl FaultCode {
    /// The number on the bus and in every record.
    #[must_use]
    pub const fn number(self) -> u16 {
        self as u16
    }
}

/// Code of an emergency message which reports that an error has ended.
pub const NO_ERROR: u16 = 0;

macro_rules! notices {
    ($( $(#[doc = $doc:literal])* $code:ident = $number:literal; )*) => {
        /// Emergency code of a node's own, without a fault of the leg. A number is never used again.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u16)]
        pub enum NoticeCode {
            $( $(#[doc = $doc])* $code = $number, )*
        }

        impl NoticeCode {
            /// All of them, in the table's order.
            pub const ALL: [Self; [$( $number, )*].len()] = [$( Self::$code, )*];

            /// The number on the bus.
            #[must_use]
            pub const fn number(self) -> u16 {
                self as u16
            }
        }
    };
}

notices! {
    /// Received frames were lost (8110: CAN overrun).
    Overrun = 0x8110;
    /// A received PDO was shorter than its mapping (8210: PDO not processed).
    ShortPdo = 0x8210;
    /// Objects were not stored, or cannot be read back (5530: data storage).
    StoreFailed = 0x5530;
    /// The flash is about to be written: the node may be silent for seconds, heartbeats included.
    Storing = 0xFF0D;
    /// A step towards enabled was refused: joint (from 1; 0 the leg), reason (bit of 60FD), causes.
    NotEnabled = 0xFF0E;
}

/// A fault and the joint it was seen at; it stops the whole leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What went wrong.
    pub code: FaultCode,
    /// Where, counted from 0.
    pub joint: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written out a second time on purpose: who changes a number has to change it here as well, and must not.
    #[test]
    fn fault_numbers_are_fixed() {
        let numbers = [
            (FaultCode::EncoderStep, 0x7305),
            (FaultCode::EncoderPlace, 0xFF02),
            (FaultCode::EncoderFrozen, 0xFF09),
            (FaultCode::OpenPhase, 0xFF0A),
            (FaultCode::CurrentZero, 0xFF0B),
            (FaultCode::StuckConversion, 0xFF0C),
            (FaultCode::CurrentSense, 0x5210),
            (FaultCode::Conversion, 0xFF03),
            (FaultCode::Overcurrent, 0x2310),
            (FaultCode::GateFault, 0x5410),
            (FaultCode::GateConfiguration, 0x5400),
            (FaultCode::BusVoltage, 0x3200),
            (FaultCode::SupplyLost, 0x3220),
            (FaultCode::Temperature, 0x4210),
            (FaultCode::Thermistor, 0xFF04),
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
        assert_eq!(NoticeCode::ALL.map(NoticeCode::number), [0x8110, 0x8210, 0x5530, 0xFF0D, 0xFF0E]);
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
    fn every_fault_has_a_word_of_its_own() {
        for (index, code) in FaultCode::ALL.iter().enumerate() {
            assert!(code.name().bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_'), "{code:?}");
            assert!(FaultCode::ALL[..index].iter().all(|other| other.name() != code.name()), "{code:?}");
        }
    }
}
