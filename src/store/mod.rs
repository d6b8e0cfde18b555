//! Nonvolatile store: objects of the bus, calibrations, the accepted models.
//!
//! Why: a leg that needs calibration and identification after every power cut is not used, and one with wrong
//! stored values pushes its wearer wrongly. Therefore only accepted values are stored, and stored values are
//! checked before use. A power cut at any byte leaves the old value or the new one, never a mix.
//!
//! ```text
//! value --Kept::to_layout--> bytes: schema (2), layout
//!       --sequential-storage--> header with CRCs | key | bytes          two sectors in turn
//! value <--Kept::from_layout (ranges)-- layout <--defaults for what an older schema lacks-- bytes
//! ```
//!
//! | stored value | key | taken back into use by |
//! | --- | --- | --- |
//! | objects of a node of the bus | 1, 2 | the bus |
//! | calibration of an axis | 3, 4 | `motor::Calibration`, past a check at the motor |
//! | model and where it comes from | 5, of a worn leg 6 | `LegConfiguration::restore`, past the fingerprint |
//!
//! **Only with the bridges off.** The STM32F405 has one bank of flash. It stalls while it is written (16 us a
//! word) or erased (0.25 to 0.5 s for 16 KB), and with it every instruction fetch, including the current
//! loop's. A write therefore needs a [`Permit`], which only a drive with its outputs off gives.
//!
//! Reading may write as well. The first read that finds a write cut off by a power loss repairs it
//! (`MapStorage::fetch_item`: a sector is erased, records are copied). A board therefore reads at its start,
//! before any bridge may switch; its flash refuses all other accesses (docs/files.md).
//!
//! **Wear.** An unchanged value is not written again. A sector is erased once per some 15 KB of records;
//! measured in `tests/firmware/store.rs`.
//!
//! Cost: the crate `sequential-storage` (its wear levelling and repair are tested by fuzzing there) and
//! `zerocopy` (layouts).
//! Known limits: if the newest copy of a record has decayed, the copy before it is returned, as after a power
//! cut. There is no clock, so records carry a generation instead of a date.

mod calibration;
mod model;
mod record;
mod storage;

pub use calibration::CalibrationRecord;
pub use model::{JointProvenance, ModelRecord, Provenance};
pub use record::{RecordError, Storable};
pub use storage::Storage;

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::leg::{DriveState, Permission};
use crate::listed::listed;
use record::{HEAD, LONGEST};

/// Length of the longest record in the flash, with its key, in whole words.
const BUFFER: usize = (LONGEST + HEAD + 1).next_multiple_of(8);

listed! {
    /// Keys of the stored values. Numbers never change and are never used again.
    #[repr(u8)]
    pub enum Key {
        /// All keys.
        ALL;
        /// Objects of the first node that a host changed.
        Objects1 = 1;
        /// Objects of the second node that a host changed.
        Objects2 = 2;
        /// Calibration of the first axis.
        Calibration1 = 3;
        /// Calibration of the second axis.
        Calibration2 = 4;
        /// Model of the leg, empty or unknown whether worn. Only this one is the feedforward after a start; a
        /// worn leg's model serves the assistance alone.
        Model = 5;
        /// Model of the worn leg.
        WornModel = 6;
    }
}

impl Key {
    /// Keys of the models, see [`ModelRecord::key`].
    pub const MODELS: [Self; 2] = [Self::Model, Self::WornModel];
}

/// Proof that the bridges are off: given by a drive with its outputs off, required for every write.
#[derive(Debug)]
pub struct Permit(());

impl Permit {
    /// Returns a permit for a drive in this state; `None` where a bridge may switch.
    pub fn from_state(state: DriveState) -> Option<Self> {
        Self::under(state.permission())
    }

    /// Returns a permit for a drive with this permission; `None` where a bridge may switch.
    pub(crate) fn under(permission: Permission) -> Option<Self> {
        (permission == Permission::Off).then_some(Self(()))
    }
}

/// Error for a range of flash that cannot hold a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnfitRange;

/// Reason why nothing was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// The flash holds other data, or the store is damaged beyond repair: only [`Store::forget_all`] helps.
    Damaged,
    /// The flash did not answer.
    Flash,
    /// The record was read but is invalid.
    Record(RecordError),
}

/// Reason why nothing was written; the previous value is still there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveError {
    /// See [`LoadError::Damaged`].
    Damaged,
    /// The flash did not answer, or reads back something else.
    Flash,
    /// The value exceeds the length of a record.
    TooLong,
    /// The record would be refused when read back.
    Record(RecordError),
}

/// Effect of a save on the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// The value was written.
    Written,
    /// The value was there already.
    Unchanged,
}

/// Store in a range of at least two sectors of a flash.
pub struct Store<F: NorFlash> {
    map: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    buffer: [u8; BUFFER],
}

impl<F: NorFlash> Store<F> {
    /// Opens a store in a range of flash addresses. Reads nothing yet.
    ///
    /// # Errors
    /// [`UnfitRange`] unless the range begins and ends at sectors, holds two of them, and each of them holds
    /// two of the longest records.
    pub fn new(flash: F, range: Range<u32>) -> Result<Self, UnfitRange> {
        if F::ERASE_SIZE < 4 * BUFFER || range.end as usize > flash.capacity() || range.start > range.end {
            return Err(UnfitRange);
        }
        let config = MapConfig::try_new(range).map_err(|_| UnfitRange)?;
        Ok(Self { map: MapStorage::new(flash, config, Cache::new_uncached()), buffer: [0; BUFFER] })
    }

    /// Reads the record of a key; `None` if there never was one.
    ///
    /// # Errors
    /// See [`LoadError`]. An invalid record stays where it is.
    pub async fn load<R: Storable>(&mut self, key: Key) -> Result<Option<R>, LoadError> {
        match self.fetch(key).await? {
            Some(bytes) => record::decode(bytes).map(Some).map_err(LoadError::Record),
            None => Ok(None),
        }
    }

    /// Writes a record and replaces the previous one.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub async fn save<R: Storable>(
        &mut self,
        permit: &Permit,
        key: Key,
        value: &R,
    ) -> Result<Saved, SaveError> {
        let mut bytes = [0; LONGEST + HEAD];
        let length = record::encode(value, &mut bytes).map_err(SaveError::Record)?;
        self.write(permit, key, bytes.get(..length).unwrap_or_default()).await
    }

    /// Reads raw bytes, at most the length of `into`; returns their number.
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

    /// Writes raw bytes.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub async fn save_bytes(&mut self, permit: &Permit, key: Key, bytes: &[u8]) -> Result<Saved, SaveError> {
        self.write(permit, key, bytes).await
    }

    /// Erases the whole store, when a host restores the defaults.
    ///
    /// # Errors
    /// [`SaveError::Flash`].
    pub async fn forget_all(&mut self, _permit: &Permit) -> Result<(), SaveError> {
        self.map.erase_all().await.map_err(|_| SaveError::Flash)
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.map.destroy().0
    }

    async fn fetch(&mut self, key: Key) -> Result<Option<&[u8]>, LoadError> {
        self.map.fetch_item::<&[u8]>(&mut self.buffer, &(key as u8)).await.map_err(|error| match error {
            sequential_storage::Error::Storage { .. } => LoadError::Flash,
            _ => LoadError::Damaged,
        })
    }

    async fn write(&mut self, _permit: &Permit, key: Key, bytes: &[u8]) -> Result<Saved, SaveError> {
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
