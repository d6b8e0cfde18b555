use super::super::testing::{NOTHING, TestHardware, device, on_a_bus};
use super::super::{HostEnds, Signals};
use super::*;
use crate::bus::device::{LegOrder, LegRequest, LegStatus};
use crate::bus::tests::codes;
use crate::hal::Frame;
use crate::leg::{DriveEvent, DriveState, JointStatus, PowerRequest};

mod bandwidths;
mod flood;

struct Bench {
    device: Device<2, 4>,
    round: BusRound,
    hardware: TestHardware<2>,
    signals: Signals<2>,
    /// The leg's ends.
    host: HostEnds<'static, 2>,
    bus: BusEnds<'static, 2>,
    storage: Handover<StoreJob<2>>,
    drive: DriveState,
    /// The leg takes its orders.
    takes: bool,
    requests: Vec<LegRequest>,
}

impl Bench {
    fn new() -> Self {
        let (hardware, host, bus) = on_a_bus();
        let mut bench = Self {
            device: device(),
            round: BusRound::new(),
            hardware,
            signals: Signals::new(),
            host,
            bus,
            storage: Handover::new(StoreJob::NOTHING),
            drive: DriveState::SwitchOnDisabled,
            takes: true,
            requests: Vec::new(),
        };
        bench.run(4);
        bench.send(0, &[1, 0]);
        bench
    }

    /// Runs one round only.
    fn round(&mut self) {
        let Self { device, bus, storage, signals, hardware, .. } = self;
        self.round.round(device, bus, storage, signals, hardware, &NOTHING);
    }

    /// Runs a tick of the leg and a round; then the mailboxes are sent.
    fn run(&mut self, rounds: u32) {
        for _ in 0..rounds {
            if self.takes
                && let Some(request) = self.host.orders.dequeue().and_then(|order| order.request)
            {
                self.requests.push(request);
                if let LegRequest::Power(power) = request {
                    self.drive = self.drive.after(DriveEvent::Requested(power), 4);
                }
            }
            self.drive = self.drive.after(DriveEvent::Tick, 4);
            let joint = JointStatus { drive: self.drive, ..JointStatus::NONE };
            let status =
                LegStatus { joints: [joint; 2], held: true, blocked: false, rests: false, ..LegStatus::NONE };
            // The previous report may still wait.
            let _ = self.host.status.enqueue(status);
            self.hardware.now_us += 500;
            self.round();
            self.hardware.empty_mailboxes();
        }
    }

    /// Frames arrive with the next round.
    fn arrive(&mut self, frames: &[Frame]) {
        self.hardware.reception().arriving.extend(frames);
    }

    fn unheard(&self) -> usize {
        self.hardware.reception().unheard()
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.arrive(&[Frame::new(id, data)]);
        self.run(8);
    }

    fn word(&mut self, word: u8) {
        [0x601, 0x602].into_iter().for_each(|id| self.send(id, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]));
    }

    fn enable(&mut self) {
        [6, 7, 15].into_iter().for_each(|word| self.word(word));
    }

    /// Codes of both nodes' emergency messages since the last call, the first node's first.
    fn emergencies(&mut self) -> Vec<(u16, u16)> {
        let sent = core::mem::take(&mut self.hardware.can.sent);
        let mut emergencies = codes(sent.iter().map(|(frame, _, _)| frame));
        emergencies.sort_by_key(|(id, _)| *id);
        emergencies
    }
}

const CANCEL: [u8; 8] = [0x2F, 0x00, 0x21, 1, 2, 0, 0, 0];

#[test]
fn a_waiting_order_is_not_overwritten_and_no_request_is_lost() {
    let mut bench = Bench::new();
    bench.enable();
    assert_eq!((bench.drive, bench.signals.is_hosted()), (DriveState::OperationEnabled, true));
    bench.requests.clear();
    bench.run(2);
    bench.takes = false;
    // A disabling step while the leg takes no order; then another command.
    bench.word(7);
    bench.send(0x601, &CANCEL);
    bench.run(20);
    assert_eq!(bench.requests, []);
    bench.takes = true;
    bench.run(20);
    assert_eq!(bench.requests, [LegRequest::Power(PowerRequest::DisableOperation), LegRequest::Cancel]);
    // Again, behind an order without a request.
    bench.requests.clear();
    bench.takes = false;
    bench.run(4);
    bench.send(0x601, &CANCEL);
    bench.takes = true;
    bench.run(20);
    assert_eq!(bench.requests, [LegRequest::Cancel]);
}

