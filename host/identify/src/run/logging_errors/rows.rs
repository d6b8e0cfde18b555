//! Whole recordings as filtered rows in double precision, and the changes that a direction makes to them.
//!
//! The filter chain is that of the identification: smoothing with twice the bandwidth, regressor, one
//! low-pass for regressor and torque, 50 Hz. Windows are whole, so that a row's torque can be moved in time.
//! Training and held-out part of a split file are one motion here.
//!
//! ```text
//! row k of joint j:   torque_jk = columns_jk p + noise       used where the joint moves (stillness rule)
//! weight            = sqrt(block weight) / s_j               s_j: one independent row, from the residual
//! ```
//!
//! Blocks of 16 rows whose residual is far above the median lose their weight, so a push is not taken for a
//! delay. Cost: a few regressors for each 500 Hz sample. Memory: the rows.

use std::sync::Arc;

use scarab::ident::{DECIMATION, Kernel, KernelError, LowPass, SAMPLE_RATE_HZ, SMOOTHING_BANDWIDTHS};
use scarab_base::stats::{quantile, rms};

use crate::run::logging_errors::fit::{Fit, Score, score, segment_sigma, solve};
use crate::run::logging_errors::regressor::{Filtered, Instant, Regressor};
use crate::run::logging_errors::table::Table;
use crate::run::resample::TAPS;

/// Rows of a block with a common weight.
const BLOCK_ROWS: usize = 16;
/// Residual of a block over the median, from which its weight falls, and at which it is zero.
const DISTURBED: (f64, f64) = (3.0, 6.0);
/// Largest length of a cluster, s.
const LARGEST_CLUSTER_S: f64 = 2.0;
/// Shortest length of a cluster, s.
const SMALLEST_CLUSTER_S: f64 = 1.0;
/// Least number of clusters.
const CLUSTERS: f64 = 8.0;
/// Least number of rows of a joint, for each parameter.
const ROWS_PER_PARAMETER: usize = 5;

/// One recording on the 500 Hz grid, chain angles and torques.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Duration of its training part from the start, s; infinite for a training file.
    pub(crate) training_s: f64,
    /// Start in its recording and duration of the recording, s.
    pub(crate) within_s: [f64; 2],
    /// Chain angles, rad.
    pub(crate) position: Table,
    /// Chain torques, N m.
    pub(crate) torque: Table,
}

/// Smoothing filter and low-pass filter.
#[derive(Clone, Debug)]
pub(crate) struct Filters {
    smoothing: Box<Kernel<f64, TAPS>>,
    low_pass: Box<LowPass<f64, TAPS>>,
}

impl Filters {
    /// Filters of an identification at this bandwidth.
    ///
    /// # Errors
    /// The filter cannot be built for the bandwidth.
    pub fn new(bandwidth_hz: f64) -> Result<Self, KernelError> {
        Ok(Self {
            smoothing: Box::new(Kernel::new(SMOOTHING_BANDWIDTHS * bandwidth_hz, SAMPLE_RATE_HZ)?),
            low_pass: Box::new(LowPass::new(bandwidth_hz, SAMPLE_RATE_HZ)?),
        })
    }
}

/// One motion after the smoothing.
#[derive(Clone, Debug)]
struct Part {
    instants: Vec<Instant>,
    /// Low-passed torque of each joint at every grid point; zero where the window is incomplete.
    filtered: Vec<Vec<f64>>,
    /// Grid point of the first row's centre.
    first: usize,
    training_s: f64,
    within_s: [f64; 2],
}

impl Part {
    fn new(motion: &Motion, joints: usize, filters: &Filters) -> Self {
        let (smoothing, low_pass) = (&*filters.smoothing, &*filters.low_pass);
        let reach = smoothing.reach();
        let columns =
            |series: &Table| (0..joints).map(|joint| series.column(joint).collect::<Vec<f64>>()).collect();
        let (angles, torques): (Vec<Vec<f64>>, Vec<Vec<f64>>) =
            (columns(&motion.position), columns(&motion.torque));
        let samples = motion.position.len();
        let instants = (reach..samples.saturating_sub(reach)).map(|at| {
            let mut instant = Instant::default();
            instant.torque[..joints].copy_from_slice(&motion.torque[at]);
            for joint in 0..joints {
                let window = &angles[joint][at - reach..=at + reach];
                (instant.position[joint], instant.velocity[joint], instant.acceleration[joint]) =
                    smoothing.apply(window, &[], angles[joint][at]);
            }
            instant
        });
        let weights = low_pass.weights();
        let filtered = torques.iter().map(|torque| {
            let mut filtered = vec![0.0; torque.len()];
            let windows = torque.windows(weights.len());
            for (slot, window) in filtered.iter_mut().skip(low_pass.reach()).zip(windows) {
                *slot = window.iter().zip(weights).map(|(sample, weight)| sample * weight).sum();
            }
            filtered
        });
        Self {
            instants: instants.collect(),
            filtered: filtered.collect(),
            first: reach + low_pass.reach(),
            training_s: motion.training_s,
            within_s: motion.within_s,
        }
    }

