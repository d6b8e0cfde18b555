//! Time base: SysTick at 24 kHz drives everything, TIM5 counts instructions.
//!
//! SysTick is the only timer of this part that QEMU interrupts at the right rate. Its count does not change
//! while it is stopped, so the plant runs with SysTick stopped and costs the firmware no time. The plant's
//! instructions are subtracted from the clock as well.
//!
//! ```text
//! executor's time = ticks of 24 kHz * 125 / 3  us
//! instructions    = (TIM5 - TIM5 while stopped) / 8       TIM5 in QEMU: 1 GHz; -icount shift=3: 8 ns each
//! ```
//!
//! TIM5 wraps after 4.3 s; the instruction count at the last tick extends it beyond that.
#![expect(unsafe_code, reason = "device registers, and symbols that the executor's time links to")]

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Waker;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;
use stm32_metapac::Interrupt;

/// Time per instruction with `-icount shift=3`.
const NANOSECONDS_PER_INSTRUCTION: u32 = 8;
/// Speed of the emulated processor.
pub const INSTRUCTIONS_PER_S: u32 = 1_000_000_000 / NANOSECONDS_PER_INSTRUCTION;
/// Reload value of SysTick, which counts at 168 MHz.
const RELOAD: u32 = 168_000_000 / scarab::hal::CURRENT_RATE_HZ - 1;

const SYST_CSR: *mut u32 = 0xE000_E010 as *mut u32;
const SYST_RVR: *mut u32 = 0xE000_E014 as *mut u32;
const SYST_CVR: *mut u32 = 0xE000_E018 as *mut u32;
const RUNS_WITH_INTERRUPT: u32 = 0b111;
const STOPPED: u32 = 0b110;
const TIM5_CNT: *const u32 = 0x4000_0C24 as *const u32;
const TIM5_ARR: *mut u32 = 0x4000_0C2C as *mut u32;
const TIM5_EGR: *mut u32 = 0x4000_0C14 as *mut u32;

/// Ticks since the start.
static TICKS: AtomicU32 = AtomicU32::new(0);
/// Counts of TIM5 while SysTick was stopped.
static SUBTRACTED: AtomicU32 = AtomicU32::new(0);
/// Instructions up to the last tick, and the firmware's TIM5 counts at that tick.
static COUNTED: AtomicU32 = AtomicU32::new(0);
static AT: AtomicU32 = AtomicU32::new(0);
/// Tick at which the executors must be woken.
static ALARM: AtomicU32 = AtomicU32::new(u32::MAX);

fn counter() -> u32 {
    // SAFETY: an aligned register of TIM5, always mapped on this machine; reading it has no side effect.
    unsafe { TIM5_CNT.read_volatile() }
}

/// TIM5 counts of the firmware.
fn own() -> u32 {
    counter().wrapping_sub(SUBTRACTED.load(Ordering::Relaxed))
}

/// Instructions of the firmware; wraps after 34 s. Level 0 must call [`tick`] first.
pub fn instructions() -> u32 {
    loop {
        let before = COUNTED.load(Ordering::Relaxed);
        let since = own().wrapping_sub(AT.load(Ordering::Relaxed)) / NANOSECONDS_PER_INSTRUCTION;
        // A tick in between has changed both words.
        if COUNTED.load(Ordering::Relaxed) == before {
            return before.wrapping_add(since);
        }
    }
}

/// Advances the instruction count, so that no difference reaches the wrap of TIM5.
fn count() {
    let (at, now) = (AT.load(Ordering::Relaxed), own());
    let since = now.wrapping_sub(at) / NANOSECONDS_PER_INSTRUCTION;
    AT.store(at.wrapping_add(since * NANOSECONDS_PER_INSTRUCTION), Ordering::Relaxed);
    COUNTED.store(COUNTED.load(Ordering::Relaxed).wrapping_add(since), Ordering::Relaxed);
}

/// Starts the ticks.
pub fn start() {
    // SAFETY: registers of TIM5 and SysTick, which no other code uses; interrupts have their levels.
    unsafe {
        TIM5_ARR.write_volatile(u32::MAX);
        TIM5_EGR.write_volatile(1);
        SYST_RVR.write_volatile(RELOAD);
        SYST_CVR.write_volatile(0);
        SYST_CSR.write_volatile(RUNS_WITH_INTERRUPT);
    }
}

/// Runs `work` without using firmware time.
#[inline(never)]
pub fn stopped<R>(work: impl FnOnce() -> R) -> R {
    // SAFETY: called at level 0 only, so no other code writes this register meanwhile.
    unsafe { SYST_CSR.write_volatile(STOPPED) };
    let before = counter();
    let result = work();
    SUBTRACTED.fetch_add(counter().wrapping_sub(before), Ordering::Relaxed);
    // SAFETY: as above.
    unsafe { SYST_CSR.write_volatile(RUNS_WITH_INTERRUPT) };
    result
}

/// Counts of SysTick until the next tick, of 7,000.
pub fn left() -> u32 {
    // SAFETY: a register of the processor, always present; reading it has no side effect.
    unsafe { SYST_CVR.read_volatile() }
}

/// Begins a tick and returns its number.
pub fn tick() -> u32 {
    count();
    let tick = TICKS.load(Ordering::Relaxed).wrapping_add(1);
    TICKS.store(tick, Ordering::Relaxed);
    if tick >= ALARM.load(Ordering::Relaxed) {
        ALARM.store(u32::MAX, Ordering::Relaxed);
        NVIC::pend(Interrupt::TIM3);
    }
    tick
}

struct Time {
    queue: Mutex<RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static TIME: Time = Time { queue: Mutex::new(RefCell::new(Queue::new())) });

impl Driver for Time {
    fn now(&self) -> u64 {
        u64::from(TICKS.load(Ordering::Relaxed)) * 125 / 3
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|section| {
            let mut queue = self.queue.borrow(section).borrow_mut();
            if queue.schedule_wake(at, waker) {
                set_alarm(queue.next_expiration(self.now()));
            }
        });
    }
}

/// Sets the alarm to the first tick at or after an instant.
fn set_alarm(at: u64) {
    let tick = at.saturating_mul(3).div_ceil(125);
    ALARM.store(u32::try_from(tick).unwrap_or(u32::MAX), Ordering::Relaxed);
}

/// Interrupt of the alarm.
pub fn alarm() {
    critical_section::with(|section| {
        let mut queue = TIME.queue.borrow(section).borrow_mut();
        set_alarm(queue.next_expiration(TIME.now()));
    });
}
