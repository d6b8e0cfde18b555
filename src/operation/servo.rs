//! Level 1: the leg's tick with inputs and reports, 4 kHz, triggered by the current loop of the last axis.
//!
//! ```text
//! samples     newest of each joint
//! gate        no tick without calibration and zero of each joint: outputs off, requests dropped; faults are
//!             reported and reset all the same
//! findings    of the identification
//! faults      reported by the board's other levels; gains and limits (every 64 ms); supply; derating
//! bandwidths  of the position loops that a host has set, while the drive is off
//! request     of the operator, else of a host; filtered by the inhibit word, the enabling switch and the
//!             holding brake
//! leg         -> current targets, permission, holding brake; the samples of a session of assistance
//! out         report to the bus; limits, requests, states, samples as events for identification and trace
//! ```

use core::array;

use super::host_side::{HostSide, Prepared};
use super::queues::{LegEvent, RESERVED, ServoEnds};
use super::signals::Signals;
use crate::checksum::Checksum;
use crate::hal::{Hardware, JointSample, Sample};
use crate::leg::{
    Activity, AssistNote, Control, ControlOutput, ControlRequest, DriveState, Following, LimitCodes,
    Permission, PowerRequest, Refusal, RefusalReason, may_reset, permitted,
};
use crate::safety::{
    BrakeDelays, DeratingRamps, Fault, FaultCode, HoldingBrake, InhibitReason, JointShares, SupplyCurrent,
    SupplyLimits, SupplyWatch,
};
use crate::servo::SERVO_RATE_HZ;
use crate::trace::{Record, words};
use crate::units::{Hertz, Volt};

/// Ticks between two checksums of gains and limits, less one: 64 ms.
const CHECKSUM_MASK: u32 = 0xFF;

/// State of level 1 between two ticks, besides the leg's control.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoLevel<const N: usize> {
    sample: [JointSample; N],
    /// State and activity at the last report.
    state: Option<DriveState>,
    activity: Activity,
    /// Limits already reported in this second.
    limits: [LimitCodes; N],
    ticking: bool,
    /// Inhibit reasons whose faults were reported to control.
    causes: u32,
    /// The housekeeping does not have the drive's newest state.
    is_state_due: bool,
    tick: u32,
    /// Checksum of gains and limits at creation, or after the last change of the bandwidths.
    checksum: Checksum,
    /// Bandwidths of the position loops that a host has set.
    bandwidths: [Option<Hertz>; N],
    supply: SupplyWatch,
    supply_current: SupplyCurrent,
    holding_brake: Option<HoldingBrake>,
    ramps: DeratingRamps,
    volt_per_code: Volt,
    /// Side of the bus, where there is one.
    host: Option<HostSide<N>>,
    /// Plan and seed of a host's identification.
    prepared: Option<Prepared>,
    /// Last refusal in this drive state.
    refused: Option<Refusal>,
}

impl<const N: usize> ServoLevel<N> {
    /// State before the first tick. `following` is required for a host's commands; `None` without a bus.
    pub fn new(
        control: &Control<N>,
        ramps: DeratingRamps,
        volt_per_code: Volt,
        following: Option<Following<N>>,
    ) -> Self {
        Self {
            sample: [JointSample::default(); N],
            state: None,
            activity: Activity::Idle,
            limits: [LimitCodes::default(); N],
            ticking: false,
            causes: 0,
            is_state_due: false,
            tick: 0,
            checksum: control.checksum(),
            bandwidths: [None; N],
            supply: SupplyWatch::default(),
            supply_current: SupplyCurrent::new(SupplyLimits::NONE),
            holding_brake: None,
            ramps,
            volt_per_code,
            host: following.map(|following| HostSide::new(following, volt_per_code)),
            prepared: None,
            refused: None,
        }
    }

    /// Adds limits of the supply current; without them there are none.
    pub fn with_supply(self, limits: SupplyLimits) -> Self {
        Self { supply_current: SupplyCurrent::new(limits), ..self }
    }

