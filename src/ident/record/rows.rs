//! Second stage of the filter chain: regressor rows and torque through one low-pass, then 50 Hz.
//!
//! ```text
//! y_f(t) = sum_k h_k y(t - k T),     tau_f(t) = sum_k h_k tau(t - k T)
//! ```
//!
//! The whole row goes through the filter, including the sharp `sign(qd)` of Coulomb friction. A sharp column
//! against a smoothed torque biases friction by three standard deviations; with the same filter for both the
//! bias is below 0.2. Instead of storing `TAPS` rows, each open output is a running sum: a new sample is
//! added to the `taps / decimation` outputs whose windows contain it.
//!
//! At the ends of a motion windows may be cut short ([`Ends::Cut`]). Any weights used on both sides leave the
//! equation true, so no information is lost. Only the half without the centre may be missing. A cut window
//! has a sharp edge and passes frequencies above the low-pass, so errors are measured on whole windows
//! ([`Ends::Whole`]).
//!
//! Cost of one sample: `PENDING (N (B + 5) + 1)` multiplications. Memory: as many numbers.

use super::stribeck::BANK;
use crate::ident::signal::kernel::LowPass;
use crate::real::{self, Real};

/// Samples from one output to the next: 500 Hz to 50 Hz.
pub const DECIMATION: usize = 10;

/// One filtered row for each joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteredRows<T, const N: usize, const B: usize> {
    /// `regressor[joint]` times base parameters is the torque.
    pub regressor: [[T; B]; N],
    /// Stribeck columns of each joint's own torque; zero where no curve is searched.
    pub stribeck: [[T; BANK]; N],
    /// Filtered torque, N m, D-H sign.
    pub torque: [T; N],
    /// Share of the window, weighted by the filter's magnitude, with the joint at rest: 0..1.
    pub still: [T; N],
}

impl<T: Real, const N: usize, const B: usize> FilteredRows<T, N, B> {
    fn empty() -> Self {
        Self {
            regressor: [[T::zero(); B]; N],
            stribeck: [[T::zero(); BANK]; N],
            torque: [T::zero(); N],
            still: [T::zero(); N],
        }
    }

    /// True if all entries are finite.
    pub fn is_finite(&self) -> bool {
        self.torque
            .iter()
            .chain(self.regressor.iter().flatten())
            .chain(self.stribeck.iter().flatten())
            .all(|&value| real::is_finite(value))
    }
}

/// Treatment of windows at both ends of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Windows are cut short; no row is lost.
    Cut,
    /// Only whole windows give rows.
    Whole,
}

/// An unfinished output.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Open<T, const N: usize, const B: usize> {
    rows: FilteredRows<T, N, B>,
    /// Sum of the absolute weights used so far.
    weight: T,
}

impl<T: Real, const N: usize, const B: usize> Open<T, N, B> {
    fn empty() -> Self {
        Self { rows: FilteredRows::empty(), weight: T::zero() }
    }

    fn add(&mut self, rows: &FilteredRows<T, N, B>, weight: T) {
        add_scaled(&mut self.rows, rows, weight, real::abs(weight));
        self.weight += real::abs(weight);
    }

    /// Finished rows; shares of standstill are relative to the weights used.
    fn close(&self) -> FilteredRows<T, N, B> {
        let mut rows = self.rows;
        for still in &mut rows.still {
            *still /= real::max(self.weight, T::EPSILON);
        }
        rows
    }
}

