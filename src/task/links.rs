//! What passes between the levels, and the two ends of every queue.

use heapless::spsc::{Consumer, Producer, Queue};
use static_cell::ConstStaticCell;

use super::leg::JOINTS;
use crate::hal::JointSample;
use crate::leg::{Activity, ControlRequest, DriveState, Finding, LoggedSample, Plan};
use crate::operation::{Order, Outcome};
use crate::trace::Record;

/// What the servo tells the identification, in its order.
#[expect(clippy::large_enum_variant, reason = "queues hold values, and there is no heap to box them on")]
pub enum Told {
    /// A sample of the log.
    Sample(LoggedSample<JOINTS>),
    /// The leg does something else now.
    Activity(Activity),
    /// An identification begins: with this plan and these random numbers, where a host said so.
    Begun(Option<(Plan, u64)>),
    /// The update offered is in use now.
    TookUpdate,
    /// To be passed on.
    Say(Record<JOINTS>),
}

/// Both ends of every queue.
pub struct Links {
    /// To the current loops and back.
    pub orders: [(Producer<'static, Order>, Consumer<'static, Order>); JOINTS],
    /// Back from the current loops.
    pub outcomes: [(Producer<'static, Outcome>, Consumer<'static, Outcome>); JOINTS],
    /// From the current loops to the servo.
    pub samples: [(Producer<'static, JointSample>, Consumer<'static, JointSample>); JOINTS],
    /// To the servo.
    pub requests: (Producer<'static, ControlRequest<JOINTS>>, Consumer<'static, ControlRequest<JOINTS>>),
    /// To the servo.
    pub findings: (Producer<'static, Finding<JOINTS>>, Consumer<'static, Finding<JOINTS>>),
    /// From the servo.
    pub drive: (Producer<'static, DriveState>, Consumer<'static, DriveState>),
    /// From the servo.
    pub told: (Producer<'static, Told>, Consumer<'static, Told>),
    /// From the housekeeping.
    pub notes: (Producer<'static, Record<JOINTS>>, Consumer<'static, Record<JOINTS>>),
}

/// Samples and events on their way to the identification: 190 ms of the log. Closing a motion takes 11 million
/// instructions in one call, 89 ms of a processor that does nothing else.
pub const TOLD: usize = 104;
/// Of them this many are kept free for events.
pub const EVENTS: usize = 8;

macro_rules! queue {
    ($type:ty, $length:expr) => {{
        static QUEUE: ConstStaticCell<Queue<$type, { $length }>> = ConstStaticCell::new(Queue::new());
        QUEUE.take().split()
    }};
}

impl Links {
    /// All queues, empty; once. The long one lies where the board has room for it.
    #[must_use]
    pub fn new(told: &'static mut Queue<Told, TOLD>) -> Self {
        Self {
            orders: [queue!(Order, 3), queue!(Order, 3)],
            outcomes: [queue!(Outcome, 4), queue!(Outcome, 4)],
            samples: [queue!(JointSample, 4), queue!(JointSample, 4)],
            requests: queue!(ControlRequest<JOINTS>, 3),
            findings: queue!(Finding<JOINTS>, 3),
            drive: queue!(DriveState, 8),
            told: told.split(),
            notes: queue!(Record<JOINTS>, 16),
        }
    }
}
