//! The board as `hal::Hardware`: every method is a few register accesses.

use embassy_time::Instant;
use spin::Mutex;

use super::flash::supply_is_low;
use super::gate_driver::GateDrivers;
use super::settings::analog::temperature_c;
use super::{brake, bridge, can, contacts, converter, encoder, holding_brake, interrupts, status_light, watchdog};
use crate::hal::{Contacts, Controller, AbsoluteEncoderSide, Frame, Hardware};

/// Gate drivers, available after the start; only the housekeeping uses them.
static GATE_DRIVERS: Mutex<Option<GateDrivers>> = Mutex::new(None);

/// Access to the registers of this board; each level has its own value.
#[derive(Clone, Copy, Debug)]
pub struct Odrive;

impl Odrive {
    /// Creates the access and stores the gate drivers.
    pub fn new(gate_drivers: GateDrivers) -> Self {
        if let Some(mut home) = GATE_DRIVERS.try_lock() {
            *home = Some(gate_drivers);
        }
        Self
    }
}

/// Calls a function with the gate drivers; `None` before the start has stored them.
fn gates<R>(ask: impl FnOnce(&mut GateDrivers) -> R) -> Option<R> {
    GATE_DRIVERS.try_lock()?.as_mut().map(ask)
}

impl Hardware<2> for Odrive {
    #[inline(always)]
    fn masked(&mut self, step: impl FnOnce(&mut Self)) {
        cortex_m::interrupt::free(|_| step(self));
    }

    #[inline(always)]
    fn disable_all(&mut self) {
        bridge::disable_all();
    }

    #[inline(always)]
    fn disable(&mut self, axis: usize) {
        bridge::disable(axis);
    }

    #[inline(always)]
    fn set_duty(&mut self, axis: usize, duty: &[f32; 3]) {
        bridge::set_duty(axis, duty);
    }

    #[inline(always)]
    fn enable(&mut self, axis: usize) {
        bridge::enable(axis);
    }

    #[inline(always)]
    fn set_brake(&mut self, duty: f32) {
        brake::set(duty);
    }

    fn set_holding_brake(&mut self, released: bool) {
        holding_brake::set(released);
    }

    fn set_status_light(&mut self, is_lit: bool) {
        status_light::set(is_lit);
    }

    #[inline(always)]
    fn pend_servo(&mut self) {
        interrupts::pend_servo();
    }

    fn pend_bus(&mut self) {
        can::pend();
    }

    fn pend_assist(&mut self) {
        interrupts::pend_assist();
    }

    fn contacts(&self) -> Contacts {
        Contacts { enabling: contacts::enabling(), start: contacts::start() }
    }

    fn encoder_count(&self, axis: usize) -> u16 {
        encoder::count(axis)
    }

    fn encoder_frame(&mut self, axis: usize, side: AbsoluteEncoderSide) -> u16 {
        gates(|gates| gates.encoder(axis, side)).unwrap_or(u16::MAX)
    }

    fn temperature(&self, axis: usize) -> Option<f32> {
        converter::thermistors().get(axis).copied().and_then(temperature_c)
    }

    fn convert_thermistor(&mut self, axis: usize) {
        converter::convert_thermistor(axis);
    }

    fn thermistor_code(&mut self) -> Option<u16> {
        converter::thermistor_code()
    }

    fn gate_holds(&mut self, axis: usize) -> bool {
        gates(|gates| gates.holds(axis)).unwrap_or(false)
    }

    fn gate_status(&mut self, axis: usize) -> u32 {
        gates(|gates| gates.status(axis)).unwrap_or(u32::MAX)
    }

    fn switch_gates(&mut self, on: bool) {
        gates(|gates| if on { gates.on() } else { gates.off() });
    }

    fn configure_gates(&mut self) -> bool {
        gates(GateDrivers::configure) == Some([true; 2])
    }

    fn now_us(&self) -> u64 {
        Instant::now().as_micros()
    }

    fn controller(&mut self) -> Controller {
        can::status()
    }

    fn mailboxes_waiting(&self) -> u32 {
        can::waiting()
    }

    fn send(&mut self, mailbox: u32, frame: &Frame) {
        can::send(mailbox, frame);
    }

    fn abort_transmission(&mut self) {
        can::give_up();
    }

    fn processor_supply_is_low(&self) -> bool {
        supply_is_low()
    }

    fn feed_watchdog(&mut self) {
        watchdog::feed();
    }

    fn stretch_watchdog(&mut self) -> bool {
        watchdog::stretch()
    }

    fn tighten_watchdog(&mut self) -> bool {
        watchdog::tighten()
    }
}
