//! An excitation as plain numbers: the output of a design tool and a constant of an image.
//!
//! Why separate from [`Periodic`]: its constructor rounds times to ticks and may fail, while a constant has
//! to be plain data. The table holds the numbers as designed. [`ExcitationTable::motion`] builds the motion,
//! which must be proven like any other before a leg takes it.
//!
//! Angles are the model's (D-H) joint angles, rad; the amplitudes are `s_k`, `c_k` of [`Fourier`].
//!
//! ```
//! use scarab::motion::ExcitationTable;
//!
//! const SWING: ExcitationTable<1, 2> = ExcitationTable {
//!     period_s: 4.0,
//!     blend_s: 1.0,
//!     cycles: 3,
//!     centre_rad: [0.4],
//!     sine_rad: [[0.2, 0.1]],
//!     cosine_rad: [[0.0, 0.05]],
//! };
//! let motion = SWING.motion(4000).expect("finite numbers");
//! assert_eq!(motion.duration_ticks(), (1 + 3 * 4 + 1) * 4000);
//! ```

use super::{Fourier, HARMONICS, MotionError, Periodic};
use crate::units::Second;

/// Whole cycles of a Fourier series between two blends, in plain numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExcitationTable<const N: usize, const H: usize = HARMONICS> {
    /// One cycle, s.
    pub period_s: f32,
    /// Time from rest to full speed, and back, s.
    pub blend_s: f32,
    /// Cycles at full speed.
    pub cycles: u32,
    /// Centre `q0` of every joint, rad.
    pub centre_rad: [f32; N],
    /// Amplitudes `s_k` of every joint, rad, lowest harmonic first.
    pub sine_rad: [[f32; H]; N],
    /// Amplitudes `c_k` of every joint, rad, lowest harmonic first.
    pub cosine_rad: [[f32; H]; N],
}

impl<const N: usize, const H: usize> ExcitationTable<N, H> {
    /// Builds the motion at `rate_hz` ticks per second; not yet proven against any limits.
    ///
    /// # Errors
    /// [`MotionError`] for an invalid number.
    pub fn motion(&self, rate_hz: u32) -> Result<Periodic<N, H>, MotionError> {
        let curve = Fourier::new(Second(self.period_s), self.centre_rad, self.sine_rad, self.cosine_rad)?;
        Periodic::new(curve, Second(self.blend_s), self.cycles, rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: ExcitationTable<1, 1> = ExcitationTable {
        period_s: 4.0,
        blend_s: 1.0,
        cycles: 2,
        centre_rad: [0.4],
        sine_rad: [[0.2]],
        cosine_rad: [[0.1]],
    };

    #[test]
    fn the_motion_of_a_table_is_that_of_its_numbers() {
        let motion = TABLE.motion(4000).expect("finite");
        let curve = Fourier::new(Second(4.0), [0.4], [[0.2]], [[0.1]]).expect("finite");
        assert_eq!(Ok(motion), Periodic::new(curve, Second(1.0), 2, 4000));
    }

    #[test]
    fn a_table_that_makes_no_sense_is_refused() {
        let of = |change: fn(&mut ExcitationTable<1, 1>)| {
            let mut table = TABLE;
            change(&mut table);
            table.motion(4000)
        };
        assert_eq!(of(|table| table.cosine_rad[0][0] = f32::NAN), Err(MotionError::NotFinite { joint: 0 }));
        assert_eq!(of(|table| table.period_s = 0.0), Err(MotionError::Period));
        assert_eq!(of(|table| table.blend_s = f32::INFINITY), Err(MotionError::Blend));
        assert_eq!(of(|table| table.cycles = 0), Err(MotionError::Cycles));
    }
}
