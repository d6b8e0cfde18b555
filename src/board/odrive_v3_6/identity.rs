//! Identity of the board, and the reason of its last reset.

use super::registers::{apply, byte, load};
use super::settings::RESET_REASONS;
use super::settings::analog::{BLANK, VERSION_ADDRESS, stated};
use super::settings::flash::{OPTCR, brown_out_level};

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

/// Reason of a processor reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power-on.
    PowerOn,
    /// Supply sagged.
    BrownOut,
    /// Reset pin, as used by a debug probe.
    Pin,
    /// Software reset after a crash.
    Software,
    /// Watchdog expired.
    Watchdog,
    /// Any other reason.
    Other,
}

impl Reset {
    /// Name used in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "power_on",
            Self::BrownOut => "brown_out",
            Self::Pin => "pin",
            Self::Software => "software",
            Self::Watchdog => "watchdog",
            Self::Other => "other",
        }
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
