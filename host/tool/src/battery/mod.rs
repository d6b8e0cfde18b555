//! Table of cases by which the verdict of `replay` is judged, with the generators of its inputs.
//!
//! | group | input | truth |
//! | --- | --- | --- |
//! | `damage` | recordings damaged as loggers do it | fit to the undamaged recording |
//! | `logs` | logs of the simulated default leg | the simulated leg |
//! | `recordings` | recordings of real machines | none: the verdict alone is known |
//! | `field` | files found in the field | stated in the row |
//! | `random` | clean random legs | the generated leg |
//! | `faults` | random legs with one random fault | the generated leg |
//!
//! Rows stand in `cases.toml`; a new case is a new row. Cases run in this process by the function that
//! `replay` runs. A case's name, such as `mujoco/delay/0.02/1`, repeats it: `--kind` selects by parts of
//! names.

mod damage;
mod dynamics;
mod judge;
mod matrix;
mod outcome;
mod random;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;
use scarab_base::error::ToolError;
use scarab_identify::{LegFile, Recording};
use scarab_rig::options::SimulationOptions;
use scarab_rig::simulate::simulate;
use serde::Deserialize;

use dynamics::Values;
use judge::{Accept, Expect, Judged};
pub use matrix::Battery;
use outcome::{Outcome, Task};
use random::Sample;

/// Rows of `cases.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rows {
    source: Vec<Row>,
    damage: Vec<Kind>,
    case: Vec<Row>,
    fault: Vec<Kind>,
    truth: BTreeMap<String, Values>,
}

/// Files, options and expectation of one replay.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Row {
    name: String,
    kind: String,
    leg: String,
    /// Paths from the workspace, or from the folder of an environment variable that they begin with.
    files: Vec<String>,
    held_out: Vec<String>,
    options: String,
    /// For damage: joints, and duration to identify from [s].
    joints: usize,
    training_s: f64,
    /// `accept`, `refuse` or `either`.
    expect: String,
    causes: Vec<String>,
    words: Vec<String>,
    joint: Option<usize>,
    truth: String,
}

/// Kind of damage, or of random fault.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Kind {
    kind: String,
    /// Sizes of a damage; least and largest magnitude of a fault.
    sizes: Vec<f64>,
    causes: Vec<String>,
    words: Vec<String>,
    /// Damaged joints: `all` together, `each`, or `both`.
    joints: String,
    least_joints: usize,
    least_training_s: f64,
    /// Whether a fault needs parallel axes.
    parallel: bool,
    /// Reported direction, and its value over the size; a low-pass of f Hz delays by 1 / (2 pi f).
    direction: String,
    factor: Option<f64>,
    /// Whether it is a disturbance that robust identification tolerates.
    must_accept: bool,
    /// Whether the torque does not show which joint it is.
    hides_joint: bool,
}

impl Kind {
    /// Causes that name it at this joint.
    fn expect(&self, joint: Option<usize>) -> Expect {
        let joint = joint.filter(|_| !self.hides_joint);
        Expect { causes: self.causes.clone(), words: self.words.clone(), joint, ..Expect::default() }
    }
}

/// Input of one case with what it demands; made when it runs.
struct Trial {
    task: Task,
    expect: Expect,
    note: String,
}

type Make = Box<dyn Fn() -> Result<Trial, ToolError> + Send + Sync>;

/// One case.
struct Case {
    name: String,
    kind: String,
    make: Make,
}

/// Selection of cases.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Parts of names; all cases if empty.
    pub kinds: Vec<String>,
    /// First seed, and number of seeds, of generated cases.
    pub seed: u64,
    pub count: u64,
}

impl Selection {
    fn holds(&self, name: &str) -> bool {
        let name = format!("/{name}/");
        self.kinds.is_empty() || self.kinds.iter().any(|kind| name.contains(&format!("/{kind}/")))
    }
}

/// Undamaged recordings of a source and what they give.
struct Clean {
    task: Task,
    recordings: Vec<Recording>,
    outcome: Arc<Outcome>,
}

