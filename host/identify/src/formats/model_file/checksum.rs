//! Checksum of a file's content, independent of its formatting.
//!
//! Keys enter in alphabetical order, each value with its kind and length, floats by their bits.
//! Spaces, comments and the order of keys have no effect; every number and word has.

use crc::{CRC_64_XZ, Crc, Digest, Table};
use toml::Value;

const CODE: Crc<u64, Table<1>> = Crc::<u64, Table<1>>::new(&CRC_64_XZ);
/// Key of the checksum.
pub(super) const KEY: &str = "checksum";

/// Checksum of a parsed file, without the checksum itself.
pub(super) fn of_table(file: &toml::Table) -> String {
    let mut digest = CODE.digest();
    let others: Vec<_> = file.iter().filter(|(key, _)| *key != KEY).collect();
    table(&mut digest, others);
    format!("crc-64:{:016x}", digest.finalize())
}

fn table(digest: &mut Digest<'_, u64, Table<1>>, mut entries: Vec<(&String, &Value)>) {
    entries.sort_by_key(|(key, _)| *key);
    begin(digest, b't', entries.len());
    for (key, entry) in entries {
        word(digest, key);
        value(digest, entry);
    }
}

fn begin(digest: &mut Digest<'_, u64, Table<1>>, kind: u8, length: usize) {
    digest.update(&[kind]);
    digest.update(&(length as u64).to_le_bytes());
}

fn word(digest: &mut Digest<'_, u64, Table<1>>, word: &str) {
    begin(digest, b's', word.len());
    digest.update(word.as_bytes());
}

fn value(digest: &mut Digest<'_, u64, Table<1>>, of: &Value) {
    match of {
        Value::String(text) => word(digest, text),
        Value::Integer(number) => {
            digest.update(b"i");
            digest.update(&number.to_le_bytes());
        }
        Value::Float(number) => {
            digest.update(b"f");
            digest.update(&number.to_bits().to_le_bytes());
        }
        Value::Boolean(truth) => digest.update(&[b'b', u8::from(*truth)]),
        Value::Datetime(instant) => word(digest, &instant.to_string()),
        Value::Array(entries) => {
            begin(digest, b'a', entries.len());
            entries.iter().for_each(|entry| value(digest, entry));
        }
        Value::Table(inner) => table(digest, inner.iter().collect()),
    }
}
