//! The only access to `libm`: scalars in both precisions and their functions.
//!
//! Why one access: std's inherent `f32::sqrt` silently replaces any trait method of that name in tests. The
//! host would then test other code than the board runs. Also, `libm::sinf` and `libm::cosf` compute in double
//! precision inside, which a Cortex-M4F does in software (about 1,000 instructions). Code that is generic
//! over [`Real`] runs in `f32` on the device and in `f64` on the host, where the second checks the first.
//!
//! | function | `f32` | largest error |
//! | --- | --- | --- |
//! | [`sin_cos`] | Cody-Waite reduction, minimax polynomials, single precision only | 1.2e-7 (see below) |
//! | `sin_cos_of_turns` | polynomials of [`sin_cos`], reduced exactly as an integer | 1.2e-7 |
//! | [`sqrt`] | one instruction on the device, `libm` elsewhere | correctly rounded |
//! | [`exp`], `ln`, [`atan2`] | `libm` | 1 ulp |
//!
//! The polynomials are Moshier's (Cephes, 1984-1992). The error of [`sin_cos`] holds for arguments up to
//! 8,192; beyond that the result is NaN.
//!
//! For `f64` all functions are those of `libm`.

use nalgebra::RealField;

/// Scalar type of all computations: `f32` on the device, `f64` for reference.
pub trait Real: RealField + Copy {
    /// Smallest number that still changes 1 when added.
    const EPSILON: Self;
    /// Largest finite number.
    const LARGEST: Self;
    /// Nearest representable number.
    fn from_double(value: f64) -> Self;
    /// Value in double precision.
    fn to_double(self) -> f64;
    /// Integer part; 0 for a negative number or NaN, the largest integer for a larger number.
    fn to_count(self) -> u32;
    #[doc(hidden)]
    fn door_abs(self) -> Self;
    #[doc(hidden)]
    fn door_sin_cos(self) -> (Self, Self);
    #[doc(hidden)]
    fn door_sqrt(self) -> Self;
    #[doc(hidden)]
    fn door_exp(self) -> Self;
    #[doc(hidden)]
    fn door_ln(self) -> Self;
    #[doc(hidden)]
    fn door_atan2(self, x: Self) -> Self;
}

/// Sine and cosine of an angle in rad.
pub fn sin_cos<T: Real>(angle: T) -> (T, T) {
    angle.door_sin_cos()
}

/// Sine and cosine of an angle in units of 2^-32 turns, wrong by up to 1.2e-7 each: no reduction needed.
#[inline(always)]
pub(crate) fn sin_cos_of_turns(units: u32) -> (f32, f32) {
    const RADIAN_PER_UNIT: f32 = core::f32::consts::TAU / 4_294_967_296.0;
    // Nearest quarter turn, and the angle from there.
    let quarter = units.wrapping_add(1 << 29) >> 30;
    let rest = units.wrapping_sub(quarter << 30).cast_signed() as f32;
    let (sine, cosine) = eighth_of_a_turn(rest * RADIAN_PER_UNIT);
    let (sine, cosine) = if quarter & 1 == 0 { (sine, cosine) } else { (cosine, -sine) };
    if quarter & 2 == 0 { (sine, cosine) } else { (-sine, -cosine) }
}

/// Square root; NaN for negative numbers.
pub fn sqrt<T: Real>(value: T) -> T {
    value.door_sqrt()
}

/// e to the power of `value`.
pub fn exp<T: Real>(value: T) -> T {
    value.door_exp()
}

/// Natural logarithm; NaN for negative numbers.
pub fn ln<T: Real>(value: T) -> T {
    value.door_ln()
}

/// Angle of the point (`x`, `y`) from the x axis, rad, in -pi..=pi.
pub fn atan2<T: Real>(y: T, x: T) -> T {
    y.door_atan2(x)
}

/// Magnitude; one instruction on the device.
pub fn abs<T: Real>(value: T) -> T {
    value.door_abs()
}

/// The smaller of two numbers; if one is NaN, the other.
pub fn min<T: Real>(one: T, other: T) -> T {
    if other < one || is_nan(one) { other } else { one }
}

