//! Most likely cause of a refusal, from fits repeated with one error corrected.
//!
//! ```text
//! m             misfit of the refit over the torque, root mean square over the joints
//! plausible     no parameter that must be positive is below zero by more than 5 sigma;
//!               torque of the prior's sign and size
//! explained     (m0^2 - m^2) / (m0^2 - n^2)    m0: without the correction, n: noise
//! ```
//!
//! Ranking: findings about samples first, then the plausible correction that leaves least of the misfit. It
//! is named alone only if it explains half of the misfit beyond the noise. Otherwise the cause is unknown,
//! and the corrections that explain a tenth of a joint's misfit, or refuse by themselves, are listed. Where
//! the uncorrected fit is not plausible, m0 is the misfit of the leg whose parameters have their sign. Causes
//! of equal misfit that are certain too are listed as not distinguished.

use scarab::ident::Test;
use scarab_base::stats::rms;

use crate::report::additional_torque::AdditionalKind;
use crate::report::doubt::{CauseReport, DirectionReport, ReadAs, SampleFinding};
use crate::report::findings::FindingReport;
use crate::run::logging_errors::corrections::{
    angle_units, corrected, corrections, millinewton_metres, spans, unit_pairs,
};
use crate::run::logging_errors::directions::CHANCE;
use crate::run::logging_errors::midway::Midway;
use crate::run::logging_errors::refused::{
    HALF, Refused, Tried, UNKNOWN, WEAKER, are_close, changed_midway, quality, refit,
};
use crate::run::logging_errors::samples::SATURATION;
use crate::run::logging_errors::{LoggingErrors, NO_GRAVITY, Question, assumption, lag, sample_cause};

/// Misfits closer than this ratio are those of mirrored legs.
const MIRRORED: f64 = 1.001;

/// Scale between joints, percent, from which a torque is not in mN m.
const OTHER_SCALE_PERCENT: f64 = 40.0;
/// Mean change over the time near zero, over the width of that band, from which a torque is slow there.
const SLOW: f64 = 2.5;
/// Speed from which a joint moves, rad/s.
const MOVING_RADPS: f64 = 0.03;
/// Share of its largest value at which a torque counts as zero, and how often one without sign returns there.
const NEAR_ZERO: f64 = 0.02;
const LEAST_RETURNS: usize = 3;
/// Samples at 500 Hz for each such return: a torque of one sign may touch zero now and then.
const SAMPLES_PER_RETURN: usize = 1000;
fn unknown() -> CauseReport {
    CauseReport { name: UNKNOWN, words: "too few rows to try corrections".into(), ..CauseReport::default() }
}

/// Names the most likely cause of a refusal.
pub(crate) fn likely(
    question: &Question,
    errors: Option<&LoggingErrors>,
    samples: &[SampleFinding],
    findings: &[FindingReport],
) -> CauseReport {
    if let Some(finding) = samples.iter().find(|finding| finding.refuses) {
        return sample_cause(finding);
    }
    if let Some(cause) = without_torque(findings).or_else(|| motionless(findings)) {
        return cause;
    }
    let Some(errors) = errors else { return excluded(samples).unwrap_or_else(unknown) };
    if let Some(cause) = one_way(question, errors, findings) {
        return cause;
    }
    // After a change of sign the robust weights exclude the rest, and with it what other corrections leave.
    if let Some(midway) = errors.midway.as_ref().filter(|midway| midway.refuses() && midway.change < -1.0) {
        return changed_midway(midway);
    }
    if let Some(cause) = encoder_steps(question, errors, findings) {
        return cause;
    }
    // Damage resembles friction at rest and columns without effect: the refused fit's choice of both is not
    // used.
    let plain = question.with_all_columns();
    let again = plain.as_ref().and_then(|plain| LoggingErrors::fit(plain).ok().flatten());
    let (question, errors) = match (&plain, &again) {
        (Some(plain), Some(again)) => (plain, again),
        _ => (question, errors),
    };
    let refused = Refused::new(question, errors);
    if let Some(cause) = refused.is_alien().then(|| per_mille(question)).flatten() {
        return cause;
    }
    let mut tried: Vec<_> =
        corrections(question).iter().filter_map(|correction| refit(question, correction)).collect();
    tried.extend(fitted(&refused));
    tried.extend(unit_pairs(question).iter().filter_map(|pair| refit(question, pair)));
    match named(&refused, &mut tried) {
        // Friction by load fits part of a torque without sign.
        Some(best) if best.cause.name == AdditionalKind::LoadFriction.name() => {
            let magnitude = unsigned(question, errors);
            magnitude.filter(|found| found.joint == best.cause.joint).unwrap_or(best.cause)
        }
        Some(best) => best.cause,
        None => without_weight(findings)
            .or_else(|| unsigned(question, errors))
            .or_else(|| excluded(samples))
            .unwrap_or_else(|| refused.unknown(tried)),
    }
}

