use super::super::tests::{Board, axis};
use super::super::{Lost, NmtState, Objects, dictionary::Object};
use super::*;
use crate::leg::{DriveEvent, DriveState, Fault, FaultCode};
use crate::units::{NewtonMetre, Radian, RadianPerSecond};

const CONTROLWORD: Object = Object::at(0x6040, 0);

impl Board {
    /// Writes both controlwords in one tick.
    fn control(&mut self, words: [u16; 2]) -> [u16; 2] {
        for (axis, word) in self.axes.iter_mut().zip(words) {
            assert_eq!(axis.write(CONTROLWORD, u32::from(word)), Ok(()));
        }
        self.run(4);
        self.states()
    }

    /// State bits and bit 15.
    fn states(&self) -> [u16; 2] {
        self.axes.map(|axis| axis.statusword() & 0x806F)
    }

    fn enabled() -> Self {
        let mut board = Self::started(1);
        board.control([6; 2]);
        assert_eq!(board.control([15; 2]), [0x27; 2]);
        board
    }
}

#[test]
fn six_seven_fifteen_enable_and_fifteen_goes_through_switched_on() {
    let mut board = Board::started(1);
    board.run(1);
    assert_eq!(board.states(), [0x40; 2]);
    assert_eq!(board.control([7; 2]), [0x40; 2]);
    assert_eq!(board.control([15; 2]), [0x40; 2]);
    assert_eq!(board.control([6; 2]), [0x21; 2]);
    assert_eq!(board.control([7; 2]), [0x23; 2]);
    assert_eq!(board.control([15; 2]), [0x27; 2]);
    assert_eq!(board.drive, DriveState::OperationEnabled);
    assert_eq!(board.control([7; 2]), [0x23; 2]);
    assert_eq!(board.control([15; 2]), [0x27; 2]);
    assert_eq!(board.control([6; 2]), [0x21; 2]);
    assert_eq!(board.control([0; 2]), [0x40; 2]);
    assert_eq!(board.control([6; 2]), [0x21; 2]);
    assert_eq!(board.control([15; 2]), [0x27; 2]);
}

#[test]
fn nothing_is_powered_and_no_target_taken_until_both_joints_are_enabled() {
    let mut board = Board::started(1);
    board.axes[0].write(Object::at(0x6060, 0), 8).expect("a mode");
    board.axes[0].write(Object::at(0x607A, 0), 500_000).expect("a target");
    board.control([6, 0]);
    assert_eq!(board.control([15, 0]), [0x8027, 0x40]);
    assert_eq!((board.drive, board.axes[0].command().target), (DriveState::SwitchOnDisabled, Target::Hold));
    board.control([15, 6]);
    assert_eq!(board.drive, DriveState::ReadyToSwitchOn);
    assert_eq!(board.control([15, 15]), [0x27; 2]);
    let Target::CyclicPosition { position, .. } = board.axes[0].command().target else {
        panic!("{:?}", board.axes[0].command())
    };
    // 500,000 micro-radian; f32 has 24 bits.
    assert!((position.0 - 0.5).abs() < 1e-6);
}

#[test]
fn one_joint_stops_both_and_an_old_controlword_restarts_neither() {
    for word in [0, 6, 7] {
        let mut board = Board::enabled();
        board.control([15, word]);
        assert_ne!(board.drive, DriveState::OperationEnabled);
        // The host continues to send what it sent to the other joint.
        board.axes[1].write(CONTROLWORD, 15).expect("a word");
        let drive = board.drive;
        board.run(4);
        let may_go_on = word != 0;
        assert_eq!(board.drive, drive);
        // Both joints must be enabled again.
        assert_eq!(board.control([15, 15])[1] == 0x27, may_go_on, "{word}");
    }
    let mut board = Board::enabled();
    board.axes[0].write(CONTROLWORD, 2).expect("a word");
    board.tick();
    assert!(matches!(board.drive, DriveState::QuickStopActive { .. }));
    board.tick();
    assert_eq!(board.states(), [0x07; 2]);
    board.run(10);
    assert_eq!(board.states(), [0x40; 2]);
    assert_eq!(board.control([15; 2]), [0x40; 2]);
}

#[test]
fn the_quick_stop_option_chooses_between_damping_and_off() {
    let mut board = Board::enabled();
    board.axes[0].write(Object::at(0x605A, 0), 0).expect("off");
    board.axes[0].write(CONTROLWORD, 2).expect("a word");
    board.tick();
    assert_eq!(board.drive, DriveState::SwitchOnDisabled);
}

