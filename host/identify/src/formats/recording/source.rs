//! Opens a text for reading piece by piece: gzip is unpacked, and long files show their progress.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::rc::Rc;

use flate2::bufread::MultiGzDecoder;
use indicatif::{ProgressBar, ProgressStyle};

use scarab_base::error::FileError;

/// Size from which progress is shown, bytes: some seconds of reading.
const SHOWN_FROM: u64 = 50_000_000;
/// Buffer of the file, bytes.
const BUFFER: usize = 1 << 16;
/// First bytes of a gzip file.
const GZIP: [u8; 2] = [0x1F, 0x8B];
/// Largest unpacked over packed size beyond `UNPACKED_FREELY`. Recorded numbers reach 3 to 20.
const LARGEST_EXPANSION: u64 = 200;
const UNPACKED_FREELY: u64 = 64_000_000;

/// Opened file.
pub struct Source {
    pub(crate) text: Box<dyn BufRead>,
    pub(crate) is_gzip: bool,
    progress: ProgressBar,
}

impl Drop for Source {
    fn drop(&mut self) {
        self.progress.finish_and_clear();
    }
}

/// Opens a file.
pub fn open(path: &Path) -> Result<Source, FileError> {
    if path.is_dir() {
        let reason = "is a folder: name the recording in it; only the folder of a ROS 2 bag (`.mcap`) is read as a whole";
        return Err(FileError { file: path.display().to_string(), line: None, reason: reason.into() });
    }
    let unreadable = |error: &io::Error| FileError::unreadable(path, error);
    let file = File::open(path).map_err(|error| unreadable(&error))?;
    let length = file.metadata().map_err(|error| unreadable(&error))?.len();
    let progress = progress(path, length, "{bytes} of {total_bytes}");
    let read = Rc::new(Cell::new(0));
    let counted = Counted { file: progress.wrap_read(file), read: Rc::clone(&read) };
    let mut packed = BufReader::with_capacity(BUFFER, counted);
    let is_gzip = packed.fill_buf().map_err(|error| unreadable(&error))?.starts_with(&GZIP);
    let text: Box<dyn BufRead> = if is_gzip {
        let unpacked = Unpacked { text: MultiGzDecoder::new(packed), packed: read, unpacked: 0 };
        Box::new(BufReader::with_capacity(BUFFER, unpacked))
    } else {
        Box::new(packed)
    };
    Ok(Source { text, is_gzip, progress })
}

/// Progress of reading a file in so many steps, hidden for a short one. `position` is the bar's text.
pub(crate) fn progress(path: &Path, steps: u64, position: &str) -> ProgressBar {
    if path.metadata().map_or(0, |metadata| metadata.len()) < SHOWN_FROM {
        return ProgressBar::hidden();
    }
    let progress = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template(&format!("reading {{bar:40}} {position}, {{eta}} left")) {
        progress.set_style(style);
    }
    progress
}

/// Counts the bytes of the file.
struct Counted<R> {
    file: R,
    read: Rc<Cell<u64>>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let length = self.file.read(out)?;
        self.read.set(self.read.get() + length as u64);
        Ok(length)
    }
}

/// Unpacked text, refused if it grows like no recording.
struct Unpacked<R> {
    text: R,
    packed: Rc<Cell<u64>>,
    unpacked: u64,
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let length =
            self.text.read(out).map_err(|error| io::Error::other(format!("damaged gzip data ({error})")))?;
        self.unpacked += length as u64;
        if self.unpacked > UNPACKED_FREELY + LARGEST_EXPANSION * self.packed.get() {
            return Err(io::Error::other(format!(
                "the gzip data unpack to more than {LARGEST_EXPANSION} times their size: not a recording"
            )));
        }
        Ok(length)
    }
}
