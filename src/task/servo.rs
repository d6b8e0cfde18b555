//! Level 1 on the board: the interrupt around `operation::ServoLevel`.

use cortex_m::peripheral::DWT;

use super::SIGNALS;
use super::leg::{JOINTS, LEG};
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::leg::Control;
use crate::operation::{ServoEnds, ServoLevel};

/// State of level 1.
pub struct ServoLoop {
    /// Control half of the leg.
    pub control: Control<JOINTS>,
    /// The servo level.
    pub level: ServoLevel<JOINTS>,
    /// The level's ends of the queues.
    pub ends: ServoEnds<'static, JOINTS>,
}

/// State of level 1, once the start has set it.
pub static SERVO: spin::Mutex<Option<&'static mut ServoLoop>> = spin::Mutex::new(None);

/// Interrupt of the servo.
#[inline(always)]
pub fn interrupt() {
    let statistics = &SIGNALS.statistics;
    if let Some(mut servo) = SERVO.try_lock()
        && let Some(servo) = servo.as_mut()
    {
        let begun = DWT::cycle_count();
        let _ = servo.level.tick(&mut servo.control, LEG.gravity, &mut servo.ends, &SIGNALS, &mut Odrive);
        statistics.servo_worst.raise(DWT::cycle_count().wrapping_sub(begun));
    }
    statistics.servo_ticks.add();
}
