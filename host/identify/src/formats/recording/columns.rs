//! CSV by column names: the header is parsed once, then every row is checked against it.

use std::io::{BufRead, Cursor, Read};
use std::path::Path;

use csv::StringRecord;
use scarab_base::error::FileError;

use crate::formats::recording::dialect::{Decimal, Delimiter};
use crate::formats::recording::fault::Fault;
use crate::formats::recording::lines::Lines;

/// Rows of a CSV file, the header included.
pub(crate) struct Rows<R> {
    reader: csv::Reader<Lines<R>>,
    row: StringRecord,
}

impl<R: BufRead> Rows<R> {
    pub fn new(source: R, delimiter: Delimiter) -> Self {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .delimiter(delimiter.byte())
            .from_reader(Lines::new(source, delimiter == Delimiter::Space));
        Self { reader, row: StringRecord::new() }
    }

    /// Next row, or `None` at the end.
    pub fn next(&mut self) -> Result<Option<&StringRecord>, Fault> {
        self.reader.get_mut().begin_record();
        match self.reader.read_record(&mut self.row) {
            Ok(true) => Ok(Some(&self.row)),
            Ok(false) => Ok(None),
            Err(error) => Err(match error.kind() {
                csv::ErrorKind::Io(error) => Fault::Unreadable(error.to_string()),
                csv::ErrorKind::Utf8 { .. } => Fault::Unreadable("not a text file".to_owned()),
                _ => Fault::NotCsv(error),
            }),
        }
    }

    /// Line on which the last row began.
    pub fn line(&self) -> usize {
        self.reader.get_ref().record_line()
    }

    /// Whether the last row has no line end.
    pub(crate) fn is_open(&self) -> bool {
        self.reader.get_ref().is_open()
    }
}

/// Passes the header to `find` and every row after it to `take`; returns the line of each row.
pub(crate) fn for_each_row<C>(
    file: &Path,
    source: impl BufRead,
    mut find: impl FnMut(&StringRecord) -> Result<C, Fault>,
    mut take: impl FnMut(&C, &StringRecord) -> Result<(), Fault>,
) -> Result<LineNumbers, FileError> {
    let mut rows = Rows::new(source, Delimiter::Comma);
    let mut numbers = LineNumbers::default();
    let mut columns: Option<(C, usize)> = None;
    loop {
        let result = rows.next().and_then(|row| {
            let Some(row) = row else { return Ok(None) };
            match &columns {
                None => columns = Some((find(row)?, row.len())),
                Some((_, expected)) if row.len() != *expected => {
                    return Err(Fault::FieldCount { found: row.len(), expected: *expected });
                }
                Some((columns, _)) => {
                    take(columns, row)?;
                    return Ok(Some(true));
                }
            }
            Ok(Some(false))
        });
        match result {
            Ok(Some(true)) => numbers.push(rows.line()),
            Ok(Some(false)) => {}
            Ok(None) if columns.is_none() => return Err(refuse(file, None, Fault::Empty)),
            Ok(None) => return Ok(numbers),
            Err(fault) => return Err(refuse(file, Some(rows.line()), fault)),
        }
    }
}

/// Text as a source of rows.
pub(crate) fn of_text(text: &str) -> impl BufRead + '_ {
    Cursor::new(text.as_bytes())
}

/// Line of every sample. Only the samples that do not follow their predecessor's line are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineNumbers {
    samples: usize,
    /// Samples with their lines, at the breaks.
    breaks: Vec<(usize, usize)>,
}

impl LineNumbers {
    pub(crate) fn push(&mut self, line: usize) {
        if self.line_of(self.samples) != Some(line) {
            self.breaks.push((self.samples, line));
        }
        self.samples += 1;
    }

    /// Line of a sample, or the line after the last one's.
    pub(crate) fn line_of(&self, sample: usize) -> Option<usize> {
        let after = self.breaks.partition_point(|(first, _)| *first <= sample);
        let (first, line) = self.breaks.get(after.checked_sub(1)?)?;
        (sample <= self.samples).then(|| line + sample - first)
    }
}

pub(crate) fn refuse(file: &Path, line: Option<usize>, fault: Fault) -> FileError {
    FileError { file: file.display().to_string(), line, reason: fault.to_string() }
}

/// Column of the file: its index and name.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    pub(crate) index: usize,
    pub(crate) name: String,
}

impl Column {
    /// Only column of this name.
    pub(crate) fn named<'a>(names: impl Iterator<Item = &'a str>, name: &str) -> Result<Option<Self>, Fault> {
        let mut matches = names.enumerate().filter(|(_, present)| *present == name);
        match (matches.next(), matches.next()) {
            (Some((index, _)), None) => Ok(Some(Self { index, name: name.to_owned() })),
            (Some(_), Some(_)) => Err(Fault::RepeatedColumn(name.to_owned())),
            (None, _) => Ok(None),
        }
    }

    /// Finds a column; the error names all that are `needed`.
    pub(crate) fn find(header: &StringRecord, name: &str, needed: &[String]) -> Result<Self, Fault> {
        Self::named(header.iter(), name)?.ok_or_else(|| Fault::MissingColumn {
            column: name.to_owned(),
            present: header.iter().collect::<Vec<_>>().join(", "),
            needed: needed.join(", "),
            advice: String::new(),
        })
    }

    /// Finite number in this column.
    pub(crate) fn number(&self, row: &StringRecord) -> Result<f64, Fault> {
        self.parsed(row.get(self.index).unwrap_or(""), Decimal::Point)
    }

    /// Finite number, as the file holds it.
    pub(crate) fn parsed(&self, text: &str, decimal: Decimal) -> Result<f64, Fault> {
        match decimal.parse(text) {
            None => Err(Fault::NotANumber { column: self.name.clone(), text: text.to_owned() }),
            Some(value) if !value.is_finite() => {
                Err(Fault::NotFinite { column: self.name.clone(), text: text.to_owned() })
            }
            Some(value) => Ok(value),
        }
    }

    /// This number, if it is finite.
    pub(crate) fn finite(&self, value: f64) -> Result<f64, Fault> {
        if !value.is_finite() {
            return Err(Fault::NotFinite { column: self.name.clone(), text: value.to_string() });
        }
        Ok(value)
    }
}

/// First bytes of a source, and the source with them.
pub(crate) fn peeked<R: BufRead>(mut source: R, most: usize) -> std::io::Result<(Vec<u8>, impl BufRead)> {
    let mut begin = Vec::new();
    source.by_ref().take(most as u64).read_to_end(&mut begin)?;
    Ok((begin.clone(), Cursor::new(begin).chain(source)))
}
