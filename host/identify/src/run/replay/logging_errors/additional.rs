//! Springs and friction by load that a replay estimates and subtracts.
//!
//! | leg file | estimated |
//! | --- | --- |
//! | `"on"` | always |
//! | `"auto"` | if it is the likely cause of a misfit, and not distinguished from another is none |
//! | `"off"` | never |
//!
//! The recordings are identified again without them, until the values stay within a fifth of their sigma, at
//! most four times. A spring needs an offset, with which its torque at rest is measured in a sum.

use scarab::model::Parameter;
use scarab_base::names::parameter_name;
use scarab_base::number::Number;

use crate::formats::leg_file::Switch;
use crate::leg::additional_torque::Additional;
use crate::report::RunReport;
use crate::report::additional_torque::{AdditionalKind, AdditionalTorque, rest_name};
use crate::report::doubt::UnseenSpring;
use crate::report::model_choice::ModelChoiceReport;
use crate::run::logging_errors::beside::{Beside, LISTED, additional, significance};
use crate::run::logging_errors::directions::{Found, Kind};
use crate::run::logging_errors::{LoggingErrors, Question};
use crate::run::replay::logging_errors::Subject;

/// Sigma up to which a spring is unseen.
const UNSEEN: f64 = 2.0;
/// Change of a value, in its sigma, that another identification is worth.
const SETTLED: f64 = 0.2;

impl<const N: usize, const B: usize> Subject<'_, N, B> {
    /// Whether the leg file leaves an additional torque to the data, demands or forbids it.
    fn switch(&self, joint: usize, kind: AdditionalKind) -> Switch {
        self.leg.joints.get(joint).map_or(Switch::Off, |joint| match kind {
            AdditionalKind::Spring => joint.spring,
            AdditionalKind::LoadFriction => joint.load_friction,
        })
    }

    /// Adds the standard deviations of the subtracted torques to those of the parameters, and reports them.
    /// Returns better values, where they differ.
    pub(super) fn refined(
        &self,
        run: &mut RunReport,
        question: &Question,
        errors: &mut LoggingErrors,
    ) -> Option<Additional> {
        let wanted: Vec<(usize, AdditionalKind)> =
            self.additional.torques.iter().map(|torque| (torque.joint - 1, torque.kind)).collect();
        if wanted.is_empty() {
            return None;
        }
        let rest = additional(question, &errors.equations.for_training(), &wanted);
        let dropped = &self.solver.record().selection.dropped;
        for ((torque, (_, own)), shift) in run.additional_torque.iter_mut().zip(&rest.found).zip(&rest.shifts)
        {
            for (sigma, change) in errors.sigma.iter_mut().zip(shift) {
                sigma.logging = sigma.logging.hypot(*change);
            }
            torque.sigma = *own;
            torque.shift = self.background.kept(dropped).map(|base| shift[base]).collect();
        }
        run.model_choice.extend(run.additional_torque.iter().map(|torque| ModelChoiceReport {
            joint: torque.joint,
            option: torque.kind.name(),
            asked: self.switch(torque.joint - 1, torque.kind).name(),
            used: "on",
            why: torque.words(),
            ..ModelChoiceReport::default()
        }));
        report_rest(run);
        let mut torques = run.additional_torque.clone();
        for (torque, (rest, _)) in torques.iter_mut().zip(&rest.found) {
            torque.value += rest;
        }
        let is_settled = rest.found.iter().all(|rest| significance(*rest) < SETTLED);
        (!is_settled).then(|| Additional { torques, friction: self.friction(question, &rest) })
    }

    /// All additional torques that are to be subtracted, if that is more than is.
    pub(super) fn wanted(
        &self,
        run: &RunReport,
        question: &Question,
        errors: &LoggingErrors,
    ) -> Option<Additional> {
        let cause = run.doubt.as_ref().and_then(|doubt| doubt.likely_cause.as_ref());
        let cause = cause.filter(|cause| cause.possible.is_empty());
        let is_cause = |joint: usize, kind: AdditionalKind| {
            let named = cause.filter(|cause| cause.name == kind.name());
            named.is_some_and(|cause| cause.joint.is_none_or(|own| own == joint + 1))
        };
        let is_subtracted = |joint: usize, kind: AdditionalKind| {
            self.additional.torques.iter().any(|torque| torque.joint == joint + 1 && torque.kind == kind)
        };
        let is_wanted = |&(joint, kind): &(usize, AdditionalKind)| match self.switch(joint, kind) {
            Switch::On | Switch::Within(_) => true,
            Switch::Auto => is_subtracted(joint, kind) || is_cause(joint, kind) && self.has_room(joint, kind),
            Switch::Off => false,
        };
        let all = (0..N).flat_map(|joint| AdditionalKind::ALL.map(|kind| (joint, kind)));
        let wanted: Vec<(usize, AdditionalKind)> = all.filter(is_wanted).collect();
        if wanted.len() == self.additional.torques.len() {
            return None;
        }
        let beside = additional(question, &errors.equations.for_training(), &wanted);
        let torques = wanted.into_iter().zip(&beside.found).filter_map(|((joint, kind), &(rest, sigma))| {
            let before =
                run.additional_torque.iter().find(|torque| torque.joint == joint + 1 && torque.kind == kind);
            let value = rest + before.map_or(0.0, |before| before.value);
            let is_seen = value > 0.0 && significance((value, sigma)) > LISTED;
            let is_used = before.is_some() || is_seen || self.switch(joint, kind) == Switch::On;
            is_used.then(|| AdditionalTorque { joint: joint + 1, kind, value, sigma, shift: Vec::new() })
        });
        let torques: Vec<AdditionalTorque> = torques.collect();
        let is_more = torques.len() > self.additional.torques.len();
        is_more.then(|| Additional { torques, friction: self.friction(question, &beside) })
    }

    /// Whether the joint has the offset with which a spring's torque at rest is measured in a sum.
    fn has_room(&self, joint: usize, kind: AdditionalKind) -> bool {
        let has_offset = self.leg.joints.get(joint).is_some_and(|joint| {
            joint.offset != Switch::Off && !matches!(joint.asymmetric_coulomb, Switch::On)
        });
        kind != AdditionalKind::Spring || has_offset
    }

    /// Springs that could replace weight unseen, by more than the accepted error.
    pub(super) fn unseen_springs(&self, question: &Question, errors: &LoggingErrors) -> Vec<UnseenSpring> {
        let unseen = |found: &Found| {
            let Kind::Spring(joint) = found.kind else { return None };
            let stiffness = UNSEEN * found.sigma();
            let is_moment = |base: &usize| {
                let carrier = question.regressor.carrier(*base);
                matches!(carrier, Some((own, Parameter::HX | Parameter::HY)) if own == joint)
            };
            let size = |base: &usize| found.values[*base].abs();
            let moments = (0..found.shift.len()).filter(is_moment);
            let base = moments.max_by(|one, other| size(one).total_cmp(&size(other)))?;
            let change = (found.shift[base] / found.value * stiffness / found.values[base]).abs();
            let is_open = self.switch(joint, AdditionalKind::Spring) == Switch::Auto && found.seen;
            (is_open && change > question.accepted_error).then(|| UnseenSpring {
                joint: joint + 1,
                stiffness,
                parameter: self.background.base_name(base),
                change,
            })
        };
        errors.found.iter().filter_map(unseen).collect()
    }

    /// Coulomb and viscous friction and offset of each joint, as fitted.
    fn friction(&self, question: &Question, beside: &Beside) -> Vec<[f64; 3]> {
        let of = |joint: usize, parameter: Parameter| {
            let carries = |base: &usize| question.regressor.carrier(*base) == Some((joint, parameter));
            (0..question.active.len()).find(carries).map_or(0.0, |base| beside.refitted.values[base])
        };
        let of_joint = |joint: usize| {
            let [coulomb, viscous, offset] =
                [Parameter::FC, Parameter::FV, Parameter::OFF].map(|parameter| of(joint, parameter));
            [coulomb, viscous, self.anatomy[joint].from_chain(offset)]
        };
        (0..N).map(of_joint).collect()
    }
}

