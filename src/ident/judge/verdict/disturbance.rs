//! Tests for a disturbed motion: in all joints for too long, or too often.
//!
//! Rows that robust identification excluded ([`Outliers`]) do not corrupt the result. But data with many
//! exclusions are not trusted, and a leg that stood on the floor was not an open chain.

use super::{Evidence, Reason, Test, Thresholds, VerdictBuilder};
use crate::ident::record::motion_record::Outliers;
use crate::real::{self, Real};

impl<T: Real> Thresholds<T> {
    /// Judges the parameters from the weighted rows on all rows of the motion; used only without held-out
    /// motions. It is right to exclude a push. But a machine that was pushed for most of its motion leaves a
    /// few undisturbed rows, and a model that fits nothing else.
    pub(crate) fn judge_whole<const N: usize>(
        &self,
        outliers: &Outliers<T, N>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        for (joint, &share) in outliers.whole_error_share.iter().enumerate() {
            builder.at_most(
                Reason::Residual,
                Test::WholeError,
                Some(joint),
                None,
                share,
                self.largest_whole_error_share,
            );
        }
    }

    /// Judges contact with the floor: a single long stretch with large errors in all joints. If more than
    /// half of the rows have large errors, the model is wrong, not the leg held; other tests cover that.
    pub(crate) fn judge_disturbance<const N: usize>(
        &self,
        outliers: &Outliers<T, N>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let mostly = outliers.disturbed_share.iter().any(|&share| share > T::from_double(0.5));
        builder.note(Evidence {
            reason: Reason::Contact,
            test: Test::CommonDisturbance,
            joint: None,
            motion: None,
            value: outliers.longest_common_s,
            limit: self.longest_disturbance_s,
            passed: outliers.longest_common_s <= self.longest_disturbance_s || mostly,
        });
        self.judge_excluded(outliers, None, builder);
    }

    /// Judges the shares of replaced samples and disturbed rows, on the motion
    /// identified from or a held-out one.
    pub(crate) fn judge_excluded<const N: usize>(
        &self,
        outliers: &Outliers<T, N>,
        motion: Option<usize>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let samples = real::max(T::from_double(f64::from(outliers.samples)), T::one());
        for joint in 0..N {
            let replaced = T::from_double(f64::from(outliers.replaced[joint])) / samples;
            let limit = self.largest_replaced_share;
            builder.at_most(Reason::Outliers, Test::ReplacedShare, Some(joint), motion, replaced, limit);
            let (share, limit) = (outliers.disturbed_share[joint], self.largest_disturbed_share);
            builder.at_most(Reason::Outliers, Test::DisturbedShare, Some(joint), motion, share, limit);
        }
    }
}
