//! Every mode, motion and comparison of `assist`, over all seeds.

use crate::report::assist::{
    AssistReport, AssistRow, BodyMassReport, EnergyReport, InteractionCurve, PeriodicReport, RefusedReport,
    SharesReport, WearerSum,
};
use hal_sim::wearer::description::WearerDescription;
use rayon::prelude::*;
use scarab::assist::energy::BUDGET_J;
use scarab::leg::AssistShares;
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::assist::AssistFile;
use scarab_identify::leg::exercise::{Exercise, hip_and_knee};
use scarab_identify::leg::setup::base_rank;
use scarab_identify::leg::two_bodies::{MuscleTone, TwoBodies};
use scarab_identify::report::SCHEMA;

use super::energy::{energy, limit_cycles};
use super::periodic::periodic;
use super::stability::limits;
use super::subject::{Cuffs, Models, Subject};
use super::trial::{Drives, Trial, trial};

/// Mode of the leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// Cancels weight, friction and a share of the inertia of the empty leg.
    Transparent,
    /// Carries a share of the wearer's weight too.
    Weight,
    /// Gives a share of the wearer's torque of a periodic motion too.
    Periodic,
}

impl Mode {
    /// Name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Transparent => "transparent",
            Self::Weight => "weight",
            Self::Periodic => "periodic",
        }
    }

    /// Shares of this mode, of those that the operator chose.
    pub fn shares(self, chosen: &AssistFile) -> AssistFile {
        match self {
            Self::Transparent => AssistFile { weight: 0.0, periodic: 0.0, ..*chosen },
            Self::Weight => AssistFile { periodic: 0.0, ..*chosen },
            Self::Periodic => AssistFile { weight: 0.0, ..*chosen },
        }
    }
}

/// What to run.
#[derive(Clone, Debug)]
pub struct AssistOptions {
    /// Modes.
    pub modes: Vec<Mode>,
    /// Motions of the wearer.
    pub exercises: Vec<Exercise>,
    /// Shares.
    pub shares: AssistFile,
    /// Cuffs of the wearer.
    pub cuffs: Cuffs,
    /// First and last seed.
    pub seeds: (u64, u64),
    /// Runs that measure the energy given to limp and resisting wearers.
    pub energy_runs: usize,
    /// Drawn exoskeletons that are observed at rest.
    pub drawn_legs: usize,
}

/// Comparisons of one mode and motion; mean squares.
#[derive(Clone, Debug, Default)]
struct Compared {
    off: Option<Trial>,
    gravity_only: Option<Trial>,
    truth: Option<Trial>,
    identified: Trial,
    prior: Option<Trial>,
    without: Trial,
}

/// Results of one seed.
struct SeedResult<const B: usize> {
    subject: Subject<B>,
    /// `None` for a mode that needs a refused model.
    compared: Vec<Option<Compared>>,
    periodic: Vec<PeriodicReport>,
}

/// Runs everything.
///
/// # Errors
/// The leg has no wearer to be taken off, cannot be simulated, or its drive stops.
pub fn study(leg: &LegFile, options: &AssistOptions) -> Result<AssistReport, ToolError> {
    // Before the number of base parameters, whose absence has less telling reasons.
    let _ = TwoBodies::from_leg(leg)?;
    match base_rank(leg) {
        0..=13 => study_sized::<13>(leg, options),
        _ => study_sized::<18>(leg, options),
    }
}

fn study_sized<const B: usize>(leg: &LegFile, options: &AssistOptions) -> Result<AssistReport, ToolError> {
    let bodies = TwoBodies::from_leg(leg)?;
    let (first, last) = options.seeds;
    let results: Vec<Result<SeedResult<B>, RefusedReport>> = (first..=last)
        .into_par_iter()
        .map(|seed| run_seed::<B>(leg, options, seed))
        .collect::<Result<_, ToolError>>()?;
    let mut refused = Vec::new();
    let mut seeds = Vec::new();
    for result in results {
        match result {
            Ok(found) => {
                refused.extend(found.subject.refused.iter().cloned());
                seeds.push(found);
            }
            Err(report) => refused.push(report),
        }
    }
    let rig = options.cuffs.on(&bodies.wearer(MuscleTone::Insisting));
    let (passivity, limit_cycles) = safety(options, &seeds)?;
    let (wearer_sums, body_mass) = wearer_sums(&bodies, &seeds);
    Ok(AssistReport {
        schema: SCHEMA,
        leg: leg.name.clone(),
        seeds: [first, last],
        refused,
        shares: options.modes.iter().map(|mode| shares_report(*mode, &options.shares)).collect(),
        rows: rows(leg, options, &seeds),
        ended: seeds
            .iter()
            .flat_map(|seed| seed.compared.iter().flatten())
            .filter(|found| found.identified.has_ended)
            .count(),
        energy: passivity,
        limit_cycles,
        legs_at_rest: if seeds.is_empty() { 0 } else { options.drawn_legs },
        missed: None,
        faults: 0,
        periodic: seeds.iter().flat_map(|seed| seed.periodic.iter().copied()).collect(),
        wearer_sums,
        body_mass,
        stability: limits(&bodies.exoskeleton, &rig, options.shares.friction)?,
        curves: seeds.first().map_or_else(Vec::new, |seed| curves(leg, options, seed)),
    })
}