/// The larger of two numbers; if one is NaN, the other.
pub fn max<T: Real>(one: T, other: T) -> T {
    if other > one || is_nan(one) { other } else { one }
}

fn is_nan<T: Real>(value: T) -> bool {
    value.partial_cmp(&value).is_none()
}

/// Limits `value` to `low..=high`; NaN gives `low`.
pub fn clamp<T: Real>(value: T, low: T, high: T) -> T {
    if value > high {
        high
    } else if value >= low {
        value
    } else {
        low
    }
}

/// Sign of a number: -1, 0 or 1; 0 for NaN.
pub fn sign<T: Real>(value: T) -> T {
    if value > T::zero() {
        T::one()
    } else if value < T::zero() {
        -T::one()
    } else {
        T::zero()
    }
}

/// True if neither NaN nor infinite.
pub fn is_finite<T: Real>(value: T) -> bool {
    abs(value) <= T::LARGEST
}

#[expect(clippy::disallowed_methods, reason = "this file is the door to libm")]
impl Real for f64 {
    const EPSILON: Self = f64::EPSILON;
    const LARGEST: Self = f64::MAX;
    fn from_double(value: f64) -> Self {
        value
    }
    fn to_double(self) -> f64 {
        self
    }
    fn to_count(self) -> u32 {
        self as u32
    }
    fn door_abs(self) -> Self {
        f64::abs(self)
    }
    fn door_sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }
    fn door_sqrt(self) -> Self {
        libm::sqrt(self)
    }
    fn door_exp(self) -> Self {
        libm::exp(self)
    }
    fn door_ln(self) -> Self {
        libm::log(self)
    }
    fn door_atan2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
}

#[expect(clippy::disallowed_methods, reason = "this file is the door to libm")]
impl Real for f32 {
    const EPSILON: Self = f32::EPSILON;
    const LARGEST: Self = f32::MAX;
    fn from_double(value: f64) -> Self {
        value as f32
    }
    fn to_double(self) -> f64 {
        f64::from(self)
    }
    fn to_count(self) -> u32 {
        self as u32
    }
    fn door_abs(self) -> Self {
        f32::abs(self)
    }
    fn door_sin_cos(self) -> (Self, Self) {
        sin_cos_single(self)
    }
    fn door_sqrt(self) -> Self {
        sqrt_single(self)
    }
    fn door_exp(self) -> Self {
        libm::expf(self)
    }
    fn door_ln(self) -> Self {
        libm::logf(self)
    }
    fn door_atan2(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }
}

#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
#[expect(clippy::disallowed_methods, reason = "this file is the door to libm")]
fn sqrt_single(value: f32) -> f32 {
    libm::sqrtf(value)
}

/// Square root of the FPU: `core` has none on stable, and `libm` computes it with integers. The two
/// instructions change `s0` only, as the calling convention allows. The directive names the FPU of a
/// Cortex-M4F, which the target does not tell the assembler.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
#[unsafe(naked)]
extern "C" fn sqrt_single(value: f32) -> f32 {
    core::arch::naked_asm!(".fpu fpv4-sp-d16", "vsqrt.f32 s0, s0", "bx lr")
}

/// Largest angle of the three-part reduction, 1,300 turns. Beyond, it loses digits and resolves 0.03 degrees
/// or worse. No joint gets there, so the result is NaN, which the next check refuses.
const LARGEST_REDUCED_ANGLE: f32 = 8192.0;

#[expect(clippy::excessive_precision, reason = "the three parts of pi/4 as published")]
fn sin_cos_single(angle: f32) -> (f32, f32) {
    const FOUR_OVER_PI: f32 = 1.273_239_54;
    const PI_QUARTER: [f32; 3] = [0.785_156_25, 2.418_756_484_985_352e-4, 3.774_894_977_445_941e-8];
    let magnitude = angle.abs();
    if magnitude > LARGEST_REDUCED_ANGLE || magnitude.is_nan() {
        return (f32::NAN, f32::NAN);
    }
    let octant = (magnitude * FOUR_OVER_PI) as u32;
    let octant = octant + (octant & 1);
    let turns = octant as f32;
    let x = ((magnitude - turns * PI_QUARTER[0]) - turns * PI_QUARTER[1]) - turns * PI_QUARTER[2];
    let (sine, cosine) = eighth_of_a_turn(x);
    let (sine, cosine) = match octant & 7 {
        0 => (sine, cosine),
        2 => (cosine, -sine),
        4 => (-sine, -cosine),
        _ => (-cosine, sine),
    };
    (if angle < 0.0 { -sine } else { sine }, cosine)
}

