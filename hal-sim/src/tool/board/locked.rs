//! A value that threads may share, each for as long as it locks it: `heapless`' queues are not `Sync`.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// The value behind its lock. Compared and cloned as the value is.
#[derive(Debug, Default)]
pub struct Locked<T>(Mutex<T>);

impl<T> Locked<T> {
    /// The value.
    pub fn new(value: T) -> Self {
        Self(Mutex::new(value))
    }

    /// Locks the value for reading.
    pub fn lock(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The value, without locking it.
    pub fn get(&mut self) -> &mut T {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Clone> Clone for Locked<T> {
    fn clone(&self) -> Self {
        Self::new(self.lock().clone())
    }
}

impl<T: PartialEq> PartialEq for Locked<T> {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self, other) || *self.lock() == *other.lock()
    }
}
