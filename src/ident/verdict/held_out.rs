//! What the residual of unused motions looks like in time, and what it asks for.

use super::{Docket, Evidence, Reason, Test, Thresholds, Unused};
use crate::ident::alignment::{Direction, Misalignment};
use crate::real::{self, Real};

impl<T: Real> Thresholds<T> {
    /// Whether what is left of an unused motion is noise, or small. Where noise is large this is the sharper test: a rest
    /// that neighbouring half seconds share has no noise in it.
    pub fn judge_colour<const N: usize, const B: usize>(
        &self,
        motion: usize,
        unused: &Unused<'_, T, N, B>,
        docket: &mut Docket<'_, T>,
    ) {
        for (joint, residual) in unused.residual.joints.iter().enumerate() {
            let noise = Some(unused.record.noise[joint]).filter(|&noise| noise > T::zero());
            let share = if noise.is_some() { self.harmless_error_share } else { self.largest_error_share };
            let harmless = share * unused.record.torque[joint].root_mean_square;
            let limit = real::max(harmless, residual.slow_by_chance(self.noise_quantile, noise));
            let at = (Some(joint), Some(motion));
            docket.at_most(
                Reason::Validation,
                Test::SlowResidual,
                at.0,
                at.1,
                residual.slow(noise.is_some()),
                limit,
            );
        }
    }

    /// Whether all joints missed together, once and for long, on a motion that is predicted well otherwise.
    pub fn judge_contact<const N: usize, const B: usize>(
        &self,
        motion: usize,
        unused: &Unused<'_, T, N, B>,
        docket: &mut Docket<'_, T>,
    ) {
        let residual = unused.residual;
        let (wild, rows) = residual
            .joints
            .iter()
            .fold((0_u32, 0_u32), |(wild, rows), joint| (wild + joint.wild, rows + joint.rows));
        // A wrong model misses everywhere: that is no contact.
        let elsewhere = T::of(f64::from(rows)) * T::of(0.5) < T::of(f64::from(wild));
        let value = residual.longest_common_s;
        let limit = self.longest_disturbance_s;
        docket.note(Evidence {
            reason: Reason::Contact,
            test: Test::CommonDisturbance,
            joint: None,
            motion: Some(motion),
            value,
            limit,
            passed: value <= limit || elsewhere,
        });
    }

    /// Whether the unused motions ask for other lengths or zeros than the model has, significantly and by more than
    /// lengths and zeros are known; alone or beside each other, whichever says more.
    ///
    /// Where the noise is not known, sigma comes from the model's own errors, which are not white: three times the
    /// tolerance is allowed then.
    pub fn judge_alignment(&self, found: &Misalignment<T>, noise_is_known: bool, docket: &mut Docket<'_, T>) {
        let (test, tolerance) = match found.direction {
            Direction::Length => (Test::LinkLength, self.largest_length_error),
            Direction::Zero => (Test::EncoderZero, self.largest_zero_error),
        };
        let tolerance = if noise_is_known { tolerance } else { T::of(3.0) * tolerance };
        let limit = |sigma: T| real::max(tolerance, self.noise_quantile * sigma);
        let (mut value, mut allowed) = (found.delta, limit(found.sigma));
        if let Some((delta, sigma)) = found.beside
            && real::abs(delta) * allowed > real::abs(value) * limit(sigma)
        {
            (value, allowed) = (delta, limit(sigma));
        }
        docket.note(Evidence {
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
