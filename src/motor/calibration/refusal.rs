//! The closed list of reasons for which there is no calibration.

/// One of the motor's phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The phase without a shunt.
    A,
    /// Second phase.
    B,
    /// Third phase.
    C,
}

/// Why there is no calibration. The bridge is released.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Current vector beyond the configuration's bound.
    Overcurrent,
    /// A shunt amplifier at its rail.
    CurrentSense,
    /// Bus voltage out of range.
    BusVoltage,
    /// The zero of this phase's shunt is too far from the middle, or too noisy.
    ShuntZero(Phase),
    /// The rotor turns although the bridge is off.
    Turning,
    /// No current in this phase.
    PhaseOpen(Phase),
    /// This phase's shunt reads with the wrong sign.
    ShuntInverted(Phase),
    /// Both shunts read with the wrong sign.
    ShuntsInverted,
    /// The shunts of B and C are exchanged.
    ShuntsSwapped,
    /// Currents do not follow the voltage's direction, and no single exchange explains it.
    CurrentDirection,
    /// The phases' resistances differ by more than 15 %.
    PhaseImbalance,
    /// Resistance or inductance out of range, or too large for the voltage allowed.
    MotorConstants,
    /// Resistance more than 40 %, or an inductance more than 20 % from the stored one: another motor.
    OtherMotor,
    /// The current does not settle in time.
    TimeOut,
    /// The field turned, the counter did not.
    NoCounts,
    /// The counter runs against the field: two motor leads or the encoder's A and B are exchanged.
    Direction,
    /// The counts fit this number of pole pairs.
    PolePairs(u8),
    /// The counts fit this number of counts per turn.
    CountsPerTurn(u32),
    /// The rotor did not follow the field evenly: load, friction or a blocked joint.
    Slipped,
    /// No index pulse in a whole turn.
    NoIndex,
    /// Index pulses at different places of the turn.
    IndexMoved,
    /// The rotor does not stand where the stored offset says.
    StoredOffset,
}
