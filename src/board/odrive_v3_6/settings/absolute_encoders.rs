//! Select lines and frames of AS5047P encoders on the gate drivers' SPI (SCK PC10, MISO PC11, MOSI PC12).
//!
//! | encoders of an axis | select of the rotor's | select of the joint's |
//! | --- | --- | --- |
//! | at the rotor | GPIO7 (M0), GPIO8 (M1) | - |
//! | at the joint, rotor with index | - | GPIO7 (M0), GPIO8 (M1) |
//! | at both | GPIO7 (M0), GPIO8 (M1) | Z input: PC9 (M0), PC15 (M1) |
//!
//! Each axis has its own row. GPIO7 and GPIO8 are JTAG's TDI and TDO; a debug probe on SWD does not use them.
//!
//! Source: ams AS5047P data sheet; second edge, 16 bits and at most 10 MHz, as for the DRV8301. Pins:
//! `Board/v3/Inc/main.h:77-156`.

use super::Write;
use super::external::{INDEX_LINES, masked};
use super::pins::{Mode, Pin, pin};
use crate::hal::AbsoluteEncoderSide;
use crate::leg::AbsoluteEncoders;

/// Command to read the angle (register 0x3FFF, bit 14 read, bit 15 even parity); the answer comes with the
/// next frame.
pub const READ_ANGLE: u16 = 0xFFFF;
/// Command to read the error register (0x0001), which clears it.
pub const READ_ERRORS: u16 = 0x4001;
/// Bit of an answer after a command with an error.
pub const ERROR: u16 = 1 << 14;

/// Select lines on GPIO7 and GPIO8.
const FIRST: [Pin; 2] = [pin(b'A', 15, Mode::Output(true)), pin(b'B', 3, Mode::Output(true))];
/// Select lines on the index inputs.
const SECOND: [Pin; 2] =
    [pin(b'C', INDEX_LINES[0], Mode::Output(true)), pin(b'C', INDEX_LINES[1], Mode::Output(true))];

/// Select line of an encoder, low while it is selected; `None` without that encoder.
pub fn select(axis: usize, side: AbsoluteEncoderSide, encoders: AbsoluteEncoders) -> Option<Pin> {
    let lines = match side {
        AbsoluteEncoderSide::Rotor if encoders.rotor => &FIRST,
        AbsoluteEncoderSide::Joint if encoders.joint.is_none() => return None,
        AbsoluteEncoderSide::Joint if encoders.rotor => &SECOND,
        AbsoluteEncoderSide::Joint => &FIRST,
        AbsoluteEncoderSide::Rotor => return None,
    };
    lines.get(axis).copied()
}

/// Masks the interrupt of an axis' index where the encoder at its rotor has none.
pub fn mask_index(axis: usize, encoders: AbsoluteEncoders, mut write: impl FnMut(&[Write])) {
    if encoders.rotor
        && let Some(line) = INDEX_LINES.get(axis)
    {
        write(&[masked(*line)]);
    }
}

/// Deselects an axis' encoders. Before the first transfer: an encoder whose line floats answers as well.
pub fn deselect(axis: usize, encoders: AbsoluteEncoders, mut write: impl FnMut(&[Write])) {
    for pin in [AbsoluteEncoderSide::Rotor, AbsoluteEncoderSide::Joint]
        .into_iter()
        .filter_map(|side| select(axis, side, encoders))
    {
        write(&pin.writes());
    }
}
