//! Queues between the levels, as plain values with one producer and one consumer each.
//!
//! The board splits them once, from statics; a simulation owns, clones and splits them for each level that it
//! runs. No level waits for another: a full queue takes nothing more.
//!
//! | from | to | content |
//! | --- | --- | --- |
//! | housekeeping | current | [`Order`] |
//! | current | housekeeping | [`Outcome`] |
//! | current | servo | joint samples, one in six periods |
//! | housekeeping | servo | requests of the operator |
//! | servo | housekeeping | drive states |
//! | servo | identification | [`LegEvent`], in order |
//! | identification | servo | findings |
//! | housekeeping | identification | records |
//! | servo | assist | sessions, their samples |
//! | assist | servo | torques |
//! | housekeeping | storage | calibrations that passed |
//! | bus interrupt | bus | received frames |
//! | bus | servo | [`LegOrder`] |
//! | servo | bus | [`LegStatus`], logged samples |

use core::sync::atomic::{Ordering, fence};

use heapless::spsc::{Consumer, Producer, Queue};

use super::axis_state::{Order, Outcome};
use crate::bus::device::{LegOrder, LegStatus};
use crate::hal::{Frame, JointSample};
use crate::leg::{
    Activity, AssistSession, AssistTorque, ControlRequest, DriveState, Finding, LogSample, LoggedSample,
    Plan, StoredCalibration, Wearing,
};
use crate::trace::Record;

/// Axis that passed its calibration, and the part of the calibration that can be stored.
pub type Calibrated = (usize, Option<StoredCalibration>);

/// Event from the servo to the identification.
#[derive(Clone, Debug, PartialEq)]
pub enum LegEvent<const N: usize> {
    /// Sample of the log.
    Sample(LoggedSample<N>),
    /// The leg's activity has changed.
    Activity(Activity),
    /// An identification begins; with plan and seed if a host gave them, and what is known about the leg.
    Begun(Option<(Plan, u64)>, Option<Wearing>),
    /// The offered update is now in use.
    TookUpdate,
    /// The result of the identification was taken; an accepted model is now in use.
    TookResult,
    /// Record for the trace.
    Record(Record<N>),
}

/// Length of the event queue: 190 ms of the log. Closing a motion takes 11 million instructions in one call,
/// which is 89 ms of an otherwise idle processor.
pub(crate) const EVENTS: usize = 104;
/// Entries of it that samples leave free for other events.
pub(crate) const RESERVED: usize = 8;
/// Length of the queue of received frames: 1.5 ms of the shortest at 1 Mbit/s.
pub(crate) const FRAMES: usize = 33;

/// Length of the queue of samples to the assistance: three wait at most.
pub(crate) const SAMPLES: usize = 4;

/// Uses the first item of a queue where it lies, and removes it. A large item that is returned instead is
/// copied three times. The producer sees the slot occupied until `take` returns.
pub(super) fn take_first<T, R>(queue: &mut Consumer<'_, T>, take: impl FnOnce(&T) -> R) -> Option<R> {
    if !queue.ready() {
        return None;
    }
    // The queue looks at its indices without ordering there.
    fence(Ordering::Acquire);
    let taken = take(queue.peek()?);
    drop_first(queue);
    Some(taken)
}

/// Removes the first item. Not inlined, so that the compiler drops the item instead of copying it out.
#[inline(never)]
fn drop_first<T>(queue: &mut Consumer<'_, T>) {
    drop(queue.dequeue());
}

/// Queue from the servo to the identification, separate from [`Queues`] because of its size.
pub type EventQueue<const N: usize> = Queue<LegEvent<N>, EVENTS>;

/// All queues of a board with `N` axes except the events' and the bus'.
#[derive(Clone, Debug, PartialEq)]
pub struct Queues<const N: usize> {
    orders: [Queue<Order, 3>; N],
    outcomes: [Queue<Outcome, 4>; N],
    samples: [Queue<JointSample, 4>; N],
    requests: Queue<ControlRequest, 3>,
    findings: Queue<Finding<N>, 3>,
    drive: Queue<DriveState, 8>,
    notes: Queue<Record<N>, 15>,
    calibrated: Queue<Calibrated, 4>,
}