/// Energy given to limp and resisting wearers, and legs that oscillate at rest, with the first seed's models.
fn safety<const B: usize>(
    options: &AssistOptions,
    seeds: &[SeedResult<B>],
) -> Result<(EnergyReport, usize), ToolError> {
    let budget_j = f64::from(BUDGET_J);
    let Some(SeedResult { subject, .. }) = seeds.first() else {
        return Ok((EnergyReport { budget_j, worst_j: Number::UNKNOWN, runs: 0, exceeded: 0 }, 0));
    };
    let is_possible = |mode: &&Mode| **mode == Mode::Transparent || subject.worn.is_some();
    let possible = options.modes.iter().filter(is_possible);
    let shares: Vec<_> = possible.map(|mode| mode.shares(&options.shares).shares()).collect();
    let transparent = Mode::Transparent.shares(&options.shares).shares();
    let passivity = energy(subject, &shares, options.energy_runs, budget_j)?;
    Ok((passivity, limit_cycles(subject, transparent, options.drawn_legs)?))
}

fn shares_report(mode: Mode, chosen: &AssistFile) -> SharesReport {
    let AssistFile { friction, inertia, weight, periodic } = mode.shares(chosen);
    SharesReport { mode: mode.name(), friction, inertia, weight, periodic }
}

/// Identifies both models, then runs every mode and motion.
fn run_seed<const B: usize>(
    leg: &LegFile,
    options: &AssistOptions,
    seed: u64,
) -> Result<Result<SeedResult<B>, RefusedReport>, ToolError> {
    let subject = match Subject::<B>::identify(leg, &options.cuffs, seed)? {
        Ok(subject) => subject,
        Err(refused) => return Ok(Err(refused)),
    };
    let rig = options.cuffs.on(&subject.bodies.wearer(MuscleTone::Insisting));
    let cases: Vec<_> = options
        .modes
        .iter()
        .flat_map(|mode| options.exercises.iter().map(|exercise| (*mode, *exercise)))
        .collect();
    let compared = cases
        .into_par_iter()
        .map(|(mode, exercise)| {
            let is_possible = mode == Mode::Transparent || subject.worn.is_some();
            is_possible.then(|| compare(&subject, options, &rig, mode, exercise)).transpose()
        })
        .collect::<Result<_, ToolError>>()?;
    let is_periodic = options.modes.contains(&Mode::Periodic) && subject.worn.is_some();
    let cadences: Vec<f64> = options.exercises.iter().filter_map(|exercise| exercise.cadence_hz()).collect();
    let shares = Mode::Periodic.shares(&options.shares).shares();
    let wearer = options.cuffs.on(&subject.bodies.wearer(MuscleTone::Firm));
    let periodic = cadences
        .into_par_iter()
        .filter(|_| is_periodic)
        .map(|cadence_hz| periodic(&subject, [&rig, &wearer], shares, cadence_hz))
        .collect::<Result<_, ToolError>>()?;
    Ok(Ok(SeedResult { subject, compared, periodic }))
}

/// Runs all comparisons of a mode at one motion of the wearer's leg.
fn compare<const B: usize>(
    subject: &Subject<B>,
    options: &AssistOptions,
    rig: &WearerDescription,
    mode: Mode,
    exercise: Exercise,
) -> Result<Compared, ToolError> {
    let joints = hip_and_knee(&subject.exoskeleton)
        .ok_or_else(|| subject.exoskeleton.error("is not a hip and a knee"))?;
    let motion = exercise.intended(joints, subject.seed);
    let shares = mode.shares(&options.shares);
    let run = |drives: Drives<'_>| trial(subject, rig, motion, drives);
    let of_empty = |shares: &AssistFile, model| run(Drives::AssistEmpty(shares.shares(), model));
    if mode != Mode::Transparent {
        let models = [&subject.empty.identified, &subject.worn()?.identified];
        let identified = run(Drives::Assist(shares.shares(), models))?;
        let without = of_empty(&Mode::Transparent.shares(&shares), &subject.empty.identified)?;
        return Ok(Compared { identified, without, ..Compared::default() });
    }
    let Models { identified, truth, prior, .. } = &subject.empty;
    let off = run(Drives::Off)?;
    Ok(Compared {
        without: off.clone(),
        off: Some(off),
        gravity_only: Some(run(Drives::AssistEmpty(AssistShares::GRAVITY_ONLY, identified))?),
        truth: Some(of_empty(&shares, truth)?),
        identified: of_empty(&shares, identified)?,
        prior: prior.as_ref().map(|prior| of_empty(&shares, prior)).transpose()?,
    })
}

