//! TIM5's counter as QEMU has it: 1 GHz without being enabled, which at `-icount shift=0` is one per instruction.

use core::hint::black_box;

const TIM5_CNT: *const u32 = 0x4000_0C24 as *const u32;
const TIM5_ARR: *mut u32 = 0x4000_0C2C as *mut u32;
const TIM5_EGR: *mut u32 = 0x4000_0C14 as *mut u32;

/// Lets the counter run over all of its 32 bits.
#[expect(unsafe_code, reason = "device registers")]
pub fn start() {
    // SAFETY: these addresses are registers of TIM5 on this machine, nothing else uses the timer, and writing its reload value
    // and update event has no effect on memory.
    unsafe {
        TIM5_ARR.write_volatile(u32::MAX);
        TIM5_EGR.write_volatile(1);
    }
}

#[expect(unsafe_code, reason = "device register")]
fn now() -> u32 {
    // SAFETY: an aligned register of TIM5, always mapped on this machine; reading it changes nothing.
    unsafe { TIM5_CNT.read_volatile() }
}

/// Instructions of `work` and what it returned; the counting itself is subtracted.
pub fn count<R>(work: impl FnOnce() -> R) -> (u32, R) {
    let before = now();
    let result = black_box(work());
    let between = now().wrapping_sub(before);
    (between.saturating_sub(empty()), result)
}

#[inline(never)]
fn empty() -> u32 {
    let before = now();
    black_box(());
    now().wrapping_sub(before)
}

/// Mean and largest of many counts.
#[derive(Default)]
pub struct Tally {
    sum: u64,
    number: u32,
    most: u32,
}

impl Tally {
    pub fn push(&mut self, instructions: u32) {
        self.sum += u64::from(instructions);
        self.number += 1;
        self.most = self.most.max(instructions);
    }

    pub fn mean(&self) -> u32 {
        ((self.sum + u64::from(self.number / 2)) / u64::from(self.number.max(1))) as u32
    }

    pub fn most(&self) -> u32 {
        self.most
    }
}
