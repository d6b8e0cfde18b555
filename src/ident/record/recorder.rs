//! From logged samples to a record of one motion, in constant memory for any duration.
//!
//! ```text
//! angle, torque 500 Hz -> Hampel -> Smoother -> regressor of smoothed motion -> RowFilter 50 Hz -> Window
//! end of the motion: Window -> weights, Stribeck friction -> one factor per joint (assembly)
//! ```
//!
//! A [`Record`] holds one information factor for each joint, so that noise weights can be chosen afterwards,
//! and the size of the filtered torque. These give the fit of *any* parameters to the motion without the
//! samples; training and validation use the same type.

use core::borrow::BorrowMut;
use core::mem::MaybeUninit;

use super::assembly::{Choices, assemble};
use super::choice::Estimator;
use super::motion_record::{Outliers, Record, Selection, TorqueSize};
use super::row_model::RowModel;
use super::rows::{DECIMATION, Ends, FilteredRows, RowFilter};
use super::window::{self, Window};
use crate::ident::signal::hampel::{self, Hampel, Quantity};
use crate::ident::signal::kernel::{Kernel, KernelError, LowPass};
use crate::ident::signal::noise::NoiseLevel;
use crate::ident::signal::smoothing::{Smoothed, Smoother};
use crate::in_place::{fill, made};
use crate::real::{self, Real};

/// Bandwidth of the smoothing over that of the rows. The smoothing must leave the motion unchanged in the
/// rows' band, so that only one low-pass shapes the equation. With one bandwidth for both, large fast swings
/// are predicted worse: double pendulum's swing-up 0.137 and 0.093 against 0.117 and 0.085 N m, simple
/// pendulum at 3 Hz 0.165 against 0.056.
pub const SMOOTHING_BANDWIDTHS: f64 = 2.0;
/// Sample rate of a [`Recorder`].
pub const SAMPLE_RATE_HZ: f64 = 500.0;

/// Smoothed speed below which a joint may stick, rad/s, where the encoder is fine enough.
pub const STILL_SPEED: f64 = 0.03;
/// Pulse of the smoothed speed at one count of an encoder, in counts per period of the rows' bandwidth.
pub(crate) const PULSE_COUNTS: f64 = 6.2;
/// Speed below which a joint may stick, in pulses of a coarse encoder. A joint that sticks beside an edge
/// between two counts shows one pulse; the rest is margin.
pub(crate) const STILL_PULSES: f64 = 1.6;
/// Largest share of standstill in a row's window for the row to be used. Friction at rest takes any value up
/// to breakaway, so a row beyond it is unreliable. On the MuJoCo leg, whose hip sticks a fifth of the time,
/// using such rows costs 14 % of Coulomb friction and twelve times the torque error. On the simulated default
/// leg a share of 0.3 biases the knee's rotor inertia by 2.5 standard deviations, 0.05 by 0.1.
pub const LARGEST_STILL_SHARE: f64 = 0.05;

/// Window of the blocks of one motion, with the device's size.
pub type MotionWindow<T, const N: usize, const B: usize> = Window<T, N, B, { window::NUMBERS }>;

/// Both filters of a recorder, built before it: construction may fail while nothing large is allocated yet.
#[derive(Clone, Debug, PartialEq)]
pub struct Filters<T, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> {
    smoothing: Kernel<T, TAPS>,
    low_pass: LowPass<T, TAPS>,
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
        let rate = T::from_double(SAMPLE_RATE_HZ);
        let low_pass = LowPass::new(bandwidth_hz, rate)?;
        if RowFilter::<T, N, B, PENDING>::outputs_needed(low_pass.taps()) > PENDING {
            return Err(KernelError::TooLong { needed: low_pass.taps() });
        }
        let smoothing = Kernel::new(T::from_double(SMOOTHING_BANDWIDTHS) * bandwidth_hz, rate)?;
        Ok(Self { smoothing, low_pass })
    }

    /// Row low-pass, the second filter.
    pub(crate) fn low_pass(&self) -> &LowPass<T, TAPS> {
        &self.low_pass
    }
}

/// Accumulates one motion after the other. The recorder owns its window, or `W`
/// refers to one elsewhere in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorder<
    T,
    const N: usize,
    const B: usize,
    const TAPS: usize,
    const PENDING: usize,
    W = MotionWindow<T, N, B>,
> {
    smoothing: Kernel<T, TAPS>,
    low_pass: LowPass<T, TAPS>,
    smoother: Smoother<T, N, TAPS>,
    filter: RowFilter<T, N, B, PENDING>,
    estimator: Estimator,
    ends: Ends,
    /// True if disturbed stretches of this motion get less weight.
    reweights: bool,
    /// Outlier filters for angle and torque of each joint.
    hampel: [[Hampel<T>; 2]; N],
    window: W,
    choices: Option<Choices<N>>,
    samples: u32,
    replaced: [u32; N],
    noise: [NoiseLevel<T>; N],
    speed: [Sum<T>; N],
    instants: u32,
    rows: [u32; N],
    rejected: u32,
}

