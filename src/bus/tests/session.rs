//! Replays the recorded session of real host software with four nodes to this implementation.

use super::*;

const SESSION: &str = include_str!("../../../tests/data/corc_x2_session.candump");

/// Time in microseconds, identifier and data.
fn recorded() -> impl Iterator<Item = (u64, u16, Vec<u8>)> {
    SESSION.lines().map(|line| {
        let mut words = line.split_whitespace();
        let time = words.next().expect("a time").trim_matches(['(', ')']);
        let (seconds, micro) = time.split_once('.').expect("seconds");
        let number = |text: &str| text.parse::<u64>().expect("a number");
        let id = u16::from_str_radix(words.nth(1).expect("an identifier"), 16).expect("hexadecimal");
        let data = words.skip(1).map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect();
        (number(seconds) * 1_000_000 + number(micro), id, data)
    })
}

/// Differences to the recording: answers without a counterpart here, and emergencies.
struct Replay {
    boards: [Board; 2],
    answered: usize,
    unasked: Vec<(u16, Vec<u8>)>,
    emergencies: usize,
}

/// The session as CORC of October 2022 to April 2025 has it: RPDO 1 also carries a placeholder of the outputs
/// (`entry`), so its frames have more bytes.
fn with_placeholder(entry: u32) -> impl Iterator<Item = (u64, u16, Vec<u8>)> {
    let length = usize::from(entry as u8 / 8);
    recorded().flat_map(move |(time, id, mut data)| {
        let mut frames = Vec::new();
        match (id, data.as_mut_slice()) {
            (0x601..=0x604, [0x2F, 0x00, 0x16, 0, count @ 1, ..]) => {
                *count = 2;
                let [a, b, c, d] = entry.to_le_bytes();
                frames.push((time, id, [0x23, 0x00, 0x16, 2, a, b, c, d].to_vec()));
                frames.push((time, id - 0x80, [0x60, 0x00, 0x16, 2, 0, 0, 0, 0].to_vec()));
            }
            (0x201..=0x204, _) => data.extend([0; 4].iter().take(length)),
            _ => {}
        }
        frames.push((time, id, data));
        frames
    })
}

fn replay(session: impl Iterator<Item = (u64, u16, Vec<u8>)>) -> Replay {
    let mut boards = [Board::started(1), Board::started(3)];
    let mut ours: Vec<Frame> = Vec::new();
    let mut result =
        Replay { boards: [Board::new(1), Board::new(3)], answered: 0, unasked: Vec::new(), emergencies: 0 };
    let begin = recorded().next().expect("a session").0;
    for (time_us, id, data) in session {
        for board in &mut boards {
            // The leg ticks at least once between two frames; long pauses are shortened to one tick.
            board.now_us = board.now_us.max(time_us - begin);
            ours.extend(board.tick());
        }
        if (0x581..=0x584).contains(&id) {
            match ours.iter().position(|frame| frame.id() == id) {
                Some(index) => {
                    assert_eq!(ours.remove(index).data(), data, "{id:x} at {time_us}");
                    result.answered += 1;
                }
                None => result.unasked.push((id, data)),
            }
        } else {
            assert!(!ours.iter().any(|frame| frame.id() == id + 0x580 - 0x600), "unused answer: {id:x}");
            for board in &mut boards {
                board.receive(id, &data);
                ours.extend(board.frames());
            }
        }
        result.emergencies += ours.iter().filter(|frame| (0x81..=0x84).contains(&frame.id())).count();
        ours.retain(|frame| frame.id() >> 7 == 0x580 >> 7);
    }
    result.boards = boards;
    result
}

#[test]
fn every_request_of_the_recorded_session_is_answered_as_recorded() {
    let Replay { answered, unasked, emergencies, .. } = replay(recorded());
    // 211 answers were recorded. The capture lost the request of one of them (node 1, modes of operation) and
    // both frames of another exchange, so one answer has no request.
    assert_eq!((answered, emergencies), (210, 0));
    assert_eq!(unasked, [(0x581, [0x60, 0x60, 0x60, 0, 0, 0, 0, 0].to_vec())]);
}

#[test]
fn all_four_nodes_are_configured_with_a_placeholder_of_either_length() {
    for entry in [0x2194_0010, 0x2194_0020, 0x60FE_0110, 0x60FE_0120] {
        let Replay { mut boards, answered, emergencies, .. } = replay(with_placeholder(entry));
        // One request more per node, each answered as by a node that accepts it.
        assert_eq!((answered, emergencies), (214, 0), "{entry:x}");
        for board in &mut boards {
            let node = u32::from(board.nodes[0].id().number());
            for (index, sub, value) in
                [(0x1600, 0, 2), (0x1600, 2, entry), (0x1400, 1, 0x200 + node), (0x1403, 1, 0x500 + node)]
            {
                assert_eq!(board.read(index, sub), Ok(value), "{entry:x} {index:x}");
            }
        }
    }
}

#[test]
fn the_recorded_session_configures_pdos_while_operational() {
    let Replay { mut boards, .. } = replay(recorded());
    for board in &mut boards {
        let node = u32::from(board.nodes[0].id().number());
        assert_eq!(board.nodes[0].state(), NmtState::Operational);
        let expected = [
            (0x1800, 1, 0x4000_0180 + node),
            (0x1801, 1, 0x4000_0280 + node),
            (0x1803, 2, 1),
            (0x1A01, 0, 2),
            (0x1A01, 2, 0x606C_0020),
            (0x1A03, 1, 0x219A_0020),
            (0x1402, 1, 0x400 + node),
            (0x1400, 2, 0xFF),
            (0x1601, 1, 0x607A_0020),
            (0x6083, 0, 240_000),
        ];
        for (index, sub, value) in expected {
            assert_eq!(board.read(index, sub), Ok(value), "{index:x}");
        }
        // The recording contains no SYNC; the next one triggers four PDOs per node.
        board.receive(0x80, &[]);
        let frames: Vec<(u16, usize)> =
            board.frames().iter().map(|frame| (frame.id(), frame.data().len())).collect();
        let node = node as u16;
        let of =
            |node: u16| [(0x180, 2), (0x280, 8), (0x380, 2), (0x480, 4)].map(|(base, n)| (base + node, n));
        assert_eq!(frames, [of(node), of(node + 1)].concat());
    }
}

#[test]
fn the_recorded_session_enables_one_joint_and_the_leg_waits_for_both() {
    let Replay { mut boards, .. } = replay(recorded());
    for board in &mut boards {
        // Shutdown (6) before enabling is recorded for nodes 1 and 3 only.
        let words = board.axes.map(|axis| axis.statusword());
        assert_eq!(words, [0x8000 | 0x237, 0x250], "{words:x?}");
        assert_eq!(board.drive, DriveState::SwitchOnDisabled);
        let knee = board.nodes[1].id();
        for word in [0x06, 0x3F] {
            board.receive(knee.on(0x200), &[word, 0]);
            board.run(4);
        }
        assert_eq!(board.drive, DriveState::OperationEnabled);
        assert_eq!(board.axes.map(|axis| axis.statusword()), [0x237; 2]);
    }
}
