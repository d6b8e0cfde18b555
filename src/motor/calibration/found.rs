//! What a passed calibration found, and what of it outlives the power.

use super::inductance::Inductances;
use crate::motor::{AxisConfiguration, CountScale, Direction, ElectricalAngle};
use crate::units::{Henry, Ohm};

/// The part of a configuration on which an offset depends: with another one it is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderSetting {
    /// How the counter runs while the field turns from A over B to C.
    pub counter: Direction,
    /// Of the motor.
    pub pole_pairs: u8,
    /// Of the encoder.
    pub counts_per_turn: u32,
}

impl EncoderSetting {
    /// Of an axis.
    #[must_use]
    pub const fn of(configuration: &AxisConfiguration) -> Self {
        Self {
            counter: configuration.counter,
            pole_pairs: configuration.pole_pairs,
            counts_per_turn: configuration.counts_per_turn,
        }
    }
}

/// What a passed calibration found. There is no other way to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    pub(super) encoder: EncoderSetting,
    pub(super) zeros: [f32; 2],
    pub(super) resistance: Ohm,
    pub(super) inductances: Inductances,
    pub(super) offset: ElectricalAngle,
    /// The counter at the end, and the place within a turn it stands for.
    pub(super) counter: u16,
    pub(super) place: i32,
    pub(super) indexed: bool,
}

/// What is worth keeping of a calibration while the power is off: places relative to the index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredCalibration {
    /// Of one phase.
    pub resistance: Ohm,
    /// Along the flux.
    pub direct_inductance: Henry,
    /// Across the flux.
    pub quadrature_inductance: Henry,
    /// Electrical angle at the index.
    pub offset: ElectricalAngle,
    /// With which configuration it was found.
    pub encoder: EncoderSetting,
}

impl Calibration {
    /// With which configuration it was found.
    #[must_use]
    pub fn encoder(&self) -> EncoderSetting {
        self.encoder
    }

    /// Whether places count from the index.
    #[must_use]
    pub fn indexed(&self) -> bool {
        self.indexed
    }

    /// Codes of the shunts without current.
    #[must_use]
    pub fn zeros(&self) -> [f32; 2] {
        self.zeros
    }

    /// Of one phase.
    #[must_use]
    pub fn resistance(&self) -> Ohm {
        self.resistance
    }

    /// Along the flux.
    #[must_use]
    pub fn direct_inductance(&self) -> Henry {
        self.inductances.direct
    }

    /// Across the flux.
    #[must_use]
    pub fn quadrature_inductance(&self) -> Henry {
        self.inductances.quadrature
    }

    /// Electrical angle at the place from which counts within a turn are counted: the index, if there is one.
    #[must_use]
    pub fn offset(&self) -> ElectricalAngle {
        self.offset
    }

    /// Electrical angle at a counter reading; the counter may have moved by half of its range since the calibration.
    #[must_use]
    pub fn angle_at(&self, scale: &CountScale, direction: Direction, counter: u16) -> ElectricalAngle {
        scale.angle(self.place_of(scale, direction, counter)).plus(self.offset)
    }

    /// What can be kept; nothing without an index, because the counter forgets.
    #[must_use]
    pub fn stored(&self) -> Option<StoredCalibration> {
        self.indexed.then_some(StoredCalibration {
            resistance: self.resistance,
            direct_inductance: self.inductances.direct,
            quadrature_inductance: self.inductances.quadrature,
            offset: self.offset,
            encoder: self.encoder,
        })
    }

    /// The same, had the counter begun so many counts further: for tests of where it wraps, on the host alone.
    #[cfg(not(target_os = "none"))]
    #[must_use]
    pub fn with_counter_moved(&self, offset: u16) -> Self {
        Self { counter: self.counter.wrapping_add(offset), ..*self }
    }

    pub(in crate::motor) fn place_of(&self, scale: &CountScale, direction: Direction, counter: u16) -> i32 {
        let moved = i32::from(counter.wrapping_sub(self.counter).cast_signed());
        scale.within_turn(self.place + direction.sign() * moved)
    }
}
