//! Persistent memory of a simulated board: `scarab::store` on a simulated flash, optionally saved to a file.
//!
//! As on the board, nothing is written unless the drive is off, and a damaged record is reported by name. The
//! file is an image of the flash: the two sectors of stored parameters.

use embassy_futures::block_on;
use hal_sim::flash::Flash;
use scarab::bus::LONGEST;
use scarab::leg::{DriveState, IdentifiedModel, LegConfiguration};
use scarab::store::{Key, ModelRecord, Permit, Provenance, Store};
use scarab_boot::Region;

/// Size and number of the sectors on the board.
pub(crate) const SECTOR: usize = Region::PARAMETERS.sector_bytes as usize;
const SECTORS: usize = Region::PARAMETERS.sectors as usize;
/// Size of a board's flash.
pub const BYTES: usize = SECTOR * SECTORS;

/// The simulated flash.
pub(crate) type Cells = Flash<SECTOR, SECTORS>;

/// Flash of one board.
#[derive(Clone, Debug)]
pub struct Memory {
    flash: Option<Cells>,
}

const KEYS: [Key; 2] = [Key::Objects1, Key::Objects2];

/// Name of a stored model in messages.
pub(crate) fn model_name(key: Key) -> &'static str {
    if key == Key::WornModel { "the stored model of the worn leg" } else { "the stored model" }
}

impl Memory {
    /// Creates a flash with this content, or an erased one.
    pub fn new(bytes: Option<&[u8]>) -> Self {
        let mut flash = Cells::new(1);
        if let Some(bytes) = bytes {
            let count = bytes.len().min(BYTES);
            flash.bytes_mut()[..count].copy_from_slice(&bytes[..count]);
        }
        Self { flash: Some(flash) }
    }

    /// Accesses the store; `None` if it cannot be created.
    pub(crate) fn with<T>(&mut self, ask: impl FnOnce(&mut Store<Cells>) -> T) -> Option<T> {
        let flash = self.flash.take()?;
        let mut store = Store::new(flash, 0..BYTES as u32).ok()?;
        let answer = ask(&mut store);
        self.flash = Some(store.into_flash());
        Some(answer)
    }

    /// Makes the power fail after this number of programmed or erased bytes; `None` restores it.
    pub fn fail_after(&mut self, bytes: Option<u64>) {
        if let Some(flash) = &mut self.flash {
            flash.fail_after(bytes);
        }
    }

    /// Bytes programmed or erased so far, and number of erased sectors.
    pub fn worked(&self) -> (u64, u32) {
        self.flash.as_ref().map_or((0, 0), |flash| (flash.worked(), flash.erasures().iter().sum()))
    }

    /// Returns the stored model of this key without a check of its leg; `None` if there is none or it cannot
    /// be read.
    pub fn any_model<const N: usize>(&mut self, key: Key) -> Option<ModelRecord<N>> {
        self.with(|store| block_on(store.load::<ModelRecord<N>>(key)))?.ok().flatten()
    }

    /// Stores any model under its key.
    pub fn keep_any<const N: usize>(&mut self, state: DriveState, kept: &ModelRecord<N>) -> bool {
        let Some(permit) = Permit::from_state(state) else { return false };
        self.with(|store| block_on(store.save(&permit, kept.key(), kept))).is_some_and(|saved| saved.is_ok())
    }

    /// Content of the flash, for fault injection.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.flash.as_mut().map_or(&mut [], Cells::bytes_mut)
    }

    /// Content of the flash.
    pub fn bytes(&mut self) -> &[u8] {
        self.flash.as_mut().map_or(&[], |flash| flash.bytes_mut())
    }

    /// Returns the stored objects of a node, if any. For legs of more than two joints only the first two are
    /// stored.
    ///
    /// # Errors
    /// Reason why they cannot be read.
    pub fn objects(&mut self, joint: usize) -> Result<Option<Vec<u8>>, String> {
        let Some(key) = KEYS.get(joint) else { return Ok(None) };
        let mut bytes = [0; LONGEST];
        let length = self.with(|store| block_on(store.load_bytes(*key, &mut bytes))).transpose();
        let length = length.map_err(|why| format!("the stored objects of node {}: {why:?}", joint + 1))?;
        Ok(length.flatten().map(|length| bytes[..length].to_vec()))
    }

    /// Stores the objects of a node; returns whether this succeeded.
    pub fn keep_objects(&mut self, state: DriveState, joint: usize, bytes: &[u8]) -> bool {
        let (Some(permit), Some(key)) = (Permit::from_state(state), KEYS.get(joint)) else { return false };
        self.with(|store| block_on(store.save_bytes(&permit, *key, bytes))).is_some_and(|saved| saved.is_ok())
    }

    /// Returns the stored model of this key with its provenance, if it belongs to this leg.
    ///
    /// # Errors
    /// Reason why it cannot be read or does not belong to this leg.
    pub(crate) fn model<const N: usize, const B: usize>(
        &mut self,
        configuration: &LegConfiguration<N, B>,
        key: Key,
    ) -> Result<Option<(IdentifiedModel<N>, Provenance<N>)>, String> {
        let kept = self.with(|store| block_on(store.load::<ModelRecord<N>>(key)));
        let kept = kept.transpose().map_err(|why| format!("{}: {why:?}", model_name(key)))?.flatten();
        let Some(kept) = kept else { return Ok(None) };
        let model =
            configuration.restore(&kept.model).map_err(|why| format!("{}: {why:?}", model_name(key)))?;
        Ok(Some((model, kept.provenance)))
    }

    /// Erases everything; returns whether this succeeded.
    pub(crate) fn forget(&mut self, state: DriveState) -> bool {
        let Some(permit) = Permit::from_state(state) else { return false };
        self.with(|store| block_on(store.forget_all(&permit))).is_some_and(|forgotten| forgotten.is_ok())
    }
}
