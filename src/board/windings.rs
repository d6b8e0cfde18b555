//! Temperatures of the windings in memory that survives a reset and a short power cut.
//!
//! Without them a board that restarts again and again would take its hot motors for less hot ones.
#![expect(unsafe_code, reason = "memory that outlives a reset")]

use core::mem::MaybeUninit;
use core::ptr;

use crate::checksum::Checksum;

/// Both temperatures as bits, and their checksum with [`MAGIC`].
#[unsafe(link_section = ".uninit.windings")]
static mut STORED: MaybeUninit<[u32; WORDS]> = MaybeUninit::uninit();

const WORDS: usize = 3;
const MAGIC: u32 = 0x5749_4E44;

fn sum(words: [u32; 2]) -> u32 {
    words.into_iter().fold(Checksum::EMPTY.word(MAGIC), Checksum::word).value()
}

/// Writes both temperatures, degrees Celsius. Called by the housekeeping alone.
pub fn store(celsius: [f32; 2]) {
    let [first, second] = celsius.map(f32::to_bits);
    let address = (&raw mut STORED).cast::<u32>();
    // A reset between two of these stores leaves a wrong checksum, and the windings are assumed warm.
    for (word, value) in [first, second, sum([first, second])].into_iter().enumerate() {
        // SAFETY: the static exists, is aligned and has so many words. Only this function writes it, at one
        // priority level, and `stored` reads it before that level runs.
        unsafe { ptr::write_volatile(address.wrapping_add(word), value) };
    }
}

/// Temperatures before the start, degrees Celsius; `None` if the checksum is wrong. For the start, before the
/// housekeeping runs.
pub fn stored() -> Option<[f32; 2]> {
    let address = (&raw mut STORED).cast::<u32>();
    // SAFETY: as above; any bit pattern is a valid word. The read is volatile because the content was written
    // before this image began.
    let [first, second, check] = core::array::from_fn::<u32, WORDS, _>(|word| unsafe {
        ptr::read_volatile(address.wrapping_add(word))
    });
    let celsius = [first, second].map(f32::from_bits);
    let is_sound = check == sum([first, second]) && celsius.iter().all(|celsius| celsius.is_finite());
    is_sound.then_some(celsius)
}
