//! The monitor decides last in every tick, from the measurements and the request.
//!
//! Why last: only the output of [`Monitor::decide`] reaches the bridge, whatever a controller, a model or a
//! bus requests. One tick runs in this order:
//!
//! 1. Detect faults, or take reported ones ([`Monitor::report`]): a measured or requested value that is not
//!    finite; three encoder readings rejected in 10 ms. While the drive is on also 1.1 times the speed limit,
//!    and 0.5 degrees beyond the range.
//! 2. Update the state ([`DriveState::after`]): a fault, or the tick and then the operator's request.
//!    Enabling requires the joints to be within range, and slow enough to stop there; otherwise the request
//!    is refused with its reason ([`RefusalReason`]).
//! 3. Apply the state's permission: off, damp, or the requested torque within the bounds of [`Barrier`].
//! 4. Convert torque to current. A current that is not finite turns the bridges off.
//!
//! **Returning.** A leg without torque falls and may come to rest outside its range. Such a joint is enabled
//! unless [`Monitor::permit_return`] forbids it, and then returns: no torque drives it farther out, and a
//! reduced one drives it back ([`Barrier::bound`]). Its permitted end follows it inwards. Half a degree
//! beyond that end is the fault of leaving the range. Within 0.1 degrees of its range a joint counts as
//! inside again, with its usual bounds.
//!
//! Cost: about 60 operations and two square roots per joint.

use super::barrier::{Barrier, Limited, RETURN_SPEED};
use super::derating::{Derating, LimitCodes};
use super::fault::{Fault, FaultCode, Reaction};
use super::limits::Limits;
use super::refusal::{Refusal, RefusalReason};
use super::state::{DriveState, Event, Permission, PowerRequest};
use crate::checksum::Checksum;
use crate::hal::DriveCommand;
use crate::real::{max, min};
use crate::units::{Ampere, NewtonMetre, Radian, RadianPerSecond};

/// Longest damping.
const DAMP_MS: u32 = 300;
/// Window in which rejected readings are counted.
const GLITCH_WINDOW_MS: u32 = 10;
/// Rejected readings within the window that are a fault.
const GLITCHES_FOR_FAULT: u32 = 3;
/// Multiple of the speed limit above which a joint is too fast.
const OVERSPEED_FACTOR: f32 = 1.1;
/// Distance beyond the range that is a fault (0.5 degrees).
pub const RANGE_TOLERANCE: Radian = Radian(0.008_727);
/// Largest distance beyond the range from which a joint may return (15 degrees). End stops hold it nearer, so
/// a larger angle is wrong, as on a leg of the other side.
const RETURN_REACH: Radian = Radian(0.262);
/// Distance from the range at which a returning joint counts as inside (0.1 degrees). From there its usual
/// bounds cause no torque step.
const RETURNED: Radian = Radian(0.001_745);

/// Measurements of `N` joints, in the model's angle and sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Observation<const N: usize> {
    /// Joint angles.
    pub(crate) position: [Radian; N],
    /// Joint velocities.
    pub(crate) velocity: [RadianPerSecond; N],
    /// Measured motor currents, in the drive's sign.
    pub(crate) current: [Ampere; N],
    /// Encoder readings of this tick that were impossible and not used.
    pub(crate) rejected: [bool; N],
}

/// Requested torques and state change of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Request<const N: usize> {
    /// Joint torques in the model's sign.
    pub(crate) torque: [NewtonMetre; N],
    /// Request of the operator, given in one tick only.
    pub(crate) power: Option<PowerRequest>,
}

/// Decision of the monitor at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision<const N: usize> {
    /// Final command to the drives.
    pub(crate) command: DriveCommand<N>,
    /// State that permitted the command.
    pub state: DriveState,
    /// Torques of the command in the model's sign; zero where off.
    pub torque: [NewtonMetre; N],
    /// Limits that reduced the request.
    pub limited: [Limited; N],
    /// Fault detected at this tick.
    pub fault: Option<Fault>,
    /// Why a request to enable was refused at this tick.
    pub(crate) refused: Option<Refusal>,
    /// Joints that are returning into their range.
    pub returns: [bool; N],
}

