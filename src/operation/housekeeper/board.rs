//! What level 6 needs of a board, and what it is built from.

use super::super::stage::{Order, Outcome};
use crate::leg::{Calibration, ControlRequest, DriveState};
use crate::motor::{AxisConfiguration, CalibrationSettings};
use crate::safety::{Cause, FaultCode};
use crate::trace::Record;

/// What level 6 needs of a board of `N` joints. Every method answers at once.
pub trait HousekeepingBoard<const N: usize> {
    /// The enabling switch is held; the start button is pressed.
    fn contacts(&self) -> (bool, bool);
    /// Why nothing may be enabled: the interlock's bits.
    fn causes(&self) -> u32;
    /// One more.
    fn raise(&mut self, cause: Cause);
    /// What does not hold for ever is forgotten.
    fn reset_interlock(&mut self);
    /// A gate driver holds its registers.
    fn gate_holds(&mut self, axis: usize) -> bool;
    /// What the gate drivers say is wrong.
    fn gate_status(&mut self) -> u32;
    /// The gate drivers' supply.
    fn switch_gates(&mut self, on: bool);
    /// Writes all registers; whether they hold.
    fn configure_gates(&mut self) -> bool;
    /// Of a bridge, degrees Celsius; none of a thermistor that is open or shorted.
    fn temperature(&self, axis: usize) -> Option<f32>;
    /// The servo gives less torque from 20 degrees below the hottest on.
    fn set_temperature(&mut self, degrees_c: f32);
    /// The servo reacts from its next tick on.
    fn report(&mut self, code: FaultCode, axis: usize);
    /// The counter of an axis as it is.
    fn encoder_count(&self, axis: usize) -> u16;
    /// Of a joint as the servo saw them last.
    fn joint_counts(&self, joint: usize) -> i32;
    /// The servo's ticks mean something from now on.
    fn begin_servo(&mut self);
    /// They do no more.
    fn end_servo(&mut self);
    /// Whether they do.
    fn has_begun(&self) -> bool;
    /// To an axis. It takes one within 42 us, and here are at most two in 2 ms.
    fn order(&mut self, axis: usize, order: Order);
    /// From an axis.
    fn outcome(&mut self, axis: usize) -> Option<Outcome>;
    /// An axis passed a calibration, which may be kept from now on.
    fn calibrated(&mut self, axis: usize, calibration: &Calibration) {
        let _ = (axis, calibration);
    }
    /// Everything that was kept was forgotten; told once.
    fn take_forgotten(&mut self) -> bool {
        false
    }
    /// To the servo; whether there was room.
    fn request(&mut self, request: ControlRequest<N>) -> bool;
    /// What the servo told since the last round, oldest first.
    fn drive_state(&mut self) -> Option<DriveState>;
    /// To whoever tells.
    fn say(&mut self, record: Record<N>);
}

/// What it is built from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HousekeepingSettings<const N: usize> {
    /// As commissioned.
    pub axes: [AxisConfiguration; N],
    /// What a calibration may do to a motor.
    pub calibration: [CalibrationSettings; N],
    /// A bridge that is not cooler is too hot, degrees Celsius.
    pub hottest_c: f32,
}
