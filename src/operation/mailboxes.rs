//! Level 5: what waits in the mailboxes of the bus' controller, and how old it may become.
//!
//! Why: a controller sends again what nobody acknowledges, for ever. One whose plug was pulled becomes passive and never goes off, so what
//! waits in it would be the first to leave when the plug is put back, however old.
//!
//! ```text
//! active    as many frames as there is room for, of each node in turn
//! passive   one at a time; what waits for longer than 10 ms is given up and a newer one takes its place. Emergency and boot-up messages, which
//!           are told once, are given again instead
//! off       what waits is given up as long as it lasts, and no node has a frame (`Station::poll`)
//! ```

use crate::bus::identification::Results;
use crate::bus::station::Station;
use crate::bus::{Controller, Frame};

/// The longest that a frame waits in a passive controller, microseconds: the longest frame takes 1.1 ms of the slowest bus, and whoever works on a
/// cycle of 10 ms has newer ones by then.
const PATIENCE_US: u64 = 10_000;

/// Where the controller keeps frames until they leave.
pub trait Mailboxes {
    /// One is empty.
    fn has_room(&self) -> bool;
    /// All are.
    fn is_empty(&self) -> bool;
    /// Into one of them.
    fn send(&mut self, frame: &Frame);
    /// What has not left does not leave any more; they are empty soon.
    fn give_up(&mut self);
}

/// Who speaks next, and what was given to a passive controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speaker {
    /// The node that is asked first.
    first: usize,
    /// Passive; and since when what is in the mailboxes waits there.
    since_us: Option<u64>,
    /// The frame that a passive controller has.
    given: Option<Frame>,
    /// One that was given up and is to be told all the same.
    again: Option<Frame>,
}

/// Emergency messages, and that of a node's start.
fn is_told_once(frame: &Frame) -> bool {
    matches!(frame.id(), 0x081..=0x0FF) || matches!((frame.id(), frame.data()), (0x701..=0x77F, [0]))
}

impl Speaker {
    /// Nobody has spoken.
    #[must_use]
    pub const fn new() -> Self {
        Self { first: 0, since_us: None, given: None, again: None }
    }

    /// What leaves in this round.
    pub fn speak<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        mailboxes: &mut impl Mailboxes,
        controller: Controller,
        now_us: u64,
        station: &mut Station<N, LOG>,
        results: &R,
    ) {
        let mut next = || Self::next(&mut self.again, &mut self.first, now_us, station, results);
        if controller != Controller::Passive {
            (self.since_us, self.given) = (None, None);
            if controller == Controller::Off {
                mailboxes.give_up();
                return;
            }
            while mailboxes.has_room()
                && let Some(frame) = next()
            {
                mailboxes.send(&frame);
            }
            return;
        }
        let since_us = *self.since_us.get_or_insert(now_us);
        if mailboxes.is_empty() {
            // What was given has left.
            (self.since_us, self.given) = (Some(now_us), next());
            if let Some(frame) = &self.given {
                mailboxes.send(frame);
            }
        } else if now_us.saturating_sub(since_us) > PATIENCE_US {
            mailboxes.give_up();
            self.since_us = Some(now_us);
            self.again = self.given.take().filter(is_told_once);
        }
    }

    /// The next frame, of each node in turn; the others hear it, since the controller does not hear itself.
    fn next<R: Results, const N: usize, const LOG: usize>(
        again: &mut Option<Frame>,
        first: &mut usize,
        now_us: u64,
        station: &mut Station<N, LOG>,
        results: &R,
    ) -> Option<Frame> {
        if again.is_some() {
            return again.take();
        }
        for _ in 0..N {
            let joint = *first;
            *first = (joint + 1) % N;
            if let Some(frame) = station.poll(joint, now_us, results) {
                station.hear(&frame, now_us, Some(joint), results);
                return Some(frame);
            }
        }
        None
    }
}

#[cfg(test)]
pub(super) mod tests;
