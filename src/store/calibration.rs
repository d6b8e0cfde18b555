//! Stored calibration of a motor and its encoder, with the setting that it holds for.
//!
//! A stored calibration is not trusted. Before current flows the axis checks it at the motor
//! (`motor::Calibration`, verification), and refuses one that was made with another setting.

use zerocopy::little_endian::{F32, I32, U16, U32};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

use super::record::{RecordError, Storable};
use crate::leg::{
    AbsoluteAngle, CounterDirection, ElectricalAngle, EncoderSetting, JointZero, StoredCalibration,
};
use crate::real::is_finite;
use crate::units::{Henry, Ohm};

/// Temperature from which that of a winding is counted, degrees Celsius.
const LOWEST_C: f32 = -100.0;
/// Contents without a zero of the joint.
const NO_ZERO: JointZero = JointZero { rotor: 0, joint: AbsoluteAngle::from_steps(0), setting: 0 };
const HAS_ZERO: u8 = 1;
const IS_ABSOLUTE: u8 = 2;

/// Calibration of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationRecord(pub StoredCalibration);

/// Layout in the flash, 32 bytes. The first schema had 24, with zeros instead of the temperature.
#[derive(Clone, Copy, Debug, Default, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct CalibrationLayout {
    resistance_ohm: F32,
    direct_henry: F32,
    quadrature_henry: F32,
    /// Offset in units of 2^-32 electrical turns.
    offset: I32,
    counts_per_turn: U32,
    pole_pairs: u8,
    /// Counter direction: 0 up, 1 down.
    counter: u8,
    /// Temperature of the winding, tenths of a kelvin above [`LOWEST_C`]; 0 where it is not known.
    winding_tenths: U16,
    /// Rotor position at the joint's zero.
    zero_rotor: I32,
    /// Reading of the joint's encoder there, and check of its setting.
    zero_joint: U16,
    zero_setting: u8,
    /// 1: the joint has a zero; 2: the rotor has an absolute encoder.
    flags: u8,
}

impl Storable for CalibrationRecord {
    type Layout = CalibrationLayout;
    const LENGTHS: &'static [usize] = &[
        {
            assert!(size_of::<CalibrationLayout>() == 32);
            24
        },
        32,
    ];

    fn to_layout(&self) -> CalibrationLayout {
        let StoredCalibration {
            resistance,
            direct_inductance,
            quadrature_inductance,
            offset,
            encoder,
            winding_c,
            joint_zero,
        } = self.0;
        let zero = joint_zero.unwrap_or(NO_ZERO);
        CalibrationLayout {
            resistance_ohm: F32::new(resistance.0),
            direct_henry: F32::new(direct_inductance.0),
            quadrature_henry: F32::new(quadrature_inductance.0),
            offset: I32::new(offset.units()),
            counts_per_turn: U32::new(encoder.counts_per_turn),
            pole_pairs: encoder.pole_pairs,
            counter: u8::from(encoder.counter == CounterDirection::Down),
            winding_tenths: U16::new(
                winding_c.map_or(0, |celsius| (10.0 * (celsius - LOWEST_C) + 0.5) as u16),
            ),
            zero_rotor: I32::new(zero.rotor),
            zero_joint: U16::new(zero.joint.steps()),
            zero_setting: zero.setting,
            flags: if joint_zero.is_some() { HAS_ZERO } else { 0 }
                | if encoder.absolute { IS_ABSOLUTE } else { 0 },
        }
    }

    fn from_layout(layout: &CalibrationLayout) -> Result<Self, RecordError> {
        let [resistance, direct, quadrature] =
            [layout.resistance_ohm, layout.direct_henry, layout.quadrature_henry].map(F32::get);
        let is_size = |value: f32| is_finite(value) && value > 0.0;
        let counter = match layout.counter {
            0 => CounterDirection::Up,
            1 => CounterDirection::Down,
            _ => return Err(RecordError::Range),
        };
        let counts_per_turn = layout.counts_per_turn.get();
        let makes_sense = [resistance, direct, quadrature].into_iter().all(is_size)
            && counts_per_turn > 0
            && layout.flags <= HAS_ZERO | IS_ABSOLUTE
            && layout.pole_pairs > 0;
        if !makes_sense {
            return Err(RecordError::Range);
        }
        Ok(Self(StoredCalibration {
            resistance: Ohm(resistance),
            direct_inductance: Henry(direct),
            quadrature_inductance: Henry(quadrature),
            offset: ElectricalAngle::from_units(layout.offset.get()),
            encoder: EncoderSetting {
                counter,
                pole_pairs: layout.pole_pairs,
                counts_per_turn,
                absolute: layout.flags & IS_ABSOLUTE != 0,
            },
            winding_c: match layout.winding_tenths.get() {
                0 => None,
                tenths => Some(LOWEST_C + f32::from(tenths) / 10.0),
            },
            joint_zero: (layout.flags & HAS_ZERO != 0).then(|| JointZero {
                rotor: layout.zero_rotor.get(),
                joint: AbsoluteAngle::from_steps(layout.zero_joint.get()),
                setting: layout.zero_setting,
            }),
        }))
    }
}
