//! CAN1, by its registers: nothing here waits for the bus.
//!
//! Why not the driver of `embassy-stm32`: it tells neither bus-off nor passive and has no way to give queued frames up; a frame with a
//! length above 8 panics where its bytes are read; its handlers run in critical sections; and bit rate and filters would not be in the
//! record of writes that a test holds against the board's facts.
//!
//! | level | vector | what |
//! | --- | --- | --- |
//! | 4 | CAN1_RX0 | frames out of the controller's queue of three into one of thirty-two |
//! | 5 | CAN1_TX | a mailbox is empty; also pended by the former and by the servo: `task::bus` |
//!
//! Three frames of the shortest kind take 141 us at 1 Mbit/s; a reset that recalls full records keeps level 5 busy for 1.8 ms. So the
//! queue is emptied above it.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::interrupt::{CAN1_TX, InterruptExt};

use super::registers::{apply, load, store};
use super::settings::can::{
    BEGIN, CLOCK, EDGES, ERRORS, MAILBOX, MSR, PINS, RECEIVED, RF0R, SET_UP, TAKE_PART, TSR, set_up,
};
use crate::bus::{Controller, Frame};

/// Longest wait for the controller to be set up: it ends what it receives, at most a frame of the slowest bus, 1.1 ms.
const PATIENCE: u32 = 100_000;

/// Transmit requests that were answered (RQCP), the first bit of the mailboxes that are empty (TME), and what gives a mailbox up (ABRQ).
const ANSWERED: u32 = 1 | 1 << 8 | 1 << 16;
const EMPTY: u32 = 26;
const GIVE_UP: u32 = 1 << 7 | 1 << 15 | 1 << 23;
/// Of the receiving queue: frames in it, one was lost, let the oldest go.
const PENDING: u32 = 0b11;
const OVERRUN: u32 = 1 << 4;
const RELEASE: u32 = 1 << 5;

static LOST: AtomicBool = AtomicBool::new(false);
static TAKES_PART: AtomicBool = AtomicBool::new(false);

/// Takes part in the bus from now on; the vectors are still masked. Whether the controller answered.
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

/// The oldest frame received, if there is one.
pub fn receive() -> Option<Frame> {
    let queue = load(RF0R);
    if queue & OVERRUN != 0 {
        LOST.store(true, Ordering::Relaxed);
        store(RF0R, OVERRUN);
    }
    // One that is still being let go is looked for again: the interrupt stays raised.
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

/// Mailboxes in which a frame waits to be sent, a bit each.
pub fn waiting() -> u32 {
    !(load(TSR) >> EMPTY) & 0b111
}

/// Gives a frame into an empty mailbox.
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
    // The lowest bit asks for it to be sent.
    store(mailbox, u32::from(frame.id()) << 21 | 1);
}

/// What waits in the mailboxes is not sent any more: what a bus that was off for seconds would be told first is old.
pub fn give_up() {
    store(TSR, GIVE_UP);
}

/// How the controller does; an overrun is told once. One that did not answer at the start is off the bus.
pub fn status() -> Controller {
    if !TAKES_PART.load(Ordering::Relaxed) {
        return Controller::Off;
    }
    let [off, passive] = ERRORS;
    match load(super::settings::can::ESR) {
        errors if errors & off != 0 => Controller::Off,
        // Before a state that lasts: it would hide what was lost in it.
        _ if LOST.swap(false, Ordering::Relaxed) => Controller::Overrun,
        errors if errors & passive != 0 => Controller::Passive,
        _ => Controller::Active,
    }
}

/// A frame that was received found no room further on.
pub fn lose() {
    LOST.store(true, Ordering::Relaxed);
}

/// The reason for which the vector of level 5 was raised is seen.
pub(super) fn acknowledge() {
    store(TSR, ANSWERED);
}

/// Level 5 runs as soon as nothing above does.
#[inline(always)]
pub fn pend() {
    CAN1_TX.pend();
}
