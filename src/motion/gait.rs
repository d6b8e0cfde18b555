//! The walking pattern of the paper, repaired, closed and written as a Fourier curve.
//!
//! Why not the printed equations: they leave the range that the paper states, they are not periodic, and the
//! knee's reaches 625 degrees. Tian et al. print, for the flexion in degrees at `t` per cent of the cycle,
//!
//! ```text
//! (31)  hip  = 118.7 sin(0.092 t + 0.016) + 3.085 sin(0.025 t + 1.632) + 111.8 sin(0.0938 t + 3.02)
//! (32)  knee = -5089 e^-((t-76.25)/13.44)^2 + 5677 e^-((t-75.76)/12.88)^2 + 5.3288 e^-((t-19.74)/23.41)^2
//! ```
//!
//! The repair, step by step:
//!
//! 1. Use 508.9 and 567.7 for 5089 and 5677: the knee then spans 75.6 degrees, and a 6.5 s cycle accelerates
//!    it by 5.4 rad/s^2 at 4.8 s, which the paper reports as 5.2 rad/s^2 at 4.8 s.
//! 2. Close the curve: a straight line through the middle of the cycle removes the jump from 100 % back to 0
//!    (hip -15.0, knee -8.6 degrees). No point moves by more than half of the jump.
//! 3. Take the Fourier series of the closed curve up to the sixth harmonic. The series stays within 0.70
//!    (hip) and 0.72 degrees (knee) of the closed curve, farthest at the kink where the cycle closes.
//! 4. Add an offset, 25.0 and 23.7 degrees, that puts each joint into the middle of the paper's
//!    working range of 2.17..50.18 (hip) and 6.85..95.53 degrees (knee). The joints then span
//!    15.0..37.4 and 14.3..88.2 degrees.
//!
//! The coefficients below are the result of these steps; a test derives them again from the equations. Angles
//! are anatomical: flexion positive at both joints.

use super::{Fourier, HARMONICS, MotionError};
use crate::real::{abs, is_finite, max};
use crate::units::{Radian, Second};

/// A joint of the walking pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GaitJoint {
    /// Hip flexion.
    Hip,
    /// Knee flexion.
    Knee,
}

/// Offset and amplitudes of one joint, degrees.
struct Pattern {
    centre_deg: f32,
    sine_deg: [f32; HARMONICS],
    cosine_deg: [f32; HARMONICS],
}

const HIP: Pattern = Pattern {
    centre_deg: 27.5383,
    sine_deg: [-4.6368, 2.2862, 0.3776, 0.1380, 0.0666, 0.0374],
    cosine_deg: [9.8779, 0.3370, -0.4584, -0.2764, -0.1791, -0.1248],
};

const KNEE: Pattern = Pattern {
    centre_deg: 34.2765,
    sine_deg: [-17.5317, 5.1743, 10.9580, -0.9542, -1.7196, -0.0872],
    cosine_deg: [-4.5121, -16.8834, 3.0951, 5.4302, 0.1088, -0.2076],
};

impl GaitJoint {
    const fn pattern(self) -> &'static Pattern {
        match self {
            Self::Hip => &HIP,
            Self::Knee => &KNEE,
        }
    }
}

/// Walking pattern of a leg with these `joints`, anatomical angles in rad, one cycle per `period`.
pub fn curve<const N: usize>(joints: [GaitJoint; N], period: Second) -> Result<Fourier<N>, MotionError> {
    let radian = |degree: f32| degree.to_radians();
    Fourier::new(
        period,
        joints.map(|joint| radian(joint.pattern().centre_deg)),
        joints.map(|joint| joint.pattern().sine_deg.map(radian)),
        joints.map(|joint| joint.pattern().cosine_deg.map(radian)),
    )
}

/// Stretches and shifts a curve so that each joint's proven range becomes the given `(low, high)`.
///
/// For legs with another range than the paper's. A joint that does not move gets the middle of its range.
pub fn mapped_into<const N: usize, const H: usize>(
    curve: Fourier<N, H>,
    ranges: [(Radian, Radian); N],
) -> Result<Fourier<N, H>, MotionError> {
    let envelope = curve.envelope();
    let (mut scale, mut offset) = ([1.0; N], [Radian::ZERO; N]);
    for joint in 0..N {
        let (low, high) = (ranges[joint].0.0, ranges[joint].1.0);
        if !(low < high && is_finite(low) && is_finite(high)) {
            return Err(MotionError::Range { joint });
        }
        let (curve_low, curve_high) = (envelope[joint].low.0, envelope[joint].high.0);
        // Narrower by the possible rounding of the stretched coefficients and the new centre.
        let rounding = 1e-5 * (high - low) + 32.0 * f32::EPSILON * max(abs(low), abs(high));
        let factor = (high - low - rounding) / (curve_high - curve_low);
        scale[joint] = if factor > 0.0 && factor < 1e4 { factor } else { 1.0 };
        offset[joint] = Radian(0.5 * (low + high) - scale[joint] * 0.5 * (curve_low + curve_high));
    }
    curve.mapped(scale, offset)
}