#[test]
fn options_that_would_not_be_carried_out_are_refused() {
    use crate::bus::Abort::{NoObject, Range};
    let mut axis = axis();
    let mut write = |index, sub, value: i32| axis.write(Object::at(index, sub), value as u32);
    for (index, value) in [
        (0x605A, 1),
        (0x605A, 5),
        (0x605A, 6),
        (0x605B, 1),
        (0x605C, 1),
        (0x605D, 2),
        (0x605E, 1),
        (0x6007, 4),
        (0x607E, 0x80),
        (0x6086, 1),
        (0x6098, 1),
        (0x60F2, 3),
    ] {
        assert_eq!(write(index, 0, value), Err(Range), "{index:x}");
    }
    for index in [0x6085, 0x60C5, 0x60C6] {
        assert_eq!(write(index, 0, 1_000_000), Err(NoObject), "{index:x}");
    }
    // 60C2: 255 ms is the longest period at any time, so the smaller value is written first.
    for (sub, value, wanted) in [
        (1, 255, Ok(())),
        (2, -2, Err(Range)),
        (2, -4, Ok(())),
        (1, 20, Ok(())),
        (2, -2, Ok(())),
        (1, 26, Err(Range)),
        (1, 0, Err(Range)),
        (2, -7, Err(Range)),
        (2, 1, Err(Range)),
    ] {
        assert_eq!(write(0x60C2, sub, value), wanted, "60C2:{sub} {value}");
    }
    assert_eq!([1, 2].map(|sub| axis.read(Object::at(0x60C2, sub))), [Ok(20), Ok(0xFFFF_FFFE)]);
}

#[test]
fn both_nodes_report_a_fault_and_a_rising_edge_resets_it() {
    let mut board = Board::enabled();
    let fault = Fault { code: FaultCode::Overspeed, joint: 1 };
    board.drive = board.drive.after(DriveEvent::Failed(fault), 2);
    let frames = board.run(2);
    let sent: Vec<_> = frames.iter().map(|frame| (frame.id(), frame.data().to_vec())).collect();
    let data = [0x00, 0x84, 0b10_0001, 2, 0, 0, 0, 0].to_vec();
    assert_eq!(sent, [(0x81, data.clone()), (0x82, data)]);
    assert_eq!(board.read(0x603F, 0), Ok(0x8400));
    board.run(5);
    assert_eq!(board.states(), [0x08; 2]);
    assert_eq!(board.control([15, 15]), [0x08; 2]);
    assert_eq!(board.control([0x80, 15]), [0x40; 2]);
    // A bit that stays set does not reset the next fault.
    let later = Fault { code: FaultCode::PositionLimit, joint: 0 };
    board.drive = board.drive.after(DriveEvent::Failed(later), 2);
    assert_eq!(board.control([0x80, 15]), [0x08; 2]);
    board.axes[0].write(CONTROLWORD, 0).expect("a word");
    assert_eq!(board.control([0x80, 15]), [0x40; 2]);
    assert_eq!(board.read(0x1003, 1), Ok(0x0001_8500));
}

#[test]
fn a_refused_enable_is_not_shown_as_enabled() {
    let mut board = Board::started(1);
    board.control([6; 2]);
    board.refuses = true;
    assert_eq!(board.control([15; 2]), [0x21; 2]);
}

#[test]
fn a_lost_host_stops_the_drive_by_its_option() {
    for (option, state) in [(0, 0x27), (2, 0x40), (3, 0x07)] {
        let mut board = Board::enabled();
        board.receive(0, &[1, 0]);
        assert_eq!(board.write(0x6007, 0, option, 2), Ok(()));
        assert_eq!(board.write(0x1016, 1, 80 << 16 | 20, 4), Ok(()));
        board.receive(0x750, &[5]);
        board.frames();
        let frames = board.run(80);
        assert!(frames.iter().all(|frame| frame.id() != 0x81), "{frames:?}");
        let frames = board.run(2);
        let emergency = frames.iter().find(|frame| frame.id() == 0x81).expect("an emergency");
        assert_eq!(emergency.data(), [0x30, 0x81, 0b1_0001, 0, 0, 0, 0, 0]);
        assert_eq!(board.states()[0], state, "{option}");
        assert_eq!(board.nodes[0].state(), NmtState::PreOperational, "{option}");
        // The host is back: the end of the error is reported, and nothing restarts.
        board.run(10);
        board.receive(0x750, &[5]);
        let frames = board.run(2);
        let back = frames.iter().find(|frame| frame.id() == 0x81).expect("the end of it");
        assert_eq!(back.data(), [0; 8]);
        assert_eq!(board.drive == DriveState::OperationEnabled, option == 0);
    }
}

