//! An accepted model as it is kept, with where it comes from.
//!
//! The model says which leg it belongs to by its fingerprint; [`Provenance`] says to a person what it was found with, so that a
//! model that looks odd a year later can be judged: which firmware, how often before, which random numbers, how warm, worn or
//! not, with which lengths and torque constants, and how well each joint's torque was explained.

use core::borrow::BorrowMut;

use zerocopy::little_endian::{F32, U32, U64};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

use super::record::{Kept, LONGEST, RecordError};
use crate::leg::{
    Constant, Fingerprint, Identification, IdentifiedModel, LegConfiguration, MotionWindow,
    PARAMETERS_PER_JOINT, StoredModel, Stribeck,
};
use crate::units::{Celsius, Metre, NewtonMetre, NewtonMetrePerAmpere};

/// Where one joint's parameters come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointProvenance {
    /// Distance to the joint before it, along the common normal.
    pub length: Metre,
    /// At the joint.
    pub torque_per_ampere: NewtonMetrePerAmpere,
    /// Root mean square of measured minus predicted, on a motion that was not identified from.
    pub rms: NewtonMetre,
    /// Mean of the absolute torque on it.
    pub mean_absolute: NewtonMetre,
}

/// Where a model comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Provenance<const N: usize> {
    /// Of the firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Counts the models that were accepted on this board.
    pub generation: u32,
    /// Of the swarm's random numbers.
    pub swarm_seed: u64,
    /// Of the warmer bridge when it was accepted; unknown without a thermistor.
    pub bridge: Option<Celsius>,
    /// A person wore the leg; unknown unless the operator said so.
    pub worn: Option<bool>,
    /// From the base.
    pub joints: [JointProvenance; N],
}

/// A model and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptModel<const N: usize> {
    /// As plain data.
    pub model: StoredModel<N>,
    /// To be told to whoever asks.
    pub provenance: Provenance<N>,
}

/// Firmware version: major, minor, patch.
const VERSION: [u8; 3] = version_of(env!("CARGO_PKG_VERSION").as_bytes());

/// Numbers of a version, up to 255 each; what follows the third is ignored.
const fn version_of(text: &[u8]) -> [u8; 3] {
    let mut version = [0; 3];
    let (mut place, mut part) = (0, 0);
    while place < text.len() && part < version.len() {
        match text[place] {
            digit @ b'0'..=b'9' => version[part] = 10 * version[part] + (digit - b'0'),
            _ => part += 1,
        }
        place += 1;
    }
    version
}

impl<const N: usize> KeptModel<N> {
    /// A model that was just accepted, with what its identification tells of it; generation and seed are its own.
    pub fn of<const B: usize, const TAPS: usize, const PENDING: usize, W>(
        configuration: &LegConfiguration<N, B>,
        identification: &Identification<N, B, TAPS, PENDING, W>,
        model: &IdentifiedModel<N>,
        generation: u32,
        swarm_seed: u64,
    ) -> Self
    where
        W: BorrowMut<MotionWindow<f32, N, B>>,
    {
        let estimate = identification.estimate();
        let fit = |joint: usize| identification.fit(estimate.as_ref()?, 1, joint);
        let mut joints = configuration.joints.each_ref().map(|joint| JointProvenance {
            length: Metre(0.0),
            torque_per_ampere: joint.scale.torque_per_ampere,
            rms: NewtonMetre(f32::NAN),
            mean_absolute: NewtonMetre(f32::NAN),
        });
        for (joint, from) in joints.iter_mut().enumerate() {
            from.length = Metre(configuration.model.chain.distance_to(joint).unwrap_or(0.0));
            if let Some(fit) = fit(joint) {
                from.rms = NewtonMetre(fit.rms_nm.unwrap_or(f32::NAN));
                from.mean_absolute = NewtonMetre(fit.mean_absolute_nm);
            }
        }
        Self {
            model: configuration.keep(model),
            provenance: Provenance {
                firmware: VERSION,
                generation,
                swarm_seed,
                bridge: None,
                worn: None,
                joints,
            },
        }
    }
}

/// One joint in the flash; 81 bytes.
#[derive(Clone, Copy, Debug, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct JointLayout {
    parameters: [F32; PARAMETERS_PER_JOINT],
    stribeck_excess: F32,
    stribeck_velocity: F32,
    /// 0 offset, 1 asymmetry.
    constant: u8,
    length_m: F32,
    torque_per_ampere: F32,
    rms_nm: F32,
    mean_absolute_nm: F32,
}

