use super::super::Frame;
use super::super::tests::Board;
use super::*;
use crate::bus::Objects;
use crate::bus::dictionary::Object;
use crate::leg::DriveState;
use crate::testing::TestRandom;

const MS: u64 = 1000;

/// Time at which silence is detected after these frames, checked every half millisecond.
fn begins(frames: &[(Kind, u64)], until_us: u64) -> Option<u64> {
    let mut silence = Silence::default();
    let mut frames = frames.iter().peekable();
    (0..until_us).step_by(500).find(|&now_us| {
        while let Some((kind, at_us)) = frames.next_if(|(_, at_us)| *at_us <= now_us) {
            silence.received(*kind, *at_us);
        }
        silence.begins(now_us)
    })
}

fn cyclic(kind: Kind, from_us: u64, period_us: u64, count: u64) -> Vec<(Kind, u64)> {
    (0..count).map(|index| (kind, from_us + index * period_us)).collect()
}

fn sorted(parts: &[Vec<(Kind, u64)>]) -> Vec<(Kind, u64)> {
    let mut all = parts.concat();
    all.sort_by_key(|(_, at_us)| *at_us);
    all
}

#[test]
fn twenty_frames_of_one_kind_arm_it_and_nineteen_do_not() {
    for kind in [Kind::Sync, Kind::Word, Kind::Receive(0), Kind::Receive(3)] {
        assert_eq!(begins(&cyclic(kind, MS, 2 * MS, 19), 2000 * MS), None, "{kind:?}");
        // The last of 20 frames comes at 39 ms.
        assert_eq!(begins(&cyclic(kind, MS, 2 * MS, 20), 2000 * MS), Some(139 * MS + 500));
    }
    // Nineteen frames of each of two kinds do not arm either.
    let two = sorted(&[cyclic(Kind::Sync, MS, 2 * MS, 19), cyclic(Kind::Word, 2 * MS, 2 * MS, 19)]);
    assert_eq!(begins(&two, 2000 * MS), None);
}

#[test]
fn the_time_is_ten_mean_periods() {
    for period in [20, 100, 240] {
        let last = MS + 39 * period * MS;
        let found = begins(&cyclic(Kind::Receive(1), MS, period * MS, 40), last + 4000 * MS);
        assert_eq!(found, Some(last + 10 * period * MS + 500), "{period}");
    }
}

#[test]
fn irregular_or_slow_frames_never_arm() {
    // Fewer than four frames per second: an operator, or polling software.
    assert_eq!(begins(&cyclic(Kind::Word, 0, 300 * MS, 200), 120_000 * MS), None);
    // Twelve frames in a burst, once a second.
    let bursts: Vec<_> =
        (0..60).flat_map(|second| cyclic(Kind::Word, second * 1000 * MS, 5 * MS, 12)).collect();
    assert_eq!(begins(&bursts, 70_000 * MS), None);
}

#[test]
fn jitter_pauses_and_a_new_rate_are_not_silence() {
    let mut random = TestRandom::new(1);
    let mut below = |bound: u64| random.below(bound);
    // One minute at 2 ms with intervals of 0 to 4 ms; one of 100 intervals is a pause of up to 95 ms.
    let mut now = 0;
    let host: Vec<_> = (0..30_000)
        .map(|_| {
            now += if below(100) == 0 { below(95 * MS) } else { below(4 * MS) };
            (Kind::Sync, now)
        })
        .collect();
    assert_eq!(begins(&host, now), None);
    // From 2 ms to 60 ms and back to 1 ms.
    let slow = cyclic(Kind::Sync, 100 * MS, 60 * MS, 100);
    let fast = cyclic(Kind::Sync, 6100 * MS, MS, 1000);
    assert_eq!(begins(&sorted(&[cyclic(Kind::Sync, 0, 2 * MS, 50), slow, fast]), 7100 * MS), None);
}

#[test]
fn a_kind_that_stops_while_another_continues_is_ignored() {
    let parts = [cyclic(Kind::Receive(2), 0, 2 * MS, 500), cyclic(Kind::Sync, 0, 10 * MS, 500)];
    assert_eq!(begins(&sorted(&parts), 5000 * MS), None);
    let last = 4990 * MS;
    assert_eq!(begins(&sorted(&parts), 6000 * MS), Some(last + 100 * MS + 500));
}

#[test]
fn the_fastest_kind_decides_but_two_periods_of_the_slowest_are_awaited() {
    // Periods of SYNC and controlword, ms, which end together; time after the last frame of any kind.
    for (fast, slow, time) in [(2, 240, 480), (2, 60, 120), (2, 20, 100), (20, 60, 200), (80, 240, 800)] {
        let last = 12_000 * MS;
        let until_last =
            |kind, period| cyclic(kind, last - 30 * slow * MS, period * MS, 30 * slow / period + 1);
        let host = sorted(&[until_last(Kind::Sync, fast), until_last(Kind::Word, slow)]);
        assert_eq!(begins(&host, last + 4000 * MS), Some(last + time * MS + 500), "{fast} {slow}");
    }
}

