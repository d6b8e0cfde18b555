//! Identification half of a leg: records logged motions, solves in slices, judges.

use core::borrow::BorrowMut;
use core::mem::MaybeUninit;

use super::activity::{Segment, VALIDATION_MOTIONS};
use super::configuration::{LegConfiguration, LegError};
use super::control::LoggedSample;
use super::model::IdentifiedModel;
use super::model_monitor::ModelMonitor;
use crate::ident::{
    Baseline, Cause, Change, Ends, Evidence, Filters, HeldOut, LinkPrior, Misalignments, MotionWindow, Plan,
    Progress, Reason, Record, Recorder, Residual, RowModel, SearchState, Solver, Thresholds, Unused, Verdict,
    no_stribeck,
};
use crate::in_place::{Slot, each, empty_slot, fill, made};
use crate::model::friction::Stribeck;

/// Message from identification to control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finding<const N: usize> {
    /// The solver is done; the validation motions can start.
    Solved,
    /// Verdict, with the model if it was accepted.
    Judged {
        /// Accepted or not, and why.
        verdict: Verdict,
        /// The model, only with an accepting verdict.
        model: Option<IdentifiedModel<N>>,
    },
    /// The accepted model no longer fits the tracked motion.
    Changed(Change<f32, N>),
    /// Result of the search for the cause of a change.
    Updated {
        /// The cause.
        cause: Cause,
        /// Accepted or not, and why.
        verdict: Verdict,
        /// The updated model, offered with an accepted change. An earlier offer is void.
        model: Option<IdentifiedModel<N>>,
    },
}

/// State of the identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Work {
    /// Waiting for samples.
    Idle,
    /// Records samples of this segment.
    Recording(Segment),
    /// The solver works on the training record.
    Solving,
}

/// Recorder, solver and records of one identification. The window is part of the value, or (`W` a reference)
/// located elsewhere in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification<
    const N: usize,
    const B: usize,
    const TAPS: usize,
    const PENDING: usize,
    W = MotionWindow<f32, N, B>,