/// Explains the misfit of an accepted leg: the error that is named alone, and the shift of each parameter
/// when it is fitted.
pub(crate) fn of_misfit(question: &Question, errors: &LoggingErrors) -> Option<(CauseReport, Vec<f64>)> {
    let refused = Refused::new(question, errors);
    let best = named(&refused, &mut fitted(&refused))?;
    let all = &errors.equations;
    let plain = all.fit(&all.columns, &all.torque, false).values;
    let shift = best.values.iter().zip(&plain).map(|(with, without)| with - without).collect();
    Some((best.cause, shift))
}

/// Errors that are fitted beside the parameters. Delays of all joints come first, because a low-pass is tried
/// only where it fits clearly better than a delay.
fn fitted(refused: &Refused<'_>) -> Vec<Tried> {
    let (question, errors) = (refused.question, refused.errors);
    let mut tried: Vec<Tried> =
        lag::all(&errors.equations).into_iter().map(|lag| refused.tried(lag)).collect();
    tried.extend(refused.directions());
    tried.extend(assumption::all(question, &errors.equations).into_iter().map(|other| refused.tried(other)));
    let midway = errors.midway.as_ref().filter(|midway| midway.refuses());
    tried.extend(midway.map(|midway| refused.midway(midway)));
    tried
}

/// The correction that explains the misfit, with those that are not distinguished from it. Drops corrections
/// that leave no possible leg or are chance.
fn named(refused: &Refused<'_>, tried: &mut Vec<Tried>) -> Option<Tried> {
    tried.retain(|tried| tried.quality.sound && tried.significance > WEAKER);
    let alone = |least: f64| {
        let all = tried.iter().filter(|tried| tried.significance > least && refused.is_named_alone(tried));
        nearest(all.cloned().collect(), |best, other| refused.are_equal(best, other))
    };
    let mut best = alone(CHANCE).or_else(|| alone(WEAKER))?;
    let alike: Vec<CauseReport> = tried
        .iter()
        .filter(|other| other.significance > CHANCE && other.cause.name != best.cause.name)
        .filter(|other| refused.is_named_alone(other) && refused.are_equal(&best, other))
        .map(|other| other.cause.clone())
        .collect();
    if best.cause.explained.known().is_some() {
        best.cause.words += &format!(
            "; fitted, it explains {:.0} % of the misfit beyond the noise",
            100.0 * refused.explained(&best)
        );
    }
    best.cause.explained = refused.explained(&best).into();
    if !alike.is_empty() {
        let mut subjects: Vec<String> = alike.iter().map(subject).collect();
        subjects.dedup();
        best.cause.words += &format!("; not distinguished from {}", subjects.join(", "));
        best.cause.possible = alike;
    }
    Some(best)
}

/// Name and joint of a cause.
fn subject(cause: &CauseReport) -> String {
    let name = cause.name.replace('_', " ");
    cause.joint.map_or(name.clone(), |joint| format!("{name} of joint {joint}"))
}

