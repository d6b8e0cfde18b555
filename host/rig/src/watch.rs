//! Observes a simulated run, including data that the firmware does not have.

use std::time::Instant;

use hal_sim::world::TICK_S;
use scarab::ident::record::stribeck::combination;
use scarab::ident::{
    Ends, FilteredRows, LARGEST_STILL_SHARE, Reason, Record, Recorder, RowFilter, RowModel, Smoothed,
    Smoother, Solver, Verdict,
};
use scarab::leg::{LoggedSample, Segment};
use scarab::model::Parameter;
use scarab::real::sqrt;
use scarab_base::error::ToolError;
use scarab_base::names::VALIDATION_NAMES;
use scarab_identify::report::findings::FindingReport;
use scarab_identify::report::scale::ScaleReport;
use scarab_identify::report::series::{Reader, Role, Series};
use scarab_identify::report::{RunReport, TrackingReport};
use scarab_identify::run::analysis::{Circumstances, Costs, Motion as RecordedMotion, TruthFit};
use scarab_identify::run::information::Information;
use scarab_identify::run::scale::{Scale, loaded};

use crate::options::SimulationOptions;
use crate::pair::{Context, PENDING, Pair, TAPS};
use crate::scale;

/// A logged sample is the mean of eight ticks and begins with the motion's first.
const MIDDLE_OF_A_SAMPLE_TICKS: f64 = 3.5;

/// Noise-free torque and sticking, through the same filter chain as the measured torque.
struct TruthChain<const N: usize, const B: usize> {
    torque: Box<Smoother<f32, N, TAPS>>,
    sticking: Box<Smoother<f32, N, TAPS>>,
    filter: Box<RowFilter<f32, N, B, PENDING>>,
    rows: Vec<FilteredRows<f32, N, B>>,
}

impl<const N: usize, const B: usize> TruthChain<N, B> {
    fn new() -> Self {
        Self {
            torque: Box::new(Smoother::new()),
            sticking: Box::new(Smoother::new()),
            filter: Box::new(RowFilter::new(Ends::Whole)),
            rows: Vec::new(),
        }
    }

    fn start(&mut self) -> Vec<FilteredRows<f32, N, B>> {
        self.torque.clear();
        self.sticking.clear();
        self.filter.clear();
        core::mem::take(&mut self.rows)
    }

    fn push(&mut self, context: &Context<N, B>, position: &[f32; N], torque: &[f32; N], sticking: &[f32; N]) {
        let sticking = self.sticking.push(&context.smoothing, position, sticking);
        let instant: Option<Smoothed<f32, N>> = self.torque.push(&context.smoothing, position, torque);
        if let (Some(instant), Some(sticking)) = (instant, sticking) {
            let mut rows = context.background.device.rows(&instant);
            rows.still = sticking.torque;
            self.rows.extend(self.filter.push(&context.low_pass, &rows));
        }
    }
}

/// Compares base values with the noise-free torque of one motion.
fn truth_fit<const N: usize, const B: usize>(
    rows: &[FilteredRows<f32, N, B>],
    model: &RowModel<f32, N, B>,
    values: &[f32; B],
) -> [TruthFit; N] {
    core::array::from_fn(|joint| {
        // The rows precede the friction curve, so its part comes from other columns.
        let curve = model.stribeck[joint];
        let columns = [Parameter::FC, Parameter::FV].map(|parameter| model.drive(joint, parameter));
        let surplus = curve.excess * columns[0].map_or(0.0, |base| values[base]);
        let made = combination(curve.velocity);
        let bank = made.bank.map(|weight| weight * surplus);
        let mut values = *values;
        for (column, weight) in columns.into_iter().zip(made.friction) {
            if let Some(base) = column {
                values[base] += weight * surplus;
            }
        }
        let (mut squared, mut absolute, mut used) = (0.0, 0.0, 0_usize);
        for row in rows.iter().filter(|row| f64::from(row.still[joint]) <= LARGEST_STILL_SHARE) {
            let known = row.regressor[joint].iter().zip(&values);
            let curve = row.stribeck[joint].iter().zip(&bank);
            let predicted: f32 = known.chain(curve).map(|(element, value)| element * value).sum();
            let error = f64::from(predicted - row.torque[joint]);
            squared += error * error;
            absolute += f64::from(row.torque[joint].abs());
            used += 1;
        }
        let count = used.max(1) as f64;
        TruthFit {
            percent_of_mean_abs: 100.0 * sqrt(squared / count) / (absolute / count),
            sticking_share: 1.0 - used as f64 / rows.len().max(1) as f64,
        }
    })
}

