//! CAN bus: one frame at a time, the lowest identifier first, each for the time of its bits.
//!
//! Why bit by bit: stuffed bits and arbitration decide whether a mapping fits a bus, and how late a target
//! arrives. Limits: no errors on the wire and no clock drift.
//!
//! Source: ISO 11898-1, classic frames with 11-bit identifiers.

use std::collections::VecDeque;

use scarab::bus::Frame;

const NS_PER_S: u64 = 1_000_000_000;
/// Check sum delimiter, acknowledge slot and delimiter, end of frame, intermission: never stuffed.
const TAIL_BITS: u32 = 1 + 2 + 7 + 3;

/// Number of bits of a frame on the wire, with stuffed bits and the following intermission.
pub fn bits(frame: &Frame) -> u32 {
    let mut bits = vec![false];
    let mut push = |value: u32, count: u32| {
        bits.extend((0..count).rev().map(|shift| value >> shift & 1 == 1));
    };
    push(u32::from(frame.id()), 11);
    push(0, 3);
    push(frame.data().len() as u32, 4);
    for byte in frame.data() {
        push(u32::from(*byte), 8);
    }
    // Generator x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
    let sum = bits.iter().fold(0_u32, |sum, bit| {
        let next = sum << 1;
        if *bit == (sum >> 14 & 1 == 1) { next & 0x7FFF } else { (next ^ 0x4599) & 0x7FFF }
    });
    bits.extend((0..15).rev().map(|shift| sum >> shift & 1 == 1));
    let (mut stuffed, mut run, mut last) = (0, 0, true);
    for bit in &bits {
        run = if *bit == last { run + 1 } else { 1 };
        last = *bit;
        if run == 5 {
            // The stuffed bit starts a new run.
            (stuffed, run, last) = (stuffed + 1, 1, !last);
        }
    }
    bits.len() as u32 + stuffed + TAIL_BITS
}

/// Waiting frame, with its earliest start and its mailbox in the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Waiting {
    frame: Frame,
    asked_ns: u64,
    slot: u32,
}

/// Waiting frames of one controller.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mailbox {
    waiting: VecDeque<Waiting>,
    /// Whether frames leave in order of arrival, as from a host's adapter. Otherwise by identifier, as from a
    /// controller.
    in_order: bool,
    /// Mailbox of the frame on the wire.
    leaving: Option<u32>,
    /// Whether the controller is bus-off; then nothing is sent.
    pub is_off: bool,
}

impl Mailbox {
    /// Creates the queue of a host's adapter.
    pub fn in_order() -> Self {
        Self { in_order: true, ..Self::default() }
    }

    /// Adds a frame to be sent from this instant on.
    pub fn push(&mut self, frame: Frame, now_ns: u64) {
        self.put(0, frame, now_ns);
    }

    /// Adds a frame to one of the controller's mailboxes, to be sent from this instant on.
    pub fn put(&mut self, slot: u32, frame: Frame, asked_ns: u64) {
        self.waiting.push_back(Waiting { frame, asked_ns, slot });
    }

    /// Occupied mailboxes of the controller, one bit each. A frame on the wire still occupies its own.
    pub fn slots(&self) -> u32 {
        let slots = self.waiting.iter().map(|waiting| waiting.slot).chain(self.leaving);
        slots.fold(0, |bits, slot| bits | 1 << slot)
    }

    /// Number of waiting frames.
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether no frame waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Removes the waiting frames; a frame on the wire is still sent.
    pub fn clear(&mut self) {
        self.waiting.clear();
    }

    /// Earliest instant at which a frame may be sent.
    fn earliest_ns(&self) -> Option<u64> {
        self.waiting.iter().map(|waiting| waiting.asked_ns).min().filter(|_| !self.is_off)
    }

    /// Index of the frame that takes part in the arbitration at an instant.
    fn first(&self, now_ns: u64) -> Option<usize> {
        let entries = self.waiting.iter().enumerate().filter(|_| !self.is_off);
        let mut ready = entries.filter(|(index, waiting)| {
            // In an adapter's queue only the first frame can be ready.
            waiting.asked_ns <= now_ns && (*index == 0 || !self.in_order)
        });
        let first =
            if self.in_order { ready.next() } else { ready.min_by_key(|(_, waiting)| waiting.frame.id()) };
        first.map(|(index, _)| index)
    }
}

/// A transmitted frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Content of the frame.
    pub frame: Frame,
    /// Index of the sender's mailbox.
    pub sender: usize,
    /// Earliest instant at which the frame could be sent.
    pub(crate) asked_ns: u64,
    /// End of its last bit.
    pub end_ns: u64,
}

/// The bus and the frame on it.
#[derive(Clone, Debug)]
pub struct Wire {
    bit_ns: u64,
    /// End of the last frame.
    free_ns: u64,
    moving: Option<Sent>,
    busy_ns: u64,
}

