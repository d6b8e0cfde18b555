extern crate std;

use std::collections::VecDeque;
use std::vec::Vec;

use super::super::mailboxes::tests::{NOTHING, Wire, station};
use super::*;
use crate::bus::station::LegRequest;
use crate::leg::{DriveEvent, DriveState, JointStatus, PowerRequest};

mod flood;

/// Queues of one, as the board's.
struct Board {
    wire: Wire,
    status: Controller,
    /// One was lost since the last round.
    lost: bool,
    frames: VecDeque<Frame>,
    /// What hearing one takes.
    frame_us: u64,
    told: Option<LegTold<2>>,
    order: Option<LegOrder<2>>,
    held: bool,
    hosted: bool,
    memory: Keep<2>,
    is_lent: bool,
    ended: bool,
}

impl Mailboxes for Board {
    fn waiting(&self) -> u32 {
        self.wire.waiting()
    }
    fn send(&mut self, mailbox: u32, frame: &Frame) {
        self.wire.send(mailbox, frame);
    }
    fn give_up(&mut self) {
        self.wire.give_up();
    }
}

impl BusBoard<2> for Board {
    fn now_us(&self) -> u64 {
        self.wire.now_us
    }
    fn status(&mut self) -> Controller {
        if core::mem::take(&mut self.lost) { Controller::Overrun } else { self.status }
    }
    fn frame(&mut self) -> Option<Frame> {
        let frame = self.frames.pop_front()?;
        self.wire.now_us += self.frame_us;
        Some(frame)
    }
    fn logged(&mut self) -> Option<LoggedSample<2>> {
        None
    }
    fn is_told(&self) -> bool {
        self.told.is_some()
    }
    fn told(&mut self) -> Option<LegTold<2>> {
        self.told.take()
    }
    fn takes_order(&self) -> bool {
        self.order.is_none()
    }
    fn order(&mut self, order: LegOrder<2>) {
        assert!(self.order.is_none(), "overwritten");
        self.order = Some(order);
    }
    fn held(&self) -> bool {
        self.held
    }
    fn set_hosted(&mut self, hosted: bool) {
        self.hosted = hosted;
    }
    fn kept(&mut self) -> Option<&Keep<2>> {
        core::mem::take(&mut self.ended).then(|| {
            self.is_lent = false;
            &self.memory
        })
    }
    fn lent(&mut self) -> Option<&mut Keep<2>> {
        (!self.is_lent).then_some(&mut self.memory)
    }
    fn keep(&mut self) {
        assert!(!self.is_lent, "lent twice");
        self.is_lent = true;
    }
}

struct Bench {
    station: Station<2, 4>,
    round: BusRound,
    board: Board,
    drive: DriveState,
    /// The leg takes its orders.
    takes: bool,
    requests: Vec<LegRequest>,
}

impl Bench {
    fn new() -> Self {
        let board = Board {
            wire: Wire::default(),
            status: Controller::Active,
            lost: false,
            frames: VecDeque::new(),
            frame_us: 0,
            told: None,
            order: None,
            held: true,
            hosted: false,
            memory: Keep::NOTHING,
            is_lent: false,
            ended: false,
        };
        let (drive, round) = (DriveState::SwitchOnDisabled, BusRound::new());
        let mut bench = Self { station: station(), round, board, drive, takes: true, requests: Vec::new() };
        bench.run(4);
        bench.send(0, &[1, 0]);
        bench
    }

    /// A leg's tick, a round, and what is in the mailboxes leaves.
    fn run(&mut self, rounds: u32) {
        for _ in 0..rounds {
            if self.takes
                && let Some(request) = self.board.order.take().and_then(|order| order.request)
            {
                self.requests.push(request);
                if let LegRequest::Power(power) = request {
                    self.drive = self.drive.after(DriveEvent::Asked(power), 4);
                }
            }
            self.drive = self.drive.after(DriveEvent::Tick, 4);
            let joint = JointStatus { drive: self.drive, ..JointStatus::NONE };
            self.board.told.get_or_insert(LegTold {
                joints: [joint; 2],
                blocked: false,
                rests: false,
                ..LegTold::NONE
            });
            self.board.wire.now_us += 500;
            self.round.round(33, &mut self.station, &mut self.board, &NOTHING);
            self.board.wire.empty();
        }
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.board.frames.push_back(Frame::new(id, data));
        self.run(8);
    }

    fn word(&mut self, word: u8) {
        [0x601, 0x602].into_iter().for_each(|id| self.send(id, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]));
    }

    fn enable(&mut self) {
        [6, 7, 15].into_iter().for_each(|word| self.word(word));
    }

    /// Codes of both nodes' emergency messages since this was asked, the first node's first.
    fn told(&mut self) -> Vec<(u16, u16)> {
        let sent = core::mem::take(&mut self.board.wire.sent).into_iter().map(|(frame, _, _)| frame);
        let emergencies = sent.filter(|frame| matches!(frame.id(), 0x81..=0xFF));
        let code = |frame: Frame| u16::from_le_bytes([frame.data()[0], frame.data()[1]]);
        let mut told: Vec<(u16, u16)> = emergencies.map(|frame| (frame.id(), code(frame))).collect();
        told.sort_by_key(|(id, _)| *id);
        told
    }
}

const CANCEL: [u8; 8] = [0x2F, 0x00, 0x21, 1, 2, 0, 0, 0];

