//! Detects files that a command would overwrite or cannot write, before it computes anything.
//!
//! The roles of its arguments (`crate::cli::arguments::role`) define the use of each file, so one check
//! serves every command. Each written file is compared with every other file of the command, by its resolved
//! path and by its file number (hard links). Then a write is tried.

use std::any::TypeId;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Command};
use scarab_base::error::ToolError;
use scarab_base::files::write::{can_write_in, can_write_over};
use scarab_base::files::{folder_of, is_device, resolved};

use crate::cli::arguments::role::{Input, LegName, Output, OutputFolder, Updated};

/// Kinds of files that a command writes into a folder under its own names.
const WRITTEN_INTO_FOLDERS: [&str; 2] = ["svg", "eds"];

/// Use of a file by a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Input,
    Output,
    Folder,
    Updated,
}

/// One file of a command.
#[derive(Debug)]
struct Named {
    /// Option or argument of the file.
    argument: String,
    path: PathBuf,
    role: Role,
    /// Resolved path; equal for every spelling.
    resolved: PathBuf,
    /// Device and number of an existing file.
    number: Option<(u64, u64)>,
}

impl Named {
    fn new(argument: &str, path: &Path, role: Role) -> Self {
        let (resolved, number) = (resolved(path), number(path));
        Self { argument: argument.to_owned(), path: path.to_owned(), role, resolved, number }
    }

    fn is_written(&self) -> bool {
        self.role != Role::Input
    }

    fn is_same_file(&self, other: &Self) -> bool {
        self.resolved == other.resolved || self.number.is_some() && self.number == other.number
    }

    /// Whether the command may write this file into its folder under its own name.
    fn may_lie_in(&self, folder: &Self) -> bool {
        let kind = self.resolved.extension().and_then(|extension| extension.to_str()).unwrap_or("");
        folder.role == Role::Folder
            && self.resolved.parent() == Some(&folder.resolved)
            && WRITTEN_INTO_FOLDERS.contains(&kind.to_ascii_lowercase().as_str())
    }

    /// Error about this file.
    fn refused(&self, reason: &str) -> ToolError {
        ToolError::input(format!("{} {}: {reason}", self.argument, self.path.display()))
    }
}

#[cfg(unix)]
fn number(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    path.metadata().ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn number(_: &Path) -> Option<(u64, u64)> {
    None
}

/// Rejects a command line whose outputs are inputs, coincide, or cannot be written.
///
/// # Errors
/// Names option, file and reason.
pub fn check(command: &Command, matches: &ArgMatches) -> Result<(), ToolError> {
    let mut files = Vec::new();
    let (mut command, mut matches) = (command, matches);
    loop {
        command.get_arguments().for_each(|argument| collect(argument, matches, &mut files));
        let Some((name, inner)) = matches.subcommand() else { break };
        let Some(next) = command.find_subcommand(name) else { break };
        (command, matches) = (next, inner);
    }
    files.retain(|file| !is_device(&file.path));
    check_apart(&files)?;
    files.iter().filter(|file| file.is_written()).try_for_each(|file| check_writable(file, &files))
}

/// Whether the type of an argument defines the use of its file.
pub(crate) fn has_role(argument: &Arg) -> bool {
    let kind = argument.get_value_parser().type_id();
    [
        TypeId::of::<Input>(),
        TypeId::of::<LegName>(),
        TypeId::of::<Output>(),
        TypeId::of::<OutputFolder>(),
        TypeId::of::<Updated>(),
    ]
    .iter()
    .any(|role| kind == *role)
}

/// Collects the files of an argument.
fn collect(argument: &Arg, matches: &ArgMatches, files: &mut Vec<Named>) {
    if !has_role(argument) {
        return;
    }
    let name = match (argument.get_long(), argument.get_value_names()) {
        (Some(long), _) => format!("--{long}"),
        (None, Some([name, ..])) => name.to_string(),
        (None, _) => argument.get_id().to_string().to_uppercase(),
    };
    let id = argument.get_id().as_str();
    let mut add = |path: &Path, role| files.push(Named::new(&name, path, role));
    values::<Input>(matches, id).for_each(|file| add(file, Role::Input));
    values::<LegName>(matches, id).filter_map(|leg| leg.file()).for_each(|file| add(file, Role::Input));
    values::<Output>(matches, id).for_each(|file| add(file, Role::Output));
    values::<OutputFolder>(matches, id).for_each(|folder| add(folder, Role::Folder));
    values::<Updated>(matches, id).for_each(|file| add(file, Role::Updated));
}

/// Values of an argument, if they are of this type.
fn values<'a, T: Clone + Send + Sync + 'static>(
    matches: &'a ArgMatches,
    id: &str,
) -> impl Iterator<Item = &'a T> {
    matches.try_get_many::<T>(id).ok().flatten().into_iter().flatten()
}

/// Rejects files that are both read and written, or written twice.
fn check_apart(files: &[Named]) -> Result<(), ToolError> {
    for (index, written) in files.iter().enumerate().filter(|(_, file)| file.is_written()) {
        for (_, other) in files.iter().enumerate().filter(|(number, _)| *number != index) {
            let (argument, path) = (&other.argument, other.path.display());
            if written.is_same_file(other) {
                return Err(written.refused(&match other.role {
                    Role::Input => format!(
                        "is the same file as {argument} {path}, which the command reads and would overwrite: name another file"
                    ),
                    _ => format!("is the same file as {argument} {path}, which the command writes as well: name another file"),
                }));
            }
            if other.may_lie_in(written) {
                return Err(written.refused(&format!(
                    "drawings and data sheets in this folder could overwrite {argument} {path}: name another folder"
                )));
            }
        }
    }
    Ok(())
}

/// Checks that the file can be written, without leaving anything behind.
fn check_writable(file: &Named, files: &[Named]) -> Result<(), ToolError> {
    let cannot = |reason: &str| file.refused(&format!("cannot be written: {reason}"));
    let resolved = &file.resolved;
    let is_folder = file.role == Role::Folder;
    match resolved.metadata() {
        Ok(found) if is_folder && !found.is_dir() => return Err(cannot("it is a file, not a folder")),
        Ok(found) if !is_folder && found.is_dir() => return Err(cannot("it is a folder")),
        Ok(found) if !is_folder && found.permissions().readonly() => {
            return Err(cannot("it is write-protected"));
        }
        Ok(_) if !is_folder => can_write_over(resolved).map_err(|error| cannot(&error.to_string()))?,
        _ => {}
    }
    // Folders that the command creates need not exist.
    let mut folder = if is_folder { resolved.clone() } else { folder_of(resolved) };
    let is_made = is_folder
        || files.iter().any(|other| other.role == Role::Folder && folder.starts_with(&other.resolved));
    while is_made && !folder.exists() && folder_of(&folder) != folder {
        folder = folder_of(&folder);
    }
    let name = folder.display();
    if !folder.exists() {
        return Err(cannot(&format!("the folder {name} does not exist")));
    }
    if !folder.is_dir() {
        return Err(cannot(&format!("{name} is not a folder")));
    }
    can_write_in(&folder)
        .map_err(|error| cannot(&format!("no file can be created in the folder {name}: {error}")))
}
