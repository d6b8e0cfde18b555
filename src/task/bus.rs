//! Level 5 on the board: the interrupt around `operation::BusRound`, run whenever frames came, a mailbox is empty, or the servo has ticked.
//!
//! Why its own level and no executor: a poll takes 0.8 thousand instructions and a frame up to 2.4, which any level below the servo could
//! give. But a block that is sent again takes 81 thousand in one call (0.6 ms), and a reset that recalls full records 219 thousand. So it
//! stands below the level that empties the controller's queue of three frames, and above the housekeeping, whose rounds of 2 ms allow for it.
//!
//! ```text
//! level 4  frames of the controller --queue of 32-->                        a frame without room is reported as an overrun
//! level 1  servo --reports, log-->  bus  --orders--> servo                   one of each under way; the newest targets are in the next
//! thread   identification --results--> bus;  bus --what to store--> storage   large values: lent, or passed in turn (`Handover`)
//! ```
//!
//! Frames of one node are heard by the other as they are given to the controller, which does not hear itself.

use core::mem::MaybeUninit;

use heapless::spsc::{Consumer, Producer, Queue};

use super::SIGNALS;
use super::leg::{BASE, JOINTS};
use crate::bus::identification::Found;
use crate::bus::station::Station;
use crate::hal::{Frame, Hardware};
use crate::operation::{BusEnds, BusQueues, BusRound, Handover, HostEnds, Keep};
use crate::place::{each, fill};
use crate::store::KeptModel;

/// Samples of the log that wait for a host: 384 ms of it.
pub const LOG: usize = 192;

/// Nodes and axes of this board.
pub type BoardStation = Station<JOINTS, LOG>;
/// Results of this board's leg.
pub type BoardFound = Found<JOINTS, BASE>;

/// Queues of the bus, and what is lent.
pub struct Memory {
    queues: BusQueues<JOINTS>,
    found: Queue<&'static mut BoardFound, 2>,
    spare: Queue<&'static mut BoardFound, 2>,
    accepted: Queue<KeptModel<JOINTS>, 2>,
    results: [BoardFound; 2],
    storage: Handover<Keep<JOINTS>>,
}

/// The identification's end.
pub struct ThreadEnd {
    found: Producer<'static, &'static mut BoardFound>,
    spare: Consumer<'static, &'static mut BoardFound>,
    accepted: Producer<'static, KeptModel<JOINTS>>,
}

/// The storage's end.
pub struct KeeperEnd {
    /// What is to be stored.
    pub storage: &'static Handover<Keep<JOINTS>>,
    /// Models that were accepted.
    pub accepted: Consumer<'static, KeptModel<JOINTS>>,
}

/// What level 5 works on.
pub struct BusLoop {
    station: &'static mut BoardStation,
    fresh: Consumer<'static, &'static mut BoardFound>,
    spare: Producer<'static, &'static mut BoardFound>,
    found: &'static mut BoardFound,
    round: BusRound,
    ends: BusEnds<'static, JOINTS>,
    storage: &'static Handover<Keep<JOINTS>>,
}

/// What level 5 works on, once the start has set it.
pub static BUS: spin::Mutex<Option<&'static mut BusLoop>> = spin::Mutex::new(None);
/// Where level 4 puts frames, once the start has set it.
pub static FRAMES_IN: spin::Mutex<Option<Producer<'static, Frame>>> = spin::Mutex::new(None);

impl Memory {
    /// Empty, built in its place.
    pub fn place(slot: &mut MaybeUninit<Self>) -> &mut Self {
        fill!(
            slot,
            {
                queues: BusQueues::new(),
                found: Queue::new(),
                spare: Queue::new(),
                accepted: Queue::new(),
                storage: Handover::new(Keep::NOTHING),
            },
            { results: |results| each(results, BoardFound::nothing) }
        )
    }

    /// All ends; the frames' first.
    pub fn split(
        &'static mut self,
        station: &'static mut BoardStation,
    ) -> (Producer<'static, Frame>, HostEnds<'static, JOINTS>, ThreadEnd, KeeperEnd, BusLoop) {
        let (frames_in, servo, ends) = self.queues.split();
        let ((found_in, fresh), (mut spare, spare_out)) = (self.found.split(), self.spare.split());
        let (accepted_in, accepted) = self.accepted.split();
        let [found, other] = &mut self.results;
        let _ = spare.enqueue(other);
        let storage: &'static Handover<Keep<JOINTS>> = &self.storage;
        let bus = BusLoop { station, fresh, spare, found, round: BusRound::new(), ends, storage };
        let thread = ThreadEnd { found: found_in, spare: spare_out, accepted: accepted_in };
        (frames_in, servo, thread, KeeperEnd { storage, accepted }, bus)
    }
}

impl ThreadEnd {
    /// Has the bus answer with other results; whether there was room.
    pub fn publish(&mut self, fill: impl FnOnce(&mut BoardFound)) -> bool {
        let Some(found) = self.spare.dequeue() else { return false };
        fill(found);
        self.found.enqueue(found).is_ok()
    }

    /// Passes on a model that may be stored, in the place of one that was not.
    pub fn accept(&mut self, model: KeptModel<JOINTS>) {
        let _ = self.accepted.enqueue(model);
    }
}

impl BusLoop {
    fn run(&mut self, hardware: &mut impl Hardware<JOINTS>) {
        while let Some(fresh) = self.fresh.dequeue() {
            let _ = self.spare.enqueue(core::mem::replace(&mut self.found, fresh));
        }
        self.found.search = SIGNALS.statistics.search.each_ref().map(|count| count.get());
        self.round.round(self.station, &mut self.ends, self.storage, &SIGNALS, hardware, &*self.found);
    }
}

/// Level 5.
#[inline(always)]
pub fn interrupt(hardware: &mut impl Hardware<JOINTS>) {
    if let Some(mut bus) = BUS.try_lock()
        && let Some(bus) = bus.as_mut()
    {
        bus.run(hardware);
    }
}

/// Level 4: a frame came; whether there was room for it.
#[inline(always)]
pub fn received(frame: Frame) -> bool {
    match FRAMES_IN.try_lock() {
        Some(mut frames) => frames.as_mut().is_some_and(|frames| frames.enqueue(frame).is_ok()),
        None => false,
    }
}
