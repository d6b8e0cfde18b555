//! Sum of many terms without loss of digits.

use crate::real::{self, Real};

/// Sum without loss of digits over millions of terms (Neumaier 1974).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sum<T> {
    total: T,
    lost: T,
}

impl<T: Real> Sum<T> {
    pub(super) fn zero() -> Self {
        Self { total: T::zero(), lost: T::zero() }
    }
    pub(super) fn add(&mut self, term: T) {
        let total = self.total + term;
        self.lost += if real::abs(self.total) >= real::abs(term) {
            (self.total - total) + term
        } else {
            (term - total) + self.total
        };
        self.total = total;
    }
    pub(super) fn value(&self) -> T {
        self.total + self.lost
    }
}
