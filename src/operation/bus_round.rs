//! Level 5: one round of the bus, in this order.
//!
//! ```text
//! controller   active, passive, off, or a frame was lost: told once on every change
//! frames       that came, at most as many as fit the queue
//! log          all that waits
//! time         whether a host is missed, however full the bus is
//! store        what ended, what is asked for
//! leg          what it told, then its next order; neither while it has not taken the one before, which would be overwritten and a request with it
//! mailboxes    [`Speaker`]
//! ```
//!
//! **How often.** Each frame raises a round, and a wire that is full of the shortest has 21 thousand a second. Frames that are no node's business end it at
//! once; the others pay ([`Credit`]). Who is in debt hears nothing; what the leg told is taken all the same.

use super::credit::Credit;
use super::handover::Handover;
use super::mailboxes::Speaker;
use super::queues::{BusEnds, FRAMES};
use super::signals::Signals;
use crate::bus::identification::Results;
use crate::bus::station::{Keeping, Station};
use crate::bus::{KeptNode, Storing};
use crate::hal::{Controller, Hardware};

/// Frames that wait excuse who is missed for so long: longer than the deepest debt.
const BEHIND_US: u64 = 20_000;
/// Somebody may be missed, whoever says nothing.
const WATCH_US: u64 = 1000;

/// What a host wants stored: on its way to the storage, and back with the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Keep<const N: usize> {
    /// What a host asked for.
    pub what: Keeping,
    /// Of each node.
    pub objects: [KeptNode; N],
    /// Models kept so far.
    pub generation: u32,
    /// It was kept.
    pub done: bool,
}

impl<const N: usize> Keep<N> {
    /// Not asked for anything yet.
    pub const NOTHING: Self =
        Self { what: Keeping::All, objects: [KeptNode::NOTHING; N], generation: 0, done: true };
}

/// What is known between two rounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusRound {
    controller: Controller,
    /// The same, but for a frame that was lost in it.
    lasting: Controller,
    /// The leg has not been told of what came since.
    due: bool,
    speaker: Speaker,
    credit: Credit,
    /// In which mailboxes something waited after the last round that was none for nobody's frames, and when that was.
    waiting: u32,
    whole_us: u64,
    /// When nobody waited to be heard.
    watched_us: u64,
}

impl BusRound {
    /// Nothing heard yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            controller: Controller::Active,
            lasting: Controller::Active,
            due: false,
            speaker: Speaker::new(),
            credit: Credit::new(),
            waiting: 0,
            whole_us: 0,
            watched_us: 0,
        }
    }

    /// One round.
    pub fn round<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        station: &mut Station<N, LOG>,
        ends: &mut BusEnds<'_, N>,
        storage: &Handover<Keep<N>>,
        signals: &Signals<N>,
        hardware: &mut impl Hardware<N>,
        results: &R,
    ) {
        let now_us = hardware.now_us();
        self.credit.earn(now_us);
        let may_hear = self.credit.is_left();
        if !may_hear && !ends.told.ready() {
            return;
        }
        let status = hardware.controller();
        let mut is_whole = status != self.controller;
        if is_whole {
            self.controller = status;
            station.on_controller(status, results);
        }
        if status != Controller::Overrun {
            self.lasting = status;
        }
        let mut is_behind = !may_hear;
        for _ in 0..FRAMES {
            if is_behind {
                break;
            }
            let Some(frame) = ends.frames.dequeue() else { break };
            if station.hear(&frame, now_us, None, results) {
                is_whole = true;
                self.credit.pay(hardware.now_us());
                is_behind = !self.credit.goes_on();
            }
        }
        // A host whose frames still wait is not missing yet, unless that lasts.
        if !is_behind {
            self.watched_us = now_us;
        }
        let is_watching = !is_behind || now_us.saturating_sub(self.watched_us) > BEHIND_US;
        self.due |= is_whole;
        let is_late = now_us.saturating_sub(self.whole_us) >= WATCH_US;
        if is_whole || is_late || ends.told.ready() || hardware.mailboxes_waiting() != self.waiting {
            self.whole_us = now_us;
            while let Some(logged) = ends.logged.dequeue() {
                station.log(&logged);
            }
            if is_watching {
                station.watch(now_us, results);
            } else {
                station.look_back(now_us);
            }
            Self::store(station, storage);
            self.exchange(station, ends, signals);
            self.speaker.speak(hardware, self.lasting, now_us, station, results);
            self.waiting = hardware.mailboxes_waiting();
        }
        self.credit.pay(hardware.now_us());
    }

    /// Takes the leg's report and gives its next order; neither while the leg has not taken the order before.
    fn exchange<const N: usize, const LOG: usize>(
        &mut self,
        station: &mut Station<N, LOG>,
        ends: &mut BusEnds<'_, N>,
        signals: &Signals<N>,
    ) {
        if !ends.orders.ready() {
            return;
        }
        if let Some(told) = ends.told.dequeue() {
            station.told(&told);
            signals.set_hosted(station.is_hosted());
            self.due = true;
        }
        if self.due {
            let _ = ends.orders.enqueue(station.order());
            self.due = false;
        }
    }

    fn store<const N: usize, const LOG: usize>(station: &mut Station<N, LOG>, storage: &Handover<Keep<N>>) {
        if let Some(stored) = storage.take_back() {
            station.set_generation(stored.generation);
            station.stored(stored.done, &stored.objects);
        }
        let Some(mut next) = storage.idle() else { return };
        let Some(what) = station.take_store(&mut next.objects) else { return };
        (next.what, next.generation) = (what, station.generation());
        station.storing(Storing::Busy);
        drop(next);
        storage.give();
    }
}

impl Default for BusRound {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