/// Gives the covariance of the base parameters, which has the reported standard deviations, the part that
/// the additional torques make.
pub(super) fn correlate(run: &mut RunReport) {
    let shifts: Vec<&[f64]> = run.additional_torque.iter().map(|torque| &*torque.shift).collect();
    let common =
        |row: usize, column: usize| shifts.iter().map(|shift| shift[row] * shift[column]).sum::<f64>();
    let covariance = &mut run.detail.covariance;
    let rest = |(base, row): (usize, &Vec<f64>)| (1.0 - common(base, base) / row[base]).max(0.0).sqrt();
    let rests: Vec<f64> = covariance.iter().enumerate().map(rest).collect();
    for (row, elements) in covariance.iter_mut().enumerate() {
        for (column, element) in elements.iter_mut().enumerate() {
            *element = rests[row] * rests[column] * *element + common(row, column);
        }
    }
}

/// Reports the offset of a joint with a spring as the sum that torque determines.
fn report_rest(run: &mut RunReport) {
    for torque in run.additional_torque.iter().filter(|torque| torque.kind == AdditionalKind::Spring) {
        let (offset, rest) = (parameter_name(torque.joint - 1, Parameter::OFF), rest_name(torque.joint - 1));
        for base in run.base_parameters.iter_mut().filter(|base| base.name == offset) {
            base.name += "R";
            base.terms.insert(rest.clone(), 1.0);
        }
        for parameter in run.parameters.iter_mut().filter(|parameter| parameter.name == offset) {
            (parameter.status, parameter.sigma) = ("grouped", Number::UNKNOWN);
            parameter.grouped_with.push(rest.clone());
        }
    }
}
