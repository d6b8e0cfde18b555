//! Types of command-line arguments that define the use of a file.

use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::builder::{
    MapValueParser, PathBufValueParser, StringValueParser, TypedValueParser, ValueParserFactory,
};

use scarab_identify::formats::leg_file::SHIPPED_LEGS;

/// Declares a path in a role, as an argument of the command line.
macro_rules! role {
    ($(#[$words:meta])* $name:ident) => {
        $(#[$words])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub struct $name(PathBuf);

        impl Deref for $name {
            type Target = Path;

            fn deref(&self) -> &Path {
                &self.0
            }
        }

        impl ValueParserFactory for $name {
            type Parser = MapValueParser<PathBufValueParser, fn(PathBuf) -> Self>;

            fn value_parser() -> Self::Parser {
                PathBufValueParser::new().map(Self)
            }
        }
    };
}

role! {
    /// File that is only read.
    Input
}
role! {
    /// File that is written as a whole.
    Output
}
role! {
    /// Folder for output files; created if missing.
    OutputFolder
}
role! {
    /// File that is read and written again.
    Updated
}

/// Shipped leg by its name, or a leg file that is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LegName(String);

impl LegName {
    /// File, unless a shipped leg is meant.
    pub(crate) fn file(&self) -> Option<&Path> {
        let is_shipped = SHIPPED_LEGS.iter().any(|(name, _)| *name == self.0);
        (!is_shipped).then(|| Path::new(&self.0))
    }
}

impl Deref for LegName {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl ValueParserFactory for LegName {
    type Parser = MapValueParser<StringValueParser, fn(String) -> Self>;

    fn value_parser() -> Self::Parser {
        StringValueParser::new().map(Self)
    }
}
