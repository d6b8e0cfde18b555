//! Section on the verdict: result, sentences of failures, and the margin of every test.

use maud::{Markup, html};
use scarab_base::number::Number;
use scarab_base::table::{Table, cells};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::findings::{FindingReport, hardly_tested};

use crate::view::html::table::ToHtml;
use crate::view::html::{count, exact, joint_name, number};
use crate::view::tables;

/// Verdict in large type and in words, with each reason and its limit.
pub(crate) fn banner(run: &RunReport) -> Markup {
    let validated = !run.validation.is_empty();
    let misfit = run.accepted_misfit();
    let cause = run.doubt.as_ref().and_then(|doubt| doubt.likely_cause.as_ref());
    html! {
        section.verdict.accepted[run.accepted()].refused[!run.accepted()] {
            @if run.accepted() {
                p.word { "Accepted" @if misfit.is_some() { ", with a misfit" } @if !validated { ", not validated" } }
                p { "The model explains the motion it was identified from" @if validated {
                    ", and predicts the motions that were not used"
                } ". " (passed(run)) }
                @for torque in &run.additional_torque {
                    p { strong { "Identified with a part that the rigid-body model lacks: " } (torque.subject()) ", " (torque.words()) "." }
                }
                @if run.is_replay() {
                    @for words in hardly_tested(run) { p { strong { "Hardly tested: " } (words) "." } }
                }
                @if let Some(ratio) = misfit {
                    p.warning { strong { "Warning: " } (tables::misfit(ratio)) ". The torque holds something that the model does not, \
                        within the accepted error. "
                        @if let Some(cause) = cause {
                            "Likely cause: " (cause.named()) ". The standard deviations contain its effect on the parameters."
                        } @else {
                            "The standard deviations contain its scatter, not a constant part that no error of the list below \
                            describes."
                        }
                    }
                }
                @if !validated {
                    p { strong { "Not validated: " } "no motion was held out, so nothing is known of its predictions." }
                }
            } @else {
                p.word { "Refused" }
                p { "Do not use this model. It was refused because of:" }
                ul { @for reason in &run.reasons { li { (sentences(reason, run)) } } }
                @if let Some(cause) = cause {
                    p { strong { "Likely cause: " } (cause.name.replace('_', " ")) ": " (cause.words) "." }
                }
            }
        }
    }
}

/// Faults and warnings of a board; empty for other runs.
pub(crate) fn alarms(run: &RunReport) -> Markup {
    let trace = run.trace.as_ref();
    let (faults, warnings) = trace.map_or((&[][..], &[][..]), |trace| (&trace.faults, &trace.warnings));
    html! {
        @if !faults.is_empty() {
            section.verdict.refused {
                p.word { (count(faults.len(), "fault")) " of the drive" }
                p { "Independent of the verdict on the model, the board reported:" }
                ul { @for words in faults { li { (words) } } }
            }
        }
        @if !warnings.is_empty() {
            section { h2 { "Warnings" } ul { @for words in warnings { li { (words) } } } }
        }
    }
}

fn passed(run: &RunReport) -> String {
    match run.findings.len() {
        0 => String::new(),
        all => format!("All {all} tests of the verdict were passed."),
    }
}

/// Failures for a reason: their sentences, or the general explanation.
fn sentences(reason: &str, run: &RunReport) -> Markup {
    let failed = run.findings.iter().filter(|finding| finding.reason == reason && !finding.passed);
    let words: Vec<String> =
        failed.map(|finding| tables::failure(run, finding)).filter(|words| !words.is_empty()).collect();
    let name = html! { strong { (reason.replace('_', " ")) } ": " };
    match words.as_slice() {
        [] => html! { (name) (tables::explanation(reason)) "." },
        [only] => html! { (name) (only) "." },
        many => {
            html! { (name) (tables::explanation(reason)) "." ul { @for words in many { li { (words) "." } } } }
        }
    }
}