    /// Adds a holding brake, if there is one.
    pub fn with_holding_brake(self, delays: Option<BrakeDelays>) -> Self {
        Self { holding_brake: delays.map(HoldingBrake::new), ..self }
    }

    /// Runs one tick of the leg; `None` while the joints' samples are invalid. `gravity` in the base frame,
    /// m/s^2. Always inlined: the board has no use for the output, which then costs nothing.
    #[inline(always)]
    pub fn tick<H: Hardware<N>>(
        &mut self,
        control: &mut Control<N>,
        gravity: [f32; 3],
        ends: &mut ServoEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut H,
    ) -> Option<ControlOutput<N>> {
        for (slot, samples) in self.sample.iter_mut().zip(&mut ends.samples) {
            while let Some(sample) = samples.dequeue() {
                *slot = sample;
            }
        }
        for (count, sample) in signals.statistics.counts.iter().zip(&self.sample) {
            count.set(sample.encoder_counts.cast_unsigned());
        }
        let begun = signals.has_begun();
        let changes = core::mem::replace(&mut self.ticking, begun) != begun;
        if changes {
            control.restart();
        }
        if !begun {
            self.rest(control, ends, signals, hardware);
            return None;
        }
        if changes {
            self.state = None;
            if let Some(host) = &mut self.host {
                host.begin();
            }
        }
        if let Some(finding) = ends.findings.dequeue()
            && control.receive(finding)
        {
            send(LegEvent::TookResult, ends, signals);
        }
        while let Some(torque) = ends.assist.as_mut().and_then(|assist| assist.torques.dequeue()) {
            control.receive_torque(&torque);
        }
        self.pass_board_state(control, signals);
        self.set_bandwidths(control, signals);
        let (request, by_hand) = self.next_request(control, ends, signals, hardware);
        // Until the brake is open the drive holds its pose.
        let waits = self.holding_brake.is_some_and(|brake| !brake.is_open());
        // The start button begins nothing while a host has the drive.
        let is_hosts = by_hand && self.host.as_ref().is_some_and(HostSide::has_drive);
        let permitted = permitted(request.as_ref(), signals.inhibit.causes(), control.state())
            .filter(|request| !((waits || is_hosts) && request.moves()));
        let sample = Sample { joints: self.sample };
        let host = self.host.as_mut().map(|host| host.host(waits));
        if matches!(permitted, Some(ControlRequest::Identify)) && !control.activity().is_identifying() {
            // The statement belongs to this identification alone.
            control.set_wearing(self.prepared.and_then(|prepared| prepared.wearing));
        }
        let output = control.tick(&sample, permitted, gravity, host);
        if let Some(note) = control.take_assist_note() {
            if let (AssistNote::Refused(_), Some(host)) = (note, &mut self.host) {
                host.refuse(RefusalReason::NoAssistance);
            }
            let ((event, why), tick) = (words::assist(note), self.tick);
            send(LegEvent::Record(Record::Assist { tick, event, why }), ends, signals);
        }
        assist(control, &output, ends, hardware);
        signals.set_targets(output.servo.drive());
        signals.set_permission(output.servo.decision.state.permission());
        self.hold(output.servo.decision.state, signals, hardware);
        if let (Some(host), Some(ends)) = (&mut self.host, &mut ends.host) {
            host.report(control, &sample, &output, ends, signals, hardware);
        }
        self.report_noted(ends, signals);
        self.report_limits(control, &output, ends, signals);
        self.report(control, request.as_ref(), permitted, &output, ends, signals);
        Some(output)
    }

    /// Shares of the torque that the limits of the supply current leave (`SupplyCurrent::shares`).
    pub fn supply_shares(&self) -> [f32; 2] {
        self.supply_current.shares()
    }

