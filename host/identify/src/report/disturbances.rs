//! Reports of excluded data and of Stribeck friction.

use serde::{Deserialize, Serialize};

use scarab_base::number::Number;
use scarab_base::precision::{plain, sigma, value};
use scarab_base::words::{Word, word};

/// Data excluded from the motion identified from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OutliersReport {
    /// `robust` or `plain`.
    #[serde(deserialize_with = "word")]
    pub estimator: Word,
    /// 500 Hz samples accepted.
    pub samples: u32,
    /// Isolated outliers among angles and torques of each joint, replaced before the filter.
    pub replaced: Vec<u32>,
    /// Share of each joint's rows with less than half of their weight, 0..1.
    pub disturbed_share: Vec<Number>,
    /// Longest stretch of such rows of each joint, s.
    pub longest_s: Vec<Number>,
    /// Longest stretch in which all joints' rows were disturbed at once, s.
    pub longest_common_s: Number,
}

impl OutliersReport {
    /// One line; `None` for plain least squares.
    pub fn line(&self) -> Option<String> {
        if self.estimator == "plain" {
            return Some("estimator: plain least squares, nothing excluded".into());
        }
        let joints: Vec<String> = self
            .replaced
            .iter()
            .zip(&self.disturbed_share)
            .zip(&self.longest_s)
            .enumerate()
            .map(|(joint, ((replaced, share), longest))| {
                format!(
                    "joint {}: {replaced} outliers replaced, {:.1} % of the rows disturbed, longest {:.2} s",
                    joint + 1,
                    100.0 * share.known().unwrap_or(f64::NAN),
                    longest.known().unwrap_or(f64::NAN),
                )
            })
            .collect();
        Some(format!("excluded of {} samples: {}", self.samples, joints.join("; ")))
    }
}

/// Stribeck friction of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StribeckReport {
    /// Joint, from 1.
    pub joint: usize,
    /// Static friction above Coulomb friction, N m.
    pub surplus_nm: Number,
    /// Standard deviation of the surplus.
    pub surplus_sigma_nm: Number,
    /// Speed at which the surplus has fallen to 1/e, rad/s.
    pub speed_rad_s: Number,
    /// Standard deviation of the speed.
    pub speed_sigma_rad_s: Number,
    /// Chi-square explained by the Stribeck term.
    pub gain_chi2: Number,
}

impl StribeckReport {
    /// One line of text.
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
