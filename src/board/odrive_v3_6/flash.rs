//! Flash for persistent data and new images, behind `embedded-storage`'s trait.
//!
//! **What a write costs.** The chip has one bank. A write takes 16 us a word (100 at most), an erase 0.25 s a
//! sector of 16 KB (0.5 at most), 1 s one of 128 KB (2 at most). Every fetch from flash stalls until then:
//! current loops, servo, bus, watchdog. So nothing is changed unless the registers show both main outputs
//! off, the brake resistor's duty zero, and a supply that words of 32 bits need. The caller's word is not
//! enough: a duty would stay on during the stall. `operation::Storing` does the rest: it raises the inhibit
//! first, informs hosts and stretches the watchdog.
//!
//! An erase stops the executors' timer (TIM5). An overflow missed during the stall would leave the time half
//! a period wrong for ever; with stopped time no deadline passes. The driver also empties the data cache,
//! which an erase does not invalidate.
//!
//! Source: RM0090 3.6, 3.9; times DS8626 table 42 (words of 32 bits).

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use cortex_m::peripheral::DWT;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use scarab_boot::Region;

use super::registers::{copy, load, store};
use super::settings::CLOCK_HZ;
use super::settings::flash::{ACR, BUSY, CACHE, CR, KEYR, KEYS, LOCK, PROGRAM, SR, START, WRONG};
use super::{brake, bridge, settings, watchdog};

/// Longest wait, processor cycles: 2.5 s for an erased sector, 1 ms for a word.
const ERASED: u32 = 5 * CLOCK_HZ / 2;
const WRITTEN: u32 = CLOCK_HZ / 1000;
/// Control register of the executors' timer, and its enable bit.
const TIM5_CR1: u32 = 0x4000_0C00;
const COUNTS: u32 = 1;

/// Reason for which nothing was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Range beyond the region.
    OutOfBounds,
    /// Range not in whole words or sectors.
    NotAligned,
    /// A bridge or the brake resistor is on.
    Armed,
    /// The processor's supply is too low.
    Supply,
    /// The flash reports an error or does not answer.
    Failed,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::Armed | Self::Supply | Self::Failed => NorFlashErrorKind::Other,
        }
    }
}

/// Polls a future that must complete at once: the flash driver never waits.
pub fn at_once<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

/// A region of the flash as one range that begins at 0. Each region has one owner; two would undo each
/// other's writes. All sectors of a region have `SECTOR` bytes.
pub struct Flash<const SECTOR: usize> {
    region: Region,
}

/// A new image.
pub type LargeSectors = Flash<{ Region::NEW_IMAGE.sector_bytes as usize }>;
/// Stored parameters, or the state of an update.
pub type SmallSectors = Flash<{ Region::PARAMETERS.sector_bytes as usize }>;

impl LargeSectors {
    /// Space of the new image, for the owner of the update.
    pub const fn new_image() -> Self {
        Self { region: Region::NEW_IMAGE }
    }
}

impl SmallSectors {
    /// Stored parameters, for the owner of the store.
    pub const fn parameters() -> Self {
        Self { region: Region::PARAMETERS }
    }

    /// State of an update, for its owner.
    pub const fn state() -> Self {
        Self { region: Region::STATE }
    }
}

/// Copies bytes of a region.
pub fn read(region: &Region, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
    copy(checked_address(region, offset, bytes.len())?, bytes);
    Ok(())
}

/// Whether the processor's supply is too low to change the flash.
pub fn supply_is_low() -> bool {
    let (register, is_low) = settings::SUPPLY;
    load(register) & is_low != 0
}

/// Unlocks the flash for one change and locks it again.
#[inline(never)]
fn change(control: u32, patience: u32, address: u32, value: u32) -> Result<(), FlashError> {
    if !bridge::are_disabled() || brake::is_on() {
        return Err(FlashError::Armed);
    }
    if supply_is_low() {
        return Err(FlashError::Supply);
    }
    store(SR, WRONG);
    for key in KEYS {
        store(KEYR, key);
    }
    store(CR, control);
    store(address, value);
    cortex_m::asm::dsb();
    let begun = DWT::cycle_count();
    while load(SR) & BUSY != 0 && DWT::cycle_count().wrapping_sub(begun) < patience {}
    let status = load(SR);
    store(CR, LOCK);
    if status & (BUSY | WRONG) == 0 { Ok(()) } else { Err(FlashError::Failed) }
}

/// Address of a range, if it lies within the region.
fn checked_address(region: &Region, offset: u32, length: usize) -> Result<u32, FlashError> {
    match offset.checked_add(length as u32) {
        Some(end) if end <= region.bytes() => Ok(region.address + offset),
        _ => Err(FlashError::OutOfBounds),
    }
}

/// Erases the sectors of a range.
#[inline(never)]
fn erase(region: &Region, from: u32, to: u32) -> Result<(), FlashError> {
    let bytes = region.sector_bytes;
    if from > to || !from.is_multiple_of(bytes) || !to.is_multiple_of(bytes) {
        return Err(FlashError::NotAligned);
    }
    checked_address(region, from, (to - from) as usize)?;
    for number in region.sector + from / bytes..region.sector + to / bytes {
        // The stretched watchdog covers the time of one sector, perhaps not of two.
        watchdog::feed();
        store(TIM5_CR1, load(TIM5_CR1) & !COUNTS);
        let chosen = settings::flash::erase(number);
        let erased = change(chosen, ERASED, CR, chosen | START);
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

/// Programs whole words.
#[inline(never)]
fn write(region: &Region, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
    let first = checked_address(region, offset, bytes.len())?;
    let (words, rest) = bytes.as_chunks::<4>();
    if !rest.is_empty() || !first.is_multiple_of(4) {
        return Err(FlashError::NotAligned);
    }
    for (address, word) in (first..).step_by(4).zip(words) {
        change(PROGRAM, WRITTEN, address, u32::from_le_bytes(*word))?;
    }
    Ok(())
}

impl<const SECTOR: usize> ErrorType for Flash<SECTOR> {
    type Error = FlashError;
}

impl<const SECTOR: usize> ReadNorFlash for Flash<SECTOR> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        read(&self.region, offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.region.bytes() as usize
    }
}

impl<const SECTOR: usize> NorFlash for Flash<SECTOR> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        erase(&self.region, from, to)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        write(&self.region, offset, bytes)
    }
}
