//! What every used pin is. Source: `Board/v3/Inc/main.h:77-156`, `board.cpp:35-254`; registers RM0090 8.4.
//!
//! The bus' pins: [`super::can`]. Left as reset has them, since nothing uses them yet: UART_A (PA0, PA1), USB (PA11, PA12), GPIO6 to 8 (PB2,
//! PA15, PB3).

use super::Write;

/// What a pin is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A converter's input.
    Analog,
    /// A level that is read.
    Input(Pull),
    /// A level that is driven: high or low.
    Output(bool),
    /// A peripheral's, by its number; pulled where it is an input, and until the peripheral drives it.
    Alternate(u32, Pull),
}

/// What a pin is pulled to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Pull {
    /// Nothing.
    None,
    /// Supply.
    Up,
    /// Ground.
    Down,
}

/// A port and a number, and what it is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// `A` to `D`.
    pub port: u8,
    /// 0..=15.
    pub number: u32,
    /// What it is to be.
    pub mode: Mode,
}

const fn pin(port: u8, number: u32, mode: Mode) -> Pin {
    Pin { port, number, mode }
}

/// What a released output looks like until the timer drives it: low.
const BRIDGE_0: Mode = Mode::Alternate(1, Pull::Down);
const BRIDGE_1: Mode = Mode::Alternate(3, Pull::Down);
const CHOPPER: Mode = Mode::Alternate(1, Pull::Down);
const ENCODER: Mode = Mode::Alternate(2, Pull::None);
/// An open contact, or a wire that broke, is low.
const CONTACT: Mode = Mode::Input(Pull::Down);

/// Gate drivers off and deselected: the first that is set.
pub const GATES_OFF: [Pin; 3] = [
    pin(b'B', 12, Mode::Output(false)),
    pin(b'C', 13, Mode::Output(true)),
    pin(b'C', 14, Mode::Output(true)),
];

/// All others; bridges and chopper last, when their timers hold them low.
pub const PINS: [Pin; 32] = [
    // Shunts of axis 0 (B, C) and axis 1 (C, B); bus voltage; thermistors of bridge 0, bridge 1 and chopper.
    pin(b'C', 0, Mode::Analog),
    pin(b'C', 1, Mode::Analog),
    pin(b'C', 2, Mode::Analog),
    pin(b'C', 3, Mode::Analog),
    pin(b'A', 6, Mode::Analog),
    pin(b'C', 5, Mode::Analog),
    pin(b'A', 4, Mode::Analog),
    pin(b'A', 5, Mode::Analog),
    // Encoders A, B and index.
    pin(b'B', 4, ENCODER),
    pin(b'B', 5, ENCODER),
    pin(b'B', 6, ENCODER),
    pin(b'B', 7, ENCODER),
    pin(b'C', 9, Mode::Input(Pull::None)),
    pin(b'C', 15, Mode::Input(Pull::None)),
    // Fault of either gate driver, low when there is one.
    pin(b'D', 2, Mode::Input(Pull::Up)),
    // GPIO5: emergency stop, GPIO3: enabling switch, GPIO4: start button.
    pin(b'C', 4, CONTACT),
    pin(b'A', 2, CONTACT),
    pin(b'A', 3, CONTACT),
    pin(b'A', 8, BRIDGE_0),
    pin(b'A', 9, BRIDGE_0),
    pin(b'A', 10, BRIDGE_0),
    pin(b'B', 13, BRIDGE_0),
    pin(b'B', 14, BRIDGE_0),
    pin(b'B', 15, BRIDGE_0),
    pin(b'C', 6, BRIDGE_1),
    pin(b'C', 7, BRIDGE_1),
    pin(b'C', 8, BRIDGE_1),
    pin(b'A', 7, BRIDGE_1),
    pin(b'B', 0, BRIDGE_1),
    pin(b'B', 1, BRIDGE_1),
    pin(b'B', 10, CHOPPER),
    pin(b'B', 11, CHOPPER),
];

/// Address of a port's first register.
#[must_use]
pub const fn port(letter: u8) -> u32 {
    0x4002_0000 + 0x400 * (letter as u32 - b'A' as u32)
}

/// Offset of the input register.
pub const IDR: u32 = 0x10;
/// Offset of the register that sets (low half) and clears (high half) outputs.
pub const BSRR: u32 = 0x18;

impl Pin {
    /// What makes the pin so: level, pull, slowest edges, function, and the mode last.
    #[must_use]
    pub const fn writes(&self) -> [Write; 5] {
        let Self { port: letter, number, mode } = *self;
        let base = port(letter);
        let (level, pull, function, bits) = match mode {
            Mode::Analog => (0, Pull::None, 0, 0b11),
            Mode::Input(pull) => (0, pull, 0, 0b00),
            Mode::Output(high) => (1 << if high { number } else { number + 16 }, Pull::None, 0, 0b01),
            Mode::Alternate(function, pull) => (0, pull, function, 0b10),
        };
        let (two, four) = (2 * number, 4 * (number % 8));
        [
            Write::whole("GPIO_BSRR", base + BSRR, level),
            Write::bits("GPIO_PUPDR", base + 0x0C, 0b11 << two, (pull as u32) << two),
            Write::bits("GPIO_OSPEEDR", base + 0x08, 0b11 << two, 0),
            Write::bits("GPIO_AFR", base + 0x20 + 4 * (number / 8), 0xF << four, function << four),
            Write::bits("GPIO_MODER", base, 0b11 << two, bits << two),
        ]
    }
}