/// Verdict with its evidence. A drive that `stopped` before is refused for its input.
fn judged<const N: usize, const B: usize>(
    pair: &Pair<N, B>,
    stopped: Option<String>,
) -> (Verdict, Vec<FindingReport>) {
    if let Some(words) = stopped {
        return (Verdict::refused(Reason::Input), vec![FindingReport::stopped(words)]);
    }
    let mut findings = Vec::new();
    let verdict = pair
        .leg
        .identification()
        .judge_with(&mut |evidence| findings.push(FindingReport::new(evidence, &VALIDATION_NAMES)));
    (verdict, findings)
}

/// Observer of a run, including data that the firmware does not have.
pub struct Watch<'a, const N: usize, const B: usize> {
    context: &'a Context<N, B>,
    chain: TruthChain<N, B>,
    torque_sum: [f64; N],
    sticking_sum: [f64; N],
    segment: Option<Segment>,
    training_rows: Vec<FilteredRows<f32, N, B>>,
    validation_rows: [Vec<FilteredRows<f32, N, B>>; VALIDATION_NAMES.len()],
    log: Vec<LoggedSample<N>>,
    information: Information<N>,
    costs: Option<Costs<B>>,
    excess: Vec<(u32, f64)>,
    /// Results of a known mass and a known load, after their evaluation.
    pub(crate) scale: Option<Scale<N, B>>,
}

impl<'a, const N: usize, const B: usize> Watch<'a, N, B> {
    /// Creates an empty observer.
    pub fn new(context: &'a Context<N, B>) -> Self {
        Self {
            context,
            chain: TruthChain::new(),
            torque_sum: [0.0; N],
            sticking_sum: [0.0; N],
            segment: None,
            training_rows: Vec::new(),
            validation_rows: Default::default(),
            log: Vec::new(),
            information: Information::new(
                context.background.model.base.rank(),
                context.background.stribeck_truth,
            ),
            costs: None,
            excess: Vec::new(),
            scale: None,
        }
    }

    /// Rows of a predicted motion with the noise-free torque; the last motion's are available once
    /// it is reported.
    pub fn noise_free(&self, motion: usize) -> &[FilteredRows<f32, N, B>] {
        self.validation_rows.get(motion).map_or(&[], Vec::as_slice)
    }

    /// Logged samples of a motion.
    pub fn logged(&self, segment: Segment) -> impl Iterator<Item = &LoggedSample<N>> {
        self.log.iter().filter(move |logged| logged.segment == Some(segment))
    }

    /// Observes the tick just run; `torque` and `sticking` are from before it.
    pub(crate) fn see(
        &mut self,
        pair: &Pair<N, B>,
        torque: &[f64; N],
        sticking: &[bool; N],
        logged: Option<&LoggedSample<N>>,
    ) {
        for joint in 0..N {
            self.torque_sum[joint] += torque[joint] / 8.0;
            self.sticking_sum[joint] += f64::from(u8::from(sticking[joint])) / 8.0;
        }
        self.watch_search(pair);
        let Some(logged) = logged else { return };
        if logged.segment != self.segment {
            let rows = self.chain.start();
            self.keep(rows);
            self.segment = logged.segment;
        }
        if logged.segment.is_some() {
            let anatomy = self.context.anatomy();
            let torque = core::array::from_fn(|joint| anatomy[joint].to_chain(self.torque_sum[joint]) as f32);
            let sticking = self.sticking_sum.map(|share| share as f32);
            self.chain.push(self.context, &logged.sample.position_rad, &torque, &sticking);
        }
        if logged.segment.is_some() {
            self.log.push(*logged);
        }
        if logged.segment == Some(Segment::Training) {
            self.inform(pair);
        }
        (self.torque_sum, self.sticking_sum) = ([0.0; N], [0.0; N]);
    }

