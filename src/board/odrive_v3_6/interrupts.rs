//! Interrupt priorities.
//!
//! | priority | level | vectors | task |
//! | --- | --- | --- | --- |
//! | 0 | above all | EXTI4 | the emergency stop's contact as it opens; never masked |
//! | 1 | 0 | ADC, EXTI9_5, EXTI15_10 | current loops of both axes, index pulses; never masked |
//! | 2 | 1 | OTG_HS | servo, pended by the current loop; never masked |
//! | 3 | 3 | TIM5 | time of the executors |
//! | 4 | 4 | CAN1_RX0 | frames out of the CAN controller |
//! | 5 | 5 | CAN1_TX | the bus' nodes and axes, pended by CAN1_RX0 and by the servo |
//! | 5 | 5 | OTG_FS | law of the assistance, pended by the servo |
//! | 6 | 6 | I2C3_EV | executor of the housekeeping; and every vector that is not named |
//!
//! Critical sections mask priority 3 and below. Reset leaves every vector at priority 0, where it could
//! interrupt a critical section of the same data. So all are moved before anything is enabled.

use embassy_stm32::interrupt::{
    ADC, CAN1_RX0, CAN1_TX, EXTI4, EXTI9_5, EXTI15_10, I2C3_EV, InterruptExt, OTG_FS, OTG_HS, Priority, TIM5,
};

use super::registers::store;

/// Interrupt priority registers of the processor.
const PRIORITIES: u32 = 0xE000_E400;
/// Number of priority words: 82 vectors.
const WORDS: u32 = 21;

/// Sets every vector to level 6, then the named ones to theirs.
pub(super) fn set_levels() {
    for word in 0..WORDS {
        store(PRIORITIES + 4 * word, 0x6060_6060);
    }
    EXTI4.set_priority(Priority::P0);
    for vector in [ADC, EXTI9_5, EXTI15_10] {
        vector.set_priority(Priority::P1);
    }
    OTG_HS.set_priority(Priority::P2);
    TIM5.set_priority(Priority::P3);
    CAN1_RX0.set_priority(Priority::P4);
    for vector in [CAN1_TX, OTG_FS] {
        vector.set_priority(Priority::P5);
    }
    I2C3_EV.set_priority(Priority::P6);
}

/// Requests a run of the servo after level 0.
#[inline(always)]
pub fn pend_servo() {
    OTG_HS.pend();
}

/// Requests a run of the assistance.
pub fn pend_assist() {
    OTG_FS.pend();
}
