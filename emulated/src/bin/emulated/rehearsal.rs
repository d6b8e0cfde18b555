//! One crash per run, selected on the emulator's command line (`cargo emulate --crash`).
//!
//! The crashes run in this image because current loops, servo, executors and identification run as usual, and
//! the crash handler must work at their levels. After the crash the image starts again, as on the board. This
//! module determines the kind of start, and the operator's actions that follow.
//!
//! | start | detected by | operator's actions |
//! | --- | --- | --- |
//! | first | none of the below | enables and requests identification; the crash comes in the given tick |
//! | after the crash | crash record | as first, must be refused; resets the fault, as first; restarts |
//! | after that | a word preserved over the reset | as first; ends the emulator |
//!
//! **The worst instant** is chosen. A crash at thread level comes such that a tick falls due during its
//! handling. A stack overflow comes right after a tick, so that no tick interrupts it.
#![expect(unsafe_code, reason = "memory preserved over a reset, semihosting, an unmapped address")]

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

/// Longest command line that is parsed. Without arguments the command line is the path of the image.
const COMMAND_LINE: usize = 64;
/// Memory of the board that this machine lacks.
const NOWHERE: *const u32 = 0x1000_0000 as *const u32;
/// Interrupt without a handler.
const UNHANDLED: Interrupt = Interrupt::SDIO;
/// SysTick counts left, of 7,000 a period: the crash begins 220 to 370 instructions before a tick.
const TICK_COMES: core::ops::Range<u32> = 300..500;
/// More than 3,300 instructions before the next tick: enough to fill the stack.
const TICK_WENT: u32 = 4_500;
/// Servo ticks: the operator resets the fault; the image is restarted; the last start ends.
const RESET: u32 = SERVO_RATE_HZ / 10;
const RESTART: u32 = 2 * RESET;
const LAST: u32 = RESET;
/// Bytes of one call while the stack is filled.
const FRAME: usize = 1024;

/// State preserved over a reset. The emulated memory is all zero at power-on.
#[derive(Clone, Copy)]
struct Persisted {
    /// Instruction count at which the crash was begun.
    begun: u32,
    /// Consecutive starts that found a crash.
    crashes: u32,
    /// Whether the image was restarted on purpose.
    restarted: bool,
}

#[unsafe(link_section = ".uninit.rehearsal")]
static mut PERSISTED: MaybeUninit<Persisted> = MaybeUninit::uninit();

/// Servo tick from which on the crash is due, at thread level or in the servo's interrupt; without
/// one the largest.
static DUE_IN_THREAD: AtomicU32 = AtomicU32::new(u32::MAX);
static DUE_IN_SERVO: AtomicU32 = AtomicU32::new(u32::MAX);
/// Kind of the crash at thread level.
static KIND: AtomicU32 = AtomicU32::new(0);

/// Kind of start of the image.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Power-on.
    First,
    /// After a crash.
    Crashed,
    /// Deliberate restart after that.
    Again,
}

impl Start {
    /// Name used in records.
    pub fn name(self) -> &'static str {
        if self == Self::First { "emulator" } else { "software" }
    }

    /// Whether the operator resets the fault in this servo tick, and begins again.
    pub fn resets(self, servo_ticks: u32) -> bool {
        self == Self::Crashed && servo_ticks == RESET
    }

    /// Restarts the image or ends the run at the end of each kind of start.
    pub fn act(self, servo_ticks: u32) {
        match self {
            // This crash was not requested. Its records have been sent, and the run cannot continue.
            Self::Crashed if servo_ticks == RESET / 2 && persisted().begun == 0 => end(false),
            Self::Crashed if servo_ticks == RESTART => {
                persist(Persisted { begun: 0, crashes: 0, restarted: true });
                SCB::sys_reset();
            }
            Self::Again if servo_ticks == LAST => end(true),
            _ => {}
        }
    }
}

fn persisted() -> Persisted {
    // SAFETY: the static exists and is aligned, zero at power-on and always written as a whole afterwards. So
    // its flag is 0 or 1. Every access is volatile, and none interrupts another: starts come before
    // interrupts, and a crash ends the run.
    unsafe { ptr::read_volatile((&raw const PERSISTED).cast::<Persisted>()) }
}

fn persist(now: Persisted) {
    // SAFETY: as for `persisted`.
    unsafe { ptr::write_volatile((&raw mut PERSISTED).cast::<Persisted>(), now) }
}

/// Determines the kind of start; a first start arms the requested crash.
pub fn start(crashed: bool) -> Start {
    let before = persisted();
    persist(Persisted { crashes: before.crashes + u32::from(crashed), restarted: false, ..before });
    if crashed {
        heprintln!("emulated: crash {} was begun at instruction {}", before.crashes + 1, before.begun);
        if before.crashes > 0 {
            // A second crash in a row would repeat endlessly.
            end(false);
        }
        return Start::Crashed;
    }
    if before.restarted {
        return Start::Again;
    }
    read_request();
    Start::First
}

/// Parses `crash=KIND@TICK` on the command line.
fn read_request() {
    let mut line = [0_u8; COMMAND_LINE];
    // SAFETY: the debugger's call writes at most the given number of bytes.
    let failed = unsafe { syscall!(GET_CMDLINE, line.as_mut_ptr(), line.len()) };
    let words = line.split(|byte| matches!(byte, b' ' | 0)).filter_map(|word| str::from_utf8(word).ok());
    let requested = words.filter_map(|word| word.strip_prefix("crash=")?.split_once('@')).next();
    let Some((kind, tick)) = requested.filter(|_| failed == 0) else { return };
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
    persist(Persisted { begun: clock::instructions(), ..persisted() });
}

/// Crashes at thread level when due, between two steps of the identification.
pub fn in_thread() {
    if SIGNALS.statistics.servo_ticks.get() < DUE_IN_THREAD.load(Ordering::Relaxed) {
        return;
    }
    match KIND.load(Ordering::Relaxed) {
        1 if TICK_COMES.contains(&clock::left()) => reach_beyond(),
        2 if clock::left() > TICK_WENT => {
            fill_the_stack(0);
        }
        3 if TICK_COMES.contains(&clock::left()) => raise_unhandled(),
        _ => {}
    }
}

/// Crashes in the servo's interrupt when due.
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
    // SAFETY: not valid on purpose: the read must fault.
    black_box(unsafe { NOWHERE.read_volatile() });
}

#[inline(never)]
#[expect(unconditional_recursion, reason = "the end of the stack stops it")]
fn fill_the_stack(depth: u32) -> u32 {
    begin();
    let mut frame = MaybeUninit::<[u8; FRAME]>::uninit();
    black_box(&mut frame);
    let deeper = fill_the_stack(depth + 1);
    black_box(&mut frame);
    deeper + 1
}

#[inline(never)]
fn raise_unhandled() {
    begin();
    NVIC::pend(UNHANDLED);
    // SAFETY: outside any critical section; the missing handler is intended.
    unsafe { NVIC::unmask(UNHANDLED) };
    black_box(UNHANDLED.number());
}
