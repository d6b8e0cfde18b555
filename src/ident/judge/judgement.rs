//! Judgement of a solver's result: every test that applies, in order.

use super::alignment::Misalignments;
use super::verdict::{Evidence, Reason, Test, Thresholds, Unused, Verdict, VerdictBuilder};
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::estimate::Problem;
use crate::ident::solve::solver::Solver;
use crate::real::Real;

impl<T: Real, const N: usize, const B: usize> Solver<T, N, B> {
    /// Judges the result with held-out motions and the geometry errors they show: accepted, or refused with
    /// all reasons that apply. Every piece of evidence goes to `hand_on`.
    pub fn judge<'a>(
        &self,
        model: &RowModel<T, N, B>,
        thresholds: &Thresholds<T>,
        unused: impl Iterator<Item = Unused<'a, T, N, B>>,
        misalignments: &Misalignments<T>,
        hand_on: &mut dyn FnMut(&Evidence<T>),
    ) -> Verdict {
        let builder = &mut VerdictBuilder::new(hand_on);
        let (record, least_squares) = (self.record(), self.least_squares());
        let problem = Problem::new(record, model);
        thresholds.judge_input(model, record, builder);
        thresholds.judge_excitation(&problem.whole(), least_squares.rank(), builder);
        let excess = self.search_excess().unwrap_or(T::LARGEST);
        builder.at_most(Reason::Input, Test::Search, None, None, excess, thresholds.search_excess);
        let found = self.found();
        let estimate = self.estimate();
        if !builder.verdict().has(Reason::Unexcited) {
            // Parameters that the motion did not excite cannot be judged.
            thresholds.judge_physics(model, record, least_squares, builder);
            thresholds.judge_physics(model, record, &estimate, builder);
            if let Some(consistency) = self.consistency() {
                thresholds.judge_consistency(&consistency, builder);
            }
        }
        thresholds.judge_disturbance(&record.outliers, builder);
        // The values before the completion: a computed torque has no inertia or friction in them.
        thresholds.judge_measurement(model, record, &self.search().values(), builder);
        thresholds.judge_residual(record, &found, builder);
        let mut predicted = false;
        for (motion, unused) in unused.enumerate() {
            predicted = true;
            thresholds.judge_excluded(&unused.record.outliers, Some(motion), builder);
            thresholds.judge_validation(record, motion, unused.record, &estimate, builder);
            thresholds.judge_colour(record, motion, &unused, &estimate, builder);
            thresholds.judge_contact(motion, &unused, builder);
        }
        if !predicted {
            thresholds.judge_whole(&record.outliers, builder);
        }
        if !builder.verdict().has(Reason::Validation) {
            // Pushes and a wrong mass ask for changes that are not geometry errors.
            for found in misalignments.iter().flatten() {
                thresholds.judge_alignment(found, builder);
            }
        }
        builder.verdict()
    }
}

#[cfg(test)]
mod tests;
