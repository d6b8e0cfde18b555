//! Order of exceptions, and the state that each handler reads (ARMv7-M Architecture Reference Manual, B1.5).
//!
//! Every handler gives its number and the interrupt control register as it enters and leaves: the order of
//! preemption and tail-chaining. Barriers after each request make that order defined.

use core::arch::{asm, naked_asm};

use cortex_m::Peripherals;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{NVIC, SCB};
use cortex_m::register::{basepri, primask};
use cortex_m_rt::exception;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::Interrupt;

use super::{computation, give};

/// Interrupt control and state: active and pending exception, base level, pending flags.
const STATE: *const u32 = 0xE000_ED04 as *const u32;
const LEAVES: u32 = 1 << 31;

/// Runs all checks; their words are the results.
pub fn run(core: &mut Peripherals) {
    give(computation::integers());
    give(computation::floats());
    give(special());
    prepare(core);
    nested();
    masked();
    grouped();
    called();
    disabled();
    slept();
    give(exclusive());
}

/// Gives a number with the state of the interrupt controller.
fn see(what: u32) {
    // SAFETY: reading the register has no effect.
    give(what << 16 ^ unsafe { STATE.read_volatile() });
}

fn barrier() {
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

fn pend(which: Interrupt) {
    NVIC::pend(which);
    barrier();
}

fn pend_system() {
    SCB::set_pendsv();
    barrier();
}

/// Instructions that the compiler rarely chooses: saturation, packed halves, fused products, roots.
fn special() -> u32 {
    let (mut sum, flags): (u32, u32);
    // SAFETY: registers only; the status register is written back as it was after a reset.
    unsafe {
        asm!(
            "vmsr fpscr, {zero}",
            "qadd {a}, {x}, {y}", "ssat {b}, #9, {x}", "eor {a}, {a}, {b}",
            "smlad {a}, {x}, {y}, {a}", "sxtab16 {b}, {a}, {x}", "add {a}, {a}, {b}, ror #5",
            "umull {b}, {c}, {x}, {y}", "umaal {b}, {c}, {x}, {y}", "eor {a}, {a}, {b}", "add {a}, {a}, {c}",
            "bfi {a}, {y}, #3, #7", "ubfx {b}, {x}, #11, #9", "eor {a}, {a}, {b}, ror #9",
            "usad8 {b}, {x}, {y}", "uadd8 {c}, {x}, {y}", "sel {c}, {x}, {y}", "eor {a}, {a}, {b}",
            "eor {a}, {a}, {c}, ror #3", "mrs {b}, apsr", "eor {a}, {a}, {b}",
            "vmov s0, {x}", "vmov s1, {y}", "vcvt.f32.s32 s2, s0", "vcvt.f32.u32 s3, s1",
            "vsqrt.f32 s4, s3", "vfma.f32 s4, s2, s3", "vfnms.f32 s4, s3, s3", "vmov {b}, s4",
            "eor {a}, {a}, {b}, ror #1", "vcvtr.s32.f32 s5, s2", "vcvt.s32.f32 s6, s3", "vmov {b}, s5",
            "eor {a}, {a}, {b}", "vmov {b}, s6", "add {a}, {a}, {b}", "vcvtb.f16.f32 s7, s3",
            "vmov {b}, s7", "uxth {b}, {b}", "eor {a}, {a}, {b}",
            "vmrs {f}, fpscr", "vmsr fpscr, {zero}",
            a = out(reg) sum, b = out(reg) _, c = out(reg) _, f = out(reg) flags,
            x = in(reg) 0x7F03_8123_u32, y = in(reg) 0x6543_F0E1_u32, zero = in(reg) 0,
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _,
            out("s7") _,
        );
    }
    give(flags);
    sum
}

/// Sets levels: call 0x10, system 0xF0, SPI2 0x20, SPI1 and USART1 0x40.
fn prepare(core: &mut Peripherals) {
    // SAFETY: no interrupt is enabled before its level is set.
    unsafe {
        core.SCB.set_priority(SystemHandler::SVCall, 0x10);
        core.SCB.set_priority(SystemHandler::PendSV, 0xF0);
        for (which, level) in [(Interrupt::SPI1, 0x40), (Interrupt::SPI2, 0x20), (Interrupt::USART1, 0x40)] {
            core.NVIC.set_priority(which, level);
            NVIC::unmask(which);
        }
    }
}

/// A level is preempted by a higher one, and followed by an equal one before a lower one.
fn nested() {
    give(0xA000_0001);
    pend(Interrupt::SPI1);
    see(1);
}

/// Base priority and the interrupt mask hold requests back; a cleared request never runs.
fn masked() {
    give(0xA000_0002);
    // SAFETY: no critical section depends on these masks here.
    unsafe {
        basepri::write(0x40);
        pend(Interrupt::USART1);
        pend(Interrupt::SPI2);
        see(2);
        basepri::write(0);
        barrier();
        cortex_m::interrupt::disable();
        pend_system();
        pend(Interrupt::SPI2);
        see(3);
        give(u32::from(primask::read().is_active()));
        cortex_m::interrupt::enable();
        barrier();
        cortex_m::interrupt::disable();
        pend_system();
        SCB::clear_pendsv();
        barrier();
        see(4);
        cortex_m::interrupt::enable();
    }
    barrier();
    see(5);
}

/// With three bits of sub-priority, levels 0x20 and 0x40 are one group: no preemption, but an order.
fn grouped() {
    give(0xA000_0003);
    const CONTROL: *mut u32 = 0xE000_ED0C as *mut u32;
    // SAFETY: the key allows the write; only the split of priorities changes.
    unsafe { CONTROL.write_volatile(0x05FA_0600) };
    barrier();
    pend(Interrupt::SPI1);
    see(6);
    // SAFETY: as above.
    unsafe { CONTROL.write_volatile(0x05FA_0000) };
    barrier();
}

/// Supervisor calls: stacked registers, returned value, aligned stack, floats in use or not.
fn called() {
    give(0xA000_0004);
    let (mut first, last): (u32, u32);
    // Bit 3 of CONTROL, which a Cortex-M4 lacks, is set in Unicorn, so both floating-point bits are cleared.
    // SAFETY: the handler keeps every register but r0. Floats in s0 and s16 survive it.
    unsafe {
        asm!(
            "vmov s0, r1", "vmov s16, r2", "svc 7", "vmov r1, s0", "vmov r2, s16", "eor r0, r0, r1",
            "eor r0, r0, r2", "mrs r3, control", "bic r3, r3, #12", "msr control, r3", "isb",
            "push {{r4}}", "svc 9", "pop {{r4}}", "eor r0, r0, r3",
            inout("r0") 0x1111_1111 => first, inout("r1") 0x3F80_0000_u32 => last,
            inout("r2") 0x4000_0001_u32 => _, out("r3") _, out("r12") _, out("s0") _, out("s16") _,
        );
    }
    first ^= last;
    give(first);
}

/// A request outlives a disabled interrupt; a cleared one does not.
fn disabled() {
    give(0xA000_0005);
    NVIC::mask(Interrupt::SPI1);
    pend(Interrupt::SPI1);
    give(u32::from(NVIC::is_pending(Interrupt::SPI1)) | u32::from(NVIC::is_enabled(Interrupt::SPI1)) << 1);
    see(7);
    NVIC::unpend(Interrupt::SPI1);
    // SAFETY: its level is set.
    unsafe { NVIC::unmask(Interrupt::SPI1) };
    barrier();
    see(8);
}

/// A masked request ends a wait for an interrupt, and an event one for an event.
fn slept() {
    give(0xA000_0006);
    cortex_m::interrupt::disable();
    pend(Interrupt::SPI2);
    cortex_m::asm::wfi();
    see(9);
    // SAFETY: no critical section depends on the mask here.
    unsafe { cortex_m::interrupt::enable() };
    barrier();
    cortex_m::asm::sev();
    cortex_m::asm::wfe();
    see(10);
}

/// Whether a store-exclusive fails after a call (bit 0) and after an interrupt (bit 1), as both clear the
/// reservation.
fn exclusive() -> u32 {
    let mut word = 5_u32;
    let (called, interrupted): (u32, u32);
    // SAFETY: the word is this function's. The call's handler keeps every register but r0. 36 in the trigger
    // register requests SPI2.
    unsafe {
        asm!("ldrex r1, [{0}]", "svc 3", "strex {1}, r1, [{0}]", "ldrex r1, [{0}]", "str {3}, [{2}]", "dsb", "isb",
            "strex {3}, r1, [{0}]", in(reg) &raw mut word, out(reg) called, in(reg) 0xE000_EF00_u32,
            inout(reg) 36 => interrupted, out("r0") _, out("r1") _);
    }
    called | interrupted << 1
}

#[interrupt]
fn SPI1() {
    see(0x101);
    pend_system();
    pend(Interrupt::USART1);
    give(u32::from(NVIC::is_pending(Interrupt::USART1)) | u32::from(NVIC::is_active(Interrupt::SPI1)) << 1);
    pend(Interrupt::SPI2);
    // Set other values in the registers of the interrupted code.
    // SAFETY: declared as changed; those that a callee keeps are untouched.
    unsafe { asm!("vmov s0, {0}", "vcmp.f32 s0, #0", in(reg) 7, out("s0") _) };
    give(LEAVES | 0x101);
}

#[interrupt]
fn SPI2() {
    see(0x102);
    give(LEAVES | 0x102);
}

#[interrupt]
fn USART1() {
    see(0x103);
    give(LEAVES | 0x103);
}

#[exception]
fn PendSV() {
    see(0x104);
    // SAFETY: the handler keeps every register but r0.
    unsafe { asm!("svc 5", inout("r0") 3 => _, out("r1") _, out("r2") _, out("r3") _, out("r12") _) };
    give(LEAVES | 0x104);
}

/// Supervisor call: hands the frame and the return code on.
#[unsafe(naked)]
#[unsafe(export_name = "SVCall")]
extern "C" fn supervisor_call() {
    naked_asm!("mrs r0, msp", "mov r1, lr", "push {{r0, lr}}", "bl {called_with}", "pop {{r0, pc}}", called_with = sym called_with)
}

/// Reports return code, alignment, stacked registers and the call's number; the caller's r0 becomes their
/// sum.
extern "C" fn called_with(frame: *mut u32, code: u32) {
    see(0x105);
    give(code);
    // SAFETY: the processor stored eight words there; the word before the return address is the call.
    unsafe {
        let call = (frame.add(6).read() as *const u16).sub(1).read();
        let status = frame.add(7).read();
        give(status & 0x0000_03FF | u32::from(call & 0xFF) << 24 | u32::from(frame as u32 % 8 == 0) << 16);
        frame.write(frame.read().wrapping_add(code) ^ u32::from(call));
    }
}