    /// Runs instead of a tick while the leg has no zeros: requests are dropped, except for the reset of a
    /// fault. A fault is reported as in a tick, also the one that ended the ticks.
    #[inline(never)]
    fn rest<H: Hardware<N>>(
        &mut self,
        control: &mut Control<N>,
        ends: &mut ServoEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut H,
    ) {
        signals.disable();
        signals.set_permission(Permission::Off);
        self.hold(DriveState::NotReadyToSwitchOn, signals, hardware);
        signals.set_wanted_brake(0.0);
        let request = ends.requests.dequeue();
        let mut resets = request == Some(ControlRequest::Power(PowerRequest::ResetFault));
        if let (Some(host), Some(ends)) = (&mut self.host, &mut ends.host) {
            resets |= host.rest(control.state(), ends, signals, hardware);
        }
        self.pass_faults(control, signals);
        let fault = control.stand_by(resets && may_reset(signals.inhibit.causes()));
        let state = control.state();
        // Before its first tick a drive is not ready.
        self.state = self.state.or(Some(DriveState::NotReadyToSwitchOn));
        if self.has_changed(state) {
            self.is_state_due = true;
            self.record_change(state, fault, control.activity(), ends, signals);
        }
        self.send_state(state, ends);
        self.state = Some(state);
        self.send_activity(control.activity(), ends, signals);
        self.report_noted(ends, signals);
    }

    /// Commands the holding brake. A stop may come between any two instructions, so the inhibit word is read
    /// with interrupts masked.
    fn hold<H: Hardware<N>>(&mut self, state: DriveState, signals: &Signals<N>, hardware: &mut H) {
        if let Some(brake) = &mut self.holding_brake {
            let released = brake.follow(state);
            hardware.masked(|hardware| {
                hardware.set_holding_brake(released && signals.inhibit.is_clear());
            });
        }
    }

    /// Next request, the operator's before the host's, and whether it is the operator's.
    fn next_request<H: Hardware<N>>(
        &mut self,
        control: &mut Control<N>,
        ends: &mut ServoEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &H,
    ) -> (Option<ControlRequest>, bool) {
        // The button that began a session ends it.
        let by_hand = match ends.requests.dequeue() {
            Some(ControlRequest::Assist(_)) if control.activity().assists() => {
                Some(ControlRequest::EndAssist)
            }
            request => request,
        };
        let (Some(host), Some(ends)) = (&mut self.host, &mut ends.host) else {
            return (by_hand, true);
        };
        host.receive(ends, |fault| control.report(fault));
        control.permit_return(host.may_return());
        let (request, prepared) = host.request(by_hand).unzip();
        if let Some(prepared) = prepared {
            self.prepared = prepared;
        }
        (host.held(request, control.state(), signals, hardware), by_hand.is_some())
    }

    /// Applies the bandwidths that a host has set, while the drive is off.
    fn set_bandwidths(&mut self, control: &mut Control<N>, signals: &Signals<N>) {
        if control.state().permission() != Permission::Off {
            return;
        }
        let bandwidths = signals.position_bandwidths();
        if bandwidths != self.bandwidths {
            self.bandwidths = bandwidths;
            let is_sound = self.is_sound(control);
            control.set_bandwidths(&bandwidths);
            // A wrong checksum stays wrong.
            if is_sound {
                self.checksum = control.checksum();
            }
        }
    }

    /// Whether gains and limits have their checksum.
    #[inline(never)]
    fn is_sound(&self, control: &Control<N>) -> bool {
        control.checksum() == self.checksum
    }

    /// Passes the faults of the board's other levels to control: new inhibit reasons, then what names its
    /// joint.
    fn pass_faults(&mut self, control: &mut Control<N>, signals: &Signals<N>) {
        let causes = signals.inhibit.causes();
        let new = causes & !core::mem::replace(&mut self.causes, causes);
        if new != 0 {
            let of = |cause: InhibitReason| cause.code().filter(|_| new & cause.bit() != 0);
            for code in InhibitReason::ALL.into_iter().filter_map(of) {
                control.report(Fault { code, joint: 0 });
            }
        }
        for joint in 0..N {
            let fault = |code| Fault { code, joint: joint as u8 };
            signals.take_reported(joint).for_each(|found| control.report(fault(found.code())));
            if let Some(code) = signals.take_axis_fault(joint) {
                control.report(fault(code));
            }
        }
    }

