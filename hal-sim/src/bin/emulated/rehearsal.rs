//! Crashes on request: one, in the middle of a run, as the emulator's command line asks (`cargo emulate --crash`).
//!
//! Why in this image: current loops, servo, executors and identification run as they always do, and it is their levels that the crash
//! handler has to get past. Once it happened the image starts again, as on the board; what kind of start it is, and what the operator
//! then does, is known here.
//!
//! | start | how it is known | what the operator does |
//! | --- | --- | --- |
//! | first | neither of the others | enables and asks to identify; the crash comes in the tick that was asked for |
//! | after the crash | its record | the same, which has to be refused; resets the fault, the same again; then starts the image again |
//! | after that | a word kept over the reset | the same; ends the emulator |
//!
//! **The worst instant** is chosen: a crash at thread level comes so that a tick falls due while it is handled; a stack overflow
//! right after a tick, so that none comes while the stack runs out.
#![expect(unsafe_code, reason = "memory that outlives a reset, semihosting, an address where nothing is")]

use core::hint::black_box;
use core::mem::MaybeUninit;
use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::{NVIC, SCB};
use cortex_m_semihosting::{heprintln, syscall};
use scarab::servo::SERVO_RATE_HZ;
use scarab::task::SIGNALS;
use stm32_metapac::Interrupt;

use super::{clock, end};

/// Longer command lines ask for nothing: without arguments it is the path of the image.
const COMMAND_LINE: usize = 64;
/// Memory that the board has and this machine does not.
const NOWHERE: *const u32 = 0x1000_0000 as *const u32;
/// Nobody handles it.
const UNHANDLED: Interrupt = Interrupt::SDIO;
/// Of SysTick, 7,000 a period: the crash is begun with 220 to 370 instructions to go.
const TICK_COMES: core::ops::Range<u32> = 300..500;
/// More than 3,300 instructions to go: enough to fill the stack.
const TICK_WENT: u32 = 4_500;
/// Servo ticks: the operator resets the fault; the image is started again; the last start ends.
const RESET: u32 = SERVO_RATE_HZ / 10;
const RESTART: u32 = 2 * RESET;
const LAST: u32 = RESET;
/// Bytes of one call while the stack is filled.
const FRAME: usize = 1024;

/// What is kept over a reset. The emulated memory is all zero when the machine is switched on.
#[derive(Clone, Copy)]
struct Kept {
    /// Instructions at which the crash was begun.
    begun: u32,
    /// Starts that found a crash, one after the other.
    crashes: u32,
    /// The image was started again on purpose.
    restarted: bool,
}

#[unsafe(link_section = ".uninit.rehearsal")]
static mut KEPT: MaybeUninit<Kept> = MaybeUninit::uninit();

/// Servo tick from which on it happens, at thread level or in the servo's interrupt; none: the largest.
static DUE_IN_THREAD: AtomicU32 = AtomicU32::new(u32::MAX);
static DUE_IN_SERVO: AtomicU32 = AtomicU32::new(u32::MAX);
/// Which of those at thread level.
static KIND: AtomicU32 = AtomicU32::new(0);

/// How the image was started.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Switched on.
    First,
    /// By a crash.
    Crashed,
    /// On purpose, after that.
    Again,
}

impl Start {
    /// The word in records.
    pub fn name(self) -> &'static str {
        if self == Self::First { "emulator" } else { "software" }
    }

    /// In this servo tick the operator resets the fault, and begins anew.
    pub fn resets(self, servo_ticks: u32) -> bool {
        self == Self::Crashed && servo_ticks == RESET
    }

    /// After so many servo ticks nothing more is to be seen.
    pub fn act(self, servo_ticks: u32) {
        match self {
            // It was not asked for: it is told by now, and there is nothing to go on with.
            Self::Crashed if servo_ticks == RESET / 2 && kept().begun == 0 => end(false),
            Self::Crashed if servo_ticks == RESTART => {
                keep(Kept { begun: 0, crashes: 0, restarted: true });
                SCB::sys_reset();
            }
            Self::Again if servo_ticks == LAST => end(true),
            _ => {}
        }
    }
}

