//! Words for what the TOML reader refuses.

/// Likeness (Jaro and Winkler, 0 to 1) from which a known word is proposed.
const ALIKE: f64 = 0.8;

/// Reason in one line; for an unknown key or value with the known word that is most like it.
#[must_use]
pub fn reason(fault: &toml::de::Error) -> String {
    let reason = fault.message().replace('\n', ", ");
    match proposal(&reason) {
        Some(word) => format!("{reason}; did you mean `{word}`?"),
        None => reason,
    }
}

/// The reader writes "unknown field `a`, expected one of `b`, `c`": the first word is the wrong one.
fn proposal(reason: &str) -> Option<&str> {
    if !reason.starts_with("unknown ") {
        return None;
    }
    let mut words = reason.split('`').skip(1).step_by(2);
    let wrong = words.next()?;
    words
        .map(|word| (strsim::jaro_winkler(wrong, word), word))
        .filter(|(likeness, _)| *likeness >= ALIKE)
        .max_by(|one, other| one.0.total_cmp(&other.0))
        .map(|(_, word)| word)
}

#[cfg(test)]
mod tests {
    use super::proposal;

    #[test]
    fn a_misspelt_key_is_answered_with_the_nearest_one() {
        assert_eq!(proposal("unknown field `viscos`, expected one of `mass`, `viscous`"), Some("viscous"));
        assert_eq!(proposal("unknown variant `moter`, expected `motor` or `joint`"), Some("motor"));
        assert_eq!(proposal("unknown field `colour`, expected one of `mass`, `com`"), None);
        assert_eq!(proposal("missing field `name`"), None);
    }
}
