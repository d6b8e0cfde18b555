//! What a leg is doing, above the power states of its drive.

/// Motions that are predicted and not identified from: two gaits and an unused Fourier motion.
pub const VALIDATION_MOTIONS: usize = 3;

/// What a leg is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activity {
    /// Nothing; holds its pose where the drive is enabled.
    #[default]
    Idle,
    /// Finding its own parameters.
    Identify(IdentifyPhase),
    /// Following a motion.
    Track(Step),
    /// Following what a host commands, tick by tick.
    Follow,
}

/// How far an identification is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdentifyPhase {
    /// To where the excitation begins.
    Approach,
    /// The exciting motion; its samples are the training data.
    Excite,
    /// At rest until the last samples are in.
    Settle,
    /// At rest while the solver works.
    Solve,
    /// Motions that are only predicted.
    Validate {
        /// Counted from 0.
        motion: u8,
        /// On the way to it, or in it.
        step: Step,
    },
    /// At rest until the verdict.
    Judge,
}

/// The two parts of every motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// To where it begins.
    Approach,
    /// The motion itself.
    Run,
}

/// What a logged sample is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Segment {
    /// Identified from.
    Training,
    /// Predicted; counted from 0.
    Validation(u8),
    /// A motion that is followed: the accepted model is watched.
    Tracking,
}

impl Activity {
    /// What samples taken now are for.
    #[must_use]
    pub const fn segment(self) -> Option<Segment> {
        match self {
            Self::Identify(IdentifyPhase::Excite) => Some(Segment::Training),
            Self::Identify(IdentifyPhase::Validate { motion, step: Step::Run }) => {
                Some(Segment::Validation(motion))
            }
            Self::Track(Step::Run) => Some(Segment::Tracking),
            _ => None,
        }
    }
}
