//! Random frames: all identifiers and lengths, interrupted transfers, two clients at once.

use super::*;
use crate::testing::TestRandom;

/// Whether the state bits of the statusword are a CiA 402 state.
fn is_state(word: u16) -> bool {
    matches!(word & 0x6F, 0x00 | 0x40 | 0x21 | 0x23 | 0x27 | 0x07 | 0x0F | 0x08)
}

/// A random frame, mostly a valid one.
fn frame(random: &mut TestRandom) -> (u16, Vec<u8>) {
    let [kind, a, b, c] = random.bits().to_le_bytes();
    // Separate random bytes, so that the choices are independent.
    let [cut, short, command, _] = random.bits().to_le_bytes();
    let mut data = [random.bits().to_le_bytes(), random.bits().to_le_bytes()].concat();
    let id = match kind % 8 {
        // Requests with an existing command and object.
        0..=3 => {
            let row = table::ROWS[usize::from(a) % table::ROWS.len()];
            let is_named = c & 0xC0 != 0;
            let index = row.index + u16::from(b) % u16::from(row.indices);
            let [low, high] = if is_named { index.to_le_bytes() } else { [0x0A, 0x10] };
            data[0] = [
                0x40, 0x40, 0x40, 0x23, 0x2F, 0x2B, 0x21, 0xA4, 0xA3, 0xC6, 0xA2, 0xC1, 0x60, 0x70, 0x00,
                0x80,
            ][usize::from(c % 16)];
            (data[1], data[2], data[3]) = (low, high, if is_named { row.sub + b % row.subs } else { 0 });
            match data[0] {
                0xA4 => (data[4], data[5]) = (data[4] & 0x7F, 0),
                0xA2 => (data[1], data[2]) = (data[1] & 7, data[2] | 1),
                _ => {}
            }
            0x601 + u16::from(b & 1)
        }
        4 => [0x000, 0x080, 0x750, 0x701][usize::from(a % 4)],
        5 => 0x200 + 0x100 * u16::from(a % 4) + u16::from(b % 3),
        _ => u16::from_le_bytes([a, b]) & 0x7FF,
    };
    let length = if cut % 4 == 0 { usize::from(short % 9) } else { 8 };
    data.truncate(if id == 0 { 2 } else { length });
    if id == 0 && cut % 4 != 0 {
        data[0] = [1, 128, 2, 130][usize::from(command % 4)];
        data[1] &= 3;
    }
    (id, data)
}

fn play(seed: u64, frames: u32) -> (u32, [u32; 4]) {
    let mut random = TestRandom::new(seed);
    let mut board = Board::started(1);
    let (mut most, mut seen) = (0, [0; 4]);
    for number in 0..frames {
        let (id, data) = frame(&mut random);
        board.receive(id, &data);
        if random.bits().is_multiple_of(64) {
            board.now_us += 2_000_000;
        }
        // A correct sequence that enables the leg, now and then.
        if random.bits().is_multiple_of(512) {
            for (id, data) in [
                (0, [130, 0]),
                (0, [1, 0]),
                (0x201, [6, 0]),
                (0x202, [6, 0]),
                (0x201, [15, 0]),
                (0x202, [15, 0]),
            ] {
                board.receive(id, &data);
                board.tick();
            }
        }
        if random.bits().is_multiple_of(4096) {
            let fault = crate::leg::Fault { code: crate::leg::FaultCode::Overspeed, joint: 1 };
            board.drive = board.drive.after(DriveEvent::Failed(fault), 4);
        }
        // The nodes report the leg's state at the beginning of the tick.
        let drive = board.drive;
        let answers = board.tick();
        most = most.max(answers.len() as u32);
        for answer in &answers {
            // At most eight bytes, and not an NMT command.
            assert!(answer.data().len() <= 8 && answer.id() != 0, "{number}: {answer:x?}");
        }
        for axis in &board.axes {
            let word = axis.statusword();
            assert!(is_state(word), "{number}: {word:x}");
            assert!(word & 0x806F != 0x27 || drive == DriveState::OperationEnabled, "{number}: {word:x}");
            // The leg is never enabled if a joint is not.
            assert!(board.drive != DriveState::OperationEnabled || word & 0x6F == 0x27, "{number}: {word:x}");
        }
        seen[0] += u32::from(board.drive == DriveState::OperationEnabled);
        seen[1] += u32::from(board.nodes[0].state() == NmtState::Operational);
        seen[2] +=
            answers.iter().filter(|frame| frame.id() == 0x581 && frame.data()[0] == 0x80).count() as u32;
        seen[3] +=
            answers.iter().filter(|frame| frame.id() == 0x581 && frame.data()[0] != 0x80).count() as u32;
    }
    (most, seen)
}

#[test]
fn random_frames_cause_no_panic_no_endless_answers_and_no_lone_joint() {
    let frames = std::env::var("SCARAB_FRAMES").ok().and_then(|text| text.parse().ok()).unwrap_or(50_000);
    let (most, seen) = play(1, frames);
    println!(
        "{frames} frames: at most {most} frames in one tick, enabled/operational/aborts/answers {seen:?}"
    );
    // Two nodes may send a block of 127 segments each, and the other frames of one tick.
    assert!(most < 2 * (127 + 16), "{most}");
    // Each outcome must occur often enough.
    assert!(seen.iter().all(|&count| count > frames / 200), "{seen:?}");
}
