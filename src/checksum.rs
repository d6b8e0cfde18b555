//! Checksum over words of memory that detects a changed word.
//!
//! Why no cyclic redundancy check: this one is three instructions a word without a table, and it only has to
//! detect a changed word. A step is a bijection of the sum for each word and of the word for each sum. Any
//! change within one word therefore changes the sum for certain; changes of several words pass with 2^-32.
//!
//! ```text
//! sum = (sum xor word) * 16777619 modulo 2^32
//! ```
//!
//! Source: Fowler, Noll, Vo (FNV-1a), a word at a time. Cost: 3 instructions a word.

/// Checksum over words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checksum(u32);

impl Checksum {
    /// Checksum of no words.
    pub const EMPTY: Self = Self(0x811c_9dc5);

    /// Adds one word.
    pub const fn word(self, word: u32) -> Self {
        Self((self.0 ^ word).wrapping_mul(16_777_619))
    }

    /// Adds one number, with all of its bits.
    pub const fn number(self, number: f32) -> Self {
        self.word(number.to_bits())
    }

    /// Adds several numbers.
    pub(crate) fn numbers(self, numbers: impl IntoIterator<Item = f32>) -> Self {
        numbers.into_iter().fold(self, Self::number)
    }

    /// Value of the checksum.
    pub const fn value(self) -> u32 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_bit_and_two_exchanged_words_are_detected() {
        let words = [3.5_f32, -0.0, f32::NAN, 1e-40, 7.0, 0.0];
        let sum = Checksum::EMPTY.numbers(words);
        for index in 0..words.len() {
            for bit in 0..32 {
                let mut other = words;
                other[index] = f32::from_bits(other[index].to_bits() ^ 1 << bit);
                assert_ne!(Checksum::EMPTY.numbers(other), sum, "word {index}, bit {bit}");
            }
            let mut other = words;
            other.swap(index, (index + 1) % words.len());
            assert_ne!(Checksum::EMPTY.numbers(other), sum, "words from {index}");
        }
    }
}
