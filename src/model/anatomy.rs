//! Flexion angles and the chain's angles: all conversions are here.
//!
//! Outside this module angles are anatomical: hip and knee flexion positive, zero when standing straight.
//! Inside the model they are those of the Denavit-Hartenberg frames, whose direction and zero may differ.
//!
//! ```text
//! q = direction q_anatomical + zero_offset
//! torque = direction torque_anatomical               (speed and acceleration likewise)
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | direction | +1 or -1 | - |
//! | zero_offset | the chain's angle where the anatomical one is zero | rad |
//!
//! Power is the same on both sides, since direction squared is 1.

use crate::real::{Real, is_finite};

/// Reason why a joint's conversion is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnatomyError {
    /// The direction is neither 1 nor -1.
    Direction,
    /// The zero offset is NaN or infinite.
    ZeroOffset,
}

/// Conversion between one joint's anatomical angle and the chain's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnatomicalJoint<T> {
    pub(crate) direction: T,
    pub(crate) zero_offset: T,
}

impl<T: Real> AnatomicalJoint<T> {
    /// Conversion with `direction` 1 or -1 and a chain angle of `zero_offset` (rad) at the anatomical zero.
    ///
    /// # Errors
    /// [`AnatomyError`] names the argument that is out of its range.
    pub fn new(direction: i32, zero_offset: T) -> Result<Self, AnatomyError> {
        let direction = match direction {
            1 => T::one(),
            -1 => -T::one(),
            _ => return Err(AnatomyError::Direction),
        };
        if !is_finite(zero_offset) {
            return Err(AnatomyError::ZeroOffset);
        }
        Ok(Self { direction, zero_offset })
    }

    /// Identity: both angles are equal.
    pub fn identity() -> Self {
        Self { direction: T::one(), zero_offset: T::zero() }
    }

    /// Direction, 1 or -1.
    pub fn direction(&self) -> T {
        self.direction
    }

    /// Chain angle at the anatomical zero, rad.
    pub fn zero_offset(&self) -> T {
        self.zero_offset
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> AnatomicalJoint<U> {
        AnatomicalJoint {
            direction: U::from_double(self.direction.to_double()),
            zero_offset: U::from_double(self.zero_offset.to_double()),
        }
    }

    /// Converts an anatomical angle to the chain's, rad.
    pub fn angle_to_chain(&self, anatomical: T) -> T {
        self.direction * anatomical + self.zero_offset
    }

    /// Converts a chain angle to the anatomical one, rad.
    pub fn angle_from_chain(&self, q: T) -> T {
        self.direction * (q - self.zero_offset)
    }

    /// Converts an anatomical speed, acceleration or torque to the chain's.
    pub fn to_chain(&self, anatomical: T) -> T {
        self.direction * anatomical
    }

    /// Converts the chain's speed, acceleration or torque to the anatomical one.
    pub fn from_chain(&self, value: T) -> T {
        self.direction * value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversion_and_back_is_the_identity_and_keeps_power() {
        let knee = AnatomicalJoint::new(-1, 0.25_f64).unwrap();
        assert_eq!(knee.angle_to_chain(0.5), -0.25);
        // One addition and one subtraction of numbers near 1: two roundings.
        assert!((knee.angle_from_chain(knee.angle_to_chain(0.7)) - 0.7).abs() < 4e-16);
        let (speed, torque) = (1.3, -20.0);
        assert_eq!(knee.to_chain(speed) * knee.to_chain(torque), speed * torque);
        assert_eq!(knee.from_chain(knee.to_chain(torque)), torque);
    }

    #[test]
    fn a_direction_other_than_one_and_an_infinite_offset_are_refused() {
        assert_eq!(AnatomicalJoint::new(0, 0.0_f32), Err(AnatomyError::Direction));
        assert_eq!(AnatomicalJoint::new(2, 0.0_f32), Err(AnatomyError::Direction));
        assert_eq!(AnatomicalJoint::new(1, f32::NAN), Err(AnatomyError::ZeroOffset));
    }
}
