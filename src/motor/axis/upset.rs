//! Fault injection into an axis, host only: bit flips that the checksum must find (row M2 of docs/safety.md).

use super::Axis;

impl Axis {
    /// Number of values in which a bit can be flipped.
    pub const NUMBERS: u8 = 6;

    /// Flips one bit (of 32, from the lowest) of a constant. In order: current limit, square of the
    /// overcurrent bound, both current-sensor offsets, sign of the current, proportional gain of
    /// the current loop.
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

    /// Makes the modulator's constants NaN, which no input can do (row N1).
    pub const fn spoil_modulation(&mut self) {
        self.constants.modulator.spoil();
    }
}
