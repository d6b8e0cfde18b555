//! Level 5 on the board: the interrupt around `operation::AssistLevel`.

use super::SIGNALS;
use super::leg::JOINTS;
use crate::operation::{AssistEnds, AssistLevel};
use cortex_m::peripheral::DWT;

/// State of the assistance.
pub struct AssistLoop {
    level: AssistLevel<JOINTS>,
    ends: AssistEnds<'static, JOINTS>,
}

impl AssistLoop {
    /// Assistance without a session.
    pub const fn new(ends: AssistEnds<'static, JOINTS>) -> Self {
        Self { level: AssistLevel::new(), ends }
    }
}

/// State of the assistance, once the start has set it.
pub static ASSIST: spin::Mutex<Option<&'static mut AssistLoop>> = spin::Mutex::new(None);

/// Interrupt of the assistance.
pub fn interrupt() {
    let begun = DWT::cycle_count();
    if let Some(mut assist) = ASSIST.try_lock()
        && let Some(assist) = assist.as_mut()
    {
        assist.level.run(&mut assist.ends);
    }
    SIGNALS.statistics.assist_worst.raise(DWT::cycle_count().wrapping_sub(begun));
}