/// The monitor of one leg; see the module's steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Monitor<const N: usize> {
    limits: Limits<N>,
    barriers: [Barrier; N],
    ampere_per_nm: [f32; N],
    derating: Derating<N>,
    /// 1.1 times the speed limits, rad/s. Below: ends of the ranges with their tolerance.
    fault_speed: [f32; N],
    fault_range: [[Radian; 2]; N],
    damp_ticks: u32,
    glitch_window: u64,
    glitches: [u64; N],
    /// Fault reported for the next tick.
    reported: Option<Fault>,
    /// Permitted ends of a returning joint.
    returns: [Option<[Radian; 2]>; N],
    may_return: [bool; N],
    state: DriveState,
}

impl<const N: usize> Monitor<N> {
    /// A monitor for `rate_hz` decisions per second, 100..=6,400, so that 10 ms are 1 to 64 ticks. A rate
    /// outside is replaced by the nearest.
    pub fn new(limits: Limits<N>, rate_hz: u32) -> Self {
        let rate_hz = rate_hz.clamp(100, 6400);
        let window_ticks = rate_hz * GLITCH_WINDOW_MS / 1000;
        Self {
            limits,
            barriers: limits.joints().map(|joint| Barrier::new(&joint)),
            ampere_per_nm: limits.joints().map(|joint| 1.0 / joint.torque_per_ampere.0),
            derating: Derating::NONE,
            fault_speed: limits.joints().map(|joint| OVERSPEED_FACTOR * joint.speed.0),
            fault_range: limits
                .joints()
                .map(|joint| [joint.low - RANGE_TOLERANCE, joint.high + RANGE_TOLERANCE]),
            damp_ticks: rate_hz * DAMP_MS / 1000,
            glitch_window: u64::MAX.checked_shr(64 - window_ticks).unwrap_or(0),
            glitches: [0; N],
            reported: None,
            returns: [None; N],
            may_return: [true; N],
            state: DriveState::NotReadyToSwitchOn,
        }
    }

    /// Checksum over all constants: limits, values derived from them, times.
    pub(crate) fn checksum(&self) -> Checksum {
        let limits = self.limits.joints().iter().fold(Checksum::EMPTY, |sum, joint| joint.add_to(sum));
        let barriers = self.barriers.iter().fold(limits, |sum, barrier| barrier.add_to(sum));
        barriers
            .numbers(self.ampere_per_nm)
            .numbers(self.fault_speed)
            .numbers(self.fault_range.iter().flatten().map(|end| end.0))
            .word(self.damp_ticks)
            .word(self.glitch_window as u32)
    }

    /// Reports a fault from outside; the next tick treats it like one of the monitor's own detectors. One
    /// whose reaction is Off is not replaced.
    pub(crate) fn report(&mut self, fault: Fault) {
        if self.reported.is_none_or(|before| before.code.reaction() != Reaction::Off) {
            self.reported = Some(fault);
        }
    }

    /// Sets the derating of each joint's torque cap from the next tick on.
    pub(crate) fn derate(&mut self, derating: &Derating<N>) {
        if self.derating != *derating {
            self.derating = *derating;
            for (joint, barrier) in self.barriers.iter_mut().enumerate() {
                barrier.derate(derating.shares(joint));
            }
        }
    }

    /// Selects the joints that may be enabled outside their range; all by default.
    pub(crate) const fn permit_return(&mut self, joints: [bool; N]) {
        self.may_return = joints;
    }

    /// Joints that are returning into their range.
    pub(crate) fn returns(&self) -> [bool; N] {
        self.returns.map(|ends| ends.is_some() && self.state.is_enabled())
    }

    /// Codes of the limits that a decision applied to each joint.
    pub(crate) fn limit_codes(&self, decision: &Decision<N>) -> [LimitCodes; N] {
        core::array::from_fn(|joint| {
            LimitCodes::new(&decision.limited[joint], &self.limits.joints()[joint], &self.derating, joint)
        })
    }

