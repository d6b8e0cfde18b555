//! CAN1 (RM0090 32) on a wire with one partner: modes, mailboxes, filters, queues, errors.
//!
//! One frame at a time is on the wire, for the time of its bits; of the waiting ones the lowest identifier
//! goes first. A partner acknowledges frames while it is connected and has the same bit rate. Without one a
//! frame is repeated, and the transmit error counter stops at error passive. Refused: timing outside
//! initialisation, filters outside their own initialisation, a request in a mailbox that is not empty. Known
//! limits: data frames with 11-bit identifiers; no time stamps, no silent or loop-back mode.

use std::collections::VecDeque;

use scarab::bus::Frame;
use scarab_client::wire;

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};
use crate::time::{NEVER, TICK_HZ, Ticks};

const INRQ: u32 = 1;
const SLEEP: u32 = 2;
const TXFP: u32 = 1 << 2;
const RFLM: u32 = 1 << 3;
const NART: u32 = 1 << 4;
const ABOM: u32 = 1 << 6;
/// Depth of a receive queue.
const DEPTH: usize = 3;
const BANKS: usize = 28;
/// Bit rate of the partner, bit/s.
const PARTNER_RATE: u64 = 1_000_000;

/// A transmit mailbox.
#[derive(Clone, Copy, Debug, Default)]
struct Mailbox {
    registers: [u32; 4],
    /// Position in the order of requests; `None` if empty.
    order: Option<u64>,
    abort: bool,
}

impl Mailbox {
    /// Completes or withdraws the request, whose bit (TXRQ) falls.
    fn empty(&mut self) {
        (self.order, self.abort) = (None, false);
        self.registers[0] &= !1;
    }

    fn frame(&self) -> Frame {
        let [identifier, length, low, high] = self.registers;
        let mut bytes = [0; 8];
        bytes[..4].copy_from_slice(&low.to_le_bytes());
        bytes[4..].copy_from_slice(&high.to_le_bytes());
        Frame::new((identifier >> 21) as u16, &bytes[..(length as usize & 0xF).min(8)])
    }
}

/// A receive queue.
#[derive(Clone, Debug, Default)]
struct Fifo {
    frames: VecDeque<Frame>,
    full: bool,
    overrun: bool,
}

/// Sender of the frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sender {
    Mailbox(usize),
    Partner,
}

/// State of the controller and the wire.
#[derive(Clone, Debug, Default)]
pub struct Can {
    mcr: u32,
    ier: u32,
    btr: u32,
    tsr: u32,
    /// Error counters of transmission and reception, last error code.
    errors: [u32; 2],
    last_error: u32,
    /// An error was detected whose interrupt is enabled (ERRI).
    error: bool,
    bus_off: bool,
    initialising: bool,
    asleep: bool,
    /// Instant at which a change of mode, or the recovery from bus-off, ends.
    joins: Ticks,
    recovers: Ticks,
    mailboxes: [Mailbox; 3],
    orders: u64,
    fifos: [Fifo; 2],
    filter_init: bool,
    filter_mode: u32,
    filter_scale: u32,
    filter_queue: u32,
    filter_active: u32,
    filters: Vec<[u32; 2]>,
    on_wire: Option<(Sender, Frame, Ticks)>,
    /// Clock of the controller's bus, Hz.
    pub bus_hz: u64,
    /// Frames that the partner sends, in order.
    pub partner: VecDeque<Frame>,
    /// Frames that the controller sent, with the instant of their end.
    pub sent: Vec<(Ticks, Frame)>,
    /// Whether a partner acknowledges frames.
    pub connected: bool,
    /// Ends of the partner's frames on the wire, if they are to be recorded.
    pub heard: Option<Vec<(Ticks, Frame)>>,
}

impl Can {
    /// A controller after power-on, with a partner of 1 Mbit/s.
    pub fn new() -> Self {
        Self {
            mcr: 0x1_0002,
            btr: 0x0123_0000,
            asleep: true,
            joins: NEVER,
            recovers: NEVER,
            filter_init: true,
            filters: vec![[0; 2]; BANKS],
            bus_hz: 16_000_000,
            connected: true,
            ..Self::default()
        }
    }

