//! Units of the columns as the cause of a refusal: the options that read them so; currents read as torques.
//!
//! ```text
//! r_i = sum g tau / sum g^2        recorded torque over the prior's torque g, over the rows of joint i
//! current, constant k_i stated     r_i k_i is near 1 for every joint, and r_i is not
//! current, constant unknown        r_i is far below 1 for every joint, in the shape of the prior's torque
//! ```
//!
//! Without a prior nothing shows the scale of the torques, so nothing is suspected.

use crate::base::number::Number;
use crate::formats::recording::import::Import;
use crate::formats::recording::signal::{Quantity, Signal, Unit};
use crate::formats::recording::suggest::{Reading, options, readings};
use crate::report::doubt::CauseReport;
use crate::run::logging_errors::Question;
use crate::run::logging_errors::rows::Equations;

/// Ratio to the prior's torque that an error of the prior explains.
const PRIOR_ERROR: f64 = 1.6;
/// Factor by which a stated constant must bring the ratio nearer to 1.
const NEARER: f64 = 2.0;
/// Largest ratio of a current to a torque whose constant is unknown.
const CURRENT_RATIO: f64 = 0.2;
/// Least correlation of recorded torque and the prior's.
const ALIKE: f64 = 0.8;

/// Options that read the columns as the cause states, where it is a unit.
pub(super) fn remedy(import: Option<&Import>, name: &str, joint: Option<usize>) -> Option<String> {
    let import = import?;
    let mut changed = readings(import);
    let is_meant = |signal: Signal| joint.is_none_or(|joint| signal.joint() == Some(joint));
    let unit = Unit::named(match name {
        "angle_unit" => "deg",
        "torque_unit" => "mNm",
        _ => return None,
    })?;
    let meant = changed.iter_mut().filter(|reading| {
        reading.signal.quantity() == unit.quantity && is_meant(reading.signal) && reading.unit.factor() == 1.0
    });
    let count = meant.map(|reading| reading.unit = unit).count();
    (count > 0).then(|| format!("; read it so by {}", options(&changed)))
}

/// Currents that were read as torques, by the scale of the prior.
pub(super) fn current<const N: usize, const B: usize>(
    question: &Question<N, B>,
    equations: &Equations<N, B>,
    import: Option<&Import>,
) -> Option<CauseReport> {
    let import = import?;
    let is_torque = |joint: usize| !import.columns.contains_key(&Signal::Current(joint + 1));
    let scales = scales(equations, &question.prior?);
    let is_alike = scales.iter().all(|scale| scale.ratio > 0.0 && scale.likeness >= ALIKE);
    if !is_alike || !(0..N).all(is_torque) {
        return None;
    }
    let ratios: Vec<String> = scales.iter().map(|scale| format!("{:.3}", scale.ratio)).collect();
    let ratios = format!("torque is {} of the prior's (joints in order)", ratios.join(", "));
    let stated: Option<Vec<f64>> =
        import.drives.iter().map(|drive| drive.torque_per_ampere.map(f64::abs)).collect();
    let words = match stated {
        Some(constants) => {
            let explains = scales.iter().zip(&constants).all(|(scale, constant)| {
                let [before, after] = [scale.ratio, scale.ratio * constant].map(|ratio| ratio.ln().abs());
                after < PRIOR_ERROR.ln() && before > after + NEARER.ln()
            });
            if !explains {
                return None;
            }
            format!("{ratios}, and `torque_per_ampere` of the leg file explains it: is it a current?")
        }
        None if scales.iter().all(|scale| scale.ratio < CURRENT_RATIO) => {
            let constants: Vec<String> =
                scales.iter().map(|scale| format!("{:.2}", 1.0 / scale.ratio)).collect();
            format!(
                "{ratios}, in its shape: is it a current? Then state each joint's `torque_per_ampere` (by the prior about {})",
                constants.join(", ")
            )
        }
        None => return None,
    };
    let changed: Vec<Reading> = readings(import)
        .into_iter()
        .map(|reading| match reading.signal {
            Signal::Torque(joint) => {
                Reading { signal: Signal::Current(joint), unit: Quantity::Current.si(), ..reading }
            }
            _ => reading,
        })
        .collect();
    Some(CauseReport {
        name: "torque_current",
        joint: None,
        value: scales.first().map_or(Number::UNKNOWN, |scale| scale.ratio.into()),
        sigma: Number::UNKNOWN,
        words: format!("{words}; read it so by {}", options(&changed)),
    })
}

/// Scale of a joint's recorded torque.
struct Scale {
    /// Recorded torque over the prior's.
    ratio: f64,
    /// Cosine between both, -1..1.
    likeness: f64,
}

fn scales<const N: usize, const B: usize>(equations: &Equations<N, B>, prior: &[f64; B]) -> [Scale; N] {
    core::array::from_fn(|joint| {
        let (mut along, mut measured, mut expected) = (0.0, 0.0, 0.0);
        for ((place, torque), row) in equations.places.iter().zip(&equations.torque).zip(&equations.columns) {
            if place.joint == joint {
                let guess: f64 = row.iter().zip(prior).map(|(element, value)| element * value).sum();
                along += guess * torque;
                measured += torque * torque;
                expected += guess * guess;
            }
        }
        let product: f64 = measured * expected;
        Scale { ratio: along / expected.max(1e-300), likeness: along / product.sqrt().max(1e-300) }
    })
}