/// In the flash; 28 bytes and the joints'.
#[derive(Clone, Copy, Debug, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct ModelLayout<const N: usize> {
    fingerprint: U64,
    firmware: [u8; 3],
    generation: U32,
    swarm_seed: U64,
    /// NaN: unknown.
    bridge_celsius: F32,
    /// 0 no, 1 yes, 2 unknown.
    worn: u8,
    joints: [JointLayout; N],
}

impl<const N: usize> Default for ModelLayout<N> {
    fn default() -> Self {
        let zero = F32::new(0.0);
        Self {
            fingerprint: U64::new(0),
            firmware: [0; 3],
            generation: U32::new(0),
            swarm_seed: U64::new(0),
            bridge_celsius: F32::new(f32::NAN),
            worn: 2,
            joints: [JointLayout {
                parameters: [zero; PARAMETERS_PER_JOINT],
                stribeck_excess: zero,
                stribeck_velocity: F32::new(1.0),
                constant: 0,
                length_m: zero,
                torque_per_ampere: zero,
                rms_nm: zero,
                mean_absolute_nm: zero,
            }; N],
        }
    }
}

impl<const N: usize> Kept for KeptModel<N> {
    type Layout = ModelLayout<N>;
    const LENGTHS: &'static [usize] = &[{
        let length = 28 + 81 * N;
        assert!(length == size_of::<ModelLayout<N>>() && length <= LONGEST);
        length
    }];

    fn to_layout(&self) -> ModelLayout<N> {
        let Self { model, provenance } = self;
        ModelLayout {
            fingerprint: U64::new(model.fingerprint.0),
            firmware: provenance.firmware,
            generation: U32::new(provenance.generation),
            swarm_seed: U64::new(provenance.swarm_seed),
            bridge_celsius: F32::new(provenance.bridge.map_or(f32::NAN, |bridge| bridge.0)),
            worn: provenance.worn.map_or(2, u8::from),
            joints: core::array::from_fn(|joint| {
                let (curve, from) = (&model.stribeck[joint], &provenance.joints[joint]);
                JointLayout {
                    parameters: model.parameters[joint].map(F32::new),
                    stribeck_excess: F32::new(curve.excess),
                    stribeck_velocity: F32::new(curve.velocity),
                    constant: u8::from(model.constant[joint] == Constant::Asymmetry),
                    length_m: F32::new(from.length.0),
                    torque_per_ampere: F32::new(from.torque_per_ampere.0),
                    rms_nm: F32::new(from.rms.0),
                    mean_absolute_nm: F32::new(from.mean_absolute.0),
                }
            }),
        }
    }

    /// Numbers and curves are judged by `LegConfiguration::restore`, the only way of a kept model into use.
    fn from_layout(layout: &ModelLayout<N>) -> Result<Self, RecordError> {
        let worn = match layout.worn {
            0 => Some(false),
            1 => Some(true),
            2 => None,
            _ => return Err(RecordError::Range),
        };
        let mut constant = [Constant::Offset; N];
        for (constant, joint) in constant.iter_mut().zip(&layout.joints) {
            *constant = match joint.constant {
                0 => Constant::Offset,
                1 => Constant::Asymmetry,
                _ => return Err(RecordError::Range),
            };
        }
        let bridge = layout.bridge_celsius.get();
        Ok(Self {
            model: StoredModel {
                fingerprint: Fingerprint(layout.fingerprint.get()),
                parameters: layout.joints.map(|joint| joint.parameters.map(F32::get)),
                stribeck: layout.joints.map(|joint| Stribeck {
                    excess: joint.stribeck_excess.get(),
                    velocity: joint.stribeck_velocity.get(),
                }),
                constant,
            },
            provenance: Provenance {
                firmware: layout.firmware,
                generation: layout.generation.get(),
                swarm_seed: layout.swarm_seed.get(),
                bridge: (!bridge.is_nan()).then_some(Celsius(bridge)),
                worn,
                joints: layout.joints.map(|joint| JointProvenance {
                    length: Metre(joint.length_m.get()),
                    torque_per_ampere: NewtonMetrePerAmpere(joint.torque_per_ampere.get()),
                    rms: NewtonMetre(joint.rms_nm.get()),
                    mean_absolute: NewtonMetre(joint.mean_absolute_nm.get()),
                }),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::version_of;

    #[test]
    fn a_version_is_read_number_by_number() {
        assert_eq!(version_of(b"0.1.0"), [0, 1, 0]);
        assert_eq!(version_of(b"12.205.39"), [12, 205, 39]);
        assert_eq!(version_of(b"1.2.3-rc.4"), [1, 2, 3]);
        assert_eq!(version_of(b"7"), [7, 0, 0]);
    }
}
