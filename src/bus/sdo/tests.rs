//! Tests of the server against an independent client by CiA 301, which may also lose segments.

use super::super::Frame;
use super::super::tests::{Board, LONG, LONG_TEXT, value};
use super::*;

fn request(command: u8, index: u16, rest: [u8; 4]) -> [u8; 8] {
    let [low, high] = index.to_le_bytes();
    let [a, b, c, d] = rest;
    [command, low, high, 0, a, b, c, d]
}

fn code(answer: Option<[u8; 8]>) -> Option<u32> {
    value(answer?).err()
}

#[test]
fn a_segmented_upload_is_complete() {
    let mut board = Board::started(1);
    let begin = board.ask(request(0x40, 0x100A, [0; 4])).expect("an answer");
    assert_eq!(begin, request(0x41, 0x100A, (LONG as u32).to_le_bytes()));
    let mut bytes: Vec<u8> = Vec::new();
    let mut toggle = 0;
    loop {
        let answer = board.ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]).expect("a segment");
        assert_eq!(answer[0] & 0xF0, toggle);
        bytes.extend(&answer[1..8 - usize::from(answer[0] >> 1 & 7)]);
        toggle ^= 0x10;
        if answer[0] & 1 != 0 {
            break;
        }
    }
    assert_eq!(bytes, LONG_TEXT.as_bytes());
    // A request after the last segment is refused.
    assert_eq!(code(board.ask([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0])), Some(0x0504_0001));
}

#[test]
fn a_segment_with_the_wrong_toggle_ends_the_transfer() {
    let mut board = Board::started(1);
    board.ask(request(0x40, 0x100A, [0; 4]));
    assert_eq!(code(board.ask([0x70, 0, 0, 0, 0, 0, 0, 0])), Some(0x0503_0000));
    assert_eq!(code(board.ask([0x60, 0, 0, 0, 0, 0, 0, 0])), Some(0x0504_0001));
}

/// Uploads by blocks; `receives(n)` says whether the client receives the nth segment.
fn block_upload(
    board: &mut Board,
    block: u8,
    mut receives: impl FnMut(usize) -> bool,
) -> (Vec<u8>, u16, usize) {
    let begin = board.ask(request(0xA4, 0x100A, [block, 0, 0, 0])).expect("an answer");
    assert_eq!(begin, request(0xC6, 0x100A, (LONG as u32).to_le_bytes()));
    let id = board.nodes[0].id();
    let (mut bytes, mut segments): (Vec<u8>, usize) = (Vec::new(), 0);
    let mut send = [0xA3, 0, 0, 0, 0, 0, 0, 0];
    loop {
        board.receive(id.on(0x600), &send);
        let sent = board.frames();
        let own = sent.iter().filter(|frame| frame.id() == id.on(0x580));
        let frames: Vec<[u8; 8]> = own.map(|frame| frame.full().expect("eight bytes")).collect();
        if let [end] = frames[..]
            && end[0] & 0xE3 == 0xC1
        {
            bytes.truncate(bytes.len() - usize::from(end[0] >> 2 & 7));
            board.receive(id.on(0x600), &[0xA1, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(board.frames(), []);
            return (bytes, u16::from_le_bytes([end[1], end[2]]), segments);
        }
        assert!(!frames.is_empty() && frames.len() <= usize::from(block), "{frames:x?}");
        let mut taken = 0;
        for frame in frames {
            segments += 1;
            if receives(segments) && frame[0] & 0x7F == taken + 1 {
                taken += 1;
                bytes.extend(&frame[1..]);
            }
        }
        send = [0xA2, taken, block, 0, 0, 0, 0, 0];
    }
}

#[test]
fn a_block_upload_is_complete_despite_lost_segments() {
    let expected = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM).checksum(LONG_TEXT.as_bytes());
    for block in [1, 2, 50, 126, 127] {
        let (bytes, sum, segments) = block_upload(&mut Board::started(1), block, |_| true);
        assert_eq!((&bytes[..], sum), (LONG_TEXT.as_bytes(), expected), "{block}");
        assert_eq!(segments, LONG.div_ceil(7), "{block}");
    }
    // The client loses every fifth, every 64th or the last segment; after 2000 segments it loses none.
    for lost in [5, 64, LONG.div_ceil(7)] {
        let (bytes, sum, segments) =
            block_upload(&mut Board::started(1), 127, |segment| segment > 2000 || segment % lost != 0);
        assert_eq!((&bytes[..], sum), (LONG_TEXT.as_bytes(), expected), "{lost}");
        assert!(segments > LONG.div_ceil(7), "{lost}");
    }
}

#[test]
fn the_threshold_selects_expedited_or_block_upload() {
    // Threshold 4: expedited. Threshold 0: a block of one segment.
    let mut board = Board::started(1);
    let whole = board.ask(request(0xA4, 0x1000, [127, 4, 0, 0]));
    assert_eq!(whole, Some(request(0x43, 0x1000, 0x0002_0192_u32.to_le_bytes())));
    let begun = board.ask(request(0xA4, 0x1000, [127, 0, 0, 0])).expect("an answer");
    assert_eq!(begun, request(0xC6, 0x1000, [4, 0, 0, 0]));
    assert_eq!(board.ask([0xA3, 0, 0, 0, 0, 0, 0, 0]), Some([0x81, 0x92, 0x01, 0x02, 0, 0, 0, 0]));
    let end = board.ask([0xA2, 1, 127, 0, 0, 0, 0, 0]).expect("the end");
    assert_eq!(end[0], 0xC1 | 3 << 2);
    let own = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM).checksum(&[0x92, 0x01, 0x02, 0x00]);
    assert_eq!(u16::from_le_bytes([end[1], end[2]]), own);
}