/// Path of a row; `None` if its environment variable is not set.
fn path(text: &str) -> Option<PathBuf> {
    match text.split_once('/') {
        Some((variable, rest)) if variable.starts_with("SCARAB_") => {
            Some(PathBuf::from(std::env::var_os(variable)?).join(rest))
        }
        _ => Some(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(text)),
    }
}

/// Folder or environment variable that the first path begins with.
fn folder(files: &[String]) -> String {
    files.first().and_then(|file| file.split('/').next()).unwrap_or_default().to_owned()
}

impl Row {
    /// Reads the files, or simulates the log of a seed; `None` if a file is missing.
    fn task(&self) -> Option<Task> {
        if let Some(seed) = self.files.first().and_then(|file| file.strip_prefix("seed ")) {
            let leg = LegFile::load(&self.leg).ok()?;
            let run = simulate(&leg, &SimulationOptions::with_seed(seed.parse().ok()?)).ok()?;
            let (leg, _) = LegFile::text(&self.leg).ok()?;
            let empty = Task { leg, options: self.options.clone(), ..Task::default() };
            return Some(Task { training: vec![Default::default()], ..empty }.with(run.recordings.get(..1)?));
        }
        let paths = |files: &[String]| files.iter().map(|file| path(file)).collect::<Option<Vec<_>>>();
        let leg = self.leg.contains('/').then(|| path(&self.leg));
        let leg = leg.flatten().map_or(self.leg.clone(), |path| path.to_string_lossy().into_owned());
        Task::load(&leg, &paths(&self.files)?, &paths(&self.held_out)?, &self.options)
    }

    fn command(&self) -> String {
        let validate = if self.held_out.is_empty() { "" } else { " --validate " };
        let [files, held_out] = [&self.files, &self.held_out].map(|files| files.join(" "));
        format!("replay {files}{validate}{held_out} --leg {} {}", self.leg, self.options)
    }
}

/// All selected cases. Sources and files that are missing are reported in one line each.
fn cases(selection: &Selection) -> Result<Vec<Case>, ToolError> {
    let rows: Rows = outcome::table()?;
    let mut cases = Vec::new();
    let mut missing = BTreeMap::new();
    for source in rows.source {
        let name = |row: &Kind, size: f64, joint: Option<usize>| {
            let joint = joint.map_or("all".into(), |joint| joint.to_string());
            format!("damage/{}/{}/{size}/{joint}", source.name, row.kind)
        };
        let possible = rows
            .damage
            .iter()
            .filter(|row| source.joints >= row.least_joints && source.training_s >= row.least_training_s);
        let mut due = Vec::new();
        for row in possible {
            let mut joints = if row.joints == "each" { Vec::new() } else { vec![None] };
            if row.joints == "each" || (row.joints == "both" && source.joints > 1) {
                joints.extend((1..=source.joints).map(Some));
            }
            for size in &row.sizes {
                due.extend(joints.iter().map(|joint| (row.clone(), *size, *joint)));
            }
        }
        due.retain(|(row, size, joint)| selection.holds(&name(row, *size, *joint)));
        if due.is_empty() {
            continue;
        }
        let Some(task) = source.task() else {
            *missing.entry(folder(&source.files)).or_insert(0) += due.len();
            continue;
        };
        let clean = Arc::new(Clean { recordings: task.recordings()?, outcome: Arc::new(task.run()), task });
        for (row, size, joint) in due {
            let clean = Arc::clone(&clean);
            let (name, kind) = (name(&row, size, joint), row.kind.clone());
            let joints = source.joints;
            let make: Make = Box::new(move || damaged(&clean, &row, size, joint, joints));
            cases.push(Case { name, kind, make });
        }
    }
    for row in rows.case.into_iter().filter(|row| selection.holds(&row.name)) {
        let is_found = row.files.iter().all(|file| path(file).is_some_and(|path| path.exists()));
        if !is_found {
            *missing.entry(folder(&row.files)).or_insert(0) += 1;
            continue;
        }
        let truth = rows.truth.get(&row.truth).cloned().unwrap_or_default();
        let group = row.name.split('/').next().unwrap_or_default();
        let (name, kind) = (row.name.clone(), format!("{group}: {}", row.kind));
        cases.push(Case { name, kind, make: Box::new(move || stated(&row, &truth)) });
    }
    for seed in selection.seed..selection.seed.saturating_add(selection.count) {
        let mut add = |name: String, kind: &str, make: Make| {
            if selection.holds(&name) {
                cases.push(Case { name, kind: kind.into(), make });
            }
        };
        add(format!("logs/{seed}"), "logs", Box::new(move || log(seed)));
        add(format!("random/{seed}"), "random", Box::new(move || clean_random(seed)));
        let fault = rows.fault[seed as usize % rows.fault.len()].clone();
        add(
            format!("faults/{}/{seed}", fault.kind),
            &format!("fault: {}", fault.kind),
            Box::new(move || faulty(&fault, seed)),
        );
    }
    for (file, count) in missing {
        eprintln!("skipped: {count} cases, files of {file} are missing");
    }
    Ok(cases)
}

