//! Rows of a file become samples of a recording: conversion, checks, and the rows that are skipped.

use std::io::BufRead;
use std::mem::{Discriminant, discriminant};
use std::path::Path;

use csv::StringRecord;
use scarab_base::error::FileError;

use crate::formats::recording::chosen::{Chosen, Names, choose};
use crate::formats::recording::columns::{LineNumbers, Rows, peeked, refuse};
use crate::formats::recording::dialect::{Decimal, Dialect, LOOKED_AT, first_rows};
use crate::formats::recording::fault::{Fault, rounded};
use crate::formats::recording::import::{ColumnName, Import};
use crate::formats::recording::merged::{check_scattered, joined};
use crate::formats::recording::signal::{Quantity, Signal, Unit};
use crate::formats::recording::suggest::{Reading, command, documented};
use crate::formats::recording::{
    JointSeries, MINIMUM_DURATION_S, MINIMUM_RATE_HZ, MOST_BAD_PERCENT, MOST_SAMPLES, Recording,
    median_step_s,
};
use crate::report::reading::{ARRAYS, ReadReport, SkippedReport};

/// Rate above which the unit of the time is in doubt, Hz.
pub(crate) const LARGEST_RATE_HZ: f64 = 5e4;

/// Recording with its provenance.
#[derive(Clone, Debug)]
pub struct Read {
    pub recording: Recording,
    pub report: ReadReport,
}

/// Takes rows and checks them.
pub(crate) struct Decoder<'a> {
    file: &'a Path,
    import: &'a Import,
    columns: Vec<Chosen>,
    recording: Recording,
    /// Line of every sample.
    numbers: LineNumbers,
    skipped: Skipped,
    /// Rows so far.
    rows: usize,
    /// First row with its line and time, where that time is out of range: the next row shows its unit.
    suspect: Option<(usize, f64)>,
    /// Values of the current row.
    values: Vec<f64>,
}

impl<'a> Decoder<'a> {
    /// Chooses the columns by their names.
    pub fn new(file: &'a Path, names: &Names, import: &'a Import) -> Result<Self, Fault> {
        let (columns, joints_in_file) = choose(names, import)?;
        let joints = import.drives.len();
        let recording = Recording {
            file: file.to_owned(),
            time_s: Vec::new(),
            joints: vec![JointSeries::default(); joints],
            joints_in_file,
        };
        let (numbers, skipped, values) = (LineNumbers::default(), Skipped::default(), Vec::new());
        Ok(Self { file, import, columns, recording, numbers, skipped, rows: 0, suspect: None, values })
    }

    /// Indices of the chosen columns, in the order in which [`Decoder::take`] asks for their numbers.
    #[cfg(feature = "readers")]
    pub(crate) fn indices(&self) -> Vec<usize> {
        self.columns.iter().map(|chosen| chosen.column.index).collect()
    }

    /// Takes one row, whose numbers `number` reads; `line` is where it stands.
    ///
    /// # Errors
    /// The row is invalid and not skipped.
    pub(crate) fn take(
        &mut self,
        line: usize,
        number: impl FnMut(&Chosen) -> Result<f64, Fault>,
    ) -> Result<(), FileError> {
        self.rows += 1;
        match self.push(number) {
            Ok(()) => {
                self.settle(None)?;
                self.numbers.push(line);
                Ok(())
            }
            Err(Fault::Absurd { column, value, limit, .. }) if self.is_time(&column) => {
                let is_first = self.recording.time_s.is_empty() && self.skipped.rows == 0;
                if is_first && self.suspect.is_none() {
                    self.suspect = Some((line, value));
                    return Ok(());
                }
                self.settle(Some(value))?;
                let advice = self.time_advice(&self.recording.time_s);
                self.skip_taken(line, Fault::Absurd { column, value, limit, advice })
            }
            Err(fault) => {
                self.settle(None)?;
                self.skip_taken(line, fault)
            }
        }
    }

