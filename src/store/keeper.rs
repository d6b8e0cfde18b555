//! Who keeps one board's things: what is in the store, and what was found since and waits for a host to have it kept.
//!
//! ```text
//! found       accept(model), calibrated(axis, ..)       not written: kept only when a host asks
//! "save"      keep(objects, generation)                 objects of every node; calibrations, once all axes have one; a model not kept yet
//! "load"      forget()                                  the store is erased, and what waited is forgotten with it
//! ```
//!
//! So what was found before everything was forgotten is not kept by the next "save": a model that a host threw away must not come back.

use embedded_storage_async::nor_flash::NorFlash;

use super::{KeptCalibration, KeptModel, Key, Permit, Store};
use crate::leg::StoredCalibration;

const OBJECTS: [Key; 2] = [Key::Objects1, Key::Objects2];
const CALIBRATIONS: [Key; 2] = [Key::Calibration1, Key::Calibration2];

/// See the module; of a leg of `N` joints, two at most.
pub struct Keeper<F: NorFlash, const N: usize> {
    store: Store<F>,
    /// Accepted since something was kept last.
    accepted: Option<KeptModel<N>>,
    /// Of each axis, where it passed one that can be kept.
    calibrations: [Option<StoredCalibration>; N],
}

impl<F: NorFlash, const N: usize> Keeper<F, N> {
    /// Nothing found yet.
    #[must_use]
    pub const fn new(store: Store<F>) -> Self {
        Self { store, accepted: None, calibrations: [None; N] }
    }

    /// A model that may be kept from now on, in the place of one that was not.
    pub fn accept(&mut self, model: KeptModel<N>) {
        self.accepted = Some(model);
    }

    /// An axis passed a calibration: what of it can be kept, if anything can.
    pub fn calibrated(&mut self, axis: usize, calibration: Option<StoredCalibration>) {
        if let Some(place) = self.calibrations.get_mut(axis) {
            *place = calibration;
        }
    }

    /// What is kept of a node: so many bytes; `None` where it cannot be read.
    pub async fn objects(&mut self, joint: usize, into: &mut [u8]) -> Option<usize> {
        let key = *OBJECTS.get(joint)?;
        Some(self.store.load_bytes(key, into).await.ok()?.unwrap_or(0))
    }

    /// The calibration that is kept of an axis, if one can be read.
    pub async fn calibration(&mut self, axis: usize) -> Option<StoredCalibration> {
        let key = *CALIBRATIONS.get(axis)?;
        self.store.load::<KeptCalibration>(key).await.ok()?.map(|kept| kept.0)
    }

    /// The model that is kept, if there is one; `None` where it cannot be read.
    pub async fn model(&mut self) -> Option<Option<KeptModel<N>>> {
        self.store.load(Key::Model).await.ok()
    }

    /// Keeps these objects of each node and what waited; the number of models kept so far, of which there were `generation`. `None` where
    /// something was not kept.
    pub async fn keep(&mut self, permit: &Permit, objects: [&[u8]; N], generation: u32) -> Option<u32> {
        for (key, bytes) in OBJECTS.into_iter().zip(objects) {
            self.store.save_bytes(permit, key, bytes).await.ok()?;
        }
        // One of them alone would have its neighbour checked against an older one.
        if self.calibrations.iter().all(Option::is_some) {
            for (key, calibration) in CALIBRATIONS.into_iter().zip(self.calibrations.iter().flatten()) {
                self.store.save(permit, key, &KeptCalibration(*calibration)).await.ok()?;
            }
        }
        let Some(mut model) = self.accepted else { return Some(generation) };
        model.provenance.generation = generation.wrapping_add(1);
        self.store.save(permit, Key::Model, &model).await.ok()?;
        self.accepted = None;
        Some(model.provenance.generation)
    }

    /// Forgets everything; the number of models kept so far, which is none. `None` where the store could not be erased.
    pub async fn forget(&mut self, permit: &Permit) -> Option<u32> {
        self.store.forget_all(permit).await.ok()?;
        (self.accepted, self.calibrations) = (None, [None; N]);
        Some(0)
    }

    /// The flash, for whoever lent it.
    pub fn into_flash(self) -> F {
        self.store.into_flash()
    }
}
