//! Most likely cause of a refusal, from fits repeated with one error corrected.
//!
//! ```text
//! remaining     misfit of the refit over the torque, root mean square over the joints; of a sum of torques
//!               over the torques that were not added
//! plausible     no parameter that must be positive is below zero by more than 5 sigma;
//!               torque of the prior's sign and size
//! ```
//!
//! Ranking: findings about samples first, then the plausible correction that leaves least of the misfit.
//! Where the uncorrected fit is not plausible, a correction must make it so. Otherwise the correction must
//! halve the misfit's power, or be a direction that refuses. Another clock, no weight and absolute angles
//! must explain half of the misfit in any case. Another leg is named only where a link's length or a zero is
//! significant, and off by no more than its linear estimate can tell.

use scarab::ident::Test;
use scarab::model::AnatomicalJoint;
use scarab::real::dot;

use crate::report::doubt::{CauseReport, DirectionReport, ReadAs, SampleFinding};
use crate::report::findings::{FindingReport, is_small};
use crate::run::logging_errors::assumption;
use crate::run::logging_errors::directions::{CHANCE, Directions, Found, label};
use crate::run::logging_errors::fit::segment_sigma;
use crate::run::logging_errors::lag;
use crate::run::logging_errors::midway::Midway;
use crate::run::logging_errors::rows::{Equations, Motion};
use crate::run::logging_errors::samples::SATURATION;
use crate::run::logging_errors::table::Table;
use crate::run::logging_errors::{
    LoggingErrors, Question, Refitted, joint_words, midway_words, sample_cause,
};

/// Sigma by which a parameter may be negative.
const NEGATIVE_SIGMA: f64 = 5.0;
/// Ratio of a joint's torque to the prior's, beyond which its unit is wrong.
const PLAUSIBLE_RATIO: f64 = 30.0;
/// Part of the misfit that a correction may leave where the uncorrected fit is plausible.
const HALVED: f64 = 0.7;
/// Share of the misfit from which an error is named although its size lies beyond the search.
const BEYOND: f64 = 0.3;
/// Part of the misfit's power that another assumption may leave.
const HALF: f64 = 0.5;
/// Significance of a direction that is named where no other cause is found.
const WEAKER: f64 = 3.0;
/// Misfits closer than this ratio count as equal: the simpler correction is named.
const EQUAL: f64 = 1.1;
/// Misfit over the torque up to which one correction may be all that is wrong.
const SMALL_MISFIT: f64 = 0.2;
/// Misfits closer than this ratio are those of mirrored legs.
const MIRRORED: f64 = 1.001;

/// Scale between joints, percent, from which a torque is not in mN m.
const OTHER_SCALE_PERCENT: f64 = 40.0;
/// Share of its largest value at which a torque counts as zero, and how often one without sign returns there.
const NEAR_ZERO: f64 = 0.02;
const LEAST_RETURNS: usize = 3;
/// Cause: a drive between other links than the model has it.
const COUPLED_DRIVE: &str = "coupled_drive";

/// Change of the angles and torques of one instant.
type Change = Box<dyn Fn(&mut [f64], &mut [f64])>;

/// A correction of the samples: angles and torques of one instant, anatomical.
struct Correction {
    name: &'static str,
    joint: Option<usize>,
    words: String,
    reads: Vec<ReadAs>,
    apply: Change,
}

/// Quality of a fit.
#[derive(Clone, Copy, Debug)]
struct Quality {
    remaining: f64,
    sound: bool,
}

