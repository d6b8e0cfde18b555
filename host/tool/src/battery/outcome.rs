//! A replay in memory, and what its JSON report says.

use std::path::{Path, PathBuf};

use scarab_base::error::{FileError, ToolError};
use scarab_base::{files, toml_file};
use scarab_identify::{Import, LegFile, Recording, Recordings, ReplayOptions, replay};
use serde::Deserialize;
use serde_json::Value;

use crate::battery::dynamics::Values;

/// Files and options of one replay.
#[derive(Clone, Debug, Default)]
pub(super) struct Task {
    /// Text of the leg file.
    pub(super) leg: String,
    /// Name and text of each recording to identify from.
    pub(super) training: Vec<(PathBuf, String)>,
    /// Recordings held out.
    pub(super) held_out: Vec<(PathBuf, String)>,
    /// Options of `replay`, as on its command line.
    pub(super) options: String,
}

/// Verdict, in the order of the matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Verdict {
    #[default]
    Accepted,
    Misfit,
    Refused,
    BadInput,
}

/// What one replay found.
#[derive(Clone, Debug, Default)]
pub(super) struct Outcome {
    pub(super) verdict: Verdict,
    pub(super) found: Found,
    /// Message of bad input, and all warnings.
    pub(super) words: String,
}

/// The part of the report that the battery judges.
#[derive(Clone, Debug, Default, Deserialize)]
pub(super) struct Found {
    pub(super) reasons: Vec<String>,
    pub(super) likely_cause: Option<Cause>,
    pub(super) base_parameters: Vec<Base>,
    #[serde(default)]
    pub(super) directions: Vec<Direction>,
    #[serde(default)]
    pub(super) findings: Vec<Finding>,
}

/// One test of the verdict.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Finding {
    pub(super) passed: bool,
    pub(super) words: String,
}

/// A named cause, and others that explain the misfit as well.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Cause {
    pub(super) name: String,
    pub(super) joint: Option<usize>,
    #[serde(default)]
    pub(super) possible: Vec<Value>,
}

/// One base parameter.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Base {
    pub(super) name: String,
    pub(super) terms: Values,
    pub(super) value: Option<f64>,
    pub(super) sigma: Option<f64>,
}

/// One estimated error of the logging chain.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Direction {
    pub(super) name: String,
    pub(super) joint: Option<usize>,
    pub(super) sigma: Option<f64>,
    pub(super) unit: String,
}

impl Base {
    /// Value and sigma, if the data determine the parameter.
    pub(super) fn estimate(&self) -> Option<(f64, f64)> {
        Some((self.value?, self.sigma?))
    }

    /// True value from base parameters or from those of the links.
    pub(super) fn truth(&self, truth: &Values) -> Option<f64> {
        let sum = || self.terms.iter().map(|(name, factor)| Some(factor * truth.get(name)?)).sum();
        truth.get(&self.name).copied().or_else(sum)
    }
}

impl Outcome {
    pub(super) fn is_accepted(&self) -> bool {
        matches!(self.verdict, Verdict::Accepted | Verdict::Misfit)
    }

    /// Errors over sigma with their parameters, the largest first.
    pub(super) fn errors(&self, truth: &Values) -> Vec<(f64, &str)> {
        let error = |base: &Base| {
            let ((value, sigma), truth) = (base.estimate()?, base.truth(truth)?);
            Some((value - truth).abs() / sigma)
        };
        let bases = self.found.base_parameters.iter();
        let mut errors: Vec<_> = bases.filter_map(|base| Some((error(base)?, base.name.as_str()))).collect();
        errors.sort_by(|one, other| other.0.total_cmp(&one.0));
        errors
    }
}

impl Task {
    /// Task of files on disk; `None` where one is missing.
    pub(super) fn load(leg: &str, training: &[PathBuf], held_out: &[PathBuf], options: &str) -> Option<Self> {
        let read = |paths: &[PathBuf]| {
            let text = |path: &PathBuf| Some((path.clone(), files::read_text(path).ok()?));
            paths.iter().map(text).collect::<Option<Vec<_>>>()
        };
        let (leg, _) = LegFile::text(leg).ok()?;
        Some(Self { leg, training: read(training)?, held_out: read(held_out)?, options: options.into() })
    }

