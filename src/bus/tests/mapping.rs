//! The compact PDO mapping of docs/bus.md.

use super::*;

/// Writes to the node at this position on the board.
fn set(board: &mut Board, joint: usize, index: u16, sub: u8, value: u32, size: u8) {
    board.nodes.rotate_left(joint);
    board.axes.rotate_left(joint);
    assert_eq!(board.write(index, sub, value, size), Ok(()), "{index:x} {sub}");
    board.nodes.rotate_right(joint);
    board.axes.rotate_right(joint);
}

fn map(board: &mut Board, joint: usize, communication: u16, cob: u32, kind: u32, mapped: &[u32]) {
    let mapping = communication + 0x200;
    set(board, joint, communication, 1, 0x8000_0000 | cob, 4);
    set(board, joint, mapping, 0, 0, 1);
    set(board, joint, communication, 2, kind, 1);
    for (sub, entry) in (1..).zip(mapped) {
        set(board, joint, mapping, sub, *entry, 4);
    }
    set(board, joint, mapping, 0, mapped.len() as u32, 1);
    set(board, joint, communication, 1, cob, 4);
}

/// Compact mapping of nodes 1 and 2 (docs/bus.md).
fn compact() -> Board {
    let mut board = Board::started(1);
    board.receive(0, &[1, 0]);
    board.frames();
    for joint in 0..2 {
        let node = 1 + joint as u32;
        // Statusword, position and short velocity at every SYNC; the other PDOs are disabled.
        map(&mut board, joint, 0x1800, 0x180 + node, 1, &[0x6041_0010, 0x6064_0020, 0x2010_0010]);
        for communication in 0x1801..=0x1803 {
            let default = 0x180 + 0x100 * (u32::from(communication) - 0x1800) + node;
            set(&mut board, joint, communication, 1, 0x8000_0000 | default, 4);
        }
        // Both joints' targets in one frame; each node skips the other's bytes.
        let targets = [[0x607A_0020, 0x0007_0020], [0x0007_0020, 0x607A_0020]][joint];
        map(&mut board, joint, 0x1401, 0x301, 1, &targets);
    }
    board
}

#[test]
fn the_compact_mapping_moves_two_joints_with_one_frame_and_answers_with_two() {
    let mut board = compact();
    board.receive(0x301, &[1, 2, 3, 0, 4, 5, 6, 0]);
    board.receive(0x080, &[]);
    let sent: Vec<(u16, usize)> =
        board.frames().iter().map(|frame| (frame.id(), frame.data().len())).collect();
    assert_eq!(sent, [(0x181, 8), (0x182, 8)]);
    let target = dictionary::Object::at(0x607A, 0);
    assert_eq!(board.axes.map(|axis| axis.read(target)), [Ok(0x0003_0201), Ok(0x0006_0504)]);
}