#[test]
fn a_halt_outlasts_a_lost_host() {
    let mut board = Board::enabled();
    board.axes[0].write(Object::at(0x6007, 0), 0).expect("no reaction");
    board.control([0x11F, 15]);
    board.axes[0].lost(Lost::Heartbeat);
    assert!(board.axes[0].command().halt);
    board.control([15; 2]);
    assert!(!board.axes[0].command().halt);
}

#[test]
fn homing_makes_targets_void() {
    let mut board = Board::enabled();
    for (index, value) in [(0x6060, 6), (0x607A, 100), (0x607C, 0), (0x6098, 37)] {
        board.axes[0].write(Object::at(index, 0), value).expect("a value");
    }
    board.run(4);
    board.control([0x1F, 15]);
    board.axes[0].write(Object::at(0x6060, 0), 8).expect("a mode");
    assert_eq!(board.axes[0].command().target, Target::Hold);
}

#[test]
fn stiffness_and_damping_end_with_their_session() {
    let mut board = Board::enabled();
    let write = |board: &mut Board, index, sub, value| {
        board.axes[0].write(Object::at(index, sub), value).expect("a value");
        board.axes[0].command().target != Target::Hold
    };
    write(&mut board, 0x6060, 0, u32::MAX);
    for _ in 0..2 {
        // The joint holds its pose until all three are written.
        let follows =
            [(0x607A, 0), (0x2020, 1), (0x2020, 2)].map(|(index, sub)| write(&mut board, index, sub, 100));
        assert_eq!(follows, [false, false, true]);
        board.axes[0].void_targets();
        assert_eq!(board.axes[0].command().target, Target::Hold);
    }
}

#[test]
fn a_lost_host_is_a_fault_with_option_1() {
    type Loss = fn(&mut Board);
    let lose: [(Loss, FaultCode); 3] = [
        (|board| board.axes[0].lost(Lost::Heartbeat), FaultCode::Heartbeat),
        (|board| board.axes[0].lost(Lost::ReceivedPdo), FaultCode::LatePdo),
        (|board| board.axes[0].lost(Lost::Bus(true)), FaultCode::BusOff),
    ];
    for (lose, code) in lose {
        let mut board = Board::enabled();
        assert_eq!(board.write(0x6007, 0, 1, 2), Ok(()));
        lose(&mut board);
        assert_eq!((board.axes[0].take_fault(), board.axes[0].take_fault()), (Some(code), None));
        // Only the leg reacts to the fault.
        assert_eq!(board.axes[0].own, DriveState::OperationEnabled);
    }
    let mut board = Board::enabled();
    assert_eq!(board.write(0x6007, 0, 1, 2), Ok(()));
    board.axes[0].lost(Lost::Stopped);
    assert_eq!(board.axes[0].take_fault(), None);
    board.run(2);
    assert_eq!(board.states()[0], 0x07);
}

#[test]
fn a_mode_is_displayed_before_the_leg_is_enabled() {
    let mut board = Board::started(1);
    assert_eq!(board.write(0x6060, 0, 8, 1), Ok(()));
    assert_eq!(board.read(0x6061, 0), Ok(8));
}

#[test]
fn a_lost_bus_or_an_nmt_command_stops_the_drive_for_good() {
    use super::super::Controller;
    let lose: [fn(&mut Board); 6] = [
        |board| board.receive(0, &[2, 1]),
        |board| board.receive(0, &[128, 1]),
        |board| board.receive(0, &[129, 2]),
        |board| board.receive(0, &[130, 0]),
        |board| board.nodes[1].on_controller(Controller::Passive, &mut board.axes[1]),
        |board| board.nodes[1].on_controller(Controller::Off, &mut board.axes[1]),
    ];
    for (number, lose) in lose.into_iter().enumerate() {
        let mut board = Board::enabled();
        board.receive(0, &[1, 0]);
        board.tick();
        lose(&mut board);
        board.tick();
        assert!(matches!(board.drive, DriveState::QuickStopActive { .. }), "{number}: {:?}", board.drive);
        board.nodes[1].on_controller(Controller::Active, &mut board.axes[1]);
        board.receive(0, &[1, 0]);
        board.run(10);
        assert_eq!(board.control([15; 2]), [0x40; 2], "{number}");
    }
}