    /// Passes faults, bus voltage and temperature from the rest of the board to control.
    fn pass_board_state(&mut self, control: &mut Control<N>, signals: &Signals<N>) {
        self.pass_faults(control, signals);
        self.tick = self.tick.wrapping_add(1);
        if self.tick & CHECKSUM_MASK == 0 && !self.is_sound(control) {
            control.report(Fault { code: FaultCode::Parameters, joint: 0 });
        }
        let bus = self.volt_per_code * signals.statistics.bus[0].get() as f32;
        if self.supply.check(bus) {
            control.report(Fault { code: FaultCode::SupplyLost, joint: 0 });
        }
        let joints = array::from_fn(|joint| JointShares {
            winding: signals.winding_share(joint),
            first_motion: signals.current_share(joint),
        });
        let found = self.supply_current.advance(signals.power_w(), signals.given_brake(), bus);
        signals.set_wanted_brake(self.supply_current.brake_duty());
        if let Some(code) = found {
            if code == FaultCode::ChargeCurrent {
                signals.inhibit.raise(InhibitReason::ChargeCurrent);
            }
            control.report(Fault { code, joint: 0 });
        }
        let ramps = self.ramps.at(signals.hottest_c(), bus, joints);
        control.derate(&ramps.with_supply(self.supply_current.shares()));
    }

    /// Records a refusal by the bus.
    fn report_noted(&mut self, ends: &mut ServoEnds<'_, N>, signals: &Signals<N>) {
        if let Some(refused) = self.host.as_mut().and_then(HostSide::take_noted) {
            send(LegEvent::Record(not_enabled(self.tick, refused)), ends, signals);
        }
    }

    /// Records active limits that were not reported in this second, one per tick.
    fn report_limits(
        &mut self,
        control: &Control<N>,
        output: &ControlOutput<N>,
        ends: &mut ServoEnds<'_, N>,
        signals: &Signals<N>,
    ) {
        if self.tick.is_multiple_of(SERVO_RATE_HZ) {
            self.limits = [LimitCodes::default(); N];
        }
        let codes = control.limit_codes(output);
        for (joint, (codes, reported)) in codes.iter().zip(&mut self.limits).enumerate() {
            if let Some(code) = codes.without(*reported).first() {
                *reported = reported.with(true, code);
                let (tick, joint) = (self.tick, joint as u8 + 1);
                let record = Record::Limit { tick, code: code as u8, name: code.name(), joint };
                send(LegEvent::Record(record), ends, signals);
                return;
            }
        }
    }

    /// Records changes and sends the sample of the log.
    fn report(
        &mut self,
        control: &Control<N>,
        request: Option<&ControlRequest>,
        permitted: Option<&ControlRequest>,
        output: &ControlOutput<N>,
        ends: &mut ServoEnds<'_, N>,
        signals: &Signals<N>,
    ) {
        let tick = self.tick;
        let mut record = |record| send(LegEvent::Record(record), ends, signals);
        let accepted = permitted.is_some() && !output.refused;
        let name = match request {
            None | Some(ControlRequest::Power(_)) => None,
            Some(ControlRequest::Identify) => Some("identify"),
            Some(ControlRequest::Track { .. }) => Some("track"),
            Some(ControlRequest::TakeUpdate) => Some("take_update"),
            Some(ControlRequest::Assist(_)) => Some("assist"),
            Some(ControlRequest::EndAssist) => Some("end_assist"),
        };
        if let Some(name) = name {
            record(Record::Request { tick, name, accepted });
        }
        if accepted && matches!(permitted, Some(ControlRequest::Identify)) {
            let prepared = self.prepared.map(|prepared| (prepared.plan, prepared.seed));
            send(LegEvent::Begun(prepared, control.wearing()), ends, signals);
        }
        let decision = &output.servo.decision;
        let activity = control.activity();
        let changed = self.has_changed(decision.state);
        let before = self.refused.filter(|_| !changed);
        self.refused = decision.refused.or(before);
        if let Some(refused) = decision.refused.filter(|refused| before != Some(*refused)) {
            send(LegEvent::Record(not_enabled(tick, refused)), ends, signals);
        }
        if changed || activity != self.activity {
            let fault = decision.fault.filter(|_| changed);
            self.record_change(decision.state, fault, activity, ends, signals);
        }
        self.is_state_due |= changed;
        self.send_state(decision.state, ends);
        self.state = Some(decision.state);
        if output.took_update {
            send(LegEvent::TookUpdate, ends, signals);
        }
        // A sample belongs to the ticks before it, so it precedes a new activity.
        if let Some(logged) = output.logged {
            let is_full = ends.events.len() + RESERVED >= ends.events.capacity();
            if is_full || ends.events.enqueue(LegEvent::Sample(logged)).is_err() {
                signals.statistics.samples_lost.add();
            }
        }
        self.send_activity(activity, ends, signals);
    }

