//! Files that are there as a whole or not at all: written beside their place first, then renamed.
//!
//! ```text
//! folder of the file --> .scarab-PROCESS-NUMBER.tmp --> all bytes --> rename over the file
//! ```
//!
//! A command that fails on the way leaves the file as it was. A link stays a link: the file that it leads to is replaced.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::{folder_of, is_device, resolved};
use crate::tool::error::ToolError;

/// Writes a file as a whole; its folder is made if it does not exist.
///
/// # Errors
/// Where it cannot be written; the file is then as it was.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), ToolError> {
    let mut file = NewFile::create(path)?;
    file.write_all(bytes.as_ref()).map_err(|error| ToolError::cannot_write(path, &error))?;
    file.finish()
}

/// A file that takes its place when it is finished, and leaves no trace if it never is.
#[derive(Debug)]
pub struct NewFile {
    out: BufWriter<File>,
    /// As the user named it.
    named: PathBuf,
    /// Temporary file and the place it takes; none of a device, which is written to directly.
    rename: Option<(PathBuf, PathBuf)>,
}

impl NewFile {
    /// Begins a file; its folder is made if it does not exist.
    ///
    /// # Errors
    /// Where nothing can be written there.
    pub fn create(path: &Path) -> Result<Self, ToolError> {
        let cannot = |error: io::Error| ToolError::cannot_write(path, &error);
        if is_device(path) {
            let out = BufWriter::new(OpenOptions::new().append(true).open(path).map_err(cannot)?);
            return Ok(Self { out, named: path.to_owned(), rename: None });
        }
        let place = resolved(path);
        let folder = folder_of(&place);
        std::fs::create_dir_all(&folder).map_err(cannot)?;
        let (temporary, file) = temporary_in(&folder).map_err(cannot)?;
        // The permissions of the file stay as they were.
        if let Ok(metadata) = place.metadata() {
            let _ = file.set_permissions(metadata.permissions());
        }
        Ok(Self { out: BufWriter::new(file), named: path.to_owned(), rename: Some((temporary, place)) })
    }

    /// The file behind it, for another program to write to.
    ///
    /// # Errors
    /// Where the system has no further handle.
    pub fn handle(&self) -> Result<File, ToolError> {
        self.out.get_ref().try_clone().map_err(|error| ToolError::cannot_write(&self.named, &error))
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// Where it cannot be written to its end or renamed; the file in its place is then as it was.
    pub fn finish(mut self) -> Result<(), ToolError> {
        let named = &self.named;
        self.out.flush().map_err(|error| ToolError::cannot_write(named, &error))?;
        if let Some((temporary, place)) = &self.rename {
            std::fs::rename(temporary, place).map_err(|error| ToolError::cannot_write(named, &error))?;
            self.rename = None;
        }
        Ok(())
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if let Some((temporary, _)) = &self.rename {
            let _ = std::fs::remove_file(temporary);
        }
    }
}

/// Whether a file can be made in a folder: one is, and removed again.
pub(super) fn can_write_in(folder: &Path) -> io::Result<()> {
    let (temporary, _) = temporary_in(folder)?;
    std::fs::remove_file(temporary)
}

/// Whether a file that exists can be written: it is opened, and left as it is.
pub(super) fn can_write_over(file: &Path) -> io::Result<()> {
    OpenOptions::new().append(true).open(file).map(drop)
}

/// A new file under a name that is not taken.
fn temporary_in(folder: &Path) -> io::Result<(PathBuf, File)> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = folder.join(format!(".scarab-{}-{number}.tmp", std::process::id()));
    let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
    Ok((path, file))
}
