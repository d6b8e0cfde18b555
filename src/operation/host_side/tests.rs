extern crate std;

use std::collections::VecDeque;
use std::vec::Vec;

use super::super::mailboxes::tests::{NOTHING, station};
use super::*;
use crate::bus::Frame;
use crate::leg::{FaultCode, JointStatus};

#[derive(Default)]
struct Board {
    orders: VecDeque<LegOrder<2>>,
    told: Vec<LegTold<2>>,
    full: bool,
    pended: u32,
    open: bool,
    blocked: bool,
}

impl HostBoard<2> for Board {
    fn order(&mut self) -> Option<LegOrder<2>> {
        self.orders.pop_front()
    }
    fn takes_told(&self) -> bool {
        !self.full
    }
    fn tell(&mut self, told: LegTold<2>) {
        assert!(!self.full);
        self.told.push(told);
    }
    fn pend(&mut self) {
        self.pended += 1;
    }
    fn held(&self) -> bool {
        !self.open
    }
    fn is_clear(&self) -> bool {
        !self.blocked
    }
}

/// What a host that has the drive commands.
fn commanded() -> [JointCommand; 2] {
    let mut station = station();
    // Its boot-up message goes first.
    assert!(station.poll(0, 0, &NOTHING).is_some());
    station.hear(&Frame::new(0x601, &[0x2B, 0x40, 0x60, 0, 6, 0, 0, 0]), 0, None, &NOTHING);
    assert!(station.poll(0, 0, &NOTHING).is_some());
    let joint = JointStatus { drive: DriveState::SwitchOnDisabled, ..JointStatus::NONE };
    station.told(&LegTold { joints: [joint; 2], rests: false, ..LegTold::NONE });
    station.order().commands.expect("a host")
}

fn order(request: Option<LegRequest>) -> LegOrder<2> {
    LegOrder { commands: Some(commanded()), request, faults: [None; 2] }
}

fn side(orders: &[LegOrder<2>]) -> HostSide<Board, 2> {
    HostSide::new(Board { orders: orders.iter().copied().collect(), ..Board::default() })
}

const UP: PowerRequest = PowerRequest::EnableOperation;
const ENABLE: LegRequest = LegRequest::Power(UP);

fn unreported(_: Fault) {
    panic!("no fault")
}

#[test]
fn a_request_waits_for_the_operators_hand_and_none_after_it_is_lost() {
    let identify = LegRequest::Identify { plan: Plan::Sequential, seed: 7 };
    let mut side = side(&[order(Some(ENABLE)), order(Some(identify)), order(Some(LegRequest::TakeUpdate))]);
    let stop = ControlRequest::Power(PowerRequest::QuickStop);
    for _ in 0..3 {
        side.hear(unreported);
        // The hand goes first, and what it asks for begins with no host's plan.
        assert_eq!(side.request(Some(stop)), Some((stop, None)));
        assert_eq!(side.board.orders.len(), 2);
    }
    let expected = [
        (ControlRequest::Power(UP), None),
        (ControlRequest::Identify, Some((Plan::Sequential, 7))),
        (ControlRequest::TakeUpdate, None),
    ];
    for expected in expected {
        side.hear(unreported);
        assert_eq!(side.request(None), Some(expected));
        assert_eq!(side.request(None), None, "once");
    }
}

#[test]
fn the_newest_commands_count_a_cancel_is_passed_on_once_and_faults_are_reported() {
    let fault = LegOrder { faults: [None, Some(FaultCode::Heartbeat)], ..order(None) };
    let mut side = side(&[order(Some(LegRequest::Cancel)), fault]);
    assert!(side.commands().is_none());
    let mut reported = Vec::new();
    side.hear(|fault| reported.push(fault));
    assert_eq!(reported, [Fault { code: FaultCode::Heartbeat, joint: 1 }]);
    let commands = commanded();
    assert_eq!(side.commands(), Some((&commands, true)));
    assert_eq!(side.commands(), Some((&commands, false)));
    // A host that has the drive no longer commands nothing.
    side.board.orders.push_back(LegOrder { commands: None, ..order(None) });
    side.hear(unreported);
    assert_eq!(side.commands(), None);
}

#[test]
fn an_open_switch_turns_requests_to_enable_away_and_stops_a_leg_that_is_enabled() {
    let mut side = side(&[]);
    let (up, stop, off) =
        [UP, PowerRequest::QuickStop, PowerRequest::DisableVoltage].map(ControlRequest::Power).into();
    let states = [DriveState::SwitchOnDisabled, DriveState::SwitchedOn, DriveState::OperationEnabled];
    for request in [None, Some(up), Some(off), Some(ControlRequest::Identify)] {
        for state in states {
            assert_eq!(side.held(request, state), request);
        }
    }
    side.board.open = true;
    for state in states {
        let enabled = state == DriveState::OperationEnabled;
        for turned_away in [None, Some(up), Some(ControlRequest::Identify), Some(ControlRequest::TakeUpdate)]
        {
            assert_eq!(side.held(turned_away, state), enabled.then_some(stop), "{state:?}");
        }
        // What leads down is passed on.
        assert_eq!(side.held(Some(off), state), Some(off));
    }
}

#[test]
fn the_bus_runs_after_every_second_tick_and_is_told_once_it_has_taken_what_it_had() {
    let mut side = side(&[]);
    side.board.full = true;
    // A request for power was refused while the bus had no time.
    (0..4).for_each(|tick| side.told(tick == 1, || LegTold::NONE));
    assert_eq!((side.board.pended, side.board.told.len()), (2, 0));
    side.board.full = false;
    (0..4).for_each(|_| side.told(false, || LegTold { change: [true; 2], ..LegTold::NONE }));
    let told: Vec<(bool, bool, [bool; 2])> =
        side.board.told.iter().map(|told| (told.refused, told.blocked, told.change)).collect();
    assert_eq!(
        (side.board.pended, &told[..]),
        (4, &[(true, false, [true; 2]), (false, false, [true; 2])][..])
    );
}

#[test]
fn what_is_asked_of_a_leg_without_zeros_is_forgotten() {
    let mut side = side(&[order(Some(ENABLE))]);
    side.hear(unreported);
    side.board.orders.extend([order(Some(ENABLE)), order(Some(LegRequest::Cancel))]);
    side.board.blocked = true;
    (0..2).for_each(|_| side.rest());
    assert_eq!((side.board.orders.len(), side.board.told.len()), (0, 1));
    assert_eq!(side.board.told[0], LegTold::NONE);
    side.hear(unreported);
    assert_eq!((side.request(None), side.commands()), (None, None));
}
