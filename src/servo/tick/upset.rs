//! Bit flips in memory, on the host only, to test the checksum (row M2 of docs/safety.md).

use super::Servo;

impl<const N: usize> Servo<N> {
    /// Numbers of a joint that can be flipped.
    pub const NUMBERS: u8 = 6;

    /// Flips one bit (of 32, from the lowest) of one of a joint's constants: counts per radian, largest
    /// acceleration, current per torque, overspeed bound, either end of the range.
    pub fn upset(&mut self, joint: usize, number: u8, bit: u8) {
        let Some(this) = self.joints.get_mut(joint) else { return };
        let upset = match number {
            0 => &mut this.count_per_radian,
            1 => &mut this.largest_acceleration_rad_per_s2,
            number => match self.monitor.number_mut(joint, number - 2) {
                Some(upset) => upset,
                None => return,
            },
        };
        *upset = f32::from_bits(upset.to_bits() ^ 1 << (bit % 32));
    }
}
