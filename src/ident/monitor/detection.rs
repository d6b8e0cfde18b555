//! Detects that an accepted model no longer fits: load, wearer or friction changed.
//!
//! Each joint has a cumulative sum of log-likelihood ratios (Page 1954) over blocks of n = 25 moving
//! rows (half a second). The hypotheses: "the residual's energy is rho times its value at
//! acceptance" against "unchanged":
//!
//! ```text
//! E = mean of e^2 over the block                      1 while nothing has changed, see [`super::baseline`]
//! l = nu/2 (E (1 - 1/rho) - ln rho)                   log-likelihood ratio of the block              (W1)
//! S <- max(0, S + min(l, h/P))                        alarm when S >= h                              (W2)
//! nu = n / (1 + 2 sum_k (1 - k/n) rho_k^2)            degrees of freedom of n rows that overlap
//! rho_k = sum_j h_j h_(j + m k) / sum_j h_j^2         their correlation, m the decimation
//! ```
//!
//! **Limit.** The time between false alarms of (W2) is at least `exp(t h)` blocks, with t the positive
//! root of `E0 exp(t l) = 1` (Lorden 1971 for t = 1; Siegmund 1985 for the tilt). Assume `nu E / kappa`
//! has a chi-square distribution; kappa >= 1 is the factor by which the noise may have been
//! underestimated. Then t is the root of
//!
//! ```text
//! t ln rho + ln(1 - t kappa (1 - 1/rho)) = 0,     h = ln(N gamma) / t                                   (W3)
//! ```
//!
//! for any nu (t = 1 for kappa = 1). Here gamma is the wanted time in blocks and N the number of charts.
//! Clipping at h/P only makes the time longer. `rho = 2`, `kappa = 1.1` and 100 h give t = 0.70, h = 20.3 for
//! two joints.
//!
//! **Persistence.** One block adds at most h/P, so an alarm needs P disturbed blocks, and more to make up for
//! undisturbed ones between them. An undisturbed block subtracts `nu/2 (ln rho - 1 + 1/rho)`, 1.7 of 20 at 16
//! Hz. A push of 0.3 s touches three blocks; a persistence of 6 s requires twelve. A wearer who pushes half
//! of the time has changed the load.
//!
//! **Delay.** `h / min(nu/2 (E (1 - 1/rho) - ln rho), h/P)` blocks for an energy E. No energy below
//! `E = rho ln rho / (rho - 1)` is detected: 1.39 for rho = 2, a torque error of 0.62 standard deviations of
//! a row.
//!
//! Sources: E. S. Page, Continuous inspection schemes, 1954; G. Lorden, Procedures for reacting to a change
//! in distribution, 1971; D. Siegmund, Sequential Analysis, 1985; nu: Satterthwaite 1946.
//! Cost: beside the baseline's, some 10 operations a row. Memory: `4 N + 4` numbers.
//! Limits: a joint at rest gives no usable rows, so a load hung on a resting leg is detected once it moves.

use super::baseline::Baseline;
use crate::ident::record::recorder::{LARGEST_STILL_SHARE, SAMPLE_RATE_HZ};
use crate::ident::record::rows::{DECIMATION, FilteredRows};
use crate::ident::signal::kernel::LowPass;
use crate::real::{self, Real};

/// Moving rows of a joint in a block: half a second.
pub(crate) const ROWS_PER_BLOCK: u32 = 25;
const ROW_RATE_HZ: f64 = SAMPLE_RATE_HZ / DECIMATION as f64;
/// Duration of a block for a joint that is never at rest, s.
const BLOCK_S: f64 = ROWS_PER_BLOCK as f64 / ROW_RATE_HZ;
/// Bisections for the root of (W3): to the last bit of single precision.
const HALVINGS: u32 = 30;

/// Tuning of the monitor: rate of false alarms, smallest change of interest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorSettings<T> {
    /// Least mean time between false alarms of a leg that moves all the time, s.
    pub time_between_false_alarms_s: T,
    /// rho: energy of the residual over that at acceptance, for which the sum is optimal; above 1.
    pub energy_ratio: T,
    /// kappa: factor by which the noise variance may have been underestimated; from 1 to
    /// below `rho ln rho / (rho - 1)`.
    pub noise_margin: T,
    /// Time that even the largest change must last, s.
    pub persistence_s: T,
}

impl<T: Real> Default for MonitorSettings<T> {
    fn default() -> Self {
        Self {
            // Weeks of therapy with some hours each.
            time_between_false_alarms_s: T::from_double(100.0 * 3600.0),
            // A torque error as large as the noise of a row: 0.3 kg on the shank of the default leg.
            energy_ratio: T::from_double(2.0),
            // 22 s of motion determine a variance to 5 % (one standard deviation).
            noise_margin: T::from_double(1.1),
            // Two cycles of a gait of 3 s: one spasm or stumble is shorter.
            persistence_s: T::from_double(6.0),
        }
    }
}

impl<T: Real> MonitorSettings<T> {
    /// Energy up to which the sums do not grow: `rho ln rho / (rho - 1)`.
    pub(crate) fn silent_energy(&self) -> T {
        self.energy_ratio * real::ln(self.energy_ratio) / (self.energy_ratio - T::one())
    }
}

/// Alarm: load, wearer or friction changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change<T, const N: usize> {
    /// Time since the sum that raised the alarm began to grow, s: the estimate of when the change happened.
    pub since_s: T,
    /// Joints whose sum is above half of the limit.
    pub joints: [bool; N],
    /// Sum of each joint.
    pub statistic: [T; N],
    /// Limit h that a sum reached.
    pub(crate) limit: T,
}

