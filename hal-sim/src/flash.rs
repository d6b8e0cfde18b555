//! Flash memory of a microcontroller, with a power failure at any byte.
//!
//! Programming clears bits, erasing a sector sets them:
//!
//! ```text
//! program: byte := byte AND data     erase: every byte of a sector := FF     both from the lowest address up
//! power fails at byte k: below k done, above k unchanged, k a random mix of both
//! ```
//!
//! Why: persistence over a power cut can only be tested by cutting at every byte. A byte that was cut in the
//! middle always reads the same here. A real half-programmed cell may read differently each time, which is
//! not modelled. Wear is counted, not modelled: erasures of each sector, and all bytes programmed or erased.

use embedded_storage_async::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// Reason for which a flash operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Address or length out of bounds, or not in whole words or sectors.
    Request(NorFlashErrorKind),
    /// The power failed, now or before.
    NoPower,
}

impl From<NorFlashErrorKind> for FlashError {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self::Request(kind)
    }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Request(kind) => *kind,
            Self::NoPower => NorFlashErrorKind::Other,
        }
    }
}

/// `SECTORS` sectors of `BYTES` bytes, programmed four bytes at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Flash<const BYTES: usize, const SECTORS: usize> {
    cells: [[u8; BYTES]; SECTORS],
    /// Bytes until the power fails.
    left: Option<u64>,
    /// Bytes programmed or erased so far.
    worked: u64,
    erased: [u32; SECTORS],
    random: Xoshiro256PlusPlus,
}

impl<const BYTES: usize, const SECTORS: usize> Flash<BYTES, SECTORS> {
    /// An erased flash with power.
    pub fn new(seed: u64) -> Self {
        Self {
            cells: [[0xFF; BYTES]; SECTORS],
            left: None,
            worked: 0,
            erased: [0; SECTORS],
            random: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// Makes the power fail after this number of further bytes, in the middle of the next one. `None` keeps
    /// the power on.
    pub fn fail_after(&mut self, bytes: Option<u64>) {
        self.left = bytes;
    }

    /// Whether the power has failed.
    pub fn is_dead(&self) -> bool {
        self.left == Some(0)
    }

    /// Bytes programmed or erased so far.
    pub fn worked(&self) -> u64 {
        self.worked
    }

    /// Number of erasures of each sector.
    pub fn erasures(&self) -> &[u32; SECTORS] {
        &self.erased
    }

    /// All bytes, for reading or corrupting.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.cells.as_flattened_mut()
    }

    fn check(&self, from: usize, length: usize, grain: usize) -> Result<(), FlashError> {
        if from + length > BYTES * SECTORS {
            return Err(NorFlashErrorKind::OutOfBounds.into());
        }
        if !from.is_multiple_of(grain) || !length.is_multiple_of(grain) {
            return Err(NorFlashErrorKind::NotAligned.into());
        }
        Ok(())
    }

    /// Changes one byte to `aim`; fails when the power fails.
    fn work(&mut self, address: usize, aim: u8) -> Result<(), FlashError> {
        let Some(cell) = self.cells.as_flattened_mut().get_mut(address) else {
            return Err(NorFlashErrorKind::OutOfBounds.into());
        };
        match &mut self.left {
            Some(0) => return Err(FlashError::NoPower),
            Some(left) => *left -= 1,
            None => {}
        }
        if self.left == Some(0) {
            // A random part of the bits to change did change.
            *cell ^= (*cell ^ aim) & self.random.next_u32() as u8;
            return Err(FlashError::NoPower);
        }
        *cell = aim;
        self.worked += 1;
        Ok(())
    }
}

impl<const BYTES: usize, const SECTORS: usize> ErrorType for Flash<BYTES, SECTORS> {
    type Error = FlashError;
}

impl<const BYTES: usize, const SECTORS: usize> ReadNorFlash for Flash<BYTES, SECTORS> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, into: &mut [u8]) -> Result<(), FlashError> {
        self.check(offset as usize, into.len(), Self::READ_SIZE)?;
        if self.is_dead() {
            return Err(FlashError::NoPower);
        }
        let from = offset as usize;
        let bytes = self.cells.as_flattened().get(from..from + into.len());
        into.copy_from_slice(bytes.ok_or(NorFlashErrorKind::OutOfBounds)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES * SECTORS
    }
}

impl<const BYTES: usize, const SECTORS: usize> NorFlash for Flash<BYTES, SECTORS> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.check(from as usize, (to as usize).saturating_sub(from as usize), Self::ERASE_SIZE)?;
        for sector in from as usize / BYTES..to as usize / BYTES {
            if let Some(erased) = self.erased.get_mut(sector) {
                *erased += 1;
            }
            for address in sector * BYTES..(sector + 1) * BYTES {
                self.work(address, 0xFF)?;
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.check(offset as usize, bytes.len(), Self::WRITE_SIZE)?;
        for (index, byte) in bytes.iter().enumerate() {
            let address = offset as usize + index;
            let there = self.cells.as_flattened().get(address).copied().unwrap_or(0xFF);
            self.work(address, there & byte)?;
        }
        Ok(())
    }
}

impl<const BYTES: usize, const SECTORS: usize> MultiwriteNorFlash for Flash<BYTES, SECTORS> {}
