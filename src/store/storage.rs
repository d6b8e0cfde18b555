//! Manager of one board's stored parameters and of new results that wait for a host's "save".
//!
//! ```text
//! found       accept(model), calibrated(axis, ..)       pending: stored only when a host asks
//! "save"      keep(objects, generation)                 objects of all nodes; calibrations, once all axes
//!                                                       have one; pending models
//! "load"      forget()                                  erases the store, discards pending results
//! ```
//!
//! The worn leg's model and any other are pending side by side and stored under their own keys. After "load",
//! the next "save" stores nothing found before it: a model that a host discarded must not come back.

use embedded_storage_async::nor_flash::NorFlash;

use super::{CalibrationRecord, Key, ModelRecord, Permit, Store};
use crate::leg::StoredCalibration;

const OBJECTS: [Key; 2] = [Key::Objects1, Key::Objects2];
const CALIBRATIONS: [Key; 2] = [Key::Calibration1, Key::Calibration2];

/// Stored parameters and pending results of a leg with `N` joints, two at most; see the module.
pub struct Storage<F: NorFlash, const N: usize> {
    store: Store<F>,
    /// Models accepted since the last "save", in the order of [`Key::MODELS`].
    accepted: [Option<ModelRecord<N>>; 2],
    /// Calibration that each axis passed, if it can be stored.
    calibrations: [Option<StoredCalibration>; N],
}

impl<F: NorFlash, const N: usize> Storage<F, N> {
    /// Manager without pending results.
    pub const fn new(store: Store<F>) -> Self {
        Self { store, accepted: [None; 2], calibrations: [None; N] }
    }

    /// Sets the pending model of its key; replaces an older pending one.
    pub fn accept(&mut self, model: ModelRecord<N>) {
        let [other, worn] = &mut self.accepted;
        let accepted = if model.key() == Key::WornModel { worn } else { other };
        *accepted = Some(model);
    }

    /// Sets the pending calibration of an axis; `None` if the axis passed one that cannot be stored.
    pub fn calibrated(&mut self, axis: usize, calibration: Option<StoredCalibration>) {
        if let Some(slot) = self.calibrations.get_mut(axis) {
            *slot = calibration;
        }
    }

    /// Reads the stored objects of a node; returns their length, `None` where they cannot be read.
    pub async fn objects(&mut self, joint: usize, into: &mut [u8]) -> Option<usize> {
        let key = *OBJECTS.get(joint)?;
        Some(self.store.load_bytes(key, into).await.ok()?.unwrap_or(0))
    }

    /// Reads the stored calibration of an axis; `None` if there is none or it cannot be read.
    pub async fn calibration(&mut self, axis: usize) -> Option<StoredCalibration> {
        let key = *CALIBRATIONS.get(axis)?;
        self.store.load::<CalibrationRecord>(key).await.ok()?.map(|record| record.0)
    }

    /// Reads the stored model of one of [`Key::MODELS`]. The outer `None` means that reading failed, the
    /// inner that no model is stored.
    pub async fn model(&mut self, key: Key) -> Option<Option<ModelRecord<N>>> {
        self.store.load(key).await.ok()
    }

    /// Stores these objects of each node and all pending results. Returns the number of models stored so far;
    /// `generation` is that number before. `None` if anything failed.
    pub async fn save(&mut self, permit: &Permit, objects: [&[u8]; N], generation: u32) -> Option<u32> {
        for (key, bytes) in OBJECTS.into_iter().zip(objects) {
            self.store.save_bytes(permit, key, bytes).await.ok()?;
        }
        // All or none: with only one, the neighbouring axis would be checked against an older calibration.
        if self.calibrations.iter().all(Option::is_some) {
            for (key, calibration) in CALIBRATIONS.into_iter().zip(self.calibrations.iter().flatten()) {
                self.store.save(permit, key, &CalibrationRecord(*calibration)).await.ok()?;
            }
        }
        let mut generation = generation;
        for accepted in self.accepted.iter().flatten() {
            let mut model = *accepted;
            generation = generation.wrapping_add(1);
            model.provenance.generation = generation;
            self.store.save(permit, model.key(), &model).await.ok()?;
        }
        // Pending until all are stored: a repeated save gives each the same generation.
        self.accepted = [None; 2];
        Some(generation)
    }

    /// Erases everything. Returns the number of models stored so far, zero; `None` if
    /// the store could not be erased.
    pub async fn forget(&mut self, permit: &Permit) -> Option<u32> {
        self.store.forget_all(permit).await.ok()?;
        (self.accepted, self.calibrations) = ([None; 2], [None; N]);
        Some(0)
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.store.into_flash()
    }
}
