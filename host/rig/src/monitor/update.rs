//! The quick update compared with the changes that were made.

use crate::report::monitor::{HypothesisReport, UpdateReport, ValueReport};
use scarab::ident::{Cause, Hypothesis, PAYLOAD_PARAMETERS, Reason, Thresholds, Update};
use scarab::model::{Parameter, Payload};
use scarab_base::names::parameter_name;
use scarab_identify::formats::leg_file::LegFile;

use super::Disturbance;

/// Cause of these disturbances, if it is a single one among the firmware's hypotheses.
fn expected(disturbances: &[Disturbance]) -> Cause {
    match disturbances {
        [Disturbance::Payload(payload)] => Cause::Payload { link: payload.joint },
        [Disturbance::Friction { .. }] => Cause::Friction,
        _ => Cause::Unexplained,
    }
}

/// Report of the quick update, compared with the actual changes.
pub(super) fn update_report<const N: usize, const B: usize>(
    leg: &LegFile,
    update: &Update<f32, N, B>,
    thresholds: &Thresholds<f32>,
    disturbances: &[Disturbance],
    known: &[Disturbance],
    after_s: f64,
) -> UpdateReport {
    let right = update.cause == expected(disturbances);
    let numbers = |values: &[f32]| values.iter().map(|value| (*value).into()).collect();
    let name = |joint: usize| leg.joints.get(joint).map(|joint| joint.name.clone());
    let mut hypotheses = vec![HypothesisReport {
        name: "unchanged".into(),
        chi_square: update.unchanged.0.into(),
        freedom: update.unchanged.1.into(),
        explains: false,
    }];
    let links =
        (0..N).map(|link| (format!("payload on {}", name(link).unwrap_or_default()), &update.payload[link]));
    for (name, hypothesis) in links.chain([("friction".into(), &update.friction)]) {
        let (chi_square, freedom) = (hypothesis.chi_square.into(), hypothesis.freedom.into());
        let explains = hypothesis.explains(thresholds);
        hypotheses.push(HypothesisReport { name, chi_square, freedom, explains });
    }
    let (cause, link, values) = match update.cause {
        Cause::Payload { link } => {
            let parameters = PAYLOAD_PARAMETERS.map(|parameter| (link, parameter));
            ("payload", name(link), values(leg, &update.payload[link], &parameters, known, right))
        }
        Cause::Friction => {
            let parameters: Vec<_> =
                (0..N).flat_map(|joint| [(joint, Parameter::FC), (joint, Parameter::FV)]).collect();
            ("friction", None, values(leg, &update.friction, &parameters, known, right))
        }
        Cause::Nothing => ("nothing", None, Vec::new()),
        Cause::Unexplained => ("unexplained", None, Vec::new()),
    };
    UpdateReport {
        cause,
        link,
        reasons: update.verdict.reasons().map(Reason::name).collect(),
        right,
        after_s,
        hypotheses,
        energy_before: numbers(&update.energy_before),
        energy_after: numbers(&update.energy_after),
        values,
    }
}

fn values(
    leg: &LegFile,
    hypothesis: &Hypothesis<f32>,
    parameters: &[(usize, Parameter)],
    disturbances: &[Disturbance],
    right: bool,
) -> Vec<ValueReport> {
    let determined = parameters.iter().enumerate().filter(|(index, _)| hypothesis.determined[*index]);
    determined
        .map(|(index, &(joint, parameter))| ValueReport {
            name: parameter_name(joint, parameter),
            unit: parameter.unit(),
            value: hypothesis.values[index].into(),
            sigma: hypothesis.sigma(index).into(),
            truth: disturbances
                .first()
                .filter(|_| right)
                .and_then(|one| truth(leg, one, joint, parameter))
                .into(),
        })
        .collect()
}

fn truth(leg: &LegFile, disturbance: &Disturbance, joint: usize, parameter: Parameter) -> Option<f64> {
    match *disturbance {
        Disturbance::Payload(payload) => {
            let at_origin = Payload { joint: 0, ..payload };
            (joint == payload.joint).then(|| at_origin.parameters::<1>()[0][parameter.index()])
        }
        Disturbance::Friction { factor, .. } => {
            let link = leg.joints.get(joint)?.truth.as_ref()?;
            let before = if parameter == Parameter::FC { link.coulomb } else { link.viscous };
            Some((factor - 1.0) * before)
        }
    }
}