/// Whether the limit is a minimum, and the subject of the test.
fn meaning(test: &str) -> (bool, &str) {
    match test {
        "rows" => (true, "filtered rows in which the joint moves"),
        "not_finite" => (false, "samples and rows that are not finite"),
        "torque" => (true, "rms torque, N m"),
        "search" => (false, "chi-square by which the search ended above least squares"),
        "weight" => (false, "torque that holds the leg's weight, N m"),
        "shaking" => (false, "rms speed beside the command, rad/s"),
        "drive" => (true, "the drive stayed enabled"),
        "speed" => (true, "rms speed, rad/s"),
        "encoder_pulse" => (false, "speed of the pulse that one encoder count makes, rad/s"),
        "encoder_steps" => (false, "share of error that the encoder's steps make"),
        "determined" => (true, "base parameters that are determined"),
        "condition" => (false, "condition of the scaled problem"),
        "predicted_uncertainty" => (false, "uncertainty of the predicted torque over its rms"),
        "finite" => (false, "parameters that are not finite"),
        "negative_parameter" => (false, "sigma by which a parameter is below what a body can have"),
        "negative_energy" => (false, "sigma by which kinetic energy is negative"),
        "prior_box" => (false, "chi-square that physical consistency costs"),
        "dynamic_share" => (true, "share of the torque that inertia and friction make"),
        "training_error" => (false, "rms error on the motion identified from, N m"),
        "whole_error" => (false, "error of all rows over their torque, excluded rows included"),
        "validation_error" => (false, "rms error on an unused motion, N m"),
        "slow_residual" => (false, "residual that lasts, N m"),
        "link_length" => (false, "share by which the link before seems longer"),
        "encoder_zero" => (false, "angle by which the zero seems off, rad"),
        "common_disturbance" => (false, "time for which all joints deviate together, s"),
        "replaced_share" => (false, "share of samples replaced as outliers"),
        "disturbed_share" => (false, "share of rows excluded as disturbed"),
        "delay" => (false, "delay of the torque against the angle, ms"),
        "encoder_scale" => (false, "error of the angle's scale, %"),
        "torque_scale" => (false, "torque scale against that of joint 1, %"),
        "spring" => (false, "stiffness of a spring beside the drive, N m/rad"),
        "offset_drift" => (false, "change of the torque's offset over a recording, N m"),
        "torque_drift" => (false, "change of the torque's gain over a recording, %"),
        "friction_drift" => (false, "change of the friction over a recording, %"),
        "gravity" => (false, "angle by which gravity seems turned, degrees"),
        "no_gravity" => (true, "sigma by which the leg's weight shows"),
        "changed_midway" => (false, "change of the torque's gain midway"),
        "zero_rows" => (false, "time of the first row of zeros, s"),
        "saturation" => (false, "limit of the recorded torque, N m"),
        "held_samples" => (false, "time for which recorded values are held, s"),
        "time_stamps" => (false, "error of the time stamps, s"),
        _ => (false, ""),
    }
}

/// Errors of the logging chain, the misfit over noise, and parameters at a limit of the prior.
pub(crate) fn doubts(run: &RunReport) -> Markup {
    html! { @if let Some(doubt) = &run.doubt {
        section {
            h2 { "Errors of the logging chain" }
            p { "Each error is fitted beside the parameters. The recording is refused where an error is significant, shifts a \
                parameter by more than two sigma, and explains part of the misfit." }
            ul { @for line in doubt.lines() { li { (line) } } }
        }
    } }
}

/// Tests with the value 1 if passed, else 0.
const YES_OR_NO: [&str; 1] = ["drive"];

/// Ratio of a test's value to its limit: 1 at the limit.
fn nearness(finding: &FindingReport) -> f64 {
    let (value, limit) =
        (finding.value.known().unwrap_or(f64::INFINITY).abs(), finding.limit.known().unwrap_or(0.0));
    let (least, _) = meaning(finding.test);
    let share = if least { limit / value } else { value / limit };
    if share.is_nan() { 0.0 } else { share }
}

