//! Register and memory access by address; the only such place.
#![expect(unsafe_code, reason = "registers are reached by their addresses")]

use super::settings::Write;

/// Reads a register.
pub(super) fn load(address: u32) -> u32 {
    // SAFETY: every caller in this board layer passes the address of a register of the STM32F405 or of a word
    // of its system memory. All are aligned and readable without a side effect on memory.
    unsafe { core::ptr::read_volatile(address as *const u32) }
}

/// Writes a register.
pub(super) fn store(address: u32, value: u32) {
    // SAFETY: as for `load`; no such address belongs to a variable, and no write starts DMA. The flash words
    // that `flash` programs lie beyond the image.
    unsafe { core::ptr::write_volatile(address as *mut u32, value) }
}

/// Applies a list of writes in order. One copy of the loop: inlined it would be as long as the lists.
#[inline(never)]
pub(super) fn apply(writes: &[Write]) {
    for write in writes {
        let before = if write.mask == u32::MAX { 0 } else { load(write.address) };
        store(write.address, write.applied_to(before));
    }
}

/// Reads one byte of system memory or of the flash.
pub(super) fn byte(address: u32) -> u8 {
    // SAFETY: the callers read one-time programmable memory and the flash beyond the image, which exist and
    // are readable.
    unsafe { core::ptr::read_volatile(address as *const u8) }
}

/// Copies bytes of the flash.
pub(super) fn copy(address: u32, into: &mut [u8]) {
    for (index, byte) in into.iter_mut().enumerate() {
        *byte = self::byte(address + index as u32);
    }
}