    fn rows(&self, filters: &Filters, regressor: &dyn Regressor, change: &dyn Fn(&mut Instant)) -> Filtered {
        regressor.filtered(&filters.low_pass, &self.instants, change)
    }

    /// Low-passed torque of a joint at a row, measured `late_s` later than its angle: cubic between grid
    /// points.
    fn torque(&self, joint: usize, row: usize, late_s: f64) -> f64 {
        let position = (self.first + DECIMATION * row) as f64 + late_s * SAMPLE_RATE_HZ;
        let base = position.floor();
        let (at, share) = (base as usize, position - base);
        let series = &self.filtered[joint];
        if share == 0.0 {
            return series[at];
        }
        let [before, left, right, after] = [series[at - 1], series[at], series[at + 1], series[at + 2]];
        let (rise, fall) = (0.5 * (right - before), 0.5 * (after - left));
        let rest = 1.0 - share;
        rest * rest * ((1.0 + 2.0 * share) * left + share * rise)
            + share * share * ((1.0 + 2.0 * rest) * right - rest * fall)
    }
}

/// Origin of an equation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowSource {
    /// Index of its motion.
    pub(crate) motion: usize,
    /// Index of the row in its motion, at 50 Hz.
    row: usize,
    /// Joint, from 0.
    pub(crate) joint: usize,
    /// Whether it belongs to the training motion.
    pub(crate) training: bool,
    /// Segment of at most two seconds.
    pub(crate) cluster: usize,
    /// Time from the start of its recording, as a share of the recording's duration.
    pub(crate) share: f64,
}

impl RowSource {
    /// Time of a drift: from -0.5 at the start of the recording to 0.5 at its end.
    pub(crate) fn drift(&self) -> f64 {
        self.share - 0.5
    }
}

/// All usable rows of all joints, one equation each.
#[derive(Clone)]
pub(crate) struct Equations {
    filters: Filters,
    parts: Arc<[Part]>,
    /// Regressor of the leg.
    pub(crate) regressor: Arc<dyn Regressor>,
    /// Columns that are estimated.
    pub(crate) active: Vec<bool>,
    /// One over the variance by which each is known to be zero; zero where unknown.
    pub(crate) known: Vec<f64>,
    /// Origin of each equation.
    pub(crate) sources: Vec<RowSource>,
    /// Regressor columns.
    pub(crate) columns: Table,
    /// Low-passed torque, N m.
    pub(crate) torque: Vec<f64>,
    /// Weight of each equation, 1/(N m).
    pub(crate) weight: Vec<f64>,
    /// Standard deviation of an independent row of each joint, N m, from the residual.
    pub(crate) row_sigma: Vec<f64>,
    /// Rows of each joint's factor that count, in complete rows.
    pub(crate) rows: Vec<f64>,
}

impl Equations {
    /// Filters the motions; `None` if a joint has too few rows.
    pub fn new(
        regressor: &Arc<dyn Regressor>,
        motions: &[Motion],
        filters: Filters,
        active: &[bool],
    ) -> Option<Self> {
        let joints = regressor.joints();
        let mut all = Self {
            parts: motions.iter().map(|motion| Part::new(motion, joints, &filters)).collect(),
            filters,
            regressor: regressor.clone(),
            active: active.to_vec(),
            known: regressor.known(),
            sources: Vec::new(),
            columns: Table::new(regressor.rank()),
            torque: Vec::new(),
            weight: Vec::new(),
            row_sigma: vec![1.0; joints],
            rows: vec![0.0; joints],
        };
        all.collect();
        let columns = active.iter().filter(|on| **on).count();
        let enough = (0..joints).all(|joint| {
            all.sources.iter().filter(|source| source.joint == joint && source.training).count()
                >= ROWS_PER_PARAMETER * columns
        });
        if !enough {
            return None;
        }
        all.weigh();
        Some(all)
    }

