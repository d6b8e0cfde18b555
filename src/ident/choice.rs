//! What is estimated, what is not, and what the data decide.

/// Whether a part of the model is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// If the data tell it.
    Auto,
    /// It is.
    On,
    /// It is not.
    #[default]
    Off,
}

impl Choice {
    /// Not ruled out beforehand.
    #[must_use]
    pub const fn is_possible(self) -> bool {
        !matches!(self, Self::Off)
    }
}

/// How disturbances of a motion are met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Wild samples are replaced, disturbed stretches count for less.
    #[default]
    Robust,
    /// Every sample counts alike.
    Plain,
}
