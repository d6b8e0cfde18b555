//! Recordings of a leg's motion: time, angle and torque of each joint, read from files and checked.
//!
//! An identification is only as good as its input, and the recording machine is unknown. Nothing is repaired
//! or converted silently. Invalid data are refused with file, line and reason; plausible data pass unchanged
//! ([`resample`](crate::run::resample) makes them uniform).
//!
//! Format: a header, then one row per sample. Columns are found by name, in any order; others are ignored.
//! Other names, units, delimiters and files without a header are read as [`import::Import`] states them.
//!
//! | column | unit | range |
//! | --- | --- | --- |
//! | `t_s` | s, strictly increasing, within +-1e10 s | see below |
//! | `q1_rad`, `q2_rad`, .. | rad, proximal joint first | within +-1000 rad |
//! | `tau1_Nm`, `tau2_Nm`, .. | N m at the joint | within +-100 kN m |
//!
//! The median time step corresponds to at least 10 Hz. No step exceeds 0.1 s or 20 median steps,
//! whichever is longer.
//!
//! Limits: swapped columns, or a command recorded as a measurement, look like valid numbers here; only the
//! fit can detect them. Cost: 16 bytes per joint and sample, and 8 per sample; the text is never held as a
//! whole.

use std::f64::consts::TAU;
use std::io::{self, BufRead as _, Write};
use std::path::{Path, PathBuf};

use scarab_base::error::{FileError, ToolError};
use scarab_base::files::NewFile;

mod chosen;
pub(crate) mod columns;
mod decode;
pub mod dialect;
mod fault;
mod foreign;
pub mod import;
mod lines;
mod merged;
pub(crate) mod signal;
pub(crate) mod source;
pub(crate) mod suggest;

use columns::{LineNumbers, of_text, refuse};
pub use decode::Read;
pub(crate) use fault::Fault;
use foreign::Foreign;
use import::Import;

/// Least number of samples of a recording.
pub(crate) const MINIMUM_SAMPLES: usize = 50;
/// Least duration of a recording, s.
pub(crate) const MINIMUM_DURATION_S: f64 = 1.0;
/// Least median rate, Hz.
pub(crate) const MINIMUM_RATE_HZ: f64 = 10.0;
/// Tolerance on the rate for rounded time stamps.
const RATE_TOLERANCE: f64 = 1.001;
/// Deviation from a whole turn within which a jump of an angle is one, rad, and samples on either side.
const TURN_TOLERANCE_RAD: f64 = 0.5;
const TURN_SAMPLES: usize = 5;
/// Longest step that is not a gap, s.
pub(crate) const LARGEST_STEP_S: f64 = 0.1;
/// Longest step in median steps that is not a gap.
pub(crate) const LARGEST_STEP_IN_MEDIANS: f64 = 20.0;
/// Largest plausible time stamp, s: seconds since 1970 are 2e9, and an f64 still resolves a microsecond
/// there.
pub(crate) const LARGEST_TIME_S: f64 = 1.0e10;
/// Largest plausible angle, rad; larger ones are in another unit.
pub(crate) const LARGEST_POSITION_RAD: f64 = 1.0e3;
/// Largest plausible torque, N m; larger ones are in another unit.
pub(crate) const LARGEST_TORQUE_NM: f64 = 1.0e5;

/// Largest number of samples: eleven hours at 500 Hz, half a gigabyte for two joints.
pub(crate) const MOST_SAMPLES: usize = 20_000_000;
/// Largest share of rows that may be skipped, percent.
pub(crate) const MOST_BAD_PERCENT: usize = 5;

/// Recorded signals of one joint: one entry per sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointSeries {
    /// Angle, rad.
    pub position_rad: Vec<f64>,
    /// Torque at the joint, N m.
    pub torque_nm: Vec<f64>,
}

/// Recorded motion: every list is as long as `time_s`.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Source file.
    pub file: PathBuf,
    /// Time stamps, s, strictly increasing, with the recorder's jitter and offset.
    pub time_s: Vec<f64>,
    /// Joints, proximal first.
    pub joints: Vec<JointSeries>,
    /// Number of joints in the file; more than `joints` if fewer were requested.
    pub joints_in_file: usize,
}

impl Recording {
    /// Reads the joints of `import` from a file.
    ///
    /// # Errors
    /// Names file, line and reason, and where column names are close the complete command.
    pub fn read(file: &Path, import: &Import) -> Result<Read, FileError> {
        if let Some(foreign) = Foreign::detect_folder(file) {
            return foreign.read(file, false, import);
        }
        let mut source = source::open(file)?;
        let begin = source.text.fill_buf().map_err(|error| FileError::unreadable(file, &error))?;
        if let Some(foreign) = Foreign::detect(begin) {
            return foreign.read(file, source.is_gzip, import);
        }
        let packing = if source.is_gzip { ", gzip" } else { "" };
        decode::csv(file, &mut source.text, packing, import)
    }

    /// Checks samples as those of a file are checked: `time_s`, and angles and torques of each joint, all of
    /// one length. `name` stands for the file, and the index of a sample for the line.
    ///
    /// # Errors
    /// Names the sample and the reason.
    pub fn from_samples(name: &Path, time_s: &[f64], joints: &[JointSeries]) -> Result<Read, FileError> {
        decode::samples(name, time_s, joints)
    }

    /// Reads the first `joints` joints of a CSV text; `file` is used only in error messages.
    pub fn parse(file: &Path, text: &str, joints: usize) -> Result<Self, FileError> {
        Ok(Self::parse_as(file, text, &Import::plain(joints))?.recording)
    }

