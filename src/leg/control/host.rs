//! Control by a host: while the drive is enabled, `Follow` replaces `Idle`.

use super::{Activity, Control};
use crate::assist::AssistEnd;
use crate::leg::follow::{Commanded, Following, JointCommand};
use crate::motion::{Motion, MotionState};

/// A host's side of one tick: its commands, if it has the drive, and the state of following them.
#[derive(Debug)]
pub struct Host<'a, const N: usize> {
    /// State from tick to tick.
    pub(crate) following: &'a mut Following<N>,
    /// Commands of this tick; `None` while no host has the drive.
    pub(crate) commands: Option<&'a [JointCommand; N]>,
    /// Whether the activity is cancelled: of an identification or a tracked motion the joints slow down to
    /// rest along their profiles, assistance fades out.
    pub(crate) cancel: bool,
    /// Whether the drive holds its pose: commands are not followed yet.
    pub(crate) waits: bool,
}

impl<const N: usize> Control<N> {
    /// Follows the host's commands if the drive is enabled and no other activity runs.
    pub(super) fn apply_commands(&mut self, host: Option<&mut Host<'_, N>>) -> Option<Commanded<N>> {
        let Host { following, commands, cancel, waits } = host?;
        let Some(commands) = *commands else {
            if self.activity.follows_host() {
                self.activity = Activity::Idle;
            }
            return None;
        };
        // A halt ends another activity too.
        let cancel = *cancel || commands.iter().any(|command| command.halt);
        if *waits || !self.servo.state().is_enabled() {
            return None;
        }
        if self.activity.assists() {
            if cancel {
                self.assistance.leave(AssistEnd::Requested);
            }
            return None;
        }
        if cancel && !self.activity.follows_host() {
            following.begin(commands, &self.motion.state_at(self.motion_tick));
            self.activity = Activity::Follow;
        }
        if self.activity == Activity::Idle {
            following.begin(commands, &MotionState::at_rest(self.motion.end_rad()));
            self.activity = Activity::Follow;
        }
        if !self.activity.follows_host() {
            return None;
        }
        self.models.want(commands.iter().all(|command| command.feedforward));
        let commanded = following.follow(commands);
        if let Some(fault) = commanded.fault {
            self.servo.monitor.report(fault);
        }
        // Start of a possible next activity.
        (self.motion, self.motion_tick) = (Motion::Hold(commanded.motion.position_rad), 0);
        Some(commanded)
    }
}