    /// Reports the first row's time that was out of range; `next` is the next row's, if it is so too.
    fn settle(&mut self, next: Option<f64>) -> Result<(), FileError> {
        let Some((line, value)) = self.suspect.take() else { return Ok(()) };
        let time = &self.columns[0];
        let advice = next.map_or(String::new(), |next| self.time_advice(&[time.si(value), time.si(next)]));
        let (column, limit) = (time.column.name.clone(), time.largest());
        self.skip_taken(line, Fault::Absurd { column, value, limit, advice })
    }

    fn is_time(&self, column: &str) -> bool {
        self.columns.first().is_some_and(|first| first.signal == Signal::Time && first.column.name == column)
    }

    /// Advice on the unit of these times, s.
    fn time_advice(&self, time_s: &[f64]) -> String {
        other_time_unit(time_s, self.import, self.columns.iter().map(Chosen::reading).collect())
    }

    /// Skips a row with this fault, if that is requested.
    ///
    /// # Errors
    /// The fault, where rows are not skipped.
    pub(crate) fn skip(&mut self, line: usize, fault: Fault) -> Result<(), FileError> {
        self.rows += 1;
        self.skip_taken(line, fault)
    }

    fn skip_taken(&mut self, line: usize, fault: Fault) -> Result<(), FileError> {
        if !self.import.skip_bad || !fault.is_of_row() || fault.is_of_unit() {
            // A fault of the first row is rather one of all rows.
            let is_damage = fault.is_of_row()
                && !fault.is_of_unit()
                && !matches!(fault, Fault::Repeated)
                && !self.recording.time_s.is_empty();
            let fault = if is_damage { Fault::Skippable(Box::new(fault)) } else { fault };
            return Err(refuse(self.file, Some(line), fault));
        }
        self.skipped.add(line, &fault);
        Ok(())
    }

    fn push(&mut self, mut number: impl FnMut(&Chosen) -> Result<f64, Fault>) -> Result<(), Fault> {
        if self.recording.time_s.len() >= MOST_SAMPLES {
            return Err(Fault::TooManySamples);
        }
        self.values.clear();
        self.values.extend(self.import.rate_hz.map(|rate| (self.rows - 1) as f64 / rate));
        let mut same_time = None;
        for column in &self.columns {
            let value = column.value(number(column)?)?;
            self.values.push(value);
            // Time comes first: its fault is reported before those of other columns.
            if let ([time], Some(&previous)) = (&self.values[..], self.recording.time_s.last())
                && *time <= previous
            {
                same_time = Some(*time).filter(|time| *time == previous);
                if same_time.is_none() {
                    return Err(Fault::TimeNotIncreasing { previous, time: *time });
                }
            }
        }
        if let Some(time) = same_time.filter(|_| !self.import.even_stamps) {
            let is_repeated =
                self.recording.joints.iter().zip(self.values[1..].chunks_exact(2)).all(|(joint, pair)| {
                    joint.position_rad.last() == pair.first() && joint.torque_nm.last() == pair.last()
                });
            let fault = Fault::TimeNotIncreasing { previous: time, time };
            return Err(if is_repeated { Fault::Repeated } else { fault });
        }
        self.recording.time_s.push(self.values[0]);
        for (joint, pair) in self.recording.joints.iter_mut().zip(self.values[1..].chunks_exact(2)) {
            joint.position_rad.push(pair[0]);
            joint.torque_nm.push(pair[1]);
        }
        Ok(())
    }

