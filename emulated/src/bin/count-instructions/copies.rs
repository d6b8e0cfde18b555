//! Memory copies (`scarab::board::copy`): correctness at every length and alignment, and cost.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;

use crate::counter::{Tally, count, heading};

const WORDS: usize = 48;
/// Length that covers every path through the copies: rounds of 32 and of 16 bytes, and all remainders.
const LONGEST: usize = 100;
const ALIGNMENTS: usize = 4;
/// Fill around a copy.
const UNTOUCHED: u8 = 0xEE;
/// Largest instructions of a copy of 144 bytes, aligned and unaligned.
const MOST: [u32; 2] = [80, 140];

/// Prints the table; returns whether every copy is correct and within its bound.
pub fn report() -> bool {
    heading("copies of 144 bytes");
    let words: [u32; WORDS] = core::array::from_fn(|place| 0x0302_0100 + 0x0404_0404 * place as u32);
    let bytes = words.map(u32::to_le_bytes);
    let bytes = bytes.as_flattened();
    let mut met = true;
    for length in 0..=LONGEST {
        for from in 0..ALIGNMENTS {
            for to in 0..ALIGNMENTS {
                let mut place = [UNTOUCHED; LONGEST + 2 * ALIGNMENTS];
                let (begin, end) = (ALIGNMENTS + to, ALIGNMENTS + to + length);
                let (Some(source), Some(room)) = (bytes.get(from..from + length), place.get_mut(begin..end))
                else {
                    return false;
                };
                black_box(room).copy_from_slice(black_box(source));
                let is_whole = place.get(begin..end).is_some_and(|copy| copy.iter().eq(source));
                let beside = place.iter().take(begin).chain(place.iter().skip(end));
                if !is_whole || beside.into_iter().any(|byte| *byte != UNTOUCHED) {
                    hprintln!("a copy of {} bytes from {} to {} is wrong", length, from, to);
                    met = false;
                }
            }
        }
    }
    let mut place = [0_u32; WORDS];
    for length in 0..=WORDS {
        let (Some(source), Some(room)) = (words.get(..length), place.get_mut(..length)) else { return false };
        black_box(&mut *room).copy_from_slice(black_box(source));
        met &= room == source;
    }
    for (name, [from, to], most) in [("aligned", [0, 0], MOST[0]), ("not aligned", [1, 2], MOST[1])] {
        let mut place = [0; 4 * WORDS];
        let (Some(source), Some(room)) = (bytes.get(from..from + 144), place.get_mut(to..to + 144)) else {
            return false;
        };
        let mut tally = Tally::default();
        tally.push(count(|| black_box(room).copy_from_slice(black_box(source))).0);
        met &= tally.print_against(name, most);
    }
    met
}
