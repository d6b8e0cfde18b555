//! Report of an identification's result as a sequence of records.
//!
//! The caller takes one record at a time, so it can wait until the listener has caught up. Nothing is copied
//! but the tests of the verdict, eight at a time. The order is fixed: solver, parameters, base parameters,
//! covariance, Stribeck friction, motions with their fits, findings, reasons, verdict, end.
//!
//! Cost: one judgement for every eight findings, a copy of the covariance for each record.
//! Limits: if the identification restarts meanwhile, the report must be dropped.

use core::borrow::BorrowMut;

use super::{Record, words};
use crate::leg::{
    Estimate, Evidence, Identification, MotionWindow, Parameter, Plan, SearchState, VALIDATION_MOTIONS,
};

const PARAMETERS: usize = Parameter::ALL.len();
/// Findings stored at a time.
const CHUNK: usize = 8;

/// Section of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Solver,
    Parameters,
    Base,
    Covariance,
    Stribeck,
    Motions,
    Findings,
    Reasons,
    Verdict,
    End,
    Sent,
}

/// A report in progress; see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    part: Part,
    index: usize,
    records: u32,
    findings: [Option<Evidence<f32>>; CHUNK],
}

impl Default for Report {
    fn default() -> Self {
        Self { part: Part::Solver, index: 0, records: 0, findings: [None; CHUNK] }
    }
}

impl Report {
    /// Next record; `None` at the end, or without a result.
    pub fn advance<
        const N: usize,
        const B: usize,
        const TAPS: usize,
        const PENDING: usize,
        W: BorrowMut<MotionWindow<f32, N, B>>,
    >(
        &mut self,
        identification: &Identification<N, B, TAPS, PENDING, W>,
    ) -> Option<Record<N>> {
        let estimate = identification.estimate()?;
        let source = Source { identification, estimate: &estimate };
        while self.part != Part::Sent {
            if let Some(record) = source.record(self) {
                self.index += 1;
                if let Some(record) = record {
                    self.records += 1;
                    return Some(record);
                }
            } else {
                self.index = 0;
                self.part = match self.part {
                    Part::Solver => Part::Parameters,
                    Part::Parameters => Part::Base,
                    Part::Base => Part::Covariance,
                    Part::Covariance => Part::Stribeck,
                    Part::Stribeck => Part::Motions,
                    Part::Motions => Part::Findings,
                    Part::Findings => Part::Reasons,
                    Part::Reasons => Part::Verdict,
                    Part::Verdict => Part::End,
                    Part::End | Part::Sent => Part::Sent,
                };
            }
        }
        None
    }
}

/// Identification to report, and the estimate that its records share.
struct Source<'a, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W> {
    identification: &'a Identification<N, B, TAPS, PENDING, W>,
    estimate: &'a Estimate<f32, B>,
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>
    Source<'_, N, B, TAPS, PENDING, W>
