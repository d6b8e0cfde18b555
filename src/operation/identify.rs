//! Thread level: the identification, fed by the servo's events.
//!
//! **Gaps.** A missing sample, detected by its tick, would distort every row that contains it. So the
//! identification is cancelled, and control gets a refused verdict because of its input.

use core::borrow::BorrowMut;

use super::queues::{EVENTS, IdentificationEnds, LegEvent};
use super::signals::Signals;
use crate::leg::{
    Activity, Finding, Identification, IdentifiedModel, IdentifyPhase, LoggedSample, MotionWindow, Reason,
    Segment, Verdict, Wearing,
};
use crate::servo::TICKS_PER_LOG;
use crate::trace::{Record, judged, words};

/// State between two slices.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentificationLevel {
    activity: Activity,
    /// Tick and segment of the newest sample.
    last: Option<(u32, Segment)>,
    /// A sample was lost in this identification.
    gap: bool,
    /// Seed of the current search.
    seed: u64,
    /// Whether the leg of the current identification is empty or worn, if known.
    wearing: Option<Wearing>,
    /// Verdict that control has not taken yet.
    verdict: Option<Verdict>,
    /// Control has taken the result.
    taken: bool,
    /// Changed results to be published; the verdict is `None` where an identification begins.
    publish: Option<Option<Verdict>>,
}

/// Result of one slice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slice<const N: usize> {
    /// No work left.
    Idle,
    /// The search continues.
    Busy,
    /// Control took a result; contains the model if it was accepted.
    Judged(Option<IdentifiedModel<N>>),
}

impl IdentificationLevel {
    /// State before the first event; `seed` is used unless a host gives another.
    pub const fn new(seed: u64) -> Self {
        Self {
            activity: Activity::Idle,
            last: None,
            gap: false,
            seed,
            wearing: None,
            verdict: None,
            taken: false,
            publish: None,
        }
    }

    /// Takes the servo's events and returns whether there were any. `sample` is called for each logged
    /// sample, `record` for each record.
    #[inline(never)]
    pub fn receive<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>(
        &mut self,
        identification: &mut Identification<N, B, TAPS, PENDING, W>,
        ends: &mut IdentificationEnds<'_, N>,
        mut record: impl FnMut(&Record<N>),
        mut sample: impl FnMut(&LoggedSample<N>),
    ) -> bool
    where
        W: BorrowMut<MotionWindow<f32, N, B>>,
    {
        let mut received = false;
        // At most one queue's worth per call, so that new events do not starve the search.
        for _ in 0..EVENTS {
            let Some(event) = ends.events.dequeue() else { break };
            received = true;
            match event {
                LegEvent::Sample(logged) => {
                    sample(&logged);
                    self.take(&logged, identification);
                }
                LegEvent::Begun(prepared, wearing) => {
                    self.wearing = wearing;
                    identification.cancel();
                    if let Some((plan, seed)) = prepared {
                        identification.prepare(plan, seed);
                        self.seed = seed;
                    }
                    (self.gap, self.verdict, self.publish) = (false, None, Some(None));
                }
                LegEvent::Activity(activity) => {
                    self.activity = activity;
                    if !matches!(activity, Activity::Identify(_)) {
                        identification.cancel();
                        self.verdict = None;
                    }
                }
                LegEvent::TookUpdate => identification.take_update(),
                LegEvent::TookResult => {
                    self.taken = true;
                    // The next slice reads the result before a newer event can change it.
                    break;
                }
                LegEvent::Record(one) => record(&one),
            }
        }
        received
    }

    fn take<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>(
        &mut self,
        logged: &LoggedSample<N>,
        identification: &mut Identification<N, B, TAPS, PENDING, W>,
    ) where
        W: BorrowMut<MotionWindow<f32, N, B>>,
    {
        let tick = logged.sample.tick;
        if let (Some((before, segment)), Some(now)) = (self.last, logged.segment)
            && segment == now
            && tick.wrapping_sub(before) != TICKS_PER_LOG
        {
            self.gap = true;
        }
        self.last = logged.segment.map(|segment| (tick, segment));
        if !self.gap {
            identification.push(logged);
        }
    }

    /// Runs one slice of the search with at most `evaluations`.
    #[inline(never)]
    pub fn work<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>(
        &mut self,
        identification: &mut Identification<N, B, TAPS, PENDING, W>,
        evaluations: u32,
        ends: &mut IdentificationEnds<'_, N>,
        signals: &Signals<N>,
        mut record: impl FnMut(&Record<N>),
    ) -> Slice<N>
    where
        W: BorrowMut<MotionWindow<f32, N, B>>,
    {
        use IdentifyPhase::{Judge, Settle, Solve};
        // A finding that does not fit would leave control waiting for it.
        if !ends.findings.ready() {
            return Slice::Idle;
        }
        if core::mem::take(&mut self.taken)
            && let Some(verdict) = self.verdict.take()
        {
            self.publish = Some(Some(verdict));
            // A verdict on lost samples comes from this level: the identification was cancelled without one.
            let model = if verdict.is_accepted() { identification.took_result() } else { None };
            return Slice::Judged(model);
        }
        if self.gap {
            if let Activity::Identify(Settle | Solve | Judge) = self.activity {
                self.gap = false;
                identification.cancel();
                let verdict = Verdict::refused(Reason::Input);
                record(&Record::Refused {
                    why: "samples_lost",
                    value: signals.statistics.samples_lost.get(),
                });
                // There is space: checked above.
                let _ = ends.findings.enqueue(Finding::Judged { verdict, model: None });
                self.verdict = Some(verdict);
            }
            return Slice::Idle;
        }
        let Some(finding) = identification.advance(evaluations) else {
            let Some(solver) = identification.solver() else { return Slice::Idle };
            let search = solver.search();
            let [iterations, done] = &signals.statistics.search;
            iterations.set(search.iterations());
            done.set(search.evaluations());
            return if identification.is_searching() { Slice::Busy } else { Slice::Idle };
        };
        match &finding {
            Finding::Solved => {}
            Finding::Judged { verdict, .. } => self.verdict = Some(*verdict),
            Finding::Changed(change) => record(&Record::Change {
                since_s: change.since_s,
                joints: change.joints,
                statistic: change.statistic,
                limit: change.limit,
            }),
            Finding::Updated { cause, verdict, model } => {
                let (cause, link) = words::cause(*cause);
                let verdict = judged(verdict.is_accepted());
                record(&Record::Update { cause, link, verdict, offered: model.is_some() });
            }
        }
        // There is space: checked above. Control takes one finding per tick.
        let _ = ends.findings.enqueue(finding);
        Slice::Busy
    }

    /// Changed results to be published; see [`Self::published`].
    pub const fn unpublished(&self) -> Option<Option<Verdict>> {
        self.publish
    }

    /// Marks the results as published.
    pub const fn published(&mut self) {
        self.publish = None;
    }

    /// Activity of the leg after the newest event.
    pub const fn activity(&self) -> Activity {
        self.activity
    }

    /// Tick of the newest sample.
    pub fn tick(&self) -> u32 {
        self.last.map_or(0, |(tick, _)| tick)
    }

    /// Whether the leg of the current identification is empty or worn, if known.
    pub const fn wearing(&self) -> Option<Wearing> {
        self.wearing
    }

    /// Seed of the current search.
    pub const fn seed(&self) -> u64 {
        self.seed
    }
}

#[cfg(test)]
mod tests;