/// Open outputs of the second stage.
#[derive(Clone, Debug, PartialEq)]
pub struct RowFilter<T, const N: usize, const B: usize, const PENDING: usize> {
    open: [Open<T, N, B>; PENDING],
    /// Samples since the start of the window of the output that will be finished
    /// next; `None` before the first.
    age: Option<usize>,
    /// Index of that output in `open`.
    oldest: usize,
    ends: Ends,
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> RowFilter<T, N, B, PENDING> {
    /// An empty filter.
    pub fn new(ends: Ends) -> Self {
        Self { open: [Open::empty(); PENDING], age: None, oldest: 0, ends }
    }

    /// Open outputs that a kernel of `taps` weights needs.
    pub(crate) const fn outputs_needed(taps: usize) -> usize {
        taps.div_ceil(DECIMATION)
    }

    /// Discards all samples.
    pub fn clear(&mut self) {
        *self = Self::new(self.ends);
    }

    /// Takes the rows of one 500 Hz sample; every tenth call returns a finished
    /// output once the window is full.
    ///
    /// An output needs `outputs_needed(low_pass.taps()) <= PENDING`; the recorder that owns both checks it.
    pub fn push<const TAPS: usize>(
        &mut self,
        low_pass: &LowPass<T, TAPS>,
        rows: &FilteredRows<T, N, B>,
    ) -> Option<FilteredRows<T, N, B>> {
        let weights = low_pass.weights();
        let age = self.age.unwrap_or(match self.ends {
            // The first output's centre is the first sample.
            Ends::Cut => low_pass.reach(),
            Ends::Whole => 0,
        });
        let mut slot = self.oldest;
        for behind in 0..PENDING {
            // The output `behind` positions younger began `behind * DECIMATION` samples later.
            let Some(tap) = age.checked_sub(behind * DECIMATION) else { break };
            if let (Some(output), Some(&weight)) = (self.open.get_mut(slot), weights.get(tap)) {
                output.add(rows, weight);
            }
            slot = if slot + 1 >= PENDING { 0 } else { slot + 1 };
        }
        self.age = Some(age + 1);
        if age + 1 < weights.len() { None } else { self.take_oldest() }
    }

    /// Returns the outputs whose centre was seen, one per call, after the last sample; then `None`, and the
    /// filter is empty.
    pub(crate) fn finish<const TAPS: usize>(
        &mut self,
        low_pass: &LowPass<T, TAPS>,
    ) -> Option<FilteredRows<T, N, B>> {
        if self.ends == Ends::Cut && self.age.is_some_and(|age| age > low_pass.reach()) {
            return self.take_oldest();
        }
        self.clear();
        None
    }

    fn take_oldest(&mut self) -> Option<FilteredRows<T, N, B>> {
        self.age = self.age.map(|age| age.saturating_sub(DECIMATION));
        let output = self.open.get_mut(self.oldest)?;
        let finished = output.close();
        *output = Open::empty();
        self.oldest = if self.oldest + 1 >= PENDING { 0 } else { self.oldest + 1 };
        Some(finished)
    }
}

fn add_scaled<T: Real, const N: usize, const B: usize>(
    output: &mut FilteredRows<T, N, B>,
    rows: &FilteredRows<T, N, B>,
    weight: T,
    share: T,
) {
    for joint in 0..N {
        for (sum, &element) in output.regressor[joint].iter_mut().zip(&rows.regressor[joint]) {
            *sum += weight * element;
        }
        for (sum, &element) in output.stribeck[joint].iter_mut().zip(&rows.stribeck[joint]) {
            *sum += weight * element;
        }
        output.torque[joint] += weight * rows.torque[joint];
        output.still[joint] += share * rows.still[joint];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn running_sums_equal_the_convolution_at_every_tenth_sample() {
        let low_pass = LowPass::<f64, 256>::new(8.0, 500.0).expect("fits");
        let mut filter = RowFilter::<f64, 1, 2, 26>::new(Ends::Cut);
        let signal = |index: usize| ((index * 7919 % 1013) as f64 / 1013.0, (index % 17) as f64);
        let mut outputs = Vec::new();
        for index in 0..1500 {
            let (left, right) = signal(index);
            let rows = FilteredRows {
                regressor: [[left, 1.0]],
                stribeck: [[0.0; 3]],
                torque: [right],
                still: [0.0],
            };
            outputs.extend(filter.push(&low_pass, &rows));
        }
        while let Some(output) = filter.finish(&low_pass) {
            outputs.push(output);
        }
        // One for every tenth sample, ends included.
        assert_eq!(outputs.len(), 1500_usize.div_ceil(DECIMATION));
        assert_eq!(filter, RowFilter::new(Ends::Cut));
        for (number, output) in outputs.iter().enumerate() {
            let window = low_pass.weights().iter().enumerate();
            let (mut left, mut right, mut ones) = (0.0, 0.0, 0.0);
            for (tap, weight) in window {
                let Some(index) = (number * DECIMATION + tap).checked_sub(low_pass.reach()) else { continue };
                if index < 1500 {
                    let sample = signal(index);
                    (left, right, ones) =
                        (left + weight * sample.0, right + weight * sample.1, ones + weight);
                }
            }
            assert!((output.regressor[0][0] - left).abs() < 1e-12);
            assert!((output.regressor[0][1] - ones).abs() < 1e-12);
            assert!((output.torque[0] - right).abs() < 1e-12);
        }
    }
}
