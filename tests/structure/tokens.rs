//! Minimal lexer that finds the modules which a Rust source names.
//!
//! Comments, doc comments, strings and characters are dropped, so that mentioning a module in prose is not a
//! use. Identifiers and `::` stay whole; every other character is a token of its own.

/// A word or a sign of the source, and its line (from 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Token<'a> {
    pub text: &'a str,
    pub line: usize,
}

/// All tokens of a source file, in order.
pub fn tokens(source: &str) -> Vec<Token<'_>> {
    let mut found = Vec::new();
    let (mut at, mut line) = (0, 1);
    while at < source.len() {
        let rest = &source[at..];
        let (length, is_token) = next(rest);
        if is_token {
            found.push(Token { text: &rest[..length], line });
        }
        line += rest[..length].matches('\n').count();
        at += length;
    }
    found
}

/// Length in bytes of the first element of `rest`, and whether it is a token.
fn next(rest: &str) -> (usize, bool) {
    let first = rest.chars().next().unwrap_or(' ');
    if rest.starts_with("//") {
        (rest.find('\n').unwrap_or(rest.len()), false)
    } else if rest.starts_with("/*") {
        (block_comment(rest), false)
    } else if let Some(length) = string(rest).or_else(|| character(rest)) {
        (length, false)
    } else if first.is_alphabetic() || first == '_' {
        (rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len()), true)
    } else if rest.starts_with("::") {
        (2, true)
    } else {
        (first.len_utf8(), !first.is_whitespace())
    }
}

fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        let here = &rest[at..];
        if here.starts_with("/*") {
            depth += 1;
            at += 2;
        } else if here.starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += here.chars().next().map_or(1, char::len_utf8);
        }
    }
    rest.len()
}

/// Length of a string: `"..."`, `b"..."`, `c"..."` with escapes, and the raw forms with any number of `#`.
fn string(rest: &str) -> Option<usize> {
    let body = rest.trim_start_matches(['b', 'c']);
    let prefix = rest.len() - body.len();
    if prefix > 1 {
        return None;
    }
    if let Some(raw) = body.strip_prefix('r') {
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        let open = prefix + 1 + hashes + 1;
        raw[hashes..].strip_prefix('"')?;
        let close = format!("\"{}", "#".repeat(hashes));
        return Some(rest[open..].find(&close).map_or(rest.len(), |at| open + at + close.len()));
    }
    body.strip_prefix('"')?;
    Some(prefix + 1 + escaped_until(&rest[prefix + 1..], '"'))
}

/// Length of a character: `'x'` and `'\n'`, but not the lifetime `'a`.
fn character(rest: &str) -> Option<usize> {
    let body = rest.strip_prefix('\'')?;
    let mut characters = body.chars();
    let first = characters.next()?;
    (first == '\\' || characters.next() == Some('\'')).then(|| 1 + escaped_until(body, '\''))
}

/// Bytes up to and including the first unescaped `end`.
fn escaped_until(body: &str, end: char) -> usize {
    let mut escaped = false;
    for (at, character) in body.char_indices() {
        if !escaped && character == end {
            return at + 1;
        }
        escaped = !escaped && character == '\\';
    }
    body.len()
}

#[test]
fn prose_strings_and_characters_leave_no_tokens() {
    let source = "/// [`crate::ident`]\n/* crate::leg /* nested */ */ a\n\"crate::\\\" b\" r#\"c \" d\"# b'e' '\\'' 'f' f::<'g> /*";
    let texts: Vec<(&str, usize)> = tokens(source).iter().map(|token| (token.text, token.line)).collect();
    let last = [("f", 3), ("::", 3), ("<", 3), ("'", 3), ("g", 3), (">", 3)];
    assert_eq!(texts[..2], [("a", 2), ("b", 3)]);
    assert_eq!(texts[2..], last);
}