/// Root of the mean over the seeds of a mean square; unknown if a seed has none.
fn pooled<'a>(trials: impl Iterator<Item = Option<&'a Trial>>, value: impl Fn(&Trial) -> f64) -> Number {
    let squares: Option<Vec<f64>> = trials.map(|trial| trial.map(&value)).collect();
    let squares = squares.filter(|squares| !squares.is_empty());
    squares.map(|squares| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()).into()
}

fn rows<const B: usize>(leg: &LegFile, options: &AssistOptions, seeds: &[SeedResult<B>]) -> Vec<AssistRow> {
    let mut rows = Vec::new();
    let mut case = 0;
    for mode in &options.modes {
        for exercise in &options.exercises {
            for (joint, file) in leg.joints.iter().enumerate() {
                let all = || seeds.iter().filter_map(|seed| seed.compared.get(case)?.as_ref());
                let interaction = |trial: &Trial| trial.interaction[joint];
                let muscle = |trial: &Trial| trial.muscle[joint];
                // Fast motions need little torque along their weight: its share would be noise.
                let share = |value: &dyn Fn(&Compared) -> f64| -> Number {
                    let mean = all().map(value).sum::<f64>() / all().count() as f64;
                    let is_slow = matches!(exercise, Exercise::Extension | Exercise::Reaching);
                    if *mode == Mode::Weight && is_slow { mean.into() } else { Number::UNKNOWN }
                };
                rows.push(AssistRow {
                    mode: mode.name(),
                    motion: exercise.name(),
                    joint: file.name.clone(),
                    drives_off_rms_nm: pooled(all().map(|found| found.off.as_ref()), interaction),
                    gravity_only_rms_nm: pooled(all().map(|found| found.gravity_only.as_ref()), interaction),
                    true_model_rms_nm: pooled(all().map(|found| found.truth.as_ref()), interaction),
                    identified_rms_nm: pooled(all().map(|found| Some(&found.identified)), interaction),
                    prior_rms_nm: pooled(all().map(|found| found.prior.as_ref()), interaction),
                    wearer_rms_nm: pooled(all().map(|found| Some(&found.identified)), muscle),
                    wearer_without_rms_nm: pooled(all().map(|found| Some(&found.without)), muscle),
                    wearer_gravity_share: share(&|found| found.identified.gravity_share[joint]),
                    wearer_gravity_share_without: share(&|found| found.without.gravity_share[joint]),
                });
            }
            case += 1;
        }
    }
    rows
}

/// Interaction torque of the first mode over time.
fn curves<const B: usize>(
    leg: &LegFile,
    options: &AssistOptions,
    seed: &SeedResult<B>,
) -> Vec<InteractionCurve> {
    let mut curves = Vec::new();
    for (exercise, found) in options.exercises.iter().zip(&seed.compared) {
        let Some(found) = found else { continue };
        let (Some(off), Some(gravity_only)) = (&found.off, &found.gravity_only) else { continue };
        for (joint, file) in leg.joints.iter().enumerate() {
            let of = |trial: &Trial| trial.curve.iter().map(|(_, torque)| torque[joint]).collect();
            curves.push(InteractionCurve {
                motion: exercise.name(),
                joint: file.name.clone(),
                time_s: off.curve.iter().map(|(time, _)| *time).collect(),
                drives_off_nm: of(off),
                gravity_only_nm: of(gravity_only),
                identified_nm: of(&found.identified),
            });
        }
    }
    curves
}

/// Base sums of a hip and a knee that a wearer changes, with their units.
const SUMS: [(&str, &str); 6] = [
    ("HX1R", "kg m"),
    ("HY1", "kg m"),
    ("ZZ1R", "kg m2"),
    ("HX2", "kg m"),
    ("HY2", "kg m"),
    ("ZZ2", "kg m2"),
];

