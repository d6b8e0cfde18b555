//! What came of watching, as data.
//!
//! The names of the fields are an interface.

use serde::Serialize;

use scarab::ident::{Cause, Hypothesis, PAYLOAD_PARAMETERS, Reason, Thresholds, Update};
use scarab::model::{Parameter, Payload};

use super::super::analysis::parameter_name;
use super::super::leg_file::LegFile;
use super::super::report::Number;
use super::Disturbance;

/// Many runs.
#[derive(Clone, Debug, Serialize)]
pub struct MonitorRuns {
    /// Version of the JSON.
    pub schema: u32,
    /// Name in the leg file.
    pub leg: String,
    /// In the order of their seeds.
    pub runs: Vec<MonitorRun>,
}

/// One run.
#[derive(Clone, Debug, Serialize)]
pub struct MonitorRun {
    /// Of noise and pushes.
    pub seed: u64,
    /// Why there was no model to watch; empty where there was.
    pub refused: Vec<&'static str>,
    /// Standard deviation of one filtered row of each joint at acceptance.
    pub row_sigma_nm: Vec<Number>,
    /// What a joint's sum must reach.
    pub limit: Number,
    /// Walked without any change.
    pub hours: f64,
    /// Alarms while nothing had changed, seconds of walking.
    pub false_alarms_at_s: Vec<f64>,
    /// Whether anything was changed.
    pub changed: bool,
    /// The alarm after the change.
    pub alarm: Option<AlarmReport>,
    /// What the quick pass made of it.
    pub update: Option<UpdateReport>,
    /// Whether the change was still going on when it was noticed.
    pub still_changing: bool,
    /// Whether the leg complained again within a minute of the update.
    pub alarm_after_update: bool,
    /// Root mean square position error of all joints before the change, degrees.
    pub error_deg_before: Number,
    /// From the change to the end of the quick pass.
    pub error_deg_changed: Number,
    /// With the update in use.
    pub error_deg_updated: Number,
}

/// An alarm.
#[derive(Clone, Debug, Serialize)]
pub struct AlarmReport {
    /// Seconds after the change.
    pub after_s: f64,
    /// How long ago the leg says it happened.
    pub since_s: Number,
    /// Joints it names.
    pub joints: Vec<String>,
    /// Sum of each joint.
    pub statistic: Vec<Number>,
}

/// What the quick pass found.
#[derive(Clone, Debug, Serialize)]
pub struct UpdateReport {
    /// `payload`, `friction`, `nothing` or `unexplained`.
    pub cause: &'static str,
    /// The link that carries the payload.
    pub link: Option<String>,
    /// Of the verdict.
    pub reasons: Vec<&'static str>,
    /// Whether that is what happened.
    pub right: bool,
    /// Seconds from the alarm.
    pub after_s: f64,
    /// What was compared: the model as it was, a payload on each link, other friction.
    pub hypotheses: Vec<HypothesisReport>,
    /// Energy of each joint's residual over that at acceptance.
    pub energy_before: Vec<Number>,
    /// With the update.
    pub energy_after: Vec<Number>,
    /// Changes of parameters under the cause found; none where nothing explains the change.
    pub values: Vec<ValueReport>,
}

/// How well one explanation does.
#[derive(Clone, Debug, Serialize)]
pub struct HypothesisReport {
    /// `unchanged`, `payload on LINK`, `friction`.
    pub name: String,
    /// What it leaves unexplained.
    pub chi_square: Number,
    /// Degrees of freedom of that.
    pub freedom: Number,
    /// Whether what it leaves is noise.
    pub explains: bool,
}

/// A change of one parameter.
#[derive(Clone, Debug, Serialize)]
pub struct ValueReport {
    /// `M2`, `FC1`.
    pub name: String,
    /// SI.
    pub unit: &'static str,
    /// Found.
    pub value: Number,
    /// Standard deviation, the accepted model's uncertainty in it.
    pub sigma: Number,
    /// What the simulation changed; unknown where the cause found is not what happened.
    pub truth: Number,
}

impl MonitorRun {
    /// Nothing happened yet.
    pub(super) fn new(seed: u64) -> Self {
        Self {
            seed,
            refused: Vec::new(),
            row_sigma_nm: Vec::new(),
            limit: Number::UNKNOWN,
            hours: 0.0,
            false_alarms_at_s: Vec::new(),
            changed: false,
            alarm: None,
            update: None,
            still_changing: false,
            alarm_after_update: false,
            error_deg_before: Number::UNKNOWN,
            error_deg_changed: Number::UNKNOWN,
            error_deg_updated: Number::UNKNOWN,
        }
    }

    /// The identification was refused.
    pub(super) fn refused(seed: u64, reasons: Vec<&'static str>) -> Self {
        Self { refused: reasons, ..Self::new(seed) }
    }

    /// A model, no false alarm; a change noticed, rightly explained, and quiet after the update unless it went on.
    #[must_use]
    pub fn is_as_it_should_be(&self) -> bool {
        let quiet = self.still_changing || !self.alarm_after_update;
        let explained = self.update.as_ref().is_some_and(|update| update.right) && quiet;
        self.refused.is_empty() && self.false_alarms_at_s.is_empty() && (!self.changed || explained)
    }
}

/// What explains these disturbances: only what stands among the firmware's hypotheses, alone.
fn expected(disturbances: &[Disturbance]) -> Cause {
    match disturbances {
        [Disturbance::Payload(payload)] => Cause::Payload { link: payload.joint },
        [Disturbance::Friction { .. }] => Cause::Friction,
        _ => Cause::Unexplained,
    }
}

/// The quick pass beside what happened.
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
    let told = parameters.iter().enumerate().filter(|(index, _)| hypothesis.determined[*index]);
    told.map(|(index, &(joint, parameter))| ValueReport {
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