/// A source's recordings with one damage.
fn damaged(
    clean: &Clean,
    row: &Kind,
    size: f64,
    joint: Option<usize>,
    joints: usize,
) -> Result<Trial, ToolError> {
    let damaged: Vec<usize> = joint.map_or((0..joints).collect(), |joint| vec![joint - 1]);
    let mut task = clean.task.clone();
    if row.kind == "gravity" {
        let mut leg = LegFile::parse(&task.leg, "leg")?;
        let before = format!("{:?}", leg.gravity);
        damage::turn_gravity(&mut leg.gravity, size);
        task.leg = task.leg.replace(&before, &format!("{:?}", leg.gravity));
        if task.leg == clean.task.leg {
            return Err(ToolError::input(format!("the leg file does not state its gravity as {before}")));
        }
    } else {
        let mut recordings = clean.recordings.clone();
        if !damage::apply(&row.kind, &mut recordings, size, &damaged) {
            return Err(ToolError::input(format!("{}: not a kind of damage", row.kind)));
        }
        task = task.with(&recordings);
    }
    let value = match row.kind.as_str() {
        "low_pass" => 1.0 / (std::f64::consts::TAU * size),
        _ => size * row.factor.unwrap_or(1.0),
    };
    // Gravity, and a ratio of torques, are reported for one joint or for none.
    let is_of_all = row.kind == "gravity" || row.hides_joint;
    let touched = if is_of_all { vec![None] } else { damaged.iter().map(|joint| Some(joint + 1)).collect() };
    let touched = touched.into_iter().filter(|_| !row.direction.is_empty());
    let injected = touched.map(|joint| (row.direction.clone(), joint, value)).collect();
    let expect = Expect {
        accept: Accept::Clean { clean: Arc::clone(&clean.outcome), injected },
        refuses: !row.must_accept,
        names: true,
        ..row.expect(joint)
    };
    Ok(Trial { task, expect, note: String::new() })
}

/// A case whose files and expectation its row states.
fn stated(row: &Row, truth: &Values) -> Result<Trial, ToolError> {
    let task =
        row.task().ok_or_else(|| ToolError::input(format!("{}: cannot be read", row.files.join(", "))))?;
    let expect = Expect {
        accept: if row.expect == "refuse" { Accept::Never } else { Accept::Near(truth.clone()) },
        refuses: row.expect != "accept",
        names: !row.causes.is_empty() || !row.words.is_empty(),
        causes: row.causes.clone(),
        words: row.words.clone(),
        joint: row.joint,
    };
    Ok(Trial { task, expect, note: row.command() })
}

/// The expectation of clean data.
fn accepted(truth: Values) -> Expect {
    Expect { accept: Accept::Near(truth), ..Expect::default() }
}