#[test]
fn each_rising_edge_takes_one_set_point() {
    let mut board = Board::enabled();
    let mode = JointStatus { mode: 1, drive: board.drive, ..JointStatus::NONE };
    let seen = |requests_seen| JointStatus { requests_seen, ..mode };
    let axis = &mut board.axes[0];
    axis.write(Object::at(0x6060, 0), 1).expect("a mode");
    let number = |axis: &Axis| match axis.command().target {
        Target::ProfilePosition(point) => point,
        other => panic!("{other:?}"),
    };
    axis.update(&mode);
    for (count, position) in [(1, 100_000), (2, 200_000)] {
        axis.write(Object::at(0x607A, 0), position).expect("a target");
        axis.write(CONTROLWORD, 0x3F).expect("a word");
        assert!(axis.statusword() & 1 << 12 != 0);
        axis.write(CONTROLWORD, 0x3F).expect("a word");
        let point = number(axis);
        assert_eq!((axis.command().request_count, point.immediately, point.relative_to), (count, true, None));
        assert!((point.position.0 - position as f32 * 1e-6).abs() < 1e-7);
        // A new target without a rising edge moves nothing.
        axis.write(Object::at(0x607A, 0), 900_000).expect("a target");
        assert_eq!((number(axis), axis.command().request_count), (point, count));
        axis.write(CONTROLWORD, 0x2F).expect("a word");
        axis.update(&seen(count));
        assert!(axis.statusword() & 1 << 12 == 0);
    }
    // A relative one, by 60F2.
    for (count, (option, reference)) in
        (3..).zip([(0, Reference::Target), (1, Reference::Demand), (2, Reference::Actual)])
    {
        axis.write(Object::at(0x60F2, 0), option).expect("an option");
        axis.write(CONTROLWORD, 0x7F).expect("a word");
        assert_eq!((number(axis).relative_to, axis.command().request_count), (Some(reference), count));
        axis.write(CONTROLWORD, 0x6F).expect("a word");
        axis.update(&seen(count));
    }
    axis.write(CONTROLWORD, 0x14F).expect("a word");
    assert!(axis.command().halt);
}

#[test]
fn set_points_end_with_their_host_although_the_leg_stays_enabled() {
    let mut board = Board::enabled();
    let status = JointStatus { drive: board.drive, mode: 1, ..JointStatus::NONE };
    let axis = &mut board.axes[0];
    axis.write(Object::at(0x6007, 0), 0).expect("no reaction");
    axis.write(Object::at(0x6060, 0), 1).expect("a mode");
    axis.update(&status);
    axis.write(CONTROLWORD, 0x1F).expect("a word");
    let seen = |count| JointStatus { requests_seen: count, ..status };
    axis.update(&seen(1));
    assert!(matches!(axis.command().target, Target::ProfilePosition(_)));
    axis.lost(Lost::Heartbeat);
    // Until the leg has left the mode, a new start waits.
    axis.write(CONTROLWORD, 0xF).expect("a word");
    axis.write(CONTROLWORD, 0x1F).expect("a word");
    axis.update(&seen(1));
    assert_eq!((axis.command().target, axis.command().request_count), (Target::Hold, 1));
    axis.update(&JointStatus { mode: 0, ..seen(1) });
    assert_eq!(axis.command().request_count, 1);
    axis.update(&seen(1));
    assert!(matches!(axis.command().target, Target::ProfilePosition(_)));
    assert_eq!(axis.command().request_count, 2);
}

#[test]
fn a_quick_stop_goes_on_when_a_lost_host_is_no_reason_to_stop() {
    let mut board = Board::enabled();
    let axis = &mut board.axes[0];
    axis.write(Object::at(0x6007, 0), 0).expect("no reaction");
    axis.write(CONTROLWORD, 2).expect("a word");
    axis.lost(Lost::Heartbeat);
    assert!(matches!(axis.own, DriveState::QuickStopActive { .. }));
}

