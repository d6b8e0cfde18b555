//! Designs a motion for a leg file, or checks a given one, and reports it.

use std::path::Path;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use scarab::ident::status;
use scarab::model::{PARAMETERS_PER_JOINT, Parameter, Payload};
use scarab::motion::Motion;
use scarab_base::error::{FileError, ToolError};
use scarab_base::number::Number;
use scarab_identify::formats::excitation::{Excitation, Expected, Proved, geometry};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::background::Background;
use scarab_identify::leg::motions::EXCITATION_CYCLES;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_identify::report::excite::{
    ComparedBase, ExciteReport, ExpectedBase, ExpectedParameter, JointReport, RandomMotion, SCHEMA,
};
use scarab_identify::with_leg_size;

use crate::excite::assumption::{Assumption, assumed, with_rotors};
use crate::excite::bench::{Bench, ExciteOptions};
use crate::excite::design::{Candidate, DesignOptions, Goal, SHRINK, candidates, smaller};
use crate::excite::expectation::{Expectation, Rehearsal, rehearse};
use crate::excite::warnings::warnings;

/// Duration of a design, s, and error of each base parameter that its torque covers, percent, by default.
pub const USUAL_DURATION_S: f64 = 22.0;
pub const USUAL_MARGIN_PERCENT: f64 = 20.0;
/// Curves that show for most legs that they have a motion.
const SHORT_SEARCH: u32 = 1800;
/// Curves of the search for the motion with the least torque.
const LEAST_TORQUE_SEARCH: u32 = 6000;
/// Warning about that motion.
const LEAST_TORQUE_WARNING: &str = "the search finds no informative motion within the torque limits: this one needs the least torque \
     over its limit. Raise `torque_limit_nm` or narrow `range_deg` for smaller sigma";

/// Motion with its report.
#[derive(Clone, Debug)]
pub struct Excited {
    /// Motion as written to the file.
    pub motion: Excitation,
    /// Report.
    pub report: ExciteReport,
}

/// Rejects a motion that belongs to another leg, or exceeds the limits of angle, speed,
/// acceleration or torque. The torque includes carried masses.
///
/// # Errors
/// Names the file.
pub fn check(
    leg: &LegFile,
    file: &Path,
    motion: &Excitation,
    carried: &[Payload<f64>],
) -> Result<(), ToolError> {
    with_leg_size!(leg, check_sized(leg, file, motion, carried))
}

/// [`check`], for a leg whose bodies are unknown only of joints and geometry.
///
/// # Errors
/// Names the file.
pub fn check_known(leg: &LegFile, file: &Path, motion: &Excitation) -> Result<(), ToolError> {
    if assumed(leg, Assumption::Best).is_ok() {
        return check(leg, file, motion, &[]);
    }
    fn table<const N: usize, const B: usize>(leg: &LegFile, motion: &Excitation) -> Result<(), String> {
        motion.table::<N>(leg).map(drop)
    }
    with_leg_size!(leg, table(leg, motion)).map_err(|reason| FileError::new(file.display(), reason).into())
}

fn check_sized<const N: usize, const B: usize>(
    leg: &LegFile,
    file: &Path,
    motion: &Excitation,
    carried: &[Payload<f64>],
) -> Result<(), ToolError> {
    // First, because another leg's motion is the most likely mistake.
    motion.table::<N>(leg).map_err(|reason| FileError::new(file.display(), reason))?;
    let none = DesignOptions { duration_s: 0.0, seed: 0, evaluations: 0 };
    let options = ExciteOptions { carried: carried.to_vec(), ..ExciteOptions::plain(none, 0.0) };
    Bench::<N, B>::new(leg, &options)?
        .given(motion)
        .map_err(|reason| FileError::new(file.display(), reason))?;
    Ok(())
}

/// Designs a motion, or checks a given one. If no motion fits, rotor inertias are assumed where none are
/// stated; if none fits then, the one with the least torque is designed.
///
/// # Errors
/// The leg file cannot be used, or no motion fits.
pub fn excite(leg: &LegFile, options: &ExciteOptions) -> Result<Excited, ToolError> {
    with_leg_size!(leg, excite_sized(leg, options))
}

fn excite_sized<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ExciteOptions,
) -> Result<Excited, ToolError> {
    let (mut excited, lines) = first_fitting::<N, B, _>(leg, options.given.is_none(), |leg, goal| {
        excited::<N, B>(leg, options, goal)
    })?;
    excited.report.warnings.extend(lines);
    Ok(excited)
}