/// A corrected error with its fit.
struct Tried {
    cause: CauseReport,
    quality: Quality,
    /// Whether the same error of another joint cannot be distinguished.
    is_shared: bool,
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
    let power = power(&errors.equations);
    let here = quality(question, &errors.equations, &power);
    let corrections = corrections(question);
    let mut tried: Vec<_> =
        corrections.iter().filter_map(|correction| refit(question, correction, &power)).collect();
    // Before the delays, because a low-pass is tried only where it fits clearly better than a delay.
    let lags = lag::all(&errors.equations).into_iter().filter(|lag| lag.significance > CHANCE);
    tried.extend(lags.map(|lag| of_refitted(question, errors, lag.refitted, here)));
    for (found, report) in errors.found.iter().zip(&errors.directions) {
        let is_estimate = !found.at_limit || found.explained() > BEYOND;
        let certain = found.significance() > CHANCE && is_estimate && (!report.passed || !here.sound);
        if certain {
            tried.push(of_direction(question, errors, found, report, here));
        }
    }
    let assumptions = assumption::all(&errors.equations, &question.zero());
    let assumptions = assumptions.into_iter().filter(|other| other.remaining < HALF);
    tried.extend(assumptions.map(|other| of_refitted(question, errors, other, here)));
    let midway = errors.midway.as_ref().filter(|midway| midway.refuses());
    tried.extend(midway.map(|midway| changed_midway(midway, here)));
    tried.extend(unit_pairs(question).iter().filter_map(|pair| refit(question, pair, &power)));
    let refused: Vec<bool> = tried.iter().map(|tried| is_refusing(errors, &tried.cause)).collect();
    let passing = tried.into_iter().zip(refused).filter(|(tried, refused)| {
        tried.quality.sound && (!here.sound || *refused || tried.quality.remaining < HALVED * here.remaining)
    });
    let best = nearest(passing.map(|(tried, _)| tried).collect());
    let geometry = findings.iter().find(|finding| {
        let tests = [Test::LinkLength, Test::EncoderZero];
        !finding.passed && tests.iter().any(|test| test.name() == finding.test)
    });
    let is_estimate =
        |finding: &&FindingReport| finding.value.known().is_some_and(|value| is_small(finding.test, value));
    match (best, geometry) {
        (Some(best), _) => beyond_unit(question, best),
        // Whatever looks like a large error of geometry is none that is known.
        (None, Some(finding)) if !is_estimate(&finding) => excluded(samples).unwrap_or_else(unknown),
        (None, Some(finding)) => CauseReport {
            name: "other_leg",
            joint: finding.joint,
            value: finding.value,
            words: finding.words.clone(),
            ..CauseReport::default()
        },
        (None, None) => unsigned(question)
            .or_else(|| weaker(question, errors, here))
            .or_else(|| excluded(samples))
            .unwrap_or_else(unknown),
    }
}