#[test]
fn an_edge_of_bit_4_in_another_mode_starts_nothing() {
    // Homing takes its start at once; `requests_of_one_mode_start_nothing_in_the_next` has 6 to 1.
    for (before, after) in [(3, 1), (8, 1), (3, 6), (1, 6)] {
        for is_followed in [false, true] {
            let mut board = Board::enabled();
            let status = JointStatus { drive: board.drive, is_full: true, ..JointStatus::NONE };
            let axis = &mut board.axes[0];
            axis.write(Object::at(0x6060, 0), before).expect("a mode");
            // The leg follows the mode, or not yet.
            axis.update(&JointStatus { mode: if is_followed { before as i8 } else { 0 }, ..status });
            let requests = axis.command().request_count;
            axis.write(CONTROLWORD, 0x1F).expect("a word");
            axis.write(Object::at(0x6060, 0), after).expect("a mode");
            axis.update(&JointStatus { mode: after as i8, is_full: false, ..status });
            axis.write(CONTROLWORD, 0x1F).expect("a word");
            axis.update(&JointStatus { mode: after as i8, is_full: false, ..status });
            assert_eq!(axis.command().request_count, requests, "{before} {after} {is_followed}");
        }
    }
}

#[test]
fn a_set_point_is_acknowledged_only_where_it_can_be_taken() {
    let mut board = Board::enabled();
    let mode = JointStatus { mode: 1, drive: board.drive, ..JointStatus::NONE };
    let axis = &mut board.axes[0];
    axis.write(Object::at(0x6060, 0), 1).expect("a mode");
    axis.update(&mode);
    axis.write(CONTROLWORD, 0x1F).expect("a word");
    axis.write(CONTROLWORD, 0x0F).expect("a word");
    // The leg has taken it, and has one that waits: bit 12 stays, and a third one is not taken.
    axis.update(&JointStatus { requests_seen: 1, is_full: true, ..mode });
    assert!(axis.statusword() & 1 << 12 != 0);
    axis.write(CONTROLWORD, 0x1F).expect("a word");
    assert_eq!(axis.command().request_count, 1);
    axis.write(CONTROLWORD, 0x0F).expect("a word");
    axis.update(&JointStatus { requests_seen: 1, ..mode });
    assert!(axis.statusword() & 1 << 12 == 0);
    // A lost host does not make a bit that stays set a new request.
    axis.write(CONTROLWORD, 0x1F).expect("a word");
    axis.update(&JointStatus { requests_seen: 2, ..mode });
    axis.write(Object::at(0x6007, 0), 0).expect("no reaction");
    axis.lost(Lost::Heartbeat);
    axis.write(CONTROLWORD, 0x1F).expect("a word");
    assert_eq!(axis.command().request_count, 2);
}

#[test]
fn targets_of_an_ended_session_are_void_until_they_are_written_again() {
    let primary = [(3, 0x60FF), (4, 0x6071), (8, 0x607A), (9, 0x60FF), (10, 0x6071), (-1, 0x607A)];
    for (mode, index) in primary {
        let mut board = Board::enabled();
        let write = |board: &mut Board, value| {
            board.axes[0].write(Object::at(index, 0), value).expect("a target");
            for sub in [1, 2] {
                board.axes[0].write(Object::at(0x2020, sub), 100).expect("stiffness or damping");
            }
        };
        board.axes[0].write(Object::at(0x6060, 0), mode as u32).expect("a mode");
        assert_eq!(board.axes[0].command().target, Target::Hold, "{mode}");
        write(&mut board, 100);
        assert_eq!(board.axes[0].command().target.mode().map(|mode| mode as i32), Some(mode));
        // Disabled and enabled again; lost, without a reaction.
        board.control([7; 2]);
        assert_eq!(board.control([15; 2]), [0x27; 2]);
        assert_eq!(board.axes[0].command().target, Target::Hold, "{mode}");
        write(&mut board, 100);
        board.axes[0].write(Object::at(0x6007, 0), 0).expect("no reaction");
        board.axes[0].lost(Lost::Heartbeat);
        assert_eq!(board.axes[0].command().target, Target::Hold, "{mode}");
        assert_eq!(board.axes[0].read(Object::at(index, 0)), Ok(100));
    }
}

#[test]
fn position_limits_are_checked_as_a_pair_and_against_the_joint() {
    use crate::bus::Abort::{MaximumBelowMinimum, State};
    let mut board = Board::started(1);
    let axis = &mut board.axes[0];
    assert_eq!(axis.write(Object::at(0x607D, 2), 100), Ok(()));
    assert_eq!(axis.write(Object::at(0x607D, 1), 200), Err(MaximumBelowMinimum));
    let mut board = Board::enabled();
    // The joint is at 0.
    for (sub, limit, expected) in [(1, 1, Err(State)), (2, -1, Err(State)), (1, -1, Ok(())), (2, 1, Ok(()))] {
        assert_eq!(board.axes[0].write(Object::at(0x607D, sub), limit as u32), expected, "{sub} {limit}");
    }
}