    /// Recordings of the documented format, training first.
    pub(super) fn recordings(&self) -> Result<Vec<Recording>, ToolError> {
        let joints = LegFile::parse(&self.leg, "leg")?.joints.len();
        let all = self.training.iter().chain(&self.held_out);
        Ok(all.map(|(name, text)| Recording::parse(name, text, joints)).collect::<Result<_, FileError>>()?)
    }

    /// The task with other recordings.
    pub(super) fn with(&self, recordings: &[Recording]) -> Self {
        let text = |recording: &Recording| {
            let mut text = Vec::new();
            // Writing into memory does not fail.
            recording.write(&mut text).ok();
            (recording.file.clone(), String::from_utf8_lossy(&text).into_owned())
        };
        let (training, held_out) = recordings.split_at(self.training.len().min(recordings.len()));
        let [training, held_out] = [training, held_out].map(|part| part.iter().map(text).collect());
        Self { training, held_out, ..self.clone() }
    }

    /// Writes leg and recordings for `replay` into a folder.
    pub(super) fn save(&self, folder: &Path) -> Result<(), ToolError> {
        files::write(&folder.join("leg.toml"), &self.leg)?;
        for (number, (_, text)) in self.training.iter().chain(&self.held_out).enumerate() {
            files::write(&folder.join(format!("{number}.csv")), text)?;
        }
        Ok(())
    }

    /// Identifies and judges as `scarab replay` does.
    pub(super) fn run(&self) -> Outcome {
        self.replayed().unwrap_or_else(|error| Outcome {
            verdict: Verdict::BadInput,
            words: error.to_string(),
            ..Outcome::default()
        })
    }

    fn replayed(&self) -> Result<Outcome, ToolError> {
        let leg = &LegFile::parse(&self.leg, "leg")?;
        let (options, import) = self.stated(leg)?;
        let read = |files: &[(PathBuf, String)]| {
            let each = files.iter().map(|(name, text)| Recording::parse_as(Path::new(name), text, &import));
            each.collect::<Result<Vec<_>, _>>()
        };
        let recordings = Recordings {
            training: read(&self.training)?,
            held_out: read(&self.held_out)?,
            ..Recordings::default()
        };
        let replayed = replay(leg, &recordings, &options)?;
        let report =
            serde_json::to_value(&replayed.run).map_err(|error| ToolError::input(error.to_string()))?;
        let verdict = match report["verdict"].as_str() {
            Some("accepted") => Verdict::Accepted,
            Some("accepted_with_misfit") => Verdict::Misfit,
            _ => Verdict::Refused,
        };
        let found = Found::deserialize(report).map_err(|error| ToolError::input(error.to_string()))?;
        Ok(Outcome { verdict, found, words: replayed.warnings.join("; ") })
    }

    /// Options of the command line, and how the files are read.
    fn stated(&self, leg: &LegFile) -> Result<(ReplayOptions, Import), ToolError> {
        let mut import = Import::from_leg(leg, &self.leg);
        let mut options = ReplayOptions { import: Some(import.clone()), ..ReplayOptions::from_leg(leg) };
        let mut columns = Vec::new();
        let mut words = self.options.split_whitespace();
        while let Some(word) = words.next() {
            let mut value = || words.next().unwrap_or_default();
            let number =
                |text: &str| text.parse().map_err(|_| ToolError::input(format!("{word} {text}: no number")));
            match word {
                "--split" => options.split = Some(number(value())?),
                "--accept-error" => options.accept_error_percent = number(value())?,
                "--even-stamps" => (options.even_stamps, import.even_stamps) = (true, true),
                "--merge-rows" => import.merge_rows = true,
                "--rate" => import.rate_hz = Some(number(value())?),
                "--skip-bad" => import.skip_bad = true,
                "--bandwidth" => match value() {
                    "auto" => options.chooses_bandwidth = true,
                    hertz => options.bandwidth_hz = number(hertz)?,
                },
                "--columns" => {
                    let parsed: Result<_, _> = value().split(',').map(str::parse).collect();
                    columns = parsed.map_err(ToolError::input)?;
                }
                _ => return Err(ToolError::input(format!("{word}: not an option of the battery"))),
            }
        }
        let import = import.with(&columns, &[]).map_err(ToolError::input)?;
        options.import = Some(import.clone());
        Ok((options, import))
    }
}

/// Rows of `cases.toml`, checked by its test.
pub(super) fn table<T: serde::de::DeserializeOwned>() -> Result<T, FileError> {
    toml_file::parse(include_str!("cases.toml"), "cases.toml")
}
