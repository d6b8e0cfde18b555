//! A bit that flips in memory, on the host alone: what the checksum is tried against (row M2 of docs/safety.md). No image has it.

use super::Axis;

impl Axis {
    /// Numbers of an axis that can be upset.
    pub const NUMBERS: u8 = 6;

    /// Flips one bit (of 32, from the lowest) of a number that never changes: current limit, overcurrent bound squared, zeros of both
    /// shunts, the sign of the current, proportional gain of the current loop.
    pub fn upset(&mut self, number: u8, bit: u8) {
        let constants = &mut self.constants;
        let [zero_b, zero_c] = &mut constants.zeros;
        let upset = match number {
            0 => &mut constants.current_limit,
            1 => &mut constants.overcurrent_square,
            2 => zero_b,
            3 => zero_c,
            4 => &mut constants.current_sign,
            _ => constants.gains.proportional_mut(),
        };
        *upset = f32::from_bits(upset.to_bits() ^ 1 << (bit % 32));
    }

    /// The modulator's numbers are none: what no port reaches (row N1).
    pub const fn spoil_modulation(&mut self) {
        self.constants.modulator.spoil();
    }
}
