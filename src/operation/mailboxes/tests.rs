use super::super::testing::{NOTHING, TestHardware, device};
use super::*;
use crate::bus::tests::codes;

struct Bench {
    device: Device<2, 4>,
    transmitter: TxScheduler,
    hardware: TestHardware<2>,
    controller: Controller,
}

const ROUND_US: u64 = 500;

impl Bench {
    fn at_the_start(controller: Controller) -> Self {
        let (transmitter, hardware) = (TxScheduler::default(), TestHardware::new());
        Self { device: device(), transmitter, hardware, controller }
    }

    /// Both nodes operational, their first PDO sent every 2 ms.
    fn new() -> Self {
        let mut bench = Self::at_the_start(Controller::Active);
        bench.run(4);
        let (asynchronous, every_2_ms) = ((2_u8, 255_u8), (5_u8, 2_u8));
        for (node, (sub, value)) in
            [1, 2].into_iter().flat_map(|node| [(node, asynchronous), (node, every_2_ms)])
        {
            let size = if sub == 2 { 0x2F } else { 0x2B };
            bench.receive(&Frame::new(0x600 + node, &[size, 0x00, 0x18, sub, value, 0, 0, 0]));
            bench.run(2);
        }
        bench.receive(&Frame::new(0, &[1, 0]));
        bench.run(40);
        assert!(bench.leaving(0x181).count() > 5 && bench.leaving(0x182).count() > 5);
        bench.hardware.can.sent.clear();
        bench
    }

    fn receive(&mut self, frame: &Frame) {
        self.device.receive(frame, self.hardware.now_us, None, &NOTHING);
    }

    fn set(&mut self, controller: Controller, unplugged: bool) {
        (self.controller, self.hardware.can.unplugged) = (controller, unplugged);
        self.device.on_controller(controller, &NOTHING);
    }

    fn round(&mut self) {
        self.hardware.now_us += ROUND_US;
        let now_us = self.hardware.now_us;
        self.transmitter.fill(&mut self.hardware, self.controller, now_us, &mut self.device, &NOTHING);
        self.hardware.empty_mailboxes();
    }

    fn run(&mut self, rounds: u32) {
        (0..rounds).for_each(|_| self.round());
    }

    fn leaving(&self, id: u16) -> impl Iterator<Item = Frame> {
        self.hardware.can.sent.iter().map(|(frame, _, _)| *frame).filter(move |frame| frame.id() == id)
    }

    /// Codes of a node's emergency messages that left.
    fn emergencies(&self, node: u16) -> Vec<u16> {
        let sent = self.hardware.can.sent.iter().map(|(frame, _, _)| frame);
        codes(sent).into_iter().filter(|(id, _)| *id == 0x80 + node).map(|(_, code)| code).collect()
    }
}

#[test]
fn after_a_pulled_plug_frames_are_new_and_emergencies_complete() {
    // Duration without plug in rounds of half a millisecond; the controller is passive after 3 ms.
    for rounds in (1..200).step_by(7) {
        let mut bench = Bench::new();
        bench.hardware.can.unplugged = true;
        bench.run(6);
        assert_eq!(bench.hardware.can.waiting.len(), 3);
        bench.set(Controller::Passive, true);
        bench.run(rounds);
        let back_us = bench.hardware.now_us;
        bench.hardware.can.unplugged = false;
        bench.run(20);
        bench.set(Controller::Active, false);
        bench.run(20);
        for (frame, given_us, left_us) in &bench.hardware.can.sent {
            let age_us = left_us - given_us;
            // Nothing is aborted before the controller is passive: 3 ms more.
            let patience_us = PATIENCE_US + ROUND_US + 6 * ROUND_US;
            assert!(age_us <= patience_us, "{rounds}: {frame:?} after {age_us} us");
            assert!(*left_us > back_us);
        }
        assert_eq!([1, 2].map(|node| bench.emergencies(node)), [[0x8120, 0]; 2].map(Vec::from), "{rounds}");
        // Both nodes send again as before.
        assert!(bench.leaving(0x181).count() > 3 && bench.leaving(0x182).count() > 3, "{rounds}");
    }
}

#[test]
fn a_passive_controller_that_still_sends_loses_nothing() {
    let mut bench = Bench::new();
    bench.set(Controller::Passive, false);
    bench.run(400);
    assert_eq!([1, 2].map(|node| bench.emergencies(node)), [[0x8120]; 2].map(Vec::from));
    assert_eq!(bench.hardware.can.aborted, 0);
    // 200 ms, one frame every 2 ms from each node.
    assert!(bench.leaving(0x181).count() > 95 && bench.leaving(0x182).count() > 95);
}

#[test]
fn a_delayed_boot_up_message_leaves_when_the_plug_is_in() {
    let mut bench = Bench::at_the_start(Controller::Passive);
    bench.hardware.can.unplugged = true;
    bench.run(300);
    assert!(bench.hardware.can.aborted > 10);
    bench.hardware.can.unplugged = false;
    bench.run(20);
    assert_eq!([0x701, 0x702].map(|id| bench.leaving(id).count()), [1, 1]);
}

