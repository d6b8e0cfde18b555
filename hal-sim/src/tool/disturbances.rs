//! What was set aside of a motion and what was found of Stribeck friction, as reports say it.

use scarab::ident::{Record, StribeckFit};
use serde::Serialize;

use super::precision::{plain, sigma, value};
use super::report::Number;

/// What was set aside of the motion identified from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutliersReport {
    /// `robust` or `plain`.
    pub estimator: &'static str,
    /// 500 Hz samples taken in.
    pub samples: u32,
    /// Isolated wild angles and torques of each joint, replaced before the filter.
    pub replaced: Vec<u32>,
    /// Share of each joint's rows that counted for less than half, 0..1.
    pub disturbed_share: Vec<Number>,
    /// Longest stretch of such rows of each joint, s.
    pub longest_s: Vec<Number>,
    /// Longest stretch in which all joints' rows were disturbed at once, s.
    pub longest_common_s: Number,
}

impl OutliersReport {
    /// Of the record of a training motion.
    #[must_use]
    pub fn of<const N: usize, const B: usize>(record: &Record<f32, N, B>, estimator: &'static str) -> Self {
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

    /// One line; nothing to say of plain least squares.
    #[must_use]
    pub fn line(&self) -> Option<String> {
        if self.estimator == "plain" {
            return Some("estimator: plain least squares, nothing set aside".into());
        }
        let joints: Vec<String> = self
            .replaced
            .iter()
            .zip(&self.disturbed_share)
            .zip(&self.longest_s)
            .enumerate()
            .map(|(joint, ((replaced, share), longest))| {
                format!(
                    "joint {}: {replaced} wild samples replaced, {:.1} % of the rows disturbed, {:.2} s at a stretch",
                    joint + 1,
                    100.0 * share.known().unwrap_or(f64::NAN),
                    longest.known().unwrap_or(f64::NAN),
                )
            })
            .collect();
        Some(format!("set aside of {} samples: {}", self.samples, joints.join("; ")))
    }
}

/// Stribeck friction of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StribeckReport {
    /// Counted from 1.
    pub joint: usize,
    /// Static friction less Coulomb's, N m.
    pub surplus_nm: Number,
    /// Standard deviation.
    pub surplus_sigma_nm: Number,
    /// Speed at which it has fallen to 1/e, rad/s.
    pub speed_rad_s: Number,
    /// Standard deviation.
    pub speed_sigma_rad_s: Number,
    /// Chi-square that it explains.
    pub gain_chi2: Number,
}

impl StribeckReport {
    /// Of a joint whose Stribeck friction was found, with these base parameters.
    #[must_use]
    pub fn of<const B: usize>(joint: usize, fit: &StribeckFit<f32, B>, values: &[f32; B]) -> Self {
        Self {
            joint: joint + 1,
            surplus_nm: fit.surplus(values).into(),
            surplus_sigma_nm: fit.sigma.into(),
            speed_rad_s: fit.speed.into(),
            speed_sigma_rad_s: fit.speed_sigma.into(),
            gain_chi2: fit.gain.into(),
        }
    }

    /// One line.
    #[must_use]
    pub fn line(&self) -> String {
        format!(
            "Stribeck friction of joint {}: {} +- {} N m above Coulomb's at rest, fallen to 1/e at {} +- {} rad/s (explains {} \
             chi-square units)",
            self.joint,
            value(self.surplus_nm, self.surplus_sigma_nm),
            sigma(self.surplus_sigma_nm),
            value(self.speed_rad_s, self.speed_sigma_rad_s),
            sigma(self.speed_sigma_rad_s),
            plain(self.gain_chi2),
        )
    }
}
