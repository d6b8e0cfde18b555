//! Parser of one trace line.
//!
//! Nothing is copied: a [`Line`] borrows the text and searches it for each key. Readers ignore unknown keys,
//! so an older reader understands a newer trace.

use core::str::FromStr;

/// Reason why a line or a value cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError<'a> {
    /// The line does not begin with a kind.
    Kind,
    /// The text is not a `key=value` pair, or is a list without an end.
    Pair(&'a str),
    /// The line has no such key.
    Missing(&'a str),
    /// The value of this key has the wrong type.
    Value(&'a str),
}

/// One line; see the grammar of [`super`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line<'a> {
    kind: &'a str,
    pairs: &'a str,
}

impl<'a> Line<'a> {
    /// Parses a line and checks all of its pairs.
    ///
    /// # Errors
    /// [`LineError::Kind`], [`LineError::Pair`].
    pub fn parse(text: &'a str) -> Result<Self, LineError<'a>> {
        let text = text.trim_end();
        let (kind, pairs) = text.split_once(' ').unwrap_or((text, ""));
        if !is_word(kind) {
            return Err(LineError::Kind);
        }
        let line = Self { kind, pairs };
        let mut pairs = line.pairs();
        match pairs.find(Result::is_err) {
            Some(Err(error)) => Err(error),
            _ => Ok(line),
        }
    }

    /// Kind of the record.
    pub fn kind(&self) -> &'a str {
        self.kind
    }

    /// Record number since the start.
    ///
    /// # Errors
    /// [`LineError::Missing`], [`LineError::Value`].
    pub fn number(&self) -> Result<u32, LineError<'static>> {
        self.value("n")
    }

    /// Keys and values in order.
    pub fn pairs(&self) -> impl Iterator<Item = Result<(&'a str, &'a str), LineError<'a>>> + use<'a> {
        let mut rest = self.pairs;
        core::iter::from_fn(move || {
            if rest.is_empty() {
                return None;
            }
            let pair = take_pair(rest);
            rest = match pair {
                Ok((_, _, after)) => after,
                Err(_) => "",
            };
            Some(pair.map(|(key, value, _)| (key, value)))
        })
    }

    /// Value of a key as text.
    ///
    /// # Errors
    /// [`LineError::Missing`].
    pub fn text<'k>(&self, key: &'k str) -> Result<&'a str, LineError<'k>> {
        let mut pairs = self.pairs().filter_map(Result::ok);
        pairs.find(|(found, _)| *found == key).map(|(_, value)| value).ok_or(LineError::Missing(key))
    }

    /// Value of a key as a number or a truth value.
    ///
    /// # Errors
    /// [`LineError::Missing`], [`LineError::Value`].
    pub fn value<'k, V: FromStr>(&self, key: &'k str) -> Result<V, LineError<'k>> {
        self.text(key)?.parse().map_err(|_| LineError::Value(key))
    }
}

fn is_word(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'_'))
}

/// Splits off the first pair: key, value, and the rest after the following space.
fn take_pair(text: &str) -> Result<(&str, &str, &str), LineError<'_>> {
    let whole = text.split(' ').next().unwrap_or(text);
    let (key, rest) = text.split_once('=').ok_or(LineError::Pair(whole))?;
    let end = if rest.starts_with('[') {
        rest.find(']').map(|index| index + 1).ok_or(LineError::Pair(whole))?
    } else {
        rest.find(' ').unwrap_or(rest.len())
    };
    let (value, after) = rest.split_at_checked(end).ok_or(LineError::Pair(whole))?;
    let after = match after.strip_prefix(' ') {
        Some(after) => after,
        None if after.is_empty() => after,
        None => return Err(LineError::Pair(whole)),
    };
    if !is_word(key) || value.is_empty() {
        return Err(LineError::Pair(whole));
    }
    Ok((key, value, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_found_by_their_key_in_any_order() {
        let line =
            Line::parse("log n=7 position_rad=[0.5, -1e-7] segment=1 status=0x1f passed=true name=-\n")
                .expect("a line");
        assert_eq!((line.kind(), line.number()), ("log", Ok(7)));
        assert_eq!(line.text("position_rad"), Ok("[0.5, -1e-7]"));
        assert_eq!(line.value::<u8>("segment"), Ok(1));
        assert_eq!(line.text("status"), Ok("0x1f"));
        assert_eq!(line.value::<bool>("passed"), Ok(true));
        assert_eq!(line.text("name"), Ok("-"));
        assert_eq!(line.pairs().count(), 6);
    }

    #[test]
    fn what_is_no_line_is_refused_and_not_guessed() {
        assert_eq!(Line::parse(""), Err(LineError::Kind));
        assert_eq!(Line::parse("Kind a=1"), Err(LineError::Kind));
        assert_eq!(Line::parse("kind a"), Err(LineError::Pair("a")));
        assert_eq!(Line::parse("kind a= b=1"), Err(LineError::Pair("a=")));
        assert_eq!(Line::parse("kind a=[1, 2"), Err(LineError::Pair("a=[1,")));
        assert_eq!(Line::parse("kind a=[1]b=2"), Err(LineError::Pair("a=[1]b=2")));
        assert_eq!(Line::parse("kind A=1"), Err(LineError::Pair("A=1")));
        let line = Line::parse("kind a=x c=[1, 2]").expect("a line");
        assert_eq!(line.value::<u8>("a"), Err(LineError::Value("a")));
        assert_eq!(line.value::<u8>("b"), Err(LineError::Missing("b")));
    }
}
