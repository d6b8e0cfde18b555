//! Model terms of each joint: requested, used, and why.

use serde::{Deserialize, Serialize};

use crate::report::additional_torque::AdditionalKind;
use scarab_base::number::Number;
use scarab_base::precision::{sigma, value};
use scarab_base::words::{Word, word};

/// Decision about one term of one joint's model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelChoiceReport {
    /// Joint, from 1.
    pub joint: usize,
    /// `rotor`, `offset`, `stribeck`, `asymmetric_coulomb`, `spring` or `load_friction`, as in leg files.
    #[serde(deserialize_with = "word")]
    pub option: Word,
    /// `auto`, `on`, `off` or `within`, known within a tolerance.
    #[serde(deserialize_with = "word")]
    pub asked: Word,
    /// `on` or `off`.
    #[serde(deserialize_with = "word")]
    pub used: Word,
    /// Chi-square explained by the term; unknown if the data did not decide.
    pub gain_chi2: Number,
    /// Limit below which the term is dropped.
    pub limit_chi2: Number,
    /// Reason in words.
    pub why: String,
}

impl ModelChoiceReport {
    /// Whether it is a spring or friction by load.
    fn is_addition(&self) -> bool {
        AdditionalKind::ALL.map(AdditionalKind::name).contains(&self.option)
    }

    /// Whether it is a spring or friction by load that the leg file demands.
    pub(crate) fn is_demanded_addition(&self) -> bool {
        self.asked == "on" && self.is_addition()
    }
}

/// Coulomb friction of one joint in both directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectionsReport {
    /// Joint, from 1.
    pub joint: usize,
    /// Friction while the D-H angle grows, N m.
    pub forward_nm: Number,
    /// Standard deviation of `forward_nm`.
    pub forward_sigma_nm: Number,
    /// Friction while the D-H angle falls, N m; not negative for friction.
    pub backward_nm: Number,
    /// Standard deviation of `backward_nm`.
    pub backward_sigma_nm: Number,
}

/// One line for each decision that was left to the data, and each spring or friction by load.
pub fn lines(choices: &[ModelChoiceReport], directions: &[DirectionsReport]) -> Vec<String> {
    let open = choices.iter().filter(|choice| choice.asked == "auto" || choice.is_addition());
    let open = open.map(|choice| {
        format!(
            "model, joint {}: {} {} ({}): {}",
            choice.joint, choice.option, choice.used, choice.asked, choice.why
        )
    });
    let directions = directions.iter().map(|found| {
        format!(
            "Coulomb friction of joint {}: {} +- {} N m while the D-H angle grows, {} +- {} N m while it falls",
            found.joint,
            value(found.forward_nm, found.forward_sigma_nm),
            sigma(found.forward_sigma_nm),
            value(found.backward_nm, found.backward_sigma_nm),
            sigma(found.backward_sigma_nm)
        )
    });
    open.chain(directions).collect()
}