/// Ends of the current loops.
pub struct CurrentEnds<'a, const N: usize> {
    /// Orders to each axis.
    pub(crate) orders: [Consumer<'a, Order>; N],
    /// Outcomes of each axis.
    pub(crate) outcomes: [Producer<'a, Outcome>; N],
    /// Samples of each joint for the servo.
    pub(crate) samples: [Producer<'a, JointSample>; N],
}

/// Ends of the servo; those of the bus where there is one.
pub struct ServoEnds<'a, const N: usize> {
    /// Samples of each joint.
    pub(crate) samples: [Consumer<'a, JointSample>; N],
    pub(super) requests: Consumer<'a, ControlRequest>,
    pub(super) findings: Consumer<'a, Finding<N>>,
    pub(super) drive: Producer<'a, DriveState>,
    pub(super) events: Producer<'a, LegEvent<N>>,
    /// Ends towards the assistance, where there is one.
    pub assist: Option<ServoAssistEnds<'a, N>>,
    /// Ends towards the bus.
    pub host: Option<HostEnds<'a, N>>,
}

/// Ends of the housekeeping.
pub struct HousekeepingEnds<'a, const N: usize> {
    pub(super) orders: [Producer<'a, Order>; N],
    pub(super) outcomes: [Consumer<'a, Outcome>; N],
    /// Requests to the servo.
    pub(crate) requests: Producer<'a, ControlRequest>,
    /// Drive states of the servo.
    pub(crate) drive: Consumer<'a, DriveState>,
    /// Records for the trace.
    pub(crate) notes: Producer<'a, Record<N>>,
    pub(super) calibrated: Producer<'a, Calibrated>,
}

/// Ends of the identification.
pub struct IdentificationEnds<'a, const N: usize> {
    pub(super) events: Consumer<'a, LegEvent<N>>,
    pub(super) findings: Producer<'a, Finding<N>>,
    /// Records of the housekeeping.
    pub notes: Consumer<'a, Record<N>>,
}

/// Both ends of every queue.
pub struct Ends<'a, const N: usize> {
    /// Level 0.
    pub current: CurrentEnds<'a, N>,
    /// Level 1.
    pub servo: ServoEnds<'a, N>,
    /// Level 6.
    pub housekeeping: HousekeepingEnds<'a, N>,
    /// Thread level.
    pub identification: IdentificationEnds<'a, N>,
    /// Calibrations for the storage, thread level.
    pub calibrated: Consumer<'a, Calibrated>,
}

/// Splits each queue and returns the ends in two arrays.
fn split_all<'a, T, const L: usize, const N: usize>(
    queues: &'a mut [Queue<T, L>; N],
) -> ([Producer<'a, T>; N], [Consumer<'a, T>; N]) {
    let mut consumers = [const { None }; N];
    let mut slots = consumers.iter_mut();
    let producers = queues.each_mut().map(|queue| {
        let (producer, consumer) = queue.split();
        if let Some(slot) = slots.next() {
            *slot = Some(consumer);
        }
        producer
    });
    (producers, consumers.map(|consumer| consumer.expect("as many places as queues")))
}

impl<const N: usize> Queues<N> {
    /// Creates empty queues.
    pub const fn new() -> Self {
        Self {
            orders: [const { Queue::new() }; N],
            outcomes: [const { Queue::new() }; N],
            samples: [const { Queue::new() }; N],
            requests: Queue::new(),
            findings: Queue::new(),
            drive: Queue::new(),
            notes: Queue::new(),
            calibrated: Queue::new(),
        }
    }

    /// Splits every queue. A board with a bus then sets the servo's ends towards it.
    pub fn split<'a>(&'a mut self, events: &'a mut EventQueue<N>) -> Ends<'a, N> {
        let (give_orders, take_orders) = split_all(&mut self.orders);
        let (give_outcomes, take_outcomes) = split_all(&mut self.outcomes);
        let (give_samples, take_samples) = split_all(&mut self.samples);
        let (give_request, take_request) = self.requests.split();
        let (give_finding, take_finding) = self.findings.split();
        let (give_drive, take_drive) = self.drive.split();
        let (give_note, take_note) = self.notes.split();
        let (give_calibrated, calibrated) = self.calibrated.split();
        let (give_event, take_event) = events.split();
        Ends {
            current: CurrentEnds { orders: take_orders, outcomes: give_outcomes, samples: give_samples },
            servo: ServoEnds {
                samples: take_samples,
                requests: take_request,
                findings: take_finding,
                drive: give_drive,
                events: give_event,
                assist: None,
                host: None,
            },
            housekeeping: HousekeepingEnds {
                orders: give_orders,
                outcomes: take_outcomes,
                requests: give_request,
                drive: take_drive,
                notes: give_note,
                calibrated: give_calibrated,
            },
            identification: IdentificationEnds {
                events: take_event,
                findings: give_finding,
                notes: take_note,
            },
            calibrated,
        }
    }

