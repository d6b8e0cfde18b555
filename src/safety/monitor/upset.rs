//! Access for bit flips in the monitor's values, on the host only (row M2 of docs/safety.md). No image has
//! it.

use super::Monitor;

impl<const N: usize> Monitor<N> {
    /// A joint's current per torque, overspeed bound, or lower or upper end of its range with tolerance.
    pub(crate) fn number_mut(&mut self, joint: usize, number: u8) -> Option<&mut f32> {
        match number {
            0 => self.ampere_per_nm.get_mut(joint),
            1 => self.fault_speed.get_mut(joint),
            2 => self.fault_range.get_mut(joint).map(|[low, _]| &mut low.0),
            _ => self.fault_range.get_mut(joint).map(|[_, high]| &mut high.0),
        }
    }
}
