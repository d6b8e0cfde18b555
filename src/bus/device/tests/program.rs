//! A new image by block and by segmented transfer, from an independent client by CiA 301.

use super::*;
use crate::bus::Abort;
use crate::bus::program::{ProgramCommand, ProgramStatus};
use crc::{CRC_16_XMODEM, Crc};
use scarab_boot::Region;

const CLEARED: ProgramStatus = ProgramStatus(ProgramStatus::STOPPED | ProgramStatus::CLEARED);

/// A bench whose program is stopped, and a consumer that takes few bytes at a time.
struct Receiver {
    bench: Bench,
    taken: Vec<u8>,
    per_round: usize,
}

impl Receiver {
    fn new(per_round: usize) -> Self {
        let mut bench = Bench::new();
        bench.device.update_program(CLEARED);
        Self { bench, taken: Vec::new(), per_round }
    }

    /// Sends one frame; returns the answer of the first node at once, if it has one.
    fn send(&mut self, data: &[u8]) -> Option<[u8; 8]> {
        self.bench.receive(0x601, data);
        self.round()
    }

    /// One round of the bus; the consumer takes its bytes.
    fn round(&mut self) -> Option<[u8; 8]> {
        for _ in 0..self.per_round {
            self.taken.extend(self.bench.device.take_program_byte());
        }
        self.bench.device.watch(self.bench.now_us, &NOTHING);
        let frames = self.bench.run(1);
        frames.iter().find(|frame| frame.id() == 0x581).and_then(|frame| frame.data().try_into().ok())
    }

    /// Waits for the answer; also returns the number of rounds.
    fn answer(&mut self, sent: Option<[u8; 8]>) -> ([u8; 8], usize) {
        let mut answer = sent;
        for round in 0..1000 {
            match answer {
                Some(answer) => return (answer, round),
                None => answer = self.round(),
            }
        }
        panic!("no answer");
    }

    fn ask(&mut self, data: &[u8]) -> [u8; 8] {
        let sent = self.send(data);
        self.answer(sent).0
    }
}

fn program() -> Vec<u8> {
    (0..3001_u32).map(|index| ((index * 31) >> 2) as u8).collect()
}

#[test]
fn blocks_arrive_complete_however_slow_their_consumer_is() {
    let program = program();
    for per_round in [1, 7, 300] {
        let mut receiver = Receiver::new(per_round);
        let [a, b, c, d] = (program.len() as u32).to_le_bytes();
        let begun = receiver.ask(&[0xC6, 0x50, 0x1F, 1, a, b, c, d]);
        assert_eq!(begun[0], 0xA4);
        let block = usize::from(begun[4]);
        let mut waited = 0;
        for (index, part) in program.chunks(7 * block).enumerate() {
            let mut sent = None;
            let count = part.len().div_ceil(7);
            for (number, segment) in part.chunks(7).enumerate() {
                assert_eq!(sent, None, "an answer within a block");
                let is_last = 7 * block * (index + 1) >= program.len() && number + 1 == count;
                let mut data = [0; 8];
                data[0] = (number as u8 + 1) | (u8::from(is_last) << 7);
                data[1..=segment.len()].copy_from_slice(segment);
                sent = receiver.send(&data);
            }
            let (answer, rounds) = receiver.answer(sent);
            assert_eq!(answer[..3], [0xA2, count as u8, block as u8]);
            waited += rounds;
        }
        assert_eq!(waited > 100, per_round == 1, "{per_round}: {waited}");
        let unused = (7 - program.len() % 7) as u8 % 7;
        let [low, high] = Crc::<u16>::new(&CRC_16_XMODEM).checksum(&program).to_le_bytes();
        assert_eq!(receiver.ask(&[0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0])[0], 0xA1);
        (0..1000).for_each(|_| assert_eq!(receiver.round(), None));
        assert!(receiver.taken == program, "{per_round}");
    }
}

