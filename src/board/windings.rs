//! Temperatures of the windings in memory that survives a reset and a short power cut.
//!
//! Without them a board that restarts again and again would take its hot motors for less hot ones.
#![expect(unsafe_code, reason = "the section whose memory outlives a reset")]

use core::sync::atomic::{AtomicU32, Ordering};

use crate::checksum::Checksum;

/// Both temperatures as bits, and their checksum with [`MAGIC`].
#[unsafe(link_section = ".uninit.windings")]
static STORED: [AtomicU32; 3] = [const { AtomicU32::new(0) }; 3];

const MAGIC: u32 = 0x5749_4E44;

fn sum(words: [u32; 2]) -> u32 {
    words.into_iter().fold(Checksum::EMPTY.word(MAGIC), Checksum::word).value()
}

/// Writes both temperatures, degrees Celsius.
pub fn store(celsius: [f32; 2]) {
    let words = celsius.map(f32::to_bits);
    let [first, second, check] = &STORED;
    // A reset between these stores leaves a wrong checksum, and the windings are assumed warm.
    check.store(!sum(words), Ordering::SeqCst);
    first.store(words[0], Ordering::SeqCst);
    second.store(words[1], Ordering::SeqCst);
    check.store(sum(words), Ordering::SeqCst);
}

/// Temperatures before the start, degrees Celsius; `None` if the checksum is wrong.
#[must_use]
pub fn stored() -> Option<[f32; 2]> {
    let [first, second, check] = STORED.each_ref().map(|word| word.load(Ordering::SeqCst));
    let whole = check == sum([first, second]);
    whole.then(|| [first, second].map(f32::from_bits)).filter(|celsius| celsius.iter().all(|c| c.is_finite()))
}
