//! Identity of the board, and the reason of its last reset.

use super::registers::{apply, byte, load};
use super::settings::RESET_REASONS;
use super::settings::analog::{BLANK, VERSION_ADDRESS, stated};
use super::settings::flash::{OPTCR, brown_out_level};
use crate::listed::listed;

/// Version of a board without a factory entry, as stated when the image was built.
const STATED: [u8; 3] = stated(option_env!("SCARAB_BOARD_VOLTS"));

/// Identity of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Unique number, lowest word first.
    pub unique: [u32; 3],
    /// Factory version: major, minor, voltage. Without a factory entry the version stated for the
    /// image, else 255.
    pub version: [u8; 3],
    /// Reason of the last reset.
    pub reset: Reset,
    /// Brown-out reset level, 0 (off) to 3.
    pub brown_out: u8,
}

listed! {
    /// Reason of a processor reset.
    pub enum Reset {
        /// All reasons, in the order of the enum.
        ALL,
        /// Name used in records.
        name;
        /// Power-on.
        PowerOn, "power_on";
        /// Supply sagged.
        BrownOut, "brown_out";
        /// Reset pin, as used by a debug probe.
        Pin, "pin";
        /// Software reset after a crash.
        Software, "software";
        /// Watchdog expired.
        Watchdog, "watchdog";
        /// Any other reason.
        Other, "other";
    }
}

impl Identity {
    /// Reads the identity, and clears the reset reasons for the next time.
    pub(super) fn read() -> Self {
        let reasons = load(RESET_REASONS.address);
        apply(&[RESET_REASONS]);
        let has = |bit: u32| reasons >> bit & 1 == 1;
        // The pin's bit accompanies every other; brown-out's accompanies power-on (RM0090 7.3.21).
        let reset = match () {
            () if has(29) || has(30) => Reset::Watchdog,
            () if has(28) => Reset::Software,
            () if has(27) => Reset::PowerOn,
            () if has(25) => Reset::BrownOut,
            () if has(26) => Reset::Pin,
            () => Reset::Other,
        };
        let bytes = embassy_stm32::uid::uid();
        let mut unique = [0; 3];
        for (slot, word) in unique.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *slot = u32::from_le_bytes(*word);
        }
        let burnt_in = [0, 1, 2].map(|index| byte(VERSION_ADDRESS + index));
        let version = if burnt_in == [BLANK; 3] { STATED } else { burnt_in };
        Self { unique, version, reset, brown_out: brown_out_level(load(OPTCR)) }
    }
}