    /// Resets the controller; the partner stays.
    pub fn reset(&mut self) {
        let (partner, sent) = (std::mem::take(&mut self.partner), std::mem::take(&mut self.sent));
        let (connected, bus_hz, heard) = (self.connected, self.bus_hz, self.heard.take());
        *self = Self { partner, sent, connected, bus_hz, heard, ..Self::new() };
    }

    /// Bit rate, bit/s.
    pub fn rate(&self) -> u64 {
        let quanta = 3 + (self.btr >> 16 & 0xF) + (self.btr >> 20 & 7);
        self.bus_hz / (u64::from((self.btr & 0x3FF) + 1) * u64::from(quanta))
    }

    fn bit(&self) -> Ticks {
        TICK_HZ / self.rate().max(1)
    }

    /// Whether the partner's bit rate is within half a percent.
    fn fits(&self) -> bool {
        self.connected && self.rate().abs_diff(PARTNER_RATE) * 200 <= PARTNER_RATE
    }

    fn takes_part(&self) -> bool {
        self.mcr & (INRQ | SLEEP) == 0 && !(self.initialising || self.asleep || self.bus_off)
    }

    /// Makes the controller bus-off, as errors on the wire do.
    pub fn go_bus_off(&mut self, now: Ticks) {
        let before = self.status();
        (self.bus_off, self.errors, self.on_wire) = (true, [0, 0], None);
        if self.mcr & ABOM != 0 {
            self.recovers = now + 128 * 11 * self.bit();
        }
        self.detect(before);
    }

    /// Raises the error interrupt's flag after a detected error (RM0090 32.9.2, ERRI); `before` is the error
    /// status before it.
    fn detect(&mut self, before: u32) {
        let risen = self.status() & !before & 7;
        self.error |= risen & self.ier >> 8 != 0 || self.last_error != 0 && self.ier >> 11 & 1 == 1;
    }

    /// Puts the next frame on the wire if it is idle.
    pub fn start(&mut self, now: Ticks) {
        if self.on_wire.is_some() || !self.takes_part() {
            return;
        }
        let waiting = (0..3).filter(|index| self.mailboxes[*index].order.is_some());
        let own = waiting
            .map(|index| self.turn(index))
            .min()
            .map(|(_, index)| (self.mailboxes[index].frame(), Sender::Mailbox(index)));
        let partner = self.partner.front().filter(|_| self.fits()).map(|frame| (*frame, Sender::Partner));
        let first = match (own, partner) {
            (Some(own), Some(partner)) if partner.0.id() < own.0.id() => Some(partner),
            (own, partner) => own.or(partner),
        };
        if let Some((frame, sender)) = first {
            let end = now + u64::from(wire::bits(&frame)) * self.bit();
            self.on_wire = Some((sender, frame, end));
        }
    }

    /// Instant of the next event.
    pub fn due(&self) -> Ticks {
        self.on_wire.as_ref().map_or(NEVER, |(.., end)| *end).min(self.joins).min(self.recovers)
    }

    /// Processes the event that is due.
    pub fn pass(&mut self, now: Ticks) {
        if now >= self.joins {
            (self.joins, self.initialising) = (NEVER, self.mcr & INRQ != 0);
            self.asleep = self.mcr & SLEEP != 0;
        }
        if now >= self.recovers {
            (self.recovers, self.bus_off) = (NEVER, false);
        }
        if let Some((sender, frame, end)) = self.on_wire
            && now >= end
        {
            self.on_wire = None;
            match sender {
                Sender::Mailbox(index) => self.finish(index, frame, now),
                Sender::Partner => {
                    self.partner.pop_front();
                    if let Some(heard) = &mut self.heard {
                        heard.push((end, frame));
                    }
                    self.receive(frame);
                }
            }
        }
        self.start(now);
    }

