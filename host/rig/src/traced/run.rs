//! Reads, describes and reports a trace for the command line.

use scarab_base::error::{FileError, ToolError};
use scarab_base::files::NewFile;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use crate::trace::Decoder;
use crate::trace::events::{Event, Weight};
use crate::trace::read::Trace;

/// Bytes read at a time.
const PIECE: usize = 64 * 1024;
/// Limit of a line, bytes. A longer line is skipped.
const LONGEST_LINE: usize = 64 * 1024;

/// Reads a file, or `-` for standard input; writes the records as lines to `text`.
pub fn read(source: &Path, image: Option<&Path>, text: Option<&Path>) -> Result<Trace, ToolError> {
    let decoder = decoder(image)?;
    let mut input: Box<dyn Read> = if source == Path::new("-") {
        Box::new(std::io::stdin().lock())
    } else {
        Box::new(File::open(source).map_err(|error| FileError::unreadable(source, &error))?)
    };
    let mut reader = StreamReader::new(decoder);
    if let Some(path) = text {
        reader.text = Some((path.to_owned(), NewFile::create(path)?));
    }
    let mut piece = vec![0; PIECE];
    loop {
        match input.read(&mut piece) {
            Ok(0) => break,
            Ok(count) => reader.feed(&piece[..count])?,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(FileError::unreadable(source, &error).into()),
        }
    }
    reader.finish(source)
}

/// Decoder of an image's frames; none for text.
///
/// # Errors
/// The image cannot be read or has no texts of records.
pub fn decoder(image: Option<&Path>) -> Result<Option<Decoder>, ToolError> {
    let Some(path) = image else { return Ok(None) };
    let bytes = std::fs::read(path).map_err(|error| FileError::unreadable(path, &error))?;
    let named = |error: ToolError| FileError::new(path.display(), error);
    Ok(Some(Decoder::new(&bytes).map_err(named)?))
}

/// Reads bytes of text or `defmt` frames into a trace.
pub struct StreamReader {
    decoder: Option<Decoder>,
    trace: Trace,
    line: Vec<u8>,
    zeros: u64,
    text: Option<(PathBuf, NewFile)>,
}

impl StreamReader {
    /// Creates a reader of frames if there is a decoder, of text otherwise.
    pub fn new(decoder: Option<Decoder>) -> Self {
        Self { decoder, trace: Trace::default(), line: Vec::new(), zeros: 0, text: None }
    }

    /// Trace so far.
    pub fn trace_mut(&mut self) -> &mut Trace {
        &mut self.trace
    }

    /// Takes the next bytes.
    ///
    /// # Errors
    /// The file of lines cannot be written.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(), ToolError> {
        if let Some(decoder) = &mut self.decoder {
            let (trace, text) = (&mut self.trace, &mut self.text);
            let mut outcome = Ok(());
            decoder.feed(bytes, |line| {
                let pushed = push(trace, text, line);
                if outcome.is_ok() {
                    outcome = pushed;
                }
            });
            return outcome;
        }
        for &byte in bytes {
            self.zeros += u64::from(byte == 0);
            if byte == b'\n' {
                self.end_line()?;
            } else if self.line.len() <= LONGEST_LINE {
                self.line.push(byte);
            }
        }
        Ok(())
    }

    /// Adds the line to the trace. An over-long line counts as one without a record, because its beginning
    /// could be read as a whole record.
    fn end_line(&mut self) -> Result<(), ToolError> {
        if self.line.len() > LONGEST_LINE {
            self.line.clear();
        }
        push(&mut self.trace, &mut self.text, &String::from_utf8_lossy(&self.line))?;
        self.line.clear();
        Ok(())
    }

    /// Ends the stream. Errors name `source`.
    ///
    /// # Errors
    /// The stream contains no record, or the file of lines cannot be written.
    pub fn finish(mut self, source: &Path) -> Result<Trace, ToolError> {
        if !self.line.is_empty() {
            self.end_line()?;
        }
        if let Some((_, out)) = self.text.take() {
            out.finish()?;
        }
        let skipped = self.decoder.as_mut().map(Decoder::finish);
        let decoded = self.decoder.as_ref().map_or(0, Decoder::decoded);
        if self.trace.records == 0 {
            let hint = match &skipped {
                Some(_) if decoded == 0 => {
                    ": no frame of this image. Check that --image is the image that ran, and that the input is its stream, not text"
                }
                None if self.zeros > 0 => ": the input is not text; a defmt stream needs --image ELF",
                _ => "",
            };
            let source = source.display();
            return Err(ToolError::input(format!("{source}: contains no trace record{hint}")));
        }
        if let Some(words) = skipped.and_then(|skipped| skipped.words()) {
            self.trace.events.push(Event { time_s: None, weight: Weight::Warning, words });
        }
        self.trace.finish();
        Ok(self.trace)
    }
}

/// Adds a line to the trace, and its record to the file of lines.
fn push(trace: &mut Trace, text: &mut Option<(PathBuf, NewFile)>, line: &str) -> Result<(), ToolError> {
    trace.push(line);
    if let (Some((path, out)), Some(record)) = (text, crate::trace::text::record(line)) {
        writeln!(out, "{record}").map_err(|error| ToolError::cannot_write(path, &error))?;
    }
    Ok(())
}

/// Timeline and loops, printed before the tables.
pub fn preface(trace: &Trace) -> String {
    let mut lines: Vec<String> = trace.events.iter().map(Event::line).collect();
    lines.push(String::new());
    lines.extend(trace.statistics.lines());
    let lines_without = trace.lines - trace.records;
    lines.push(format!(
        "records: {} read, {} lost{}{}",
        trace.records,
        trace.lost(),
        count(trace.unknown, "of an unknown kind"),
        count(lines_without, "lines without a record"),
    ));
    if trace.results.len() > 1 {
        lines.push(format!("identifications: {}; this is the last", trace.results.len()));
    }
    lines.join("\n") + "\n\n"
}

fn count(count: u64, words: &str) -> String {
    if count == 0 { String::new() } else { format!(", {count} {words}") }
}

/// Faults and warnings, printed after everything else.
pub fn attention(trace: &Trace) -> String {
    let faults: Vec<String> = trace.faults().map(|event| format!("  !! {}", event.words)).collect();
    let warnings: Vec<String> = trace.warnings().iter().map(|words| format!("  !  {words}")).collect();
    if faults.is_empty() && warnings.is_empty() {
        return String::new();
    }
    let title = match faults.len() {
        0 => "\nwarnings:".to_owned(),
        1 => "\nATTENTION, 1 fault:".to_owned(),
        many => format!("\nATTENTION, {many} faults:"),
    };
    let lines: Vec<String> = std::iter::once(title).chain(faults).chain(warnings).collect();
    lines.join("\n") + "\n"
}
