extern crate std;

use std::vec::Vec;

use super::*;
use crate::bus::drive::{AxisConstants, Mode};
use crate::bus::identification::Found;
use crate::bus::{Identity, NodeId};
use crate::leg::Plan;
use crate::units::{Ampere, NewtonMetre};

/// Nothing was identified.
pub(in crate::operation) const NOTHING: Found<2, 1> = Found::nothing();

pub(in crate::operation) fn station() -> Station<2, 4> {
    let constants = AxisConstants {
        rated_torque: NewtonMetre(40.0),
        rated_current: Ampere(20.0),
        modes: Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit()),
    };
    let own = [1, 2].map(|number| NodeId::new(number).expect("a number"));
    Station::new(own, Identity::scarab(1, "test"), [constants; 2], Plan::OneTime, 1)
}

/// Three mailboxes that leave in the order in which they were filled, at once where the plug is in.
#[derive(Default)]
pub(in crate::operation) struct Wire {
    /// In which, what, since when.
    waiting: Vec<(u32, Frame, u64)>,
    pub(in crate::operation) unplugged: bool,
    /// What left, when, and when it was given.
    pub(in crate::operation) sent: Vec<(Frame, u64, u64)>,
    pub(in crate::operation) now_us: u64,
    gave_up: u32,
    most: usize,
}

impl Mailboxes for Wire {
    fn waiting(&self) -> u32 {
        self.waiting.iter().fold(0, |bits, (mailbox, _, _)| bits | 1 << mailbox)
    }
    fn send(&mut self, mailbox: u32, frame: &Frame) {
        assert!(mailbox < 3 && self.waiting() & 1 << mailbox == 0, "dropped");
        self.waiting.push((mailbox, *frame, self.now_us));
        self.most = self.most.max(self.waiting.len());
    }
    fn give_up(&mut self) {
        self.gave_up += 1;
        self.waiting.clear();
    }
}

impl Wire {
    /// What is under way when the plug is in leaves.
    pub(in crate::operation) fn empty(&mut self) {
        if !self.unplugged {
            let now_us = self.now_us;
            self.sent.extend(self.waiting.drain(..).map(|(_, frame, given_us)| (frame, given_us, now_us)));
        }
    }
}

struct Bench {
    station: Station<2, 4>,
    speaker: Speaker,
    wire: Wire,
    controller: Controller,
}

const ROUND_US: u64 = 500;

impl Bench {
    /// Both nodes operational, their first PDO sent every 2 ms.
    fn new() -> Self {
        let (speaker, wire) = (Speaker::default(), Wire::default());
        let mut bench = Self { station: station(), speaker, wire, controller: Controller::Active };
        bench.run(4);
        let (asynchronous, every_2_ms) = ((2_u8, 255_u8), (5_u8, 2_u8));
        for (node, (sub, value)) in
            [1, 2].into_iter().flat_map(|node| [(node, asynchronous), (node, every_2_ms)])
        {
            let size = if sub == 2 { 0x2F } else { 0x2B };
            bench.hear(&Frame::new(0x600 + node, &[size, 0x00, 0x18, sub, value, 0, 0, 0]));
            bench.run(2);
        }
        bench.hear(&Frame::new(0, &[1, 0]));
        bench.run(40);
        assert!(bench.leaving(0x181).count() > 5 && bench.leaving(0x182).count() > 5);
        bench.wire.sent.clear();
        bench
    }

    fn hear(&mut self, frame: &Frame) {
        self.station.hear(frame, self.wire.now_us, None, &NOTHING);
    }

    fn set(&mut self, controller: Controller, unplugged: bool) {
        (self.controller, self.wire.unplugged) = (controller, unplugged);
        self.station.on_controller(controller, &NOTHING);
    }

    fn round(&mut self) {
        self.wire.now_us += ROUND_US;
        let now_us = self.wire.now_us;
        self.speaker.speak(&mut self.wire, self.controller, now_us, &mut self.station, &NOTHING);
        self.wire.empty();
    }

    fn run(&mut self, rounds: u32) {
        (0..rounds).for_each(|_| self.round());
    }

    fn leaving(&self, id: u16) -> impl Iterator<Item = Frame> {
        self.wire.sent.iter().map(|(frame, _, _)| *frame).filter(move |frame| frame.id() == id)
    }

    /// Codes of a node's emergency messages that left.
    fn told(&self, node: u16) -> Vec<u16> {
        self.leaving(0x80 + node)
            .map(|frame| u16::from_le_bytes([frame.data()[0], frame.data()[1]]))
            .collect()
    }
}

#[test]
fn what_waits_where_a_plug_was_pulled_is_new_when_it_is_put_back_and_no_emergency_is_lost() {
    // For how long it is out, in rounds of half a millisecond; the controller is passive after 3 ms.
    for rounds in (1..200).step_by(7) {
        let mut bench = Bench::new();
        bench.wire.unplugged = true;
        bench.run(6);
        assert_eq!(bench.wire.waiting.len(), 3);
        bench.set(Controller::Passive, true);
        bench.run(rounds);
        let back_us = bench.wire.now_us;
        bench.wire.unplugged = false;
        bench.run(20);
        bench.set(Controller::Active, false);
        bench.run(20);
        for (frame, given_us, left_us) in &bench.wire.sent {
            let age_us = left_us - given_us;
            // Before it was passive nothing is given up: 3 ms more.
            let patience_us = PATIENCE_US + ROUND_US + 6 * ROUND_US;
            assert!(age_us <= patience_us, "{rounds}: {frame:?} after {age_us} us");
            assert!(*left_us > back_us);
        }
        assert_eq!([1, 2].map(|node| bench.told(node)), [[0x8120, 0]; 2].map(Vec::from), "{rounds}");
        // Both speak again as before.
        assert!(bench.leaving(0x181).count() > 3 && bench.leaving(0x182).count() > 3, "{rounds}");
    }
}