/// First success of: the leg as stated, the leg with rotor inertias, the least torque. Adds lines about what
/// is assumed.
fn first_fitting<const N: usize, const B: usize, T>(
    leg: &LegFile,
    designs: bool,
    attempt: impl Fn(&LegFile, Goal) -> Result<T, ToolError>,
) -> Result<(T, Vec<String>), ToolError> {
    let mut failed = match attempt(leg, Goal::Information) {
        Ok(found) => return Ok((found, Vec::new())),
        Err(error) => error,
    };
    let (leg, mut lines) = match with_rotors::<N, B>(leg) {
        Some((with_rotors, lines)) => match attempt(&with_rotors, Goal::Information) {
            Ok(found) => return Ok((found, lines)),
            Err(error) => {
                failed = error;
                (with_rotors, lines)
            }
        },
        None => (leg.clone(), Vec::new()),
    };
    if !designs {
        return Err(failed);
    }
    let found = attempt(&leg, Goal::LeastTorque)?;
    lines.push(LEAST_TORQUE_WARNING.to_owned());
    Ok((found, lines))
}

fn excited<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ExciteOptions,
    goal: Goal,
) -> Result<Excited, ToolError> {
    // First, because another leg's motion is the most likely mistake.
    if let Some((file, given)) = &options.given {
        given.table::<N>(leg).map_err(|reason| FileError::new(file.display(), reason))?;
    }
    let bench = Bench::<N, B>::new(leg, options)?;
    bench.require_noise()?;
    let found = match &options.given {
        Some((file, given)) => {
            vec![bench.given(given).map_err(|reason| FileError::new(file.display(), reason))?]
        }
        None => design(&bench, &options.design, goal)?,
    };
    let mut best: Option<(f64, Candidate<N>, Rehearsal<N, B>)> = None;
    let mut fault = None;
    let rehearsed: Vec<_> = found
        .into_par_iter()
        .map(|candidate| match &options.given {
            Some(_) => rehearse(&bench.leg, &candidate.table).map(|rehearsal| (candidate, rehearsal)),
            None => untouched(&bench, candidate),
        })
        .collect();
    for rehearsed in rehearsed {
        match rehearsed {
            Ok((candidate, rehearsal)) => {
                let information = rehearsal.at_noise(&bench.scorer.noise_nm).log_determinant;
                if best.as_ref().is_none_or(|(most, ..)| information > *most) {
                    best = Some((information, candidate, rehearsal));
                }
            }
            Err(error) => fault = Some(error),
        }
    }
    match (best, fault) {
        (Some((_, candidate, rehearsal)), _) => Ok(bench.excited(options, &candidate, &rehearsal)),
        (None, Some(error)) => Err(error),
        (None, None) => Err(bench.refusal(Vec::new())),
    }
}

/// Whether a motion can be designed for this leg, by a short search: what a design must assume. A refusal is
/// that of [`excite`].
///
/// # Errors
/// The leg file cannot be used, or names the limit that no motion keeps.
pub fn designable(leg: &LegFile) -> Result<Vec<String>, ToolError> {
    with_leg_size!(leg, designable_sized(leg))
}

fn designable_sized<const N: usize, const B: usize>(leg: &LegFile) -> Result<Vec<String>, ToolError> {
    first_fitting::<N, B, _>(leg, true, designed_shortly::<N, B>).map(|((), lines)| lines)
}

fn designed_shortly<const N: usize, const B: usize>(leg: &LegFile, goal: Goal) -> Result<(), ToolError> {
    let design =
        DesignOptions { duration_s: USUAL_DURATION_S, seed: DEFAULT_SEED, evaluations: SHORT_SEARCH };
    let options = ExciteOptions::plain(design, USUAL_MARGIN_PERCENT);
    let bench = Bench::<N, B>::new(leg, &options)?;
    let found = searched(&bench, &options.design, goal, &ProgressBar::hidden())?;
    let rehearsed: Vec<_> =
        found.into_par_iter().map(|candidate| untouched(&bench, candidate).map(drop)).collect();
    rehearsed.into_iter().reduce(Result::or).unwrap_or(Ok(()))
}

