//! Model terms of each joint: requested, used, and why.
//!
//! The firmware decides (`scarab::ident::solve::selection`, `scarab::ident::record::stribeck`). This module
//! converts leg files to its choices, and its decisions to words.
//!
//! | `offset` | `asymmetric_coulomb` | constant column |
//! | --- | --- | --- |
//! | on, auto | off, auto | the offset, always or by the data; includes any difference of the directions |
//! | off, auto | on | the difference of the directions, always |
//! | off | auto | the difference of the directions, by the data |
//! | off | off | absent |
//! | on | on | rejected: both are one column |

use scarab::ident::record::stribeck;
use scarab::ident::solve::selection;
use scarab::ident::{Choice, Constant, Estimate, Selection};
use scarab::model::{Parameter, Standing};
use scarab_base::names::asymmetry_name;
use scarab_base::number::Number;
use scarab_base::precision::plain;

use crate::formats::leg_file::Switch;
use crate::leg::background::Background;
use crate::leg::model_choice::TermSwitches;
use crate::report::model_choice::{DirectionsReport, ModelChoiceReport};

/// Reason of a joint whose encoder forbids the search for Stribeck friction.
const TOO_COARSE: &str = "not searched: the encoder is too coarse at this bandwidth";

/// Decision with its reason.
struct Decision {
    used: bool,
    gain: Option<f64>,
    limit: Option<f64>,
    why: String,
}

fn decided(used: bool, why: &str) -> Decision {
    Decision { used, gain: None, limit: None, why: why.into() }
}

impl<const N: usize, const B: usize> Background<N, B> {
    /// Name of a parameter in this leg's reports: `FCA1` if the constant column is a difference of
    /// the directions.
    pub fn name(&self, joint: usize, parameter: Parameter) -> String {
        if parameter == Parameter::OFF && self.meaning(joint) == Constant::Asymmetry {
            return asymmetry_name(joint);
        }
        scarab_base::names::parameter_name(joint, parameter)
    }

    fn meaning(&self, joint: usize) -> Constant {
        self.device.drive_choice.get(joint).map_or(Constant::Offset, |choice| choice.meaning)
    }

    /// All terms of all joints. `stribeck` states for each joint whether its Stribeck friction is used, and
    /// the root mean square of its torque. An unreported gain is NaN.
    pub fn model_choice(
        &self,
        found: &Selection<f32, N, B>,
        stribeck: &[(bool, f32); N],
    ) -> Vec<ModelChoiceReport> {
        let of = |(joint, requested): (usize, &TermSwitches)| {
            let report = |option, requested: Switch, decision: Decision| ModelChoiceReport {
                joint: joint + 1,
                option,
                asked: requested.name(),
                used: if decision.used { "on" } else { "off" },
                gain_chi2: decision.gain.into(),
                limit_chi2: decision.limit.into(),
                why: decision.why,
            };
            [
                report("rotor", requested.rotor, self.column(found, joint, Parameter::IA, requested.rotor)),
                report("offset", requested.offset, self.offset(found, joint, requested)),
                report(
                    "stribeck",
                    requested.stribeck,
                    self.stribeck_decision(found, stribeck[joint], joint, requested.stribeck),
                ),
                report("asymmetric_coulomb", requested.asymmetric, self.asymmetry(found, joint, requested)),
            ]
        };
        self.requested.iter().enumerate().flat_map(of).collect()
    }

    fn column(
        &self,
        found: &Selection<f32, N, B>,
        joint: usize,
        parameter: Parameter,
        requested: Switch,
    ) -> Decision {
        match requested {
            Switch::Off => return decided(false, "disabled by the leg file"),
            Switch::On => return decided(true, "requested by the leg file"),
            Switch::Within(within) => {
                return decided(true, &format!("known to be zero within {within} N m by the leg file"));
            }
            Switch::Auto => {}
        }
        let base = match self.model.base.standing(joint, parameter) {
            Standing::Alone(base) => base,
            Standing::Grouped(base) => {
                let sum = self.base_name(base);
                return decided(true, &format!("measured in the sum {sum} only: no column to drop"));
            }
            Standing::Unseen | Standing::Off => return decided(false, "has no effect on torque"),
        };
        if !found.is_made {
            return decided(true, "the identification ended before it was decided");
        }
        let (used, gain, limit) =
            (!found.dropped[base], f64::from(found.gain[base]), selection::SMALLEST_GAIN);
        let why = if gain.is_nan() {
            if used { "determined by the data" } else { "not determined by the data: held at zero" }.into()
        } else if used {
            format!("explains {} chi-square units, limit {limit}", plain(gain.into()))
        } else if gain > 0.0 {
            format!("explains {} chi-square units, limit {limit}: held at zero", plain(gain.into()))
        } else {
            "not distinguishable from the others by this motion: held at zero".into()
        };
        Decision { used, gain: Some(gain), limit: Some(limit), why }
    }

