//! Unit newtypes for numbers that cross module borders on the device.
//!
//! A bare `f32` does not show its unit; the compiler rejects a `Radian` where an `Ampere` is expected.
//! Arithmetic that keeps the unit is provided; everything else goes through the public field.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

macro_rules! unit {
    ($(#[$meta:meta] $name:ident),+ $(,)?) => {$(
        #[$meta]
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        #[repr(transparent)]
        pub struct $name(pub f32);

        impl $name {
            /// Zero.
            pub const ZERO: Self = Self(0.0);
            /// Returns the magnitude.
            pub const fn abs(self) -> Self { Self(self.0.abs()) }
            /// True if neither NaN nor infinite.
            pub const fn is_finite(self) -> bool { self.0.is_finite() }
            /// Limits to `-bound..=bound`; zero if the value or the bound is NaN.
            pub fn limited(self, bound: Self) -> Self {
                let raised = if self.0 < -bound.0 { -bound.0 } else { self.0 };
                if raised > bound.0 {
                    bound
                } else if raised <= bound.0 {
                    Self(raised)
                } else {
                    Self::ZERO
                }
            }
        }
        impl Add for $name { type Output = Self; fn add(self, other: Self) -> Self { Self(self.0 + other.0) } }
        impl Sub for $name { type Output = Self; fn sub(self, other: Self) -> Self { Self(self.0 - other.0) } }
        impl AddAssign for $name { fn add_assign(&mut self, other: Self) { self.0 += other.0; } }
        impl SubAssign for $name { fn sub_assign(&mut self, other: Self) { self.0 -= other.0; } }
        impl Neg for $name { type Output = Self; fn neg(self) -> Self { Self(-self.0) } }
        impl Mul<f32> for $name { type Output = Self; fn mul(self, factor: f32) -> Self { Self(self.0 * factor) } }
        impl Div<f32> for $name { type Output = Self; fn div(self, factor: f32) -> Self { Self(self.0 / factor) } }
    )+};
}

unit! {
    /// Angle, rad.
    Radian,
    /// Angular velocity, rad/s.
    RadianPerSecond,
    /// Angular acceleration, rad/s^2.
    RadianPerSecondSquared,
    /// Torque at the joint, N m.
    NewtonMetre,
    /// Current, A; for a motor, its quadrature current unless stated otherwise.
    Ampere,
    /// Time, s.
    Second,
    /// Joint torque per motor current, N m/A.
    NewtonMetrePerAmpere,
    /// Moment of inertia, kg m^2.
    KilogramMetreSquared,
    /// Length, m.
    Metre,
    /// Temperature, degrees Celsius.
    Celsius,
    /// Frequency, Hz.
    Hertz,
    /// Voltage, V.
    Volt,
    /// Resistance of one phase against the star point, ohm.
    Ohm,
    /// Inductance of one phase in the rotating frame, H.
    Henry,
    /// Flux linkage of the magnets with one phase, peak, V s.
    Weber,
}
