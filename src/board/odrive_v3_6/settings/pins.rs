//! Function of every used pin.
//!
//! Source: `Board/v3/Inc/main.h:77-156`, `board.cpp:35-254`; registers RM0090 8.4.
//!
//! Pins of the bus: [`super::can`]; of absolute encoders: [`super::absolute_encoders`]. Unused and left in
//! their reset state: GPIO1 and GPIO2 (PA0, PA1) without thermistors in the motors, USB (PA11, PA12), GPIO6
//! (PB2) without a holding brake, and GPIO7 and GPIO8 (PA15, PB3) without absolute encoders.

use super::Write;

/// Function of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Analog input of a converter.
    Analog,
    /// Digital input.
    Input(Pull),
    /// Digital output, initially high or low.
    Output(bool),
    /// Alternate function, by number; the pull acts on inputs, and on outputs until the
    /// peripheral drives them.
    Alternate(u32, Pull),
}

/// Pull resistor of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Pull {
    /// No pull.
    None,
    /// Pull to the supply.
    Up,
    /// Pull to ground.
    Down,
}

/// Port, number and function of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Port `A` to `D`.
    pub port: u8,
    /// Number, 0..=15.
    pub number: u32,
    /// Function.
    pub mode: Mode,
}

pub(super) const fn pin(port: u8, number: u32, mode: Mode) -> Pin {
    Pin { port, number, mode }
}

/// Pulled low until the timer drives it: outputs off.
const BRIDGE_0: Mode = Mode::Alternate(1, Pull::Down);
const BRIDGE_1: Mode = Mode::Alternate(3, Pull::Down);
const CHOPPER: Mode = Mode::Alternate(1, Pull::Down);
const ENCODER: Mode = Mode::Alternate(2, Pull::None);
/// An open contact or a broken wire reads low.
const CONTACT: Mode = Mode::Input(Pull::Down);

/// Gate drivers off and deselected; these pins are set first.
pub const GATES_OFF: [Pin; 3] = [
    pin(b'B', 12, Mode::Output(false)),
    pin(b'C', 13, Mode::Output(true)),
    pin(b'C', 14, Mode::Output(true)),
];

/// All other pins; bridges and chopper last, when their timers hold them low.
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
    // Common fault line of both gate drivers, active low.
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

/// Driver of the holding brake on GPIO6, initially low: engaged. Only written where there is a brake.
pub const HOLDING_BRAKE: Pin = pin(b'B', 2, Mode::Output(false));

/// Status light on GPIO6, initially dark. Only written in an image with one, which has no holding brake.
pub const STATUS_LIGHT: Pin = HOLDING_BRAKE;

/// Thermistors in the motors, on GPIO1 and GPIO2. Only written where there is one.
pub const MOTOR_THERMISTORS: [Pin; 2] = [pin(b'A', 0, Mode::Analog), pin(b'A', 1, Mode::Analog)];

/// Address of a port's first register.
pub const fn port(letter: u8) -> u32 {
    0x4002_0000 + 0x400 * (letter as u32 - b'A' as u32)
}

/// Offset of the input register.
pub const IDR: u32 = 0x10;
/// Offset of the register that sets (low half) and clears (high half) outputs.
pub const BSRR: u32 = 0x18;

impl Pin {
    /// Writes that configure the pin: level, pull, slowest edges, function, and the mode last.
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
