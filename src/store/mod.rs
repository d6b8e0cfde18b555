//! What outlives the power: objects of the bus, calibrations, the accepted model.
//!
//! Why: a leg that has to be calibrated and identified after each power cut is not used, and one that remembers wrongly pushes a
//! person wrongly. So nothing is kept that was not accepted, nothing is believed because it was kept, and a cut of the power
//! at any byte leaves the old value or the new one, never a mix.
//!
//! ```text
//! value --Kept::to_layout--> bytes: schema (2), layout --sequential-storage--> header with CRCs | key | bytes    two sectors in turn
//! value <--Kept::from_layout (ranges)-- layout <--defaults for what an older schema lacks-- bytes
//! ```
//!
//! | what is kept | key | taken back into use by |
//! | --- | --- | --- |
//! | objects of a node of the bus | 1, 2 | the bus |
//! | calibration of an axis | 3, 4 | `motor::Calibration`, past a check at the motor |
//! | model and where it comes from | 5 | `LegConfiguration::restore`, past the fingerprint |
//!
//! **Only while the bridges are released.** The one bank of the STM32F405's flash stands still while it is written (16 us a word)
//! or erased (1 to 2 s for 128 KB), and with it every instruction fetched from it, the current loop's too. Whoever stores
//! therefore shows a [`Permit`], which only a drive that is off gives. Reading may write as well: what a cut of the power left half done is
//! repaired by the first read that comes across it (`MapStorage::fetch_item`: a sector is erased, records are copied). So a board reads
//! at its start, before anything may switch, and its flash refuses whatever else (docs/store.md).
//!
//! **Wear.** A value that is already there is not written again. A sector is erased once per some 120 KB of records; measured
//! in `tests/store.rs`.
//!
//! Cost: the crate `sequential-storage` (its wear levelling and repair are tested by fuzzing there) and `zerocopy` (layouts).
//! Known limits: a record whose newest copy has rotted is answered by the copy before it, as after a cut; there is no clock,
//! so records carry a generation instead of a date.

mod calibration;
mod keeper;
mod model;
mod record;

pub use calibration::KeptCalibration;
pub use keeper::Keeper;
pub use model::{JointProvenance, KeptModel, Provenance};
pub use record::{Kept, RecordError};

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::leg::{DriveState, Permission};
use record::{HEAD, LONGEST};

/// A record as it lies in the flash, with its key, in whole words.
const BUFFER: usize = (LONGEST + HEAD + 1).next_multiple_of(8);

/// What is kept. Numbers never change and are never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Key {
    /// What a host changed of the first node's objects.
    Objects1 = 1,
    /// Of the second node's.
    Objects2 = 2,
    /// The first axis' calibration.
    Calibration1 = 3,
    /// The second axis'.
    Calibration2 = 4,
    /// The leg's model.
    Model = 5,
}

impl Key {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Objects1, Self::Objects2, Self::Calibration1, Self::Calibration2, Self::Model];
}

/// The bridges are released: given by a drive that is off, shown to whoever writes.
#[derive(Debug)]
pub struct Permit(());

impl Permit {
    /// Of a drive in this state; none where a bridge may switch.
    #[must_use]
    pub fn of(state: DriveState) -> Option<Self> {
        Self::under(state.permission())
    }

    /// Of a drive that has this permission.
    #[must_use]
    pub fn under(permission: Permission) -> Option<Self> {
        (permission == Permission::Released).then_some(Self(()))
    }
}

/// Why a range of flash cannot hold a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnfitRange;

/// Why nothing was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// The flash holds something else, or what was kept is damaged beyond repair: only [`Store::forget_all`] helps.
    Damaged,
    /// The flash did not answer.
    Flash,
    /// The record was read and makes no sense.
    Record(RecordError),
}

/// Why nothing was written; what was kept before is still there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError {
    /// As in [`LoadError::Damaged`].
    Damaged,
    /// The flash did not answer, or reads back otherwise than it was written.
    Flash,
    /// More than fits a record.
    TooLong,
    /// The record would not be taken back.
    Record(RecordError),
}

/// Whether the flash was touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// It was written.
    Written,
    /// It was there already.
    Unchanged,
}

