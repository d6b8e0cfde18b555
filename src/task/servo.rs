//! Level 1 on the board: the interrupt around `operation::ServoLevel`.

use super::SIGNALS;
use super::leg::{JOINTS, LEG};
use crate::hal::Hardware;
use crate::leg::Control;
use crate::operation::{ServoEnds, ServoLevel};

/// What level 1 works on.
pub struct ServoLoop {
    /// The half of the leg that moves.
    pub control: Control<JOINTS>,
    /// The level around it.
    pub level: ServoLevel<JOINTS>,
    /// Its ends of the queues.
    pub ends: ServoEnds<'static, JOINTS>,
    /// Processor cycles; wraps.
    pub clock: fn() -> u32,
}

/// What level 1 works on, once the start has set it.
pub static SERVO: spin::Mutex<Option<&'static mut ServoLoop>> = spin::Mutex::new(None);

/// The servo's vector.
#[inline(always)]
pub fn interrupt(hardware: &mut impl Hardware<JOINTS>) {
    let statistics = &SIGNALS.statistics;
    if let Some(mut servo) = SERVO.try_lock()
        && let Some(servo) = servo.as_mut()
    {
        let begun = (servo.clock)();
        let _ = servo.level.tick(&mut servo.control, LEG.gravity, &mut servo.ends, &SIGNALS, hardware);
        statistics.servo_worst.raise((servo.clock)().wrapping_sub(begun));
    }
    statistics.servo_ticks.add();
}