> {
    model: RowModel<f32, N, B>,
    prior: Option<[LinkPrior<f32>; N]>,
    plan: Plan,
    swarm_seed: u64,
    thresholds: Thresholds<f32>,
    recorder: Recorder<f32, N, B, TAPS, PENDING, W>,
    work: Work,
    solver: Slot<Solver<f32, N, B>>,
    validation: [Option<Record<f32, N, B>>; VALIDATION_MOTIONS],
    held_out: HeldOut<f32, N, B, PENDING>,
    residuals: [Residual<f32, N>; VALIDATION_MOTIONS],
    verdict: Option<Verdict>,
    report_due: bool,
    model_monitor: ModelMonitor<N, B>,
    /// Friction curves of the accepted model. Monitoring uses them even if a later identification was
    /// refused.
    accepted_stribeck: [Stribeck<f32>; N],
    change_due: bool,
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize>
    Identification<N, B, TAPS, PENDING>
{
    /// Creates an identification without records.
    ///
    /// # Errors
    /// [`LegError::Kernel`] if the filter does not fit.
    pub fn new(configuration: &LegConfiguration<N, B>) -> Result<Self, LegError> {
        Self::with_window(configuration, MotionWindow::new())
    }
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>
    Identification<N, B, TAPS, PENDING, W>
where
    W: BorrowMut<MotionWindow<f32, N, B>>,
{
    /// Creates an identification with the given empty window.
    ///
    /// # Errors
    /// See [`Identification::new`].
    pub(crate) fn with_window(configuration: &LegConfiguration<N, B>, window: W) -> Result<Self, LegError> {
        let filters = Filters::new(configuration.bandwidth_hz).map_err(LegError::Kernel)?;
        Ok(made(|slot| Self::new_in(slot, configuration, &filters, window)))
    }

    /// Creates an identification in place, because it is larger than the device's stack. The filters must
    /// fit.
    pub(crate) fn new_in<'a>(
        slot: &'a mut MaybeUninit<Self>,
        configuration: &LegConfiguration<N, B>,
        filters: &Filters<f32, N, B, TAPS, PENDING>,
        window: W,
    ) -> &'a mut Self {
        fill!(slot, {
            model: configuration.model.clone(),
            prior: configuration.prior,
            plan: configuration.plan,
            swarm_seed: configuration.swarm_seed,
            thresholds: configuration.thresholds,
            work: Work::Idle,
            held_out: HeldOut::new(filters.low_pass().reach()),
            residuals: [Residual::new(); VALIDATION_MOTIONS],
            verdict: None,
            report_due: false,
            model_monitor: ModelMonitor::new(filters.low_pass(), configuration.monitor),
            accepted_stribeck: no_stribeck(),
            change_due: false,
        }, {
            solver: empty_slot,
            validation: |records| each(records, || None),
            recorder: |recorder| Recorder::new_in(recorder, filters, configuration.estimator, window),
        })
    }

    /// Sets the plan and the random seed of the next search.
    pub fn prepare(&mut self, plan: Plan, swarm_seed: u64) {
        (self.plan, self.swarm_seed) = (plan, swarm_seed);
    }

    /// Returns the seed of the next search's random numbers.
    pub const fn swarm_seed(&self) -> u64 {
        self.swarm_seed
    }

    /// Processes a logged sample. A sample without segment, or of another one, ends the motion recorded so
    /// far.
    pub fn push(&mut self, logged: &LoggedSample<N>) {
        let recording = match self.work {
            Work::Recording(segment) => Some(segment),
            Work::Idle | Work::Solving => None,
        };
        if recording != logged.segment {
            if let Some(ended) = recording {
                self.close(ended);
            }
            if let Some(begun) = logged.segment {
                self.open(begun);
            }
        }
        if logged.segment.is_some() {
            let sample = &logged.sample;
            let progress = self.recorder.push(&self.model, &sample.position_rad, &sample.torque_nm);
            self.take_progress(logged.segment, progress);
        }
    }

    fn take_progress(&mut self, segment: Option<Segment>, progress: Option<Progress<f32, N, B>>) {
        match (segment, progress) {
            (Some(Segment::Validation(_)), Some(progress)) => self.held_out.take(&self.model, &progress),
            // At the first samples, or after one that was not finite, the windows restart.
            (Some(Segment::Validation(_)), None) => self.held_out.break_off(),
            (Some(Segment::Tracking), Some(Progress { rows: Some(rows), .. }))
                if self.model_monitor.watch(&rows).is_some() =>
            {
                self.recorder.clear(Ends::Whole);
                self.change_due = true;
            }
            _ => {}
        }
    }

    fn open(&mut self, segment: Segment) {
        self.recorder.clear(match segment {
            Segment::Training => Ends::Cut,
            Segment::Validation(_) | Segment::Tracking => Ends::Whole,
        });
        if segment == Segment::Tracking {
            self.model.stribeck = self.accepted_stribeck;
            self.model_monitor.begin();
            self.change_due = false;
        }
        self.work = Work::Recording(segment);
        if segment == Segment::Training {
            self.model.stribeck = no_stribeck();
            self.solver.clear();
            self.held_out.clear();
            self.validation.iter_mut().for_each(|record| *record = None);
            self.verdict = None;
        } else if let Some(solver) = self.solver.as_ref() {
            let dropped = &solver.record().selection.dropped;
            self.held_out.begin(&solver.values(), &solver.unexpected(), &solver.row_noise(), dropped);
        }
    }

    #[inline(never)]
    fn close(&mut self, segment: Segment) {
        if segment == Segment::Tracking {
            self.work = Work::Idle;
            return;
        }
        while let Some(progress) = self.recorder.flush(&self.model) {
            self.take_progress(Some(segment), progress);
        }
        self.held_out.break_off();
        let record = self.recorder.finish();
        match segment {
            Segment::Training => self.begin_solving(record),
            Segment::Validation(motion) => {
                let motion = usize::from(motion);
                if let (Some(slot), Some(residual)) =
                    (self.validation.get_mut(motion), self.residuals.get_mut(motion))
                {
                    *slot = Some(record);
                    *residual = *self.held_out.residual();
                }
                self.work = Work::Idle;
                self.report_due = self.validation.iter().all(Option::is_some);
            }
            Segment::Tracking => {}
        }
    }

    /// Separate from [`Self::close`], so that recorder and solver do not need the stack at the same time.
    #[inline(never)]
    fn begin_solving(&mut self, record: Record<f32, N, B>) {
        let (model, prior) = (&self.model, self.prior.as_ref());
        self.solver.fill(|slot| Solver::new_in(slot, model, record, self.plan, prior, self.swarm_seed));
        self.work = Work::Solving;
    }

    /// Spends up to `evaluations` on the search; returns a finding when there is one.
    pub fn advance(&mut self, evaluations: u32) -> Option<Finding<N>> {
        if self.report_due {
            self.report_due = false;
            return Some(self.judge());
        }
        if self.work == Work::Recording(Segment::Tracking) {
            return self.monitor_model();
        }
        if self.work != Work::Solving {
            return None;
        }
        let solver = self.solver.as_mut()?;
        match solver.advance(&self.model, evaluations) {
            SearchState::Running => None,
            SearchState::Done => {
                self.work = Work::Idle;
                self.model.stribeck = solver.stribeck(&self.model);
                Some(Finding::Solved)
            }
            SearchState::Failed(_) => {
                self.work = Work::Idle;
                Some(self.judge())
            }
        }
    }

    /// Returns the alarm, and later the result of the quick pass.
    fn monitor_model(&mut self) -> Option<Finding<N>> {
        if self.change_due {
            self.change_due = false;
            return self.model_monitor.change().map(|change| Finding::Changed(*change));
        }
        if !self.model_monitor.is_ready(&self.recorder.rows()) {
            return None;
        }
        let record = self.recorder.finish();
        self.recorder.clear(Ends::Whole);
        let update = self.model_monitor.solve(&self.model, &record, &self.thresholds)?;
        let model = update.is_change();
        Some(Finding::Updated {
            cause: update.cause,
            verdict: update.verdict,
            model: model.then(|| IdentifiedModel::from_estimate(&self.model, &update.estimate)),
        })
    }

    /// Discards the monitored model, because another one is in use.
    pub(crate) fn forget_model(&mut self) {
        self.model_monitor.forget();
    }

    /// Uses the offered update as the monitored model.
    pub(crate) fn take_update(&mut self) {
        self.model_monitor.take();
    }

    fn judge(&mut self) -> Finding<N> {
        let verdict = self.judge_with(&mut |_| {});
        self.verdict = Some(verdict);
        let estimate = self.solver.as_ref().map(Solver::estimate).filter(|_| verdict.is_accepted());
        let model = estimate.map(|estimate| IdentifiedModel::from_estimate(&self.model, &estimate));
        Finding::Judged { verdict, model }
    }

    /// Confirms that control took the result: tracked motions are compared with it from now on. Returns the
    /// model if it was accepted.
    ///
    /// This is separate from the verdict, because the operator may cancel the identification while it is
    /// judged. The model in use then remains the one that is monitored and stored.
    pub(crate) fn took_result(&mut self) -> Option<IdentifiedModel<N>> {
        let solver = self.solver.as_ref().filter(|_| self.verdict.is_some_and(Verdict::is_accepted))?;
        let estimate = solver.estimate();
        let model = IdentifiedModel::from_estimate(&self.model, &estimate);
        let others = self.validation.iter().flatten();
        self.model_monitor.accept(Baseline::new(estimate, solver.record(), others));
        self.accepted_stribeck = self.model.stribeck;
        Some(model)
    }

    /// Judges the records so far; every piece of evidence is passed to `hand_on`.
    #[inline(never)]
    pub fn judge_with(&self, hand_on: &mut dyn FnMut(&Evidence<f32>)) -> Verdict {
        self.solver.as_ref().map_or(Verdict::refused(Reason::Input), |solver| {
            let recorded = self.validation.iter().zip(&self.residuals);
            let unused = recorded
                .filter_map(|(record, residual)| record.as_ref().map(|record| Unused { record, residual }));
            solver.judge(&self.model, &self.thresholds, unused, &self.misalignments(), hand_on)
        })
    }

    /// Estimates errors of link lengths and joint zeros from the validation motions.
    pub(crate) fn misalignments(&self) -> Misalignments<f32> {
        self.held_out.alignment().misalignments()
    }

    /// Replaces the identified base values once the search is done, so that the following motions validate
    /// the given ones. This checks a stored model before it is used again.
    pub fn examine(&mut self, values: &[f32; B]) {
        if let Some(solver) = self.solver.as_mut().filter(|_| self.work != Work::Solving) {
            solver.examine(values);
        }
    }

    /// Cancels an identification, also before another one starts: a verdict that control no longer expects
    /// must not change the monitored model. Earlier results stay, and a tracked motion continues to be
    /// recorded.
    pub(crate) fn cancel(&mut self) {
        self.report_due = false;
        if self.work != Work::Recording(Segment::Tracking) {
            self.work = Work::Idle;
        }
    }

    /// Whether a search is running and was not cancelled.
    pub(crate) fn is_searching(&self) -> bool {
        self.work == Work::Solving
    }

    /// Returns the solver of the last training motion.
    pub fn solver(&self) -> Option<&Solver<f32, N, B>> {
        self.solver.as_ref()
    }

    /// Returns the records of the validation motions.
    pub fn validation(&self) -> &[Option<Record<f32, N, B>>; VALIDATION_MOTIONS] {
        &self.validation
    }

    /// Returns the last verdict.
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Returns the monitoring of the accepted model.
    pub fn model_monitor(&self) -> &ModelMonitor<N, B> {
        &self.model_monitor
    }

    /// Whether there is prior knowledge.
    pub(crate) fn has_prior(&self) -> bool {
        self.prior.is_some()
    }

    /// Returns the row model.
    pub fn model(&self) -> &RowModel<f32, N, B> {
        &self.model
    }
}
