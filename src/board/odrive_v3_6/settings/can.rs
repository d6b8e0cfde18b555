//! CAN1 controller: bit rates, filters, interrupts, pins.
//!
//! ```text
//! bit = 21 quanta of prescaler / 42 MHz: 1 synchronisation, 16 before sampling (81 %), 4 after, jump width 4
//! prescaler = 2,000,000 / bit rate: 2, 4, 8, 16 for 1000, 500, 250, 125 kbit/s, all without a remainder
//! ```
//!
//! Frames are sent in the order of their submission, not of their identifiers. Otherwise frames of one
//! identifier, as the segments of a block, would overtake each other (of two equal ones the lower mailbox
//! goes first). A controller in bus-off recovers by itself after 128 times eleven recessive bits; recovery
//! enables nothing.
//!
//! Source: `Board/v3/Src/can.c:62-66, 111-119`, `communication/can/odrive_can.cpp:76-80`;
//! registers RM0090 32.9.

use super::Write;
use super::pins::{Mode, Pin, Pull, port};

/// First register of CAN1.
pub const CAN: u32 = 0x4000_6400;
/// Master control register.
pub const MCR: u32 = CAN;
/// Master status register.
pub const MSR: u32 = CAN + 0x04;
/// Transmit status register.
pub const TSR: u32 = CAN + 0x08;
/// Receive queue of three frames.
pub const RF0R: u32 = CAN + 0x0C;
/// Error counters and status.
pub const ESR: u32 = CAN + 0x18;
const IER: u32 = CAN + 0x14;
const BTR: u32 = CAN + 0x1C;
/// First of three transmit mailboxes, 16 bytes each: identifier, length, data.
pub const MAILBOX: u32 = CAN + 0x180;
/// Oldest received frame, with the same layout.
pub const RECEIVED: u32 = CAN + 0x1B0;
const FILTERS: u32 = CAN + 0x200;

/// Request for initialisation mode (INRQ), and its acknowledgement (INAK).
pub const SET_UP: u32 = 1;
/// Bus-off (BOFF) and error-passive (EPVF) flags.
pub const ERRORS: [u32; 2] = [1 << 2, 1 << 1];

/// Clock of the controller, Hz: APB1.
pub const CLOCK_HZ: u32 = 42_000_000;
const QUANTA: u32 = 1 + BEFORE + AFTER;
const BEFORE: u32 = 16;
const AFTER: u32 = 4;
const JUMP: u32 = 4;

/// Default bit rate, kbit/s.
pub const USUAL_KBIT: u16 = 1000;

/// Clock enable of the controller (RCC_APB1ENR CAN1EN).
pub const CLOCK: [Write; 1] = [Write::bits("RCC_APB1ENR", 0x4002_3840, 1 << 25, 1 << 25)];

/// Receive and transmit pins, pulled to the recessive level.
pub const PINS: [Pin; 2] = [
    Pin { port: b'B', number: 8, mode: Mode::Alternate(9, Pull::Up) },
    Pin { port: b'B', number: 9, mode: Mode::Alternate(9, Pull::Up) },
];

/// Slew rate of the transmit pin: edges of 10 ns (medium speed) instead of 100. Otherwise a tenth of a bit
/// would be lost twice per round trip.
pub const EDGES: [Write; 1] = [Write::bits("GPIO_OSPEEDR", port(b'B') + 0x08, 0b11 << 18, 0b01 << 18)];

/// Wakes up and requests initialisation mode. Runs on under a debugger (DBF 0), recovers from bus-off (ABOM),
/// sends mailboxes in order (TXFP). Repeats unacknowledged frames (NART 0), and drops the newest frame at an
/// overrun (RFLM).
pub const BEGIN: [Write; 1] = [Write::whole("CAN_MCR", MCR, 1 << 6 | 1 << 3 | 1 << 2 | SET_UP)];

/// Sets bit rate, one filter and interrupts. The controller takes part once the bus was silent for eleven
/// bits. An unsupported rate is replaced by the default.
pub const fn set_up(kbit: u16) -> [Write; 10] {
    let kbit = if matches!(kbit, 125 | 250 | 500 | 1000) { kbit } else { USUAL_KBIT };
    let prescaler = CLOCK_HZ / QUANTA / (kbit as u32 * 1000);
    let timing = (JUMP - 1) << 24 | (AFTER - 1) << 20 | (BEFORE - 1) << 16 | (prescaler - 1);
    [
        Write::whole("CAN_BTR", BTR, timing),
        // Filter: every 11-bit identifier, no extended or remote frames (IDE, RTR must be 0); one 32-bit
        // mask, first queue.
        Write::bits("CAN_FMR", FILTERS, 1, 1),
        Write::bits("CAN_FM1R", FILTERS + 0x04, 1, 0),
        Write::bits("CAN_FS1R", FILTERS + 0x0C, 1, 1),
        Write::bits("CAN_FFA1R", FILTERS + 0x14, 1, 0),
        Write::whole("CAN_F0R1", FILTERS + 0x40, 0),
        Write::whole("CAN_F0R2", FILTERS + 0x44, 1 << 2 | 1 << 1),
        Write::bits("CAN_FA1R", FILTERS + 0x1C, 1, 1),
        // Interrupts: frame received (FMPIE0), mailbox empty (TMEIE).
        Write::whole("CAN_IER", IER, 1 << 1 | 1),
        Write::bits("CAN_FMR", FILTERS, 1, 0),
    ]
}

/// Leaves initialisation mode; the last step.
pub const TAKE_PART: [Write; 1] = [Write::bits("CAN_MCR", MCR, SET_UP, 0)];
