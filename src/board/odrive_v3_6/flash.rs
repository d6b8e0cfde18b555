//! Flash for persistent data, behind `embedded-storage`'s trait.
//!
//! **What a write costs.** The chip has one bank. A write takes 16 us a word (100 at most), an erase 1 s a
//! sector (2 at most). Every fetch from flash stalls meanwhile: current loops, servo, bus, watchdog. So
//! nothing is changed unless the registers show both main outputs off and the brake resistor's duty zero. The
//! caller's word is not enough: a duty would stay on during the stall. `operation::Storing` does the rest: it
//! raises the inhibit first, informs hosts and stretches the watchdog.
//!
//! An erase stops the executors' timer (TIM5). An overflow missed during the stall would leave the time half
//! a period wrong for ever; with stopped time no deadline passes. The driver also empties the data cache,
//! which an erase does not invalidate.
//!
//! Source: RM0090 3.6, 3.9; times DS8626 table 42 (words of 32 bits).

use cortex_m::peripheral::DWT;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use super::registers::{copy, load, store};
use super::settings::CLOCK_HZ;
use super::settings::flash::{
    ACR, BUSY, BYTES, CACHE, CR, FIRST, KEYR, KEYS, LOCK, NUMBERS, PROGRAM, SECTOR, SR, START, WRONG, erase,
};
use super::{brake, bridge, watchdog};

/// Longest wait, processor cycles: 5 s for an erased sector, 1 ms for a word.
const ERASED: u32 = 5 * CLOCK_HZ;
const WRITTEN: u32 = CLOCK_HZ / 1000;
/// Control register of the executors' timer, and its enable bit.
const TIM5_CR1: u32 = 0x4000_0C00;
const COUNTS: u32 = 1;

/// Reason for which nothing was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Range beyond both sectors.
    OutOfBounds,
    /// Range not in whole words or sectors.
    NotAligned,
    /// A bridge or the brake resistor is on.
    Armed,
    /// The flash reports an error or does not answer.
    Failed,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::Armed | Self::Failed => NorFlashErrorKind::Other,
        }
    }
}

/// Both sectors as one range that begins at 0. Only one instance exists.
pub struct Flash(());

impl Flash {
    /// For the owner of the store; two instances would undo each other's writes.
    pub const fn new() -> Self {
        Self(())
    }

    /// Unlocks the flash for one change and locks it again.
    fn change(
        &mut self,
        control: u32,
        patience: u32,
        change: impl FnOnce(),
    ) -> Result<(), FlashError> {
        if !bridge::are_disabled() || brake::is_on() {
            return Err(FlashError::Armed);
        }
        store(SR, WRONG);
        for key in KEYS {
            store(KEYR, key);
        }
        store(CR, control);
        change();
        cortex_m::asm::dsb();
        let begun = DWT::cycle_count();
        while load(SR) & BUSY != 0 && DWT::cycle_count().wrapping_sub(begun) < patience {}
        let status = load(SR);
        store(CR, LOCK);
        if status & (BUSY | WRONG) == 0 { Ok(()) } else { Err(FlashError::Failed) }
    }
}

/// Address of a range, if it lies within both sectors.
fn place(offset: u32, length: usize) -> Result<u32, FlashError> {
    match offset.checked_add(length as u32) {
        Some(end) if end <= BYTES => Ok(FIRST + offset),
        _ => Err(FlashError::OutOfBounds),
    }
}

impl ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        copy(place(offset, bytes.len())?, bytes);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES as usize
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        if from > to || !from.is_multiple_of(SECTOR) || !to.is_multiple_of(SECTOR) {
            return Err(FlashError::NotAligned);
        }
        place(from, (to - from) as usize)?;
        for number in NUMBERS.into_iter().skip((from / SECTOR) as usize).take(((to - from) / SECTOR) as usize) {
            // The stretched watchdog covers the time of one sector, perhaps not of two.
            watchdog::feed();
            store(TIM5_CR1, load(TIM5_CR1) & !COUNTS);
            let chosen = erase(number);
            let erased = self.change(chosen, ERASED, || store(CR, chosen | START));
            store(TIM5_CR1, load(TIM5_CR1) | COUNTS);
            let [on, emptied] = CACHE;
            let access = load(ACR) & !(on | emptied);
            for value in [access, access | emptied, access, access | on] {
                store(ACR, value);
            }
            erased?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let first = place(offset, bytes.len())?;
        let (words, rest) = bytes.as_chunks::<4>();
        if !rest.is_empty() || !first.is_multiple_of(4) {
            return Err(FlashError::NotAligned);
        }
        for (address, word) in (first..).step_by(4).zip(words) {
            self.change(PROGRAM, WRITTEN, || store(address, u32::from_le_bytes(*word)))?;
        }
        Ok(())
    }
}