    /// Checks the whole recording.
    pub(crate) fn finish(mut self, format: String, header: bool) -> Result<Read, FileError> {
        self.settle(None)?;
        let advice = self.time_advice(&self.recording.time_s);
        let Self { file, import, columns, mut recording, numbers, skipped, .. } = self;
        let invalid = skipped.rows - skipped.repeated;
        let rows = recording.time_s.len() + invalid;
        if invalid * 100 > rows * MOST_BAD_PERCENT {
            let first = skipped
                .kinds
                .first()
                .map_or(String::new(), |(_, first)| format!("line {}: {}", first.line, first.reason));
            return Err(refuse(file, None, Fault::TooManyBad { skipped: invalid, rows, first }));
        }
        if import.even_stamps {
            recording.even_stamps();
        }
        recording.check(&numbers, &advice)?;
        let report = ReadReport {
            file: file.display().to_string(),
            format,
            header,
            samples: recording.time_s.len(),
            columns: columns.iter().map(Chosen::report).collect(),
            skipped: skipped.rows,
            skipped_why: skipped.kinds.into_iter().map(|(_, why)| why).collect(),
            warning: None,
        };
        Ok(Read { recording, report })
    }
}

/// Advice where these times are a recording in another unit only, else nothing. Two times show a rate, but no
/// duration.
fn other_time_unit(time_s: &[f64], import: &Import, mut readings: Vec<Reading>) -> String {
    let Some(time) = readings.iter_mut().find(|reading| reading.signal == Signal::Time) else {
        return String::new();
    };
    let (step_s, duration_s) =
        (median_step_s(time_s), time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0));
    let is_pair = time_s.len() == 2;
    let is_valid = |unit: &Unit| {
        let factor = unit.factor() / time.unit.factor();
        let rate = 1.0 / (factor * step_s);
        (MINIMUM_RATE_HZ..=LARGEST_RATE_HZ).contains(&rate)
            && (is_pair || factor * duration_s >= MINIMUM_DURATION_S)
    };
    if is_valid(&time.unit) {
        return String::new();
    }
    let Some(unit) = Unit::for_quantity(Quantity::Time).find(is_valid) else { return String::new() };
    let factor = unit.factor() / time.unit.factor();
    let rate = rounded(1.0 / (factor * step_s));
    let over = if is_pair { String::new() } else { format!(" over {} s", rounded(factor * duration_s)) };
    let counts = time_s.windows(2).all(|pair| pair[1] - pair[0] == 1.0);
    let or_numbers = if counts { " or sample numbers" } else { "" };
    time.unit = unit;
    format!(
        ": is the time in {}{or_numbers}? Then it would be {rate} Hz{over}. If so, repeat the command with it:\n  {}",
        unit.name,
        command(import, &readings)
    )
}

/// Skipped rows by kind of fault, with the first of each.
#[derive(Default)]
struct Skipped {
    rows: usize,
    /// Rows among them that repeat another.
    repeated: usize,
    kinds: Vec<(Discriminant<Fault>, SkippedReport)>,
}

impl Skipped {
    fn add(&mut self, line: usize, fault: &Fault) {
        self.rows += 1;
        self.repeated += usize::from(matches!(fault, Fault::Repeated));
        let kind = discriminant(fault);
        match self.kinds.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, why)) => why.rows += 1,
            None => {
                let reason = fault.to_string();
                self.kinds.push((kind, SkippedReport { line, reason, rows: 1 }));
            }
        }
    }
}

/// Checks samples that a program holds.
pub(crate) fn samples(name: &Path, time_s: &[f64], joints: &[JointSeries]) -> Result<Read, FileError> {
    let import = Import::plain(joints.len());
    let columns = documented(joints.len()).map(|signal| signal.column(signal.quantity().si())).collect();
    let names = Names { names: columns, units: Vec::new(), are_stated: true };
    let mut decoder = Decoder::new(name, &names, &import).map_err(|fault| refuse(name, None, fault))?;
    let series: Vec<&[f64]> = std::iter::once(time_s)
        .chain(joints.iter().flat_map(|joint| [&joint.position_rad[..], &joint.torque_nm[..]]))
        .collect();
    for sample in 0..time_s.len() {
        decoder.take(sample, |chosen| chosen.column.finite(series[chosen.column.index][sample]))?;
    }
    decoder.finish(ARRAYS.to_owned(), true)
}