/// A torque that returns to zero again and again and never crosses it, as fast as it changes elsewhere. A
/// torque of one sign touches zero slowly.
fn unsigned(question: &Question, errors: &LoggingErrors) -> Option<CauseReport> {
    // A torque of one sign that the model explains is that of such a motion.
    let is_misfit =
        |joint: &usize| errors.misfit_over_noise[*joint].is_none_or(|ratio| ratio * ratio * HALF > 1.0);
    let joint = (0..question.joints()).filter(is_misfit).find(|&joint| {
        let torques: Vec<f64> =
            question.motions.iter().flat_map(|motion| motion.torque.column(joint)).collect();
        let [low, high] = [f64::min, f64::max].map(|of| torques.iter().copied().fold(0.0, of));
        let zero = NEAR_ZERO * (high - low);
        // Resampling swings over at a corner.
        let near: Vec<bool> = torques.iter().map(|torque| torque.abs() < zero).collect();
        let returns = near.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        let samples = near.iter().filter(|near| **near).count() as f64;
        let change = rms(torques.windows(2).map(|pair| pair[1] - pair[0]));
        (low > -zero || high < zero)
            && returns >= LEAST_RETURNS.max(torques.len() / SAMPLES_PER_RETURN)
            && samples * change < SLOW * 2.0 * zero * returns as f64
    })?;
    Some(CauseReport {
        name: "unsigned_torque",
        joint: Some(joint + 1),
        words: format!(
            "torque of joint {} returns to zero and never crosses it: is it a magnitude?",
            joint + 1
        ),
        ..CauseReport::default()
    })
}

/// A torque in another unit for each joint, as in per mille of each motor's rated torque: in mN m its scale
/// differs between the joints, which explains half of the misfit.
fn per_mille(question: &Question) -> Option<CauseReport> {
    let correction = millinewton_metres();
    let motions = question.motions.iter().map(|motion| corrected(question, motion, &correction)).collect();
    let smaller = Question {
        motions,
        noise: question.noise.iter().map(|density| Some((*density)? / 1e6)).collect(),
        sigma: question.sigma.iter().map(|sigma| sigma / 1e3).collect(),
        ..question.clone()
    };
    let errors = LoggingErrors::fit(&smaller).ok().flatten()?;
    let is_other = |found: &&DirectionReport| {
        found.name == "torque_scale"
            && found.value.known().is_some_and(|size| size.abs() > OTHER_SCALE_PERCENT)
    };
    let scales: Vec<String> = errors.directions.iter().filter(is_other).map(DirectionReport::words).collect();
    let refused = Refused::new(&smaller, &errors);
    let explains = |tried: &Tried| {
        tried.cause.name == "torque_scale" && tried.quality.sound && refused.explained(tried) > HALF
    };
    (!scales.is_empty() && refused.directions().iter().any(explains)).then(|| CauseReport {
        name: correction.name,
        words: format!(
            "is the torque in per mille of each motor's rated torque (CiA 402, object 6077)? Read in mN m, {}",
            scales.join("; ")
        ),
        ..CauseReport::default()
    })
}

/// A torque that is always zero as the cause.
fn without_torque(findings: &[FindingReport]) -> Option<CauseReport> {
    let finding = findings.iter().find(|finding| !finding.passed && finding.test == Test::Torque.name())?;
    Some(CauseReport {
        name: "no_torque",
        joint: finding.joint,
        words: format!("{}: is the column the measured torque?", finding.words),
        ..CauseReport::default()
    })
}

/// A torque without weight as the cause.
fn without_weight(findings: &[FindingReport]) -> Option<CauseReport> {
    let finding = findings.iter().find(|finding| !finding.passed && finding.test == NO_GRAVITY)?;
    Some(CauseReport { name: NO_GRAVITY, words: finding.words.clone(), ..CauseReport::default() })
}

/// A joint that hardly moved as the cause.
fn motionless(findings: &[FindingReport]) -> Option<CauseReport> {
    let failed = |test: &str| findings.iter().find(|finding| !finding.passed && finding.test == test);
    let finding = failed("speed").or_else(|| failed("rows"))?;
    Some(CauseReport {
        name: "motion",
        joint: finding.joint,
        value: finding.value,
        words: format!("{}; record a motion that moves every joint", finding.words),
        ..CauseReport::default()
    })
}

