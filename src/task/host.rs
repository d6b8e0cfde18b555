//! The servo's side of the bus: newest commands in, at most one request, and what came of the tick out.
//!
//! Orders are taken in every tick; the leg is told in every second one, as soon as the bus has taken what it was told before.

use super::bus::ServoEnd;
use super::interlock;
use super::leg::JOINTS;
use crate::bus::station::{LegRequest, LegTold};
use crate::hal::Sample;
use crate::leg::{
    Activity, Control, ControlOutput, ControlRequest, DriveState, Fault, Following, Host, JointCommand,
    JointStatus, Plan, PowerRequest,
};

/// Ticks between two of which the bus is told: 2 kHz, twice the fastest cycle that fits the wire.
const TICKS: u32 = 2;

/// What the servo remembers of the bus.
pub struct HostLink {
    end: ServoEnd,
    following: Following<JOINTS>,
    commands: Option<[JointCommand; JOINTS]>,
    request: Option<LegRequest>,
    cancel: bool,
    refused: bool,
    tick: u32,
    /// Has the bus run.
    pend: fn(),
    /// The operator lets the leg be enabled.
    held: fn() -> bool,
}

impl HostLink {
    /// Nothing heard yet.
    #[must_use]
    pub const fn new(end: ServoEnd, following: Following<JOINTS>, pend: fn(), held: fn() -> bool) -> Self {
        Self {
            end,
            following,
            commands: None,
            request: None,
            cancel: false,
            refused: false,
            tick: 0,
            pend,
            held,
        }
    }

    /// The joints have other zeros than before.
    pub fn begin(&mut self) {
        self.following.forget_zeros();
    }

    /// No tick of the leg: what is asked meanwhile is asked of a leg that has no zeros.
    pub fn rest(&mut self) {
        while self.end.orders.dequeue().is_some() {}
        (self.commands, self.request, self.cancel) = (None, None, false);
        if self.is_due() {
            let blocked = !interlock::is_clear();
            let _ = self.end.told.enqueue(LegTold { blocked, ..LegTold::NONE });
        }
    }

    /// Takes the newest order; none while a request waits for the operator's hand, which goes first.
    pub fn hear(&mut self, control: &mut Control<JOINTS>) {
        while self.request.is_none()
            && let Some(order) = self.end.orders.dequeue()
        {
            self.commands = order.commands;
            for (joint, code) in order.faults.into_iter().enumerate() {
                if let Some(code) = code {
                    control.report(Fault { code, joint: joint as u8 });
                }
            }
            match order.request {
                Some(LegRequest::Cancel) => self.cancel = true,
                Some(request) => self.request = Some(request),
                None => {}
            }
        }
    }

    /// What is asked while the operator's switch is open, whoever enabled the leg and whatever the housekeeping knows of it.
    pub fn held(
        &self,
        request: Option<ControlRequest<JOINTS>>,
        state: DriveState,
    ) -> Option<ControlRequest<JOINTS>> {
        if (self.held)() {
            return request;
        }
        match request {
            Some(ControlRequest::Power(power)) if !power.enables() => request,
            _ if state == DriveState::OperationEnabled => {
                Some(ControlRequest::Power(PowerRequest::QuickStop))
            }
            // A step that was asked for while the switch was held still.
            _ => None,
        }
    }

    /// What a host asks for, once, and with what its identification begins.
    pub fn request(&mut self) -> Option<(ControlRequest<JOINTS>, Option<(Plan, u64)>)> {
        Some(match self.request.take()? {
            LegRequest::Power(power) => (ControlRequest::Power(power), None),
            LegRequest::Identify { plan, seed } => (ControlRequest::Identify, Some((plan, seed))),
            LegRequest::TakeUpdate => (ControlRequest::TakeUpdate, None),
            LegRequest::Cancel => return None,
        })
    }

    /// What a host commands at this tick.
    pub fn host(&mut self) -> Option<Host<'_, JOINTS>> {
        let cancel = core::mem::take(&mut self.cancel);
        let following = &mut self.following;
        self.commands.as_ref().map(|commands| Host { following, commands, cancel })
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
            let _ = self.end.logged.enqueue(logged);
        }
        self.refused |= output.servo.decision.refused.is_some();
        if !self.is_due() {
            return;
        }
        let activity = control.activity();
        let mut joints = [JointStatus::NONE; JOINTS];
        for (joint, slot) in joints.iter_mut().enumerate() {
            let follows = activity == Activity::Follow;
            let torque = control.torque(joint, sample);
            let status = torque.and_then(|torque| self.following.status(joint, torque, follows, output));
            *slot = status.unwrap_or(JointStatus::NONE);
        }
        let told = LegTold {
            joints,
            activity,
            change: [control.change().is_some(), control.is_update_offered()],
            refused: core::mem::take(&mut self.refused),
            held: false,
            blocked: !interlock::is_clear(),
        };
        let _ = self.end.told.enqueue(told);
    }

    /// The bus has to run, and has taken what it was told before.
    fn is_due(&mut self) -> bool {
        self.tick = self.tick.wrapping_add(1);
        if !self.tick.is_multiple_of(TICKS) {
            return false;
        }
        // It runs once the servo is done.
        (self.pend)();
        self.end.told.ready()
    }
}
