//! A leg that a host commands: what follows takes the place of being idle.

use super::{Activity, Control, DriveState};
use crate::leg::follow::{Commanded, Following, JointCommand};
use crate::motion::{Motion, MotionState};

/// What a host commands at one tick, and what is made of it.
#[derive(Debug)]
pub struct Host<'a, const N: usize> {
    /// Remembers from tick to tick.
    pub following: &'a mut Following<N>,
    /// Of this tick.
    pub commands: &'a [JointCommand; N],
    /// An identification is given up, or a motion that is tracked: the joints come to rest along their profiles.
    pub cancel: bool,
}

impl<const N: usize> Control<N> {
    /// What the host commands, where the leg is enabled and does nothing else.
    pub(super) fn obey(&mut self, host: Option<&mut Host<'_, N>>) -> Option<Commanded<N>> {
        let Host { following, commands, cancel } = host?;
        if self.servo.state() != DriveState::OperationEnabled {
            return None;
        }
        if *cancel && self.activity != Activity::Follow {
            following.begin(commands, &self.motion.state_at(self.motion_tick));
            self.activity = Activity::Follow;
        }
        if self.activity == Activity::Idle {
            following.begin(commands, &MotionState::at_rest(self.motion.end_rad()));
            self.activity = Activity::Follow;
        }
        if self.activity != Activity::Follow {
            return None;
        }
        self.models.want(commands.iter().all(|command| command.feedforward));
        let commanded = following.follow(commands);
        if let Some(fault) = commanded.fault {
            self.servo.report(fault);
        }
        if let Some(shifts) = &commanded.shifts {
            self.servo.shift(shifts);
        }
        // Where another activity would begin.
        (self.motion, self.motion_tick) = (Motion::Hold(commanded.motion.position_rad), 0);
        Some(commanded)
    }
}
