//! Maps coordinates in a box to a curve within the limits of angle, speed and acceleration.
//!
//! ```text
//! s_k = x / k,  c_k = x' / k           x, x' in -1..1, k = 1..H
//! curve -> stretched to the share `g` of the inner range, g in 0.3..1, moved by `m` of the free rest
//! g is lowered until speed and acceleration, blends included, keep their limits
//! ```
//!
//! Every point of the box is thus a curve that the firmware accepts; only torque remains a condition. The
//! inner range leaves the share [`RANGE_MARGIN`] free at both ends for errors of the position loop.

use scarab::motion::{Fourier, HARMONICS, JointEnvelope};
use scarab::units::{Radian, Second};

/// Share of the range left free at both ends.
pub(crate) const RANGE_MARGIN: f32 = 0.06;
/// Largest used share of the speed and acceleration limits; the rest is for overshoot of the position loop.
pub(crate) const RATE_SHARE: f32 = 0.9;
/// Smallest share of the inner range.
const LEAST_SHARE: f64 = 0.3;

/// Coordinates of each joint: its amplitudes, the share of the range and the position in it.
pub(crate) const PER_JOINT: usize = 2 * HARMONICS + 2;

/// Curve at a point of the box; `None` only if the coordinates define no curve.
pub fn curve<const N: usize>(
    coordinates: &[f64],
    period: Second,
    blend: Second,
    limits: &[JointEnvelope; N],
) -> Option<Fourier<N>> {
    let of = |joint: usize| coordinates.get(joint * PER_JOINT..(joint + 1) * PER_JOINT);
    let amplitudes = |first: usize| -> Option<[[f32; HARMONICS]; N]> {
        let mut amplitudes = [[0.0; HARMONICS]; N];
        for (joint, amplitudes) in amplitudes.iter_mut().enumerate() {
            for (order, (amplitude, coordinate)) in
                amplitudes.iter_mut().zip(of(joint)?.get(first..)?).enumerate()
            {
                *amplitude = (*coordinate / (order + 1) as f64) as f32;
            }
        }
        Some(amplitudes)
    };
    let raw = Fourier::new(period, [0.0; N], amplitudes(0)?, amplitudes(HARMONICS)?).ok()?;
    let envelope = raw.envelope();
    let (mut scale, mut offset) = ([1.0; N], [Radian(0.0); N]);
    for joint in 0..N {
        let [.., share, centre] = of(joint)? else { return None };
        let (bound, limit) = (&envelope[joint], &limits[joint]);
        let span = (limit.high.0 - limit.low.0) * (1.0 - 2.0 * RANGE_MARGIN);
        let width = bound.high.0 - bound.low.0;
        let acceleration = bound.acceleration.0 + 1.5 * bound.speed.0 / blend.0;
        if !(width > 1e-6) {
            return None;
        }
        let share = LEAST_SHARE + (1.0 - LEAST_SHARE) * 0.5 * (1.0 + share.clamp(-1.0, 1.0));
        scale[joint] = (share as f32 * span / width)
            .min(RATE_SHARE * limit.speed.0 / bound.speed.0)
            .min(RATE_SHARE * limit.acceleration.0 / acceleration);
        let free = span - scale[joint] * width;
        let middle = 0.5 * (limit.low.0 + limit.high.0) + 0.5 * free * centre.clamp(-1.0, 1.0) as f32;
        offset[joint] = Radian(middle - scale[joint] * 0.5 * (bound.low.0 + bound.high.0));
    }
    raw.mapped(scale, offset).ok()
}
