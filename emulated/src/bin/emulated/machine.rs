//! Board functions of the emulated machine, which can only request the servo.

use scarab::hal::{Contacts, Controller, EncoderPlace, Frame, Hardware};
use scarab::task::leg::JOINTS;

use super::vectors;

/// A board without contacts, bridges, gate drivers, bus and watchdog.
pub struct Machine;

impl Hardware<JOINTS> for Machine {
    fn masked(&mut self, step: impl FnOnce(&mut Self)) {
        step(self);
    }
    fn disable_all(&mut self) {}
    fn disable(&mut self, _: usize) {}
    fn set_duty(&mut self, _: usize, _: &[f32; 3]) {}
    fn enable(&mut self, _: usize) {}
    fn set_brake(&mut self, _: f32) {}
    fn set_holding_brake(&mut self, _: bool) {}
    fn set_status_light(&mut self, _: bool) {}
    fn pend_servo(&mut self) {
        vectors::pend_servo();
    }
    fn pend_bus(&mut self) {}

    /// No session begins without an operator's or a host's request.
    fn pend_assist(&mut self) {}
    fn contacts(&self) -> Contacts {
        Contacts::default()
    }
    fn encoder_count(&self, _: usize) -> u16 {
        0
    }
    fn encoder_frame(&mut self, _: usize, _: EncoderPlace) -> u16 {
        u16::MAX
    }

    fn temperature(&self, _: usize) -> Option<f32> {
        None
    }
    fn convert_thermistor(&mut self, _: usize) {}

    fn thermistor_code(&mut self) -> Option<u16> {
        None
    }

    fn gate_holds(&mut self, _: usize) -> bool {
        true
    }
    fn gate_status(&mut self, _: usize) -> u32 {
        0
    }
    fn switch_gates(&mut self, _: bool) {}
    fn configure_gates(&mut self) -> bool {
        true
    }
    fn now_us(&self) -> u64 {
        0
    }
    fn controller(&mut self) -> Controller {
        Controller::Off
    }
    fn mailboxes_waiting(&self) -> u32 {
        0
    }
    fn send(&mut self, _: u32, _: &Frame) {}
    fn abort_transmission(&mut self) {}
    fn feed_watchdog(&mut self) {}
    fn stretch_watchdog(&mut self) -> bool {
        true
    }
    fn tighten_watchdog(&mut self) -> bool {
        true
    }
}