/// Results of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress<T, const N: usize, const B: usize> {
    /// Smoothed motion `reach` samples ago.
    pub instant: Smoothed<T, N>,
    /// Rows finished by this sample; their centre lies `2 reach` samples ago.
    pub rows: Option<FilteredRows<T, N, B>>,
}

impl<T: Real, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize>
    Recorder<T, N, B, TAPS, PENDING>
{
    /// Builds a recorder whose low-pass is 3 dB down at `bandwidth_hz`.
    ///
    /// # Errors
    /// [`KernelError`] when the bandwidth is invalid or its kernel does not fit `TAPS` and `PENDING`.
    pub fn new(bandwidth_hz: T) -> Result<Self, KernelError> {
        Self::with_window(bandwidth_hz, Window::new())
    }
}

impl<T: Real, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>
    Recorder<T, N, B, TAPS, PENDING, W>
where
    W: BorrowMut<MotionWindow<T, N, B>>,
{
    /// Builds a recorder with the given empty window.
    ///
    /// # Errors
    /// See [`Recorder::new`].
    #[inline]
    pub fn with_window(bandwidth_hz: T, window: W) -> Result<Self, KernelError> {
        let filters = Filters::new(bandwidth_hz)?;
        Ok(made(|slot| Self::new_in(slot, &filters, Estimator::Robust, window)))
    }

    /// Builds a recorder in place, from filters that already fit.
    pub(crate) fn new_in<'a>(
        slot: &'a mut MaybeUninit<Self>,
        filters: &Filters<T, N, B, TAPS, PENDING>,
        estimator: Estimator,
        window: W,
    ) -> &'a mut Self {
        fill!(slot, {
            smoothing: filters.smoothing.clone(),
            low_pass: filters.low_pass.clone(),
            smoother: Smoother::new(),
            filter: RowFilter::new(Ends::Cut),
            estimator: estimator,
            ends: Ends::Cut,
            reweights: true,
            hampel: core::array::from_fn(|_| [Hampel::new(Quantity::Angle), Hampel::new(Quantity::Torque)]),
            window: window,
            choices: None,
            samples: 0,
            replaced: [0; N],
            noise: [NoiseLevel::new(); N],
            speed: [Sum::zero(); N],
            instants: 0,
            rows: [0; N],
            rejected: 0,
        }, {})
    }

    /// Delay of the smoothed motion behind the newest sample, in samples.
    pub fn delay(&self) -> usize {
        self.smoothing.reach()
            + match self.estimator {
                Estimator::Robust => hampel::REACH,
                Estimator::Plain => 0,
            }
    }

    /// Sets the treatment of disturbances; the default is [`Estimator::Robust`].
    pub fn set_estimator(&mut self, estimator: Estimator) {
        self.estimator = estimator;
    }

    /// Taps of the low-pass to each side of a row's centre.
    pub fn reach(&self) -> usize {
        self.low_pass.reach()
    }

    /// Gives all rows of the current motion equal weight: without a known noise level
    /// disturbances cannot be detected.
    pub fn count_disturbances(&mut self) {
        self.reweights = false;
    }

    /// Discards everything, for a new motion or for a part of one to be analysed by itself. With whole
    /// windows no Stribeck friction is searched: the model's own applies.
    pub fn clear(&mut self, ends: Ends) {
        self.smoother.clear();
        self.hampel.iter_mut().flatten().for_each(Hampel::restart);
        self.filter = RowFilter::new(ends);
        self.window.borrow_mut().clear();
        self.choices = None;
        self.ends = ends;
        self.reweights = true;
        self.noise = [NoiseLevel::new(); N];
        self.speed = [Sum::zero(); N];
        (self.samples, self.replaced) = (0, [0; N]);
        (self.instants, self.rows, self.rejected) = (0, [0; N], 0);
    }

    /// Returns the samples held back for lack of neighbours after the last one, one per call; then `None`.
    /// Call it before [`Self::break_off`] or [`Self::finish`], which drop held-back samples.
    pub fn flush(&mut self, model: &RowModel<T, N, B>) -> Option<Option<Progress<T, N, B>>> {
        if self.estimator == Estimator::Plain {
            return None;
        }
        let (mut position, mut torque) = ([T::zero(); N], [T::zero(); N]);
        for joint in 0..N {
            let [angle, effort] = &mut self.hampel[joint];
            let (angle, effort) = (angle.finish()?, effort.finish()?);
            (position[joint], torque[joint]) = (angle.value, effort.value);
            let outlier = u32::from(angle.outlier) + u32::from(effort.outlier);
            self.replaced[joint] = self.replaced[joint].saturating_add(outlier);
        }
        Some(self.advance(model, &position, &torque))
    }

    /// Ends a continuous stretch of samples: windows restart, rows already taken stay. Returns the number
    /// of rows that the cut windows at the end gave.
    pub fn break_off(&mut self) -> u32 {
        self.smoother.clear();
        self.noise.iter_mut().for_each(NoiseLevel::break_off);
        self.hampel.iter_mut().flatten().for_each(Hampel::restart);
        let mut finished = 0;
        while let Some(rows) = self.filter.finish(&self.low_pass) {
            self.take(&rows);
            finished += 1;
        }
        self.window.borrow_mut().close();
        finished
    }

    fn take(&mut self, rows: &FilteredRows<T, N, B>) {
        if !rows.is_finite() {
            self.rejected = self.rejected.saturating_add(1);
            return;
        }
        let taken = rows.still.map(|still| !(still > T::from_double(LARGEST_STILL_SHARE)));
        if !self.window.borrow_mut().insert(rows, &taken) {
            self.rejected = self.rejected.saturating_add(1);
            return;
        }
        for (count, taken) in self.rows.iter_mut().zip(taken) {
            *count = count.saturating_add(u32::from(taken));
        }
    }

    /// Sample of a few samples ago, outliers replaced.
    fn clean(&mut self, position: &[T; N], torque: &[T; N]) -> Option<([T; N], [T; N])> {
        if self.estimator == Estimator::Plain {
            return Some((*position, *torque));
        }
        let (mut angles, mut torques, mut complete) = ([T::zero(); N], [T::zero(); N], true);
        for (joint, [angle, effort]) in self.hampel.iter_mut().enumerate() {
            let cleaned = (angle.push(position[joint]), effort.push(torque[joint]));
            let (Some(angle), Some(effort)) = cleaned else {
                complete = false;
                continue;
            };
            (angles[joint], torques[joint]) = (angle.value, effort.value);
            let outlier = u32::from(angle.outlier) + u32::from(effort.outlier);
            self.replaced[joint] = self.replaced[joint].saturating_add(outlier);
        }
        complete.then_some((angles, torques))
    }

    /// Takes one 500 Hz sample: D-H angles in rad, D-H torques in N m. A function of its own in the image,
    /// where `cargo chip load` counts its instructions.
    #[inline(never)]
    pub fn push(
        &mut self,
        model: &RowModel<T, N, B>,
        position: &[T; N],
        torque: &[T; N],
    ) -> Option<Progress<T, N, B>> {
        if !position.iter().chain(torque).all(|&value| real::is_finite(value)) {
            self.rejected = self.rejected.saturating_add(1);
            self.break_off();
            return None;
        }
        for (noise, &torque) in self.noise.iter_mut().zip(torque) {
            noise.push(torque);
        }
        if self.choices.is_none() {
            let choices = Choices::from_model(model);
            self.choices = Some(if self.ends == Ends::Cut { choices } else { choices.without_stribeck() });
            self.window.borrow_mut().lay_out(model);
        }
        self.samples = self.samples.saturating_add(1);
        let (position, torque) = self.clean(position, torque)?;
        self.advance(model, &position, &torque)
    }

    /// Runs the filter chain behind the outlier filter.
    fn advance(
        &mut self,
        model: &RowModel<T, N, B>,
        position: &[T; N],
        torque: &[T; N],
    ) -> Option<Progress<T, N, B>> {
        let instant = self.smoother.push(&self.smoothing, position, torque)?;
        self.instants = self.instants.saturating_add(1);
        for (sum, &velocity) in self.speed.iter_mut().zip(&instant.velocity) {
            sum.add(velocity * velocity);
        }
        let rows = self.filter.push(&self.low_pass, &model.rows(&instant));
        match &rows {
            Some(rows) => self.take(rows),
            // Nine of ten samples finish no row.
            None => {
                self.window.borrow_mut().tidy();
            }
        }
        Some(Progress { instant, rows })
    }

    /// Number of rows taken so far, per joint.
    pub fn rows(&self) -> [u32; N] {
        self.rows
    }

    /// Record of everything since [`Self::clear`], including the last samples.
    pub fn finish(&mut self) -> Record<T, N, B> {
        self.break_off();
        self.record()
    }

    fn record(&self) -> Record<T, N, B> {
        let information = T::from_double(DECIMATION as f64) * self.low_pass.energy();
        let estimator = if self.reweights { self.estimator } else { Estimator::Plain };
        let assembly = assemble(self.window.borrow(), self.choices.as_ref(), estimator, information);
        let instants = T::from_double(f64::from(self.instants.max(1)));
        Record {
            factors: assembly.factors,
            torque: core::array::from_fn(|joint| TorqueSize {
                speed: real::sqrt(self.speed[joint].value() / instants),
                ..assembly.torque[joint]
            }),
            rows: assembly.rows,
            rejected: self.rejected,
            row_information: information,
            outliers: Outliers { samples: self.samples, replaced: self.replaced, ..assembly.outliers },
            stribeck: assembly.stribeck,
            selection: Selection { stribeck: assembly.tried, ..Selection::all() },
            noise: self.noise.map(|noise| noise.sigma()),
        }
    }
}

/// A sum that keeps its digits over millions of terms (Neumaier 1974).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sum<T> {
    total: T,
    lost: T,
}

impl<T: Real> Sum<T> {
    fn zero() -> Self {
        Self { total: T::zero(), lost: T::zero() }
    }
    fn add(&mut self, term: T) {
        let total = self.total + term;
        self.lost += if real::abs(self.total) >= real::abs(term) {
            (self.total - total) + term
        } else {
            (term - total) + self.total
        };
        self.total = total;
    }
    fn value(&self) -> T {
        self.total + self.lost
    }
}
