//! Level 5: queues and the controller beneath `operation::BusRound`, run whenever frames came, a mailbox is empty, or the servo has ticked.
//!
//! Why its own level and no executor: a poll takes 0.8 thousand instructions and a frame up to 2.4, which any level below the servo could give; but a
//! block that is sent again takes 81 thousand in one call (0.6 ms), and a reset that recalls full records 219 thousand, so it stands below the level that empties the controller's queue of three
//! frames, and above the housekeeping, whose rounds of 2 ms wait that long for nothing. Nobody waits here, so there is
//! nothing for an executor to do.
//!
//! ```text
//! level 4  frames of the controller --queue of 32-->                        a frame without room is told as an overrun
//! level 1  servo --told, logged-->  bus  --order--> servo                    one of each under way; the newest targets are in the next
//! thread   identification --found--> bus;  keeper <--keep-- bus <--kept-- keeper          loans of memory, passed back and forth
//! ```
//!
//! Frames of one node are heard by the other as they are given to the controller, which does not hear itself.

use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};

use super::leg::{BASE, JOINTS};
use super::statistics::Count;
use crate::bus::identification::Found;
use crate::bus::station::{Keeping, LegOrder, LegTold, Station};
use crate::bus::{Controller, Frame, KeptNode};
use crate::leg::LoggedSample;
use crate::operation::{self, BusBoard, BusRound, Mailboxes};
use crate::place::{each, fill};
use crate::store::KeptModel;

/// Samples of the log that wait for a host: 384 ms of it.
pub const LOG: usize = 192;
/// Frames that wait to be heard: 1.5 ms of the shortest at 1 Mbit/s.
const FRAMES: usize = 33;

/// Nodes and axes of this board.
pub type BoardStation = Station<JOINTS, LOG>;
/// Results of this board's leg.
pub type BoardFound = Found<JOINTS, BASE>;

/// Iterations and evaluations of the search under way.
pub static SEARCH: [Count; 2] = [const { Count::zero() }; 2];

/// A host has the drive.
static HOSTED: AtomicBool = AtomicBool::new(false);

/// A host has the drive: closing the enabling switch permits, and no longer asks.
pub fn is_hosted() -> bool {
    HOSTED.load(Ordering::Relaxed)
}

/// The controller of the bus, seen from above.
#[derive(Clone, Copy)]
pub struct Wire {
    /// Since the start.
    pub now_us: fn() -> u64,
    /// Mailboxes in which a frame waits, a bit each.
    pub waiting: fn() -> u32,
    /// Gives one into a mailbox.
    pub send: fn(u32, &Frame),
    /// What was given and not sent is not sent any more.
    pub give_up: fn(),
    /// How it does.
    pub status: fn() -> Controller,
    /// The operator holds the enabling switch.
    pub held: fn() -> bool,
}

/// What is to be kept of this board.
pub type Keep = operation::Keep<JOINTS>;

/// Every queue, and what is lent.
pub struct Memory {
    frames: Queue<Frame, FRAMES>,
    told: Queue<LegTold<JOINTS>, 2>,
    orders: Queue<LegOrder<JOINTS>, 2>,
    logged: Queue<LoggedSample<JOINTS>, 8>,
    found: Queue<&'static mut BoardFound, 2>,
    spare: Queue<&'static mut BoardFound, 2>,
    keep: Queue<&'static mut Keep, 2>,
    kept: Queue<&'static mut Keep, 2>,
    accepted: Queue<KeptModel<JOINTS>, 2>,
    results: [BoardFound; 2],
    lent: Keep,
}

/// The servo's end.
pub struct ServoEnd {
    /// What a host wants.
    pub orders: Consumer<'static, LegOrder<JOINTS>>,
    /// What the leg did.
    pub told: Producer<'static, LegTold<JOINTS>>,
    /// Of the log.
    pub logged: Producer<'static, LoggedSample<JOINTS>>,
}

/// The identification's end.
pub struct ThreadEnd {
    found: Producer<'static, &'static mut BoardFound>,
    spare: Consumer<'static, &'static mut BoardFound>,
    accepted: Producer<'static, KeptModel<JOINTS>>,
}

/// The keeper's end.
pub struct KeeperEnd {
    /// Asked for.
    pub keep: Consumer<'static, &'static mut Keep>,
    /// Done.
    pub kept: Producer<'static, &'static mut Keep>,
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
    ports: Ports,
}

/// The board, as a round of the bus has it.
struct Ports {
    wire: Wire,
    frames: Consumer<'static, Frame>,
    told: Consumer<'static, LegTold<JOINTS>>,
    orders: Producer<'static, LegOrder<JOINTS>>,
    logged: Consumer<'static, LoggedSample<JOINTS>>,
    keep: Producer<'static, &'static mut Keep>,
    kept: Consumer<'static, &'static mut Keep>,
    /// Not under way.
    lent: Option<&'static mut Keep>,
}

