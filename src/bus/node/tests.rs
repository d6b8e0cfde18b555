use super::super::tests::{self, Board};
use super::super::{Abort, Frame};
use super::*;

fn started() -> Board {
    let mut board = Board::started(1);
    board.receive(0, &[1, 0]);
    board.tick();
    board
}

#[test]
fn a_node_boots_once_and_again_after_each_reset() {
    let mut board = Board::new(3);
    let boot = [Frame::new(0x703, &[0]), Frame::new(0x704, &[0])];
    assert_eq!(board.frames(), boot);
    assert_eq!(board.frames(), []);
    assert_eq!(board.nodes[0].state(), NmtState::PreOperational);
    for reset in [129, 130] {
        assert_eq!(board.write(0x6065, 0, 5, 4), Ok(()));
        assert_eq!(board.write(0x1005, 0, 0x1FF, 4), Ok(()));
        board.receive(0, &[reset, 3]);
        assert_eq!(board.frames(), [boot[0]]);
        // A communication reset leaves the drive's objects unchanged.
        let window = if reset == 130 { 5 } else { 87_266 };
        assert_eq!((board.read(0x6065, 0), board.read(0x1005, 0)), (Ok(window), Ok(0x80)));
    }
}

#[test]
fn sync_and_emergency_refuse_cob_ids_of_other_messages() {
    let mut board = started();
    let range = Err(Abort::Range as u32);
    // CiA 301's restricted COB-IDs, more than eleven bits, SYNC producer, and COB-IDs of other messages.
    let restricted =
        [0, 1, 0x7F, 0x101, 0x180, 0x580, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x701, 0x77F, 0x7FF, 0x800];
    let extended = [0x2000_0300, 0x4000_0300];
    for identifier in restricted.into_iter().chain(extended).chain([0x181, 0x201, 0x481, 0x501]) {
        assert_eq!(board.write(0x1005, 0, identifier, 4), range, "{identifier:x}");
        assert_eq!(board.write(0x1014, 0, identifier, 4), range, "{identifier:x}");
    }
    assert_eq!((board.write(0x1005, 0, 0x81, 4), board.write(0x1014, 0, 0x80, 4)), (range, range));
    assert_eq!(board.write(0x1014, 0, 1 << 31 | 0x601, 4), range);
    // SYNC, emergency and PDOs must not share a COB-ID.
    assert_eq!((board.write(0x1005, 0, 0x300, 4), board.write(0x1014, 0, 0x300, 4)), (Ok(()), range));
    assert_eq!((board.write(0x1014, 0, 0x310, 4), board.write(0x1005, 0, 0x310, 4)), (Ok(()), range));
    for pdo in [0x1400, 0x1800] {
        assert_eq!(board.write(pdo, 1, 1 << 31, 4), Ok(()));
        assert_eq!((board.write(pdo, 1, 0x300, 4), board.write(pdo, 1, 0x310, 4)), (range, range));
    }
    // Bit 30 (no RTR) does not change the COB-ID. The COB-ID of another PDO is refused too.
    assert_eq!(board.write(0x1401, 1, 1 << 31, 4), Ok(()));
    for taken in [0x4000_0300, 0x4000_0310, 0x401, 0x4000_0401, 0x281] {
        assert_eq!(board.write(0x1401, 1, taken, 4), range, "{taken:x}");
    }
    assert_eq!((board.write(0x1401, 1, 0x4000_0301, 4), board.write(0x1401, 1, 0x301, 4)), (Ok(()), Ok(())));
    // A disabled PDO or emergency message frees its COB-ID.
    assert_eq!(board.write(0x1005, 0, 0x201, 4), Ok(()));
    assert_eq!(board.write(0x1014, 0, 1 << 31 | 0x310, 4), Ok(()));
    assert_eq!(board.write(0x1800, 1, 0x310, 4), Ok(()));
    assert_eq!((board.write(0x1005, 0, 0x80, 4), board.write(0x1014, 0, 0x81, 4)), (Ok(()), Ok(())));
}