    /// Ends the transmission of a mailbox.
    fn finish(&mut self, index: usize, frame: Frame, now: Ticks) {
        let before = self.status();
        let acknowledged = self.fits();
        let mailbox = &mut self.mailboxes[index];
        if acknowledged {
            self.errors[0] = self.errors[0].saturating_sub(1);
            self.tsr |= 3 << (8 * index);
            mailbox.empty();
            self.last_error = 0;
            self.sent.push((now, frame));
            return;
        }
        // Acknowledge error: the counter stops at error passive.
        self.last_error = 3;
        if self.errors[0] < 128 {
            self.errors[0] += 8;
        }
        self.tsr |= 8 << (8 * index);
        if mailbox.abort || self.mcr & NART != 0 {
            mailbox.empty();
            self.tsr = self.tsr & !(3 << (8 * index)) | 1 << (8 * index);
        }
        self.detect(before);
    }

    fn receive(&mut self, frame: Frame) {
        let Some(queue) = self.queue_of(&frame) else { return };
        let locked = self.mcr & RFLM != 0;
        let fifo = &mut self.fifos[queue];
        if fifo.frames.len() == DEPTH {
            fifo.overrun = true;
            if locked {
                return;
            }
            fifo.frames.pop_back();
        }
        fifo.frames.push_back(frame);
        fifo.full |= fifo.frames.len() == DEPTH;
    }

    /// Receive queue of a frame, if a filter accepts it.
    fn queue_of(&self, frame: &Frame) -> Option<usize> {
        let wide = u32::from(frame.id()) << 21;
        let narrow = u32::from(frame.id()) << 5;
        let accepts = |bank: &usize| {
            let [first, second] = self.filters[*bank];
            match (self.filter_mode >> bank & 1 == 1, self.filter_scale >> bank & 1 == 1) {
                (false, true) => (wide ^ first) & second & !1 == 0,
                (true, true) => wide == first & !1 || wide == second & !1,
                (false, false) => {
                    [first, second].iter().any(|pair| (narrow ^ pair & 0xFFFF) & (pair >> 16) == 0)
                }
                (true, false) => {
                    [first, second].iter().any(|pair| narrow == pair & 0xFFFF || narrow == pair >> 16)
                }
            }
        };
        let mut active = (0..BANKS).filter(|bank| self.filter_active >> bank & 1 == 1);
        if self.filter_init {
            None
        } else {
            active.find(accepts).map(|bank| (self.filter_queue >> bank & 1) as usize)
        }
    }

    /// Interrupt requests: transmission, queue 0, queue 1, status.
    pub fn requests(&self) -> [bool; 4] {
        let queue = |index: usize, shift: u32| {
            let fifo = &self.fifos[index];
            let enabled = |bit: u32| self.ier >> (bit + shift) & 1 == 1;
            enabled(1) && !fifo.frames.is_empty() || enabled(2) && fifo.full || enabled(3) && fifo.overrun
        };
        [
            self.ier & 1 != 0 && self.tsr & 0x0001_0101 != 0,
            queue(0, 0),
            queue(1, 3),
            self.error && self.ier >> 15 & 1 == 1,
        ]
    }

    /// Error status register.
    fn status(&self) -> u32 {
        let [transmit, receive] = self.errors;
        let worst = transmit.max(receive);
        u32::from(worst >= 96)
            | u32::from(worst > 127) << 1
            | u32::from(self.bus_off) << 2
            | self.last_error << 4
            | transmit << 16
            | receive << 24
    }

    /// Transmit status register. Its code names an empty mailbox, or the one to be sent last.
    fn transmit_status(&self) -> u32 {
        let empty = |index: &usize| self.mailboxes[*index].order.is_none();
        let code = (0..3).find(empty).or_else(|| (0..3).max_by_key(|index| self.turn(*index))).unwrap_or(0);
        (0..3).fold(self.tsr | (code as u32) << 24, |bits, index| {
            let abort = u32::from(self.mailboxes[index].abort) << (8 * index + 7);
            bits | u32::from(empty(&index)) << (26 + index) | abort
        })
    }

    /// Order in which a mailbox is sent: by request, or by identifier and number.
    fn turn(&self, index: usize) -> (u64, usize) {
        let mailbox = &self.mailboxes[index];
        let identifier = u64::from(mailbox.registers[0] >> 21);
        (if self.mcr & TXFP != 0 { mailbox.order.unwrap_or(0) } else { identifier }, index)
    }

