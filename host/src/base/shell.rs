//! Words of a command line in messages and reports.

/// Quotes a word for a shell.
#[must_use]
pub fn quoted(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./:=,+".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_command_can_be_given_again_as_it_is_printed() {
        assert_eq!(quoted("--prior=wrong:40"), "--prior=wrong:40");
        assert_eq!(quoted("my leg's.toml"), r"'my leg'\''s.toml'");
    }
}