#[cfg(test)]
mod tests {
    use super::super::Phase;
    use super::*;
    use crate::real::{exp, sin_cos};
    use core::f64::consts::TAU;

    const JOINTS: [GaitJoint; 2] = [GaitJoint::Hip, GaitJoint::Knee];
    /// Angle that step 4 adds, degrees.
    const OFFSET_DEG: [f64; 2] = [25.0, 23.7];
    /// The paper's working range, degrees.
    const WORKING_RANGE_DEG: [(f32, f32); 2] = [(2.17, 50.18), (6.85, 95.53)];

    /// Equation (31), or (32) with a tenth of its two large amplitudes: degrees at `percent` of the cycle.
    fn repaired_deg(joint: GaitJoint, percent: f64) -> f64 {
        let bell = |height: f64, centre: f64, width: f64| {
            let x = (percent - centre) / width;
            height * exp(-(x * x))
        };
        let wave = |height: f64, rate: f64, phase: f64| height * sin_cos(rate * percent + phase).0;
        match joint {
            GaitJoint::Hip => {
                wave(118.7, 0.092, 0.016) + wave(3.085, 0.025, 1.632) + wave(111.8, 0.0938, 3.02)
            }
            GaitJoint::Knee => {
                bell(-508.9, 76.25, 13.44) + bell(567.7, 75.76, 12.88) + bell(5.3288, 19.74, 23.41)
            }
        }
    }

    /// Repaired curve without its jump (step 2), degrees at `percent` of the cycle.
    fn closed_deg(joint: GaitJoint, percent: f64) -> f64 {
        let jump = repaired_deg(joint, 100.0) - repaired_deg(joint, 0.0);
        repaired_deg(joint, percent) - jump * (percent / 100.0 - 0.5)
    }

    /// Step 3 in double precision by the discrete transform; 4,096 points alias only harmonics above 4,090.
    fn series(joint: GaitJoint) -> (f64, [f64; HARMONICS], [f64; HARMONICS]) {
        const POINTS: usize = 4096;
        let value = |point: usize| closed_deg(joint, 100.0 * point as f64 / POINTS as f64);
        let mean = (0..POINTS).map(value).sum::<f64>() / POINTS as f64;
        let project = |pick: fn((f64, f64)) -> f64| {
            core::array::from_fn(|index| {
                let angle = |point: usize| TAU * ((index + 1) * point) as f64 / POINTS as f64;
                (0..POINTS).map(|point| value(point) * pick(sin_cos(angle(point)))).sum::<f64>() * 2.0
                    / POINTS as f64
            })
        };
        (mean, project(|pair| pair.0), project(|pair| pair.1))
    }

    #[test]
    fn coefficients_are_the_fourier_series_of_the_repaired_and_closed_equations() {
        for (joint, offset_deg) in JOINTS.into_iter().zip(OFFSET_DEG) {
            let (mean, sine, cosine) = series(joint);
            let pattern = joint.pattern();
            // The table holds four decimals of a degree.
            let near = |table: f32, exact: f64| (f64::from(table) - exact).abs() < 6e-5;
            assert!(near(pattern.centre_deg, mean + offset_deg), "{joint:?} {mean}");
            for index in 0..HARMONICS {
                assert!(near(pattern.sine_deg[index], sine[index]), "{joint:?} {sine:?}");
                assert!(near(pattern.cosine_deg[index], cosine[index]), "{joint:?} {cosine:?}");
            }
        }
    }

    #[test]
    fn the_series_stays_within_the_stated_deviation_of_the_closed_curve() {
        let curve = curve(JOINTS, Second(6.5)).expect("constant");
        for (index, (joint, stated)) in JOINTS.into_iter().zip([0.70, 0.72]).enumerate() {
            let mut worst = 0.0_f64;
            for step in 0..2000 {
                let percent = f64::from(step) * 0.05;
                let state = curve.state_at(&Phase::steady(percent as f32 / 100.0));
                let closed = closed_deg(joint, percent) + OFFSET_DEG[index];
                worst = worst.max((f64::from(state.position_rad[index]).to_degrees() - closed).abs());
            }
            assert!(worst < stated && worst > 0.9 * stated, "{joint:?} {worst}");
        }
    }

