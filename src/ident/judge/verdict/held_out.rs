//! Tests of the held-out residual: its course in time and the geometry errors it shows.

use super::{Evidence, Reason, Test, Thresholds, Unused, VerdictBuilder};
use crate::ident::judge::alignment::{Direction, Misalignment};
use crate::ident::record::motion_record::Record;
use crate::ident::solve::estimate::Estimate;
use crate::real::{self, Real};

impl<T: Real> Thresholds<T> {
    /// Judges the slow part of a held-out residual: it must be noise, or small. With much noise this is the
    /// sharper test: the part that neighbouring half seconds share contains no noise.
    pub(crate) fn judge_colour<const N: usize, const B: usize>(
        &self,
        training: &Record<T, N, B>,
        motion: usize,
        unused: &Unused<'_, T, N, B>,
        estimate: &Estimate<T, B>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        for (joint, residual) in unused.residual.joints.iter().enumerate() {
            let noise = unused.record.noise[joint];
            let forgiven = self.forgives_disturbances;
            let accepted = self.accepted_error_share * unused.record.torque[joint].root_mean_square;
            let uncertain = unused.record.uncertainty(joint, estimate);
            let drawn = self.drawn(training, joint, &estimate.values, uncertain);
            let systematic = real::sqrt(accepted * accepted + drawn * drawn);
            let limit = real::max(systematic, residual.slow_by_chance(self.noise_quantile, noise, forgiven));
            let at = (Some(joint), Some(motion));
            builder.at_most(
                Reason::Validation,
                Test::SlowResidual,
                at.0,
                at.1,
                residual.slow(forgiven),
                limit,
            );
        }
    }

    /// Judges contact: one long stretch of errors in all joints, in a motion that
    /// is otherwise predicted well.
    pub(crate) fn judge_contact<const N: usize, const B: usize>(
        &self,
        motion: usize,
        unused: &Unused<'_, T, N, B>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let residual = unused.residual;
        let (outliers, rows) = residual
            .joints
            .iter()
            .fold((0_u32, 0_u32), |(outliers, rows), joint| (outliers + joint.outliers, rows + joint.rows));
        // A wrong model has errors everywhere: that is not contact.
        let elsewhere =
            T::from_double(f64::from(rows)) * T::from_double(0.5) < T::from_double(f64::from(outliers));
        let value = residual.longest_common_s;
        let limit = self.longest_disturbance_s;
        builder.note(Evidence {
            reason: Reason::Contact,
            test: Test::CommonDisturbance,
            joint: None,
            motion: Some(motion),
            value,
            limit,
            passed: value <= limit || elsewhere,
        });
    }

    /// Judges the errors of lengths and zeros that the held-out motions show. They fail if they are
    /// significant and larger than the tolerance with which lengths and zeros are known. The worse of the two
    /// estimates counts, alone or together with the other directions.
    ///
    pub(crate) fn judge_alignment(&self, found: &Misalignment<T>, builder: &mut VerdictBuilder<'_, T>) {
        let (test, tolerance) = match found.direction {
            Direction::Length => (Test::LinkLength, self.largest_length_error),
            Direction::Zero => (Test::EncoderZero, self.largest_zero_error),
        };
        let limit = |sigma: T| real::max(tolerance, self.noise_quantile * sigma);
        let (mut value, mut allowed) = (found.delta, limit(found.sigma));
        if let Some((delta, sigma)) = found.beside
            && real::abs(delta) * allowed > real::abs(value) * limit(sigma)
        {
            (value, allowed) = (delta, limit(sigma));
        }
        builder.note(Evidence {
            reason: Reason::Residual,
            test,
            joint: Some(found.joint),
            motion: None,
            value,
            limit: allowed,
            passed: real::abs(value) <= allowed,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value, limit and pass for a link's length, from its estimates alone and together with the other
    /// directions.
    fn judged(alone: [f64; 2], beside: Option<[f64; 2]>) -> (f64, f64, bool) {
        let thresholds =
            Thresholds { noise_quantile: 5.0, largest_length_error: 0.03, ..Thresholds::default() };
        let [delta, sigma] = alone;
        let found = Misalignment {
            direction: Direction::Length,
            joint: 1,
            delta,
            sigma,
            beside: beside.map(|[delta, sigma]| (delta, sigma)),
        };
        let mut seen = None;
        let mut note = |evidence: &Evidence<f64>| seen = Some(*evidence);
        thresholds.judge_alignment(&found, &mut VerdictBuilder::new(&mut note));
        let evidence = seen.expect("one piece of evidence");
        assert_eq!((evidence.test, evidence.joint), (Test::LinkLength, Some(1)));
        (evidence.value, evidence.limit, evidence.passed)
    }

    #[test]
    fn of_a_length_alone_and_beside_the_others_the_one_that_says_more_is_judged() {
        // As shares of the limit: 0.5 alone, 2 beside; 0.8 alone, 0.5 beside; in a
        // tie the value alone is judged.
        assert_eq!(judged([0.015, 0.001], Some([-0.06, 0.002])), (-0.06, 0.03, false));
        assert_eq!(judged([0.024, 0.001], Some([0.05, 0.02])), (0.024, 0.03, true));
        assert_eq!(judged([0.015, 0.0], Some([-0.015, 0.0])), (0.015, 0.03, true));
        assert_eq!(judged([0.04, 0.001], None), (0.04, 0.03, false));
    }

    #[test]
    fn noise_widens_the_limit_of_a_length() {
        // Five sigmas of 0.01.
        assert_eq!(judged([0.04, 0.01], None), (0.04, 0.05, true));
    }
}
