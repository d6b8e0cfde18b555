//! Reads back what reports write: words of closed lists, and numbers that may not be finite.
//!
//! Reports name things with words of the program (`&'static str`). A report read from a file holds the same
//! words; each distinct one is stored once and lives as long as the process.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Deserializer};

/// Word of a closed list. The alias lets a field be read by [`word`], which a plain `&'static str` cannot be.
pub type Word = &'static str;

/// Reads a word.
pub fn word<'de, D: Deserializer<'de>>(from: D) -> Result<Word, D::Error> {
    String::deserialize(from).map(stored)
}

/// Reads a list of words.
pub fn words<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Word>, D::Error> {
    Ok(Vec::<String>::deserialize(from)?.into_iter().map(stored).collect())
}

/// Reads a word that may be missing.
pub fn optional_word<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Word>, D::Error> {
    Ok(Option::<String>::deserialize(from)?.map(stored))
}

fn stored(word: String) -> Word {
    static WORDS: Mutex<BTreeSet<Word>> = Mutex::new(BTreeSet::new());
    let mut words = WORDS.lock().unwrap_or_else(PoisonError::into_inner);
    match words.get(word.as_str()) {
        Some(known) => known,
        None => {
            let new: Word = Box::leak(word.into_boxed_str());
            words.insert(new);
            new
        }
    }
}

/// Numbers that are read back bit for bit (`#[serde(with = "exact")]`), written as text: JSON has no infinity
/// and no NaN.
pub mod exact {
    use serde::{Deserialize, Deserializer, Serializer, de};

    /// Writes a number.
    pub fn serialize<S: Serializer>(number: &f64, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(number)
    }

    /// Reads a number.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        String::deserialize(from)?.parse().map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_stored_once() {
        let read = || word(&mut serde_json::Deserializer::from_str("\"kg m\"")).expect("a word");
        assert_eq!(read(), "kg m");
        assert!(core::ptr::eq(read(), read()));
    }

    #[test]
    fn every_number_is_read_back_bit_for_bit() {
        for number in [0.1 + 0.2, -0.0, 5e-324, f64::MAX, 1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            let mut text = Vec::new();
            exact::serialize(&number, &mut serde_json::Serializer::new(&mut text)).expect("JSON");
            let read =
                exact::deserialize(&mut serde_json::Deserializer::from_slice(&text)).expect("a number");
            assert!(read.to_bits() == number.to_bits() || read.is_nan() && number.is_nan(), "{text:?}");
        }
    }
}