    /// Number of joints.
    pub(crate) fn joints(&self) -> usize {
        self.regressor.joints()
    }

    /// Largest delay that can be tried, s.
    pub(crate) fn largest_delay_s(&self) -> f64 {
        (self.filters.smoothing.reach() as f64 - 3.0) / SAMPLE_RATE_HZ
    }

    /// Information of one row in independent rows.
    pub fn information(&self) -> f64 {
        DECIMATION as f64 * self.energy()
    }

    /// Share of a 500 Hz sample's noise variance that the low-pass leaves.
    pub(crate) fn energy(&self) -> f64 {
        self.filters.low_pass.energy()
    }

    fn collect(&mut self) {
        let row_s = DECIMATION as f64 / SAMPLE_RATE_HZ;
        let total: f64 = self.parts.iter().map(|part| part.instants.len() as f64 / SAMPLE_RATE_HZ).sum();
        let length = (total / CLUSTERS).clamp(SMALLEST_CLUSTER_S, LARGEST_CLUSTER_S);
        let mut clusters = 0;
        for (number, part) in self.parts.iter().enumerate() {
            let rows = part.rows(&self.filters, &*self.regressor, &|_| {});
            let joints = self.joints();
            let count = (rows.torque.len() / joints).max(1) as f64;
            let pieces = (count * row_s / length).round().max(1.0);
            let start_s = part.first as f64 / SAMPLE_RATE_HZ;
            for index in (0..rows.torque.len()).filter(|&index| rows.is_usable[index]) {
                let (row, joint) = (index / joints, index % joints);
                let time_s = start_s + row as f64 * row_s;
                self.sources.push(RowSource {
                    motion: number,
                    row,
                    joint,
                    training: time_s < part.training_s,
                    cluster: clusters + (row as f64 / count * pieces) as usize,
                    share: (part.within_s[0] + time_s) / part.within_s[1],
                });
                self.columns.push(&rows.regressor[index]);
                self.torque.push(rows.torque[index]);
            }
            clusters += pieces as usize;
        }
        self.weight = vec![1.0; self.torque.len()];
    }

    /// Columns with a changed motion or regressor, for the same equations.
    #[must_use]
    pub(crate) fn columns_of(&self, regressor: &dyn Regressor, change: &dyn Fn(&mut Instant)) -> Table {
        self.columns_at(&self.sources, regressor, change)
    }

    /// [`Self::columns_of`] for the equations of another motion with the same number of samples.
    #[must_use]
    pub(crate) fn columns_at(
        &self,
        sources: &[RowSource],
        regressor: &dyn Regressor,
        change: &dyn Fn(&mut Instant),
    ) -> Table {
        let parts = self.parts.iter().map(|part| part.rows(&self.filters, regressor, change).regressor);
        self.at_sources(sources, &parts.collect::<Vec<_>>())
    }

    /// Rows of the parts that belong to these equations.
    fn at_sources(&self, sources: &[RowSource], parts: &[Table]) -> Table {
        let row = |source: &RowSource| &parts[source.motion][source.row * self.joints() + source.joint];
        Table::of_rows(self.regressor.rank(), sources.iter().map(row))
    }

    /// Smoothed motion of every recording on the 500 Hz grid, with the duration of its training part, s.
    pub(crate) fn smoothed(&self) -> impl Iterator<Item = (&[Instant], f64)> {
        let late_s = self.filters.smoothing.reach() as f64 / SAMPLE_RATE_HZ;
        self.parts.iter().map(move |part| (&part.instants[..], part.training_s - late_s))
    }

    /// Standard deviations of the parameters of a fit to the training motion, by the scatter of its segments.
    pub(crate) fn scatter(&self, fit: &Fit) -> Vec<f64> {
        segment_sigma(fit, &self.columns, &self.torque, &self.training_weight(), &self.clusters())
    }

    /// Cluster of each equation.
    pub(crate) fn clusters(&self) -> Vec<usize> {
        self.sources.iter().map(|source| source.cluster).collect()
    }

    /// Estimates column `z` beside the parameters of `fit`, which are those of these columns and torques.
    pub(crate) fn score(&self, fit: &Fit, columns: &Table, torque: &[f64], z: &[f64]) -> Score {
        score(fit, columns, torque, z, &self.weight, &self.clusters())
    }

    /// Chain angle of a joint at its equations, rad; zero at those of others.
    pub(crate) fn angles(&self, joint: usize) -> Vec<f64> {
        let reach = self.filters.low_pass.reach();
        let angle = |source: &RowSource| {
            let instant = self.parts[source.motion].instants.get(reach + DECIMATION * source.row);
            instant.filter(|_| source.joint == joint).map_or(0.0, |instant| instant.position[joint])
        };
        self.sources.iter().map(angle).collect()
    }