#[test]
fn nothing_waits_in_a_controller_that_is_off() {
    let mut bench = Bench::new();
    bench.hardware.can.unplugged = true;
    bench.run(20);
    assert_eq!(bench.hardware.can.waiting.len(), 3);
    bench.set(Controller::Off, true);
    for _ in 0..50 {
        bench.round();
        assert!(bench.hardware.can.waiting.is_empty());
    }
    bench.set(Controller::Active, false);
    let back_us = bench.hardware.now_us;
    bench.run(20);
    assert!(bench.hardware.can.sent.iter().all(|(_, given_us, _)| *given_us > back_us));
    assert_eq!(bench.emergencies(1), [0x8140, 0]);
}

#[test]
fn nodes_send_in_turn() {
    let mut bench = Bench::new();
    // Both have a frame to send in every round, and one mailbox is free.
    bench.hardware.can.unplugged = true;
    bench.run(40);
    let mut order = Vec::new();
    for _ in 0..8 {
        bench.hardware.can.waiting.truncate(2);
        bench.hardware.now_us += 4 * ROUND_US;
        bench.round();
        order.extend(bench.hardware.can.waiting.get(2).map(|(_, frame, _)| frame.id() & 0x7F));
    }
    assert!(order == [1, 2, 1, 2, 1, 2, 1, 2] || order == [2, 1, 2, 1, 2, 1, 2, 1], "{order:?}");
    assert_eq!(bench.hardware.can.most, 3);
}

#[test]
fn a_waiting_emergency_is_sent_in_any_controller_state() {
    for controller in [Controller::Passive, Controller::Off] {
        let mut bench = Bench::new();
        // PDOs wait in two mailboxes, one node's storage message in the third.
        bench.hardware.can.unplugged = true;
        bench.run(1);
        bench.hardware.can.waiting.truncate(2);
        bench.device.storing(crate::bus::Storing::Busy);
        bench.run(1);
        assert!(bench.hardware.can.waiting.iter().any(|(_, frame, _)| frame.id() & 0x780 == 0x80));
        bench.set(controller, true);
        bench.run(60);
        bench.hardware.can.unplugged = false;
        bench.set(Controller::Active, false);
        bench.run(20);
        let code = if controller == Controller::Off { 0x8140 } else { 0x8120 };
        let mut emergencies = [1, 2].map(|node| bench.emergencies(node));
        emergencies.iter_mut().for_each(|codes| codes.truncate(2));
        assert_eq!(emergencies, [[0xFF0D, code]; 2].map(Vec::from), "{controller:?}");
    }
}

#[test]
fn an_emergency_with_another_identifier_is_sent_again_too() {
    let mut bench = Bench::new();
    bench.receive(&Frame::new(0x601, &[0x23, 0x14, 0x10, 0, 0x10, 0x03, 0, 0]));
    bench.run(4);
    bench.hardware.can.unplugged = true;
    bench.set(Controller::Passive, true);
    bench.run(300);
    bench.hardware.can.unplugged = false;
    bench.run(20);
    assert_eq!(bench.leaving(0x310).count(), 1);
}

#[test]
fn repeated_emergencies_are_in_order_from_any_mailbox() {
    let mut bench = Bench::new();
    bench.hardware.can.unplugged = true;
    bench.run(1);
    bench.hardware.can.waiting.truncate(2);
    // The error is in the last mailbox; its end in the first, which is free by then.
    bench.device.storing(crate::bus::Storing::Busy);
    bench.run(1);
    assert_eq!(bench.hardware.can.waiting.last().map(|(mailbox, _, _)| *mailbox), Some(2));
    bench.hardware.can.waiting.remove(0);
    bench.run(1);
    bench.hardware.can.waiting.remove(0);
    bench.device.storing(crate::bus::Storing::Done);
    bench.run(1);
    bench.set(Controller::Passive, true);
    bench.run(60);
    bench.hardware.can.unplugged = false;
    bench.run(20);
    for node in [1, 2] {
        let emergencies = bench.emergencies(node).into_iter().filter(|code| *code != 0x8120);
        assert!(emergencies.eq([0xFF0D, 0]), "{node}");
    }
}

#[test]
fn a_frame_waits_at_most_10_ms_in_a_passive_controller() {
    let mut bench = Bench::new();
    bench.set(Controller::Passive, true);
    while bench.hardware.can.waiting.is_empty() {
        bench.round();
    }
    // The round that wrote the frame did not count as waiting yet.
    bench.run(1 + (PATIENCE_US / ROUND_US) as u32);
    assert_eq!(bench.hardware.can.aborted, 0);
    bench.round();
    assert_eq!(bench.hardware.can.aborted, 1);
}