    /// Adds the information of this sample's noise-free motion about the base parameters.
    fn inform(&mut self, pair: &Pair<N, B>) {
        let truth = pair.world.truth();
        let anatomy = self.context.anatomy();
        let to_chain = |of: &[f64; N]| core::array::from_fn(|joint| anatomy[joint].to_chain(of[joint]));
        let state = Smoothed {
            position: core::array::from_fn(|joint| anatomy[joint].angle_to_chain(truth.position[joint])),
            velocity: to_chain(&truth.velocity),
            acceleration: to_chain(&truth.acceleration),
            torque: [0.0; N],
        };
        let rows = self.context.background.model.rows(&state);
        for joint in 0..N {
            if !truth.sticking[joint] {
                let (regressor, velocity) = (&rows.regressor[joint], state.velocity[joint]);
                self.information.insert(joint, regressor, velocity, self.context.noise[joint]);
            }
        }
    }

    fn keep(&mut self, rows: Vec<FilteredRows<f32, N, B>>) {
        match self.segment {
            Some(Segment::Training) => self.training_rows = rows,
            Some(Segment::Validation(motion)) => {
                if let Some(slot) = self.validation_rows.get_mut(usize::from(motion)) {
                    *slot = rows;
                }
            }
            Some(Segment::Tracking) | None => {}
        }
    }

    fn watch_search(&mut self, pair: &Pair<N, B>) {
        // Before the columns are selected, costs belong to another problem.
        let solver = pair.leg.identification().solver().filter(|solver| solver.is_selected());
        let Some(solver) = solver else { return };
        let iterations = solver.search().iterations();
        if self.excess.last().is_some_and(|(seen, _)| *seen == iterations) {
            return;
        }
        let costs = self.costs.get_or_insert_with(|| self.context.background.costs(solver));
        let excess = costs.factor.excess(&solver.search().values().map(f64::from)) - costs.above;
        self.excess.push((iterations, excess));
    }

    /// Curves of the run, with noise-free torque and commands from the simulation. `values` are those of
    /// the leg with its load; torque is corrected if a known mass determined the constants.
    fn series(
        &self,
        model: &RowModel<f32, N, B>,
        solver: &Solver<f32, N, B>,
        scale: Option<&Scale<N, B>>,
        values: &[f32; B],
    ) -> Result<Series, ToolError> {
        let ratios = scale.and_then(Scale::trusted).map_or([1.0; N], |found| found.map(|ratio| ratio.ratio));
        let anatomy = self.context.anatomy();
        let bandwidth_hz = self.context.configuration.bandwidth_hz;
        let mut reader = Reader::<N, B, TAPS, PENDING>::new(model, anatomy, *values, bandwidth_hz)
            .map_err(|error| ToolError::input(format!("the filter does not fit the device: {error:?}")))?;
        let unused = (0..VALIDATION_NAMES.len()).map(|index| {
            (VALIDATION_NAMES[index], Segment::Validation(index as u8), &self.validation_rows[index])
        });
        let motions = core::iter::once(("excitation", Segment::Training, &self.training_rows)).chain(unused);
        let motions = motions.map(|(name, segment, truth)| {
            let (role, commanded) = match segment {
                Segment::Training => (Role::Training, Some(&self.context.motions.excitation)),
                Segment::Validation(index) => {
                    (Role::Validation, self.context.motions.validation.get(usize::from(index)))
                }
                Segment::Tracking => (Role::Validation, None),
            };
            let samples = self.log.iter().filter(|logged| logged.segment == Some(segment));
            let samples = samples.map(|logged| {
                let torque = core::array::from_fn(|joint| logged.sample.torque_nm[joint] / ratios[joint]);
                (logged.sample.position_rad, torque)
            });
            let mut motion = reader.motion(name, role, 0.0, samples);
            let points = motion.time_s.len();
            for (joint, curves) in motion.joints.iter_mut().enumerate() {
                let rows = truth.iter().take(points);
                let noise_free = rows.map(|row| anatomy[joint].from_chain(f64::from(row.torque[joint])));
                curves.noise_free_nm = noise_free.collect();
                let angle = |time_s: &f64| {
                    let tick = (time_s / TICK_S + MIDDLE_OF_A_SAMPLE_TICKS).round() as u32;
                    let angle = commanded?.state_at(tick).position_rad[joint];
                    Some(anatomy[joint].angle_from_chain(f64::from(angle)).to_degrees())
                };
                curves.commanded_deg = motion.time_s.iter().filter_map(angle).collect();
            }
            motion
        });
        let motions = motions.collect();
        Ok(Series {
            excess: self.excess.clone(),
            floor_chi2: self.costs.as_ref().map(|costs| costs.above),
            ..reader.series(solver, motions)
        })
    }

