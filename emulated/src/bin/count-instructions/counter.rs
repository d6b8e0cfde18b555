//! Instruction counter: TIM5 as QEMU models it.
//!
//! The timer runs at 1 GHz without being enabled, which at `-icount shift=0` is one count per instruction.
//!
//! This is not documented, so [`start`] first counts a hundred `nop`. If they are not counted as a hundred,
//! the program stops.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;

const TIM5_CNT: *const u32 = 0x4000_0C24 as *const u32;
const TIM5_ARR: *mut u32 = 0x4000_0C2C as *mut u32;
const TIM5_EGR: *mut u32 = 0x4000_0C14 as *mut u32;

/// Starts the counter over all of its 32 bits; returns whether it counts instructions.
#[expect(unsafe_code, reason = "device registers")]
pub fn start() -> bool {
    // SAFETY: these addresses are registers of TIM5 on this machine. Nothing else uses the timer, and writing
    // its reload value and update event has no effect on memory.
    unsafe {
        TIM5_ARR.write_volatile(u32::MAX);
        TIM5_EGR.write_volatile(1);
    }
    let (hundred, ()) = count(hundred_nops);
    if hundred != 100 {
        hprintln!("100 instructions were counted as {}: run QEMU with -icount shift=0", hundred);
    }
    hundred == 100
}

#[expect(unsafe_code, reason = "a known number of `nop` instructions")]
#[inline(always)]
fn hundred_nops() {
    // SAFETY: `nop` changes neither registers nor memory.
    unsafe { core::arch::asm!(".rept 100", "nop", ".endr", options(nomem, nostack, preserves_flags)) }
}

#[expect(unsafe_code, reason = "device register")]
pub fn now() -> u32 {
    // SAFETY: an aligned register of TIM5, always mapped on this machine; reading it has no side effect.
    unsafe { TIM5_CNT.read_volatile() }
}

/// Counts the instructions of `work` and also returns its result; the counting itself is subtracted. Never
/// inlined, so the compiler cannot move surrounding code between the two readings.
#[inline(never)]
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

/// Mean and maximum of many counts.
#[derive(Clone, Copy, Default)]
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

    pub fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.number += other.number;
        self.most = self.most.max(other.most);
    }

    pub fn number(&self) -> u32 {
        self.number
    }

    pub fn mean(&self) -> u32 {
        ((self.sum + u64::from(self.number / 2)) / u64::from(self.number.max(1))) as u32
    }

    pub fn most(&self) -> u32 {
        self.most
    }

    /// Prints one line of the table.
    pub fn print(&self, name: &str) {
        hprintln!("{:<48} {:>8} {:>8}", name, self.mean(), self.most);
    }

    /// Prints one line of the table with the design's bound; returns whether it is met.
    pub fn print_against(&self, name: &str, goal: u32) -> bool {
        let is_within = self.most <= goal;
        let word = if is_within { "kept" } else { "MISSED" };
        hprintln!("{:<48} {:>8} {:>8}   goal {}: {}", name, self.mean(), self.most, goal, word);
        is_within
    }
}

/// Prints a heading of the table.
pub fn heading(name: &str) {
    hprintln!("\n{:<48} {:>8} {:>8}", name, "mean", "worst");
}