/// Sine and cosine of an angle within pi/4 of zero.
#[expect(clippy::excessive_precision, reason = "coefficients as published")]
#[inline(always)]
fn eighth_of_a_turn(x: f32) -> (f32, f32) {
    let z = x * x;
    let sine = ((-1.951_529_589e-4 * z + 8.332_160_873e-3) * z - 1.666_665_461e-1) * z * x + x;
    let cosine = ((2.443_315_711e-5 * z - 1.388_731_625e-3) * z + 4.166_664_568e-2) * z * z - 0.5 * z + 1.0;
    (sine, cosine)
}

/// Sum of the products of two rows, in their order; a longer one is cut.
#[inline]
pub fn dot<T: Real>(one: &[T], other: &[T]) -> T {
    one.iter().zip(other).fold(T::zero(), |sum, (&left, &right)| sum + left * right)
}

/// Median of some numbers, the upper one of two; 0 for an empty slice. Sorts the slice.
pub(crate) fn median<T: Real>(values: &mut [T]) -> T {
    for end in 1..values.len() {
        for index in (0..end).rev() {
            if values[index] <= values[index + 1] {
                break;
            }
            values.swap(index, index + 1);
        }
    }
    values.get(values.len() / 2).copied().unwrap_or(T::zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_is_the_upper_middle_value() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 3.0);
        assert_eq!(median::<f64>(&mut []), 0.0);
    }

    #[test]
    fn single_precision_sine_and_cosine_stay_within_their_stated_error() {
        let mut worst = 0.0_f64;
        for step in -400_000..400_000 {
            let angle = step as f32 * 0.020_48;
            let (sine, cosine) = sin_cos(angle);
            let (true_sine, true_cosine) = sin_cos(f64::from(angle));
            worst =
                worst.max((f64::from(sine) - true_sine).abs()).max((f64::from(cosine) - true_cosine).abs());
        }
        assert!(worst < 1.2e-7, "worst error {worst:e}");
    }

    #[test]
    fn sine_and_cosine_of_turns_stay_within_their_stated_error() {
        let mut worst = 0.0_f64;
        // An odd step, so that its multiples do not only hit quarters; the quarters' edges are added.
        let borders = (0..8_u32).flat_map(|eighth| [(eighth << 29).wrapping_sub(1), eighth << 29]);
        for units in (0..1_000_000_u32).map(|step| step.wrapping_mul(42_949_673)).chain(borders) {
            let (sine, cosine) = sin_cos_of_turns(units);
            let (true_sine, true_cosine) =
                sin_cos(f64::from(units) * core::f64::consts::TAU / 4_294_967_296.0);
            worst =
                worst.max((f64::from(sine) - true_sine).abs()).max((f64::from(cosine) - true_cosine).abs());
        }
        assert!(worst < 1.2e-7, "worst error {worst:e}");
    }

    #[test]
    fn nan_never_leaves_a_clamp() {
        assert_eq!(clamp(f32::NAN, -1.0, 1.0), -1.0);
        assert_eq!(min(f32::NAN, 2.0), 2.0);
        assert_eq!(max(2.0, f32::NAN), 2.0);
        assert!(!is_finite(f32::INFINITY) && !is_finite(f32::NAN) && is_finite(f32::MAX));
    }

    #[test]
    fn angles_beyond_the_reduction_or_infinite_give_nan() {
        assert!(!sin_cos(-8192.0_f32).0.is_nan());
        for angle in [8192.1_f32, -1.0e30, f32::INFINITY, f32::NAN] {
            let (sine, cosine) = sin_cos(angle);
            assert!(sine.is_nan() && cosine.is_nan(), "{angle}");
        }
    }
}
