//! One large value that two levels use in turn, without copying it and without waiting.
//!
//! ```text
//! idle --give--> given --(worker fills it) return--> returned --take_back--> idle
//! ```
//!
//! The turn is one atomic word. Only the side whose turn it is locks the value, so no side ever finds it
//! locked.

use super::signals::Word;

use spin::{Mutex, MutexGuard};

const IDLE: u32 = 0;
const GIVEN: u32 = 1;
const RETURNED: u32 = 2;

/// A value and the side whose turn it is.
#[derive(Debug)]
pub struct Handover<T> {
    turn: Word,
    value: Mutex<T>,
}

impl<T> Handover<T> {
    /// Creates an idle handover.
    pub const fn new(value: T) -> Self {
        Self { turn: Word::new(IDLE), value: Mutex::new(value) }
    }

    fn at(&self, turn: u32) -> Option<MutexGuard<'_, T>> {
        if self.turn.get() == turn { self.value.try_lock() } else { None }
    }

    /// The value, to be filled by the side that asks; `None` while the other has it.
    pub(crate) fn idle(&self) -> Option<MutexGuard<'_, T>> {
        self.at(IDLE)
    }

    /// Passes the value to the worker.
    pub(crate) fn give(&self) {
        self.turn.set(GIVEN);
    }

    /// The value, if the worker has it.
    pub fn given(&self) -> Option<MutexGuard<'_, T>> {
        self.at(GIVEN)
    }

    /// Passes the value back to the requesting side.
    pub fn return_value(&self) {
        self.turn.set(RETURNED);
    }

    /// The value that the worker passed back, once.
    pub(crate) fn take_back(&self) -> Option<MutexGuard<'_, T>> {
        let value = self.at(RETURNED)?;
        self.turn.set(IDLE);
        Some(value)
    }
}

impl<T: Clone> Clone for Handover<T> {
    fn clone(&self) -> Self {
        Self { turn: self.turn.clone(), value: Mutex::new(self.value.lock().clone()) }
    }
}

impl<T: PartialEq> PartialEq for Handover<T> {
    fn eq(&self, other: &Self) -> bool {
        self.turn == other.turn && *self.value.lock() == *other.value.lock()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_side_has_the_value_only_in_its_turn() {
        let handover = Handover::new(1);
        assert!(handover.given().is_none() && handover.take_back().is_none());
        *handover.idle().expect("idle") = 2;
        handover.give();
        assert!(handover.idle().is_none() && handover.take_back().is_none());
        assert_eq!(handover.given().map(|value| *value), Some(2));
        handover.return_value();
        assert!(handover.idle().is_none() && handover.given().is_none());
        assert_eq!(handover.take_back().map(|value| *value), Some(2));
        assert!(handover.take_back().is_none() && handover.idle().is_some());
    }
}