    /// State of the drive.
    pub fn state(&self) -> DriveState {
        self.state
    }

    /// Limits of each joint.
    pub fn limits(&self) -> &Limits<N> {
        &self.limits
    }

    /// Resets to the state after start: drive off, no rejected reading. A fault stays until its reset.
    pub(crate) const fn restart(&mut self) {
        (self.state, self.glitches) = (self.state.at_rest(), [0; N]);
        self.returns = [None; N];
    }

    /// Runs instead of [`Self::decide`] while the joints have no valid readings; `resets` requests the reset
    /// of a fault. Returns a new fault.
    pub(crate) fn stand_by(&mut self, resets: bool) -> Option<Fault> {
        let fault = self.reported.take();
        self.state = match (fault, self.state.at_rest()) {
            (Some(fault), state) => state.after(Event::Failed(fault), 0),
            (None, _) if resets => DriveState::NotReadyToSwitchOn,
            (None, state) => state,
        };
        fault
    }

    /// Decides one tick.
    #[must_use]
    pub(crate) fn decide(&mut self, observation: &Observation<N>, request: &Request<N>) -> Decision<N> {
        let fault = self.detect(observation, request);
        let mut refused = None;
        self.state = match fault {
            Some(fault) => self.state.after(Event::Failed(fault), self.damp_ticks),
            None => {
                let state = self.state.after(Event::Tick, self.damp_ticks);
                match request.power {
                    None => state,
                    Some(power) => {
                        let requested = state.after(Event::Requested(power), self.damp_ticks);
                        let enables = requested.is_enabled() && requested != state;
                        if enables {
                            refused = self.refusal(observation);
                            self.begin_return(observation);
                        }
                        if refused.is_some() { state } else { requested }
                    }
                }
            }
        };
        let mut decision = Decision {
            command: DriveCommand::OFF,
            state: self.state,
            torque: [NewtonMetre::ZERO; N],
            limited: [Limited::default(); N],
            fault,
            refused,
            returns: self.returns(),
        };
        match self.state.permission() {
            Permission::Off => return decision,
            Permission::Damp => {
                for joint in 0..N {
                    decision.torque[joint] = self.barriers[joint].damp(observation.velocity[joint]);
                }
            }
            Permission::Follow => {
                for joint in 0..N {
                    (decision.torque[joint], decision.limited[joint]) = self.barriers[joint].bound(
                        observation.position[joint],
                        observation.velocity[joint],
                        request.torque[joint],
                        decision.returns[joint],
                    );
                }
            }
        }
        decision.command.enabled = true;
        for joint in 0..N {
            let current = Ampere(decision.torque[joint].0 * self.ampere_per_nm[joint]);
            decision.command.currents[joint] = current.limited(self.limits.joints()[joint].current);
        }
        if !decision.command.currents.iter().all(|current| current.is_finite()) {
            decision.command = DriveCommand::OFF;
        }
        decision
    }

    /// First fault of this tick; values that are not finite come before everything else.
    fn detect(&mut self, observation: &Observation<N>, request: &Request<N>) -> Option<Fault> {
        let fault = |code, joint: usize| Some(Fault { code, joint: joint as u8 });
        for joint in 0..N {
            let finite = observation.position[joint].is_finite()
                && observation.velocity[joint].is_finite()
                && observation.current[joint].is_finite()
                && request.torque[joint].is_finite();
            if !finite {
                return fault(FaultCode::NotFinite, joint);
            }
        }
        let mut found = self.reported.take();
        for joint in 0..N {
            let rejected = observation.rejected[joint];
            self.glitches[joint] = (self.glitches[joint] << 1 | u64::from(rejected)) & self.glitch_window;
            if rejected && has_too_many(self.glitches[joint]) {
                found = found.or(fault(FaultCode::EncoderStep, joint));
            }
        }
        let permission = self.state.permission();
        if permission != Permission::Off {
            for joint in 0..N {
                if observation.velocity[joint].abs().0 > self.fault_speed[joint] {
                    found = found.or(fault(FaultCode::Overspeed, joint));
                }
                let position = observation.position[joint];
                let is_outside = match self.returns[joint] {
                    None => !self.in_range(joint, position),
                    // The leg is already stopping.
                    Some(_) if permission != Permission::Follow => false,
                    Some(ends) => self.goes_on_out(joint, position, ends),
                };
                if is_outside {
                    found = found.or(fault(FaultCode::PositionLimit, joint));
                }
            }
        }
        found
    }