/// Every kind of test with its case nearest to the limit. A passed test without a limit says nothing.
pub(crate) fn tests(findings: &[FindingReport], leg: &LegFile) -> Markup {
    let is_tested = |finding: &&FindingReport| finding.limit.known().is_some() || !finding.passed;
    let findings: Vec<FindingReport> = findings.iter().filter(is_tested).cloned().collect();
    let mut kinds: Vec<(&str, &str)> = Vec::new();
    for finding in &findings {
        if !kinds.contains(&(finding.reason, finding.test)) {
            kinds.push((finding.reason, finding.test));
        }
    }
    kinds.sort_by_key(|(reason, _)| findings.iter().position(|finding| finding.reason == *reason));
    let mut table = Table::with_class("tests")
        .text(["against", "what is tested"])
        .styled("what")
        .numbers(["value", "limit"])
        .text(["where"])
        .numbers(["passed"]);
    kinds.iter().for_each(|kind| add_row(&mut table, &findings, *kind, leg));
    html! { @if !kinds.is_empty() {
        section {
            h2 { "Tests of the verdict" }
            p { "Each kind of test, with the case that came nearest to its limit, or went farthest beyond it." }
            (table.to_html())
        }
    } }
}

/// Adds the case of one kind of test that is nearest to its limit.
fn add_row(table: &mut Table, findings: &[FindingReport], (reason, test): (&str, &str), leg: &LegFile) {
    let of_kind = || findings.iter().filter(|finding| (finding.reason, finding.test) == (reason, test));
    let (all, passed) = (of_kind().count(), of_kind().filter(|finding| finding.passed).count());
    let nearest = of_kind().max_by(|one, other| {
        let rank = |finding: &FindingReport| (!finding.passed, nearness(finding));
        let (one, other) = (rank(one), rank(other));
        one.0.cmp(&other.0).then(one.1.total_cmp(&other.1))
    });
    let (least, words) = meaning(test);
    let words = if words.is_empty() { test.replace('_', " ") } else { words.to_owned() };
    let Some(nearest) = nearest else { return };
    let (value, limit) = if YES_OR_NO.contains(&test) {
        (if nearest.passed { "yes" } else { "no" }.to_owned(), "yes".to_owned())
    } else {
        let sign = if least { "\u{2265}" } else { "\u{2264}" };
        (whole(nearest.value), format!("{sign}\u{a0}{}", exact(nearest.limit)))
    };
    table.marked_row(
        passed < all,
        cells![
            reason.replace('_', " "),
            words,
            value,
            limit,
            location(nearest, leg),
            format!("{passed} of {all}")
        ],
    );
}

/// Formats a count without decimals.
fn whole(value: Number) -> String {
    match value.known() {
        Some(known) if known.abs() < 1e6 && known == known.round() => {
            format!("{known:.0}").replace('-', "\u{2212}")
        }
        Some(known) if known.abs() >= 1e30 => "\u{2013}".into(),
        _ => number(value),
    }
}

fn location(finding: &FindingReport, leg: &LegFile) -> String {
    let joint = finding.joint.map(|joint| joint_name(leg, joint));
    let parts: Vec<String> = joint.into_iter().chain(finding.motion.clone()).collect();
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(test: &'static str, value: f64, limit: f64) -> FindingReport {
        FindingReport {
            reason: "input",
            test,
            joint: None,
            motion: None,
            value: value.into(),
            limit: limit.into(),
            passed: true,
            words: String::new(),
        }
    }

    #[test]
    fn a_least_is_neared_from_above_and_a_most_from_below() {
        assert!(nearness(&finding("speed", 0.06, 0.05)) > nearness(&finding("speed", 0.6, 0.05)));
        assert!(
            nearness(&finding("condition", 900.0, 1000.0)) > nearness(&finding("condition", 9.0, 1000.0))
        );
        // Limits of zero without a violation, and offsets of either sign.
        assert_eq!(nearness(&finding("not_finite", 0.0, 0.0)), 0.0);
        assert_eq!(nearness(&finding("encoder_zero", -0.5, 1.0)), 0.5);
    }
}