fn log(seed: u64) -> Result<Trial, ToolError> {
    let leg = scarab_identify::formats::leg_file::DEFAULT_LEG;
    let options = "--split 0.7 --bandwidth 8".to_owned();
    let row = Row { leg: leg.into(), files: vec![format!("seed {seed}")], options, ..Row::default() };
    let task = row.task().ok_or_else(|| ToolError::input(format!("{leg}: cannot be simulated")))?;
    Ok(Trial { task, expect: accepted(dynamics::truth(&LegFile::load(leg)?)), note: row.command() })
}

fn clean_random(seed: u64) -> Result<Trial, ToolError> {
    let sample = Sample::new(seed, 1, false)?;
    Ok(Trial { task: sample.task(), expect: accepted(sample.truth), note: sample.fault })
}

fn faulty(row: &Kind, seed: u64) -> Result<Trial, ToolError> {
    let mut sample = Sample::new(seed, row.least_joints, row.parallel)?;
    sample.inject(&row.kind, &row.sizes, seed);
    let (task, note, joint) = (sample.task(), sample.fault.clone(), sample.joint);
    let due = row.expect(joint);
    let injected = due.causes.iter().map(|cause| (cause.clone(), due.joint, sample.size)).collect();
    let accept = Accept::Torque { sample: Box::new(sample), injected };
    let expect = Expect { accept, refuses: true, ..due };
    Ok(Trial { task, expect, note })
}

impl Case {
    fn run(&self, out: Option<&Path>) -> Judged {
        let judged = (self.make)().and_then(|trial| {
            let judged = trial.expect.judge(&trial.task.run());
            if let Some(folder) = out.filter(|_| judged.miss.is_some()) {
                trial.task.save(&folder.join(&self.name))?;
            }
            Ok(Judged { note: trial.note, ..judged })
        });
        let judged = judged.unwrap_or_else(|error| Judged {
            miss: Some(error.to_string()),
            ..accepted(Values::new())
                .judge(&Outcome { verdict: outcome::Verdict::BadInput, ..Outcome::default() })
        });
        Judged { name: self.name.clone(), kind: self.kind.clone(), ..judged }
    }
}

/// Names of the selected cases.
///
/// # Errors
/// The table cannot be read, or a recording of a source is invalid.
pub fn list(selection: &Selection) -> Result<String, ToolError> {
    Ok(cases(selection)?.iter().map(|case| format!("{}\n", case.name)).collect())
}

/// Runs and judges the selected cases, in parallel. `out` is a folder for the files of cases that miss.
///
/// # Errors
/// The table cannot be read, or a recording of a source is invalid.
pub fn run(selection: &Selection, out: Option<&Path>) -> Result<Battery, ToolError> {
    let cases = cases(selection)?;
    if cases.is_empty() {
        return Err(ToolError::input("no case has such a name, or its files are missing: see --list"));
    }
    Ok(Battery::new(cases.par_iter().map(|case| case.run(out)).collect()))
}

#[cfg(test)]
mod tests {
    use super::{Rows, Sample, damage, outcome};

    #[test]
    fn every_row_of_the_table_changes_what_it_says() {
        let rows: Rows = outcome::table().expect("a table");
        for row in &rows.damage {
            let files = &mut [damage::tests::recording()];
            assert!(row.kind == "gravity" || damage::apply(&row.kind, files, 0.1, &[0]), "{}", row.kind);
        }
        for row in rows.source.iter().chain(&rows.case) {
            assert!(row.truth.is_empty() || rows.truth.contains_key(&row.truth), "{}: truth", row.name);
            assert!(["", "accept", "refuse", "either"].contains(&row.expect.as_str()), "{}", row.name);
        }
        for row in &rows.fault {
            let clean = Sample::new(1, row.least_joints, row.parallel).expect("a leg");
            let mut sample = clean.clone();
            sample.inject(&row.kind, &row.sizes, 1);
            assert!(clean.files() != sample.files(), "{}", row.kind);
        }
    }
}
