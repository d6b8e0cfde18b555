//! The stack, painted at the start to find its deepest use; clearing of the core-coupled memory.
//!
//! The stack lies at the bottom of the memory (memory.x). An overflow reaches below the memory and faults in
//! the same instruction; a board's crash handler resets the stack pointer.
#![expect(unsafe_code, reason = "memory between symbols of the linker")]

use core::ptr;

const PAINT: u32 = 0x5AFE_57AC;
/// Bytes below the stack pointer that are not painted.
const MARGIN: usize = 256;

unsafe extern "C" {
    static mut _stack_start: u32;
    static mut _stack_end: u32;
    static mut __sccm: u32;
    static mut __eccm: u32;
}

fn ends() -> (*mut u32, *mut u32) {
    (&raw mut _stack_end, &raw mut _stack_start)
}

/// Address of the stack's lowest word.
pub fn bottom() -> u32 {
    ends().0 as u32
}

/// Word of the stack; `None` for addresses outside it.
pub fn word(address: u32) -> Option<u32> {
    let (bottom, top) = ends();
    let inside = (bottom as u32..top as u32).contains(&address) && address.is_multiple_of(4);
    // SAFETY: an aligned word between the stack's ends, which are the linker's; any content is valid.
    inside.then(|| unsafe { ptr::read_volatile(address as *const u32) })
}

/// Size of the stack in bytes.
pub fn bytes() -> u32 {
    let (bottom, top) = ends();
    (top as usize - bottom as usize) as u32
}

/// Paints the stack below the current frame and clears the core-coupled memory. Must be the first call.
pub fn prepare() {
    let (bottom, _) = ends();
    let here = cortex_m::register::msp::read() as usize - MARGIN;
    let words = (here - bottom as usize) / 4;
    let (first, last) = (&raw mut __sccm, &raw mut __eccm);
    let core_coupled = (last as usize - first as usize) / 4;
    // SAFETY: between the stack's end and a quarter of a kilobyte below the stack pointer there is no live
    // data. No interrupt is enabled, and this function's frame lies above. The symbols are aligned to words.
    // The core-coupled memory is still unused: this runs before anything else in `main`.
    unsafe {
        for word in 0..words {
            ptr::write_volatile(bottom.add(word), PAINT);
        }
        for word in 0..core_coupled {
            ptr::write_volatile(first.add(word), 0);
        }
    }
}

/// Deepest use so far, bytes.
pub fn used() -> u32 {
    let (bottom, top) = ends();
    let words = (top as usize - bottom as usize) / 4;
    // SAFETY: reads words of the stack, which always exist; concurrent writes are above the paint.
    let untouched = (0..words).take_while(|&word| unsafe { ptr::read_volatile(bottom.add(word)) } == PAINT);
    (words - untouched.count()) as u32 * 4
}