#[test]
fn a_host_that_gives_up_its_fastest_kind_is_not_silent() {
    // SYNC at 2 ms ends at 6 s in any phase of the controlword, which goes on every 240 ms.
    for phase in (0..240).step_by(20) {
        let word = cyclic(Kind::Word, phase * MS, 240 * MS, 40);
        let last = phase * MS + 39 * 240 * MS;
        let host = sorted(&[cyclic(Kind::Sync, 0, 2 * MS, 3000), word]);
        // The controlword alone has ten of its own periods.
        assert_eq!(begins(&host, last + 4000 * MS), Some(last + 2400 * MS + 500), "{phase}");
    }
}

impl Board {
    /// Sends `count` host cycles of 2 ms: SYNC, or a frame to the first node with the controlword.
    fn cycles(&mut self, id: u16, data: &[u8], count: u32) {
        for _ in 0..count {
            self.receive(id, data);
            self.run(8);
        }
    }

    fn moving() -> Self {
        let mut board = Self::started(1);
        board.receive(0, &[1, 0]);
        for word in [6, 7, 15] {
            for id in [0x201, 0x202] {
                board.receive(id, &[word, 0]);
            }
            board.run(4);
        }
        assert_eq!(board.drive, DriveState::OperationEnabled);
        board
    }
}

#[test]
fn a_silent_host_is_reported_and_stops_the_leg_by_its_option() {
    for (option, enabled) in [(0, true), (2, false), (3, false)] {
        let mut board = Board::moving();
        for axis in &mut board.axes {
            axis.write(Object::at(0x6007, 0), option).expect("an option");
        }
        board.cycles(0x80, &[], 50);
        board.run(380);
        assert_eq!(board.drive, DriveState::OperationEnabled, "98 ms");
        let frames = board.run(40);
        assert_eq!(board.drive == DriveState::OperationEnabled, enabled, "{option}");
        let reports = frames.iter().filter(|frame| frame.data().starts_with(&[0x0F, 0xFF]));
        assert!(reports.map(Frame::id).eq([0x81, 0x82]), "{frames:?}");
        assert_eq!(board.read(0x603F, 0), Ok(0xFF0F));
        // The host sends again.
        board.receive(0, &[1, 0]);
        board.receive(0x80, &[]);
        let frames = board.run(4);
        assert!(frames.iter().any(|frame| frame.id() == 0x81 && frame.data() == [0; 8]), "{frames:?}");
        assert_eq!(board.drive == DriveState::OperationEnabled, enabled);
    }
    let mut board = Board::moving();
    board.axes[0].write(Object::at(0x6007, 0), 1).expect("an option");
    board.cycles(0x201, &[15, 0], 50);
    board.run(440);
    assert_eq!(board.axes[0].take_fault(), Some(crate::leg::FaultCode::HostSilent));
    assert_eq!(board.axes[1].take_fault(), None, "the second node received no cyclic frames");
}

#[test]
fn a_cyclic_controlword_by_sdo_arms_the_detection() {
    let mut board = Board::moving();
    board.cycles(0x601, &[0x2B, 0x40, 0x60, 0, 15, 0, 0, 0], 50);
    board.run(440);
    assert_ne!(board.drive, DriveState::OperationEnabled);
    let mut board = Board::moving();
    // Other SDO requests do not arm.
    board.cycles(0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0], 50);
    board.run(4000);
    assert_eq!(board.drive, DriveState::OperationEnabled);
}

#[test]
fn a_host_that_stops_on_purpose_is_not_reported() {
    let quiet = |board: &mut Board| {
        let frames = board.run(4000);
        assert!(!frames.iter().any(|frame| frame.data().starts_with(&[0x0F, 0xFF])), "{frames:?}");
        board.nodes[0].state()
    };
    // The drive is off.
    let mut board = Board::moving();
    board.cycles(0x80, &[], 50);
    [0x201, 0x202].into_iter().for_each(|id| board.receive(id, &[0, 0]));
    assert_eq!(quiet(&mut board), crate::bus::NmtState::Operational);
    // An NMT command stops the drive without an error.
    let mut board = Board::moving();
    board.cycles(0x80, &[], 50);
    board.receive(0, &[2, 0]);
    quiet(&mut board);
    // The detection is switched off (2013).
    let mut board = Board::moving();
    for axis in &mut board.axes {
        axis.write(Object::at(0x2013, 0), 0).expect("off");
    }
    board.cycles(0x80, &[], 50);
    quiet(&mut board);
    assert_eq!(board.drive, DriveState::OperationEnabled);
    // The board could not receive for 3 s.
    let mut board = Board::moving();
    board.cycles(0x80, &[], 50);
    board.now_us += 3000 * MS;
    board.nodes.iter_mut().for_each(|node| node.stood_still(board.now_us));
    board.run(380);
    assert_eq!(board.drive, DriveState::OperationEnabled);
}
