//! The closed list of reasons for refusing a calibration.

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

/// Reason for refusing a calibration. The outputs are off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Current vector beyond the configuration's bound.
    Overcurrent,
    /// A shunt amplifier at its rail.
    CurrentSense,
    /// Bus voltage out of range.
    BusVoltage,
    /// The current-sensor offset of this phase is too far from the middle, or too noisy.
    ShuntOffset(Phase),
    /// The rotor turns although the outputs are off.
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
    /// Resistance or inductance out of range, or too large for the allowed voltage.
    MotorConstants,
    /// Resistance more than 40 %, or an inductance more than 20 % from the stored one: not the stored motor.
    OtherMotor,
    /// The current does not settle in time.
    TimeOut,
    /// The field turned, the counter did not.
    NoCounts,
    /// The counter runs against the field: two motor leads or the encoder's A and B are exchanged.
    Direction,
    /// The counts fit this number of pole pairs instead.
    PolePairs(u8),
    /// The counts fit this number of counts per turn instead.
    CountsPerTurn(u32),
    /// The rotor did not follow the field evenly: load, friction or a blocked joint.
    Slipped,
    /// The load takes this many percent of the torque that the calibration's current holds; 60 are permitted.
    Load(u8),
    /// The rotor moved beyond the permitted travel.
    Travel,
    /// No index pulse in a whole turn.
    NoIndex,
    /// Index pulses at different positions of the turn.
    IndexMoved,
    /// The measured offset differs from the stored one.
    StoredOffset,
    /// The rotor moved while the field lay along its flux: the stored offset or the index is wrong, a phase
    /// is open, or the joint was pushed.
    Moved,
}
