//! Cost of a board's bus rounds on a full wire.
//!
//! The interrupt of level 5 is counted with its queues, without the controller's registers.
//!
//! Each received frame raises a round, each sent frame another, and every second servo tick a third. A wire
//! at 1 Mbit/s limits the number: frames without data have 47 bits, those of eight bytes 111, stuff bits not
//! counted. The frames that arrive during a long round follow it at once.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use heapless::spsc::Producer;

use scarab::bus::device::{Device, LegStatus};
use scarab::bus::drive::{AxisConstants, Mode};
use scarab::bus::identification::ResultsCopy;
use scarab::bus::{Frame, Identity, LONGEST, NmtState, NodeId, stored_objects, write_stored};
use scarab::leg::{DriveState, JointStatus, Plan};
use scarab::operation::{BusEnds, BusQueues, BusRound, Handover, HostEnds, Signals, StoreJob};
use scarab::units::{Ampere, NewtonMetre};

use crate::account::percent;
use crate::counter::{self, Tally, count, heading};
use crate::machine::{Machine, bits};

/// Frames of each kind.
const COUNT: usize = 2000;
/// Time after the boot-up messages.
const START_US: u64 = 10_000;
/// Interval of the servo's reports: every second tick.
const STATUS_US: u64 = 500;
/// With this share a fifth of the processor remains for housekeeping and the search.
const MOST_PERCENT: f32 = 43.0;
/// A device with its queues. The servo at their other end takes its orders, and reports on request.
struct Bench<'a> {
    device: Device<2, 16>,
    found: ResultsCopy<2, 1>,
    round: BusRound,
    frames: Producer<'a, Frame>,
    ends: BusEnds<'a, 2>,
    servo: HostEnds<'a, 2>,
    storage: Handover<StoreJob<2>>,
    signals: Signals<2>,
    machine: Machine,
    lost: u32,
    now_us: u64,
    tally: Tally,
    may_lose: bool,
}

impl<'a> Bench<'a> {
    fn new(queues: &'a mut BusQueues<2>) -> Option<Self> {
        let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
        let constants = AxisConstants {
            rated_torque: NewtonMetre(40.0),
            rated_current: Ampere(20.0),
            modes,
            ..AxisConstants::UNKNOWN
        };
        let own = [NodeId::new(1)?, NodeId::new(2)?];
        let device = Device::new(own, Identity::scarab(1, "emulated"), [constants; 2], Plan::OneTime, 1);
        let (frames, servo, ends, _) = queues.split();
        let mut bench = Self {
            device,
            found: ResultsCopy::nothing(),
            round: BusRound::new(),
            frames,
            ends,
            servo,
            storage: Handover::new(StoreJob::NOTHING),
            signals: Signals::new(),
            machine: Machine::default(),
            lost: 0,
            now_us: START_US,
            tally: Tally::default(),
            may_lose: false,
        };
        bench.receive(None);
        bench.receive(Some(Frame::new(0, &[1, 0])));
        let operational = bench.device.nodes().iter().all(|node| node.state() == NmtState::Operational);
        operational.then_some(bench)
    }

    /// Runs one round; returns whether a frame was sent.
    fn receive(&mut self, frame: Option<Frame>) -> bool {
        self.machine.sent = 0;
        if let Some(frame) = frame {
            self.lost += u32::from(self.frames.enqueue(frame).is_err());
        }
        (self.machine.now_us, self.machine.begun) = (self.now_us, counter::now());
        let Self { device, found, round, ends, storage, signals, machine, .. } = self;
        let (instructions, ()) = count(|| round.round(device, ends, storage, signals, machine, &*found));
        self.tally.push(instructions);
        black_box(self.servo.orders.dequeue());
        self.machine.sent > 0
    }

