//! Level 1: the servo's side of the bus. In: the newest commands and at most one request. Out: the tick's
//! results.
//!
//! Orders are taken in every tick. The servo reports in every second one, once the bus has taken the previous
//! report.

use super::queues::{HostEnds, take_first};
use super::signals::Signals;
use crate::bus::device::{LegOrder, LegRequest, LegStatus};
use crate::hal::{Hardware, Sample};
use crate::leg::{
    Control, ControlOutput, ControlRequest, DriveState, Fault, Following, Host, JointCommand, JointStatus,
    Permission, Plan, PowerRequest, Refusal, RefusalReason, Wearing,
};
use crate::units::{NewtonMetre, Volt};

/// Ticks between two reports to the bus: 2 kHz, twice the fastest cycle that fits the wire.
const TICKS: u32 = 2;
/// Time constant of the reported torque, ticks: 2 ms.
const LAG_TICKS: f32 = 8.0;

/// Settings of a host for an identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Prepared {
    /// One-time or sequential.
    pub(crate) plan: Plan,
    /// Seed of the search.
    pub(crate) seed: u64,
    /// Whether the leg is empty or worn, if the host said so.
    pub(crate) wearing: Option<Wearing>,
}

/// A request and, where it begins an identification, its settings.
pub(crate) type HostRequest = (ControlRequest, Option<Prepared>);

/// State of the servo's side of the bus.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HostSide<const N: usize> {
    following: Following<N>,
    commands: Option<[JointCommand; N]>,
    request: Option<LegRequest>,
    cancel: bool,
    refused: Option<Refusal>,
    /// A refusal by the bus itself that is not recorded yet.
    noted: Option<Refusal>,
    may_return: [bool; N],
    /// Torque from the measured currents, model's sign, smoothed; zero while the bridge is off, where the
    /// reading is noise.
    torque: [NewtonMetre; N],
    volt_per_code: Volt,
    tick: u32,
}

/// Returns whether the operator permits enabling; an open switch counts at once.
fn is_held<const N: usize>(signals: &Signals<N>, hardware: &impl Hardware<N>) -> bool {
    hardware.contacts().enabling && signals.permits()
}

impl<const N: usize> HostSide<N> {
    /// State before the first order.
    pub const fn new(following: Following<N>, volt_per_code: Volt) -> Self {
        Self {
            following,
            commands: None,
            request: None,
            cancel: false,
            refused: None,
            noted: None,
            may_return: [true; N],
            torque: [NewtonMetre::ZERO; N],
            volt_per_code,
            tick: 0,
        }
    }

    /// Resets after a change of the joints' zeros.
    pub(crate) fn begin(&mut self) {
        self.following.restart();
    }

    /// Runs instead of a tick while the leg has no zeros: reports the drive's state and drops orders, except
    /// for the reset of a fault. Returns whether a host requests that. A lost host stops nothing here; its
    /// node reports it.
    pub(crate) fn rest(
        &mut self,
        drive: DriveState,
        ends: &mut HostEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut impl Hardware<N>,
    ) -> bool {
        const RESET: Option<LegRequest> = Some(LegRequest::Power(PowerRequest::ResetFault));
        let mut resets = self.request == RESET;
        while take_first(&mut ends.orders, |order| {
            self.note(order);
            resets |= order.request == RESET;
        })
        .is_some()
        {}
        (self.commands, self.request, self.cancel) = (None, None, false);
        if self.is_due(ends, hardware) {
            let causes = signals.inhibit.causes();
            let (blocked, calibrated) = (causes != 0, signals.is_calibrated());
            let held = is_held(signals, hardware);
            let joints = [JointStatus { drive, bus: self.bus(signals), ..JointStatus::NONE }; N];
            // There is space: a report is due only then.
            let _ = ends.status.enqueue(LegStatus {
                joints,
                blocked,
                causes,
                calibrated,
                held,
                ..LegStatus::NONE
            });
        }
        resets
    }

    fn note(&mut self, order: &LegOrder<N>) {
        self.may_return = order.may_return;
        self.noted = order.refused.or(self.noted);
    }

    /// Reports to the bus that a request other than a step was refused.
    pub(crate) fn refuse(&mut self, reason: RefusalReason) {
        self.refused = Some(Refusal { joint: Refusal::LEG, reason });
    }

    /// Takes the refusal by the bus itself, once.
    pub(crate) fn take_noted(&mut self) -> Option<Refusal> {
        self.noted.take()
    }

    /// Joints that a host permits to return into their range.
    pub(crate) const fn may_return(&self) -> [bool; N] {
        self.may_return
    }

    /// Takes the newest order, unless a request still waits behind the operator's. Reports the faults of a
    /// lost host.
    pub(crate) fn receive(&mut self, ends: &mut HostEnds<'_, N>, mut report: impl FnMut(Fault)) {
        while self.request.is_none()
            && take_first(&mut ends.orders, |order| self.take(order, &mut report)).is_some()
        {}
    }

