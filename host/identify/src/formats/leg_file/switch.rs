//! Selection of a model term: always, never, or decided by the data.

use serde::{Deserialize, Serialize};

/// Whether a term is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", into = "Written", try_from = "Written")]
pub enum Switch {
    /// Estimated if the data show it.
    Auto,
    /// Always estimated.
    On,
    /// Never estimated.
    Off,
    /// Always estimated, and known to be zero within this standard deviation, N m.
    Within(f64),
}

/// A [`Switch`] as in leg files: a word, or `{ within_nm = 0.2 }`.
#[derive(Deserialize, Serialize)]
#[serde(untagged)]
enum Written {
    Word(String),
    Within(Within),
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Within {
    within_nm: f64,
}

impl From<Switch> for Written {
    fn from(switch: Switch) -> Self {
        match switch {
            Switch::Within(within_nm) => Self::Within(Within { within_nm }),
            _ => Self::Word(switch.name().into()),
        }
    }
}

impl TryFrom<Written> for Switch {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::Within(Within { within_nm }) => Ok(Self::Within(within_nm)),
            Written::Word(word) => {
                let known = [Self::Auto, Self::On, Self::Off].into_iter().find(|known| known.name() == word);
                known.ok_or_else(|| format!("unknown variant `{word}`, expected one of `auto`, `on`, `off`"))
            }
        }
    }
}

impl Switch {
    /// Word in leg files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::On => "on",
            Self::Off => "off",
            Self::Within(_) => "within",
        }
    }

    pub(super) const fn is_auto(&self) -> bool {
        matches!(self, Self::Auto)
    }

    pub(super) const fn is_off(&self) -> bool {
        matches!(self, Self::Off)
    }
}