/// Cumulative sum of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Chart<T> {
    sum: T,
    energy: T,
    rows: u32,
    /// Row instants since the sum was zero.
    age: u32,
}

impl<T: Real> Chart<T> {
    fn new() -> Self {
        Self { sum: T::zero(), energy: T::zero(), rows: 0, age: 0 }
    }
}

/// Monitors the residual of a moving leg.
#[derive(Clone, Debug, PartialEq)]
pub struct Monitor<T, const N: usize> {
    charts: [Chart<T>; N],
    half_freedom: T,
    slope: T,
    intercept: T,
    limit: T,
    largest_step: T,
}

impl<T: Real, const N: usize> Monitor<T, N> {
    /// Builds a monitor for rows that came through `low_pass`.
    pub fn new<const TAPS: usize>(low_pass: &LowPass<T, TAPS>, settings: &MonitorSettings<T>) -> Self {
        let ratio = settings.energy_ratio;
        let blocks =
            settings.time_between_false_alarms_s / T::from_double(BLOCK_S) * T::from_double(N as f64);
        let limit = real::ln(real::max(blocks, T::one())) / exponent(ratio, settings.noise_margin);
        let persistent = real::max(settings.persistence_s / T::from_double(BLOCK_S), T::one());
        Self {
            charts: [Chart::new(); N],
            half_freedom: block_freedom(low_pass.weights()) * T::from_double(0.5),
            slope: T::one() - T::one() / ratio,
            intercept: real::ln(ratio),
            limit,
            largest_step: limit / persistent,
        }
    }

    /// Resets all sums.
    pub fn clear(&mut self) {
        self.charts = [Chart::new(); N];
    }

    /// Limit h of the sums.
    pub fn limit(&self) -> T {
        self.limit
    }

    /// Current sum of each joint.
    pub(crate) fn statistic(&self) -> [T; N] {
        self.charts.map(|chart| chart.sum)
    }

    fn step(&self, energy: T) -> T {
        self.half_freedom * (energy * self.slope - self.intercept)
    }

    /// Takes the rows of one instant, 50 Hz; returns a change at the row that reaches the limit.
    pub fn push<const B: usize>(
        &mut self,
        baseline: &Baseline<T, N, B>,
        rows: &FilteredRows<T, N, B>,
    ) -> Option<Change<T, N>> {
        if !rows.is_finite() {
            return None;
        }
        let moving = rows.still.map(|still| still <= T::from_double(LARGEST_STILL_SHARE));
        self.take(&core::array::from_fn(|joint| {
            moving[joint].then(|| baseline.normalised_square(rows, joint))
        }))
    }

    /// Takes normalised squares of residuals directly; `None` for a joint at rest.
    pub(crate) fn take(&mut self, squares: &[Option<T>; N]) -> Option<Change<T, N>> {
        let mut alarm = None;
        for (joint, square) in squares.iter().enumerate() {
            let chart = &mut self.charts[joint];
            chart.age = chart.age.saturating_add(1);
            let Some(square) = *square else { continue };
            chart.energy += square;
            chart.rows += 1;
            if chart.rows < ROWS_PER_BLOCK {
                continue;
            }
            let energy = chart.energy / T::from_double(f64::from(ROWS_PER_BLOCK));
            let step = real::min(self.step(energy), self.largest_step);
            let chart = &mut self.charts[joint];
            (chart.energy, chart.rows) = (T::zero(), 0);
            chart.sum = real::max(chart.sum + step, T::zero());
            if !(chart.sum > T::zero()) {
                chart.age = 0;
            }
            if chart.sum >= self.limit * T::from_double(ALMOST) {
                alarm = alarm.max(Some(chart.age));
            }
        }
        alarm.map(|age| Change {
            since_s: T::from_double(f64::from(age)) / T::from_double(ROW_RATE_HZ),
            joints: self.charts.map(|chart| chart.sum > self.limit * T::from_double(0.5)),
            statistic: self.statistic(),
            limit: self.limit,
        })
    }
}

/// Rounding margin: P steps of h/P may miss h.
const ALMOST: f64 = 1.0 - 1e-5;

/// Root t of (W3), in 0..=1; at least a thousandth.
fn exponent<T: Real>(ratio: T, margin: T) -> T {
    let (slope, intercept) = (T::one() - T::one() / ratio, real::ln(ratio));
    let balance = |t: T| {
        let inside = T::one() - t * margin * slope;
        if inside > T::zero() { t * intercept + real::ln(inside) } else { -T::one() }
    };
    // The function is concave and zero at t = 0: positive up to the root.
    let (mut low, mut high) = (T::from_double(1e-3), T::one());
    if margin <= T::one() {
        return high;
    }
    for _ in 0..HALVINGS {
        let middle = (low + high) * T::from_double(0.5);
        if balance(middle) > T::zero() { low = middle } else { high = middle }
    }
    low
}

/// nu: degrees of freedom of a block of rows, white noise through these weights.
fn block_freedom<T: Real>(weights: &[T]) -> T {
    let product = |lag: usize| real::dot(weights, weights.get(lag..).unwrap_or(&[]));
    let (energy, rows) = (product(0), T::from_double(f64::from(ROWS_PER_BLOCK)));
    let mut spread = T::one();
    for behind in 1..ROWS_PER_BLOCK as usize {
        let correlation = product(behind * DECIMATION) / energy;
        let share = T::one() - T::from_double(behind as f64) / rows;
        spread += T::from_double(2.0) * share * correlation * correlation;
    }
    rows / spread
}

#[cfg(test)]
mod tests;
