//! Results of a campaign's runs, from which its report is made.
//!
//! A campaign may be divided into shards. Each is computed like a whole campaign of fewer seeds; joined, the
//! results are in the order of rows and seeds and do not show by how many processes they were computed.

use scarab::safety::FaultCode;
use scarab_identify::formats::shard::ShardResults;
use serde::{Deserialize, Serialize};

use crate::faults::entry::Entry;
use crate::faults::hours::Stretch;
use crate::faults::run::{Blind, Outcome};
use crate::faulty_board::PERIODS_PER_S;

/// Results of a campaign or of a shard.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Campaign {
    /// Outcomes by row and seed.
    pub outcomes: Vec<Outcome>,
    /// Outcomes of the sweep and of two faults at once.
    pub trials: Vec<Outcome>,
    /// In a blind campaign: the forked rows' runs with every detector enabled, and with one code at a time
    /// disabled.
    pub(crate) singly: Vec<(Blind, Outcome)>,
    /// Number of runs with the emergency stop at every tick.
    pub(crate) every_tick: usize,
    /// Identifications of which the runs are forks.
    pub(crate) bases: Vec<Base>,
    /// Stretches of normal motion, where requested.
    pub hours: Option<Vec<Stretch>>,
}

/// Identification without a fault, of which runs are forks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Base {
    /// Seed of the identification.
    pub(crate) seed: u64,
    /// The torque caps are widened.
    pub(crate) widened: bool,
    /// Periods until its last fork, or until the alarm.
    pub(crate) periods: u64,
    /// Fault that was reported although there was none, with its period; the later forks are not run.
    pub(crate) alarm: Option<String>,
    /// Number of these forks.
    pub(crate) not_run: usize,
}

impl Campaign {
    /// Adds further results.
    pub fn add(&mut self, other: Self) {
        self.outcomes.extend(other.outcomes);
        self.trials.extend(other.trials);
        self.singly.extend(other.singly);
        self.every_tick += other.every_tick;
        self.bases.extend(other.bases);
        if let Some(hours) = other.hours {
            self.hours.get_or_insert_default().extend(hours);
        }
    }

    /// Results of all shards of a campaign of these rows.
    pub fn joined(parts: Vec<ShardResults<Self>>, rows: &[Entry]) -> Self {
        let mut campaign = Self::default();
        for part in parts {
            campaign.add(part.results);
        }
        let index = |id: &str| rows.iter().position(|entry| entry.fault().id == id);
        campaign.outcomes.sort_by_key(|outcome| (index(outcome.fault), outcome.seed, outcome.period));
        campaign.trials.sort_by_key(|outcome| (outcome.fault, outcome.seed));
        campaign.join_bases();
        campaign
    }

    /// Makes one of the parts of each base: the longest has what all saw, and each has forks of its own.
    fn join_bases(&mut self) {
        self.bases.sort_by_key(|base| (base.seed, base.widened));
        self.bases.dedup_by(|next, base| {
            let is_same = (next.seed, next.widened) == (base.seed, base.widened);
            if is_same {
                base.periods = base.periods.max(next.periods);
                base.alarm = base.alarm.take().or(next.alarm.take());
                base.not_run += next.not_run;
            }
            is_same
        });
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.outcomes.len() + self.trials.len() + self.singly.len()
    }

    /// Duration of motion without a fault, s.
    pub(crate) fn undisturbed_s(&self) -> f64 {
        self.bases.iter().fold(0.0, |sum, base| sum + base.periods as f64 / PERIODS_PER_S as f64)
    }

    /// Faults reported during it.
    pub(crate) fn base_alarms(&self) -> Vec<String> {
        let of = |base: &Base| {
            let alarm = base.alarm.as_ref()?;
            Some(format!("base {}, {alarm}; {} runs not run", base.seed, base.not_run))
        };
        self.bases.iter().filter_map(of).collect()
    }
}

/// Written as `none`, `row` or the name of the code.
impl Serialize for Blind {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(match self {
            Self::None => "none",
            Self::Row => "row",
            Self::Code(code) => code.name(),
        })
    }
}

impl<'de> Deserialize<'de> for Blind {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let word = String::deserialize(from)?;
        let code = || FaultCode::ALL.into_iter().find(|code| code.name() == word).map(Self::Code);
        match word.as_str() {
            "none" => Ok(Self::None),
            "row" => Ok(Self::Row),
            _ => code().ok_or_else(|| serde::de::Error::custom(format!("`{word}` is no fault code"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_base::shard::Shard;

    fn base(periods: u64, alarm: Option<&str>, not_run: usize) -> Base {
        Base { seed: 1, widened: false, periods, alarm: alarm.map(str::to_owned), not_run }
    }

    fn part(bases: Vec<Base>) -> ShardResults<Campaign> {
        ShardResults::new(Shard::WHOLE, Campaign { bases, ..Campaign::default() })
    }

    /// Only shards with a fork after the alarm run the base until then.
    #[test]
    fn a_base_alarm_is_one_whichever_shards_saw_it() {
        let alarm = Some("period 9: words");
        let later = Base { seed: 2, ..base(5, None, 0) };
        let parts = vec![
            part(vec![base(4, None, 0)]),
            part(vec![base(9, alarm, 2), later.clone()]),
            part(vec![base(9, alarm, 3)]),
        ];
        let joined = Campaign::joined(parts, &[]);
        assert_eq!(joined.bases, [base(9, alarm, 5), later]);
        assert_eq!(joined.base_alarms(), ["base 1, period 9: words; 5 runs not run"]);
        assert_eq!(joined.undisturbed_s(), 9.0 / PERIODS_PER_S as f64 + 5.0 / PERIODS_PER_S as f64);
    }

    #[test]
    fn disabled_detectors_are_read_back() {
        for blind in [Blind::None, Blind::Row].into_iter().chain(FaultCode::ALL.map(Blind::Code)) {
            let text = serde_json::to_string(&blind).expect("JSON");
            assert_eq!(serde_json::from_str::<Blind>(&text).expect("read"), blind);
        }
    }
}
