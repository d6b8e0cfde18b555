//! Frames and registers of the two DRV8301 (`Drivers/DRV8301/drv8301.hpp:92-113`, `drv8301.cpp:26-102`).

/// First control register: overcurrent by drain-source voltage, number 21 (about 150 A), with latched
/// shutdown. Six inputs; 1.7 A gate current.
pub const CONTROL_1: u16 = 21 << 6 | 1 << 4;
/// Second control register: shunt amplifiers at 40 V/V.
pub const CONTROL_2: u16 = 2 << 2;
/// Gain that [`CONTROL_2`] sets, V/V.
pub const GAIN: f32 = 40.0;
/// Number of writes of the first control register: it "tends to be ignored if only done once".
pub const TIMES: usize = 5;
/// Answer of a driver without supply.
pub const FRAME_FAULT: u16 = 0xBEEF;

/// Registers by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Register {
    /// First fault register.
    Status1,
    /// Second fault register.
    Status2,
    /// Register of [`CONTROL_1`].
    Control1,
    /// Register of [`CONTROL_2`].
    Control2,
}

/// Frame that writes a register.
pub const fn write(register: Register, data: u16) -> u16 {
    (register as u16) << 11 | data & 0x07FF
}

/// Frame that reads a register; the answer comes with the next frame.
pub const fn read(register: Register) -> u16 {
    1 << 15 | (register as u16) << 11
}

/// Data of an answer; `None` without supply.
pub const fn data(answer: u16) -> Option<u16> {
    if answer == FRAME_FAULT { None } else { Some(answer & 0x07FF) }
}
