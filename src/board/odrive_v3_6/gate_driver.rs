//! Two DRV8301 on one SPI: reset, configuration and read-back, which is repeated in operation. Absolute
//! encoders share the SPI.
//!
//! Both share their enable line and their fault line: a reset affects both. A transfer takes 6 us of busy
//! waiting, below the servo's level.

use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::{Config, MODE_1, Spi, mode::Master};
use embassy_stm32::time::Hertz;

use super::contacts::drive;
use super::registers::apply;
use super::settings::absolute_encoders::{self, ERROR, READ_ANGLE, READ_ERRORS};
use super::settings::CLOCK_HZ;
use super::settings::gate_driver::{CONTROL_1, CONTROL_2, Register, TIMES, data, read, write};
use crate::hal::AbsoluteEncoderSide;
use crate::leg::AbsoluteEncoders;

/// Select lines, on port C (`main.h:77-80`).
const SELECT: [u32; 2] = [13, 14];
/// Both drivers' enable, on port B.
const ENABLE: u32 = 12;
const CYCLES_PER_US: u32 = CLOCK_HZ / 1_000_000;

/// Both gate drivers, and the encoders on their SPI.
pub struct GateDrivers {
    spi: Spi<'static, Blocking, Master>,
    encoders: [AbsoluteEncoders; 2],
}

/// SPI settings of the drivers: second edge, 42 MHz / 16 (`spi.c:71-76`, `drv8301.cpp:7-19`).
pub(super) fn configuration() -> Config {
    let mut configuration = Config::default();
    configuration.mode = MODE_1;
    configuration.frequency = Hertz(2_625_000);
    configuration.miso_pull = embassy_stm32::gpio::Pull::Up;
    configuration
}

impl GateDrivers {
    /// Deselects all encoders, before any transfer.
    pub(super) fn new(spi: Spi<'static, Blocking, Master>, encoders: [AbsoluteEncoders; 2]) -> Self {
        for (axis, encoders) in encoders.into_iter().enumerate() {
            absolute_encoders::deselect(axis, encoders, apply);
        }
        Self { spi, encoders }
    }

    /// Masks the interrupts of index inputs that are no index.
    pub(super) fn mask_indices(&self) {
        for (axis, encoders) in self.encoders.into_iter().enumerate() {
            absolute_encoders::mask_index(axis, encoders, apply);
        }
    }

    /// Frame with an encoder's angle; all ones without that encoder. After an error the chip's error register
    /// is read, so that the next frame is valid again.
    pub fn encoder(&mut self, axis: usize, side: AbsoluteEncoderSide) -> u16 {
        let encoders = self.encoders.get(axis).copied();
        let Some(pin) = encoders.and_then(|encoders| absolute_encoders::select(axis, side, encoders)) else {
            return u16::MAX;
        };
        let mut ask = |frame| self.exchange(pin.port, pin.number, frame).unwrap_or(u16::MAX);
        ask(READ_ANGLE);
        let answer = ask(READ_ANGLE);
        if answer & ERROR != 0 {
            ask(READ_ERRORS);
        }
        answer
    }

    /// Turns both off, for at least 40 us; the bridges must be off.
    pub fn off(&mut self) {
        drive(b'B', ENABLE, false);
    }

    /// Turns both on; they answer 20 ms later.
    pub fn on(&mut self) {
        drive(b'B', ENABLE, true);
    }

    /// Turns both off and on again with busy waiting; for the start.
    pub(super) fn restart(&mut self) {
        self.off();
        cortex_m::asm::delay(40 * CYCLES_PER_US);
        self.on();
        cortex_m::asm::delay(20_000 * CYCLES_PER_US);
    }

    /// Writes both configurations; returns whether each axis' driver holds its own. Takes 0.3 ms.
    pub fn configure(&mut self) -> [bool; 2] {
        for axis in 0..2 {
            for _ in 0..TIMES {
                self.frame(axis, write(Register::Control1, CONTROL_1));
            }
            self.frame(axis, write(Register::Control2, CONTROL_2));
        }
        cortex_m::asm::delay(100 * CYCLES_PER_US);
        [self.holds(0), self.holds(1)]
    }

    /// Whether a driver still holds its configuration; a disturbed frame is read a second time.
    pub fn holds(&mut self, axis: usize) -> bool {
        self.reads_back(axis) || self.reads_back(axis)
    }

    fn reads_back(&mut self, axis: usize) -> bool {
        let first = self.register(axis, Register::Control1);
        let second = self.register(axis, Register::Control2);
        first == Some(CONTROL_1) && second == Some(CONTROL_2)
    }

    /// Both status registers of a driver, the first in the upper half; all ones where it does not answer.
    pub fn status(&mut self, axis: usize) -> u32 {
        let mut status = |register| u32::from(self.register(axis, register).unwrap_or(u16::MAX));
        status(Register::Status1) << 16 | status(Register::Status2)
    }

    fn register(&mut self, axis: usize, register: Register) -> Option<u16> {
        self.frame(axis, read(register));
        data(self.frame(axis, read(register))?)
    }

    fn frame(&mut self, axis: usize, frame: u16) -> Option<u16> {
        self.exchange(b'C', *SELECT.get(axis)?, frame)
    }

    #[inline(never)]
    fn exchange(&mut self, port: u8, select: u32, frame: u16) -> Option<u16> {
        let mut word = [frame];
        drive(port, select, false);
        let sent = self.spi.blocking_transfer_in_place(&mut word);
        drive(port, select, true);
        // Minimum between frames: 400 ns (DRV8301, tHI_SCS), 350 ns (AS5047P, tCSn).
        cortex_m::asm::delay(CYCLES_PER_US);
        sent.ok().map(|()| word[0])
    }
}
