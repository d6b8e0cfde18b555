//! Rows that hold some of the signals each, as a logger of messages writes them: joined by time.
//!
//! The rows of the first joint's angle remain. Every other signal is interpolated linearly at their times,
//! between the two rows that hold it; a row where these are further apart than a gap is dropped.

use std::io::BufRead;

use csv::StringRecord;

use crate::formats::recording::LARGEST_STEP_IN_MEDIANS;
use crate::formats::recording::chosen::Chosen;
use crate::formats::recording::columns::Rows;
use crate::formats::recording::dialect::{Decimal, Dialect, split};
use crate::formats::recording::fault::Fault;
use crate::formats::recording::median_step_s;

/// Least number of first rows that show where the signals are.
const LEAST_ROWS: usize = 4;

/// Numbers of one column with their times, as the file holds them.
#[derive(Default)]
struct Series {
    time: Vec<f64>,
    value: Vec<f64>,
    line: Vec<usize>,
}

impl Series {
    /// Value at this time; `None` outside, and in a gap.
    fn at(&self, now: f64, largest_step: f64) -> Option<f64> {
        let right = self.time.partition_point(|&time| time < now);
        if self.time.get(right) == Some(&now) {
            return Some(self.value[right]);
        }
        let left = right.checked_sub(1)?;
        let step = self.time.get(right)? - self.time[left];
        let share = (now - self.time[left]) / step;
        (step <= largest_step).then(|| self.value[left] + share * (self.value[right] - self.value[left]))
    }
}

/// Line of a row that remains, with the numbers of all columns.
pub(crate) type Joined = (usize, Vec<f64>);

fn text<'a>(row: &'a StringRecord, chosen: &Chosen) -> &'a str {
    row.get(chosen.column.index).unwrap_or("")
}

/// Refuses first rows of which none holds all columns, while each column has a number in some row.
pub(crate) fn check_scattered(
    first_rows: &str,
    dialect: Dialect,
    has_header: bool,
    columns: &[Chosen],
) -> Result<(), Fault> {
    let rows = split(first_rows, dialect.delimiter);
    let rows = &rows[usize::from(has_header).min(rows.len())..];
    let is_empty = |row: &StringRecord, chosen: &Chosen| text(row, chosen).is_empty();
    let lacks_one = |row: &StringRecord| columns.iter().any(|chosen| is_empty(row, chosen));
    let is_somewhere = |chosen: &Chosen| rows.iter().any(|row| !is_empty(row, chosen));
    if rows.len() < LEAST_ROWS || !rows.iter().all(lacks_one) || !columns.iter().all(is_somewhere) {
        return Ok(());
    }
    let columns: Vec<_> = columns.iter().map(|chosen| chosen.column.name.as_str()).collect();
    Err(Fault::Scattered { rows: rows.len(), columns: columns.join(", ") })
}

/// Numbers of all columns at the times of the first joint's angle, each with its line.
///
/// # Errors
/// A field that is neither empty nor a number, or times that do not increase, with the line.
pub(crate) fn joined(
    rows: &mut Rows<impl BufRead>,
    first: Option<&StringRecord>,
    columns: &[Chosen],
    decimal: Decimal,
) -> Result<Vec<Joined>, (usize, Fault)> {
    let (time, signals) = columns.split_first().ok_or((1, Fault::Empty))?;
    let mut series: Vec<Series> = signals.iter().map(|_| Series::default()).collect();
    let mut add = |row: &StringRecord, line: usize| {
        let now = time.column.parsed(text(row, time), decimal)?;
        for (series, chosen) in series.iter_mut().zip(signals) {
            if text(row, chosen).is_empty() {
                continue;
            }
            if let Some(&previous) = series.time.last().filter(|previous| **previous >= now) {
                return Err(Fault::TimeNotIncreasing { previous, time: now });
            }
            series.value.push(chosen.column.parsed(text(row, chosen), decimal)?);
            series.time.push(now);
            series.line.push(line);
        }
        Ok(())
    };
    first.map_or(Ok(()), |first| add(first, rows.line())).map_err(|fault| (rows.line(), fault))?;
    loop {
        match rows.next().map(|row| row.cloned()) {
            Ok(Some(row)) => add(&row, rows.line()).map_err(|fault| (rows.line(), fault))?,
            Ok(None) => break,
            Err(fault) => return Err((rows.line(), fault)),
        }
    }
    let largest: Vec<f64> =
        series.iter().map(|series| LARGEST_STEP_IN_MEDIANS * median_step_s(&series.time)).collect();
    let Some(base) = series.first() else { return Ok(Vec::new()) };
    let at = |now: f64| -> Option<Vec<f64>> {
        let values = series.iter().zip(&largest).map(|(series, largest)| series.at(now, *largest));
        std::iter::once(Some(now)).chain(values).collect()
    };
    Ok(base.time.iter().zip(&base.line).filter_map(|(now, line)| Some((*line, at(*now)?))).collect())
}