    #[test]
    fn the_repaired_knee_accelerates_by_five_point_four_at_four_point_eight_seconds() {
        // Second differences over 0.01 % of the cycle, in double precision.
        let h = 0.01;
        let second_per_percent = 0.065;
        let (mut peak, mut time) = (0.0_f64, 0.0_f64);
        for step in 1..10_000 {
            let percent = f64::from(step) * h;
            let angle = |percent: f64| repaired_deg(GaitJoint::Knee, percent).to_radians();
            let curvature = (angle(percent + h) - 2.0 * angle(percent) + angle(percent - h)) / (h * h);
            let acceleration = curvature / (second_per_percent * second_per_percent);
            if acceleration.abs() > peak {
                (peak, time) = (acceleration.abs(), percent * second_per_percent);
            }
        }
        // Found: 5.36 rad/s^2 at 4.83 s; reported as 5.4 at 4.80 s, printed as 5.2 at 4.8 s.
        assert!((peak - 5.36).abs() < 0.01, "{peak}");
        assert!((time - 4.8).abs() < 0.05, "{time}");
        // The closed series still has 5.29 rad/s^2.
        let series = curve(JOINTS, Second(6.5)).expect("constant").envelope()[1].acceleration.0;
        assert!((series - 5.29).abs() < 0.03, "{series}");
    }

    #[test]
    fn printed_equation_32_is_unusable_and_its_tenth_is_a_knee() {
        let printed = |t: f64| {
            let bell = |centre: f64, width: f64| exp(-((t - centre) / width) * ((t - centre) / width));
            -5089.0 * bell(76.25, 13.44) + 5677.0 * bell(75.76, 12.88) + 5.3288 * bell(19.74, 23.41)
        };
        let extremes = |angle: &dyn Fn(f64) -> f64| {
            let angles = (0..=10_000).map(|step| angle(f64::from(step) * 0.01));
            angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let (low, high) = extremes(&printed);
        assert!((low + 131.0).abs() < 1.0 && (high - 625.0).abs() < 1.0, "{low} {high}");
        let (low, high) = extremes(&|t| repaired_deg(GaitJoint::Knee, t));
        assert!((low + 13.1).abs() < 0.1 && (high - 62.5).abs() < 0.1, "{low} {high}");
    }

    #[test]
    fn gait_stays_in_the_middle_of_the_papers_working_range() {
        let envelope = curve(JOINTS, Second(3.0)).expect("constant").envelope();
        for joint in 0..2 {
            let (low, high) = WORKING_RANGE_DEG[joint];
            let (below, above) =
                (envelope[joint].low.0.to_degrees() - low, high - envelope[joint].high.0.to_degrees());
            assert!(below > 7.0 && above > 7.0, "joint {joint}: {below} {above}");
            assert!((below - above).abs() < 0.2, "joint {joint}: {below} {above}");
        }
        // A cycle of 3 s moves the knee at 3.93 rad/s and accelerates it by 5.29 (6.5/3)^2.
        assert!((envelope[1].speed.0 - 3.93).abs() < 0.02, "{}", envelope[1].speed.0);
        assert!((envelope[1].acceleration.0 - 24.8).abs() < 0.15, "{}", envelope[1].acceleration.0);
    }

    #[test]
    fn a_gait_is_stretched_into_any_range_and_fills_it() {
        let three = [GaitJoint::Hip, GaitJoint::Knee, GaitJoint::Hip];
        let ranges = [(-0.3, 0.2), (0.5, 2.0), (-1.0, -0.9)].map(|(low, high)| (Radian(low), Radian(high)));
        let curve = curve(three, Second(3.0)).expect("constant");
        let envelope = mapped_into(curve, ranges).expect("ranges are not empty").envelope();
        for joint in 0..3 {
            let (low, high) = (ranges[joint].0.0, ranges[joint].1.0);
            let span = high - low;
            assert!(envelope[joint].low.0 >= low && envelope[joint].high.0 <= high, "joint {joint}");
            assert!(envelope[joint].low.0 < low + 1e-3 * span && envelope[joint].high.0 > high - 1e-3 * span);
        }
        let empty = [ranges[0], (Radian(1.0), Radian(1.0)), ranges[2]];
        assert_eq!(mapped_into(curve, empty), Err(MotionError::Range { joint: 1 }));
    }
}