    fn queue_status(&self, queue: usize) -> u32 {
        let fifo = &self.fifos[queue];
        fifo.frames.len() as u32 | u32::from(fifo.full) << 3 | u32::from(fifo.overrun) << 4
    }

    fn received(&self, queue: usize, register: u32) -> u32 {
        let Some(frame) = self.fifos[queue].frames.front() else { return 0 };
        let mut bytes = [0; 8];
        bytes[..frame.data().len()].copy_from_slice(frame.data());
        let word = |from: usize| {
            u32::from_le_bytes([bytes[from], bytes[from + 1], bytes[from + 2], bytes[from + 3]])
        };
        match register {
            0 => u32::from(frame.id()) << 21,
            1 => frame.data().len() as u32,
            2 => word(0),
            _ => word(4),
        }
    }

    pub fn read(&mut self, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            0x00 => self.mcr,
            0x04 => {
                u32::from(self.initialising)
                    | u32::from(self.asleep) << 1
                    | u32::from(self.error) << 2
                    | 0xC00
            }
            0x08 => self.transmit_status(),
            0x0C | 0x10 => self.queue_status((offset as usize - 0xC) / 4),
            0x14 => self.ier,
            0x18 => self.status(),
            0x1C => self.btr,
            0x180..0x1B0 => {
                self.mailboxes[(offset as usize - 0x180) / 16].registers[(offset as usize / 4) % 4]
            }
            0x1B0..0x1D0 => self.received((offset as usize - 0x1B0) / 16, offset / 4 % 4),
            0x200 => u32::from(self.filter_init) | 0x2A1C_0E00,
            0x204 => self.filter_mode,
            0x20C => self.filter_scale,
            0x214 => self.filter_queue,
            0x21C => self.filter_active,
            0x240..0x320 => self.filters[(offset as usize - 0x240) / 8][(offset as usize / 4) % 2],
            _ => access.no_register(format!("CAN1+{offset:#x}")),
        }
    }

    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        match offset {
            0x00 => self.write_control(access.implemented(value, 0x1_80FF, "CAN_MCR"), access),
            0x04 => self.error &= value & 1 << 2 == 0,
            0x08 => self.write_transmit_status(value),
            0x0C | 0x10 => self.write_queue((offset as usize - 0xC) / 4, value),
            0x14 => self.ier = access.implemented(value, 0x0003_8F7F, "CAN_IER"),
            0x18 => self.last_error = value >> 4 & 7,
            0x1C => {
                if !self.initialising {
                    return access.refuse("timing written outside initialisation", "CAN_BTR");
                }
                let value = access.implemented(value, 0xC37F_03FF, "CAN_BTR");
                if value >> 30 != 0 {
                    access.refuse(NOT_MODELLED, "CAN_BTR");
                }
                self.btr = value;
            }
            0x180..0x1B0 => self.write_mailbox(offset, value, access),
            0x200 => self.filter_init = value & 1 == 1,
            0x204 | 0x20C | 0x214 | 0x21C | 0x240..0x320 => self.write_filter(offset, value, access),
            _ => access.refuse(NO_REGISTER, format!("CAN1+{offset:#x}")),
        }
        self.start(access.now);
    }

    fn write_control(&mut self, value: u32, access: &mut Access<'_>) {
        if value & 1 << 15 != 0 {
            return self.reset();
        }
        let changed = (value ^ self.mcr) & (INRQ | SLEEP) != 0;
        self.mcr = value;
        self.asleep |= value & SLEEP != 0;
        if value & INRQ != 0 && value & SLEEP == 0 {
            self.asleep = false;
            // A frame on the wire is completed first.
            self.joins = self.on_wire.as_ref().map_or(access.now, |(.., end)| *end);
            if self.on_wire.is_none() {
                (self.initialising, self.joins) = (true, NEVER);
            }
        } else if changed && value & INRQ == 0 && (self.initialising || self.asleep) {
            // Eleven recessive bits.
            self.joins = access.now + 11 * self.bit();
        }
    }

    fn write_transmit_status(&mut self, value: u32) {
        for (index, mailbox) in self.mailboxes.iter_mut().enumerate() {
            let shift = 8 * index;
            if value >> shift & 1 == 1 {
                self.tsr &= !(0xF << shift);
            }
            if value >> (shift + 7) & 1 == 1 && mailbox.order.is_some() {
                let leaving =
                    self.on_wire.as_ref().is_some_and(|(sender, ..)| *sender == Sender::Mailbox(index));
                mailbox.abort = leaving;
                if !leaving {
                    mailbox.empty();
                    self.tsr = self.tsr & !(3 << shift) | 1 << shift;
                }
            }
        }
    }

    fn write_queue(&mut self, queue: usize, value: u32) {
        let fifo = &mut self.fifos[queue];
        fifo.full &= value & 1 << 3 == 0;
        fifo.overrun &= value & 1 << 4 == 0;
        if value & 1 << 5 != 0 {
            fifo.frames.pop_front();
        }
    }

    fn write_mailbox(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        let index = (offset as usize - 0x180) / 16;
        let register = (offset as usize / 4) % 4;
        if self.mailboxes[index].order.is_some() {
            return access.refuse("mailbox written while it is not empty", "CAN_TIxR");
        }
        self.mailboxes[index].registers[register] = value;
        if register != 0 || value & 1 == 0 {
            return;
        }
        if value & 6 != 0 {
            access.refuse(NOT_MODELLED, "CAN_TIxR");
        }
        if self.initialising {
            access.refuse("transmission requested in initialisation", "CAN_TIxR");
        }
        self.orders += 1;
        self.mailboxes[index].order = Some(self.orders);
        self.tsr &= !(0xF << (8 * index));
    }

    fn write_filter(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        if matches!(offset, 0x204 | 0x20C | 0x214) && !self.filter_init {
            return access.refuse("filter changed outside its initialisation", format!("CAN1+{offset:#x}"));
        }
        match offset {
            0x204 => self.filter_mode = value,
            0x20C => self.filter_scale = value,
            0x214 => self.filter_queue = value,
            0x21C => self.filter_active = value,
            _ => {
                let bank = (offset as usize - 0x240) / 8;
                if self.filter_active >> bank & 1 == 1 && !self.filter_init {
                    return access.refuse("active filter changed", format!("CAN1+{offset:#x}"));
                }
                self.filters[bank][(offset as usize / 4) % 2] = value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    struct Bench {
        can: Can,
        findings: Findings,
        now: Ticks,
    }

    impl Bench {
        fn new() -> Self {
            let can = Can { bus_hz: 42_000_000, ..Can::new() };
            let mut bench = Self { can, findings: Findings::default(), now: 0 };
            // 42 MHz / 2 / 21 quanta; every identifier to queue 0.
            let setup = [
                (0x00, INRQ | TXFP | RFLM),
                (0x1C, 3 << 24 | 3 << 20 | 15 << 16 | 1),
                (0x200, 1),
                (0x20C, 1),
                (0x21C, 1),
                (0x200, 0),
                (0x00, TXFP | RFLM),
            ];
            setup.into_iter().for_each(|(offset, value)| bench.write(offset, value));
            bench.run(TICK_HZ / 1000);
            bench
        }

        fn write(&mut self, offset: u32, value: u32) {
            self.can.write(offset, value, &mut Access { now: self.now, findings: &mut self.findings });
        }

        fn read(&mut self, offset: u32) -> u32 {
            self.can.read(offset, &mut Access { now: self.now, findings: &mut self.findings })
        }

        fn run(&mut self, duration: Ticks) {
            let end = self.now + duration;
            while self.can.due() <= end {
                self.now = self.can.due();
                self.can.pass(self.now);
            }
            self.now = end;
        }
    }

    #[test]
    fn a_frame_leaves_after_its_bits_and_frees_its_mailbox() {
        let mut bench = Bench::new();
        assert_eq!((bench.can.rate(), bench.read(4) & 1), (1_000_000, 0));
        bench.write(0x184, 2);
        bench.write(0x188, 0x0201);
        bench.write(0x180, 0x123 << 21 | 1);
        assert_eq!(bench.read(8) >> 26 & 7, 0b110);
        bench.run(TICK_HZ / 1000);
        let frame = Frame::new(0x123, &[1, 2]);
        let duration = u64::from(wire::bits(&frame)) * TICK_HZ / 1_000_000;
        assert_eq!(bench.can.sent, [(TICK_HZ / 1000 + duration, frame)]);
        assert_eq!((bench.read(8) >> 26 & 7, bench.read(8) & 3), (0b111, 3));
        assert!(bench.findings.is_empty(), "{:?}", bench.findings);
    }

    #[test]
    fn a_queue_of_three_keeps_the_oldest_when_it_is_locked() {
        let mut bench = Bench::new();
        bench.write(0x14, 1 << 1);
        bench.can.partner.extend((1..=4).map(|id| Frame::new(id, &[id as u8])));
        bench.can.start(bench.now);
        bench.run(TICK_HZ / 1000);
        assert_eq!(bench.read(0x0C) & 0x1B, 3 | 1 << 3 | 1 << 4);
        assert!(bench.can.requests()[1]);
        for id in 1..=3 {
            assert_eq!(bench.read(0x1B0) >> 21, id);
            bench.write(0x0C, 1 << 5);
        }
        assert!(!bench.can.requests()[1]);
    }

    #[test]
    fn without_a_partner_a_frame_is_repeated_up_to_error_passive() {
        let mut bench = Bench::new();
        bench.can.connected = false;
        bench.write(0x180, 0x10 << 21 | 1);
        bench.run(TICK_HZ / 100);
        assert_eq!((bench.read(0x18) & 7, bench.read(0x18) >> 16 & 0xFF), (3, 128));
        bench.write(0x08, 1 << 7);
        bench.run(TICK_HZ / 100);
        assert_eq!(bench.read(8) >> 26 & 7, 0b111);
    }

    #[test]
    fn a_detected_error_raises_its_flag_until_a_one_clears_it() {
        let mut bench = Bench::new();
        bench.can.connected = false;
        bench.write(0x14, 1 << 11 | 1 << 15);
        bench.write(0x180, 0x10 << 21 | 1);
        bench.run(TICK_HZ / 10_000);
        assert!(bench.can.requests()[3] && bench.read(4) & 4 != 0);
        bench.write(0x04, 4);
        assert!(!bench.can.requests()[3]);
        bench.run(TICK_HZ / 10_000);
        assert!(bench.can.requests()[3]);
    }

    #[test]
    fn the_code_names_the_last_mailbox_and_aborts_wait() {
        let mut bench = Bench::new();
        bench.can.connected = false;
        bench.write(0x00, 0);
        for (index, identifier) in [0x300, 0x200, 0x100].into_iter().enumerate() {
            assert_eq!(bench.read(8) >> 24 & 3, index as u32);
            bench.write(0x180 + 16 * index as u32, identifier << 21 | 1);
        }
        assert_eq!(bench.read(8) >> 24 & 3, 0);
        bench.write(0x08, 1 << 7);
        assert_eq!(bench.read(8) >> 26 & 7, 0);
        assert_eq!(bench.read(8) & 1 << 7, 1 << 7);
        bench.run(TICK_HZ / 5000);
        assert_eq!((bench.read(8) >> 26 & 7, bench.read(8) & 1 << 7, bench.read(0x180) & 1), (1, 0, 0));
    }

    #[test]
    fn the_controller_leaves_its_sleep_after_eleven_bits() {
        let mut bench = Bench::new();
        bench.write(0x00, SLEEP);
        assert_eq!(bench.read(4) & 3, 2);
        bench.write(0x00, 0);
        bench.run(10 * TICK_HZ / 1_000_000);
        bench.write(0x00, 0);
        assert_eq!(bench.read(4) & 3, 2);
        bench.run(TICK_HZ / 1_000_000);
        assert_eq!(bench.read(4) & 3, 0);
    }

    #[test]
    fn timing_and_filters_are_set_in_their_initialisation_only() {
        let mut bench = Bench::new();
        bench.write(0x1C, 0);
        bench.write(0x204, 1);
        assert!(bench.findings.has("timing written outside initialisation"));
        assert!(bench.findings.has("filter changed outside its initialisation"));
    }
}