/// A torque that comes back to zero again and again and never crosses it, as a magnitude does.
fn unsigned(question: &Question) -> Option<CauseReport> {
    let joint = (0..question.joints()).find(|&joint| {
        let torques: Vec<f64> =
            question.motions.iter().flat_map(|motion| motion.torque.column(joint)).collect();
        let [low, high] = [f64::min, f64::max].map(|of| torques.iter().copied().fold(0.0, of));
        // Resampling swings over at a corner.
        let zero = NEAR_ZERO * (high - low);
        let near: Vec<bool> = torques.iter().map(|torque| torque.abs() < zero).collect();
        let returns = near.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        (low > -zero || high < zero) && returns >= LEAST_RETURNS
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

/// A torque in mN m whose scales then differ between the joints is in another unit: a motor's own.
fn beyond_unit(question: &Question, cause: CauseReport) -> CauseReport {
    if cause.reads != [ReadAs::MillinewtonMetres] {
        return cause;
    }
    let correction = millinewton_metres();
    let motions = question.motions.iter().map(|motion| corrected(question, motion, &correction)).collect();
    let smaller = Question {
        motions,
        noise: question.noise.iter().map(|density| Some((*density)? / 1e6)).collect(),
        sigma: question.sigma.iter().map(|sigma| sigma / 1e3).collect(),
        ..question.clone()
    };
    let errors = LoggingErrors::fit(&smaller).ok().flatten();
    let mut other = errors.iter().flat_map(|errors| &errors.directions);
    let is_other = |found: &&DirectionReport| {
        found.name == "torque_scale"
            && !found.passed
            && found.value.known().is_some_and(|size| size.abs() > OTHER_SCALE_PERCENT)
    };
    let Some(scale) = other.find(is_other) else {
        return cause;
    };
    CauseReport {
        words: format!(
            "is the torque in per mille of each motor's rated torque (CiA 402, object 6077)? Read in mN m, {}",
            scale.words()
        ),
        reads: Vec::new(),
        ..cause
    }
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
            && quality(&calmer, &errors.equations, &power(&errors.equations)).sound;
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
    let power = power(&errors.equations);
    let here = quality(question, &errors.equations, &power);
    let candidates = angle_units(question).into_iter().chain(unit_pairs(question)).filter(|correction| {
        correction.reads.contains(&ReadAs::Degrees)
            && spans(question, correction.joint, 2.0 * std::f64::consts::TAU)
    });
    let tried = candidates.filter_map(|correction| refit(question, &correction, &power));
    nearest(
        tried.filter(|tried| tried.quality.sound && tried.quality.remaining < 0.5 * here.remaining).collect(),
    )
}

/// Cause that leaves least of the misfit; of nearly equal ones the simpler, of one name the better.
fn nearest(mut passing: Vec<Tried>) -> Option<CauseReport> {
    let least = passing.iter().map(|tried| tried.quality.remaining).fold(f64::INFINITY, f64::min);
    passing.retain(|tried| tried.quality.remaining <= EQUAL * least);
    let name = passing.first()?.cause.name;
    passing.retain(|tried| tried.cause.name == name);
    passing.sort_by(|one, other| one.quality.remaining.total_cmp(&other.quality.remaining));
    let mut all = passing.into_iter();
    let mut best = all.next()?;
    // The mirrored leg moves alike: one joint's sign, or that of all others.
    let alike = all.take_while(|tried| tried.quality.remaining <= MIRRORED * best.quality.remaining);
    let joints: Vec<String> = alike.filter_map(|tried| Some(tried.cause.joint?.to_string())).collect();
    if !joints.is_empty() {
        best.cause.words +=
            &format!("; the same correction of joint {} explains it as well", joints.join(" or "));
    }
    if best.is_shared {
        best.cause.joint = None;
    }
    Some(best.cause)
}

/// Direction that is not significant enough to refuse by itself, named after another refusal.
fn weaker(question: &Question, errors: &LoggingErrors, here: Quality) -> Option<CauseReport> {
    let pairs = errors.found.iter().zip(&errors.directions);
    let likely = pairs.filter(|(found, report)| {
        found.significance() > WEAKER
            && !found.at_limit
            && found.explained() > 0.3 * report.explained_limit.known().unwrap_or(1.0)
    });
    let tried = likely.map(|(found, report)| of_direction(question, errors, found, report, here));
    nearest(tried.filter(|tried| tried.quality.sound).collect())
}

/// Saturated stretches whose exclusion leaves too little to judge.
fn excluded(samples: &[SampleFinding]) -> Option<CauseReport> {
    samples.iter().find(|finding| finding.name == SATURATION).map(sample_cause)
}

fn unknown() -> CauseReport {
    CauseReport {
        name: "unknown",
        words: "no correction of units and no single one of signs, columns, delay, scale, gravity, spring or drift makes the \
                recording acceptable"
            .into(),
        ..CauseReport::default()
    }
}

fn is_refusing(errors: &LoggingErrors, cause: &CauseReport) -> bool {
    // A low-pass, or a delay of all joints, belongs to the delays that refused.
    let is_lag = cause.name == "torque_filter" || (cause.name == "delay" && cause.joint.is_none());
    cause.name == "changed_midway"
        || errors.directions.iter().filter(|report| !report.passed).any(|report| {
            (is_lag && report.name == "delay") || (report.name == cause.name && report.joint == cause.joint)
        })
}

fn of_refitted(question: &Question, errors: &LoggingErrors, other: Refitted, here: Quality) -> Tried {
    let sigma: Vec<f64> = errors.sigma.iter().map(|sigma| sigma.noise.max(sigma.segments)).collect();
    let sound = is_sound(question, &other.values, &sigma)
        && agrees(question, &errors.equations, &other.columns, &other.torque);
    let remaining = here.remaining * other.remaining.sqrt();
    Tried { cause: other.cause, quality: Quality { remaining, sound }, is_shared: false }
}

fn of_direction(
    question: &Question,
    errors: &LoggingErrors,
    found: &Found,
    report: &DirectionReport,
    here: Quality,
) -> Tried {
    let remaining = here.remaining * (1.0 - found.explained()).max(0.0).sqrt();
    let sigma: Vec<f64> = errors.sigma.iter().map(|sigma| sigma.noise.max(sigma.segments)).collect();
    let directions = Directions { equations: &errors.equations, zero: question.zero(), axis: question.axis };
    let (columns, torque) = directions.system(found.kind, found.value);
    let sound =
        is_sound(question, &found.values, &sigma) && agrees(question, &errors.equations, &columns, &torque);
    let mut cause = CauseReport::direction(found.kind, report);
    if !found.alike.is_empty() {
        cause.words = format!(
            "{} ({} cannot be distinguished from {})",
            cause.words,
            label(found.kind),
            found.alike.join(", ")
        );
    }
    let is_shared = found.alike.iter().any(|other| other.starts_with(found.kind.name()));
    Tried { cause, quality: Quality { remaining, sound }, is_shared }
}

fn changed_midway(midway: &Midway, here: Quality) -> Tried {
    let cause = CauseReport {
        name: "changed_midway",
        joint: midway.joint.map(|joint| joint + 1),
        value: midway.change.into(),
        sigma: midway.sigma.into(),
        words: midway_words(midway),
        ..CauseReport::default()
    };
    let remaining = here.remaining * (1.0 - midway.explained).max(0.0).sqrt();
    Tried { cause, quality: Quality { remaining, sound: true }, is_shared: false }
}

/// Equations with all angles in one other unit, for each unit that is possible.
pub(crate) fn with_other_angles(question: &Question) -> Vec<(ReadAs, Equations)> {
    let of_all = angle_units(question).into_iter().filter(|correction| correction.joint.is_none());
    of_all
        .filter_map(|correction| {
            let motions: Vec<Motion> =
                question.motions.iter().map(|motion| corrected(question, motion, &correction)).collect();
            Some((*correction.reads.first()?, question.equations(&motions).ok().flatten()?))
        })
        .collect()
}

/// Fit of the corrected motions; `None` with too few rows. `uncorrected` is the power of the torques before.
fn refit(question: &Question, correction: &Correction, uncorrected: &[f64]) -> Option<Tried> {
    let motions: Vec<Motion> =
        question.motions.iter().map(|motion| corrected(question, motion, correction)).collect();
    let equations = question.equations(&motions).ok().flatten()?;
    // A sum of torques is larger than each; in N m it must leave less.
    let power = if correction.name == COUPLED_DRIVE { uncorrected.to_vec() } else { power(&equations) };
    let quality = quality(question, &equations, &power);
    let words = format!(
        "{}; then the misfit is {:.1} % of the torque{}",
        correction.words,
        100.0 * quality.remaining,
        if quality.remaining < SMALL_MISFIT {
            " and no inertia or friction is negative"
        } else {
            ": there is another error"
        }
    );
    let cause = CauseReport {
        name: correction.name,
        joint: correction.joint.map(|joint| joint + 1),
        words,
        reads: correction.reads.clone(),
        ..CauseReport::default()
    };
    Some(Tried { cause, quality, is_shared: false })
}

/// Whether the angle of a joint, or of each, spans more than this, rad.
fn spans(question: &Question, joint: Option<usize>, least: f64) -> bool {
    (0..question.joints()).filter(|at| joint.is_none_or(|joint| joint == *at)).all(|at| {
        let angles = || question.motions.iter().flat_map(|motion| motion.position.column(at));
        angles().fold(f64::MIN, f64::max) - angles().fold(f64::MAX, f64::min) > least
    })
}

fn corrected(question: &Question, motion: &Motion, correction: &Correction) -> Motion {
    let anatomy = &question.anatomy;
    let mut motion = motion.clone();
    let each = |values: &mut [f64], of: fn(&AnatomicalJoint<f64>, f64) -> f64| {
        values.iter_mut().zip(anatomy).for_each(|(value, joint)| *value = of(joint, *value));
    };
    for (angles, torques) in motion.position.rows_mut().zip(motion.torque.rows_mut()) {
        each(angles, |joint, angle| joint.angle_from_chain(angle));
        each(torques, |joint, torque| joint.from_chain(torque));
        (correction.apply)(angles, torques);
        each(angles, |joint, angle| joint.angle_to_chain(angle));
        each(torques, |joint, torque| joint.to_chain(torque));
    }
    motion
}

/// All joints, then each where there are several.
fn subjects(joints: usize) -> impl Iterator<Item = Option<usize>> {
    std::iter::once(None).chain((0..joints).filter(move |_| joints > 1).map(Some))
}

/// Torque in mN m.
fn millinewton_metres() -> Correction {
    Correction {
        name: "torque_unit",
        joint: None,
        words: "torque divided by 1000: is it in mN m?".into(),
        reads: vec![ReadAs::MillinewtonMetres],
        apply: Box::new(|_, torques| torques.iter_mut().for_each(|torque| *torque /= 1000.0)),
    }
}

/// Corrections of the angles' unit: degrees that span more than a turn in rad, turns of the joint that span
/// less, and angles of the motor where its gear ratio is stated.
fn angle_units(question: &Question) -> Vec<Correction> {
    use std::f64::consts::TAU;
    let mut all = Vec::new();
    let joints = question.joints();
    let mut add = |joint: Option<usize>, reads: ReadAs, unit: &str, mut factors: Vec<f64>| {
        let others = factors.iter_mut().enumerate().filter(|(at, _)| joint.is_some_and(|joint| joint != *at));
        others.for_each(|(_, factor)| *factor = 1.0);
        all.push(Correction {
            name: "angle_unit",
            joint,
            words: format!("angle of {} read as {unit}", joint_words(joint)),
            reads: vec![reads],
            apply: Box::new(move |angles, _| {
                angles.iter_mut().zip(&factors).for_each(|(angle, factor)| *angle *= factor);
            }),
        });
    };
    let degree = TAU / 360.0;
    for joint in subjects(joints).filter(|joint| spans(question, *joint, TAU)) {
        add(joint, ReadAs::Degrees, "degrees", vec![degree; joints]);
    }
    if !spans(question, None, TAU) {
        add(None, ReadAs::Turns, "turns", vec![TAU; joints]);
    }
    let ratios: Option<Vec<f64>> = question.motor_ratio.iter().copied().collect();
    if let Some(ratios) = ratios {
        let of_motor = |unit: f64| ratios.iter().map(|ratio| unit / ratio).collect();
        add(None, ReadAs::MotorRadians, "angle of the motor in rad", of_motor(1.0));
        add(None, ReadAs::MotorDegrees, "angle of the motor in degrees", of_motor(degree));
        add(None, ReadAs::MotorTurns, "turns of the motor", of_motor(TAU));
    }
    all
}

/// Corrections of angle and torque at once.
fn unit_pairs(question: &Question) -> Vec<Correction> {
    let pair = |angle: Correction| {
        let torque = millinewton_metres();
        Correction {
            name: "units",
            joint: angle.joint,
            words: format!("{}, and {}", angle.words, torque.words),
            reads: [angle.reads, torque.reads].concat(),
            apply: Box::new(move |angles: &mut [f64], torques: &mut [f64]| {
                (angle.apply)(angles, torques);
                (torque.apply)(angles, torques);
            }) as Change,
        }
    };
    angle_units(question).into_iter().map(pair).collect()
}

/// All single corrections of units, signs and columns; the simpler first.
fn corrections(question: &Question) -> Vec<Correction> {
    let chosen = |joint: Option<usize>, at: usize| joint.is_none_or(|joint| joint == at);
    let joints = question.joints();
    let mut all = vec![millinewton_metres()];
    for joint in subjects(joints) {
        all.push(Correction {
            name: "torque_sign",
            joint,
            words: format!("torque of {} negated", joint_words(joint)),
            reads: Vec::new(),
            apply: Box::new(move |_, torques| {
                let each = torques.iter_mut().enumerate();
                each.filter(|(at, _)| chosen(joint, *at)).for_each(|(_, torque)| *torque = -*torque);
            }),
        });
    }
    all.extend(angle_units(question));
    for one in 0..joints {
        for other in one + 1..joints {
            for (what, of_angles, of_torques) in [
                ("torques of joints", false, true),
                ("angles of joints", true, false),
                ("joints", true, true),
            ] {
                all.push(Correction {
                    name: "joints_swapped",
                    joint: None,
                    words: format!("{what} {} and {} exchanged", one + 1, other + 1),
                    reads: Vec::new(),
                    apply: Box::new(move |angles, torques| {
                        if of_angles {
                            angles.swap(one, other);
                        }
                        if of_torques {
                            torques.swap(one, other);
                        }
                    }),
                });
            }
        }
    }
    for joint in 1..joints {
        for (sign, word) in [(1.0, "plus"), (-1.0, "minus")] {
            all.push(Correction {
                name: COUPLED_DRIVE,
                joint: Some(joint),
                words: format!(
                    "torque of joint {joint} {word} that of joint {}: does the drive of joint {} sit before joint {joint}?",
                    joint + 1,
                    joint + 1
                ),
                reads: Vec::new(),
                apply: Box::new(move |_, torques| torques[joint - 1] += sign * torques[joint]),
            });
        }
    }
    for joint in (0..joints).filter(|_| joints > 1) {
        all.push(Correction {
            name: "angle_sign",
            joint: Some(joint),
            words: format!("angle of joint {} negated", joint + 1),
            reads: Vec::new(),
            apply: Box::new(move |angles, _| angles[joint] = -angles[joint]),
        });
        all.push(Correction {
            name: "direction",
            joint: Some(joint),
            words: format!("angle and torque of joint {} with the other sign", joint + 1),
            reads: Vec::new(),
            apply: Box::new(move |angles, torques| {
                angles[joint] = -angles[joint];
                torques[joint] = -torques[joint];
            }),
        });
    }
    all
}

/// Mean square torque of each joint.
fn power(equations: &Equations) -> Vec<f64> {
    let of_joint = |joint: usize| {
        let torques = equations.sources.iter().zip(&equations.torque);
        let of: Vec<f64> =
            torques.filter(|(source, _)| source.joint == joint).map(|(_, torque)| torque * torque).collect();
        of.iter().sum::<f64>() / of.len().max(1) as f64
    };
    (0..equations.joints()).map(of_joint).collect()
}

fn quality(question: &Question, equations: &Equations, power: &[f64]) -> Quality {
    let fit = equations.fit(&equations.columns, &equations.torque, false);
    let Equations { columns, torque, weight, .. } = equations;
    let scatter = segment_sigma(&fit, columns, torque, weight, &equations.clusters());
    let sigma: Vec<f64> = scatter
        .iter()
        .enumerate()
        .map(|(base, scatter)| fit.inverse[base][base].max(0.0).sqrt().max(*scatter))
        .collect();
    let joints = equations.joints();
    let shares = (0..joints)
        .map(|joint| equations.row_sigma[joint].powi(2) * equations.information() / power[joint].max(1e-300));
    Quality {
        remaining: (shares.sum::<f64>() / joints as f64).sqrt(),
        sound: is_sound(question, &fit.values, &sigma)
            && agrees(question, equations, &equations.columns, &equations.torque),
    }
}

/// Whether every parameter that must be positive is so within 5 sigma.
fn is_sound(question: &Question, values: &[f64], sigma: &[f64]) -> bool {
    (0..values.len()).filter(|&base| question.active[base]).all(|base| {
        let bounded = question.regressor.carrier(base).is_some_and(|(_, kind)| kind.is_never_negative());
        !bounded || values[base] > -NEGATIVE_SIGMA * sigma[base]
    })
}

/// Whether the torque has the sign and size of the prior's; without a prior, at most thrice the joint's
/// limit.
fn agrees(question: &Question, equations: &Equations, columns: &Table, torque: &[f64]) -> bool {
    let rows = || equations.sources.iter().zip(torque).zip(columns.rows());
    let Some(prior) = &question.prior else {
        return rows().all(|((source, torque), _)| torque.abs() < 3.0 * question.torque_limit[source.joint]);
    };
    let zeros = || vec![0.0; equations.joints()];
    let (mut along, mut measured, mut expected) = (0.0, zeros(), zeros());
    for ((source, torque), row) in rows() {
        let guess = dot(row, prior);
        along += guess * torque;
        measured[source.joint] += torque * torque;
        expected[source.joint] += guess * guess;
    }
    along > 0.0
        && measured.iter().zip(expected).all(|(measured, expected)| {
            let ratio = (measured / expected.max(1e-300)).sqrt();
            (1.0 / PLAUSIBLE_RATIO..PLAUSIBLE_RATIO).contains(&ratio)
        })
}
