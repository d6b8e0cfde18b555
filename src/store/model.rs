//! Stored form of an accepted model, with its provenance.
//!
//! The fingerprint says which leg the model belongs to. [`Provenance`] lets a person judge a model that looks
//! odd a year later. It holds the firmware version, the number of earlier models, the random seed, the bridge
//! temperature, and whether the leg was worn. For each joint it holds length, torque constant and fit.

use core::borrow::BorrowMut;

use zerocopy::little_endian::{F32, U32, U64};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

use super::Key;
use super::record::{LONGEST, RecordError, Storable};
use crate::leg::{
    Assured, Constant, Fingerprint, Identification, IdentifiedModel, LegConfiguration, MotionWindow,
    PARAMETERS_PER_JOINT, StoredModel, Stribeck, Wearing,
};
use crate::units::{Celsius, Metre, NewtonMetre, NewtonMetrePerAmpere};

/// Provenance of one joint's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointProvenance {
    /// Distance to the joint before it, along the common normal.
    pub length: Metre,
    /// Torque constant at the joint.
    pub torque_per_ampere: NewtonMetrePerAmpere,
    /// Root mean square of measured minus predicted torque, on a held-out motion.
    pub rms: NewtonMetre,
    /// Mean of the absolute torque on that motion.
    pub mean_absolute: NewtonMetre,
}

/// Provenance of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Provenance<const N: usize> {
    /// Firmware version: major, minor, patch.
    pub firmware: [u8; 3],
    /// Number of models accepted on this board.
    pub generation: u32,
    /// Seed of the swarm's random generator.
    pub swarm_seed: u64,
    /// Temperature of the warmer bridge at acceptance; the firmware does not fill it yet.
    pub bridge: Option<Celsius>,
    /// True if the leg was worn; unknown unless the operator said so.
    pub worn: Option<bool>,
    /// Provenance of each joint, from the base.
    pub joints: [JointProvenance; N],
}

impl<const N: usize> Provenance<N> {
    /// Whether the identified leg was empty or worn, if known.
    pub fn wearing(&self) -> Option<Wearing> {
        self.worn.map(|worn| if worn { Wearing::Worn } else { Wearing::Empty })
    }
}

/// A model with its provenance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelRecord<const N: usize> {
    /// The model as plain data.
    pub model: StoredModel<N>,
    /// Provenance, for reports.
    pub provenance: Provenance<N>,
}

/// Firmware version: major, minor, patch.
const VERSION: [u8; 3] = version_of(env!("CARGO_PKG_VERSION").as_bytes());

/// Parses a version: numbers up to 255 each; text after the third is ignored.
const fn version_of(text: &[u8]) -> [u8; 3] {
    let mut version = [0; 3];
    let (mut index, mut part) = (0, 0);
    while index < text.len() && part < version.len() {
        match text[index] {
            digit @ b'0'..=b'9' => version[part] = 10 * version[part] + (digit - b'0'),
            _ => part += 1,
        }
        index += 1;
    }
    version
}

impl<const N: usize> ModelRecord<N> {
    /// Key under which the record is stored: a worn leg's model has its own.
    pub fn key(&self) -> Key {
        match self.provenance.wearing() {
            Some(Wearing::Worn) => Key::WornModel,
            Some(Wearing::Empty) | None => Key::Model,
        }
    }

    /// Builds the stored form of a newly accepted model from its identification, with the given generation
    /// and seed; `wearing` is unknown unless the operator set it.
    pub fn new<const B: usize, const TAPS: usize, const PENDING: usize, W>(
        configuration: &LegConfiguration<N, B>,
        identification: &Identification<N, B, TAPS, PENDING, W>,
        model: &IdentifiedModel<N>,
        generation: u32,
        swarm_seed: u64,
        wearing: Option<Wearing>,
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
            model: configuration.to_stored(model),
            provenance: Provenance {
                firmware: VERSION,
                generation,
                swarm_seed,
                bridge: None,
                worn: wearing.map(|wearing| wearing == Wearing::Worn),
                joints,
            },
        }
    }
}

/// Layout of one joint in the flash, 81 bytes.
#[derive(Clone, Copy, Debug, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub(crate) struct JointLayout {
    parameters: [F32; PARAMETERS_PER_JOINT],
    stribeck_excess: F32,
    stribeck_velocity: F32,
    /// Meaning of the constant torque: 0 offset, 1 asymmetry.
    constant: u8,
    length_m: F32,
    torque_per_ampere: F32,
    rms_nm: F32,
    mean_absolute_nm: F32,
}

/// Layout in the flash: 28 bytes, 81 for each joint; since schema 2 also 4, and 8 for each joint.
#[derive(Clone, Copy, Debug, FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct ModelLayout<const N: usize> {
    fingerprint: U64,
    firmware: [u8; 3],
    generation: U32,
    swarm_seed: U64,
    /// Bridge temperature; NaN if unknown.
    bridge_celsius: F32,
    /// Leg worn: 0 no, 1 yes, 2 unknown.
    worn: u8,
    joints: [JointLayout; N],
    /// Lower bounds of Coulomb and viscous friction, added in schema 2.
    coulomb_bound_nm: [F32; N],
    viscous_bound: [F32; N],
    /// Certain share of the inertia, added in schema 2.
    inertia_share: F32,
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
            coulomb_bound_nm: [zero; N],
            viscous_bound: [zero; N],
            inertia_share: zero,
        }
    }
}

impl<const N: usize> Storable for ModelRecord<N> {
    type Layout = ModelLayout<N>;
    const LENGTHS: &'static [usize] = &[28 + 81 * N, {
        let length = 28 + 81 * N + 4 * (2 * N + 1);
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
            coulomb_bound_nm: model.assured.coulomb_nm.map(F32::new),
            viscous_bound: model.assured.viscous.map(F32::new),
            inertia_share: F32::new(model.assured.inertia_share),
        }
    }

    /// Checks only the closed lists: `LegConfiguration::restore`, the only way into
    /// use, checks numbers, curves and bounds.
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
                assured: Assured {
                    coulomb_nm: layout.coulomb_bound_nm.map(F32::get),
                    viscous: layout.viscous_bound.map(F32::get),
                    inertia_share: layout.inertia_share.get(),
                },
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
