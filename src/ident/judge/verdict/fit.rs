//! Tests of the fit: on the motion identified from and on held-out motions.
//!
//! ```text
//! u^2        = tr(R Cov R') / n                       the parameters' uncertainty, on a held-out motion
//! u0         = u * least(1, sqrt(v S) / training error)
//! error^2   <= v S q(n m S) + (3 u0)^2 + (accepted share * rms torque)^2
//! error     <= ratio * training error + margin * rms torque + 3 u0
//! ```
//!
//! v is the variance of a 500 Hz sample's noise, from its own scatter (`noise`), zero if unknown. S is the
//! sum of h^2; n rows are worth m S independent ones each. q is the quantile of chi-square over its degrees
//! of freedom. The first limit does not use the training's residual, so a bad training widens nothing. The
//! second applies where noise does not explain that residual.

use super::{Evidence, Reason, Test, Thresholds, VerdictBuilder};
use crate::ident::judge::residual::Residual;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::estimate::Estimate;
use crate::model::Parameter;
use crate::real::{self, Real};

/// A held-out motion.
#[derive(Clone, Copy, Debug)]
pub struct Unused<'a, T, const N: usize, const B: usize> {
    /// Record of the motion.
    pub record: &'a Record<T, N, B>,
    /// Residual in order of time.
    pub residual: &'a Residual<T, N>,
}

impl<T: Real> Thresholds<T> {
    /// Judges the fit to the motion identified from.
    pub(crate) fn judge_residual<const N: usize, const B: usize>(
        &self,
        training: &Record<T, N, B>,
        values: &[T; B],
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        for (joint, size) in training.torque.iter().enumerate() {
            let Some(error) = training.torque_error(joint, values) else { continue }; // the joint never moved: unexcited
            let systematic = (self.accepted_error_share + self.error_margin_share) * size.root_mean_square;
            let limit = self.allowed(training, joint, systematic);
            builder.at_most(Reason::Residual, Test::TrainingError, Some(joint), None, error, limit);
        }
    }

    /// Largest error of a joint's filtered torque by noise and a systematic error.
    fn allowed<const N: usize, const B: usize>(
        &self,
        record: &Record<T, N, B>,
        joint: usize,
        systematic: T,
    ) -> T {
        let freedom =
            T::from_double(f64::from(record.rows[joint])) * real::min(record.row_information, T::one());
        let noise = record.filtered_noise(joint).unwrap_or(T::zero());
        real::sqrt(noise * noise * self.variance_ratio(freedom) + systematic * systematic)
    }

    /// Error of a held-out torque that the noise of the motion identified from permits. `uncertain` follows
    /// from the scatter of its residual, which a wrong model enlarges; that part is taken out.
    pub(crate) fn drawn<const N: usize, const B: usize>(
        &self,
        training: &Record<T, N, B>,
        joint: usize,
        values: &[T; B],
        uncertain: T,
    ) -> T {
        let (noise, error) = (training.filtered_noise(joint), training.torque_error(joint, values));
        let share = match (noise.unwrap_or(T::zero()), error) {
            (noise, Some(error)) if error > noise => noise / error,
            _ => T::one(),
        };
        self.uncertainty_sigmas * share * uncertain
    }

    /// Judges the prediction of a held-out motion: no worse than noise and parameter covariance predict.
    pub(crate) fn judge_validation<const N: usize, const B: usize>(
        &self,
        training: &Record<T, N, B>,
        motion: usize,
        record: &Record<T, N, B>,
        estimate: &Estimate<T, B>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let (values, at) = (&estimate.values, Some(motion));
        builder.at_most(
            Reason::Input,
            Test::NotFinite,
            None,
            at,
            T::from_double(f64::from(record.rejected)),
            T::zero(),
        );
        for joint in 0..N {
            if training.rows[joint] == 0 {
                continue; // unexcited
            }
            let size = record.torque[joint].root_mean_square;
            let uncertain = record.uncertainty(joint, estimate);
            let share = if size > T::zero() { uncertain / size } else { T::zero() };
            let limit = self.largest_uncertainty_share;
            builder.at_most(Reason::Unexcited, Test::PredictedUncertainty, Some(joint), at, share, limit);
            let error = record.torque_error(joint, values).unwrap_or(T::LARGEST);
            let drawn = self.drawn(training, joint, values, uncertain);
            let accepted = self.accepted_error_share * size;
            let limit = self.allowed(record, joint, real::sqrt(drawn * drawn + accepted * accepted));
            let trained = training.torque_error(joint, values).unwrap_or(T::zero());
            let limit =
                real::min(limit, self.largest_error_ratio * trained + self.error_margin_share * size + drawn);
            builder.at_most(Reason::Validation, Test::ValidationError, Some(joint), at, error, limit);
        }
    }

