//! Level 5 on the board: the interrupt around `operation::BusRound`.
//!
//! Runs when frames came, a mailbox is empty, or the servo has ticked.
//!
//! Why its own level and no executor: any level below the servo could afford a poll (800 instructions) and a
//! frame (up to 2,400). But a repeated block takes 81 thousand in one call (0.6 ms), and a reset that recalls
//! full records 219 thousand. So this level is below the one that empties the controller's queue of three
//! frames. The housekeeping is below this level; its rounds of 2 ms tolerate the delay.
//!
//! ```text
//! level 4  frames of the controller --queue of 32-->       a frame without space is reported as an overrun
//! level 1  servo --reports, log--> bus --orders--> servo  one of each in progress; the next has new targets
//! thread   identification --results--> bus;  bus --data to store--> storage  lent or `Handover`
//!          bus --bytes of a new image--> storage
//! ```
//!
//! Frames of one node reach the other node when they are given to the controller, which does not
//! receive its own.

use core::mem::MaybeUninit;

use heapless::spsc::{Consumer, Producer, Queue};

use super::SIGNALS;
use super::leg::{BASE, JOINTS};
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::bus::device::Device;
use crate::bus::identification::ResultsCopy;
use crate::hal::Frame;
use crate::in_place::{each, fill};
use crate::operation::{BusEnds, BusQueues, BusRound, Handover, HostEnds, StoreJob};
use crate::store::ModelRecord;

/// Length of the log's queue to a host, samples: 384 ms.
pub const LOG: usize = 192;

/// Nodes and axes of this board.
pub type BoardDevice = Device<JOINTS, LOG>;
/// Results of this board's leg.
pub type BoardResults = ResultsCopy<JOINTS, BASE>;

/// Queues of the bus, and buffers that are lent.
pub struct Memory {
    queues: BusQueues<JOINTS>,
    found: Queue<&'static mut BoardResults, 2>,
    spare: Queue<&'static mut BoardResults, 2>,
    accepted: Queue<ModelRecord<JOINTS>, 2>,
    results: [BoardResults; 2],
    storage: Handover<StoreJob<JOINTS>>,
}

/// The identification's end of the queues.
pub struct ThreadEnd {
    found: Producer<'static, &'static mut BoardResults>,
    spare: Consumer<'static, &'static mut BoardResults>,
    accepted: Producer<'static, ModelRecord<JOINTS>>,
}

/// The storage's end of the queues.
pub struct StorageEnd {
    /// Data to store.
    pub storage: &'static Handover<StoreJob<JOINTS>>,
    /// Accepted models.
    pub accepted: Consumer<'static, ModelRecord<JOINTS>>,
    /// Bytes of a new image.
    pub program: Consumer<'static, u8>,
}

/// State of level 5.
pub struct BusLoop {
    device: &'static mut BoardDevice,
    fresh: Consumer<'static, &'static mut BoardResults>,
    spare: Producer<'static, &'static mut BoardResults>,
    found: &'static mut BoardResults,
    round: BusRound,
    ends: BusEnds<'static, JOINTS>,
    storage: &'static Handover<StoreJob<JOINTS>>,
}

/// State of level 5, once the start has set it.
pub static BUS: spin::Mutex<Option<&'static mut BusLoop>> = spin::Mutex::new(None);
/// Queue of frames from level 4, once the start has set it.
pub static FRAMES_IN: spin::Mutex<Option<Producer<'static, Frame>>> = spin::Mutex::new(None);

impl Memory {
    /// Builds an empty memory in its place.
    pub fn new_in(slot: &mut MaybeUninit<Self>) -> &mut Self {
        fill!(
            slot,
            {
                queues: BusQueues::new(),
                found: Queue::new(),
                spare: Queue::new(),
                accepted: Queue::new(),
                storage: Handover::new(StoreJob::NOTHING),
            },
            { results: |results| each(results, BoardResults::nothing) }
        )
    }

    /// Returns all ends; the frames' first.
    pub fn split(
        &'static mut self,
        device: &'static mut BoardDevice,
    ) -> (Producer<'static, Frame>, HostEnds<'static, JOINTS>, ThreadEnd, StorageEnd, BusLoop) {
        let (frames_in, servo, ends, program) = self.queues.split();
        let ((found_in, fresh), (mut spare, spare_out)) = (self.found.split(), self.spare.split());
        let (accepted_in, accepted) = self.accepted.split();
        let [found, other] = &mut self.results;
        // There is space: the queue is new.
        let _ = spare.enqueue(other);
        let storage: &'static Handover<StoreJob<JOINTS>> = &self.storage;
        let bus = BusLoop { device, fresh, spare, found, round: BusRound::new(), ends, storage };
        let thread = ThreadEnd { found: found_in, spare: spare_out, accepted: accepted_in };
        (frames_in, servo, thread, StorageEnd { storage, accepted, program }, bus)
    }
}

impl ThreadEnd {
    /// Replaces the results that the bus answers with; returns whether a buffer was free.
    pub fn publish(&mut self, fill: impl FnOnce(&mut BoardResults)) -> bool {
        let Some(found) = self.spare.dequeue() else { return false };
        fill(found);
        self.found.enqueue(found).is_ok()
    }

    /// Passes on a model that may be stored.
    pub fn accept(&mut self, model: ModelRecord<JOINTS>) {
        // There is space: the storage takes a model in each round, and an identification lasts for seconds.
        let _ = self.accepted.enqueue(model);
    }
}

impl BusLoop {
    fn run(&mut self) {
        while let Some(fresh) = self.fresh.dequeue() {
            // There is space: of two buffers one is in use.
            let _ = self.spare.enqueue(core::mem::replace(&mut self.found, fresh));
        }
        self.found.search = SIGNALS.statistics.search.each_ref().map(|count| count.get());
        self.round.round(self.device, &mut self.ends, self.storage, &SIGNALS, &mut Odrive, &*self.found);
    }
}

/// Interrupt of level 5.
#[inline(always)]
pub fn interrupt() {
    if let Some(mut bus) = BUS.try_lock()
        && let Some(bus) = bus.as_mut()
    {
        bus.run();
    }
}

/// Interrupt of level 4: queues a received frame; returns whether there was space.
#[inline(always)]
pub fn received(frame: Frame) -> bool {
    match FRAMES_IN.try_lock() {
        Some(mut frames) => frames.as_mut().is_some_and(|frames| frames.enqueue(frame).is_ok()),
        None => false,
    }
}
