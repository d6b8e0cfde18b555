//! Files on the command line.
//!
//! Why in one place: a command that overwrites its own recording destroys the data. The files of every
//! command are therefore checked before any computation.
//!
//! | part | contents |
//! | --- | --- |
//! | `role` | types of arguments that define the use of a file |
//! | `choice` | parser of arguments that are one of a few words |
//! | [`mod@check`] | detects files that a command would overwrite or cannot write |
//! | `stated` | arguments that shards of one campaign have in common |
//!
//! Known limits: names that differ in case only count as different files, even on file systems that ignore
//! case. Redirections of the shell are not checked.

pub mod check;
pub(crate) mod choice;
pub(crate) mod role;
pub(crate) mod stated;

pub(crate) use check::check;
pub use choice::{Choice, one_of};
pub use role::{Input, LegName, Output, OutputFolder, Updated};
pub(crate) use stated::stated;