    /// Torque of all equations; where `late_s` gives a time, that much after the angle.
    pub(crate) fn delayed(&self, late_s: impl Fn(&RowSource) -> Option<f64>) -> Vec<f64> {
        let pairs = self.sources.iter().zip(&self.torque);
        pairs
            .map(|(source, &torque)| match late_s(source) {
                Some(late_s) => self.parts[source.motion].torque(source.joint, source.row, late_s),
                None => torque,
            })
            .collect()
    }

    /// Time of an equation from the middle of its recording, s.
    pub(crate) fn time_from_middle_s(&self, source: &RowSource) -> f64 {
        source.drift() * self.parts[source.motion].within_s[1]
    }

    /// Low-passed torques of a changed motion, for the same equations.
    pub(crate) fn torques_of(&self, change: &dyn Fn(&mut Instant)) -> Vec<f64> {
        let rows = self.parts.iter().map(|part| part.rows(&self.filters, &*self.regressor, change).torque);
        let parts: Vec<Vec<f64>> = rows.collect();
        let joints = self.joints();
        self.sources.iter().map(|source| parts[source.motion][source.row * joints + source.joint]).collect()
    }

    /// Sum of squared weighted residuals of each joint.
    pub(crate) fn cost_of_joints(&self, residuals: &[f64]) -> Vec<f64> {
        let mut cost = vec![0.0; self.joints()];
        for ((residual, weight), source) in residuals.iter().zip(&self.weight).zip(&self.sources) {
            cost[source.joint] += (residual * weight).powi(2);
        }
        cost
    }

    /// Columns of every row of every recording, including rows without an equation.
    pub(crate) fn every_row(&self) -> Vec<Table> {
        let rows = self.parts.iter().map(|part| part.rows(&self.filters, &*self.regressor, &|_| {}));
        rows.map(|rows| rows.regressor).collect()
    }

    /// Columns of all equations; those of `joint`, or of all joints, behind a first-order low-pass of this
    /// time constant. Exact where the columns of `every_row` are straight between two rows.
    pub(crate) fn low_passed(&self, every_row: &[Table], joint: Option<usize>, constant_s: f64) -> Table {
        let step_s = DECIMATION as f64 / SAMPLE_RATE_HZ;
        let (decay, lag) = ((-step_s / constant_s).exp(), constant_s / step_s);
        let joints = self.joints();
        let behind = every_row.iter().map(|rows| {
            let mut behind = rows.clone();
            let lagging = |index: &usize| joint.is_none_or(|joint| joint == index % joints);
            for index in (joints..rows.len()).filter(lagging) {
                let last = index - joints;
                for base in 0..self.regressor.rank() {
                    let (before, now) = (rows[last][base], rows[index][base]);
                    let rise = lag * (now - before);
                    behind[index][base] = now - rise + (behind[last][base] - before + rise) * decay;
                }
            }
            behind
        });
        self.at_sources(&self.sources, &behind.collect::<Vec<_>>())
    }

    /// Rate of change of a series given at the equations, within each joint and motion; zero at gaps and
    /// ends.
    pub(crate) fn rate_of(&self, series: &[f64]) -> Vec<f64> {
        let step = DECIMATION as f64 / SAMPLE_RATE_HZ;
        let joints = self.joints();
        let mut slots: Vec<usize> = Vec::new();
        let mut starts = Vec::with_capacity(self.parts.len());
        for part in &*self.parts {
            starts.push(slots.len());
            slots.resize(slots.len() + joints * (part.instants.len() / DECIMATION + 2), usize::MAX);
        }
        for (index, source) in self.sources.iter().enumerate() {
            slots[starts[source.motion] + joints * source.row + source.joint] = index;
        }
        let at = |source: &RowSource, offset: isize| -> Option<f64> {
            let row = source.row.checked_add_signed(offset)?;
            let end = starts.get(source.motion + 1).copied().unwrap_or(slots.len());
            let slot = starts[source.motion] + joints * row + source.joint;
            series.get(*slots.get(slot).filter(|_| slot < end)?).copied()
        };
        let rate = |source: &RowSource| -> f64 {
            let [two_back, back, on, two_on] = [-2, -1, 1, 2].map(|offset| at(source, offset));
            match (two_back, back, on, two_on) {
                (Some(a), Some(b), Some(c), Some(d)) => (8.0 * (c - b) - (d - a)) / (12.0 * step),
                (_, Some(b), Some(c), _) => (c - b) / (2.0 * step),
                _ => 0.0,
            }
        };
        self.sources.iter().map(rate).collect()
    }

