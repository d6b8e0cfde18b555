//! Division of a campaign's runs among processes.
//!
//! ```text
//! of each list of n runs, numbered from 0, shard I of N takes  floor((I - 1) n / N)  to  floor(I n / N) - 1
//! ```
//!
//! The rule depends on nothing else, so the shards of one campaign need not know of each other. Blocks rather
//! than every N-th run: runs with neighbouring seeds share work (`faults::campaign`), and the shards in their
//! order are the runs in theirs.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Limit of the shards.
const MOST_SHARDS: u64 = 100_000;

/// One of the parts of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "Stated")]
pub struct Shard {
    index: u64,
    count: u64,
}

/// Shard as written in a file.
#[derive(Deserialize)]
struct Stated {
    index: u64,
    count: u64,
}

impl Shard {
    /// The whole campaign.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// Shard number `index`, from 1, of `count`.
    ///
    /// # Errors
    /// There is no such shard.
    pub fn new(index: u64, count: u64) -> Result<Self, String> {
        if !(1..=MOST_SHARDS).contains(&count) {
            return Err(format!("{count} shards; a campaign has 1 to {MOST_SHARDS}"));
        }
        if !(1..=count).contains(&index) {
            return Err(format!("shard {index} of {count}; shards are numbered from 1 to {count}"));
        }
        Ok(Self { index, count })
    }

    /// Number of the shard, from 1.
    pub const fn index(self) -> u64 {
        self.index
    }

    /// Number of all shards.
    pub const fn count(self) -> u64 {
        self.count
    }

    /// Numbers, from 0, of the shard's runs among `runs`.
    pub fn range(self, runs: usize) -> Range<usize> {
        let bound = |index: u64| (u128::from(index) * runs as u128 / u128::from(self.count)) as usize;
        bound(self.index - 1)..bound(self.index)
    }

    /// The shard's runs.
    pub fn part<T>(self, runs: &[T]) -> &[T] {
        runs.get(self.range(runs.len())).unwrap_or_default()
    }
}

impl TryFrom<Stated> for Shard {
    type Error = String;

    fn try_from(stated: Stated) -> Result<Self, String> {
        Self::new(stated.index, stated.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').map(|(index, count)| (index.parse(), count.parse()));
        match parts {
            Some((Ok(index), Ok(count))) => Self::new(index, count),
            _ => Err(format!("`{text}` is not I/N, for example 2/8")),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} of {}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_one_shard_and_shards_differ_by_at_most_one_run() {
        for (runs, count) in [(0, 1), (1, 1), (7, 3), (3, 7), (200, 16), (1_000_000, 99_999)] {
            let all: Vec<usize> = (0..runs).collect();
            let parts = (1..=count).map(|index| Shard::new(index, count).expect("a shard").part(&all));
            let lengths: Vec<usize> = parts.clone().map(<[usize]>::len).collect();
            let (least, most) = (lengths.iter().min(), lengths.iter().max());
            assert!(most.zip(least).is_some_and(|(most, least)| most - least <= 1), "{runs} in {count}");
            assert_eq!(parts.flatten().copied().collect::<Vec<_>>(), all, "{runs} in {count}");
        }
    }

    #[test]
    fn only_shards_from_one_to_their_number_exist() {
        assert_eq!("2/3".parse::<Shard>(), Shard::new(2, 3));
        for (text, words) in [
            ("0/3", "shard 0 of 3; shards are numbered from 1 to 3"),
            ("4/3", "shard 4 of 3"),
            ("1/0", "0 shards; a campaign has 1 to 100000"),
            ("1/100001", "100001 shards"),
            ("2", "`2` is not I/N"),
            ("1/2/3", "is not I/N"),
            ("-1/3", "is not I/N"),
        ] {
            let refusal = text.parse::<Shard>().expect_err(text);
            assert!(refusal.contains(words), "{text}: {refusal}");
        }
        assert!(serde_json::from_str::<Shard>(r#"{"index":4,"count":3}"#).is_err());
    }
}