/// What is kept, in a range of at least two sectors of a flash.
pub struct Store<F: NorFlash> {
    map: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    buffer: [u8; BUFFER],
}

impl<F: NorFlash> Store<F> {
    /// The store in these bytes of a flash. Nothing is read yet.
    ///
    /// # Errors
    /// [`UnfitRange`] unless the range begins and ends at sectors, holds two of them, and each of them holds two of the
    /// longest records.
    pub fn new(flash: F, range: Range<u32>) -> Result<Self, UnfitRange> {
        if F::ERASE_SIZE < 4 * BUFFER || range.end as usize > flash.capacity() || range.start > range.end {
            return Err(UnfitRange);
        }
        let config = MapConfig::try_new(range).map_err(|_| UnfitRange)?;
        Ok(Self { map: MapStorage::new(flash, config, Cache::new_uncached()), buffer: [0; BUFFER] })
    }

    /// What is kept under a key; `None` where nothing ever was.
    ///
    /// # Errors
    /// See [`LoadError`]. A record that makes no sense stays where it is.
    pub async fn load<R: Kept>(&mut self, key: Key) -> Result<Option<R>, LoadError> {
        match self.fetch(key).await? {
            Some(bytes) => record::decode(bytes).map(Some).map_err(LoadError::Record),
            None => Ok(None),
        }
    }

    /// Keeps a record in the place of what was there.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub async fn save<R: Kept>(&mut self, permit: &Permit, key: Key, kept: &R) -> Result<Saved, SaveError> {
        let mut bytes = [0; LONGEST + HEAD];
        let length = record::encode(kept, &mut bytes).map_err(SaveError::Record)?;
        self.keep(permit, key, bytes.get(..length).unwrap_or_default()).await
    }

    /// Bytes that somebody else understands, no longer than `into`; how many there are.
    ///
    /// # Errors
    /// See [`LoadError`].
    pub async fn load_bytes(&mut self, key: Key, into: &mut [u8]) -> Result<Option<usize>, LoadError> {
        let Some(bytes) = self.fetch(key).await? else { return Ok(None) };
        match into.get_mut(..bytes.len()) {
            Some(into) => into.copy_from_slice(bytes),
            None => return Err(LoadError::Record(RecordError::Length)),
        }
        Ok(Some(bytes.len()))
    }

    /// Keeps bytes that somebody else understands.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub async fn save_bytes(&mut self, permit: &Permit, key: Key, bytes: &[u8]) -> Result<Saved, SaveError> {
        self.keep(permit, key, bytes).await
    }

    /// Erases everything that is kept: what a host asks for when it restores the defaults.
    ///
    /// # Errors
    /// [`SaveError::Flash`].
    pub async fn forget_all(&mut self, _permit: &Permit) -> Result<(), SaveError> {
        self.map.erase_all().await.map_err(|_| SaveError::Flash)
    }

    /// The flash, for whoever lent it.
    pub fn into_flash(self) -> F {
        self.map.destroy().0
    }

    async fn fetch(&mut self, key: Key) -> Result<Option<&[u8]>, LoadError> {
        self.map.fetch_item::<&[u8]>(&mut self.buffer, &(key as u8)).await.map_err(|error| match error {
            sequential_storage::Error::Storage { .. } => LoadError::Flash,
            _ => LoadError::Damaged,
        })
    }

    async fn keep(&mut self, _permit: &Permit, key: Key, bytes: &[u8]) -> Result<Saved, SaveError> {
        if bytes.len() > LONGEST + HEAD {
            return Err(SaveError::TooLong);
        }
        match self.fetch(key).await {
            Ok(Some(there)) if there == bytes => return Ok(Saved::Unchanged),
            Ok(_) => {}
            Err(LoadError::Flash) => return Err(SaveError::Flash),
            Err(_) => return Err(SaveError::Damaged),
        }
        let written = self.map.store_item(&mut self.buffer, &(key as u8), &bytes).await;
        written.map_err(|error| match error {
            sequential_storage::Error::Storage { .. } => SaveError::Flash,
            _ => SaveError::Damaged,
        })?;
        match self.fetch(key).await {
            Ok(Some(there)) if there == bytes => Ok(Saved::Written),
            _ => Err(SaveError::Flash),
        }
    }
}
