//! Level 5: one round of the bus, in this order.
//!
//! ```text
//! controller   active, passive, off, or a lost frame: reported on every change
//! frames       received ones, at most as many as fit the queue
//! log          all waiting samples
//! time         timeouts of the host, however full the bus is
//! store        results and new requests
//! board        its telemetry; steps of commissioning that a host asked for; bandwidths; a new image
//! leg          its report, then its next order; both wait until the leg has taken the previous order, which
//!             would be overwritten otherwise, and a request with it
//! mailboxes    [`TxScheduler`]
//! ```
//!
//! **Rate.** Each frame triggers a round, and a bus full of the shortest frames has 21,000 a second. Frames
//! for other nodes end the round at once; the others cost time ([`TokenBucket`]). With a negative balance no
//! frames are read, but the leg's reports still are.

use super::handover::Handover;
use super::mailboxes::TxScheduler;
use super::queues::{BusEnds, FRAMES, take_first};
use super::signals::Signals;
use super::token_bucket::TokenBucket;
use crate::bus::device::{Device, StoreCommand};
use crate::bus::identification::Results;
use crate::bus::{StoredNode, Storing};
use crate::hal::{Controller, Hardware};

/// Longest time for which waiting frames suspend the timeouts, longer than the deepest debt.
const BEHIND_US: u64 = 20_000;
/// Longest time between two checks of the timeouts.
const WATCH_US: u64 = 1000;

/// Objects that a host wants stored: sent to the storage and returned with the result.
#[derive(Clone, Debug, PartialEq)]
pub struct StoreJob<const N: usize> {
    /// Kind of storage that the host requested.
    pub what: StoreCommand,
    /// Stored objects of each node.
    pub objects: [StoredNode; N],
    /// Models stored so far.
    pub generation: u32,
    /// The objects were stored.
    pub done: bool,
}

impl<const N: usize> StoreJob<N> {
    /// No request.
    pub const NOTHING: Self =
        Self { what: StoreCommand::All, objects: [StoredNode::NOTHING; N], generation: 0, done: true };
}

/// State between two rounds of the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusRound {
    controller: Controller,
    /// State of the controller without [`Controller::Overrun`], which lasts for one frame only.
    lasting: Controller,
    /// The leg has not received an order for the newest frames.
    due: bool,
    transmitter: TxScheduler,
    tokens: TokenBucket,
    /// Mailboxes in use after the last complete round, and the time of that round.
    waiting: u32,
    whole_us: u64,
    /// Last time without waiting frames.
    watched_us: u64,
    /// A new image is being received or swapped in.
    pauses: bool,
}

impl BusRound {
    /// State before the first frame.
    pub const fn new() -> Self {
        Self {
            controller: Controller::Active,
            lasting: Controller::Active,
            due: false,
            transmitter: TxScheduler::new(),
            tokens: TokenBucket::new(),
            waiting: 0,
            whole_us: 0,
            watched_us: 0,
            pauses: false,
        }
    }

    /// Runs one round.
    pub fn round<R: Results, const N: usize, const LOG: usize>(
        &mut self,
        device: &mut Device<N, LOG>,
        ends: &mut BusEnds<'_, N>,
        storage: &Handover<StoreJob<N>>,
        signals: &Signals<N>,
        hardware: &mut impl Hardware<N>,
        results: &R,
    ) {
        let now_us = hardware.now_us();
        self.tokens.refill(now_us);
        let may_receive = self.tokens.may_start();
        if !may_receive && !ends.status.ready() {
            return;
        }
        let status = hardware.controller();
        let mut is_whole = status != self.controller;
        if is_whole {
            self.controller = status;
            device.on_controller(status, results);
        }
        if status != Controller::Overrun {
            self.lasting = status;
        }
        let mut is_behind = !may_receive;
        for _ in 0..FRAMES {
            if is_behind {
                break;
            }
            let Some(frame) = ends.frames.dequeue() else { break };
            if device.receive(&frame, now_us, None, results) {
                is_whole = true;
                self.tokens.spend(hardware.now_us());
                is_behind = !self.tokens.may_continue();
            }
        }
        // Timeouts pause while frames wait, but not for long.
        if !is_behind {
            self.watched_us = now_us;
        }
        let is_watching = !is_behind || now_us.saturating_sub(self.watched_us) > BEHIND_US;
        self.due |= is_whole;
        let is_late = now_us.saturating_sub(self.whole_us) >= WATCH_US;
        if is_whole || is_late || ends.status.ready() || hardware.mailboxes_waiting() != self.waiting {
            self.whole_us = now_us;
            while let Some(logged) = ends.logged.dequeue() {
                device.log(&logged);
            }
            if is_watching {
                device.watch(now_us, results);
            } else {
                device.check_gap(now_us);
            }
            Self::store(device, storage);
            device.update_board(&signals.board_status());
            if let Some(step) = device.take_step() {
                signals.ask(step);
            }
            signals.set_bandwidths(&device.bandwidths());
            self.pass_program(device, ends, signals);
            self.exchange(device, ends, signals);
            self.transmitter.fill(hardware, self.lasting, now_us, device, results);
            self.waiting = hardware.mailboxes_waiting();
        }
        self.tokens.spend(hardware.now_us());
    }

    /// Passes commands and bytes of a new image on. Hosts hear of a pause of the heartbeats before it, as of
    /// one for a save.
    fn pass_program<const N: usize, const LOG: usize>(
        &mut self,
        device: &mut Device<N, LOG>,
        ends: &mut BusEnds<'_, N>,
        signals: &Signals<N>,
    ) {
        while ends.program.ready()
            && let Some(byte) = device.take_program_byte()
        {
            // There is space: checked above.
            let _ = ends.program.enqueue(byte);
        }
        let command = device.take_program_command();
        if let Some(command) = command {
            signals.command_program(command);
        }
        device.update_program(signals.program_status());
        let pauses = signals.program_pauses();
        if pauses != self.pauses {
            self.pauses = pauses;
            device.pause(pauses);
        }
    }

    /// Takes the leg's report and gives its next order; neither while the leg has not taken the order before.
    fn exchange<const N: usize, const LOG: usize>(
        &mut self,
        device: &mut Device<N, LOG>,
        ends: &mut BusEnds<'_, N>,
        signals: &Signals<N>,
    ) {
        if !ends.orders.ready() {
            return;
        }
        if take_first(&mut ends.status, |status| device.update(status)).is_some() {
            signals.set_host(device.is_hosted(), device.is_stopped());
            self.due = true;
        }
        if self.due {
            // There is space: checked above.
            let _ = ends.orders.enqueue(device.order());
            self.due = false;
        }
    }

    fn store<const N: usize, const LOG: usize>(device: &mut Device<N, LOG>, storage: &Handover<StoreJob<N>>) {
        if let Some(stored) = storage.take_back() {
            device.set_generation(stored.generation);
            device.stored(stored.done, &stored.objects);
        }
        let Some(mut next) = storage.idle() else { return };
        let Some(what) = device.take_store(&mut next.objects) else { return };
        (next.what, next.generation) = (what, device.generation());
        device.storing(Storing::Busy);
        drop(next);
        storage.give();
    }
}

#[cfg(test)]
mod tests;
