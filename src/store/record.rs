//! Byte format of a record: two bytes of schema, then a fixed layout that only ever grows at its end.
//!
//! This rule gives migration without code per version. A record of an older schema is the beginning of a
//! newer one; missing fields take the layout's default. A record of a newer schema is refused, because its
//! meaning is unknown. The flash log's CRCs protect its bits. [`Storable::from_layout`] checks its meaning
//! and refuses values out of range.

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

/// Bytes of the schema before a layout.
pub(super) const HEAD: usize = 2;

/// Largest supported layout.
pub(super) const LONGEST: usize = 400;

/// Reason why a record is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordError {
    /// The length differs from the schema's.
    Length,
    /// The schema is newer than this firmware.
    Newer {
        /// Schema of the record.
        schema: u16,
    },
    /// A value is not finite, not positive where it must be, or not in its list.
    Range,
}

/// A value that can be stored.
pub trait Storable: Sized {
    /// Layout in the flash: plain bytes, little-endian, without gaps. Its default fills
    /// fields that older schemas lack.
    type Layout: FromBytes + IntoBytes + Immutable + KnownLayout + Unaligned + Default;
    /// Length of each schema's layout in bytes, from schema 1 on; the last is that of `Layout`.
    const LENGTHS: &'static [usize];

    /// Converts the value to its layout.
    fn to_layout(&self) -> Self::Layout;

    /// Converts a layout to the value.
    ///
    /// # Errors
    /// [`RecordError::Range`].
    fn from_layout(layout: &Self::Layout) -> Result<Self, RecordError>;
}

/// Writes a record of the newest schema and returns its length.
pub(super) fn encode<R: Storable>(value: &R, out: &mut [u8]) -> Result<usize, RecordError> {
    let layout = value.to_layout();
    // A record that would be refused on reading is not stored.
    R::from_layout(&layout)?;
    let bytes = layout.as_bytes();
    let (head, rest) = out.split_at_mut_checked(HEAD).ok_or(RecordError::Length)?;
    head.copy_from_slice(&(R::LENGTHS.len() as u16).to_le_bytes());
    rest.get_mut(..bytes.len()).ok_or(RecordError::Length)?.copy_from_slice(bytes);
    Ok(HEAD + bytes.len())
}

/// Reads a record of any known schema.
pub(super) fn decode<R: Storable>(bytes: &[u8]) -> Result<R, RecordError> {
    let Some((&[low, high], rest)) = bytes.split_first_chunk::<HEAD>() else {
        return Err(RecordError::Length);
    };
    let schema = u16::from_le_bytes([low, high]);
    let newer = RecordError::Newer { schema };
    let length = *R::LENGTHS.get(usize::from(schema.checked_sub(1).ok_or(newer)?)).ok_or(newer)?;
    let mut layout = R::Layout::default();
    match layout.as_mut_bytes().get_mut(..length) {
        Some(into) if rest.len() == length => into.copy_from_slice(rest),
        _ => return Err(RecordError::Length),
    }
    R::from_layout(&layout)
}

#[cfg(test)]
mod tests {
    use zerocopy::little_endian::{F32, U16};

    use super::*;
    use crate::testing::TestRandom;

    #[derive(FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
    #[repr(C)]
    struct Layout {
        number: U16,
        /// Added in schema 2.
        share: F32,
        /// Added in schema 3.
        word: [u8; 3],
    }

    impl Default for Layout {
        fn default() -> Self {
            Self { number: U16::new(0), share: F32::new(0.5), word: *b"new" }
        }
    }

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Value {
        number: u16,
        share: f32,
        word: [u8; 3],
    }

    impl Storable for Value {
        type Layout = Layout;
        const LENGTHS: &'static [usize] = &[2, 6, 9];

        fn to_layout(&self) -> Layout {
            Layout { number: U16::new(self.number), share: F32::new(self.share), word: self.word }
        }

        fn from_layout(layout: &Layout) -> Result<Self, RecordError> {
            let share = layout.share.get();
            if !(0.0..=1.0).contains(&share) {
                return Err(RecordError::Range);
            }
            Ok(Self { number: layout.number.get(), share, word: layout.word })
        }
    }

    const VALUE: Value = Value { number: 0x1234, share: 0.25, word: *b"abc" };

    #[test]
    fn an_older_record_takes_the_defaults_of_what_it_lacks() {
        assert_eq!(decode::<Value>(&[1, 0, 7, 0]), Ok(Value { number: 7, share: 0.5, word: *b"new" }));
        let second = [2, 0, 7, 0, 0, 0, 0x80, 0x3E];
        assert_eq!(decode::<Value>(&second), Ok(Value { number: 7, share: 0.25, word: *b"new" }));
    }

    #[test]
    fn newer_cut_long_and_senseless_records_are_refused_by_name() {
        let newer = |schema| Err(RecordError::Newer { schema });
        assert_eq!(decode::<Value>(&[4, 0, 7, 0]), newer(4));
        assert_eq!(decode::<Value>(&[0, 0, 7, 0]), newer(0));
        assert_eq!(decode::<Value>(&[0xFF; 11]), newer(0xFFFF));
        for bytes in [&[][..], &[1], &[1, 0], &[1, 0, 7], &[1, 0, 7, 0, 0], &[3, 0, 7, 0]] {
            assert_eq!(decode::<Value>(bytes), Err(RecordError::Length), "{bytes:?}");
        }
        let nan = [2, 0, 7, 0, 0, 0, 0xC0, 0x7F];
        assert_eq!(decode::<Value>(&nan), Err(RecordError::Range));
    }

    #[test]
    fn what_would_not_be_taken_back_is_not_kept() {
        let wrong = Value { share: f32::INFINITY, ..VALUE };
        assert_eq!(encode(&wrong, &mut [0; 16]), Err(RecordError::Range));
        assert_eq!(encode(&VALUE, &mut [0; 10]), Err(RecordError::Length));
        assert_eq!(encode(&VALUE, &mut [0; 1]), Err(RecordError::Length));
    }

    #[test]
    fn no_byte_string_makes_the_reader_panic() {
        let mut random = TestRandom::new(1);
        for length in 0..40 {
            for _ in 0..200 {
                let mut bytes = [0; 40];
                bytes.fill_with(|| random.byte());
                bytes[1] = 0;
                bytes[0] %= 5;
                let _ = decode::<Value>(&bytes[..length]);
            }
        }
    }
}