    fn refusal(&self, observation: &Observation<N>) -> Option<Refusal> {
        (0..N).find_map(|joint| {
            let is_inside = self.in_range(joint, observation.position[joint]);
            let (position, velocity) = (observation.position[joint], observation.velocity[joint]);
            let may_move = is_inside && self.derating.first_motion(joint) >= 1.0;
            let is_slow = (may_move || velocity.abs().0 <= RETURN_SPEED)
                && (!is_inside || self.barriers[joint].stops_in_range(position, velocity, RANGE_TOLERANCE));
            let reason = if !(is_inside || self.may_return[joint] && self.is_within_reach(joint, observation))
            {
                RefusalReason::OutOfRange
            } else if !is_slow {
                RefusalReason::Moving
            } else if observation.rejected[joint] {
                RefusalReason::Encoder
            } else {
                return None;
            };
            Some(Refusal { joint: joint as u8, reason })
        })
    }

    fn is_within_reach(&self, joint: usize, observation: &Observation<N>) -> bool {
        let (ends, position) = (&self.limits.joints()[joint], observation.position[joint]);
        position >= ends.low - RETURN_REACH && position <= ends.high + RETURN_REACH
    }

    /// Sets the permitted ends of the joints that are outside their range.
    fn begin_return(&mut self, observation: &Observation<N>) {
        for joint in 0..N {
            let position = observation.position[joint];
            let is_inside = self.in_range(joint, position);
            let ends = self.limits.joints()[joint];
            let ends = [min(ends.low.0, position.0), max(ends.high.0, position.0)];
            self.returns[joint] = (!is_inside).then_some(ends.map(Radian));
        }
    }

    /// Returns whether a returning joint moves outwards instead. Its permitted end only ever moves inwards.
    fn goes_on_out(&mut self, joint: usize, position: Radian, [low, high]: [Radian; 2]) -> bool {
        let ends = &self.limits.joints()[joint];
        let is_back = position >= ends.low - RETURNED && position <= ends.high + RETURNED;
        let nearer = [max(low.0, min(ends.low.0, position.0)), min(high.0, max(ends.high.0, position.0))];
        self.returns[joint] = (!is_back).then_some(nearer.map(Radian));
        position < low - RANGE_TOLERANCE || position > high + RANGE_TOLERANCE
    }

    #[inline]
    fn in_range(&self, joint: usize, position: Radian) -> bool {
        let [low, high] = self.fault_range[joint];
        position >= low && position <= high
    }
}

/// Whether a window has too many glitches. Not inlined: inlined, the bits are counted in every tick, and the
/// processor has no instruction for that.
#[cold]
#[inline(never)]
const fn has_too_many(glitches: u64) -> bool {
    glitches.count_ones() >= GLITCHES_FOR_FAULT
}

/// Access for bit flips, host only (row M2 of docs/safety.md).
#[cfg(not(target_os = "none"))]
impl<const N: usize> Monitor<N> {
    /// A joint's current per torque, overspeed bound, or lower or upper end of its range with tolerance.
    pub(crate) fn number_mut(&mut self, joint: usize, number: u8) -> Option<&mut f32> {
        match number {
            0 => self.ampere_per_nm.get_mut(joint),
            1 => self.fault_speed.get_mut(joint),
            2 => self.fault_range.get_mut(joint).map(|[low, _]| &mut low.0),
            _ => self.fault_range.get_mut(joint).map(|[_, high]| &mut high.0),
        }
    }
}

#[cfg(test)]
mod tests;
