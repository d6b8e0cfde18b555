//! Results of a passed calibration, and their persistent part.

use super::inductance::Inductances;
use crate::motor::{AbsoluteAngle, AxisConfiguration, CountScale, Direction, ElectricalAngle};
use crate::units::{Ampere, Henry, Ohm, Weber};

/// Part of a configuration on which the angle offset depends; with another setting the offset is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderSetting {
    /// Direction of the counter while the field turns from A over B to C.
    pub counter: Direction,
    /// Pole pairs of the motor.
    pub pole_pairs: u8,
    /// Counts per turn of the encoder.
    pub counts_per_turn: u32,
    /// Whether positions count from an absolute encoder's zero, not from an index.
    pub absolute: bool,
}

impl EncoderSetting {
    /// Encoder setting of an axis.
    pub const fn new(configuration: &AxisConfiguration) -> Self {
        Self {
            counter: configuration.counter,
            pole_pairs: configuration.pole_pairs,
            counts_per_turn: configuration.counts_per_turn,
            absolute: configuration.absolute,
        }
    }
}

/// Readings at the joint's zero, where an absolute encoder measures the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointZero {
    /// Rotor position within a turn, counts in the joint's sense from the index or the absolute encoder's
    /// zero.
    pub rotor: i32,
    /// Reading of the joint's encoder.
    pub joint: AbsoluteAngle,
    /// Check of the joint encoder's direction and the ratio, for which both readings hold.
    pub setting: u8,
}

/// Values that a calibration finds while the motor turns, and the uncertainty of all values: one standard
/// deviation, by the scatter of repeated measurements. Gain errors of the shunts and of the bus divider are
/// common to all repetitions, so they are not included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorFindings {
    /// Flux linkage of the magnets.
    pub flux: Weber,
    /// Quadrature current that friction takes at the calibration's speed.
    pub friction: Ampere,
    /// Quadrature current that the load takes on the path, positive against the field's forward direction.
    pub(crate) load: Ampere,
    /// Uncertainty of the resistance.
    pub resistance_sigma: Ohm,
    /// Uncertainty of the inductance along the flux.
    pub direct_sigma: Henry,
    /// Uncertainty of the inductance across the flux.
    pub quadrature_sigma: Henry,
    /// Uncertainty of the offset, electrical turns.
    pub offset_sigma_turns: f32,
    /// Uncertainty of the flux linkage.
    pub flux_sigma: Weber,
    /// Uncertainty of the friction.
    pub friction_sigma: Ampere,
}

/// Results of a passed calibration. Only a [`super::Calibrator`] can create it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    pub(super) encoder: EncoderSetting,
    pub(super) current_offsets: [f32; 2],
    pub(super) resistance: Ohm,
    pub(super) inductances: Inductances,
    pub(super) offset: ElectricalAngle,
    /// Counter at the end of the calibration, and the rotor position at that reading.
    pub(super) counter: u16,
    pub(super) position: i32,
    pub(super) indexed: bool,
    /// `None` where the motor has not turned, so that the offset is the stored one.
    pub(super) findings: Option<MotorFindings>,
}

/// Part of a calibration stored while the power is off: positions relative to the index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredCalibration {
    /// Resistance of one phase.
    pub resistance: Ohm,
    /// Inductance along the flux.
    pub direct_inductance: Henry,
    /// Inductance across the flux.
    pub quadrature_inductance: Henry,
    /// Electrical angle at the index, or at the absolute encoder's zero.
    pub offset: ElectricalAngle,
    /// Encoder setting of the calibrated configuration.
    pub encoder: EncoderSetting,
    /// Temperature of the winding at the calibration, degrees Celsius, by its model.
    pub winding_c: Option<f32>,
    /// The joint's zero, if a reference has set it.
    pub joint_zero: Option<JointZero>,
}

impl Calibration {
    /// Encoder setting of the calibrated configuration.
    pub(crate) fn encoder(&self) -> EncoderSetting {
        self.encoder
    }

    /// Whether rotor positions count from the index, or from the absolute encoder's zero.
    pub fn indexed(&self) -> bool {
        self.indexed
    }

    /// Whether the offset was measured with the motor turning. Otherwise it is the stored one, and
    /// [`Axis`](crate::motor::Axis) limits the first motion.
    pub fn is_proven(&self) -> bool {
        self.findings.is_some()
    }

    /// Flux, friction and uncertainties; `None` where the motor has not turned.
    pub fn findings(&self) -> Option<MotorFindings> {
        self.findings
    }

    /// Current-sensor offsets: shunt codes without current.
    pub fn current_offsets(&self) -> [f32; 2] {
        self.current_offsets
    }

    /// Resistance of one phase.
    pub fn resistance(&self) -> Ohm {
        self.resistance
    }

    /// Inductance along the flux.
    pub fn direct_inductance(&self) -> Henry {
        self.inductances.direct
    }

    /// Inductance across the flux.
    pub fn quadrature_inductance(&self) -> Henry {
        self.inductances.quadrature
    }

    /// Electrical angle at rotor position zero, which is the index, if there is one.
    pub fn offset(&self) -> ElectricalAngle {
        self.offset
    }

    /// Returns the part to store; `None` where positions count from neither an index nor an absolute encoder,
    /// because the counter resets with the power.
    pub fn stored(&self) -> Option<StoredCalibration> {
        self.indexed.then_some(StoredCalibration {
            resistance: self.resistance,
            direct_inductance: self.inductances.direct,
            quadrature_inductance: self.inductances.quadrature,
            offset: self.offset,
            encoder: self.encoder,
            winding_c: None,
            joint_zero: None,
        })
    }

    /// This calibration for a counter that began so many counts further. For tests of its
    /// wrapping, host only.
    #[cfg(not(target_os = "none"))]
    pub fn with_counter_moved(&self, offset: u16) -> Self {
        Self { counter: self.counter.wrapping_add(offset), ..*self }
    }

    /// Rotor position at a counter reading, counts from the index or the absolute encoder's zero, in the
    /// electrical direction. Since the calibration the counter may have moved by half of its range.
    pub(crate) fn position_of(&self, scale: &CountScale, direction: Direction, counter: u16) -> i32 {
        let moved = i32::from(counter.wrapping_sub(self.counter).cast_signed());
        scale.within_turn(self.position + direction.sign() * moved)
    }
}