/// Shrinks a motion until the monitor never reduces the simulated plant's torque. Friction at a
/// reversal and the position loop add torque that the computed demand does not contain.
fn untouched<const N: usize, const B: usize>(
    bench: &Bench<N, B>,
    mut candidate: Candidate<N>,
) -> Result<(Candidate<N>, Rehearsal<N, B>), ToolError> {
    let (mut obstacles, mut failure) = (Vec::new(), None);
    for step in 0..STEPS {
        match rehearse(&bench.leg, &candidate.table) {
            Ok(rehearsal) if rehearsal.seen.iter().all(|joint| joint.limited_ticks == 0) => {
                return Ok((candidate, rehearsal));
            }
            Ok(rehearsal) => {
                (obstacles, failure) = (rehearsal.reduced.into_iter().flatten().collect(), None);
            }
            Err(error) => failure = Some(error),
        }
        let factor = if step < FINE_STEPS { SHRINK } else { COARSE_SHRINK };
        match smaller(bench, &candidate, factor) {
            Ok(next) => candidate = next,
            Err(obstacle) => {
                obstacles.extend(obstacle);
                break;
            }
        }
    }
    if let Some(failure) = failure {
        return Err(failure);
    }
    let worst = obstacles.into_iter().max_by(|one, other| one.excess().total_cmp(&other.excess()));
    Err(bench.refusal(worst.into_iter().collect()))
}

/// Shrinking steps, and how many of them are fine; the smallest motion has a tenth of the first one's size.
const STEPS: u32 = 18;
const FINE_STEPS: u32 = 12;
/// Factor of the other steps.
const COARSE_SHRINK: f32 = 0.7;

fn design<const N: usize, const B: usize>(
    bench: &Bench<N, B>,
    options: &DesignOptions,
    goal: Goal,
) -> Result<Vec<Candidate<N>>, ToolError> {
    let progress = ProgressBar::new(u64::from(options.evaluations));
    if let Ok(style) =
        ProgressStyle::with_template("{bar:40} {pos}/{len} curves, {elapsed} elapsed, {eta} left")
    {
        progress.set_style(style);
    }
    let found = searched(bench, options, goal, &progress);
    progress.finish_and_clear();
    found
}

fn searched<const N: usize, const B: usize>(
    bench: &Bench<N, B>,
    options: &DesignOptions,
    goal: Goal,
    progress: &ProgressBar,
) -> Result<Vec<Candidate<N>>, ToolError> {
    let options = match goal {
        Goal::Information => *options,
        Goal::LeastTorque => DesignOptions { evaluations: LEAST_TORQUE_SEARCH, ..*options },
    };
    candidates(bench, &options, goal, progress)
}

impl<const N: usize, const B: usize> Bench<N, B> {
    fn excited(
        &self,
        options: &ExciteOptions,
        candidate: &Candidate<N>,
        rehearsal: &Rehearsal<N, B>,
    ) -> Excited {
        let mut motion = Excitation::from_table(&self.leg, &candidate.table);
        let expectation = &rehearsal.at_noise(&rehearsal.noise_nm);
        // All motions are compared at one noise; otherwise the motion with less torque would always win.
        let designed = rehearsal.at_noise(&self.scorer.noise_nm);
        let at_same_noise =
            |(rehearsal, keeps): (Rehearsal<N, B>, bool)| (rehearsal.at_noise(&self.scorer.noise_nm), keeps);
        let random = |cycles| self.random(motion.duration_s(), cycles).map(at_same_noise);
        let (random, quick) = (random(EXCITATION_CYCLES), random(candidate.table.cycles));
        let compared = |random: &Option<(Expectation<N, B>, bool)>| RandomMotion {
            log_determinant: random.as_ref().map(|(random, _)| random.log_determinant).into(),
            keeps_torque_limits: random.as_ref().is_some_and(|(_, keeps)| *keeps),
        };
        let background = &self.context.background;
        let joints: Vec<_> = (0..N).map(|joint| self.joint(candidate, rehearsal, joint)).collect();
        let base: Vec<_> = (0..background.model.base.rank())
            .map(|base| self.base(expectation, &designed, random.as_ref().map(|(random, _)| random), base))
            .collect();
        let parameters = parameters(background, expectation, &base);
        prove(&mut motion, &joints);
        motion.expected = Some(Expected {
            assumed: self.assumed.into(),
            torque_noise_nm: rehearsal.noise_nm.to_vec(),
            base_parameter: base.iter().map(|base| base.expected.clone()).collect(),
        });
        let warnings = warnings(&self.leg, self.noise, &candidate.demand, &joints, &base, &parameters);
        let report = ExciteReport {
            schema: SCHEMA,
            leg: self.leg.name.clone(),
            geometry: geometry(&self.leg),
            assumed: self.assumed,
            seed: options.given.is_none().then_some(options.design.seed),
            torque_noise_percent: self.noise.percent,
            torque_noise_of: self.noise.of,
            margin_percent: options.margin_percent,
            duration_s: motion.duration_s(),
            period_s: candidate.table.period_s.into(),
            cycles: candidate.table.cycles,
            blend_s: candidate.table.blend_s.into(),
            log_determinant: designed.log_determinant.into(),
            random: compared(&random),
            random_same_pace: compared(&quick),
            condition: expectation.condition.into(),
            warnings,
            joints,
            base_parameters: base,
            parameters,
        };
        Excited { motion, report }
    }

