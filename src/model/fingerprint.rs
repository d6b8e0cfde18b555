//! Fingerprint of a leg: shows whether a stored model belongs to the leg that is to use it.
//!
//! The parameters of one leg move another one wrongly, and the numbers themselves do not show it. The leg's
//! description is therefore condensed to 64 bits, stored beside the parameters, and compared before their
//! use.
//!
//! ```text
//! fingerprint = CRC-64/XZ of  version, N, then per joint from the base:
//!               sin alpha, cos alpha in steps of 2^-16; a, d, direction, zero offset, torque per ampere
//!               as f32 bits, the last negative where the drive is mounted mirrored, as on a left leg
//! ```
//!
//! | covered | not covered |
//! | --- | --- |
//! | number and order of the joints, axes and lengths | gravity: an argument of every torque |
//! | sense and zero of each joint's angle, side of the body | encoder counts, gear ratio |
//! | torque constants: all parameters are in their units | limits, gains, prior, names, estimated columns |
//!
//! Sines are in steps because a board may compute them in `f32` and the host in `f64`. All other numbers are
//! rounded to `f32` once and compared exactly; -0 equals 0. A twist close to the edge of a step, with the two
//! precisions on either side, is refused: one in a hundred, but no multiple of 5 degrees.
//!
//! Source of the code: ECMA-182, reflected (the catalogue's CRC-64/XZ), by the crate `crc` without its table.
//! The code detects mistakes, not manipulation. Cost: 25 bytes a joint, some 10 instructions a bit; once per
//! model, outside the tick.

use crc::{CRC_64_XZ, Crc, Digest, NoTable};

use super::anatomy::AnatomicalJoint;
use super::chain::Chain;

const CODE: Crc<u64, NoTable> = Crc::<u64, NoTable>::new(&CRC_64_XZ);

/// Version of the covered fields and their coding: a fingerprint of another version never fits.
const VERSION: u8 = 1;

/// Steps per unit of a sine or cosine.
const STEPS: f32 = (1_u32 << 16) as f32;

/// Description of the leg that a model was identified with, in 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub u64);

impl Fingerprint {
    /// Computes the fingerprint. The torque constants (N m/A at the joint) are negative where the drive is
    /// mounted mirrored.
    pub fn new<const N: usize>(
        chain: &Chain<f32, N>,
        anatomy: &[AnatomicalJoint<f32>; N],
        torque_per_ampere: &[f32; N],
    ) -> Self {
        let mut digest = CODE.digest();
        digest.update(&[VERSION]);
        digest.update(&(N as u32).to_le_bytes());
        let joints = chain.numbers().into_iter().zip(anatomy).zip(torque_per_ampere);
        for (((sin_alpha, cos_alpha, a, d), anatomy), &constant) in joints {
            for share in [sin_alpha, cos_alpha] {
                digest.update(&nearest_step(share).to_le_bytes());
            }
            digest.update(&[u8::from(anatomy.direction() < 0.0)]);
            for number in [a, d, anatomy.zero_offset(), constant] {
                take(&mut digest, number);
            }
        }
        Self(digest.finalize())
    }
}

fn nearest_step(share: f32) -> i32 {
    let steps = share * STEPS;
    (if steps < 0.0 { steps - 0.5 } else { steps + 0.5 }) as i32
}

fn take(digest: &mut Digest<'_, u64, NoTable>, number: f32) {
    // Adding 0 turns -0 into 0.
    digest.update(&(number + 0.0).to_bits().to_le_bytes());
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{FRAC_PI_3, PI};

    use super::super::chain::DenavitHartenberg;
    use super::*;

    const GEOMETRY: [DenavitHartenberg<f64>; 2] = [
        DenavitHartenberg { alpha: 0.0, a: 0.0, d: 0.0 },
        DenavitHartenberg { alpha: FRAC_PI_3, a: 0.39, d: 0.02 },
    ];
    const DIRECTIONS: [i32; 2] = [1, -1];
    const OFFSETS: [f32; 2] = [0.0, 0.1];
    const CONSTANTS: [f32; 2] = [1.5, 1.5];

    fn fingerprint(
        geometry: [DenavitHartenberg<f64>; 2],
        directions: [i32; 2],
        offsets: [f32; 2],
        constants: [f32; 2],
    ) -> Fingerprint {
        let anatomy =
            core::array::from_fn(|joint| AnatomicalJoint::new(directions[joint], offsets[joint]).unwrap());
        Fingerprint::new(&Chain::new(&geometry).unwrap().convert(), &anatomy, &constants)
    }

    fn own() -> Fingerprint {
        fingerprint(GEOMETRY, DIRECTIONS, OFFSETS, CONSTANTS)
    }

    #[test]
    fn every_covered_number_changes_the_fingerprint() {
        let changed = |joint: usize, change: &dyn Fn(&mut DenavitHartenberg<f64>)| {
            let mut geometry = GEOMETRY;
            change(&mut geometry[joint]);
            fingerprint(geometry, DIRECTIONS, OFFSETS, CONSTANTS)
        };
        let mut others = Vec::new();
        for joint in 0..2 {
            others.push(changed(joint, &|numbers| numbers.alpha += 5e-5));
            others.push(changed(joint, &|numbers| numbers.alpha += PI));
            others.push(changed(joint, &|numbers| numbers.a += 1e-6));
            others.push(changed(joint, &|numbers| numbers.d += 1e-6));
            let mut directions = DIRECTIONS;
            directions[joint] = -directions[joint];
            others.push(fingerprint(GEOMETRY, directions, OFFSETS, CONSTANTS));
            let mut offsets = OFFSETS;
            offsets[joint] += 1e-6;
            others.push(fingerprint(GEOMETRY, DIRECTIONS, offsets, CONSTANTS));
            let mut constants = CONSTANTS;
            constants[joint] *= 1.000_001;
            others.push(fingerprint(GEOMETRY, DIRECTIONS, OFFSETS, constants));
        }
        others.push(fingerprint([GEOMETRY[1], GEOMETRY[0]], DIRECTIONS, OFFSETS, CONSTANTS));
        others.push(own());
        for (index, one) in others.iter().enumerate() {
            assert!(!others[..index].contains(one), "change {index} is not seen");
        }
    }

    #[test]
    fn the_precision_in_which_a_sine_was_computed_and_the_sign_of_zero_do_not_matter() {
        let single = GEOMETRY.map(|numbers| DenavitHartenberg {
            alpha: numbers.alpha as f32,
            a: numbers.a as f32,
            d: numbers.d as f32,
        });
        let anatomy =
            [AnatomicalJoint::new(1, -0.0_f32).unwrap(), AnatomicalJoint::new(-1, OFFSETS[1]).unwrap()];
        let chain = Chain::new(&single).unwrap();
        let double = Chain::new(&GEOMETRY).unwrap();
        assert_ne!(chain, double.convert(), "the sines differ, or this tests nothing");
        assert_eq!(Fingerprint::new(&chain, &anatomy, &CONSTANTS), own());
    }

    #[test]
    fn a_fingerprint_stays_what_it_was() {
        // The number is stored in files and in flash: a change requires a new
        // version. Computed by another program.
        assert_eq!(own(), Fingerprint(211_407_862_034_066_059));
    }
}
