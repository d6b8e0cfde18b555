//! What a board on the bus remembers over the power: `scarab::store` over a simulated flash, which a file may outlive.
//!
//! As on the board nothing is written unless the drive is off, and a record that is damaged is refused by name. The file is the
//! flash, byte by byte: two sectors of 128 KB.

use embassy_futures::block_on;
use scarab::bus::LONGEST;
use scarab::bus::station::Keeping;
use scarab::leg::{DriveState, IdentifiedModel, LegConfiguration};
use scarab::store::{KeptModel, Key, Permit, Store};

use super::storing::Asked;
use crate::flash::Flash;

/// A sector of the STM32F405's flash that is large enough, and how many there are of it.
pub(super) const SECTOR: usize = 128 * 1024;
const SECTORS: usize = 2;
/// Bytes of a board's flash.
pub const BYTES: usize = SECTOR * SECTORS;

/// All cells of it.
pub(in crate::tool) type Cells = Flash<SECTOR, SECTORS>;

/// The flash of one board.
#[derive(Clone, Debug)]
pub struct Memory {
    flash: Option<Cells>,
}

const KEYS: [Key; 2] = [Key::Objects1, Key::Objects2];

impl Memory {
    /// A flash that holds these bytes, or is erased.
    #[must_use]
    pub fn new(bytes: Option<&[u8]>) -> Self {
        let mut flash = Cells::new(1);
        if let Some(bytes) = bytes {
            let count = bytes.len().min(BYTES);
            flash.bytes_mut()[..count].copy_from_slice(&bytes[..count]);
        }
        Self { flash: Some(flash) }
    }

    /// Whatever the store is asked; `None` where it could not be made.
    pub(in crate::tool) fn with<T>(&mut self, ask: impl FnOnce(&mut Store<Cells>) -> T) -> Option<T> {
        let flash = self.flash.take()?;
        let mut store = Store::new(flash, 0..BYTES as u32).ok()?;
        let told = ask(&mut store);
        self.flash = Some(store.into_flash());
        Some(told)
    }

    /// The power fails when so many more bytes have been programmed or erased; `None`: it is there.
    pub fn fail_after(&mut self, bytes: Option<u64>) {
        if let Some(flash) = &mut self.flash {
            flash.fail_after(bytes);
        }
    }

    /// Bytes programmed or erased so far, and sectors erased.
    #[must_use]
    pub fn worked(&self) -> (u64, u32) {
        self.flash.as_ref().map_or((0, 0), |flash| (flash.worked(), flash.erasures().iter().sum()))
    }

    /// What is kept under the model's key, whoever's it is; `None` where nothing is, or nothing that can be read.
    pub fn any_model<const N: usize>(&mut self) -> Option<KeptModel<N>> {
        self.with(|store| block_on(store.load::<KeptModel<N>>(Key::Model)))?.ok().flatten()
    }

    /// Keeps any model.
    pub fn keep_any<const N: usize>(&mut self, state: DriveState, kept: &KeptModel<N>) -> bool {
        let Some(permit) = Permit::of(state) else { return false };
        self.with(|store| block_on(store.save(&permit, Key::Model, kept))).is_some_and(|saved| saved.is_ok())
    }

    /// The bytes of the flash, to be spoilt.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.flash.as_mut().map_or(&mut [], Cells::bytes_mut)
    }

    /// The bytes of the flash.
    pub fn bytes(&mut self) -> &[u8] {
        self.flash.as_mut().map_or(&[], |flash| flash.bytes_mut())
    }

    /// What was kept of a node's objects, if anything was; of legs of more than two joints only the first two are.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn objects(&mut self, joint: usize) -> Result<Option<Vec<u8>>, String> {
        let Some(key) = KEYS.get(joint) else { return Ok(None) };
        let mut bytes = [0; LONGEST];
        let length = self.with(|store| block_on(store.load_bytes(*key, &mut bytes))).transpose();
        let length = length.map_err(|why| format!("the kept objects of node {}: {why:?}", joint + 1))?;
        Ok(length.flatten().map(|length| bytes[..length].to_vec()))
    }

    /// Keeps them; whether it could.
    pub fn keep_objects(&mut self, state: DriveState, joint: usize, bytes: &[u8]) -> bool {
        let (Some(permit), Some(key)) = (Permit::of(state), KEYS.get(joint)) else { return false };
        self.with(|store| block_on(store.save_bytes(&permit, *key, bytes))).is_some_and(|saved| saved.is_ok())
    }

    /// The model that was kept, if it is this leg's, and its generation.
    pub fn model<const N: usize, const B: usize>(
        &mut self,
        configuration: &LegConfiguration<N, B>,
    ) -> Result<Option<(IdentifiedModel<N>, u32)>, String> {
        let kept = self.with(|store| block_on(store.load::<KeptModel<N>>(Key::Model)));
        let kept = kept.transpose().map_err(|why| format!("the kept model: {why:?}"))?.flatten();
        let Some(kept) = kept else { return Ok(None) };
        let model = configuration.restore(&kept.model).map_err(|why| format!("the kept model: {why:?}"))?;
        Ok(Some((model, kept.provenance.generation)))
    }

    /// Keeps all objects and a model, or forgets everything; whether it could.
    pub(super) fn change<const N: usize>(&mut self, state: DriveState, asked: &Asked<N>) -> bool {
        match asked.what {
            Keeping::Defaults => self.forget(state),
            Keeping::All => {
                let mut nodes = asked.objects.iter().enumerate();
                nodes.all(|(joint, kept)| self.keep_objects(state, joint, kept.bytes()))
                    && asked.model.is_none_or(|model| self.keep_any(state, &model))
            }
        }
    }

    /// Forgets everything; whether it could.
    pub fn forget(&mut self, state: DriveState) -> bool {
        let Some(permit) = Permit::of(state) else { return false };
        self.with(|store| block_on(store.forget_all(&permit))).is_some_and(|forgotten| forgotten.is_ok())
    }
}