    /// Ends of the current loops, for a simulation.
    #[cfg(not(target_os = "none"))]
    #[must_use]
    pub fn current(&mut self) -> CurrentEnds<'_, N> {
        CurrentEnds {
            orders: self.orders.each_mut().map(|queue| queue.split().1),
            outcomes: self.outcomes.each_mut().map(|queue| queue.split().0),
            samples: self.samples.each_mut().map(|queue| queue.split().0),
        }
    }

    /// Replaces the samples that wait for the servo, for faults injected between the current loops and the
    /// servo.
    #[cfg(not(target_os = "none"))]
    pub fn set_samples(&mut self, samples: &[JointSample; N]) {
        for (queue, sample) in self.samples.iter_mut().zip(samples) {
            while queue.dequeue().is_some() {}
            let _ = queue.enqueue(*sample);
        }
    }

    /// Newest sample of a joint that waits for the servo.
    #[cfg(not(target_os = "none"))]
    pub fn newest_sample(&self, joint: usize) -> Option<JointSample> {
        self.samples.get(joint).and_then(|queue| queue.iter().last().copied())
    }

    /// Outcomes of an axis that wait for the housekeeping.
    #[cfg(not(target_os = "none"))]
    pub fn outcomes(&self, axis: usize) -> impl Iterator<Item = &Outcome> {
        self.outcomes.get(axis).into_iter().flat_map(Queue::iter)
    }

    /// Requests that wait for the servo's tick.
    #[cfg(not(target_os = "none"))]
    #[must_use]
    pub fn requests(&mut self) -> &mut Queue<ControlRequest, 3> {
        &mut self.requests
    }
}

/// Queues of the assistance.
#[derive(Clone, Debug, PartialEq)]
pub struct AssistQueues<const N: usize> {
    sessions: Queue<AssistSession<N>, 2>,
    samples: Queue<LogSample<N>, SAMPLES>,
    torques: Queue<AssistTorque<N>, SAMPLES>,
}

/// The servo's ends towards the assistance.
pub struct ServoAssistEnds<'a, const N: usize> {
    pub(super) sessions: Producer<'a, AssistSession<N>>,
    pub(super) samples: Producer<'a, LogSample<N>>,
    pub(super) torques: Consumer<'a, AssistTorque<N>>,
}

/// Ends of the assistance, level 5.
pub struct AssistEnds<'a, const N: usize> {
    pub(super) sessions: Consumer<'a, AssistSession<N>>,
    pub(super) samples: Consumer<'a, LogSample<N>>,
    pub(super) torques: Producer<'a, AssistTorque<N>>,
}

impl<const N: usize> AssistQueues<N> {
    /// Creates empty queues.
    pub const fn new() -> Self {
        Self { sessions: Queue::new(), samples: Queue::new(), torques: Queue::new() }
    }

    /// Splits every queue.
    #[must_use]
    pub fn split(&mut self) -> (ServoAssistEnds<'_, N>, AssistEnds<'_, N>) {
        let (give_session, sessions) = self.sessions.split();
        let (give_sample, samples) = self.samples.split();
        let (torques, take_torque) = self.torques.split();
        let servo = ServoAssistEnds { sessions: give_session, samples: give_sample, torques: take_torque };
        (servo, AssistEnds { sessions, samples, torques })
    }
}

/// Capacity for the bytes of a new image: what the flash takes in 2 ms.
const PROGRAM: usize = 512;

/// Queues of the bus.
#[derive(Clone, Debug, PartialEq)]
pub struct BusQueues<const N: usize> {
    frames: Queue<Frame, FRAMES>,
    status: Queue<LegStatus<N>, 2>,
    orders: Queue<LegOrder<N>, 2>,
    logged: Queue<LoggedSample<N>, 8>,
    program: Queue<u8, PROGRAM>,
}

/// The servo's ends towards the bus.
pub struct HostEnds<'a, const N: usize> {
    /// Orders of the bus.
    pub(crate) orders: Consumer<'a, LegOrder<N>>,
    /// Reports of the leg.
    pub(crate) status: Producer<'a, LegStatus<N>>,
    pub(super) logged: Producer<'a, LoggedSample<N>>,
}

/// Ends of the bus, level 5.
pub struct BusEnds<'a, const N: usize> {
    pub(super) frames: Consumer<'a, Frame>,
    pub(super) orders: Producer<'a, LegOrder<N>>,
    pub(super) status: Consumer<'a, LegStatus<N>>,
    pub(super) logged: Consumer<'a, LoggedSample<N>>,
    pub(super) program: Producer<'a, u8>,
}

impl<const N: usize> BusQueues<N> {
    /// Creates empty queues.
    pub const fn new() -> Self {
        Self {
            frames: Queue::new(),
            status: Queue::new(),
            orders: Queue::new(),
            logged: Queue::new(),
            program: Queue::new(),
        }
    }

    /// Splits every queue; the end of received frames is level 4's, the last one the storage's.
    #[must_use]
    pub fn split(&mut self) -> (Producer<'_, Frame>, HostEnds<'_, N>, BusEnds<'_, N>, Consumer<'_, u8>) {
        let (frames_in, frames) = self.frames.split();
        let (give_status, status) = self.status.split();
        let (orders, take_order) = self.orders.split();
        let (give_logged, logged) = self.logged.split();
        let servo = HostEnds { orders: take_order, status: give_status, logged: give_logged };
        let (program, bytes) = self.program.split();
        (frames_in, servo, BusEnds { frames, orders, status, logged, program }, bytes)
    }
}
