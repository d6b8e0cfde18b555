//! Parquet: flat columns of numbers, a batch of rows at a time.
//!
//! Compression: none, Snappy, Zstandard, LZ4 (raw), whose decoders stop at the claimed size of a page. The
//! decoders of gzip and Brotli have no such limit: their pages are refused.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::reader::{ChunkReader, FileReader, Length, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::guarded::guarded;
use crate::{Column, Error, LARGEST_PIECE, Row, Table, Take};

/// Rows decoded at once.
const BATCH: usize = 4096;

/// Opened Parquet file.
pub struct Parquet {
    reader: SerializedFileReader<Pages>,
    columns: Vec<Column>,
    rows: u64,
}

impl Parquet {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be read or is damaged.
    pub fn open(path: &Path) -> Result<Self, Error> {
        guarded(|| Self::opened(path))
    }

    fn opened(path: &Path) -> Result<Self, Error> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let holds_pages = Arc::new(AtomicBool::new(false));
        let pages = Pages { file, length, holds_pages: Arc::clone(&holds_pages) };
        let reader = SerializedFileReader::new(pages).map_err(damaged)?;
        // From here on the library reads pages only.
        holds_pages.store(true, Ordering::Relaxed);
        let metadata = reader.metadata();
        let schema = metadata.file_metadata().schema_descr();
        let columns = schema
            .columns()
            .iter()
            .map(|column| Column { name: column.path().string(), unit: unit(column) })
            .collect();
        let rows =
            metadata.row_groups().iter().map(|group| u64::try_from(group.num_rows()).unwrap_or(0)).sum();
        Ok(Self { reader, columns, rows })
    }

    fn check(&self, index: usize) -> Result<&ColumnDescriptor, Error> {
        let column = self
            .reader
            .metadata()
            .file_metadata()
            .schema_descr()
            .columns()
            .get(index)
            .ok_or_else(|| Error::new("a column that the file lacks"))?;
        let is_number =
            matches!(column.physical_type(), Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE);
        let is_plain = matches!(
            column.logical_type_ref(),
            None | Some(LogicalType::Integer(_) | LogicalType::Timestamp(_) | LogicalType::Time(_))
        ) && !matches!(column.converted_type(), ConvertedType::DECIMAL | ConvertedType::DATE);
        if !is_number || !is_plain {
            return Err(Error::new(format!(
                "column `{}` holds {}, not plain numbers",
                column.path().string(),
                column.physical_type()
            )));
        }
        if column.max_rep_level() > 0 {
            return Err(Error::new(format!(
                "column `{}` holds lists: one number a row is read",
                column.path().string()
            )));
        }
        Ok(column)
    }
}

impl Table for Parquet {
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn read(&self, chosen: &[usize], take: Take<'_>) -> Result<(), Error> {
        guarded(|| self.each_row(chosen, take))
    }
}

impl Parquet {
    fn each_row(&self, chosen: &[usize], take: Take<'_>) -> Result<(), Error> {
        let columns = chosen.iter().map(|index| self.check(*index)).collect::<Result<Vec<_>, _>>()?;
        let mut values: Vec<Vec<f64>> = vec![Vec::with_capacity(BATCH); chosen.len()];
        let mut row = vec![0.0; chosen.len()];
        let mut number = 0;
        for group in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(group).map_err(damaged)?;
            let mut readers = Vec::with_capacity(chosen.len());
            for index in chosen {
                let metadata = group.metadata().columns().get(*index);
                if let Some(codec) =
                    metadata.map(|column| column.compression()).filter(|codec| !is_bounded(*codec))
                {
                    return Err(Error::new(format!(
                        "the data are compressed by {codec}: write the file with snappy, zstd or without compression"
                    )));
                }
                readers.push(group.get_column_reader(*index).map_err(damaged)?);
            }
            loop {
                for ((reader, column), values) in readers.iter_mut().zip(&columns).zip(&mut values) {
                    values.clear();
                    batch(reader, column, values).map_err(damaged)?;
                }
                let count = values.first().map_or(0, Vec::len);
                if values.iter().any(|values| values.len() != count) {
                    return Err(Error::new("damaged Parquet file: its columns differ in length"));
                }
                for index in 0..count {
                    row.iter_mut().zip(&values).for_each(|(cell, values)| *cell = values[index]);
                    number += 1;
                    let done = number as f64 / self.rows.max(1) as f64;
                    if take(Row { number, values: &row, done }).is_break() {
                        return Ok(());
                    }
                }
                if count == 0 {
                    break;
                }
            }
        }
        Ok(())
    }
}

/// Whether the decoder stops at the claimed size of a page.
fn is_bounded(codec: Compression) -> bool {
    matches!(
        codec,
        Compression::UNCOMPRESSED | Compression::SNAPPY | Compression::ZSTD(_) | Compression::LZ4_RAW
    )
}

