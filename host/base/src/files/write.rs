//! Writes files atomically: to a temporary file first, then renamed.
//!
//! ```text
//! folder of the file --> .scarab-PROCESS-NUMBER.tmp --> all bytes --> rename over the file
//! ```
//!
//! A command that fails before the end leaves the file unchanged. A link stays a link: its target
//! is replaced.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::ToolError;
use crate::files::{folder_of, is_device, resolved};

/// Writes a whole file; its folder is created if missing.
///
/// # Errors
/// The file cannot be written; it is unchanged.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), ToolError> {
    let mut file = NewFile::create(path)?;
    file.write_all(bytes.as_ref()).map_err(|error| ToolError::cannot_write(path, &error))?;
    file.finish()
}

/// Writes a whole file that does not exist yet; a device is written as by [`write()`].
///
/// # Errors
/// The file exists, and is unchanged, or cannot be written.
pub fn write_new(path: &Path, text: &str) -> Result<(), ToolError> {
    if is_device(path) {
        return write(path, text);
    }
    let mut file = OpenOptions::new().write(true).create_new(true).open(path).map_err(|error| {
        if error.kind() == io::ErrorKind::AlreadyExists {
            exists(path)
        } else {
            ToolError::cannot_write(path, &error)
        }
    })?;
    file.write_all(text.as_bytes()).and_then(|()| file.sync_all()).map_err(|error| {
        let _ = std::fs::remove_file(path);
        ToolError::cannot_write(path, &error)
    })
}

/// Rejects a file that exists, before a command computes or asks anything.
///
/// # Errors
/// The file exists.
pub fn check_new(path: &Path) -> Result<(), ToolError> {
    if !is_device(path) && path.symlink_metadata().is_ok() { Err(exists(path)) } else { Ok(()) }
}

fn exists(path: &Path) -> ToolError {
    ToolError::input(format!(
        "{}: exists and is not overwritten: name another file, or remove it first",
        path.display()
    ))
}

/// File that replaces its destination when finished; without that it leaves no file.
#[derive(Debug)]
pub struct NewFile {
    out: BufWriter<File>,
    /// Path as given by the user.
    named: PathBuf,
    /// Temporary file and its destination; `None` for a device, which is written directly.
    rename: Option<(PathBuf, PathBuf)>,
}

impl NewFile {
    /// Starts a file; its folder is created if missing.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path) -> Result<Self, ToolError> {
        let cannot = |error: io::Error| ToolError::cannot_write(path, &error);
        if is_device(path) {
            let out = BufWriter::new(OpenOptions::new().append(true).open(path).map_err(cannot)?);
            return Ok(Self { out, named: path.to_owned(), rename: None });
        }
        let target = resolved(path);
        let folder = folder_of(&target);
        std::fs::create_dir_all(&folder).map_err(cannot)?;
        let (temporary, file) = temporary_in(&folder).map_err(cannot)?;
        // The permissions of the file stay unchanged.
        if let Ok(metadata) = target.metadata() {
            let _ = file.set_permissions(metadata.permissions());
        }
        Ok(Self { out: BufWriter::new(file), named: path.to_owned(), rename: Some((temporary, target)) })
    }

    /// Moves the file to its destination.
    ///
    /// # Errors
    /// The file cannot be written completely or renamed; the destination is unchanged.
    pub fn finish(mut self) -> Result<(), ToolError> {
        let named = &self.named;
        self.out.flush().map_err(|error| ToolError::cannot_write(named, &error))?;
        if let Some((temporary, target)) = &self.rename {
            std::fs::rename(temporary, target).map_err(|error| ToolError::cannot_write(named, &error))?;
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

/// Tests whether a file can be created in a folder, by creating and removing one.
pub fn can_write_in(folder: &Path) -> io::Result<()> {
    let (temporary, _) = temporary_in(folder)?;
    std::fs::remove_file(temporary)
}

/// Tests whether an existing file can be written, by opening it unchanged.
pub fn can_write_over(file: &Path) -> io::Result<()> {
    OpenOptions::new().append(true).open(file).map(drop)
}

/// Creates a file with an unused name.
fn temporary_in(folder: &Path) -> io::Result<(PathBuf, File)> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = folder.join(format!(".scarab-{}-{number}.tmp", std::process::id()));
    let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
    Ok((path, file))
}
