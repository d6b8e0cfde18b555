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

/// Constant of a motor that is compared with its stored value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotorConstant {
    /// Resistance of one phase, ohm.
    Resistance,
    /// Inductance along the flux, H.
    DirectInductance,
    /// Inductance across the flux, H.
    QuadratureInductance,
}

/// A value of the leg file or of the stored calibration, and the one found instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// Value of the leg file or of the stored calibration.
    pub stated: f32,
    /// Measured value.
    pub found: f32,
}

impl Mismatch {
    /// Returns the pair where both differ by more than a share of the stated value, or where one is NaN.
    pub(super) fn beyond(share: f32, stated: f32, found: f32) -> Option<Self> {
        let is_within = (found - stated).abs() <= share * stated;
        (!is_within).then_some(Self { stated, found })
    }
}

/// Reason for refusing a calibration. The outputs are off.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    OtherMotor(MotorConstant, Mismatch),
    /// The flux linkage of the back-EMF is more than 25 % from the configured one; V s.
    Flux(Mismatch),
    /// The current does not settle in time.
    TimeOut,
    /// The field turned, the counter did not.
    NoCounts,
    /// The counter runs against the field: two motor leads or the encoder's A and B are exchanged.
    Direction,
    /// The counts fit another number of pole pairs.
    PolePairs {
        /// Configured number.
        stated: u8,
        /// Number that fits.
        found: u8,
    },
    /// The counts fit another number of counts per turn.
    CountsPerTurn {
        /// Configured number.
        stated: u32,
        /// Number that fits.
        found: u32,
    },
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
    /// The measured offset differs from the stored one by more than 5 degrees; electrical turns.
    StoredOffset(Mismatch),
    /// The rotor moved while the field lay along its flux: the stored offset or the index is wrong, a phase
    /// is open, or the joint was pushed.
    Moved,
}

/// Values of a mismatch that only a record carries.
const UNKNOWN: Mismatch = Mismatch { stated: f32::NAN, found: f32::NAN };

impl Refusal {
    /// Every reason in the order of its number, without its details.
    pub const ALL: [Self; 26] = [
        Self::Overcurrent,
        Self::CurrentSense,
        Self::BusVoltage,
        Self::ShuntOffset(Phase::A),
        Self::Turning,
        Self::PhaseOpen(Phase::A),
        Self::ShuntInverted(Phase::A),
        Self::ShuntsInverted,
        Self::ShuntsSwapped,
        Self::CurrentDirection,
        Self::PhaseImbalance,
        Self::MotorConstants,
        Self::OtherMotor(MotorConstant::Resistance, UNKNOWN),
        Self::Flux(UNKNOWN),
        Self::TimeOut,
        Self::NoCounts,
        Self::Direction,
        Self::PolePairs { stated: 0, found: 0 },
        Self::CountsPerTurn { stated: 0, found: 0 },
        Self::Slipped,
        Self::Load(0),
        Self::Travel,
        Self::NoIndex,
        Self::IndexMoved,
        Self::StoredOffset(UNKNOWN),
        Self::Moved,
    ];

    /// Number on the bus (2160:5), from 1.
    pub const fn number(self) -> u8 {
        match self {
            Self::Overcurrent => 1,
            Self::CurrentSense => 2,
            Self::BusVoltage => 3,
            Self::ShuntOffset(_) => 4,
            Self::Turning => 5,
            Self::PhaseOpen(_) => 6,
            Self::ShuntInverted(_) => 7,
            Self::ShuntsInverted => 8,
            Self::ShuntsSwapped => 9,
            Self::CurrentDirection => 10,
            Self::PhaseImbalance => 11,
            Self::MotorConstants => 12,
            Self::OtherMotor(..) => 13,
            Self::Flux(_) => 14,
            Self::TimeOut => 15,
            Self::NoCounts => 16,
            Self::Direction => 17,
            Self::PolePairs { .. } => 18,
            Self::CountsPerTurn { .. } => 19,
            Self::Slipped => 20,
            Self::Load(_) => 21,
            Self::Travel => 22,
            Self::NoIndex => 23,
            Self::IndexMoved => 24,
            Self::StoredOffset(_) => 25,
            Self::Moved => 26,
        }
    }

    /// Number beside the reason: a phase from 1, a stored constant (resistance 1, direct inductance 2,
    /// quadrature inductance 3), pole pairs or counts that would fit, or a load in percent; else 0.
    pub(crate) const fn detail(self) -> u32 {
        match self {
            Self::ShuntOffset(phase) | Self::PhaseOpen(phase) | Self::ShuntInverted(phase) => {
                phase as u32 + 1
            }
            Self::OtherMotor(constant, _) => constant as u32 + 1,
            Self::PolePairs { found, .. } => found as u32,
            Self::CountsPerTurn { found, .. } => found,
            Self::Load(percent) => percent as u32,
            _ => 0,
        }
    }

    /// Both values of a contradiction to the leg file or to the stored calibration.
    pub(crate) const fn mismatch(self) -> Option<Mismatch> {
        match self {
            Self::OtherMotor(_, mismatch) | Self::Flux(mismatch) | Self::StoredOffset(mismatch) => {
                Some(mismatch)
            }
            Self::PolePairs { stated, found } => {
                Some(Mismatch { stated: stated as f32, found: found as f32 })
            }
            Self::CountsPerTurn { stated, found } => {
                Some(Mismatch { stated: stated as f32, found: found as f32 })
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_contradict_beyond_the_share_of_the_stated_one_and_where_one_is_invalid() {
        for (found, contradicts) in
            [(2.49, false), (1.51, false), (2.51, true), (1.49, true), (f32::NAN, true)]
        {
            assert_eq!(Mismatch::beyond(0.25, 2.0, found).is_some(), contradicts, "{found}");
        }
        assert_eq!(Mismatch::beyond(0.25, 2.0, 4.0), Some(Mismatch { stated: 2.0, found: 4.0 }));
    }

    #[test]
    fn the_numbers_count_from_one_in_the_order_of_the_list() {
        for (number, refusal) in (1..).zip(Refusal::ALL) {
            assert_eq!(refusal.number(), number, "{refusal:?}");
        }
        assert_eq!(Refusal::PhaseOpen(Phase::C).detail(), 3);
        assert_eq!(Refusal::OtherMotor(MotorConstant::QuadratureInductance, UNKNOWN).detail(), 3);
    }

    #[test]
    fn every_contradiction_names_both_values() {
        let pair = Mismatch { stated: 7.0, found: 11.0 };
        for refusal in [
            Refusal::OtherMotor(MotorConstant::Resistance, pair),
            Refusal::Flux(pair),
            Refusal::StoredOffset(pair),
            Refusal::PolePairs { stated: 7, found: 11 },
            Refusal::CountsPerTurn { stated: 7, found: 11 },
        ] {
            assert_eq!(refusal.mismatch(), Some(pair), "{refusal:?}");
        }
        assert_eq!(Refusal::Moved.mismatch(), None);
    }
}