impl Wire {
    /// Creates an idle bus with this bit rate.
    pub fn new(bits_per_s: u64) -> Self {
        Self { bit_ns: NS_PER_S / bits_per_s, free_ns: 0, moving: None, busy_ns: 0 }
    }

    /// Returns the next frame that ends at or before this instant; call until `None`. Frames added between
    /// two calls take part from then on.
    pub fn advance(&mut self, until_ns: u64, mailboxes: &mut [&mut Mailbox]) -> Option<Sent> {
        if self.moving.is_none() {
            self.moving = self.arbitrate(until_ns, mailboxes);
        }
        let sent = self.moving.take_if(|sent| sent.end_ns <= until_ns)?;
        self.free_ns = sent.end_ns;
        if let Some(mailbox) = mailboxes.get_mut(sent.sender) {
            mailbox.leaving = None;
        }
        Some(sent)
    }

    fn arbitrate(&mut self, until_ns: u64, mailboxes: &mut [&mut Mailbox]) -> Option<Sent> {
        // Earliest instant at which any controller may start.
        let earliest = mailboxes.iter().filter_map(|mailbox| mailbox.earliest_ns()).min()?.max(self.free_ns);
        if earliest >= until_ns {
            return None;
        }
        let ready = mailboxes.iter().enumerate();
        let ready = ready.filter_map(|(sender, mailbox)| Some((sender, mailbox.first(earliest)?)));
        let (sender, index) =
            ready.min_by_key(|(sender, index)| mailboxes[*sender].waiting[*index].frame.id())?;
        let Waiting { frame, asked_ns, slot } = mailboxes[sender].waiting.remove(index)?;
        mailboxes[sender].leaving = Some(slot);
        let length = u64::from(bits(&frame)) * self.bit_ns;
        self.busy_ns += length;
        Some(Sent { frame, sender, asked_ns, end_ns: earliest + length })
    }

    /// Total time for which the bus was in use.
    pub fn busy_ns(&self) -> u64 {
        self.busy_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bit_count_is_within_the_bounds_of_stuffing() {
        // 0x000 with eight zero bytes has many stuffed bits; 0x555 with alternating bits only in length and
        // check sum.
        for frame in [
            Frame::new(0, &[0; 8]),
            Frame::new(0x555, &[0x55; 8]),
            Frame::new(0x7FF, &[]),
            Frame::new(0x80, &[]),
        ] {
            let [least, most] = frame.bits();
            assert!((least..=most).contains(&bits(&frame)), "{frame:?} {}", bits(&frame));
        }
        assert!(bits(&Frame::new(0, &[0; 8])) > bits(&Frame::new(0x555, &[0x55; 8])) + 10);
    }

    #[test]
    fn the_lowest_identifier_wins_and_no_frame_is_interrupted() {
        let (mut node, mut host) = (Mailbox::default(), Mailbox::in_order());
        for id in [0x381, 0x181, 0x281] {
            node.push(Frame::new(id, &[1, 2]), 0);
        }
        host.push(Frame::new(0x601, &[0; 8]), 0);
        host.push(Frame::new(0x080, &[]), 0);
        let mut wire = Wire::new(1_000_000);
        let mut sent = Vec::new();
        while let Some(frame) = wire.advance(2_000_000, &mut [&mut node, &mut host]) {
            sent.push(frame.frame.id());
        }
        // The adapter's SYNC waits behind its own SDO.
        assert_eq!(sent, [0x181, 0x281, 0x381, 0x601, 0x080]);
        assert!(wire.busy_ns() > 5 * 47_000 && wire.busy_ns() < 5 * 135_000);
    }

    #[test]
    fn a_later_frame_does_not_delay_an_earlier_one() {
        let mut node = Mailbox::default();
        node.push(Frame::new(0x82, &[]), 1000);
        node.push(Frame::new(0x81, &[]), 5000);
        let mut wire = Wire::new(1_000_000);
        let sent = core::iter::from_fn(|| wire.advance(2_000_000, &mut [&mut node]));
        assert_eq!(sent.map(|sent| sent.frame.id()).collect::<Vec<_>>(), [0x82, 0x81]);
    }

    #[test]
    fn a_frame_takes_the_time_of_its_bits() {
        let mut host = Mailbox::in_order();
        let frame = Frame::new(0x80, &[]);
        host.push(frame, 10_000);
        let mut wire = Wire::new(1_000_000);
        let end = 10_000 + u64::from(bits(&frame)) * 1000;
        assert_eq!(wire.advance(end - 1, &mut [&mut host]), None);
        assert_eq!(wire.advance(end, &mut [&mut host]).map(|sent| sent.end_ns), Some(end));
    }
}