/// Reads a CSV text.
pub(crate) fn csv(
    file: &Path,
    source: impl BufRead,
    packing: &str,
    import: &Import,
) -> Result<Read, FileError> {
    let unreadable = |error: std::io::Error| refuse(file, None, Fault::Unreadable(error.to_string()));
    let (begin, source) = peeked(source, LOOKED_AT).map_err(unreadable)?;
    if begin.starts_with(&[0xFF, 0xFE]) || begin.starts_with(&[0xFE, 0xFF]) {
        let reason = "UTF-16 text: save the file as UTF-8".to_owned();
        return Err(refuse(file, None, Fault::Unreadable(reason)));
    }
    let first_rows = first_rows(&begin);
    drop(begin);
    let dialect = Dialect::detect(&first_rows, (import.delimiter, import.decimal))
        .map_err(|fault| refuse(file, None, fault))?;
    let mut rows = Rows::new(source, dialect.delimiter);
    let first = match rows.next() {
        Ok(Some(row)) => row.clone(),
        Ok(None) => return Err(refuse(file, None, Fault::Empty)),
        Err(fault) => return Err(refuse(file, Some(rows.line()), fault)),
    };
    let names = Names {
        names: first.iter().map(str::to_owned).collect(),
        units: Vec::new(),
        are_stated: !is_data(&first, dialect.decimal, import),
    };
    let mut decoder =
        Decoder::new(file, &names, import).map_err(|fault| refuse(file, Some(rows.line()), fault))?;
    let number = |row: &StringRecord, chosen: &Chosen| {
        chosen.column.parsed(row.get(chosen.column.index).unwrap_or(""), dialect.decimal)
    };
    if import.merge_rows {
        let first = (!names.are_stated).then_some(&first);
        let joined = joined(&mut rows, first, &decoder.columns, dialect.decimal)
            .map_err(|(line, fault)| refuse(file, Some(line), fault))?;
        for (line, values) in joined {
            let mut values = values.into_iter();
            decoder.take(line, |chosen| chosen.column.finite(values.next().unwrap_or(f64::NAN)))?;
        }
        return decoder
            .finish(format!("{}{packing}, rows joined by time", dialect.words()), names.are_stated);
    }
    check_scattered(&first_rows, dialect, names.are_stated, &decoder.columns)
        .map_err(|fault| refuse(file, None, fault))?;
    if !names.are_stated {
        decoder.take(rows.line(), |chosen| number(&first, chosen))?;
    }
    let (mut row, expected) = (StringRecord::new(), first.len());
    loop {
        match rows.next() {
            Ok(Some(next)) => row.clone_from(next),
            Ok(None) => break,
            Err(fault) => return Err(refuse(file, Some(rows.line()), fault)),
        }
        let line = rows.line();
        if row.len() == expected {
            decoder.take(line, |chosen| number(&row, chosen))?;
        } else {
            decoder.skip(line, Fault::FieldCount { found: row.len(), expected })?;
        }
    }
    let mut read = decoder.finish(format!("{}{packing}", dialect.words()), names.are_stated)?;
    if rows.is_open() {
        let words = "the last line has no line end: if the file was cut, its last value is wrong";
        read.report.warning = Some(format!("{}: {words}", file.display()));
    }
    Ok(read)
}

/// Whether a first row is data: all its fields, or all those that are chosen by number, are numbers.
fn is_data(first: &StringRecord, decimal: Decimal, import: &Import) -> bool {
    let is_number = |field: &str| field.is_empty() || decimal.parse(field).is_some();
    let is_chosen_number = |column: &ColumnName| match column {
        ColumnName::Number(number) => first.get(number - 1).is_some_and(is_number),
        ColumnName::Name(_) => false,
    };
    let is_one = |field: &str| decimal.parse(field).is_some();
    first.iter().all(is_number) && first.iter().any(is_one)
        || !import.columns.is_empty() && import.columns.values().all(is_chosen_number)
}