    fn offset(&self, found: &Selection<f32, N, B>, joint: usize, requested: &TermSwitches) -> Decision {
        if self.meaning(joint) == Constant::Asymmetry {
            return decided(
                false,
                match requested.offset {
                    Switch::Off => "disabled by the leg file",
                    Switch::Auto if self.device.stribeck_choice(joint) == Choice::Off => TOO_COARSE,
                    _ => "not distinguishable from the requested asymmetric Coulomb friction",
                },
            );
        }
        self.column(found, joint, Parameter::OFF, requested.offset)
    }

    fn asymmetry(&self, found: &Selection<f32, N, B>, joint: usize, requested: &TermSwitches) -> Decision {
        match (requested.asymmetric, self.meaning(joint)) {
            (Switch::Off, _) => decided(false, "disabled by the leg file"),
            (_, Constant::Offset) => decided(false, "not distinguishable from the offset, which includes it"),
            (asymmetric, Constant::Asymmetry) => self.column(found, joint, Parameter::OFF, asymmetric),
        }
    }

    fn stribeck_decision(
        &self,
        found: &Selection<f32, N, B>,
        (used, size): (bool, f32),
        joint: usize,
        requested: Switch,
    ) -> Decision {
        let Some((gain, surplus)) = found.stribeck[joint] else {
            return decided(
                used,
                match requested {
                    Switch::Off => "disabled by the leg file",
                    _ if self.device.stribeck_choice(joint) == Choice::Off => TOO_COARSE,
                    _ => "not searched: plain least squares, or nothing was recorded",
                },
            );
        };
        let (gain, surplus) = (f64::from(gain), f64::from(surplus));
        if requested == Switch::On {
            let why = if used {
                "requested by the leg file"
            } else {
                "requested by the leg file, but the best curve explains nothing"
            };
            return Decision { gain: Some(gain), ..decided(used, why) };
        }
        let limit = stribeck::SMALLEST_GAIN;
        if gain.is_nan() {
            return decided(used, "not shown by the data");
        }
        let share = 100.0 * surplus / f64::from(size);
        let why = format!(
            "explains {} chi-square units, limit {limit}; {} % of the torque's rms, limit {} %",
            plain(gain.into()),
            plain(share.into()),
            100.0 * stribeck::SMALLEST_SURPLUS_SHARE
        );
        Decision { used, gain: Some(gain), limit: Some(limit), why }
    }

    /// Coulomb friction of both directions, for joints in which they differ according to the data.
    pub(crate) fn directions(
        &self,
        dropped: &[bool; B],
        estimate: &Estimate<f32, B>,
    ) -> Vec<DirectionsReport> {
        let of = |joint: usize| {
            if self.meaning(joint) != Constant::Asymmetry {
                return None;
            }
            let [level, half] =
                [Parameter::FC, Parameter::OFF].map(|parameter| self.device.drive(joint, parameter));
            let (level, half) = (level?, half.filter(|&base| !dropped[base])?);
            let direction = |sign: f32| {
                let mut weights = [0.0; B];
                (weights[level], weights[half]) = (1.0, sign);
                let value = estimate.values[level] + sign * estimate.values[half];
                (Number::from(value), Number::from(estimate.sigma_of(&weights)))
            };
            let (forward, backward) = (direction(1.0), direction(-1.0));
            Some(DirectionsReport {
                joint: joint + 1,
                forward_nm: forward.0,
                forward_sigma_nm: forward.1,
                backward_nm: backward.0,
                backward_sigma_nm: backward.1,
            })
        };
        (0..N).filter_map(of).collect()
    }
}