    /// Reads a CSV text as stated.
    pub fn parse_as(file: &Path, text: &str, import: &Import) -> Result<Read, FileError> {
        decode::csv(file, of_text(text), "", import)
    }

    /// Checks everything that concerns more than one row. `advice` names the unit in which the time would be
    /// valid.
    fn check(&self, numbers: &LineNumbers, advice: &str) -> Result<(), FileError> {
        self.check_rate(advice)?;
        self.check_gaps()
            .and_then(|()| self.check_turns())
            .map_err(|(sample, fault)| refuse(&self.file, numbers.line_of(sample), fault))?;
        self.check_length(advice)
    }

    /// Time from the first sample to the last, s.
    pub fn duration_s(&self) -> f64 {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// Median time between two samples, s; zero for fewer than two samples.
    pub(crate) fn median_step_s(&self) -> f64 {
        median_step_s(&self.time_s)
    }

    /// Replaces the time stamps by an even clock from the first to the last.
    pub(crate) fn even_stamps(&mut self) {
        let first = self.time_s.first().copied().unwrap_or(0.0);
        let step = self.duration_s() / (self.time_s.len().max(2) - 1) as f64;
        self.time_s.iter_mut().enumerate().for_each(|(sample, time)| *time = first + step * sample as f64);
    }

    /// Splits at a fraction (0 to 1) of the duration; fails if a part is too short for a recording.
    pub fn split(&self, fraction: f64) -> Result<(Self, Self), FileError> {
        let border = self.time_s.first().copied().unwrap_or(0.0) + fraction * self.duration_s();
        let at = self.time_s.partition_point(|&time| time < border);
        let part = |range: std::ops::Range<usize>| Self {
            file: self.file.clone(),
            time_s: self.time_s[range.clone()].to_vec(),
            joints: self
                .joints
                .iter()
                .map(|joint| JointSeries {
                    position_rad: joint.position_rad[range.clone()].to_vec(),
                    torque_nm: joint.torque_nm[range.clone()].to_vec(),
                })
                .collect(),
            joints_in_file: self.joints_in_file,
        };
        let (first, second) = (part(0..at), part(at..self.time_s.len()));
        first.check_length("; it is the part before --split: choose a larger share")?;
        second.check_length("; it is the part held out for validation (--split): choose a smaller share")?;
        Ok((first, second))
    }

    /// Writes a file in the format of [`Recording::parse`].
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ToolError> {
        let mut out = NewFile::create(path)?;
        self.write(&mut out).map_err(|error| ToolError::cannot_write(path, &error))?;
        out.finish()
    }

    /// Writes the format of [`Recording::parse`] with the digits that restore every number exactly.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "t_s")?;
        (1..=self.joints.len()).try_for_each(|joint| write!(out, ",q{joint}_rad"))?;
        (1..=self.joints.len()).try_for_each(|joint| write!(out, ",tau{joint}_Nm"))?;
        writeln!(out)?;
        for (sample, time) in self.time_s.iter().enumerate() {
            write!(out, "{time}")?;
            self.joints.iter().try_for_each(|joint| write!(out, ",{}", joint.position_rad[sample]))?;
            self.joints.iter().try_for_each(|joint| write!(out, ",{}", joint.torque_nm[sample]))?;
            writeln!(out)?;
        }
        Ok(())
    }

    /// Rejects stamps in another unit before they are put on a grid of seconds, which would take gigabytes.
    fn check_rate(&self, advice: &str) -> Result<(), FileError> {
        let step_s = self.median_step_s();
        if step_s * MINIMUM_RATE_HZ <= RATE_TOLERANCE {
            return Ok(());
        }
        Err(refuse(&self.file, None, Fault::TooSlow { step_s, advice: advice.to_owned() }))
    }

    /// First gap, with the number of the sample after it.
    fn check_gaps(&self) -> Result<(), (usize, Fault)> {
        let limit = LARGEST_STEP_S.max(LARGEST_STEP_IN_MEDIANS * self.median_step_s());
        let step = |sample: usize| self.time_s[sample] - self.time_s[sample - 1];
        match (1..self.time_s.len()).find(|&sample| step(sample) > limit) {
            Some(sample) => Err((sample, Fault::Gap { gap: step(sample), limit })),
            None => Ok(()),
        }
    }

    /// First sample at which an angle jumps by a whole turn and stays there. Isolated samples are outliers.
    fn check_turns(&self) -> Result<(), (usize, Fault)> {
        for (joint, series) in self.joints.iter().enumerate() {
            let angles = &series.position_rad;
            let is_turn =
                |later: f64, earlier: f64| ((later - earlier).abs() - TAU).abs() < TURN_TOLERANCE_RAD;
            let turn = |&sample: &usize| {
                let (before, after) = angles.split_at(sample);
                let mut pairs = after.iter().zip(before.iter().rev()).take(TURN_SAMPLES);
                pairs.all(|(later, earlier)| is_turn(*later, *earlier))
            };
            if let Some(sample) = (1..angles.len()).find(turn) {
                let jump = angles[sample] - angles[sample - 1];
                return Err((sample, Fault::Wrapped { joint: joint + 1, jump }));
            }
        }
        Ok(())
    }

    fn check_length(&self, advice: &str) -> Result<(), FileError> {
        let (samples, duration) = (self.time_s.len(), self.duration_s());
        if samples < MINIMUM_SAMPLES || duration < MINIMUM_DURATION_S {
            let fault = Fault::TooShort { samples, duration, advice: advice.to_owned() };
            return Err(refuse(&self.file, None, fault));
        }
        Ok(())
    }
}

/// Median time between two samples, s; zero for fewer than two samples.
fn median_step_s(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}