fn kept() -> Kept {
    // SAFETY: the static is there and aligned, zero when the machine is switched on and written as a whole ever after; its flag is
    // therefore 0 or 1. Every access is volatile, and none interrupts another: starts come before interrupts, a crash is one.
    unsafe { ptr::read_volatile((&raw const KEPT).cast::<Kept>()) }
}

fn keep(now: Kept) {
    // SAFETY: as above.
    unsafe { ptr::write_volatile((&raw mut KEPT).cast::<Kept>(), now) }
}

/// How this start came about; where it is the first, what is asked for is made ready.
pub fn start(crashed: bool) -> Start {
    let before = kept();
    keep(Kept { crashes: before.crashes + u32::from(crashed), restarted: false, ..before });
    if crashed {
        heprintln!("emulated: crash {} was begun at instruction {}", before.crashes + 1, before.begun);
        if before.crashes > 0 {
            // Where nothing works any more, nothing is gained by starting for ever.
            end(false);
        }
        return Start::Crashed;
    }
    if before.restarted {
        return Start::Again;
    }
    ask();
    Start::First
}

/// `crash=KIND@TICK` on the command line.
fn ask() {
    let mut line = [0_u8; COMMAND_LINE];
    // SAFETY: the debugger's call writes at most as many bytes as it is told there are.
    let failed = unsafe { syscall!(GET_CMDLINE, line.as_mut_ptr(), line.len()) };
    let words = line.split(|byte| matches!(byte, b' ' | 0)).filter_map(|word| str::from_utf8(word).ok());
    let asked = words.filter_map(|word| word.strip_prefix("crash=")?.split_once('@')).next();
    let Some((kind, tick)) = asked.filter(|_| failed == 0) else { return };
    let Ok(tick) = tick.parse() else { return };
    let kind = match kind {
        "hard_fault" => return DUE_IN_SERVO.store(tick, Ordering::Relaxed),
        "panic" => 1,
        "stack_overflow" => 2,
        "interrupt" => 3,
        _ => return,
    };
    KIND.store(kind, Ordering::Relaxed);
    DUE_IN_THREAD.store(tick, Ordering::Relaxed);
}

fn begin() {
    keep(Kept { begun: clock::instructions(), ..kept() });
}

/// At thread level, between two steps of the identification.
pub fn in_thread() {
    if SIGNALS.statistics.servo_ticks.get() < DUE_IN_THREAD.load(Ordering::Relaxed) {
        return;
    }
    match KIND.load(Ordering::Relaxed) {
        1 if TICK_COMES.contains(&clock::left()) => reach_beyond(),
        2 if clock::left() > TICK_WENT => {
            fill_the_stack(0);
        }
        3 if TICK_COMES.contains(&clock::left()) => call_nobody(),
        _ => {}
    }
}

/// In the servo's interrupt.
#[inline(always)]
pub fn in_servo() {
    if SIGNALS.statistics.servo_ticks.get() >= DUE_IN_SERVO.load(Ordering::Relaxed) {
        read_nowhere();
    }
}

#[inline(never)]
fn reach_beyond() {
    begin();
    let joints = [0_u8; 2];
    black_box(joints[black_box(2)]); // here
}

#[inline(never)]
fn read_nowhere() {
    begin();
    // SAFETY: there is none; that is what this is for.
    black_box(unsafe { NOWHERE.read_volatile() });
}

#[inline(never)]
#[expect(unconditional_recursion, reason = "the stack's end stops it")]
fn fill_the_stack(depth: u32) -> u32 {
    begin();
    let mut frame = MaybeUninit::<[u8; FRAME]>::uninit();
    black_box(&mut frame);
    let deeper = fill_the_stack(depth + 1);
    black_box(&mut frame);
    deeper + 1
}

#[inline(never)]
fn call_nobody() {
    begin();
    NVIC::pend(UNHANDLED);
    // SAFETY: outside any critical section; that nobody handles it is what this is for.
    unsafe { NVIC::unmask(UNHANDLED) };
    black_box(UNHANDLED.number());
}
