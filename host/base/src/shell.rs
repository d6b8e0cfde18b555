//! Words of a command line in messages and reports.

use crate::names::BY_CARGO;

/// Alias that runs this program.
pub const ALIAS: &str = if cfg!(feature = "readers") { "cargo sim-readers" } else { "cargo sim" };

/// Words that call this program again: the alias, or the name under which it was started.
pub fn program() -> String {
    program_of(std::env::args_os().map(|word| word.to_string_lossy().into_owned()))
}

/// Words that call a program started with these words.
pub fn program_of(words: impl IntoIterator<Item = String>) -> String {
    let mut words = words.into_iter();
    match (words.next(), words.next()) {
        (Some(own), second) if second.as_deref() != Some(BY_CARGO) && !own.is_empty() => quoted(&own),
        _ => ALIAS.to_owned(),
    }
}

/// Quotes a word for a shell.
pub fn quoted(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./:=,+".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::{ALIAS, BY_CARGO, program_of, quoted};

    #[test]
    fn a_command_can_be_given_again_as_it_is_printed() {
        assert_eq!(quoted("--prior=wrong:40"), "--prior=wrong:40");
        assert_eq!(quoted("my leg's.toml"), r"'my leg'\''s.toml'");
    }
    #[test]
    fn a_program_is_named_as_it_was_called() {
        let called = |words: &[&str]| program_of(words.iter().map(|word| (*word).to_owned()));
        assert_eq!(called(&["target/debug/scarab", BY_CARGO, "leg"]), ALIAS);
        assert_eq!(called(&["scarab", "leg"]), "scarab");
        assert_eq!(called(&["./my tools/scarab"]), "'./my tools/scarab'");
        assert_eq!(called(&[]), ALIAS);
    }
}