/// Differences of the two models against anthropometry, and the body mass that fits them best.
fn wearer_sums<const B: usize>(
    bodies: &TwoBodies,
    seeds: &[SeedResult<B>],
) -> (Vec<WearerSum>, Option<BodyMassReport>) {
    let subjects = || seeds.iter().map(|seed| &seed.subject);
    let pairs: Vec<_> =
        subjects().filter_map(|subject| Some((&subject.empty, subject.worn.as_ref()?))).collect();
    let background = subjects().next().map(|subject| &subject.context.background);
    let Some(background) = background.filter(|_| !pairs.is_empty()) else {
        return (Vec::new(), None);
    };
    let count = pairs.len() as f64;
    let (mut sums, mut information, mut score) = (Vec::new(), 0.0, 0.0);
    for (name, unit) in SUMS {
        let rank = background.model.base.rank();
        let Some(base) = (0..rank).find(|base| background.base_name(*base) == name) else { continue };
        let mut differences = Vec::new();
        let (mut variance, mut expected) = (0.0, 0.0);
        for (empty, worn) in &pairs {
            differences.push(f64::from(worn.estimate.values[base] - empty.estimate.values[base]));
            expected = f64::from(worn.true_values[base] - empty.true_values[base]);
            for models in [*empty, *worn] {
                let sigma = models.estimate.sigma(base).map_or(f64::NAN, f64::from);
                variance += sigma * sigma / count;
            }
        }
        let value = differences.iter().sum::<f64>() / count;
        let scatter = differences.iter().map(|difference| (difference - value).powi(2)).sum::<f64>();
        let per_kg = expected / bodies.person.mass;
        if variance > 0.0 {
            information += per_kg * per_kg / variance;
            score += per_kg * value / variance;
        }
        sums.push(WearerSum {
            name,
            unit,
            value: value.into(),
            sigma: variance.sqrt().into(),
            spread: (pairs.len() > 1).then(|| (scatter / (count - 1.0)).sqrt()).into(),
            anthropometry: expected.into(),
        });
    }
    let mass = (information > 0.0).then(|| BodyMassReport {
        kg: score / information,
        sigma_kg: information.sqrt().recip(),
        assumption: "Winter's fractions of body mass and the leg file's lengths",
    });
    (sums, mass)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    fn options(stiffness: f64, damping: f64) -> AssistOptions {
        AssistOptions {
            modes: vec![Mode::Transparent, Mode::Weight],
            exercises: vec![Exercise::Extension],
            shares: AssistFile { friction: 1.0, inertia: 0.5, weight: 0.5, periodic: 0.3 },
            cuffs: Cuffs { stiffness, damping },
            seeds: (1, 1),
            energy_runs: 4,
            drawn_legs: 2,
        }
    }

    fn known(number: Number) -> f64 {
        number.known().expect("measured")
    }

    #[test]
    #[ignore = "campaign: .ci/full"]
    fn an_identified_model_is_as_transparent_as_the_true_one_and_carries_half_the_weight() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let report = study(&leg, &options(20e3, 400.0)).expect("a worn leg");
        assert!(report.failures().is_empty(), "{:?}", report.failures());
        let [transparent, weight] =
            [0, 2].map(|first| report.rows.get(first..first + 2).expect("two joints"));
        for row in transparent {
            let [off, truth, identified] =
                [row.drives_off_rms_nm, row.true_model_rms_nm, row.identified_rms_nm].map(known);
            println!("{}: off {off:.2}, true model {truth:.2}, identified {identified:.2} N m", row.joint);
            assert!(identified < 0.5 * off && identified < truth + 0.1 * off);
        }
        for row in weight {
            let [with, without] = [row.wearer_gravity_share, row.wearer_gravity_share_without].map(known);
            println!("{}: gravity share {without:.2} without support, {with:.2} with half", row.joint);
            assert!((0.4..0.6).contains(&with) && (0.9..1.1).contains(&without));
        }
        assert_eq!(report.wearer_sums.len(), 6);
    }

    #[test]
    fn transparency_needs_no_model_of_the_worn_leg() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        // On soft cuffs the limp limb moves beside the exoskeleton: no rigid leg explains its torque.
        let report = study(&leg, &options(8e3, 80.0)).expect("a worn leg");
        assert_eq!(report.refused.iter().map(|refused| refused.model).collect::<Vec<_>>(), ["worn"]);
        let is_measured = |row: &AssistRow| row.identified_rms_nm.known().is_some();
        let measured: Vec<_> = report.rows.iter().map(|row| (row.mode, is_measured(row))).collect();
        let expected = [("transparent", true), ("weight", false)].map(|case| [case; 2]).concat();
        assert_eq!(measured, expected);
    }
}
