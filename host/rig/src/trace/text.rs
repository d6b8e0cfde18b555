//! Finds the record in a line of text.
//!
//! A debug probe's program puts time, level, source location or colours around the board's line. A
//! record is a kind followed by ` n=` and digits. At the start of a line any kind is accepted,
//! elsewhere only a known one.

use std::borrow::Cow;

use scarab::trace::{Line, LineError};

use crate::trace::records::Kind;

/// Record within a line; `None` for a line without one.
pub fn record(line: &str) -> Option<Cow<'_, str>> {
    let line = without_colours(line);
    let (start, end) = span(&line)?;
    Some(match line {
        Cow::Borrowed(line) => Cow::Borrowed(&line[start..end]),
        Cow::Owned(line) => Cow::Owned(line[start..end].to_owned()),
    })
}

/// Start and end of the record.
fn span(line: &str) -> Option<(usize, usize)> {
    let trimmed = line.trim_end();
    for (at, _) in trimmed.match_indices(" n=") {
        let digits = trimmed[at + 3..].split(' ').next().unwrap_or("");
        let before = &trimmed[..at];
        let kind = before.rsplit(|letter: char| !is_letter(letter)).next().unwrap_or("");
        let prefix = &before[..before.len() - kind.len()];
        let is_alone = prefix.trim().is_empty();
        let is_apart = is_alone || prefix.ends_with([' ', '\t', ']', ':', '>']);
        if kind.is_empty()
            || !is_number(digits)
            || !is_apart
            || !(is_alone || Kind::from_name(kind).is_some())
        {
            continue;
        }
        return Some((prefix.len(), end(trimmed, prefix.len())));
    }
    None
}

/// End of the record without the source location that a logger appends, ` (scarab src/leg/control.rs:12)`.
fn end(line: &str, start: usize) -> usize {
    let without = line.ends_with(')').then(|| line.rfind(" (")).flatten();
    match without {
        Some(at) if at > start && matches!(Line::parse(&line[start..]), Err(LineError::Pair(_))) => {
            line[..at].trim_end().len()
        }
        _ => line.len(),
    }
}

const fn is_letter(letter: char) -> bool {
    matches!(letter, 'a'..='z' | '0'..='9' | '_')
}

fn is_number(digits: &str) -> bool {
    !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit())
}

/// Removes terminal colours (`ESC [ ... letter`).
fn without_colours(line: &str) -> Cow<'_, str> {
    if !line.contains('\u{1b}') {
        return Cow::Borrowed(line);
    }
    let mut plain = String::with_capacity(line.len());
    let mut parts = line.split('\u{1b}');
    plain.extend(parts.next());
    for part in parts {
        let rest = part.strip_prefix('[').unwrap_or(part);
        let end = rest.find(|letter: char| letter.is_ascii_alphabetic()).map_or(rest.len(), |at| at + 1);
        plain.push_str(&rest[end..]);
    }
    Cow::Owned(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_found_behind_a_logger_s_prefix() {
        let plain = "fault n=7 tick=12 code=0x8400 name=overspeed joint=1";
        for line in [
            plain.to_owned(),
            format!("  {plain}\r\n"),
            format!("0.000274 INFO  {plain}"),
            format!("12:03:44.120 [INFO ] {plain} (scarab src/trace/record.rs:12)"),
            format!("\u{1b}[32m[INFO ]\u{1b}[0m {plain} \u{1b}[2m(scarab record.rs:12)\u{1b}[0m"),
            format!("0x20000400: {plain}"),
        ] {
            assert_eq!(record(&line).as_deref(), Some(plain), "{line}");
        }
    }

    #[test]
    fn text_that_is_not_a_record_is_rejected() {
        for line in [
            "",
            "      Erasing sectors [00:00:01]",
            "the loop ran with n=4 of 5",
            "note: loops n=many",
            "nofault n = 7",
            "INFO later_kind n=7 a=1",
            "a-fault n=7",
        ] {
            assert_eq!(record(line), None, "{line}");
        }
        // Without a prefix, an unknown kind is accepted too.
        assert_eq!(record("later_kind n=7 a=1").as_deref(), Some("later_kind n=7 a=1"));
    }
}