    /// Empty solver for the report of a run in which nothing was recorded.
    fn nothing_found(&self, options: &SimulationOptions) -> Result<Solver<f32, N, B>, ToolError> {
        let configuration = &self.context.configuration;
        let mut recorder = Box::new(
            Recorder::<f32, N, B, TAPS, PENDING>::new(configuration.bandwidth_hz)
                .map_err(|_| ToolError::input("the filter does not fit the device"))?,
        );
        let prior = configuration.prior.as_ref();
        Ok(Solver::new(&configuration.model, recorder.finish(), options.plan, prior, options.swarm_seed))
    }

    /// The motion identified from, and the predicted ones; `values` are those of the leg with its load.
    fn motions(
        &self,
        model: &RowModel<f32, N, B>,
        training: &Record<f32, N, B>,
        unused: &scale::Unused<N, B>,
        values: &[f32; B],
    ) -> (RecordedMotion<N, B>, Vec<RecordedMotion<N, B>>) {
        let motion = |name: &str, record: &Record<f32, N, B>, rows: &[FilteredRows<f32, N, B>]| {
            let truth = Some(truth_fit(rows, model, values));
            RecordedMotion { name: name.into(), record: record.clone(), truth }
        };
        let predicted = VALIDATION_NAMES.iter().zip(unused).zip(&self.validation_rows);
        let predicted =
            predicted.filter_map(|((name, record), rows)| Some(motion(name, record.as_ref()?, rows)));
        (motion("fourier", training, &self.training_rows), predicted.collect())
    }

    /// Report after the verdict, curves and logged samples. If the drive `stopped` before, the result is
    /// rejected as input.
    pub fn report(
        mut self,
        pair: &Pair<N, B>,
        options: &SimulationOptions,
        tracking: Vec<TrackingReport>,
        stopped: Option<String>,
        started: Instant,
    ) -> Result<(RunReport, Series, Vec<LoggedSample<N>>), ToolError> {
        let rows = self.chain.start();
        self.keep(rows);
        let identification = pair.leg.identification();
        let nothing = self.nothing_found(options)?;
        let solver = identification.solver().unwrap_or(&nothing);
        let (verdict, mut findings) = judged(pair, stopped);
        let scale = self.scale.take();
        let corrected = scale.as_ref().and_then(|scale| {
            scale::corrected(scale, self.context, solver, identification.validation(), &self.log)
        });
        let (found, verdict, unused) = match &corrected {
            Some(run) => {
                findings.clone_from(&run.findings);
                (&*run.solver, run.verdict, &run.unused)
            }
            None => (solver, verdict, identification.validation()),
        };
        let model = identification.model();
        // The plant's torque includes the load of the leg.
        let carrying = loaded(scale.as_ref(), &found.estimate().values);
        let (training, validation) = self.motions(model, found.record(), unused, &carrying);
        let (cramer_rao, surplus_cramer_rao) =
            self.information.without(&found.record().selection.dropped).bounds();
        let is_noisy = self.context.noise.iter().all(|&noise| noise > 0.0);
        let circumstances = Circumstances {
            seed: Some(options.seed),
            cramer_rao: is_noisy.then_some(cramer_rao),
            surplus_cramer_rao: surplus_cramer_rao.map(|bound| bound.filter(|_| is_noisy)).to_vec(),
            estimator: options.estimator,
            iterations_to_half_chi2: match &corrected {
                Some(run) => run.iterations_to_half_chi2,
                None => self.excess.iter().find(|(_, excess)| *excess <= 0.5).map(|(seen, _)| *seen),
            },
            findings,
            tracking,
            drive: Some(options.drive.name()),
            simulated_s: pair.ticks as f64 * TICK_S,
            wall: started.elapsed(),
        };
        let series = if options.with_series {
            self.series(model, found, scale.as_ref(), &carrying)?
        } else {
            Series::default()
        };
        let mut report =
            self.context.background.report(found, verdict, &[training], &validation, &circumstances);
        let constants =
            self.context.configuration.joints.map(|joint| f64::from(joint.scale.torque_per_ampere.0));
        report.scale = scale.map_or_else(ScaleReport::default, |scale| ScaleReport::new(&scale, &constants));
        Ok((report, series, self.log))
    }
}