    /// Runs these frames back to back on a full wire; frames that are sent raise further rounds.
    fn run(&mut self, name: &str, frames: &[Frame]) -> bool {
        (self.tally, self.machine.bits, self.lost) = (Tally::default(), 0, 0);
        let (begun_us, mut bits_received, mut half_ms) = (self.now_us, 0, 0);
        let joint = JointStatus { drive: DriveState::OperationEnabled, ..JointStatus::NONE };
        let mut number = 0;
        for frame in frames.iter().cycle().take(COUNT) {
            bits_received += bits(frame);
            self.now_us = begun_us + u64::from(bits_received + self.machine.bits);
            let mut sends = self.receive(Some(*frame));
            while sends {
                self.now_us = begun_us + u64::from(bits_received + self.machine.bits);
                sends = self.receive(None);
            }
            number += 1;
            if self.now_us / STATUS_US > half_ms {
                half_ms = self.now_us / STATUS_US;
                let status = LegStatus {
                    joints: [joint; 2],
                    held: true,
                    blocked: false,
                    rests: false,
                    ..LegStatus::NONE
                };
                let _ = self.servo.status.enqueue(status);
                self.receive(None);
            }
        }
        let seconds = (self.now_us - begun_us) as f32 * 1e-6;
        let per_second = |count: u32| (count as f32 / seconds) as u32;
        let share = percent(self.tally.mean(), per_second(self.tally.number()));
        let is_within = share <= MOST_PERCENT && (self.lost == 0 || self.may_lose);
        hprintln!(
            "{:<40} {:>8} {:>8} {:>6.1}  {}",
            name,
            per_second(number),
            self.tally.most(),
            share,
            if is_within { "kept" } else { "MISSED" }
        );
        is_within
    }
}

/// Prints the table; returns whether all bounds are met, `None` if the device cannot be created.
#[inline(never)]
pub fn report() -> Option<bool> {
    hprintln!(
        "\nboth nodes on a full wire, goal {} %: frames a second, worst round, share of the processor",
        MOST_PERCENT
    );
    let read = [0x40, 0x41, 0x60, 0, 0, 0, 0, 0];
    let all = [
        ("of no node, without data", Frame::new(0x7F0, &[])),
        ("of no node, of eight bytes", Frame::new(0x7F0, &[0; 8])),
        ("SYNC", Frame::new(0x80, &[])),
        ("a PDO that is too short", Frame::new(0x301, &[])),
        ("targets", Frame::new(0x301, &[1, 2, 3, 4])),
        ("heartbeats", Frame::new(0x770, &[5])),
        ("network management, operational", Frame::new(0, &[1, 0])),
        ("network management, reset", Frame::new(0, &[129, 0])),
        ("SDO, answered", Frame::new(0x601, &read)),
    ];
    let mut is_within = true;
    for (name, frame) in all {
        is_within &= Bench::new(&mut BusQueues::new())?.run(name, &[frame]);
    }
    let mixed = [all[2].1, all[4].1, Frame::new(0x302, &[1, 2, 3, 4]), all[8].1];
    is_within &= Bench::new(&mut BusQueues::new())?.run("SYNC, targets, SDO", &mixed);
    let mut queues = BusQueues::new();
    let mut bench = Bench::new(&mut queues)?;
    full(&mut bench);
    // Reception stops for over a millisecond; frames without space are reported as lost (8110).
    bench.may_lose = true;
    is_within &= bench.run("reset, records of 400 bytes", &[all[7].1]);

    heading("a round that keeps both nodes' objects");
    let mut queues = BusQueues::new();
    let mut bench = Bench::new(&mut queues)?;
    bench.tally = Tally::default();
    bench.receive(Some(Frame::new(0x601, &[0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e'])));
    bench.tally.print("save");
    Some(is_within & bench.storage.given().is_some())
}

/// Fills both nodes' stored objects up to a record's capacity, with any values.
fn full(bench: &mut Bench<'_>) {
    let mut record = [0; LONGEST];
    let mut length = 0;
    for (object, row) in stored_objects() {
        let Some(room) = record.get_mut(length..) else { break };
        // Node numbers stay unchanged.
        let Ok(size) = write_stored(object, row.default, room) else { break };
        length += if object.index == 0x2001 { 0 } else { size };
    }
    for joint in 0..2 {
        bench.device.recall(joint, record.get(..length).unwrap_or_default());
    }
    bench.now_us += 10_000;
    bench.receive(None);
}
