//! Reports of excluded data and of Stribeck friction from the firmware's records.

use scarab::ident::{Record, StribeckFit};
use scarab_base::number::Number;

use crate::report::disturbances::{OutliersReport, StribeckReport};

impl OutliersReport {
    /// Report of a training motion's record.
    pub(crate) fn from_record<const N: usize, const B: usize>(
        record: &Record<f32, N, B>,
        estimator: &'static str,
    ) -> Self {
        let outliers = &record.outliers;
        Self {
            estimator,
            samples: outliers.samples,
            replaced: outliers.replaced.to_vec(),
            disturbed_share: outliers.disturbed_share.map(Number::from).to_vec(),
            longest_s: outliers.longest_s.map(Number::from).to_vec(),
            longest_common_s: outliers.longest_common_s.into(),
        }
    }
}

impl StribeckReport {
    /// Report of an identified Stribeck curve with these base parameters.
    pub fn new<const B: usize>(joint: usize, fit: &StribeckFit<f32, B>, values: &[f32; B]) -> Self {
        Self {
            joint: joint + 1,
            surplus_nm: fit.surplus(values).into(),
            surplus_sigma_nm: fit.sigma.into(),
            speed_rad_s: fit.speed.into(),
            speed_sigma_rad_s: fit.speed_sigma.into(),
            gain_chi2: fit.gain.into(),
        }
    }
}