    fn joint(&self, candidate: &Candidate<N>, rehearsal: &Rehearsal<N, B>, joint: usize) -> JointReport {
        let (file, demand) = (&self.leg.joints[joint], &candidate.demand[joint]);
        let bounds = Motion::Periodic(candidate.motion).envelope()[joint];
        let anatomy = self.context.anatomy()[joint];
        let ends = [bounds.low.0, bounds.high.0];
        let ends = ends.map(|angle| anatomy.angle_from_chain(f64::from(angle)).to_degrees());
        let torque = [demand.low_nm, demand.high_nm].map(|torque| anatomy.from_chain(torque));
        let sorted = |[one, other]: [f64; 2]| [one.min(other), one.max(other)];
        JointReport {
            name: file.name.clone(),
            angle_deg: sorted(ends),
            range_deg: file.range_deg,
            speed_deg_s: f64::from(bounds.speed.0).to_degrees(),
            speed_limit_deg_s: file.speed_limit_deg_s,
            acceleration_deg_s2: f64::from(bounds.acceleration.0).to_degrees(),
            acceleration_limit_deg_s2: file.acceleration_limit_deg_s2,
            torque_nm: sorted(torque),
            torque_with_margin_nm: demand.largest(),
            torque_limit_nm: self.torque_limit[joint],
            torque_noise_nm: rehearsal.noise_nm[joint],
            lost_share: rehearsal.lost_share[joint],
            simulated: rehearsal.seen[joint],
        }
    }

    fn base(
        &self,
        expectation: &Expectation<N, B>,
        designed: &Expectation<N, B>,
        random: Option<&Expectation<N, B>>,
        base: usize,
    ) -> ComparedBase {
        let background = &self.context.background;
        let unit = background.model.base.independent(base).map_or("", |(_, parameter)| parameter.unit());
        let sigma = expectation.estimate.sigma(base);
        ComparedBase {
            expected: ExpectedBase {
                name: background.base_name(base),
                unit: unit.into(),
                assumed: self.scorer.values[base],
                sigma,
                systematic: sigma.map(|_| expectation.systematic[base]),
            },
            ratio_to_random: random
                .and_then(|random| Some(designed.estimate.sigma(base)? / random.estimate.sigma(base)?))
                .into(),
        }
    }
}

/// Adds to a motion what is proved of its joints.
fn prove(motion: &mut Excitation, joints: &[JointReport]) {
    for (file, report) in motion.joints.iter_mut().zip(joints) {
        file.proved = Some(Proved {
            angle_deg: report.angle_deg.map(millis),
            speed_deg_s: millis(report.speed_deg_s),
            acceleration_deg_s2: millis(report.acceleration_deg_s2),
            torque_nm: millis(report.torque_with_margin_nm),
        });
    }
}

fn millis(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// Fourteen parameters of every joint with the status that the firmware will assign.
fn parameters<const N: usize, const B: usize>(
    background: &Background<N, B>,
    expectation: &Expectation<N, B>,
    base: &[ComparedBase],
) -> Vec<ExpectedParameter> {
    let model = &background.model;
    let mut all = Vec::with_capacity(N * PARAMETERS_PER_JOINT);
    for joint in 0..N {
        for parameter in Parameter::ALL {
            let status = status(model, &expectation.record, &expectation.estimate, joint, parameter);
            let carriers: Vec<usize> = model.base.carriers(joint, parameter).collect();
            let mut grouped_with = Vec::new();
            for terms in carriers.iter().map(|&carrier| model.base.terms(carrier)) {
                for (other, symbol) in (0..N).flat_map(|other| Parameter::ALL.map(|symbol| (other, symbol))) {
                    if terms[other][symbol.index()] != 0.0 && (other, symbol) != (joint, parameter) {
                        grouped_with.push(background.name(other, symbol));
                    }
                }
            }
            grouped_with.sort();
            grouped_with.dedup();
            let alone = matches!(status.name(), "identified" | "weak").then(|| carriers.first()).flatten();
            all.push(ExpectedParameter {
                name: background.name(joint, parameter),
                joint: joint + 1,
                unit: parameter.unit(),
                assumed: background.truth.map(|truth| truth[joint][parameter.index()]).into(),
                status: status.name(),
                sigma: alone
                    .and_then(|&base_index| base.get(base_index)?.expected.sigma)
                    .map_or(Number::UNKNOWN, Number::from),
                grouped_with,
            });
        }
    }
    all
}
