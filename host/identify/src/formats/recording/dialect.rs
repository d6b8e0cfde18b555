//! Delimiter and decimal sign of a CSV file, found from its first lines.
//!
//! A delimiter must split the header and every looked-at row into equally many fields; runs of spaces count
//! where no other does. A decimal comma needs
//! another delimiter than the comma, and numbers that are not all possible thousands. What remains ambiguous
//! is refused: `--delimiter` and `--decimal` settle it.

use crate::formats::recording::fault::Fault;
use crate::formats::recording::lines::{is_skipped, single_spaced};

/// Bytes looked at.
pub(crate) const LOOKED_AT: usize = 1 << 16;
/// Rows looked at.
const ROWS: usize = 50;

/// Separator of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delimiter {
    Comma,
    Semicolon,
    Tab,
    /// Any number of spaces.
    Space,
}

impl Delimiter {
    /// Delimiters that no field contains.
    const CERTAIN: [Self; 3] = [Self::Comma, Self::Semicolon, Self::Tab];

    pub(crate) fn byte(self) -> u8 {
        match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            Self::Tab => b'\t',
            Self::Space => b' ',
        }
    }

    /// Word of the option `--delimiter`.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Comma => "comma",
            Self::Semicolon => "semicolon",
            Self::Tab => "tab",
            Self::Space => "space",
        }
    }
}

/// Sign before the fraction of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decimal {
    Point,
    Comma,
}

impl Decimal {
    /// Number written with this sign, NaN and infinity included.
    pub fn parse(self, text: &str) -> Option<f64> {
        match self {
            Self::Point => text.parse().ok(),
            Self::Comma if text.contains('.') => None,
            Self::Comma => text.replacen(',', ".", 1).parse().ok(),
        }
    }
}

/// How a file writes its rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dialect {
    pub(crate) delimiter: Delimiter,
    pub(crate) decimal: Decimal,
}

impl Dialect {
    /// Finds what is not `stated` from the first rows of a file.
    ///
    /// # Errors
    /// The first rows allow two readings.
    pub(crate) fn detect(text: &str, stated: (Option<Delimiter>, Option<Decimal>)) -> Result<Self, Fault> {
        let delimiter = match stated.0 {
            Some(delimiter) => delimiter,
            None => delimiter(text)?,
        };
        let decimal = match stated.1 {
            Some(decimal) => decimal,
            None if delimiter == Delimiter::Comma => Decimal::Point,
            None => decimal(&split(text, delimiter))?,
        };
        Ok(Self { delimiter, decimal })
    }

    /// Description for the report.
    pub fn words(self) -> String {
        let delimiter = match self.delimiter {
            Delimiter::Comma => "commas",
            Delimiter::Semicolon => "semicolons",
            Delimiter::Tab => "tabs",
            Delimiter::Space => "spaces",
        };
        let decimal = if self.decimal == Decimal::Comma { ", decimal commas" } else { "" };
        format!("CSV with {delimiter}{decimal}")
    }
}

pub(crate) fn split(text: &str, delimiter: Delimiter) -> Vec<csv::StringRecord> {
    let bytes: Vec<u8> = match delimiter {
        Delimiter::Space => text.lines().flat_map(|line| single_spaced(line.as_bytes())).collect(),
        _ => text.as_bytes().to_vec(),
    };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(delimiter.byte())
        .from_reader(&bytes[..]);
    reader.records().map_while(Result::ok).collect()
}

/// First rows of a file from its first bytes.
pub(crate) fn first_rows(begin: &[u8]) -> String {
    let text = String::from_utf8_lossy(begin);
    let mut lines: Vec<&str> =
        text.split_inclusive('\n').filter(|line| !is_skipped(line.as_bytes())).collect();
    if begin.len() >= LOOKED_AT && lines.len() > 1 {
        lines.pop();
    }
    lines.truncate(ROWS);
    lines.concat()
}

fn delimiter(text: &str) -> Result<Delimiter, Fault> {
    let splits = Delimiter::CERTAIN.map(|delimiter| (delimiter, split(text, delimiter)));
    let is_even = |rows: &[csv::StringRecord]| {
        rows.first().is_some_and(|first| first.len() > 1 && rows.iter().all(|row| row.len() == first.len()))
    };
    let even: Vec<_> = splits.iter().filter(|(_, rows)| is_even(rows)).collect();
    let numbers_only = |rows: &[csv::StringRecord]| {
        rows.iter().flatten().all(|field| {
            Decimal::Comma.parse(field).is_some() && field.bytes().filter(|byte| *byte == b',').count() < 2
        })
    };
    match even[..] {
        [] if is_even(&split(text, Delimiter::Space)) => Ok(Delimiter::Space),
        [] => {
            // A damaged file: the delimiter of its first line, for the messages about the other lines.
            let fields = |(_, rows): &&(Delimiter, Vec<csv::StringRecord>)| {
                rows.first().map_or(0, csv::StringRecord::len)
            };
            let most = splits.iter().rev().max_by_key(fields);
            Ok(most.filter(|split| fields(split) > 1).map_or(Delimiter::Comma, |(delimiter, _)| *delimiter))
        }
        [(delimiter, _)] => Ok(*delimiter),
        // Numbers with decimal commas and no header.
        [(Delimiter::Comma, _), (other, rows)] if numbers_only(rows) => Ok(*other),
        [(first, _), (second, _), ..] => Err(Fault::Ambiguous {
            what: format!("the first lines are even with {}s and with {}s", first.word(), second.word()),
            options: format!("--delimiter {} or --delimiter {}", first.word(), second.word()),
        }),
    }
}

fn decimal(rows: &[csv::StringRecord]) -> Result<Decimal, Fault> {
    let fields = || rows.iter().flatten();
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let with_comma: Vec<&str> =
        fields().filter(|field| field.contains(',') && Decimal::Comma.parse(field).is_some()).collect();
    let with_point = fields().find(|field| field.contains('.') && Decimal::Point.parse(field).is_some());
    let is_thousands = |field: &&str| {
        let (whole, rest) = field.trim_start_matches(['+', '-']).split_once(',').unwrap_or((field, ""));
        digits(whole) && whole.len() <= 3 && !whole.starts_with('0') && digits(rest) && rest.len() == 3
    };
    match (with_comma.first(), with_point) {
        (None, _) => Ok(Decimal::Point),
        (Some(comma), Some(point)) => Err(Fault::Ambiguous {
            what: format!("`{comma}` has a comma and `{point}` a point"),
            options: "--decimal point or --decimal comma".to_owned(),
        }),
        (Some(comma), None) if with_comma.iter().all(is_thousands) => Err(Fault::Ambiguous {
            what: format!("`{comma}` may have a decimal comma or a separator of thousands"),
            options: "--decimal comma, or write the numbers without separators of thousands".to_owned(),
        }),
        (Some(_), None) => Ok(Decimal::Comma),
    }
}