#[test]
fn a_stopped_node_sends_its_heartbeat_and_nothing_else() {
    let mut board = started();
    assert_eq!(board.write(0x1017, 0, 1, 2), Ok(()));
    board.frames();
    board.receive(0, &[2, 1]);
    assert_eq!(board.nodes[0].state(), NmtState::Stopped);
    board.receive(0x601, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    board.receive(0x080, &[]);
    board.receive(0x201, &[6, 0]);
    let frames = board.run(8);
    let own: Vec<_> = frames.iter().filter(|frame| frame.id() & 0x7F == 1).collect();
    assert_eq!(own, [&Frame::new(0x701, &[4]); 2]);
}

#[test]
fn the_heartbeat_carries_the_state_at_its_period() {
    let mut board = Board::started(1);
    assert_eq!(board.write(0x1017, 0, 5, 2), Ok(()));
    board.receive(0, &[1, 1]);
    let frames = board.run(400);
    let count = frames.iter().filter(|frame| **frame == Frame::new(0x701, &[5])).count();
    assert_eq!(count, 20);
}

#[test]
fn synchronous_pdos_are_written_at_the_sync() {
    let mut board = started();
    assert_eq!(board.write(0x1401, 2, 1, 1), Ok(()));
    board.receive(0x301, &[1, 2, 3, 0]);
    assert_eq!(board.read(0x607A, 0), Ok(0));
    board.receive(0x080, &[]);
    board.frames();
    assert_eq!(board.read(0x607A, 0), Ok(0x30201));
    assert_eq!(board.write(0x1401, 2, 255, 1), Ok(()));
    board.receive(0x301, &[4, 0, 0, 0]);
    assert_eq!(board.read(0x607A, 0), Ok(4));
    // PDOs are ignored in Pre-operational.
    board.receive(0, &[128, 0]);
    board.receive(0x301, &[5, 0, 0, 0]);
    assert_eq!(board.read(0x607A, 0), Ok(4));
}

#[test]
fn a_short_pdo_is_reported_and_ignored_and_a_late_one_stops_the_drive() {
    let mut board = started();
    board.receive(0x301, &[1, 2, 3]);
    let sent = board.tick();
    assert_eq!(sent[0], Frame::new(0x81, &[0x10, 0x82, 0b1_0001, 0, 0, 0, 0, 0]));
    assert_eq!(board.read(0x607A, 0), Ok(0));
    board.receive(0x301, &[1, 0, 0, 0]);
    assert_eq!(board.tick()[0], Frame::new(0x81, &[0; 8]));
    assert_eq!(board.write(0x1401, 5, 10, 2), Ok(()));
    board.receive(0x301, &[1, 0, 0, 0]);
    assert_eq!(board.run(40), []);
    let sent = board.run(2);
    assert_eq!(sent[0], Frame::new(0x81, &[0x50, 0x82, 0b1_0001, 0, 0, 0, 0, 0]));
    assert_eq!(board.nodes[0].state(), NmtState::PreOperational);
}

#[test]
fn the_event_timer_of_a_synchronous_pdo_is_restarted_by_its_sync() {
    let mut board = started();
    assert_eq!(board.write(0x1401, 2, 1, 1), Ok(()));
    assert_eq!(board.write(0x1401, 5, 10, 2), Ok(()));
    let is_late = |frames: &[Frame]| frames.iter().any(|frame| codes(&[*frame]).contains(&0x8250));
    for (syncs, late) in [(true, false), (false, true)] {
        let mut found = false;
        for _ in 0..10 {
            board.receive(0x301, &[1, 0, 0, 0]);
            if syncs {
                board.receive(0x080, &[]);
            }
            found |= is_late(&board.run(8));
        }
        assert_eq!(found, late, "{syncs}");
    }
}

#[test]
fn a_counted_sync_without_valid_counter_is_ignored() {
    let mut board = started();
    assert_eq!(board.write(0x1019, 0, 4, 1), Ok(()));
    let sent = |board: &mut Board, data: &[u8]| {
        board.receive(0x080, data);
        board.frames().iter().filter(|frame| frame.id() == 0x281).count()
    };
    assert_eq!([sent(&mut board, &[]), sent(&mut board, &[5]), sent(&mut board, &[0])], [0; 3]);
    assert_eq!([sent(&mut board, &[1]), sent(&mut board, &[4])], [1; 2]);
}

/// Emergency codes of the first node among these frames.
fn codes(frames: &[Frame]) -> Vec<u16> {
    tests::codes(frames.iter().filter(|frame| frame.id() == 0x81)).iter().map(|(_, code)| *code).collect()
}

#[test]
fn reconfiguring_a_heartbeat_ends_its_error_and_the_next_is_reported() {
    let mut board = started();
    assert_eq!(board.write(0x1029, 1, 1, 1), Ok(()));
    for _ in 0..3 {
        assert_eq!(board.write(0x1016, 1, 80 << 16 | 10, 4), Ok(()));
        board.receive(0x750, &[5]);
        board.frames();
        board.now_us += 20_000;
        assert_eq!(codes(&board.frames()), [0x8130]);
        assert_eq!(board.write(0x1016, 1, 0, 4), Ok(()));
        assert_eq!(board.read(0x1001, 0), Ok(0));
        board.frames();
    }
}

#[test]
fn two_consumers_do_not_watch_the_same_node() {
    let mut board = started();
    let watch = |node: u32, time: u32| node << 16 | time;
    for (sub, setting, expected) in [
        (1, watch(80, 10), Ok(())),
        (2, watch(80, 20), Err(Abort::Incompatible as u32)),
        (2, watch(80, 0), Ok(())),
        (2, watch(81, 20), Ok(())),
        (1, watch(80, 30), Ok(())),
        (1, watch(0, 0), Ok(())),
        (2, watch(80, 20), Ok(())),
    ] {
        assert_eq!(board.write(0x1016, sub, setting, 4), expected, "{sub} {setting:x}");
    }
}

#[test]
fn another_pdo_does_not_end_the_error_of_a_late_one() {
    let mut board = started();
    for (object, value) in [(0x1400, 100), (0x1401, 0)] {
        assert_eq!(board.write(object, 5, value, 2), Ok(()));
    }
    assert_eq!(board.write(0x1029, 1, 1, 1), Ok(()));
    board.receive(0x201, &[0, 0]);
    board.frames();
    board.now_us += 101_000;
    assert_eq!(codes(&board.frames()), [0x8250]);
    board.receive(0x301, &[0; 4]);
    assert_eq!((codes(&board.frames()), board.read(0x1001, 0)), (Vec::new(), Ok(0x11)));
    board.receive(0x201, &[0, 0]);
    assert_eq!((codes(&board.frames()), board.read(0x1001, 0)), ([0].into(), Ok(0)));
}

#[test]
fn a_sync_without_its_counter_is_an_error_until_a_valid_one() {
    let mut board = started();
    assert_eq!(board.write(0x1019, 0, 10, 1), Ok(()));
    let mut emergency = |data: &[u8]| {
        board.receive(0x80, data);
        codes(&board.run(80)).first().copied()
    };
    // A counter out of its range has the right length.
    let expected = [(&[1][..], None), (&[], Some(0x8240)), (&[], None), (&[11], None), (&[2], Some(0))];
    for (data, code) in expected {
        assert_eq!(emergency(data), code, "{data:?}");
    }
}

#[test]
fn a_transmitted_pdo_says_no_remote_frames_and_keeps_its_inhibit_time_while_it_exists() {
    let mut board = started();
    for (cob, read) in [(0x181, 0x4000_0181), (0x4000_0181, 0x4000_0181), (0x8000_0181, 0xC000_0181)] {
        assert_eq!(board.write(0x1800, 1, cob, 4), Ok(()), "{cob:x}");
        assert_eq!(board.read(0x1800, 1), Ok(read));
        let expected = if cob & 1 << 31 == 0 { Err(Abort::Access as u32) } else { Ok(()) };
        assert_eq!(board.write(0x1800, 3, 20, 2), expected, "{cob:x}");
    }
    assert_eq!(board.read(0x1800, 3), Ok(20));
}
