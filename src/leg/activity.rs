//! Activities of a leg, above the power states of its drive.

/// Number of validation motions: two gaits and an unused Fourier motion. They are predicted, not identified
/// from.
pub const VALIDATION_MOTIONS: usize = 3;

/// Activity of a leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activity {
    /// None; the leg holds its pose while the drive is enabled.
    #[default]
    Idle,
    /// Identifies its own parameters.
    Identify(IdentifyPhase),
    /// Tracks a motion.
    Track(Step),
    /// Follows the commands of a host, tick by tick.
    Follow,
    /// Gives torque from the identified model; see [`crate::assist`].
    Assist(AssistPhase),
}

impl Activity {
    /// Whether the leg follows the commands of a host.
    #[inline]
    pub(crate) const fn follows_host(self) -> bool {
        matches!(self, Self::Follow)
    }

    /// Whether the leg identifies itself.
    #[inline]
    pub(crate) const fn is_identifying(self) -> bool {
        matches!(self, Self::Identify(_))
    }

    /// Whether the leg gives torque from the identified model and holds no position.
    #[inline]
    pub const fn assists(self) -> bool {
        matches!(self, Self::Assist(_))
    }
}

/// Phase of an identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdentifyPhase {
    /// Moves to the start of the excitation.
    Approach,
    /// Runs the exciting motion; its samples are the training data.
    Excite,
    /// Rests until the last samples have arrived.
    Settle,
    /// Rests while the solver works.
    Solve,
    /// Runs the validation motions.
    Validate {
        /// Index of the motion, from 0.
        motion: u8,
        /// Approach or motion.
        step: Step,
    },
    /// Rests until the verdict.
    Judge,
}

/// Phase of a session of assistance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AssistPhase {
    /// Fades in.
    Enter,
    /// Acts with its whole torque.
    Run,
    /// Fades out.
    Leave,
}

/// The two steps of every motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Moves to its start.
    Approach,
    /// Runs the motion.
    Run,
}

/// Use of a logged sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Segment {
    /// Training data.
    Training,
    /// Validation data of this motion, from 0.
    Validation(u8),
    /// Tracked motion: the accepted model is monitored.
    Tracking,
}

impl Activity {
    /// Use of the samples taken now.
    pub(crate) const fn segment(self) -> Option<Segment> {
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
