//! CAN1 driver on registers: nothing here waits for the bus.
//!
//! Why not the driver of `embassy-stm32`:
//!
//! - Neither bus-off nor error-passive is reported, and queued frames cannot be aborted.
//! - A frame with a length above 8 panics where its bytes are read.
//! - Its handlers run in critical sections.
//! - Bit rate and filters would not be in the record of writes that a test compares with the board's facts.
//!
//! | level | vector | task |
//! | --- | --- | --- |
//! | 4 | CAN1_RX0 | moves frames from the controller's queue of three into one of thirty-two |
//! | 5 | CAN1_TX | a mailbox is empty; also pended by CAN1_RX0 and by the servo: `task::bus` |
//!
//! Three frames of the shortest kind take 141 us at 1 Mbit/s; a reset that recalls full records keeps level 5
//! busy for 1.8 ms. So the queue is emptied at a level above.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::interrupt::{CAN1_TX, InterruptExt};

use super::registers::{apply, load, store};
use super::settings::can::{
    BEGIN, CLOCK, EDGES, ERRORS, MAILBOX, MSR, PINS, RECEIVED, RF0R, SET_UP, TAKE_PART, TSR, set_up,
};
use crate::hal::{Controller, Frame};

/// Longest wait for initialisation mode: the controller completes a reception first, at most a frame of the
/// slowest bus, 1.1 ms.
const PATIENCE: u32 = 100_000;

/// Completed transmit requests (RQCP), position of the empty-mailbox bits (TME), and abort requests (ABRQ).
const ANSWERED: u32 = 1 | 1 << 8 | 1 << 16;
const EMPTY: u32 = 26;
const GIVE_UP: u32 = 1 << 7 | 1 << 15 | 1 << 23;
/// Receive queue: number of frames, overrun, release of the oldest frame.
const PENDING: u32 = 0b11;
const OVERRUN: u32 = 1 << 4;
const RELEASE: u32 = 1 << 5;

static LOST: AtomicBool = AtomicBool::new(false);
static TAKES_PART: AtomicBool = AtomicBool::new(false);

/// Starts the controller; the vectors are still masked. Returns whether the controller answered.
pub fn start(kbit: u16) -> bool {
    apply(&CLOCK);
    for pin in &PINS {
        apply(&pin.writes());
    }
    apply(&EDGES);
    apply(&BEGIN);
    let answers = (0..PATIENCE).any(|_| load(MSR) & SET_UP != 0);
    if answers {
        apply(&set_up(kbit));
        apply(&TAKE_PART);
    }
    TAKES_PART.store(answers, Ordering::Relaxed);
    answers
}

/// Takes the oldest received frame, if any.
pub fn receive() -> Option<Frame> {
    let queue = load(RF0R);
    if queue & OVERRUN != 0 {
        LOST.store(true, Ordering::Relaxed);
        store(RF0R, OVERRUN);
    }
    // While a release is in progress the queue is read again later: the interrupt stays raised.
    if queue & PENDING == 0 || queue & RELEASE != 0 {
        return None;
    }
    let [identifier, length, low, high] = [0, 4, 8, 12].map(|offset| load(RECEIVED + offset));
    store(RF0R, RELEASE);
    let ([a, b, c, d], [e, f, g, h]) = (low.to_le_bytes(), high.to_le_bytes());
    let data = [a, b, c, d, e, f, g, h];
    // Lengths of 9 to 15 are 8 bytes (ISO 11898-1).
    let length = (length & 0xF).min(8) as usize;
    Some(Frame::new((identifier >> 21) as u16, data.get(..length).unwrap_or(&data)))
}

/// Mailboxes with a frame that waits for transmission, one bit each.
pub fn waiting() -> u32 {
    !(load(TSR) >> EMPTY) & 0b111
}

/// Puts a frame into an empty mailbox.
pub fn send(mailbox: u32, frame: &Frame) {
    let mailbox = MAILBOX + 0x10 * mailbox;
    let mut bytes = [0; 8];
    for (to, from) in bytes.iter_mut().zip(frame.data()) {
        *to = *from;
    }
    let [a, b, c, d, e, f, g, h] = bytes;
    store(mailbox + 4, frame.data().len() as u32);
    store(mailbox + 8, u32::from_le_bytes([a, b, c, d]));
    store(mailbox + 12, u32::from_le_bytes([e, f, g, h]));
    // Bit 0 requests transmission (TXRQ).
    store(mailbox, u32::from(frame.id()) << 21 | 1);
}

/// Aborts all waiting frames. After seconds of bus-off they are out of date.
pub fn give_up() {
    store(TSR, GIVE_UP);
}

/// State of the controller; an overrun is reported once. A controller that did not answer at the
/// start is off.
pub fn status() -> Controller {
    if !TAKES_PART.load(Ordering::Relaxed) {
        return Controller::Off;
    }
    let [off, passive] = ERRORS;
    match load(super::settings::can::ESR) {
        errors if errors & off != 0 => Controller::Off,
        // Reported before a lasting state, which would hide the overrun.
        _ if LOST.swap(false, Ordering::Relaxed) => Controller::Overrun,
        errors if errors & passive != 0 => Controller::Passive,
        _ => Controller::Active,
    }
}

/// Records the loss of a received frame for want of space in the next queue.
pub fn lose() {
    LOST.store(true, Ordering::Relaxed);
}

/// Clears the cause of the level-5 interrupt.
pub fn acknowledge() {
    store(TSR, ANSWERED);
}

/// Requests a run of level 5.
#[inline(always)]
pub fn pend() {
    CAN1_TX.pend();
}
