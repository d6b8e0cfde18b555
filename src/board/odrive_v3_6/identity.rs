//! Which board this is, and why it started.

use super::registers::{apply, byte, load};
use super::settings::RESET_REASONS;
use super::settings::analog::{BLANK, VERSION_ADDRESS, stated};

/// Of a board on which the factory has written nothing: as said when the image was built.
const STATED: [u8; 3] = stated(option_env!("SCARAB_BOARD_VOLTS"));

/// What a board knows of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Unique number, lowest word first.
    pub unique: [u32; 3],
    /// Factory's version: major, minor, voltage; where nothing was written what the image was built for, else 255.
    pub version: [u8; 3],
    /// Why it started.
    pub reset: Reset,
}

/// Why the processor started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// The supply came.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// By its pin, as a debug probe does.
    Pin,
    /// By itself, after a crash.
    Software,
    /// Something hung.
    Watchdog,
    /// Something else.
    Other,
}

impl Reset {
    /// The word in records.
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
    /// Reads it, and clears the reset reasons for the next time.
    pub(super) fn read() -> Self {
        let reasons = load(RESET_REASONS.address);
        apply(&[RESET_REASONS]);
        let has = |bit: u32| reasons >> bit & 1 == 1;
        // The pin's bit comes with every other; brown-out's with power-on (RM0090 7.3.21).
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
        let burnt_in = [0, 1, 2].map(|place| byte(VERSION_ADDRESS + place));
        let version = if burnt_in == [BLANK; 3] { STATED } else { burnt_in };
        Self { unique, version, reset }
    }
}