#[test]
fn a_leg_without_reports_is_ordered_only_by_frames() {
    let mut bench = Bench::new();
    bench.enable();
    let quiet = |bench: &mut Bench| {
        bench.hardware.now_us += 500;
        bench.host.orders.dequeue();
        bench.round();
        bench.host.orders.dequeue()
    };
    quiet(&mut bench);
    assert_eq!(quiet(&mut bench), None);
    // A torque that node 1's controlword halts.
    bench.arrive(&[Frame::new(0x201, &[0x0F, 0x01])]);
    let order = quiet(&mut bench).expect("an order");
    assert_eq!(order.commands.expect("a host has the drive").map(|command| command.halt), [true, false]);
    assert_eq!(quiet(&mut bench), None);
}

#[test]
fn an_overrun_is_reported_and_stops_a_hosted_leg() {
    let mut bench = Bench::new();
    bench.enable();
    bench.emergencies();
    bench.requests.clear();
    bench.hardware.can.overrun = true;
    bench.run(8);
    assert_eq!(bench.requests, [LegRequest::Power(PowerRequest::QuickStop)]);
    assert_eq!(bench.emergencies(), [(0x81, 0x8110), (0x81, 0), (0x82, 0x8110), (0x82, 0)]);
}

#[test]
fn an_overrun_of_a_passive_controller_fills_no_mailboxes() {
    let mut bench = Bench::new();
    bench.enable();
    bench.hardware.can.controller = Controller::Passive;
    bench.run(1);
    bench.hardware.can.unplugged = true;
    for round in 0..40 {
        bench.hardware.can.overrun = round % 3 == 0;
        bench.run(1);
        assert!(bench.hardware.mailboxes_waiting().count_ones() <= 1);
    }
}

#[test]
fn bus_off_is_reported_once_and_nothing_is_sent() {
    let mut bench = Bench::new();
    bench.enable();
    bench.emergencies();
    bench.requests.clear();
    bench.hardware.can.controller = Controller::Off;
    bench.run(50);
    assert_eq!(bench.hardware.can.sent, []);
    bench.hardware.can.controller = Controller::Active;
    bench.run(8);
    assert_eq!(bench.requests, [LegRequest::Power(PowerRequest::QuickStop)]);
    assert_eq!(bench.emergencies(), [(0x81, 0x8140), (0x81, 0), (0x82, 0x8140), (0x82, 0)]);
}

#[test]
fn a_round_takes_a_limited_number_of_frames() {
    let mut bench = Bench::new();
    bench.arrive(&[Frame::new(0x80, &[]); 40]);
    bench.run(1);
    assert_eq!(bench.unheard(), 7);
}

#[test]
fn one_store_runs_at_a_time_and_its_result_is_reported() {
    let save = [0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e'];
    let window = |bench: &mut Bench, value: u8| {
        bench.send(0x601, &[0x23, 0x65, 0x60, 0, value, 0, 0, 0]);
        bench.send(0x602, &save);
    };
    let given = |bench: &Bench| bench.storage.given().expect("a store").clone();
    let end = |bench: &Bench, done: bool| {
        let mut store = bench.storage.given().expect("a store");
        (store.done, store.generation) = (done, 5);
        drop(store);
        bench.storage.return_value();
    };
    let mut bench = Bench::new();
    bench.emergencies();
    window(&mut bench, 11);
    let first = given(&bench);
    assert_eq!(first.what, StoreCommand::All);
    // A second request waits until the first ends.
    window(&mut bench, 22);
    assert_eq!(given(&bench).objects, first.objects);
    end(&bench, true);
    bench.run(1);
    assert_ne!(given(&bench).objects, first.objects);
    assert_eq!((bench.device.generation(), given(&bench).generation), (5, 5));
    end(&bench, false);
    bench.run(8);
    let mut codes = bench.emergencies();
    codes.retain(|(id, _)| *id == 0x81);
    assert_eq!((codes.first(), codes.last()), (Some(&(0x81, 0xFF0D)), Some(&(0x81, 0x5530))), "{codes:x?}");
    assert!(bench.storage.given().is_none() && bench.storage.idle().is_some());
    // The flash refused the second: a reset restores the first.
    bench.send(0, &[129, 0]);
    bench.hardware.can.sent.clear();
    bench.send(0x601, &[0x40, 0x65, 0x60, 0, 0, 0, 0, 0]);
    let answer = bench.hardware.can.sent.iter().find(|(frame, _, _)| frame.id() == 0x581).expect("an answer");
    assert_eq!(answer.0.data()[4..], [11, 0, 0, 0]);
}
