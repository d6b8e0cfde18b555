//! Writer of a record's line: the format's placeholders in order, each with its value.
//!
//! The format is `defmt`'s; it uses only `{=type}`, `{=type:#x}` and text. On the device the same string is
//! compiled into the image and never read. Here it is read at run time, so both ways write the same line.

use core::fmt::{Result, Write};

/// A value that can follow a key.
pub trait Value {
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
        for (place, value) in self.iter().enumerate() {
            if place > 0 {
                out.write_str(", ")?;
            }
            value.put(out)?;
        }
        out.write_str("]")
    }
}

/// Writes `format` with `values` at its placeholders; a placeholder without a value stays empty.
pub(super) fn fill(format: &str, values: &[&dyn Value], out: &mut dyn Write) -> Result {
    let mut values = values.iter();
    for (place, piece) in format.split('{').enumerate() {
        let text = match piece.split_once('}') {
            Some((hint, text)) if place > 0 => {
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
