//! The running image and its update: header, flash of a new one, state that the bootloader reads.
#![expect(unsafe_code, reason = "section of the linker script")]

use embassy_boot::{FirmwareState, State};
use embedded_storage_async::nor_flash::NorFlash;
use scarab_boot::{HEADER_AT, HEADER_BYTES, Header, Region};

use super::flash::{LargeSectors, SmallSectors, at_once, read};
use super::registers::byte;
use crate::hal::ProgramMemory;

/// Header, completed after linking (`scarab_boot::seal`).
#[used]
#[unsafe(link_section = ".image_header")]
static HEADER: [u32; HEADER_BYTES / 4] = Header::UNSEALED;

/// Check sum of the running image; 0 if it was not sealed.
pub fn checksum() -> u32 {
    let mut bytes = [0; HEADER_BYTES];
    for (address, byte) in (Region::IMAGE.address + HEADER_AT..).zip(&mut bytes) {
        *byte = self::byte(address);
    }
    Header::decode(&bytes).map_or(0, |header| header.checksum)
}

/// Flash of an update.
pub struct BoardProgram {
    image: LargeSectors,
}

impl BoardProgram {
    /// For the owner of the update.
    pub const fn new() -> Self {
        Self { image: LargeSectors::new_image() }
    }

    /// Whether the running image is not confirmed: the bootloader has swapped it in.
    pub fn is_on_trial(&self) -> bool {
        let mut word = [0; 4];
        let state = at_once(FirmwareState::new(SmallSectors::state(), &mut word).get_state());
        matches!(state, Some(Ok(State::Swap)))
    }
}

impl ProgramMemory for BoardProgram {
    fn erase(&mut self, sector: u32) -> bool {
        let from = sector * Region::NEW_IMAGE.sector_bytes;
        at_once(self.image.erase(from, from + Region::NEW_IMAGE.sector_bytes)).is_some_and(|done| done.is_ok())
    }

    fn write(&mut self, offset: u32, word: [u8; 4]) -> bool {
        at_once(self.image.write(offset, &word)).is_some_and(|done| done.is_ok())
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) -> bool {
        read(&Region::NEW_IMAGE, offset, into).is_ok()
    }

    fn request_swap(&mut self) -> bool {
        let mut word = [0; 4];
        let mut state = FirmwareState::new(SmallSectors::state(), &mut word);
        at_once(state.mark_updated()).is_some_and(|done| done.is_ok())
    }

    fn confirm(&mut self) -> bool {
        let mut word = [0; 4];
        let mut state = FirmwareState::new(SmallSectors::state(), &mut word);
        at_once(state.mark_booted()).is_some_and(|done| done.is_ok())
    }

    fn restart(&mut self) {
        cortex_m::peripheral::SCB::sys_reset()
    }
}
