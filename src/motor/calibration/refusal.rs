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

impl Refusal {
    /// Both values of a contradiction to the leg file or to the stored calibration.
    #[must_use]
    pub const fn mismatch(self) -> Option<Mismatch> {
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
        for (stated, found, contradicts) in [
            (2.0, 2.49, false),
            (2.0, 1.51, false),
            (2.0, 2.51, true),
            (2.0, 1.49, true),
            (2.0, f32::NAN, true),
        ] {
            assert_eq!(Mismatch::beyond(0.25, stated, found).is_some(), contradicts, "{found}");
        }
        assert_eq!(Mismatch::beyond(0.25, 2.0, 4.0), Some(Mismatch { stated: 2.0, found: 4.0 }));
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
