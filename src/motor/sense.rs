//! Converts ADC codes to currents and bus voltage.
//!
//! Two phases have shunts; the third carries the negative sum. A code near a rail means a saturated amplifier
//! and so an unknown current. That is an error, never a number that is too small.
//!
//! ```text
//! i = ampere_per_code * (code - zero)          i_A = -(i_B + i_C)          V_bus = volt_per_code * code
//! ```
//!
//! Currents flow into the motor. `ampere_per_code` is signed, one for each shunt; `zero` is the
//! current-sensor offset that calibration measures. Source of the board's numbers: ODrive v3.6 firmware (0.5
//! mOhm, 40 V/V, 3.3 V of 4,096 codes, divider 19).
//! Cost: 45 instructions, rails included (docs/results/motor.md).

use super::Stationary;
use crate::units::{Ampere, Volt};

/// Scales of the board's amplifiers, divider and converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SenseScale {
    /// Current per code of the shunts of B and C.
    pub ampere_per_code: [Ampere; 2],
    /// Smallest and largest code without saturation.
    pub rails: [u16; 2],
    /// Bus voltage per code.
    pub volt_per_code: Volt,
}

impl SenseScale {
    /// Divider of the bus voltage on boards of 48 and 56 V.
    pub const DIVIDER: f32 = 19.0;

    /// ODrive v3.6, 56 V: 0.5 mOhm, 40 V/V, 0.3 V..3.0 V; divider 19. 0.0403 A and 15.3 mV per code.
    pub const ODRIVE_3_6: Self = Self {
        ampere_per_code: [Ampere(3.3 / 4096.0 / 40.0 / 0.0005); 2],
        rails: [372, 3723],
        volt_per_code: Volt(3.3 * Self::DIVIDER / 4096.0),
    };

    /// Bus voltage of a code.
    pub fn bus(&self, code: u16) -> Volt {
        self.volt_per_code * f32::from(code)
    }

    /// Current vector of the codes of B and C, with their current-sensor offsets; `None` where a code is
    /// at a rail.
    #[inline(always)]
    pub(crate) fn currents(&self, codes: [u16; 2], current_offsets: [f32; 2]) -> Option<Stationary<Ampere>> {
        let [b, c] = codes;
        let width = self.rails[1].wrapping_sub(self.rails[0]);
        if b.wrapping_sub(self.rails[0]) > width || c.wrapping_sub(self.rails[0]) > width {
            return None;
        }
        let b = self.ampere_per_code[0] * (f32::from(b) - current_offsets[0]);
        let c = self.ampere_per_code[1] * (f32::from(c) - current_offsets[1]);
        Some(Stationary::from_two_phases(b, c))
    }

    /// Largest phase current that both shunts can measure, for any offsets within `spread` codes
    /// of the middle.
    pub(crate) fn range(&self, spread: u16) -> Ampere {
        let below = 2048_u16.saturating_sub(self.rails[0]);
        let above = self.rails[1].saturating_sub(2048);
        let codes = below.min(above).saturating_sub(spread);
        let [b, c] = self.ampere_per_code.map(|scale| scale.abs().0);
        Ampere(f32::from(codes) * b.min(c))
    }

    /// Greatest permissible bus-voltage limit: 95 % of the converter's range. A voltage beyond the limit then
    /// still shows with a divider that is 3 % off.
    pub(crate) fn greatest_bus(&self) -> Volt {
        self.bus(4095) * 0.95
    }

    /// Whether the rails are in order and the scales plausible.
    pub(super) fn is_sensible(&self) -> bool {
        self.rails[0] < 2048
            && 2048 < self.rails[1]
            && self.rails[1] < 4096
            && self.ampere_per_code.iter().all(|scale| (1e-4..=1.0).contains(&scale.0.abs()))
            && (1e-4..=1.0).contains(&self.volt_per_code.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::sqrt;

    const OFFSETS: [f32; 2] = [2050.5, 2040.0];

    #[test]
    fn two_shunts_give_three_currents() {
        let scale = SenseScale::ODRIVE_3_6;
        let vector = scale.currents([2150, 1990], OFFSETS).expect("within the rails");
        let (b, c) = (0.040_283 * 99.5, -0.040_283 * 50.0);
        assert!((vector.alpha.0 + b + c).abs() < 1e-3, "{vector:?}");
        assert!((vector.beta.0 - (b - c) / sqrt(3.0)).abs() < 1e-3, "{vector:?}");
        // Expected: 1675 codes of 40.3 mA on the narrower side, less 100.
        assert!((scale.range(100).0 - 63.4).abs() < 0.1, "{:?}", scale.range(100));
        assert!((scale.bus(3000).0 - 45.92).abs() < 0.01);
    }

    #[test]
    fn a_saturated_amplifier_gives_no_current() {
        let scale = SenseScale::ODRIVE_3_6;
        for code in [0, 371, 3724, 4095, u16::MAX] {
            assert_eq!(scale.currents([code, 2048], OFFSETS), None);
            assert_eq!(scale.currents([2048, code], OFFSETS), None);
        }
        assert!(scale.currents([372, 3723], OFFSETS).is_some());
    }

    #[test]
    fn rails_lie_on_both_sides_of_the_middle_and_within_the_converter() {
        for (rails, sensible) in [
            ([2047, 2049], true),
            ([2048, 2049], false),
            ([2047, 2048], false),
            ([0, 4095], true),
            ([0, 4096], false),
        ] {
            let scale = SenseScale { rails, ..SenseScale::ODRIVE_3_6 };
            assert_eq!(scale.is_sensible(), sensible, "{rails:?}");
        }
    }
}
