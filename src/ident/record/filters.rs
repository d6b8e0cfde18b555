//! The recorder's two filters.

use super::recorder::{SAMPLE_RATE_HZ, SMOOTHING_BANDWIDTHS};
use super::rows::RowFilter;
use crate::ident::signal::kernel::{Kernel, KernelError, LowPass};
use crate::real::Real;

/// Both filters of a recorder, built before it: construction may fail while nothing large is allocated yet.
#[derive(Clone, Debug, PartialEq)]
pub struct Filters<T, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> {
    pub(super) smoothing: Kernel<T, TAPS>,
    pub(super) low_pass: LowPass<T, TAPS>,
}

impl<T: Real, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize>
    Filters<T, N, B, TAPS, PENDING>
{
    /// Builds both filters for a low-pass that is 3 dB down at `bandwidth_hz`.
    ///
    /// # Errors
    /// [`KernelError`] when the bandwidth is invalid or its kernel does not fit `TAPS` and `PENDING`.
    #[inline(never)]
    pub fn new(bandwidth_hz: T) -> Result<Self, KernelError> {
        let rate = T::of(SAMPLE_RATE_HZ);
        let low_pass = LowPass::new(bandwidth_hz, rate)?;
        if RowFilter::<T, N, B, PENDING>::outputs_needed(low_pass.taps()) > PENDING {
            return Err(KernelError::TooLong { needed: low_pass.taps() });
        }
        let smoothing = Kernel::new(T::of(SMOOTHING_BANDWIDTHS) * bandwidth_hz, rate)?;
        Ok(Self { smoothing, low_pass })
    }

    /// Row low-pass, the second filter.
    #[must_use]
    pub fn low_pass(&self) -> &LowPass<T, TAPS> {
        &self.low_pass
    }
}