#[test]
fn invalid_block_sizes_and_segment_numbers_are_refused() {
    let mut board = Board::started(1);
    for block in [0, 128, 255] {
        assert_eq!(code(board.ask(request(0xA4, 0x100A, [block, 0, 0, 0]))), Some(0x0504_0002));
    }
    board.ask(request(0xA4, 0x100A, [3, 0, 0, 0]));
    board.receive(0x601, &[0xA3, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(board.frames().len(), 3);
    assert_eq!(code(board.ask([0xA2, 4, 3, 0, 0, 0, 0, 0])), Some(0x0504_0003));
}

/// Writes the heartbeat time by blocks; `n` and `sum` are sent in the end message.
fn block_download(board: &mut Board, size: u32, bytes: [u8; 7], n: u8, sum: u16) -> Option<u32> {
    let begun = board.ask(request(0xC6, 0x1017, size.to_le_bytes()));
    if code(begun).is_some() {
        return code(begun);
    }
    assert_eq!(begun, Some(request(0xA4, 0x1017, [127, 0, 0, 0])));
    let [a, b, c, d, e, f, g] = bytes;
    // A segment out of order is ignored and requested again.
    assert_eq!(board.ask([0x82, 9, 9, 9, 9, 9, 9, 9]), Some([0xA2, 0, 127, 0, 0, 0, 0, 0]));
    assert_eq!(board.ask([0x81, a, b, c, d, e, f, g]), Some([0xA2, 1, 127, 0, 0, 0, 0, 0]));
    let [low, high] = sum.to_le_bytes();
    let end = board.ask([0xC1 | n << 2, low, high, 0, 0, 0, 0, 0]);
    if code(end).is_none() {
        assert_eq!(end, Some([0xA1, 0, 0, 0, 0, 0, 0, 0]));
    }
    code(end)
}

#[test]
fn a_block_download_needs_the_right_size_and_check_sum() {
    let bytes = [0xE8, 0x03, 0, 0, 0, 0, 0];
    let sum = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM).checksum(&bytes[..2]);
    let mut board = Board::started(1);
    assert_eq!(block_download(&mut board, 2, bytes, 5, sum ^ 1), Some(0x0504_0004));
    assert_eq!(block_download(&mut board, 2, bytes, 6, sum), Some(0x0504_0004));
    assert_eq!(block_download(&mut board, 4, bytes, 3, sum), Some(0x0607_0012));
    assert_eq!(block_download(&mut board, 1, bytes, 3, sum), Some(0x0607_0013));
    assert_eq!(board.read(0x1017, 0), Ok(0));
    assert_eq!(block_download(&mut board, 2, bytes, 5, sum), None);
    board.frames();
    assert_eq!(board.read(0x1017, 0), Ok(1000));
}

#[test]
fn a_block_download_without_check_sum_ignores_the_sum() {
    let mut board = Board::started(1);
    assert_eq!(board.ask(request(0xC2, 0x1017, [2, 0, 0, 0])), Some(request(0xA4, 0x1017, [127, 0, 0, 0])));
    assert_eq!(board.ask([0x81, 0xE8, 0x03, 0, 0, 0, 0, 0]), Some([0xA2, 1, 127, 0, 0, 0, 0, 0]));
    assert_eq!(board.ask([0xC1 | 5 << 2, 0x12, 0x34, 0, 0, 0, 0, 0]), Some([0xA1, 0, 0, 0, 0, 0, 0, 0]));
    board.frames();
    assert_eq!(board.read(0x1017, 0), Ok(1000));
}

#[test]
fn a_segmented_download_needs_the_right_size() {
    let mut board = Board::started(1);
    let begun = board.ask(request(0x21, 0x6065, 4_u32.to_le_bytes()));
    assert_eq!(begun, Some(request(0x60, 0x6065, [0; 4])));
    assert_eq!(board.ask([5 << 1, 0x40, 0xE2, 0, 0, 0, 0, 0]), Some([0x20, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(board.ask([0x10 | 5 << 1 | 1, 0x01, 0, 0, 0, 0, 0, 0]), Some([0x30, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(board.read(0x6065, 0), Ok(123_456));
    board.ask(request(0x20, 0x6065, [0; 4]));
    assert_eq!(code(board.ask([5 << 1 | 1, 1, 0, 0, 0, 0, 0, 0])), Some(0x0607_0013));
    board.ask(request(0x20, 0x6065, [0; 4]));
    assert_eq!(code(board.ask([1, 1, 2, 3, 4, 5, 6, 7])), Some(0x0607_0012));
}

#[test]
fn a_timeout_is_reported_once_and_an_abort_is_not_answered() {
    let mut board = Board::started(1);
    board.ask(request(0x40, 0x100A, [0; 4]));
    board.now_us += TIMEOUT_US - 1;
    assert_eq!(board.frames(), []);
    board.now_us += 1;
    let timeout = [0x80, 0x0A, 0x10, 0, 0x00, 0x00, 0x04, 0x05];
    assert_eq!(board.frames(), [Frame::new(0x581, &timeout)]);
    board.now_us += TIMEOUT_US;
    assert_eq!(board.frames(), []);
    board.ask(request(0x40, 0x100A, [0; 4]));
    assert_eq!(board.ask([0x80, 0x0A, 0x10, 0, 0, 0, 4, 5]), None);
    assert_eq!(code(board.ask([0x60, 0, 0, 0, 0, 0, 0, 0])), Some(0x0504_0001));
}

#[test]
fn the_client_timeout_restarts_after_the_board_stood_still() {
    let mut board = Board::started(1);
    board.ask(request(0x40, 0x100A, [0; 4]));
    board.now_us += 10 * TIMEOUT_US;
    board.nodes[0].stood_still(board.now_us);
    board.now_us += TIMEOUT_US - 1;
    assert_eq!(board.frames(), []);
    board.now_us += 1;
    assert_eq!(board.frames().len(), 1, "the timeout is not longer than before");
}
