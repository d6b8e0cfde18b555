//! Level 5: transmit scheduling for the CAN controller's mailboxes, with a limit on a frame's age.
//!
//! Why: a controller repeats unacknowledged frames without end. With its plug pulled it becomes passive and
//! never goes off. Its waiting frames would be the first to leave when the plug is put back, however old.
//!
//! ```text
//! active    as many frames as mailboxes are free, from each node in turn
//! passive   one at a time; a frame that waits for longer than 10 ms is aborted and replaced by a newer one
//! off       waiting frames are aborted while it lasts, and no node has a frame (`Device::poll`)
//! ```
//!
//! Emergency and boot-up messages are sent once; aborted ones are the first to be sent again. One that leaves
//! at the very moment of its abortion is sent twice.

use crate::bus::device::Device;
use crate::bus::identification::Results;
use crate::hal::{Controller, Frame, Hardware};

/// Longest wait of a frame in a passive controller, microseconds. The longest frame takes 1.1 ms on the
/// slowest bus, and a device with a cycle of 10 ms has newer frames by then.
const PATIENCE_US: u64 = 10_000;

/// Mailboxes of a controller.
const MAILBOXES: usize = 3;

/// Scheduler of the transmit mailboxes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TxScheduler {
    /// Node that is polled first.
    first: usize,
    /// Time since which frames have been waiting in a passive controller.
    since_us: Option<u64>,
    /// Frame in each mailbox that is sent once, with its sequence number.
    given: [Option<(u32, Frame)>; MAILBOXES],
    count: u32,
    /// Aborted frames that must be sent again, oldest first.
    again: [Option<Frame>; MAILBOXES],
}

impl TxScheduler {
    /// State before the first frame.
    pub const fn new() -> Self {
        Self { first: 0, since_us: None, given: [None; MAILBOXES], count: 0, again: [None; MAILBOXES] }
    }

    /// Fills the mailboxes for this round, for a controller in a lasting state.
    pub(crate) fn fill<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        hardware: &mut impl Hardware<N>,
        controller: Controller,
        now_us: u64,
        device: &mut Device<N, LOG>,
        results: &R,
    ) {
        let waiting = hardware.mailboxes_waiting();
        let waits = |index: usize| waiting & 1 << index != 0;
        for (index, given) in self.given.iter_mut().enumerate() {
            // Drops frames that have left their mailbox.
            given.take_if(|_| !waits(index));
        }
        let is_passive = controller == Controller::Passive;
        let since_us = *self.since_us.get_or_insert(now_us);
        if !is_passive || waiting == 0 {
            self.since_us = None;
        }
        let is_old = is_passive && waiting != 0 && now_us.saturating_sub(since_us) > PATIENCE_US;
        if controller == Controller::Off || is_old {
            hardware.abort_transmission();
            self.since_us = None;
            self.take_back();
            return;
        }
        let usable = match controller {
            Controller::Passive if waiting != 0 => 0,
            Controller::Passive => 1,
            _ => MAILBOXES,
        };
        for index in (0..usable).filter(|index| !waits(*index)) {
            let Some(frame) = self.next(now_us, device, results) else { break };
            hardware.send(index as u32, &frame);
            if let Some(given) = self.given.get_mut(index) {
                *given = device.reports_once(&frame).then_some((self.count, frame));
                self.count = self.count.wrapping_add(1);
            }
        }
    }

    /// Moves the frames of all mailboxes, in their order, before those that wait to be sent again.
    fn take_back(&mut self) {
        let mut back = [None; MAILBOXES];
        let mut slots = back.iter_mut();
        for _ in 0..MAILBOXES {
            let oldest = self.given.iter_mut().filter(|given| given.is_some());
            let oldest = oldest.min_by_key(|given| given.map(|(number, _)| number)).and_then(Option::take);
            let next = oldest.map(|(_, frame)| frame);
            let next = next.or_else(|| self.again.iter_mut().find_map(Option::take));
            if let Some(slot) = slots.next() {
                *slot = next;
            }
        }
        self.again = back;
    }

    /// Next frame, from each node in turn. The other nodes receive it here, since the controller does not
    /// receive its own frames.
    fn next<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        now_us: u64,
        device: &mut Device<N, LOG>,
        results: &R,
    ) -> Option<Frame> {
        if let Some(again) = self.again.iter_mut().find_map(Option::take) {
            return Some(again);
        }
        for _ in 0..N {
            let joint = self.first;
            self.first = (joint + 1) % N;
            if let Some(frame) = device.poll(joint, now_us, results) {
                device.receive(&frame, now_us, Some(joint), results);
                return Some(frame);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
