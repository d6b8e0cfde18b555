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
use super::mailboxes::{Mailboxes, Speaker};
use crate::bus::identification::Results;
use crate::bus::station::{Keeping, LegOrder, LegTold, Station};
use crate::bus::{Controller, Frame, KeptNode, Storing};
use crate::leg::LoggedSample;

/// Frames that wait excuse who is missed for so long: longer than the deepest debt.
const BEHIND_US: u64 = 20_000;
/// Somebody may be missed, whoever says nothing.
const WATCH_US: u64 = 1000;

/// What is to be kept: on its way to the keeper, and back with what became of it.
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

/// What a round needs of a board. Every method answers at once.
pub trait BusBoard<const N: usize>: Mailboxes {
    /// Since the start.
    fn now_us(&self) -> u64;
    /// How the controller does; a frame that was lost is told once.
    fn status(&mut self) -> Controller;
    /// The next frame that came.
    fn frame(&mut self) -> Option<Frame>;
    /// The next sample of the log.
    fn logged(&mut self) -> Option<LoggedSample<N>>;
    /// The leg told something.
    fn is_told(&self) -> bool;
    /// What the leg did, if it told since it was asked.
    fn told(&mut self) -> Option<LegTold<N>>;
    /// The leg has taken the order before.
    fn takes_order(&self) -> bool;
    /// What the leg is to do; not asked for unless it takes one.
    fn order(&mut self, order: LegOrder<N>);
    /// The operator holds the enabling switch.
    fn held(&self) -> bool;
    /// A host has the drive, or has it no longer.
    fn set_hosted(&mut self, hosted: bool);
    /// A store that has ended, once.
    fn kept(&mut self) -> Option<&Keep<N>>;
    /// Memory for the next store; none while one is under way.
    fn lent(&mut self) -> Option<&mut Keep<N>>;
    /// What is in the memory is to be kept.
    fn keep(&mut self);
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

    /// One round; of the frames that came at most `frames`.
    pub fn round<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        frames: usize,
        station: &mut Station<N, LOG>,
        board: &mut impl BusBoard<N>,
        results: &R,
    ) {
        let now_us = board.now_us();
        self.credit.earn(now_us);
        let may_hear = self.credit.is_left();
        if !may_hear && !board.is_told() {
            return;
        }
        let status = board.status();
        let mut is_whole = status != self.controller;
        if is_whole {
            self.controller = status;
            station.on_controller(status, results);
        }
        if status != Controller::Overrun {
            self.lasting = status;
        }
        let mut is_behind = !may_hear;
        for _ in 0..frames {
            if is_behind {
                break;
            }
            let Some(frame) = board.frame() else { break };
            if station.hear(&frame, now_us, None, results) {
                is_whole = true;
                self.credit.pay(board.now_us());
                is_behind = !self.credit.goes_on();
            }
        }
        // Who waits to be heard is not missed yet, unless that lasts.
        if !is_behind {
            self.watched_us = now_us;
        }
        let is_watching = !is_behind || now_us.saturating_sub(self.watched_us) > BEHIND_US;
        self.due |= is_whole;
        let is_late = now_us.saturating_sub(self.whole_us) >= WATCH_US;
        if is_whole || is_late || board.is_told() || board.waiting() != self.waiting {
            self.whole_us = now_us;
            self.rest(now_us, is_watching, station, board, results);
            self.waiting = board.waiting();
        }
        self.credit.pay(board.now_us());
    }

    /// What follows from what was heard and from the time.
    fn rest<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        now_us: u64,
        is_watching: bool,
        station: &mut Station<N, LOG>,
        board: &mut impl BusBoard<N>,
        results: &R,
    ) {
        while let Some(logged) = board.logged() {
            station.log(&logged);
        }
        if is_watching {
            station.watch(now_us, results);
        } else {
            station.look_back(now_us);
        }
        Self::keep(station, board);
        if board.takes_order()
            && let Some(told) = board.told()
        {
            station.told(&LegTold { held: board.held(), ..told });
            board.set_hosted(station.is_hosted());
            self.due = true;
        }
        if self.due && board.takes_order() {
            board.order(station.order());
            self.due = false;
        }
        self.speaker.speak(board, self.lasting, now_us, station, results);
    }

    fn keep<const N: usize, const LOG: usize>(station: &mut Station<N, LOG>, board: &mut impl BusBoard<N>) {
        if let Some(kept) = board.kept() {
            station.set_generation(kept.generation);
            station.stored(kept.done, &kept.objects);
        }
        let Some(lent) = board.lent() else { return };
        let Some(what) = station.take_store(&mut lent.objects) else { return };
        (lent.what, lent.generation) = (what, station.generation());
        station.storing(Storing::Busy);
        board.keep();
    }
}

impl Default for BusRound {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