/// A joint that moved in one direction only, as the cause of parameters that are not determined.
fn one_way(question: &Question, errors: &LoggingErrors, findings: &[FindingReport]) -> Option<CauseReport> {
    findings.iter().find(|finding| !finding.passed && finding.test == Test::Determined.name())?;
    let is_one_way = |joint: &usize| {
        let moves = |sign: f64| {
            let mut instants = errors.equations.smoothed().flat_map(|(instants, _)| instants);
            instants.any(|instant| sign * instant.velocity[*joint] > MOVING_RADPS)
        };
        moves(1.0) != moves(-1.0)
    };
    let joint = (0..question.joints()).find(is_one_way)?;
    Some(CauseReport {
        name: "motion",
        joint: Some(joint + 1),
        words: format!(
            "joint {} moves in one direction only, which does not distinguish its offset from Coulomb friction: record a \
             motion in both, or state `offset = \"off\"` in the leg file",
            joint + 1
        ),
        ..CauseReport::default()
    })
}

/// Encoder steps as the cause: where nothing else refuses, or where a lower bandwidth makes the recording
/// acceptable.
fn encoder_steps(
    question: &Question,
    errors: &LoggingErrors,
    findings: &[FindingReport],
) -> Option<CauseReport> {
    let bias = errors.encoder.as_ref()?;
    let mut failed = findings.iter().filter(|finding| !finding.passed);
    let words = if let Some(steps) = failed.clone().find(|finding| finding.test == "encoder_steps")
        && failed.all(|finding| finding.test == "encoder_steps")
    {
        steps.words.clone()
    } else {
        let hz = question.calmer_hz().ok()??;
        let calmer = question.at(hz);
        let errors = LoggingErrors::fit(&calmer).ok()??;
        let is_right = errors.directions.iter().all(|direction| direction.passed)
            && !errors.midway.as_ref().is_some_and(Midway::refuses)
            && !errors.encoder.as_ref().is_some_and(|bias| bias.refuses())
            && quality(&calmer, &errors.equations).sound;
        if !is_right {
            return None;
        }
        format!("encoder too coarse at this bandwidth: with `--bandwidth {hz}` the recording is accepted")
    };
    let (joint, share) = bias.largest_share();
    Some(CauseReport {
        name: "encoder_steps",
        joint: Some(joint + 1),
        value: share.into(),
        words,
        ..CauseReport::default()
    })
}

/// A joint, or all, whose angle is in degrees. It spans more than two turns; read as degrees it leaves less
/// than half of the misfit and a plausible leg.
pub(crate) fn in_degrees(question: &Question, errors: &LoggingErrors) -> Option<CauseReport> {
    let here = quality(question, &errors.equations);
    let candidates = angle_units(question).into_iter().chain(unit_pairs(question)).filter(|correction| {
        correction.reads.contains(&ReadAs::Degrees)
            && spans(question, correction.joint, 2.0 * std::f64::consts::TAU)
    });
    let tried = candidates.filter_map(|correction| refit(question, &correction));
    let is_better = |tried: &Tried| tried.quality.sound && tried.quality.remaining() < 0.5 * here.remaining();
    nearest(tried.filter(is_better).collect(), are_close).map(|tried| tried.cause)
}

/// Cause that leaves least of the misfit; of equal ones the simpler, of one name the better.
fn nearest(mut passing: Vec<Tried>, are_equal: impl Fn(&Tried, &Tried) -> bool) -> Option<Tried> {
    let remaining =
        |one: &&Tried, other: &&Tried| one.quality.remaining().total_cmp(&other.quality.remaining());
    let least = passing.iter().min_by(remaining)?.clone();
    passing.retain(|tried| are_equal(&least, tried));
    let name = passing.first()?.cause.name;
    passing.retain(|tried| tried.cause.name == name);
    passing.sort_by(|one, other| one.quality.remaining().total_cmp(&other.quality.remaining()));
    let mut all = passing.into_iter();
    let mut best = all.next()?;
    // The mirrored leg moves alike: one joint's sign, or that of all others.
    let alike = all.take_while(|tried| tried.quality.remaining() <= MIRRORED * best.quality.remaining());
    let joints: Vec<String> = alike.filter_map(|tried| Some(tried.cause.joint?.to_string())).collect();
    if !joints.is_empty() {
        best.cause.words +=
            &format!("; the same correction of joint {} explains it as well", joints.join(" or "));
    }
    if best.is_shared {
        best.cause.joint = None;
    }
    Some(best)
}

/// Saturated stretches whose exclusion leaves too little to judge.
fn excluded(samples: &[SampleFinding]) -> Option<CauseReport> {
    samples.iter().find(|finding| finding.name == SATURATION).map(sample_cause)
}
