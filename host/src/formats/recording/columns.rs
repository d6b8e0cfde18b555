//! CSV by column names: the header is parsed once, then every row is checked against it.

use std::path::Path;

use csv::StringRecord;

use crate::base::error::FileError;
use crate::formats::recording::fault::Fault;

/// Passes the header to `find` and every row after it to `take`; returns the byte offset of each row.
pub(crate) fn for_each_row<C>(
    file: &Path,
    text: &str,
    mut find: impl FnMut(&StringRecord) -> Result<C, Fault>,
    mut take: impl FnMut(&C, &StringRecord) -> Result<(), Fault>,
) -> Result<Vec<usize>, FileError> {
    if text.lines().all(|line| line.trim().is_empty() || line.starts_with('#')) {
        return Err(refuse(file, None, Fault::Empty));
    }
    // Lines are located by byte offsets: the reader's own count skips blank lines and comments.
    let refuse_at = |offset: usize, fault| refuse(file, Some(line_at(text, offset)), fault);
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let mut row = StringRecord::new();
    let mut offsets = Vec::new();
    let mut columns: Option<(C, usize)> = None;
    loop {
        let offset = reader.position().byte() as usize;
        match reader.read_record(&mut row) {
            Ok(true) => {}
            Ok(false) => return Ok(offsets),
            Err(error) => return Err(refuse_at(offset, Fault::NotCsv(error))),
        }
        match &columns {
            None => {
                let found = find(&row).map_err(|fault| refuse_at(offset, fault))?;
                columns = Some((found, row.len()));
            }
            Some((_, expected)) if row.len() != *expected => {
                return Err(refuse_at(offset, Fault::FieldCount { found: row.len(), expected: *expected }));
            }
            Some((columns, _)) => {
                take(columns, &row).map_err(|fault| refuse_at(offset, fault))?;
                offsets.push(offset);
            }
        }
    }
}

pub(crate) fn refuse(file: &Path, line: Option<usize>, fault: Fault) -> FileError {
    FileError { file: file.display().to_string(), line, reason: fault.to_string() }
}

/// Line, from 1, of the first row at or after a byte of the text.
pub(crate) fn line_at(text: &str, offset: usize) -> usize {
    let skipped = |line: &&str| line.trim_end().is_empty() || line.starts_with('#');
    let before = text[offset..].split_inclusive('\n').take_while(skipped).count();
    1 + text[..offset].matches('\n').count() + before
}

/// Column of the file: its index and name.
pub(crate) struct Column {
    index: usize,
    name: String,
}

impl Column {
    /// Finds a column; the error names all that are `needed`.
    pub(crate) fn find(header: &StringRecord, name: String, needed: &[String]) -> Result<Self, Fault> {
        let mut places = header.iter().enumerate().filter(|(_, present)| *present == name);
        match (places.next(), places.next()) {
            (Some((index, _)), None) => Ok(Self { index, name }),
            (Some(_), Some(_)) => Err(Fault::RepeatedColumn(name)),
            (None, _) => {
                let present = header.iter().collect::<Vec<_>>().join(", ");
                Err(Fault::MissingColumn { column: name, present, needed: needed.join(", ") })
            }
        }
    }

    /// Finite number in this column, at most `limit` in magnitude.
    pub(crate) fn number(&self, row: &StringRecord, limit: f64) -> Result<f64, Fault> {
        let text = row.get(self.index).unwrap_or("");
        let (column, text) = (self.name.clone(), text.to_owned());
        match text.parse::<f64>() {
            Err(_) => Err(Fault::NotANumber { column, text }),
            Ok(value) if !value.is_finite() => Err(Fault::NotFinite { column, text }),
            Ok(value) if value.abs() > limit => Err(Fault::Absurd { column, value, limit }),
            Ok(value) => Ok(value),
        }
    }
}