    fn take(&mut self, order: &LegOrder<N>, report: &mut impl FnMut(Fault)) {
        self.note(order);
        self.commands = order.commands;
        for (joint, code) in order.faults.into_iter().enumerate() {
            if let Some(code) = code {
                report(Fault { code, joint: joint as u8 });
            }
        }
        match order.request {
            // Without the drive a host cannot stop the joints along its profile, but it can request a quick
            // stop.
            Some(LegRequest::Cancel) if order.commands.is_none() => {
                self.request = Some(LegRequest::Power(PowerRequest::QuickStop));
            }
            Some(LegRequest::Cancel) => self.cancel = true,
            Some(request) => self.request = Some(request),
            None => {}
        }
    }

    /// The request of this tick: the operator's, or else the host's, once.
    pub(crate) fn request(&mut self, by_hand: Option<ControlRequest>) -> Option<HostRequest> {
        if let Some(request) = by_hand {
            return Some((request, None));
        }
        Some(match self.request.take()? {
            LegRequest::Power(power) => (ControlRequest::Power(power), None),
            LegRequest::Identify { plan, seed, wearing } => {
                (ControlRequest::Identify, Some(Prepared { plan, seed, wearing }))
            }
            LegRequest::TakeUpdate => (ControlRequest::TakeUpdate, None),
            LegRequest::Assist(shares) => (ControlRequest::Assist(shares), None),
            LegRequest::EndAssist => (ControlRequest::EndAssist, None),
            LegRequest::Cancel => return None,
        })
    }

    /// Filters a request while the operator's switch is open: no request that enables passes, and an enabled
    /// leg gets a quick stop.
    pub(crate) fn held(
        &self,
        request: Option<ControlRequest>,
        state: DriveState,
        signals: &Signals<N>,
        hardware: &impl Hardware<N>,
    ) -> Option<ControlRequest> {
        if is_held(signals, hardware) {
            return request;
        }
        match request {
            Some(ControlRequest::Power(power)) if !power.enables() => request,
            _ if state.is_enabled() => Some(ControlRequest::Power(PowerRequest::QuickStop)),
            // A step that was requested while the switch was still held.
            _ => None,
        }
    }

    /// The host's side of this tick; `waits` if its commands are not followed yet.
    pub(crate) fn host(&mut self, waits: bool) -> Host<'_, N> {
        let cancel = core::mem::take(&mut self.cancel);
        Host { following: &mut self.following, commands: self.commands.as_ref(), cancel, waits }
    }

    /// Whether a host has the drive.
    pub(crate) const fn has_drive(&self) -> bool {
        self.commands.is_some()
    }

    /// Reports the tick's results when a report is due.
    pub(crate) fn report(
        &mut self,
        control: &Control<N>,
        sample: &Sample<N>,
        output: &ControlOutput<N>,
        ends: &mut HostEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut impl Hardware<N>,
    ) {
        if let Some(logged) = output.logged {
            // The host detects a missing sample by its tick.
            let _ = ends.logged.enqueue(logged);
        }
        self.refused = output.servo.decision.refused.or(self.refused);
        self.smooth(control, sample, output);
        if !self.is_due(ends, hardware) {
            return;
        }
        let activity = control.activity();
        let mut joints = [JointStatus::NONE; N];
        for (joint, slot) in joints.iter_mut().enumerate() {
            let torque = self.torque.get(joint).copied().unwrap_or(NewtonMetre::ZERO);
            let status = self.following.status(joint, torque, activity.follows_host(), output);
            *slot = JointStatus { bus: self.bus(signals), ..status.unwrap_or(JointStatus::NONE) };
        }
        let status = LegStatus {
            joints,
            activity,
            change: [control.change().is_some(), control.is_update_offered()],
            refused: core::mem::take(&mut self.refused),
            held: is_held(signals, hardware),
            blocked: !signals.inhibit.is_clear(),
            causes: signals.inhibit.causes(),
            calibrated: true,
            rests: false,
        };
        // There is space: a report is due only then.
        let _ = ends.status.enqueue(status);
    }

    /// Low-pass with time constant [`LAG_TICKS`] while the bridges switch.
    fn smooth(&mut self, control: &Control<N>, sample: &Sample<N>, output: &ControlOutput<N>) {
        let is_off = output.servo.decision.state.permission() == Permission::Off;
        for (joint, torque) in self.torque.iter_mut().enumerate() {
            let measured = control.torque(joint, sample).filter(|_| !is_off);
            *torque = measured.map_or(NewtonMetre::ZERO, |now| *torque + (now - *torque) * (1.0 / LAG_TICKS));
        }
    }

    fn bus(&self, signals: &Signals<N>) -> Volt {
        self.volt_per_code * signals.statistics.bus[0].get() as f32
    }

    /// Counts ticks, triggers the bus level every [`TICKS`], and returns whether it has taken the previous
    /// report.
    fn is_due(&mut self, ends: &HostEnds<'_, N>, hardware: &mut impl Hardware<N>) -> bool {
        self.tick = self.tick.wrapping_add(1);
        if !self.tick.is_multiple_of(TICKS) {
            return false;
        }
        hardware.pend_bus();
        ends.status.ready()
    }
}

#[cfg(test)]
mod tests;