#[test]
fn a_passive_controller_that_still_sends_loses_nothing() {
    let mut bench = Bench::new();
    bench.set(Controller::Passive, false);
    bench.run(400);
    assert_eq!((bench.wire.gave_up, bench.told(1), bench.told(2)), (0, [0x8120].into(), [0x8120].into()));
    // 200 ms, one every 2 ms of each.
    assert!(bench.leaving(0x181).count() > 95 && bench.leaving(0x182).count() > 95);
}

#[test]
fn a_boot_up_message_that_could_not_leave_leaves_when_the_plug_is_in() {
    let (speaker, wire) = (Speaker::default(), Wire { unplugged: true, ..Wire::default() });
    let mut bench = Bench { station: station(), speaker, wire, controller: Controller::Passive };
    bench.run(300);
    assert!(bench.wire.gave_up > 10);
    bench.wire.unplugged = false;
    bench.run(20);
    assert_eq!([0x701, 0x702].map(|id| bench.leaving(id).count()), [1, 1]);
}

#[test]
fn nothing_waits_in_a_controller_that_is_off() {
    let mut bench = Bench::new();
    bench.wire.unplugged = true;
    bench.run(20);
    assert_eq!(bench.wire.waiting.len(), 3);
    bench.set(Controller::Off, true);
    for _ in 0..50 {
        bench.round();
        assert!(bench.wire.waiting.is_empty());
    }
    bench.set(Controller::Active, false);
    let back_us = bench.wire.now_us;
    bench.run(20);
    assert!(bench.wire.sent.iter().all(|(_, given_us, _)| *given_us > back_us));
    assert_eq!(bench.told(1), [0x8140, 0]);
}

#[test]
fn nodes_speak_in_turn_and_whichever_was_first_is_second_next() {
    let mut bench = Bench::new();
    // Both have something to say in every round, and there is room for one frame.
    bench.wire.unplugged = true;
    bench.run(40);
    let mut order = Vec::new();
    for _ in 0..8 {
        bench.wire.waiting.truncate(2);
        bench.wire.now_us += 4 * ROUND_US;
        bench.round();
        order.extend(bench.wire.waiting.get(2).map(|(_, frame, _)| frame.id() & 0x7F));
    }
    assert!(order == [1, 2, 1, 2, 1, 2, 1, 2] || order == [2, 1, 2, 1, 2, 1, 2, 1], "{order:?}");
    assert_eq!(bench.wire.most, 3);
}

#[test]
fn an_emergency_that_waited_in_a_mailbox_is_told_whatever_the_controller_becomes() {
    for controller in [Controller::Passive, Controller::Off] {
        let mut bench = Bench::new();
        // PDOs wait in two mailboxes, the store's message of one node in the third.
        bench.wire.unplugged = true;
        bench.run(1);
        bench.wire.waiting.truncate(2);
        bench.station.storing(crate::bus::Storing::Busy);
        bench.run(1);
        assert!(bench.wire.waiting.iter().any(|(_, frame, _)| frame.id() & 0x780 == 0x80));
        bench.set(controller, true);
        bench.run(60);
        bench.wire.unplugged = false;
        bench.set(Controller::Active, false);
        bench.run(20);
        let code = if controller == Controller::Off { 0x8140 } else { 0x8120 };
        let mut told = [1, 2].map(|node| bench.told(node));
        told.iter_mut().for_each(|codes| codes.truncate(2));
        assert_eq!(told, [[0xFF0D, code]; 2].map(Vec::from), "{controller:?}");
    }
}

#[test]
fn an_emergency_message_with_another_identifier_is_told_as_well() {
    let mut bench = Bench::new();
    bench.hear(&Frame::new(0x601, &[0x23, 0x14, 0x10, 0, 0x10, 0x03, 0, 0]));
    bench.run(4);
    bench.wire.unplugged = true;
    bench.set(Controller::Passive, true);
    bench.run(300);
    bench.wire.unplugged = false;
    bench.run(20);
    assert_eq!(bench.leaving(0x310).count(), 1);
}

#[test]
fn what_is_told_again_is_told_in_its_order_whatever_mailboxes_it_was_in() {
    let mut bench = Bench::new();
    bench.wire.unplugged = true;
    bench.run(1);
    bench.wire.waiting.truncate(2);
    // An error in the last mailbox; its end in the first, which is free by then.
    bench.station.storing(crate::bus::Storing::Busy);
    bench.run(1);
    assert_eq!(bench.wire.waiting.last().map(|(mailbox, _, _)| *mailbox), Some(2));
    bench.wire.waiting.remove(0);
    bench.run(1);
    bench.wire.waiting.remove(0);
    bench.station.storing(crate::bus::Storing::Done);
    bench.run(1);
    bench.set(Controller::Passive, true);
    bench.run(60);
    bench.wire.unplugged = false;
    bench.run(20);
    for node in [1, 2] {
        let told = bench.told(node);
        let told: Vec<u16> = told.into_iter().filter(|code| *code != 0x8120).collect();
        assert_eq!(told, [0xFF0D, 0], "{node}");
    }
}