    /// Judges whether the torque shows inertia and friction, which the angle alone cannot give. A torque
    /// without them is a recorded command, or the joint carries no moving load.
    pub(crate) fn judge_measurement<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        training: &Record<T, N, B>,
        values: &[T; B],
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let mut dynamic = *values;
        for (base, value) in dynamic.iter_mut().enumerate() {
            if let Some((_, Parameter::HX | Parameter::HY | Parameter::HZ | Parameter::M | Parameter::OFF)) =
                model.base.independent(base)
            {
                *value = T::zero();
            }
        }
        for (joint, size) in training.torque.iter().enumerate() {
            let rows = T::from_double(f64::from(training.rows[joint].max(1)));
            let part = real::sqrt(training.factors[joint].without_right().excess(&dynamic) / rows);
            let value =
                if size.root_mean_square > T::zero() { part / size.root_mean_square } else { T::zero() };
            let limit = self.smallest_dynamic_share;
            // A joint at rest already failed a test with the right reason.
            let moved = size.speed >= self.smallest_speed && training.rows[joint] > 0;
            builder.note(Evidence {
                reason: Reason::NotAMeasurement,
                test: Test::DynamicShare,
                joint: Some(joint),
                motion: None,
                value,
                limit,
                passed: !moved || value >= limit,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ident::record::factor::Factor;
    use crate::ident::record::motion_record::TorqueSize;
    use crate::ident::record::rows::DECIMATION;

    #[test]
    fn a_prediction_is_uncertain_by_its_share_of_the_torque() {
        let mut factor = Factor::<f64, 2>::new();
        factor.insert(&[3.0, 0.0], 0.0);
        let torque = [TorqueSize { mean_absolute: 3.0, root_mean_square: 4.0, speed: 1.0 }];
        let record = Record::<f64, 1, 2>::plain([factor], torque, 1);
        let mut estimate = Estimate::<f64, 2>::nothing();
        (estimate.covariance[0][0], estimate.determined) = (0.25, [true; 2]);
        let mut shares = [0.0; 1];
        let mut note = |evidence: &Evidence<f64>| {
            if evidence.test == Test::PredictedUncertainty {
                shares = [evidence.value];
            }
        };
        let mut builder = VerdictBuilder::new(&mut note);
        Thresholds::default().judge_validation(&record, 0, &record, &estimate, &mut builder);
        // Sigma 0.5 in a column of 3: 1.5 of 4 N m.
        assert_eq!(shares, [0.375]);
    }

    #[test]
    fn the_error_allowed_is_that_of_noise_and_the_accepted_share_together() {
        let torque = [TorqueSize { mean_absolute: 5.0, root_mean_square: 6.0, speed: 1.0 }];
        let record = |row_information| Record::<f64, 1, 2> {
            row_information,
            ..Record::plain([Factor::new()], torque, 400)
        };
        // 400 rows worth 0.25 independent ones each: 100 degrees of freedom;
        // chi-square's 0.999 quantile is 149.449.
        let thresholds = Thresholds { noise_quantile: 3.090_2, ..Thresholds::<f64>::default() };
        let allowed = |information, share| {
            let known =
                Record { noise: [0.2 * real::sqrt(DECIMATION as f64 / information)], ..record(information) };
            thresholds.allowed(&known, 0, share * 6.0)
        };
        let noise = 0.04 * 1.494_49;
        // Wilson and Hilferty's approximation is good to 0.6 % of the square.
        assert!((allowed(0.25, 0.0) / real::sqrt(noise) - 1.0).abs() < 4e-3);
        // A share of 2 % of 6 N m.
        let both = real::sqrt(noise + 0.12 * 0.12);
        assert!((allowed(0.25, 0.02) / both - 1.0).abs() < 4e-3);
        // A row has at most the information of one independent row.
        assert_eq!(allowed(3.0, 0.0).to_bits(), allowed(1.0, 0.0).to_bits());
    }
}
