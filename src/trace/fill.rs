//! Writer of a record's line: the format's placeholders in order, each with its value.
//!
//! The format is `defmt`'s; it uses only `{=type}`, `{=type:#x}` and text. On the device the same string is
//! compiled into the image and never read. Here it is read at run time, so both ways write the same line.

use core::fmt::{Result, Write};

/// A value that can follow a key.
pub(crate) trait Value {
    /// Writes the value as [`super::Line`] reads it back.
    fn put(&self, out: &mut dyn Write) -> Result;
    /// Writes a whole number in base 16, with `0x`; other values as [`Self::put`].
    fn put_hex(&self, out: &mut dyn Write) -> Result {
        self.put(out)
    }
}

macro_rules! whole {
    ($($type:ty),*) => {$(
        impl Value for $type {
            fn put(&self, out: &mut dyn Write) -> Result {
                write!(out, "{self}")
            }
            fn put_hex(&self, out: &mut dyn Write) -> Result {
                write!(out, "{self:#x}")
            }
        }
    )*};
}
whole!(u8, u16, u32, u64, i32);

impl Value for f32 {
    fn put(&self, out: &mut dyn Write) -> Result {
        write!(out, "{self:?}")
    }
}

impl Value for bool {
    fn put(&self, out: &mut dyn Write) -> Result {
        write!(out, "{self}")
    }
}

impl Value for &str {
    fn put(&self, out: &mut dyn Write) -> Result {
        out.write_str(self)
    }
}

impl<V: Value, const N: usize> Value for [V; N] {
    fn put(&self, out: &mut dyn Write) -> Result {
        out.write_str("[")?;
        for (index, value) in self.iter().enumerate() {
            if index > 0 {
                out.write_str(", ")?;
            }
            value.put(out)?;
        }
        out.write_str("]")
    }
}

/// Type of a field as a format names it.
pub(super) trait Hint {
    /// The name.
    const HINT: &'static str;
}

macro_rules! hints {
    ($($type:ty: $hint:literal),*) => {$(
        impl Hint for $type {
            const HINT: &'static str = $hint;
        }
    )*};
}
hints!(u8: "u8", u16: "u16", u32: "u32", u64: "u64", f32: "f32", bool: "bool", &str: "str");

impl<V, const N: usize> Hint for [V; N] {
    const HINT: &'static str = "?";
}

/// Writes `format` with `values` at its placeholders; a placeholder without a value stays empty.
pub(super) fn fill(format: &str, values: &[&dyn Value], out: &mut dyn Write) -> Result {
    let mut values = values.iter();
    for (index, piece) in format.split('{').enumerate() {
        let text = match piece.split_once('}') {
            Some((hint, text)) if index > 0 => {
                match values.next() {
                    Some(value) if hint.ends_with(":#x") => value.put_hex(out)?,
                    Some(value) => value.put(out)?,
                    None => {}
                }
                text
            }
            _ => piece,
        };
        out.write_str(text)?;
    }
    Ok(())
}

/// True if a format is a kind, the record's number, and these fields with their types. Base 16 is allowed.
///
/// For constant evaluation: a text outside its bounds would be an error of the compiler.
pub(super) const fn is_format_of(format: &str, fields: &[(&str, &str)]) -> bool {
    let format = format.as_bytes();
    let mut at = 0;
    while at < format.len() && matches!(format[at], b'a'..=b'z' | b'0'..=b'9' | b'_') {
        at += 1;
    }
    let begins = at > 0;
    let (mut at, mut is_right) = after(format, at, " n={=u32}");
    is_right &= begins;
    let mut field = 0;
    while field < fields.len() {
        let (name, hint) = fields[field];
        let mut part = 0;
        let parts = [" ", name, "={=", hint];
        while part < parts.len() {
            let found = after(format, at, parts[part]);
            (at, is_right) = (found.0, is_right && found.1);
            part += 1;
        }
        // Base 16.
        (at, _) = after(format, at, ":#x");
        let found = after(format, at, "}");
        (at, is_right) = (found.0, is_right && found.1);
        field += 1;
    }
    is_right && at == format.len()
}

/// Offset behind `part`, if the text goes on with it; else the same offset.
const fn after(text: &[u8], at: usize, part: &str) -> (usize, bool) {
    let part = part.as_bytes();
    let mut offset = 0;
    while offset < part.len() {
        if at + offset >= text.len() || text[at + offset] != part[offset] {
            return (at, false);
        }
        offset += 1;
    }
    (at + offset, true)
}

#[cfg(test)]
mod tests {
    use super::is_format_of;

    #[test]
    fn a_format_has_the_keys_and_types_of_its_fields_in_their_order() {
        let is = |format: &str| is_format_of(format, &[("tick", "u32"), ("name", "str")]);
        assert!(is("kind n={=u32} tick={=u32} name={=str}"));
        assert!(is("kind n={=u32} tick={=u32:#x} name={=str}"));
        for other in [
            "",
            " n={=u32} tick={=u32} name={=str}",
            "kind tick={=u32} name={=str}",
            "kind n={=u32} name={=str} tick={=u32}",
            "kind n={=u32} tick={=u16} name={=str}",
            "kind n={=u32} tick={=u32}",
            "kind n={=u32} tick={=u32} name={=str} more={=u8}",
            "kind n={=u32} ticks={=u32} name={=str}",
        ] {
            assert!(!is(other), "{other}");
        }
    }
}