#[test]
fn an_order_that_was_not_taken_is_not_overwritten_and_no_request_is_lost() {
    let mut bench = Bench::new();
    bench.enable();
    assert_eq!((bench.drive, bench.board.hosted), (DriveState::OperationEnabled, true));
    bench.requests.clear();
    bench.run(2);
    bench.takes = false;
    // A step down, while the leg has no time; then something else.
    bench.word(7);
    bench.send(0x601, &CANCEL);
    bench.run(20);
    assert_eq!(bench.requests, []);
    bench.takes = true;
    bench.run(20);
    assert_eq!(bench.requests, [LegRequest::Power(PowerRequest::DisableOperation), LegRequest::Cancel]);
    // Alone, behind an order that asks for nothing.
    bench.requests.clear();
    bench.takes = false;
    bench.run(4);
    bench.send(0x601, &CANCEL);
    bench.takes = true;
    bench.run(20);
    assert_eq!(bench.requests, [LegRequest::Cancel]);
}

#[test]
fn a_leg_that_tells_nothing_is_ordered_what_frames_say_and_otherwise_nothing() {
    let mut bench = Bench::new();
    bench.enable();
    let quiet = |bench: &mut Bench| {
        bench.board.wire.now_us += 500;
        bench.board.order = None;
        bench.round.round(33, &mut bench.station, &mut bench.board, &NOTHING);
        bench.board.order
    };
    quiet(&mut bench);
    assert_eq!(quiet(&mut bench), None);
    // A torque that the controlword of node 1 halts.
    bench.board.frames.push_back(Frame::new(0x201, &[0x0F, 0x01]));
    let order = quiet(&mut bench).expect("an order");
    assert_eq!(order.commands.expect("a host has the drive").map(|command| command.halt), [true, false]);
    assert_eq!(quiet(&mut bench), None);
}

#[test]
fn an_overrun_is_told_and_stops_a_hosted_leg() {
    let mut bench = Bench::new();
    bench.enable();
    bench.told();
    bench.requests.clear();
    bench.board.lost = true;
    bench.run(8);
    assert_eq!(bench.requests, [LegRequest::Power(PowerRequest::QuickStop)]);
    assert_eq!(bench.told(), [(0x81, 0x8110), (0x81, 0), (0x82, 0x8110), (0x82, 0)]);
}

#[test]
fn a_frame_that_is_lost_while_the_controller_is_passive_fills_no_mailboxes() {
    let mut bench = Bench::new();
    bench.enable();
    bench.board.status = Controller::Passive;
    bench.run(1);
    bench.board.wire.unplugged = true;
    for round in 0..40 {
        bench.board.lost = round % 3 == 0;
        bench.run(1);
        assert!(bench.board.wire.waiting().count_ones() <= 1);
    }
}

#[test]
fn a_controller_that_is_off_is_told_once_and_has_nothing_to_send() {
    let mut bench = Bench::new();
    bench.enable();
    bench.told();
    bench.requests.clear();
    bench.board.status = Controller::Off;
    bench.run(50);
    assert_eq!(bench.board.wire.sent, []);
    bench.board.status = Controller::Active;
    bench.run(8);
    assert_eq!(bench.requests, [LegRequest::Power(PowerRequest::QuickStop)]);
    assert_eq!(bench.told(), [(0x81, 0x8140), (0x81, 0), (0x82, 0x8140), (0x82, 0)]);
}

#[test]
fn an_open_switch_lets_no_step_towards_enabled_reach_the_leg() {
    let mut bench = Bench::new();
    bench.board.held = false;
    bench.enable();
    assert_eq!((bench.requests.len(), bench.drive), (0, DriveState::SwitchOnDisabled));
    bench.board.held = true;
    bench.enable();
    assert_eq!(bench.drive, DriveState::OperationEnabled);
}

#[test]
fn of_many_frames_so_many_are_heard_in_a_round() {
    let mut bench = Bench::new();
    bench.board.frames.extend([Frame::new(0x80, &[]); 40]);
    bench.run(1);
    assert_eq!(bench.board.frames.len(), 7);
}

#[test]
fn one_store_is_under_way_and_how_it_ended_is_told() {
    let save = [0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e'];
    let window = |bench: &mut Bench, value: u8| {
        bench.send(0x601, &[0x23, 0x65, 0x60, 0, value, 0, 0, 0]);
        bench.send(0x602, &save);
    };
    let mut bench = Bench::new();
    bench.told();
    window(&mut bench, 11);
    assert!(bench.board.is_lent && bench.board.memory.what == Keeping::All);
    let first = bench.board.memory.objects;
    // Another one waits until the first is over.
    window(&mut bench, 22);
    assert_eq!(bench.board.memory.objects, first);
    (bench.board.memory.done, bench.board.memory.generation, bench.board.ended) = (true, 5, true);
    bench.run(1);
    assert!(bench.board.is_lent && bench.board.memory.objects != first);
    assert_eq!((bench.station.generation(), bench.board.memory.generation), (5, 5));
    (bench.board.memory.done, bench.board.ended) = (false, true);
    bench.run(8);
    let codes: Vec<u16> = bench.told().iter().filter(|(id, _)| *id == 0x81).map(|(_, code)| *code).collect();
    assert_eq!((codes.first(), codes.last()), (Some(&0xFF0D), Some(&0x5530)), "{codes:x?}");
    assert!(!bench.board.is_lent);
    // The second was refused by the flash: a reset brings back the first.
    bench.send(0, &[129, 0]);
    bench.board.wire.sent.clear();
    bench.send(0x601, &[0x40, 0x65, 0x60, 0, 0, 0, 0, 0]);
    let answer = bench.board.wire.sent.iter().find(|(frame, _, _)| frame.id() == 0x581).expect("an answer");
    assert_eq!(answer.0.data()[4..], [11, 0, 0, 0]);
}
