//! Interrupts, at the same levels as on the board.
//!
//! | level | vector | task |
//! | --- | --- | --- |
//! | 0 | SysTick | current loops of both axes, and with SysTick stopped the plant; never masked |
//! | 1 | OTG_HS | servo; never masked |
//! | 6 | TIM3 | time of the executors |
#![expect(unsafe_code, reason = "interrupts are unmasked and their levels set")]

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{NVIC, SCB};
use cortex_m_rt::exception;
use scarab::task::{SIGNALS, servo};
use stm32_metapac::{Interrupt, interrupt};

use super::machine::Machine;
use super::{clock, plant, rehearsal};

/// Interrupt priority registers of the processor, a byte for each of 82 vectors.
const PRIORITIES: *mut u8 = 0xE000_E400 as *mut u8;
const VECTORS: usize = 82;
const LEVEL_1: u8 = 0x10;
const LEVEL_6: u8 = 0x60;

/// Sets the levels and enables the vectors; SysTick is started last.
pub fn enable() {
    // SAFETY: the registers of the interrupt controller, written once before any interrupt is enabled. Called
    // from `main`, outside any critical section.
    unsafe {
        for vector in 0..VECTORS {
            PRIORITIES.add(vector).write_volatile(LEVEL_6);
        }
        PRIORITIES.add(usize::from(Interrupt::OTG_HS.number())).write_volatile(LEVEL_1);
        if let Some(mut core) = cortex_m::Peripherals::take() {
            core.SCB.set_priority(SystemHandler::SysTick, 0);
        }
        NVIC::unmask(Interrupt::OTG_HS);
        NVIC::unmask(Interrupt::TIM3);
    }
}

/// Requests a run of the servo after level 0.
pub fn pend_servo() {
    NVIC::pend(Interrupt::OTG_HS);
}

#[exception]
fn SysTick() {
    plant::interrupt();
    if SCB::is_pendst_pending() {
        SIGNALS.statistics.current_missed.add();
    }
}

#[interrupt]
fn OTG_HS() {
    servo::interrupt(&mut Machine);
    rehearsal::in_servo();
}

#[interrupt]
fn TIM3() {
    clock::alarm();
}