    /// Whether the drive's state has another word than at the last report. Comparing words is slow, and the
    /// state is mostly the same.
    fn has_changed(&self, state: DriveState) -> bool {
        self.state.is_none_or(|before| before != state && words::drive(before) != words::drive(state))
    }

    /// Records a fault and the state or activity that follows from it.
    fn record_change(
        &self,
        state: DriveState,
        fault: Option<Fault>,
        activity: Activity,
        ends: &mut ServoEnds<'_, N>,
        signals: &Signals<N>,
    ) {
        let tick = self.tick;
        let mut record = |record| send(LegEvent::Record(record), ends, signals);
        if let Some(fault) = fault {
            let (code, name) = (fault.code.number(), fault.code.name());
            record(Record::Fault { tick, code, name, joint: fault.joint.saturating_add(1) });
        }
        let (name, phase, motion) = words::activity(activity);
        record(Record::State { tick, drive: words::drive(state), activity: name, phase, motion });
    }

    /// Sends the drive's state to the housekeeping; again in the next tick if its queue is full.
    fn send_state(&mut self, state: DriveState, ends: &mut ServoEnds<'_, N>) {
        if self.is_state_due {
            self.is_state_due = ends.drive.enqueue(state).is_err();
        }
    }

    fn send_activity(&mut self, activity: Activity, ends: &mut ServoEnds<'_, N>, signals: &Signals<N>) {
        if activity != self.activity {
            self.activity = activity;
            send(LegEvent::Activity(activity), ends, signals);
        }
    }
}

fn not_enabled<const N: usize>(tick: u32, refused: Refusal) -> Record<N> {
    Record::NotEnabled { tick, joint: refused.number(), why: refused.reason.name() }
}

/// Sends a new session and its samples to the law, and requests its run.
fn assist<const N: usize, H: Hardware<N>>(
    control: &mut Control<N>,
    output: &ControlOutput<N>,
    ends: &mut ServoEnds<'_, N>,
    hardware: &mut H,
) {
    let Some(ends) = &mut ends.assist else { return };
    if let Some(session) = control.take_session() {
        // A law that has not taken the session before does not answer, so this session ends.
        let _ = ends.sessions.enqueue(session);
        hardware.pend_assist();
    }
    if control.activity().assists()
        && let Some(logged) = &output.logged
    {
        // Without an answer the session ends.
        let _ = ends.samples.enqueue(logged.sample);
        hardware.pend_assist();
    }
}

/// Sends an event; one that does not fit is counted.
fn send<const N: usize>(event: LegEvent<N>, ends: &mut ServoEnds<'_, N>, signals: &Signals<N>) {
    if ends.events.enqueue(event).is_err() {
        signals.statistics.records_lost.add();
    }
}

#[cfg(test)]
mod tests;
