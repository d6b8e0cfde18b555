//! Standard output.

use std::io::{ErrorKind, Write};

use super::error::ToolError;

/// Writes to standard output; a pipe closed by its reader is not an error.
pub fn print(text: &str) -> Result<(), ToolError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(ToolError::input(format!("standard output cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// Text of a node, an adapter or a file as one line of a terminal: control characters are escaped.
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '"' | '\'' | '\\' => shown.push(letter),
            _ => shown.extend(letter.escape_debug()),
        }
    }
    shown
}

/// `println!` through [`print()`]: returns from the function if standard output cannot be written.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::output::print(&format!("{}\n", format_args!($($text)*)))? };
}
pub use say;
