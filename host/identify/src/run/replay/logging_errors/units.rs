//! Units of the columns as the cause of a refusal: the options that read them so; currents read as torques.
//!
//! ```text
//! r_i = sum g tau / sum g^2        recorded torque over the prior's torque g, over the rows of joint i
//! u                                1 for A, 1/1000 for mA
//! current, constant k_i stated     r_i k_i u is near 1 for every joint; for one, r_i and r_i / 1000 are not
//! current in A, k_i unknown        r_i is far below 1 for every joint, in the shape of the prior's torque
//! current in mA, k_i unknown       r_i is far above 1, r_i / 1000 below 1, and far below it for one joint
//! ```
//!
//! Without a prior nothing shows the scale of the torques, so nothing is suspected.

use scarab::real::dot;
use scarab_base::number::Number;

use crate::formats::recording::import::Import;
use crate::formats::recording::signal::{Quantity, Signal, Unit};
use crate::formats::recording::suggest::{Reading, options, readings};
use crate::report::doubt::{CauseReport, ReadAs};
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
pub(super) fn remedy(import: Option<&Import>, cause: &CauseReport) -> Option<String> {
    let mut changed = readings(import?);
    let counts = cause.reads.iter().map(|read| apply(&mut changed, *read, cause.joint)).collect::<Vec<_>>();
    let is_possible = !counts.is_empty() && counts.iter().all(|count| *count > 0);
    is_possible.then(|| format!("; read it so by {}", options(&changed)))
}

/// Reads the columns of a joint, or of all, in another unit. Returns how many columns change.
fn apply(readings: &mut [Reading], read: ReadAs, joint: Option<usize>) -> usize {
    let (unit, of_motor) = match read {
        ReadAs::Degrees => ("deg", false),
        ReadAs::Turns => ("turn", false),
        ReadAs::MotorRadians => ("rad", true),
        ReadAs::MotorDegrees => ("deg", true),
        ReadAs::MotorTurns => ("turn", true),
        ReadAs::MillinewtonMetres => ("mNm", false),
    };
    let Some(unit) = Unit::named(unit) else { return 0 };
    // The torques of a joint whose angle is wrong are those of all joints.
    let joint = if read == ReadAs::MillinewtonMetres { None } else { joint };
    let is_meant = |signal: Signal| {
        let is_of_joint = matches!(signal, Signal::Angle(_) | Signal::Torque(_));
        is_of_joint && joint.is_none_or(|joint| signal.joint() == Some(joint))
    };
    let meant = readings.iter_mut().filter(|reading| {
        reading.signal.quantity() == unit.quantity && is_meant(reading.signal) && reading.unit.factor() == 1.0
    });
    meant
        .map(|reading| {
            reading.unit = unit;
            if let (Signal::Angle(joint), true) = (reading.signal, of_motor) {
                reading.signal = Signal::MotorAngle(joint);
            }
        })
        .count()
}

/// Currents that were read as torques, by the scale of the prior. `angles` is how the equations read the
/// angles, where it is not as stated.
pub(super) fn current(
    question: &Question,
    equations: &Equations,
    import: Option<&Import>,
    angles: Option<ReadAs>,
) -> Option<CauseReport> {
    let import = import?;
    let is_torque = |joint: usize| !import.columns.contains_key(&Signal::Current(joint + 1));
    let scales = scales(equations, question.prior.as_ref()?);
    let is_alike = scales.iter().all(|scale| scale.ratio > 0.0 && scale.likeness >= ALIKE);
    if !is_alike || !(0..question.joints()).all(is_torque) {
        return None;
    }
    let ratios: Vec<String> = scales.iter().map(|scale| format!("{:.3}", scale.ratio)).collect();
    let ratios = format!("torque is {} of the prior's (joints in order)", ratios.join(", "));
    let stated: Option<Vec<f64>> =
        import.drives.iter().map(|drive| drive.torque_per_ampere.map(f64::abs)).collect();
    let (unit, words) = match stated {
        Some(constants) => (
            explained_unit(&scales, &constants)?,
            format!("{ratios}, and `torque_per_ampere` of the leg file explains it: is it a current?"),
        ),
        None => {
            let unit = fitting_unit(&scales)?;
            let constants = scales.iter().map(|scale| format!("{:.2}", 1.0 / (scale.ratio * unit.factor())));
            let words = format!(
                "{ratios}, in its shape: is it a current? Then state each joint's `torque_per_ampere` (by the prior about {})",
                constants.collect::<Vec<_>>().join(", ")
            );
            (unit, words)
        }
    };
    let mut changed: Vec<Reading> = readings(import)
        .into_iter()
        .map(|reading| match reading.signal {
            Signal::Torque(joint) => Reading { signal: Signal::Current(joint), unit, ..reading },
            _ => reading,
        })
        .collect();
    if angles.is_some_and(|angles| apply(&mut changed, angles, None) == 0) {
        return None;
    }
    Some(CauseReport {
        name: "torque_current",
        value: scales.first().map_or(Number::UNKNOWN, |scale| scale.ratio.into()),
        words: format!("{words}; read it so by {}", options(&changed)),
        reads: angles.into_iter().collect(),
        ..CauseReport::default()
    })
}

/// Unit of a current that the stated torque constants explain: with them all ratios are near 1, and one is
/// nearer than as a torque in N m or mN m.
fn explained_unit(scales: &[Scale], constants: &[f64]) -> Option<Unit> {
    Unit::for_quantity(Quantity::Current).find(|unit| {
        let ratios =
            scales.iter().zip(constants).map(|(scale, constant)| scale.ratio * unit.factor() * constant);
        let after: Vec<f64> = ratios.map(|ratio| ratio.ln().abs()).collect();
        let is_no_torque = |torque: Unit| {
            let before = scales.iter().map(|scale| (scale.ratio * torque.factor()).ln().abs());
            before.zip(&after).any(|(before, after)| before > after + NEARER.ln())
        };
        after.iter().all(|after| *after < PRIOR_ERROR.ln())
            && Unit::for_quantity(Quantity::Torque).all(is_no_torque)
    })
}

/// Unit of a current with unknown torque constants, by the size of the ratios.
fn fitting_unit(scales: &[Scale]) -> Option<Unit> {
    Unit::for_quantity(Quantity::Current).find(|unit| {
        let mut ratios = scales.iter().map(|scale| scale.ratio * unit.factor());
        if unit.factor() == 1.0 {
            return ratios.all(|ratio| ratio < CURRENT_RATIO);
        }
        scales.iter().all(|scale| scale.ratio > 1.0 / CURRENT_RATIO)
            && ratios.clone().all(|ratio| ratio < 1.0)
            && ratios.any(|ratio| ratio < CURRENT_RATIO)
    })
}

/// Scale of a joint's recorded torque.
struct Scale {
    /// Recorded torque over the prior's.
    ratio: f64,
    /// Cosine between both, -1..1.
    likeness: f64,
}

fn scales(equations: &Equations, prior: &[f64]) -> Vec<Scale> {
    let of_joint = |joint: usize| {
        let (mut along, mut measured, mut expected) = (0.0, 0.0, 0.0);
        let rows = equations.sources.iter().zip(&equations.torque).zip(equations.columns.rows());
        for ((source, torque), row) in rows {
            if source.joint == joint {
                let guess = dot(row, prior);
                along += guess * torque;
                measured += torque * torque;
                expected += guess * guess;
            }
        }
        let product: f64 = measured * expected;
        Scale { ratio: along / f64::max(expected, 1e-300), likeness: along / product.sqrt().max(1e-300) }
    };
    (0..equations.joints()).map(of_joint).collect()
}
