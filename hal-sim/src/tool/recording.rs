//! Recordings of a leg's motion: time, angle and torque of each joint, read from CSV or refused with a reason.
//!
//! A recording comes from a machine nobody here has seen, and an identification is only as good as its input. So
//! nothing is repaired silently: whatever cannot be a measurement of a leg is refused, naming file, line and
//! reason, and what may be one is passed on untouched ([`resample`](super::resample) makes it uniform).
//!
//! Format: a header, then one row per sample. Columns are found by name, in any order; others are ignored.
//!
//! | column | unit | range |
//! | --- | --- | --- |
//! | `t_s` | s, strictly increasing, within +-1e10 s | at least 10 Hz by the median step; a step of at most 0.1 s or 20 median steps, whichever is longer |
//! | `q1_rad`, `q2_rad`, .. | rad, proximal joint first | within +-1000 rad |
//! | `tau1_Nm`, `tau2_Nm`, .. | N m at the joint | within +-100 kN m |
//!
//! Limits: columns that were swapped, or a command recorded as if it were measured, look like any other numbers
//! here; only the fit can tell. Cost: 16 bytes per joint and sample and 16 per sample.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use csv::StringRecord;

pub(super) mod columns;
mod fault;

use columns::{Column, for_each_row, line_at, read_text, refuse};
pub use fault::{Fault, RecordingError};

/// A recording has at least this many samples...
pub const MINIMUM_SAMPLES: usize = 50;
/// ...over at least this time, s.
pub const MINIMUM_DURATION_S: f64 = 1.0;
/// Half of the steps in time are at most one over this long, Hz.
pub const MINIMUM_RATE_HZ: f64 = 10.0;
/// Rounded stamps may make a recording that much slower than it is.
const RATE_TOLERANCE: f64 = 1.001;
/// A step in time up to this long is never a gap, s.
pub const LARGEST_STEP_S: f64 = 0.1;
/// A step in time of up to this many median steps is never a gap either.
pub const LARGEST_STEP_IN_MEDIANS: f64 = 20.0;
/// A stamp beyond this is in another unit, s: seconds since 1970 are 2e9, and a microsecond can still be told there.
pub const LARGEST_TIME_S: f64 = 1.0e10;
/// An angle beyond this is in another unit, rad.
pub const LARGEST_POSITION_RAD: f64 = 1.0e3;
/// A torque beyond this is in another unit, N m.
pub const LARGEST_TORQUE_NM: f64 = 1.0e5;

/// What one joint did: one entry per sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointSeries {
    /// Angle, rad.
    pub position_rad: Vec<f64>,
    /// Torque at the joint, N m.
    pub torque_nm: Vec<f64>,
}

/// A motion as it was recorded: every list is as long as `time_s`.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Where it came from.
    pub file: PathBuf,
    /// Time stamps, s, strictly increasing, with whatever jitter and offset the recorder had.
    pub time_s: Vec<f64>,
    /// Proximal first.
    pub joints: Vec<JointSeries>,
    /// How many joints the file holds; more than `joints` when fewer were asked for.
    pub joints_in_file: usize,
}

impl Recording {
    /// Reads the first `joints` joints of a CSV file.
    pub fn read(file: &Path, joints: usize) -> Result<Self, RecordingError> {
        Self::parse(file, &read_text(file)?, joints)
    }

    /// Reads the first `joints` joints of a CSV text; `file` is only named in errors.
    pub fn parse(file: &Path, text: &str, joints: usize) -> Result<Self, RecordingError> {
        let mut recording = Self {
            file: file.to_owned(),
            time_s: Vec::new(),
            joints: vec![JointSeries::default(); joints],
            joints_in_file: 0,
        };
        let mut joints_in_file = 0;
        let offsets = for_each_row(
            file,
            text,
            |header| {
                let found = Columns::find(header, joints)?;
                joints_in_file = found.joints_in_file;
                Ok(found)
            },
            |columns, row| recording.push(columns, row),
        )?;
        recording.joints_in_file = joints_in_file;
        recording.check_rate()?;
        recording.check_gaps().map_err(|(sample, fault)| {
            let line = offsets.get(sample).map(|&offset| line_at(text, offset));
            refuse(file, line, fault)
        })?;
        recording.check_length()?;
        Ok(recording)
    }

    /// From the first sample to the last, s.
    pub fn duration_s(&self) -> f64 {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// The median distance of two samples, s; zero for fewer than two samples.
    pub fn median_step_s(&self) -> f64 {
        let mut steps: Vec<f64> = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(0.0)
    }

    /// Splits at a fraction (0 to 1) of the duration; refused where a part is too short to be a recording.
    pub fn split(&self, fraction: f64) -> Result<(Self, Self), RecordingError> {
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
        first.check_length()?;
        second.check_length()?;
        Ok((first, second))
    }

    /// Writes the format that [`Recording::parse`] reads, every number with the digits that restore it exactly.
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

    fn push(&mut self, columns: &Columns, row: &StringRecord) -> Result<(), Fault> {
        let time = columns.time.number(row, LARGEST_TIME_S)?;
        if let Some(&previous) = self.time_s.last()
            && time <= previous
        {
            return Err(Fault::TimeNotIncreasing { previous, time });
        }
        self.time_s.push(time);
        for (joint, (position, torque)) in self.joints.iter_mut().zip(&columns.joints) {
            joint.position_rad.push(position.number(row, LARGEST_POSITION_RAD)?);
            joint.torque_nm.push(torque.number(row, LARGEST_TORQUE_NM)?);
        }
        Ok(())
    }

    /// Refuses stamps that are in another unit before they are put on a grid of seconds, which would take gigabytes.
    fn check_rate(&self) -> Result<(), RecordingError> {
        let step_s = self.median_step_s();
        if step_s * MINIMUM_RATE_HZ <= RATE_TOLERANCE {
            return Ok(());
        }
        let counts = self.time_s.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
        Err(refuse(&self.file, None, Fault::TooSlow { step_s, counts }))
    }

    /// The first gap, with the number of the sample after it.
    fn check_gaps(&self) -> Result<(), (usize, Fault)> {
        let limit = LARGEST_STEP_S.max(LARGEST_STEP_IN_MEDIANS * self.median_step_s());
        let step = |sample: usize| self.time_s[sample] - self.time_s[sample - 1];
        match (1..self.time_s.len()).find(|&sample| step(sample) > limit) {
            Some(sample) => Err((sample, Fault::Gap { gap: step(sample), limit })),
            None => Ok(()),
        }
    }

    fn check_length(&self) -> Result<(), RecordingError> {
        let (samples, duration) = (self.time_s.len(), self.duration_s());
        if samples < MINIMUM_SAMPLES || duration < MINIMUM_DURATION_S {
            return Err(refuse(&self.file, None, Fault::TooShort { samples, duration }));
        }
        Ok(())
    }
}

/// Where everything that is read stands in a row.
struct Columns {
    time: Column,
    /// Angle and torque of each joint.
    joints: Vec<(Column, Column)>,
    joints_in_file: usize,
}

impl Columns {
    fn find(header: &StringRecord, joints: usize) -> Result<Self, Fault> {
        let pair = |joint: usize| -> Result<(Column, Column), Fault> {
            let position = Column::find(header, format!("q{joint}_rad"))?;
            Ok((position, Column::find(header, format!("tau{joint}_Nm"))?))
        };
        Ok(Self {
            time: Column::find(header, "t_s".to_owned())?,
            joints: (1..=joints).map(pair).collect::<Result<_, _>>()?,
            joints_in_file: (1..=header.len()).take_while(|&joint| pair(joint).is_ok()).count(),
        })
    }
}