    /// Least squares with these columns and torques, all equations or those of the training motion.
    pub(crate) fn fit(&self, columns: &Table, torque: &[f64], training_only: bool) -> Fit {
        if !training_only {
            return solve(columns, torque, &self.weight, &self.active, &self.known);
        }
        solve(columns, torque, &self.training_weight(), &self.active, &self.known)
    }

    /// Copy in which every column is estimated, whatever the data chose.
    pub(crate) fn with_all_columns(&self) -> Self {
        Self { active: vec![true; self.active.len()], ..self.clone() }
    }

    /// [`Self::with_all_columns`] of the training motion.
    pub(crate) fn for_training(&self) -> Self {
        Self { weight: self.training_weight(), ..self.with_all_columns() }
    }

    /// Copy in which every equation has the weight of its joint.
    pub(crate) fn with_equal_weights(&self) -> Self {
        let weight = self.sources.iter().map(|source| 1.0 / self.row_sigma[source.joint]).collect();
        Self { weight, ..self.clone() }
    }

    /// Weights of the equations of the training motion; zero for the others.
    pub(crate) fn training_weight(&self) -> Vec<f64> {
        let pairs = self.weight.iter().zip(&self.sources);
        pairs.map(|(&weight, source)| if source.training { weight } else { 0.0 }).collect()
    }

    /// Computes weights from the residual: first the scales of the joints, then the blocks with a large
    /// residual.
    fn weigh(&mut self) {
        let mut trust = vec![1.0; self.torque.len()];
        for joint in 0..self.joints() {
            let torque = self.of_joint(joint).map(|index| self.torque[index]);
            self.row_sigma[joint] = rms(torque).max(1e-9);
        }
        for round in 0..10 {
            self.weight = self
                .sources
                .iter()
                .zip(&trust)
                .map(|(source, trust): (&RowSource, &f64)| trust.sqrt() / self.row_sigma[source.joint])
                .collect();
            let fit = solve(&self.columns, &self.torque, &self.weight, &self.active, &self.known);
            let residual = fit.residuals(&self.columns, &self.torque);
            for joint in 0..self.joints() {
                self.trust(joint, &residual, round < 5, &mut trust);
                self.scale(joint, &residual, &trust, fit.rank);
            }
        }
    }

    fn of_joint(&self, joint: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.sources.len()).filter(move |&index| self.sources[index].joint == joint)
    }

    fn trust(&self, joint: usize, residual: &[f64], gently: bool, trust: &mut [f64]) {
        let mut blocks: Vec<(usize, usize, Vec<usize>)> = Vec::new();
        for index in self.of_joint(joint) {
            let source = &self.sources[index];
            let key = (source.motion, source.row / BLOCK_ROWS);
            match blocks.last_mut() {
                Some((part, block, list)) if (*part, *block) == key => list.push(index),
                _ => blocks.push((key.0, key.1, vec![index])),
            }
        }
        let size = |list: &[usize]| rms(list.iter().map(|&index| residual[index]));
        let sizes: Vec<f64> = blocks.iter().map(|(_, _, list)| size(list)).collect();
        let median = quantile(sizes.clone(), 0.5);
        for ((_, _, list), size) in blocks.iter().zip(&sizes) {
            let ratio = size / median.max(1e-12);
            let (from, to) = DISTURBED;
            let share = if gently {
                (from / ratio.max(1e-12)).min(1.0)
            } else {
                ((to - ratio) / (to - from)).clamp(0.0, 1.0)
            };
            list.iter().for_each(|&index| trust[index] = share);
        }
    }

    fn scale(&mut self, joint: usize, residual: &[f64], trust: &[f64], rank: usize) {
        let list: Vec<usize> = self.of_joint(joint).collect();
        let counted: f64 = list.iter().map(|&index| trust[index]).sum();
        let square: f64 = list.iter().map(|&index| trust[index] * residual[index].powi(2)).sum();
        let information = self.information().max(1e-3);
        let free = (counted - rank as f64 / information).max(1.0);
        let floor = 1e-5 * rms(list.iter().map(|&index| self.torque[index]));
        self.rows[joint] = counted;
        self.row_sigma[joint] = (square / free / information).sqrt().max(floor).max(1e-9);
    }
}