where
    W: BorrowMut<MotionWindow<f32, N, B>>,
{
    /// Record at `index` of this section. `None` at the section's end; `Some(None)`
    /// for an index without a record.
    fn record(&self, report: &mut Report) -> Option<Option<Record<N>>> {
        let index = report.index;
        match report.part {
            Part::Solver => (index == 0).then(|| self.solver()),
            Part::Parameters => (index < N * PARAMETERS).then(|| self.parameter(index)),
            Part::Base => self.base(index).map(Some),
            Part::Covariance => (index < B * B).then(|| self.covariance(index)),
            Part::Stribeck => (index < N).then(|| self.stribeck(index)),
            Part::Motions => (index < (VALIDATION_MOTIONS + 1) * (N + 1)).then(|| self.motion(index)),
            Part::Findings => self.finding(report).map(Some),
            Part::Reasons => {
                let name = self.identification.verdict()?.reasons().nth(index)?.name();
                Some(Some(Record::Reason { reason: name }))
            }
            Part::Verdict => (index == 0).then(|| {
                let verdict = self.identification.verdict()?;
                let reasons = verdict.reasons().count() as u8;
                Some(Record::Verdict { verdict: judged(verdict.is_accepted()), reasons })
            }),
            Part::End => (index == 0).then_some(Some(Record::End { records: report.records })),
            Part::Sent => None,
        }
    }

    fn finding(&self, report: &mut Report) -> Option<Record<N>> {
        let index = report.index % CHUNK;
        if index == 0 {
            report.findings = [None; CHUNK];
            let (first, slots, mut seen) = (report.index, &mut report.findings, 0_usize);
            self.identification.judge_with(&mut |evidence| {
                if let Some(slot) = seen.checked_sub(first).and_then(|index| slots.get_mut(index)) {
                    *slot = Some(*evidence);
                }
                seen += 1;
            });
        }
        let evidence = (*report.findings.get(index)?)?;
        Some(Record::Finding {
            reason: evidence.reason.name(),
            test: evidence.test.name(),
            joint: from_one(evidence.joint),
            motion: from_one(evidence.motion),
            value: evidence.value,
            limit: evidence.limit,
            passed: evidence.passed,
        })
    }

    fn solver(&self) -> Option<Record<N>> {
        let solver = self.identification.solver()?;
        let search = solver.search();
        Some(Record::Solver {
            plan: match solver.plan() {
                Plan::OneTime => "one-time",
                Plan::Sequential => "sequential",
            },
            swarm_seed: search.seed(),
            state: match search.state() {
                SearchState::Running => "running",
                SearchState::Done => "done",
                SearchState::Failed(_) => "failed",
            },
            iterations: search.iterations(),
            evaluations: search.evaluations(),
            steps: solver.completion().steps(),
            rank: solver.least_squares().rank() as u8,
            base: self.identification.model().base.rank() as u8,
            dropped: solver.record().selection.dropped_count() as u8,
            condition: known(solver.condition()),
            consistency_chi2: known(solver.consistency().map(|consistency| consistency.excess)),
        })
    }

    fn parameter(&self, index: usize) -> Option<Record<N>> {
        let joint = index / PARAMETERS;
        let parameter = *Parameter::ALL.get(index % PARAMETERS)?;
        let found = self.identification.parameter(self.estimate, joint, parameter)?;
        Some(Record::Parameter {
            joint: from_one(Some(joint)),
            symbol: parameter.symbol(),
            value: known(found.value),
            unit: words::unit(parameter),
            sigma: known(found.sigma),
            status: found.status.name(),
        })
    }

    fn base(&self, index: usize) -> Option<Record<N>> {
        let found = self.identification.base_parameter(self.estimate, index)?;
        let (joint, parameter) = found.carrier;
        Some(Record::Base {
            index: index as u8,
            joint: from_one(Some(joint)),
            symbol: parameter.symbol(),
            grouped: found.grouped,
            dropped: found.dropped,
            value: known(found.value),
            unit: words::unit(parameter),
            sigma: known(found.sigma),
            least_squares: found.least_squares,
        })
    }

    fn covariance(&self, index: usize) -> Option<Record<N>> {
        let (row, column) = (index / B, index % B);
        let both = *self.estimate.determined.get(row)? && *self.estimate.determined.get(column)?;
        let value = *self.estimate.covariance.get(row)?.get(column)?;
        (both && column <= row).then_some(Record::Covariance { row: row as u8, column: column as u8, value })
    }

    fn stribeck(&self, joint: usize) -> Option<Record<N>> {
        let fit = self.identification.solver()?.record().stribeck.get(joint)?.as_ref()?;
        Some(Record::Stribeck {
            joint: from_one(Some(joint)),
            surplus_nm: fit.surplus(&self.estimate.values),
            surplus_sigma_nm: fit.sigma,
            speed_rad_s: fit.speed,
            speed_sigma_rad_s: fit.speed_sigma,
            gain_chi2: fit.gain,
        })
    }

    /// One record for each motion, then one for each of its joints.
    fn motion(&self, index: usize) -> Option<Record<N>> {
        let (motion, part) = (index / (N + 1), index % (N + 1));
        let Some(joint) = part.checked_sub(1) else {
            let record = self.identification.motion(motion)?;
            return Some(Record::Motion {
                motion: motion as u8,
                samples: record.outliers.samples,
                rejected: record.rejected,
                longest_common_s: record.outliers.longest_common_s,
                row_information: record.row_information,
            });
        };
        let fit = self.identification.fit(self.estimate, motion, joint)?;
        Some(Record::Fit {
            motion: motion as u8,
            joint: from_one(Some(joint)),
            rows: fit.rows,
            rms_nm: known(fit.rms_nm),
            mean_abs_nm: fit.mean_absolute_nm,
            torque_rms_nm: fit.torque_rms_nm,
            speed_rms_rad_s: fit.speed_rms,
            disturbed_share: fit.disturbed_share,
            disturbed_longest_s: fit.disturbed_longest_s,
            replaced: fit.replaced,
        })
    }
}

/// Word for a verdict.
pub(crate) const fn judged(accepted: bool) -> &'static str {
    if accepted { "accepted" } else { "refused" }
}

fn from_one(index: Option<usize>) -> u8 {
    index.map_or(0, |index| index.saturating_add(1) as u8)
}

fn known(value: Option<f32>) -> f32 {
    value.unwrap_or(f32::NAN)
}
