//! Lines of a text that is never held as a whole, numbered for messages.
//!
//! Passes one line at a time to the CSV reader, without comments and blank lines. The line of a record is
//! thus the line passed last, whatever the reader buffers.

use std::io::{self, BufRead, Read};

/// Longest line, bytes: longer ones are not a recording's.
pub const LONGEST_LINE: usize = 1 << 20;

const UTF8_MARK: [u8; 3] = [0xEF, 0xBB, 0xBF];

/// Reader of the lines that count.
pub(crate) struct Lines<R> {
    source: R,
    line: Vec<u8>,
    /// Bytes of `line` already passed on.
    passed: usize,
    /// Number of `line`, from 1.
    number: usize,
    /// First line passed since [`Lines::begin_record`].
    record: Option<usize>,
    /// Whether the line passed last has no line end.
    is_open: bool,
    /// Whether runs of spaces separate the fields: one space of each is passed.
    is_spaced: bool,
}

impl<R: BufRead> Lines<R> {
    pub fn new(source: R, is_spaced: bool) -> Self {
        Self { source, line: Vec::new(), passed: 0, number: 0, record: None, is_open: false, is_spaced }
    }

    /// Begins a record: the next line passed is its first.
    pub(crate) fn begin_record(&mut self) {
        self.record = None;
    }

    /// Line on which the record began, or at which reading ended.
    pub(crate) fn record_line(&self) -> usize {
        self.record.unwrap_or(self.number).max(1)
    }

    /// Whether the line passed last has no line end, so that the file may be cut there.
    pub(crate) fn is_open(&self) -> bool {
        self.is_open
    }

    /// Reads the next line that is neither blank nor a comment; false at the end.
    fn advance(&mut self) -> io::Result<bool> {
        loop {
            self.line.clear();
            self.passed = 0;
            let limit = LONGEST_LINE as u64 + 1;
            if self.source.by_ref().take(limit).read_until(b'\n', &mut self.line)? == 0 {
                return Ok(false);
            }
            self.number += 1;
            if self.line.len() > LONGEST_LINE {
                self.record = Some(self.number);
                return Err(io::Error::other("the line is longer than 1 MB: not a recording"));
            }
            if self.number == 1 && self.line.starts_with(&UTF8_MARK) {
                self.line.drain(..UTF8_MARK.len());
            }
            if self.line.contains(&0) {
                self.record = Some(self.number);
                return Err(io::Error::other("not a text file"));
            }
            if !is_skipped(&self.line) {
                self.is_open = !self.line.ends_with(b"\n");
                if self.is_spaced {
                    self.line = single_spaced(&self.line);
                }
                return Ok(true);
            }
        }
    }
}

/// Fields of a line that spaces separate, with one space between them.
pub(crate) fn single_spaced(line: &[u8]) -> Vec<u8> {
    let fields: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|field| !field.is_empty()).collect();
    let mut line = fields.join(&b' ');
    line.push(b'\n');
    line
}

/// Whether the line is blank or a comment.
pub(crate) fn is_skipped(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.trim_ascii_end().is_empty()
}

impl<R: BufRead> Read for Lines<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.passed == self.line.len() && !self.advance()? {
            return Ok(0);
        }
        self.record.get_or_insert(self.number);
        let rest = &self.line[self.passed..];
        let length = rest.len().min(out.len());
        out[..length].copy_from_slice(&rest[..length]);
        self.passed += length;
        Ok(length)
    }
}
