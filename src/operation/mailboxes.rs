//! Level 5: what waits in the mailboxes of the bus' controller, and how old it may become.
//!
//! Why: a controller sends again what nobody acknowledges, for ever. One whose plug was pulled becomes passive and never goes off, so what
//! waits in it would be the first to leave when the plug is put back, however old.
//!
//! ```text
//! active    as many frames as there is room for, of each node in turn
//! passive   one at a time; what waits for longer than 10 ms is given up and a newer one takes its place
//! off       what waits is given up as long as it lasts, and no node has a frame (`Station::poll`)
//! ```
//!
//! Emergency and boot-up messages are told once: those that were given up are the first to be given again, whoever gave them and when. One
//! that leaves in the very moment in which it is given up is told twice.

use crate::bus::identification::Results;
use crate::bus::station::Station;
use crate::hal::{Controller, Frame, Hardware};

/// The longest that a frame waits in a passive controller, microseconds: the longest frame takes 1.1 ms of the slowest bus, and whoever works on a
/// cycle of 10 ms has newer ones by then.
const PATIENCE_US: u64 = 10_000;

/// Of a controller.
const MAILBOXES: usize = 3;

/// Who speaks next, and what was given to a passive controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speaker {
    /// The node that is asked first.
    first: usize,
    /// Passive; and since when what is in the mailboxes waits there.
    since_us: Option<u64>,
    /// Of each mailbox, what is told once, and how many of these were given before.
    given: [Option<(u32, Frame)>; MAILBOXES],
    count: u32,
    /// What was given up and is to be told all the same, the oldest first.
    again: [Option<Frame>; MAILBOXES],
}

impl Speaker {
    /// Nobody has spoken.
    #[must_use]
    pub const fn new() -> Self {
        Self { first: 0, since_us: None, given: [None; MAILBOXES], count: 0, again: [None; MAILBOXES] }
    }

    /// What leaves in this round, of a controller in a state that lasts.
    pub fn speak<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        hardware: &mut impl Hardware<N>,
        controller: Controller,
        now_us: u64,
        station: &mut Station<N, LOG>,
        results: &R,
    ) {
        let waiting = hardware.mailboxes_waiting();
        let waits = |place: usize| waiting & 1 << place != 0;
        for (place, given) in self.given.iter_mut().enumerate() {
            // What has left.
            given.take_if(|_| !waits(place));
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
        let places = match controller {
            Controller::Passive if waiting != 0 => 0,
            Controller::Passive => 1,
            _ => MAILBOXES,
        };
        for place in (0..places).filter(|place| !waits(*place)) {
            let Some(frame) = self.next(now_us, station, results) else { break };
            hardware.send(place as u32, &frame);
            if let Some(given) = self.given.get_mut(place) {
                *given = station.tells_once(&frame).then_some((self.count, frame));
                self.count = self.count.wrapping_add(1);
            }
        }
    }

    /// What was given is to be given again, in its order, before what waits for that already.
    fn take_back(&mut self) {
        let mut back = [None; MAILBOXES];
        let mut places = back.iter_mut();
        for _ in 0..MAILBOXES {
            let oldest = self.given.iter_mut().filter(|given| given.is_some());
            let oldest = oldest.min_by_key(|given| given.map(|(number, _)| number)).and_then(Option::take);
            let next = oldest.map(|(_, frame)| frame);
            let next = next.or_else(|| self.again.iter_mut().find_map(Option::take));
            if let Some(place) = places.next() {
                *place = next;
            }
        }
        self.again = back;
    }

    /// The next frame, of each node in turn; the others hear it, since the controller does not hear itself.
    fn next<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        now_us: u64,
        station: &mut Station<N, LOG>,
        results: &R,
    ) -> Option<Frame> {
        if let Some(again) = self.again.iter_mut().find_map(Option::take) {
            return Some(again);
        }
        for _ in 0..N {
            let joint = self.first;
            self.first = (joint + 1) % N;
            if let Some(frame) = station.poll(joint, now_us, results) {
                station.hear(&frame, now_us, Some(joint), results);
                return Some(frame);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