/// What level 5 works on, once it is there.
pub static BUS: spin::Mutex<Option<&'static mut BusLoop>> = spin::Mutex::new(None);
/// Where level 4 puts frames, once it is there.
pub static FRAMES_IN: spin::Mutex<Option<Producer<'static, Frame>>> = spin::Mutex::new(None);

impl Memory {
    /// Empty, built in its place.
    pub fn place(slot: &mut MaybeUninit<Self>) -> &mut Self {
        fill!(
            slot,
            {
                frames: Queue::new(),
                told: Queue::new(),
                orders: Queue::new(),
                logged: Queue::new(),
                found: Queue::new(),
                spare: Queue::new(),
                keep: Queue::new(),
                kept: Queue::new(),
                accepted: Queue::new(),
                lent: Keep {
                    what: Keeping::All,
                    objects: [KeptNode::NOTHING; JOINTS],
                    generation: 0,
                    done: true,
                },
            },
            { results: |results| each(results, BoardFound::nothing) }
        )
    }

    /// All ends; the frames' first.
    pub fn split(
        &'static mut self,
        station: &'static mut BoardStation,
        wire: Wire,
    ) -> (Producer<'static, Frame>, ServoEnd, ThreadEnd, KeeperEnd, BusLoop) {
        let ((frames_in, frames), (told_in, told)) = (self.frames.split(), self.told.split());
        let ((orders, orders_out), (logged_in, logged)) = (self.orders.split(), self.logged.split());
        let ((found_in, fresh), (spare, spare_out)) = (self.found.split(), self.spare.split());
        let ((keep, keep_out), (kept_in, kept)) = (self.keep.split(), self.kept.split());
        let (accepted_in, accepted) = self.accepted.split();
        let [found, other] = &mut self.results;
        let mut bus = BusLoop {
            station,
            fresh,
            spare,
            found,
            round: BusRound::new(),
            ports: Ports { wire, frames, told, orders, logged, keep, kept, lent: Some(&mut self.lent) },
        };
        let _ = bus.spare.enqueue(other);
        let servo = ServoEnd { orders: orders_out, told: told_in, logged: logged_in };
        let thread = ThreadEnd { found: found_in, spare: spare_out, accepted: accepted_in };
        let keeper = KeeperEnd { keep: keep_out, kept: kept_in, accepted };
        (frames_in, servo, thread, keeper, bus)
    }
}

impl ThreadEnd {
    /// Has the bus answer with other results; whether there was room.
    pub fn publish(&mut self, fill: impl FnOnce(&mut BoardFound)) -> bool {
        let Some(found) = self.spare.dequeue() else { return false };
        fill(found);
        self.found.enqueue(found).is_ok()
    }

    /// A model that may be kept from now on, in the place of one that was not.
    pub fn accept(&mut self, model: KeptModel<JOINTS>) {
        let _ = self.accepted.enqueue(model);
    }
}

impl Mailboxes for Ports {
    fn waiting(&self) -> u32 {
        (self.wire.waiting)()
    }

    fn send(&mut self, mailbox: u32, frame: &Frame) {
        (self.wire.send)(mailbox, frame);
    }

    fn give_up(&mut self) {
        (self.wire.give_up)();
    }
}

impl BusBoard<JOINTS> for Ports {
    fn now_us(&self) -> u64 {
        (self.wire.now_us)()
    }

    fn status(&mut self) -> Controller {
        (self.wire.status)()
    }

    fn frame(&mut self) -> Option<Frame> {
        self.frames.dequeue()
    }

    fn logged(&mut self) -> Option<LoggedSample<JOINTS>> {
        self.logged.dequeue()
    }

    fn is_told(&self) -> bool {
        self.told.ready()
    }

    fn told(&mut self) -> Option<LegTold<JOINTS>> {
        self.told.dequeue()
    }

    fn takes_order(&self) -> bool {
        self.orders.ready()
    }

    fn order(&mut self, order: LegOrder<JOINTS>) {
        let _ = self.orders.enqueue(order);
    }

    fn held(&self) -> bool {
        (self.wire.held)()
    }

    fn set_hosted(&mut self, hosted: bool) {
        HOSTED.store(hosted, Ordering::Relaxed);
    }

    fn kept(&mut self) -> Option<&Keep> {
        let kept = self.kept.dequeue()?;
        Some(self.lent.insert(kept))
    }

    fn lent(&mut self) -> Option<&mut Keep> {
        self.lent.as_deref_mut()
    }

    fn keep(&mut self) {
        if let Some(lent) = self.lent.take() {
            let _ = self.keep.enqueue(lent);
        }
    }
}

impl BusLoop {
    fn run(&mut self) {
        while let Some(fresh) = self.fresh.dequeue() {
            let _ = self.spare.enqueue(core::mem::replace(&mut self.found, fresh));
        }
        self.found.search = [SEARCH[0].get(), SEARCH[1].get()];
        self.round.round(FRAMES, self.station, &mut self.ports, &*self.found);
    }
}

/// Level 5.
#[inline(always)]
pub fn interrupt() {
    if let Some(mut bus) = BUS.try_lock()
        && let Some(bus) = bus.as_mut()
    {
        bus.run();
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
