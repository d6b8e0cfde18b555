//! Selection of a model term: always, never, or decided by the data.

use serde::{Deserialize, Serialize};

/// Whether a term is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Switch {
    /// Estimated if the data show it.
    Auto,
    /// Always estimated.
    On,
    /// Never estimated.
    Off,
}

impl Switch {
    /// Word in leg files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::On => "on",
            Self::Off => "off",
        }
    }

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
    pub(super) const fn is_auto(&self) -> bool {
        matches!(self, Self::Auto)
    }

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
    pub(super) const fn is_off(&self) -> bool {
        matches!(self, Self::Off)
    }
}
