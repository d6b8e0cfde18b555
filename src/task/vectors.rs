//! Interrupt vectors of this board, each one call.
#![expect(unsafe_code, reason = "unmasking vectors, and entering an executor from its own interrupt")]

use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{
    ADC, CAN1_RX0, CAN1_TX, EXTI4, EXTI9_5, EXTI15_10, I2C3_EV, InterruptExt, OTG_FS, OTG_HS,
};

use super::{SIGNALS, assist, bus, current, servo};
use crate::board::odrive_v3_6::{can, contacts, encoder};
use crate::safety::InhibitReason;

/// Enables the interrupts of emergency stop, converters, index pulses, bus and servo; their data must
/// be in place.
pub fn enable() {
    // SAFETY: called once, from `main`, outside any critical section. Levels are set, and the handlers take
    // their locks only by trying.
    unsafe {
        for vector in [EXTI4, EXTI9_5, EXTI15_10, OTG_HS, OTG_FS, CAN1_RX0, CAN1_TX, ADC] {
            vector.enable();
        }
    }
}

#[interrupt]
fn ADC() {
    current::interrupt();
}

#[interrupt]
fn OTG_HS() {
    servo::interrupt();
}

#[interrupt]
fn EXTI4() {
    if contacts::stop_came() {
        SIGNALS.inhibit.raise(InhibitReason::EmergencyStop);
    }
}

#[interrupt]
fn EXTI9_5() {
    encoder::index_came(0);
}

#[interrupt]
fn EXTI15_10() {
    encoder::index_came(1);
}

/// Moves received frames on. The controller holds three; a frame that arrives meanwhile raises
/// this interrupt again.
#[interrupt]
fn CAN1_RX0() {
    for _ in 0..3 {
        let Some(frame) = can::receive() else { break };
        if !bus::received(frame) {
            can::lose();
        }
    }
    can::pend();
}

#[interrupt]
fn CAN1_TX() {
    can::acknowledge();
    bus::interrupt();
}

#[interrupt]
fn OTG_FS() {
    assist::interrupt();
}

/// Executor of the housekeeping.
pub static HOUSEKEEPING: embassy_executor::InterruptExecutor = embassy_executor::InterruptExecutor::new();

/// Interrupt vector of the housekeeping.
pub const HOUSEKEEPING_VECTOR: interrupt::Interrupt = I2C3_EV;

#[interrupt]
unsafe fn I2C3_EV() {
    // SAFETY: this is the vector with which the executor is started.
    unsafe { HOUSEKEEPING.on_interrupt() }
}