fn damaged(error: ParquetError) -> Error {
    Error::new(format!("damaged Parquet file ({error})"))
}

/// Unit of a column of times.
fn unit(column: &ColumnDescriptor) -> Option<&'static str> {
    let unit = match column.logical_type_ref() {
        Some(LogicalType::Timestamp(stamp)) => Some(stamp.unit),
        Some(LogicalType::Time(time)) => Some(time.unit),
        _ => None,
    };
    match (unit, column.converted_type()) {
        (Some(TimeUnit::MILLIS), _) | (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => {
            Some("ms")
        }
        (Some(TimeUnit::MICROS), _) | (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => {
            Some("us")
        }
        (Some(TimeUnit::NANOS), _) => Some("ns"),
        _ => None,
    }
}

/// Appends the next rows of a column; nulls become NaN.
fn batch(reader: &mut ColumnReader, column: &ColumnDescriptor, out: &mut Vec<f64>) -> ParquetResult<()> {
    let is_unsigned = matches!(
        column.converted_type(),
        ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64
    );
    match reader {
        ColumnReader::DoubleColumnReader(reader) => typed(reader, column, out, |value| value),
        ColumnReader::FloatColumnReader(reader) => typed(reader, column, out, f64::from),
        ColumnReader::Int32ColumnReader(reader) if is_unsigned => {
            typed(reader, column, out, |value| f64::from(value.cast_unsigned()))
        }
        ColumnReader::Int32ColumnReader(reader) => typed(reader, column, out, f64::from),
        ColumnReader::Int64ColumnReader(reader) if is_unsigned => {
            typed(reader, column, out, |value| value.cast_unsigned() as f64)
        }
        ColumnReader::Int64ColumnReader(reader) => typed(reader, column, out, |value| value as f64),
        _ => Err(ParquetError::General("a column of another type".to_owned())),
    }
}

fn typed<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    column: &ColumnDescriptor,
    out: &mut Vec<f64>,
    number: impl Fn(T::T) -> f64,
) -> ParquetResult<()> {
    let (mut levels, mut values) = (Vec::new(), Vec::with_capacity(BATCH));
    // A page border may end a batch early; all columns must deliver equally many rows.
    while out.len() < BATCH {
        levels.clear();
        values.clear();
        let (rows, ..) = reader.read_records(BATCH - out.len(), Some(&mut levels), None, &mut values)?;
        if rows == 0 {
            return Ok(());
        }
        let mut values = values.drain(..);
        if column.max_def_level() == 0 {
            out.extend(values.map(&number));
        } else {
            let full = column.max_def_level();
            out.extend(levels.iter().map(|level| {
                if *level == full { values.next().map_or(f64::NAN, &number) } else { f64::NAN }
            }));
        }
    }
    Ok(())
}

/// File whose page headers are checked before the library decodes the pages.
struct Pages {
    file: File,
    length: u64,
    holds_pages: Arc<AtomicBool>,
}

impl Length for Pages {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for Pages {
    type T = BufReader<File>;

    fn get_read(&self, start: u64) -> ParquetResult<Self::T> {
        if self.holds_pages.load(Ordering::Relaxed) {
            let mut header = Vec::new();
            self.at(start)?.take(LONGEST_BEGIN).read_to_end(&mut header)?;
            if let Some(claimed) = claimed_size(&header).filter(|claimed| *claimed > LARGEST_PIECE as u64) {
                return Err(ParquetError::General(format!(
                    "a page claims {claimed} bytes, at most {LARGEST_PIECE} are decoded"
                )));
            }
        }
        self.at(start)
    }

    fn get_bytes(&self, start: u64, length: usize) -> ParquetResult<bytes::Bytes> {
        if start.saturating_add(length as u64) > self.length {
            return Err(ParquetError::EOF(format!("{length} bytes at byte {start} of {}", self.length)));
        }
        self.file.get_bytes(start, length)
    }
}

impl Pages {
    fn at(&self, start: u64) -> ParquetResult<BufReader<File>> {
        let mut file = self.file.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        Ok(BufReader::new(file))
    }
}

/// Bytes of a page header that hold the page's type and sizes.
const LONGEST_BEGIN: u64 = 12;
/// Begin of a field of 32 bits whose number follows the one before, in Thrift's compact protocol.
const NEXT_I32: u8 = 0x15;

/// Size of a page after decompression, as its header claims: the second of its required fields.
fn claimed_size(header: &[u8]) -> Option<u64> {
    let rest = header.strip_prefix(&[NEXT_I32])?;
    let end = rest.iter().position(|byte| byte & 0x80 == 0)?;
    let rest = rest[end + 1..].strip_prefix(&[NEXT_I32])?;
    let mut zigzag = 0;
    for (index, byte) in rest.iter().take(5).enumerate() {
        zigzag |= u64::from(byte & 0x7F) << (7 * index);
        if byte & 0x80 == 0 {
            return Some(zigzag >> 1);
        }
    }
    None
}