#[test]
fn a_set_point_before_power_is_discarded() {
    let mut board = Board::started(1);
    board.axes[0].write(Object::at(0x6060, 0), 1).expect("a mode");
    board.axes[0].write(Object::at(0x607A, 0), 500_000).expect("a target");
    board.control([6, 6]);
    assert_eq!(board.control([0x0F, 7])[0], 0x8027);
    board.control([0x1F, 7]);
    board.control([0x1F, 15]);
    assert_eq!(board.drive, DriveState::OperationEnabled);
    assert_eq!(board.axes[0].command().target, Target::ProfilePosition(SetPoint::default()));
    board.control([0x0F, 15]);
    board.control([0x1F, 15]);
    assert_ne!(board.axes[0].command().target, Target::ProfilePosition(SetPoint::default()));
    assert_eq!(board.axes[0].command().request_count, 1);
}

#[test]
fn a_reset_bit_set_before_the_fault_does_not_reset_it() {
    let mut board = Board::enabled();
    board.axes[0].write(CONTROLWORD, 0x8F).expect("a word");
    let fault = Fault { code: FaultCode::NotFinite, joint: 0 };
    board.drive = board.drive.after(DriveEvent::Failed(fault), 2);
    board.run(2);
    assert_eq!(board.states(), [0x08; 2]);
}

#[test]
fn units_are_micro_radians_and_thousandths_of_the_rated_torque() {
    let mut axis = axis();
    axis.update(&JointStatus {
        position: Radian(-0.25),
        velocity: RadianPerSecond(1.5),
        torque: NewtonMetre(-10.0),
        position_demand: Radian(0.25),
        ..JointStatus::NONE
    });
    let read = |index| axis.read(Object::at(index, 0)).expect("a value") as i32;
    // Powers of two times 1e6: exact in f32.
    assert_eq!((read(0x6064), read(0x606C), read(0x60F4)), (-250_000, 1_500_000, 500_000));
    assert_eq!((read(0x6077), read(0x2010), read(0x6076)), (-250, 1500, 40_000));
    let command = axis.command();
    assert!((command.period.0 - 0.002).abs() < 1e-9 && (command.following_window.0 - 0.087_266).abs() < 1e-8);
    assert_eq!(command.largest_torque, NewtonMetre(40.0));
}

#[test]
fn an_unsupported_mode_is_refused() {
    let constants = AxisConstants { modes: Mode::CyclicPosition.bit(), ..axis().constants };
    let mut axis = Axis::new(constants);
    for mode in -128..=127_i8 {
        let expected = if [0, 8].contains(&mode) { Ok(()) } else { Err(crate::bus::Abort::Range) };
        assert_eq!(axis.write(Object::at(0x6060, 0), mode as u8 as u32), expected, "{mode}");
    }
    axis.lost(Lost::Reset);
    axis.reset();
    assert_eq!(axis.read(Object::at(0x6060, 0)), Ok(0));
}

#[test]
fn homing_needs_a_written_method() {
    let offset = |method: Option<u32>| {
        let mut board = Board::enabled();
        board.axes[0].write(Object::at(0x607C, 0), 500_000).expect("an offset");
        board.axes[0].write(Object::at(0x6060, 0), 6).expect("a mode");
        if let Some(method) = method {
            board.axes[0].write(Object::at(0x6098, 0), method).expect("a method");
        }
        match board.axes[0].command().target {
            Target::Homing { offset } => (offset.0 * 1e3 + 0.5) as u32,
            other => panic!("{other:?}"),
        }
    };
    // Methods 0 (written), 35 and 37: the present position is home.
    assert_eq!([0, 35, 37].map(|method| offset(Some(method))), [500; 3]);
    // No method written: the leg answers with a homing error.
    assert_eq!(offset(None), u32::MAX);
    assert_eq!(Board::enabled().axes[0].read(Object::at(0x6098, 0)), Ok(0));
}

#[test]
fn zero_ramps_and_switch_values_above_one_are_refused() {
    let mut board = Board::started(1);
    for (index, refused) in [(0x2011, 2), (0x6083, 0), (0x6084, 0)] {
        for value in [1, refused] {
            let object = Object::at(index, 0);
            assert_eq!(board.axes[0].write(object, value).is_ok(), value == 1, "{index:x} {value}");
            // A refused write changes nothing.
            assert_eq!(board.axes[0].read(object), Ok(1), "{index:x}");
        }
    }
}