#[test]
fn segments_arrive_complete_however_slow_their_consumer_is() {
    let program = program();
    for per_round in [1, 7] {
        let mut receiver = Receiver::new(per_round);
        let [a, b, c, d] = (program.len() as u32).to_le_bytes();
        assert_eq!(receiver.ask(&[0x21, 0x50, 0x1F, 1, a, b, c, d])[0], 0x60);
        let count = program.len().div_ceil(7);
        for (number, segment) in program.chunks(7).enumerate() {
            let toggle = (number as u8 & 1) << 4;
            let mut data = [toggle | (7 - segment.len() as u8) << 1 | u8::from(number + 1 == count); 8];
            data[1..=segment.len()].copy_from_slice(segment);
            assert_eq!(receiver.ask(&data)[0], 0x20 | toggle);
        }
        (0..1000).for_each(|_| assert_eq!(receiver.round(), None));
        assert!(receiver.taken == program, "{per_round}");
    }
}

#[test]
fn an_image_that_does_not_fit_or_comes_at_the_wrong_time_is_refused() {
    let begin = |length: u32| {
        let [a, b, c, d] = length.to_le_bytes();
        [0xC6, 0x50, 0x1F, 1, a, b, c, d]
    };
    let mut receiver = Receiver::new(1);
    assert_eq!(value(receiver.ask(&begin(Region::IMAGE.bytes() + 1))), Err(Abort::TooLong.code()));
    assert_eq!(value(receiver.ask(&[0x40, 0x50, 0x1F, 1, 0, 0, 0, 0])), Err(Abort::WriteOnly.code()));
    for status in [0, ProgramStatus::STOPPED, CLEARED.0 | ProgramStatus::UNDER_WAY] {
        receiver.bench.device.update_program(ProgramStatus(status));
        assert_eq!(value(receiver.ask(&begin(1000))), Err(Abort::State.code()), "{status:#x}");
    }
    // A client that does not wait for the acknowledgement of a block loses its transfer, not the board.
    receiver.bench.device.update_program(CLEARED);
    receiver.per_round = 0;
    assert_eq!(receiver.ask(&begin(1000))[0], 0xA4);
    let answers: Vec<[u8; 8]> = (0..70).filter_map(|number| receiver.send(&[number % 32 + 1; 8])).collect();
    assert_eq!(answers.first().map(|answer| value(*answer)), Some(Err(Abort::Sequence.code())));
}

#[test]
fn a_host_that_follows_one_that_left_within_a_block_is_answered() {
    let mut receiver = Receiver::new(300);
    let [a, b, c, d] = 1000_u32.to_le_bytes();
    assert_eq!(receiver.ask(&[0xC6, 0x50, 0x1F, 1, a, b, c, d])[0], 0xA4);
    assert_eq!(receiver.send(&[1; 8]), None);
    // The new host asks every 0.3 s; a round takes 0.25 ms.
    let read = [0x40, 0x57, 0x1F, 1, 0, 0, 0, 0];
    // A block download, whose first byte counts as the last segment of a block.
    let begin = [0xC6, 0x50, 0x1F, 1, a, b, c, d];
    for (request, answer) in [(read, [0x43, 0x57, 0x1F, 1]), (begin, [0xA4, 0x50, 0x1F, 1])] {
        let answered = (0..6).any(|_| {
            let mut answers = vec![receiver.send(&request)];
            answers.extend((0..1200).map(|_| receiver.round()));
            answers.into_iter().flatten().any(|found| found[..4] == answer)
        });
        assert!(answered, "{request:x?}");
        receiver.send(&[0x80, 0x50, 0x1F, 1, 0, 0, 0, 0]);
        receiver.bench.device.update_program(CLEARED);
        assert_eq!(receiver.ask(&begin)[0], 0xA4);
        assert_eq!(receiver.send(&[1; 8]), None);
    }
}

#[test]
fn both_nodes_show_the_same_program_and_a_command_is_passed_on_once() {
    let mut bench = Bench::new();
    bench.device.update_program(CLEARED);
    for node in [1, 2] {
        assert_eq!(value(bench.ask(node, [0x40, 0x57, 0x1F, 1, 0, 0, 0, 0])), Ok(CLEARED.0));
    }
    bench.write(2, 0x1F51, 1, 3, 1);
    assert_eq!(bench.device.take_program_command(), Some(ProgramCommand::Clear));
    assert_eq!(bench.device.take_program_command(), None);
}
