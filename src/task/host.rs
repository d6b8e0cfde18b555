//! The servo's side of the bus on the board: queues beneath `operation::HostSide`, and the leg's values.

use super::bus::ServoEnd;
use super::interlock;
use super::leg::JOINTS;
use crate::bus::station::{LegOrder, LegTold};
use crate::hal::Sample;
use crate::leg::{Activity, Control, ControlOutput, Following, Host, JointStatus};
use crate::operation::{HostBoard, HostSide};

/// The board, as the servo's side of the bus has it.
pub struct Ports {
    end: ServoEnd,
    /// Has the bus run.
    pend: fn(),
    /// The operator lets the leg be enabled.
    held: fn() -> bool,
}

impl HostBoard<JOINTS> for Ports {
    fn order(&mut self) -> Option<LegOrder<JOINTS>> {
        self.end.orders.dequeue()
    }

    fn takes_told(&self) -> bool {
        self.end.told.ready()
    }

    fn tell(&mut self, told: LegTold<JOINTS>) {
        let _ = self.end.told.enqueue(told);
    }

    fn pend(&mut self) {
        (self.pend)();
    }

    fn held(&self) -> bool {
        (self.held)()
    }

    fn is_clear(&self) -> bool {
        interlock::is_clear()
    }
}

/// What the servo remembers of the bus.
pub struct HostLink {
    /// What it does.
    pub side: HostSide<Ports, JOINTS>,
    following: Following<JOINTS>,
}

impl HostLink {
    /// Nothing heard yet.
    #[must_use]
    pub const fn new(end: ServoEnd, following: Following<JOINTS>, pend: fn(), held: fn() -> bool) -> Self {
        Self { side: HostSide::new(Ports { end, pend, held }), following }
    }

    /// The joints have other zeros than before.
    pub fn begin(&mut self) {
        self.following.forget_zeros();
    }

    /// What a host commands at this tick.
    pub fn host(&mut self) -> Option<Host<'_, JOINTS>> {
        let (commands, cancel) = self.side.commands()?;
        Some(Host { following: &mut self.following, commands, cancel })
    }

    /// What came of the tick.
    pub fn told(
        &mut self,
        control: &Control<JOINTS>,
        sample: &Sample<JOINTS>,
        output: &ControlOutput<JOINTS>,
    ) {
        if let Some(logged) = output.logged {
            // One that does not fit is missing in the host's log by its tick.
            let _ = self.side.board.end.logged.enqueue(logged);
        }
        let following = &self.following;
        self.side.told(output.servo.decision.refused.is_some(), || {
            let activity = control.activity();
            let mut joints = [JointStatus::NONE; JOINTS];
            for (joint, slot) in joints.iter_mut().enumerate() {
                let follows = activity == Activity::Follow;
                let torque = control.torque(joint, sample);
                let status = torque.and_then(|torque| following.status(joint, torque, follows, output));
                *slot = status.unwrap_or(JointStatus::NONE);
            }
            let change = [control.change().is_some(), control.is_update_offered()];
            LegTold { joints, activity, change, ..LegTold::NONE }
        });
    }
}
