//! The monitor: shown what was measured and what is wanted, it decides last in every tick.
//!
//! Why last: whatever a controller, a model or a bus produces, only what leaves [`Monitor::decide`] reaches the
//! bridge. One tick runs detectors, state, bounds, in this order:
//!
//! 1. Detect. Anything measured or wanted that is not finite; encoder readings rejected three times in 10 ms; while
//!    the drive is on, more than 1.1 times the speed limit or 0.5 degrees beyond the range.
//! 2. Move the state ([`DriveState::after`]): a fault, or the tick and then the operator's request. To enable, the
//!    joints must stand within range and speed, or the request is refused with its reason.
//! 3. Permission of the state: released, damp, or the wanted torque within the bounds of [`Barrier`].
//! 4. Torque to current, and a last look: a current that is not finite releases the bridges.
//!
//! Cost: about 60 operations and two square roots per joint.

use super::barrier::{Barrier, Limited};
use super::fault::{Fault, FaultCode};
use super::limits::Limits;
use super::state::{DriveState, Event, Permission, PowerRequest};
use crate::hal::DriveCommand;
use crate::units::{Ampere, NewtonMetre, Radian, RadianPerSecond};

/// Damping lasts this long at most.
const DAMP_MS: u32 = 300;
/// Rejected readings are counted over this time.
const GLITCH_WINDOW_MS: u32 = 10;
/// So many rejected readings within the window are a fault.
const GLITCHES_FOR_FAULT: u32 = 3;
/// A joint is too fast above this multiple of its speed limit.
const OVERSPEED_FACTOR: f32 = 1.1;
/// A joint is out of its range beyond this much (0.5 degrees).
const RANGE_TOLERANCE: Radian = Radian(0.008_727);

/// What the sensors say about `N` joints, in the model's angle and sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation<const N: usize> {
    /// Joint angles.
    pub position: [Radian; N],
    /// Joint velocities.
    pub velocity: [RadianPerSecond; N],
    /// Measured motor currents, in the drive's sign.
    pub current: [Ampere; N],
    /// The encoder reading of this tick was impossible and not used.
    pub rejected: [bool; N],
}

/// What is wanted of the drives at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request<const N: usize> {
    /// Joint torques in the model's sign.
    pub torque: [NewtonMetre; N],
    /// What the operator asks for, at the one tick at which it is asked.
    pub power: Option<PowerRequest>,
}

/// Why the drive was not enabled although it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Counted from 0.
    pub joint: u8,
    /// What stands against it.
    pub reason: RefusalReason,
}

/// What stands against enabling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusalReason {
    /// The joint is out of its range by more than 0.5 degrees.
    OutOfRange,
    /// The joint is faster than its limit.
    Moving,
    /// The encoder reading of this tick was rejected.
    Encoder,
}

/// What the monitor decided at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision<const N: usize> {
    /// For the drives, and final.
    pub command: DriveCommand<N>,
    /// The state that permitted it.
    pub state: DriveState,
    /// Torques behind the command, model's sign; zero where released.
    pub torque: [NewtonMetre; N],
    /// What was taken from the request.
    pub limited: [Limited; N],
    /// A fault that a detector saw at this very tick.
    pub fault: Option<Fault>,
    /// Why a request to enable was refused at this tick.
    pub refused: Option<Refusal>,
}

/// The monitor of one leg; see the module's steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Monitor<const N: usize> {
    limits: Limits<N>,
    barriers: [Barrier; N],
    ampere_per_nm: [f32; N],
    damp_ticks: u32,
    glitch_window: u64,
    glitches: [u64; N],
    state: DriveState,
}

impl<const N: usize> Monitor<N> {
    /// A monitor that decides `rate_hz` times per second (100..=6,400, so that 10 ms are 1 to 64 ticks; a rate
    /// outside counts as the nearest).
    #[must_use]
    pub fn new(limits: Limits<N>, rate_hz: u32) -> Self {
        let rate_hz = rate_hz.clamp(100, 6400);
        let window_ticks = rate_hz * GLITCH_WINDOW_MS / 1000;
        Self {
            limits,
            barriers: limits.joints().map(|joint| Barrier::new(&joint)),
            ampere_per_nm: limits.joints().map(|joint| 1.0 / joint.torque_per_ampere.0),
            damp_ticks: rate_hz * DAMP_MS / 1000,
            glitch_window: u64::MAX.checked_shr(64 - window_ticks).unwrap_or(0),
            glitches: [0; N],
            state: DriveState::NotReadyToSwitchOn,
        }
    }

    /// Where the drive stands.
    #[must_use]
    pub fn state(&self) -> DriveState {
        self.state
    }

    /// What each joint may do.
    #[must_use]
    pub fn limits(&self) -> &Limits<N> {
        &self.limits
    }

    /// Decides one tick.
    #[must_use]
    pub fn decide(&mut self, observation: &Observation<N>, request: &Request<N>) -> Decision<N> {
        let fault = self.detect(observation, request);
        let mut refused = None;
        self.state = match fault {
            Some(fault) => self.state.after(Event::Failed(fault), self.damp_ticks),
            None => {
                let state = self.state.after(Event::Tick, self.damp_ticks);
                match request.power {
                    None => state,
                    Some(power) => {
                        let asked = state.after(Event::Asked(power), self.damp_ticks);
                        let enables = asked == DriveState::OperationEnabled && asked != state;
                        refused = if enables { self.refusal(observation) } else { None };
                        if refused.is_some() { state } else { asked }
                    }
                }
            }
        };
        let mut decision = Decision {
            command: DriveCommand::RELEASED,
            state: self.state,
            torque: [NewtonMetre::ZERO; N],
            limited: [Limited::default(); N],
            fault,
            refused,
        };
        match self.state.permission() {
            Permission::Released => return decision,
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
            decision.command = DriveCommand::RELEASED;
        }
        decision
    }

    /// The first fault of this tick; what is not finite comes before everything else.
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
        let mut found = None;
        for joint in 0..N {
            let rejected = observation.rejected[joint];
            self.glitches[joint] = (self.glitches[joint] << 1 | u64::from(rejected)) & self.glitch_window;
            if rejected && self.glitches[joint].count_ones() >= GLITCHES_FOR_FAULT {
                found = found.or(fault(FaultCode::EncoderStep, joint));
            }
        }
        if self.state.permission() != Permission::Released {
            for joint in 0..N {
                if observation.velocity[joint].abs().0
                    > OVERSPEED_FACTOR * self.limits.joints()[joint].speed.0
                {
                    found = found.or(fault(FaultCode::Overspeed, joint));
                }
                if !self.in_range(joint, observation.position[joint]) {
                    found = found.or(fault(FaultCode::PositionLimit, joint));
                }
            }
        }
        found
    }

    fn refusal(&self, observation: &Observation<N>) -> Option<Refusal> {
        (0..N).find_map(|joint| {
            let reason = if !self.in_range(joint, observation.position[joint]) {
                RefusalReason::OutOfRange
            } else if observation.velocity[joint].abs() > self.limits.joints()[joint].speed {
                RefusalReason::Moving
            } else if observation.rejected[joint] {
                RefusalReason::Encoder
            } else {
                return None;
            };
            Some(Refusal { joint: joint as u8, reason })
        })
    }

    fn in_range(&self, joint: usize, position: Radian) -> bool {
        let limits = &self.limits.joints()[joint];
        position >= limits.low - RANGE_TOLERANCE && position <= limits.high + RANGE_TOLERANCE
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::tests::{HIP, KNEE};
    use super::*;

    const RATE_HZ: u32 = 4000;
    const MIDDLE: [Radian; 2] = [Radian(0.45), Radian(-0.9)];
    const STANDING: Observation<2> = Observation {
        position: MIDDLE,
        velocity: [RadianPerSecond::ZERO; 2],
        current: [Ampere::ZERO; 2],
        rejected: [false; 2],
    };

    fn request(torque: f32) -> Request<2> {
        Request { torque: [NewtonMetre(torque); 2], power: None }
    }

    fn ask(power: PowerRequest) -> Request<2> {
        Request { power: Some(power), ..request(0.0) }
    }

    fn enabled() -> Monitor<2> {
        let mut monitor = Monitor::new(Limits::new([HIP, KNEE]).expect("sensible"), RATE_HZ);
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            let _ = monitor.decide(&STANDING, &ask(power));
        }
        assert_eq!(monitor.state(), DriveState::OperationEnabled);
        monitor
    }

    #[test]
    fn nothing_that_is_not_finite_reaches_the_bridge() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for joint in 0..2 {
                for field in 0..4 {
                    let (mut observation, mut wanted) = (STANDING, request(5.0));
                    match field {
                        0 => observation.position[joint].0 = bad,
                        1 => observation.velocity[joint].0 = bad,
                        2 => observation.current[joint].0 = bad,
                        _ => wanted.torque[joint].0 = bad,
                    }
                    let mut monitor = enabled();
                    let decision = monitor.decide(&observation, &wanted);
                    let fault = Fault { code: FaultCode::NotFinite, joint: joint as u8 };
                    assert_eq!(decision.command, DriveCommand::RELEASED, "field {field}");
                    assert_eq!((decision.fault, decision.state), (Some(fault), DriveState::Fault { fault }));
                    // And it stays off when the number is fine again.
                    let decision = monitor.decide(&STANDING, &request(5.0));
                    assert_eq!(decision.command, DriveCommand::RELEASED);
                }
            }
        }
    }

    #[test]
    fn torque_and_current_never_exceed_their_caps() {
        let mut monitor = enabled();
        let mut random = 1_u32;
        for _ in 0..20_000 {
            let mut uniform = |bound: f32| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (random >> 8) as f32 / (1 << 23) as f32 * bound - bound
            };
            let observation = Observation {
                position: [Radian(0.45 + uniform(0.4)), Radian(-0.9 + uniform(0.7))],
                velocity: [RadianPerSecond(uniform(3.0)), RadianPerSecond(uniform(3.0))],
                ..STANDING
            };
            let wanted = [NewtonMetre(uniform(1e4)), NewtonMetre(uniform(300.0))];
            let decision = monitor.decide(&observation, &Request { torque: wanted, power: None });
            assert!(decision.command.enabled);
            for joint in 0..2 {
                assert!(decision.torque[joint].abs().0 <= 100.0);
                assert!(decision.command.currents[joint].abs().0 <= 80.0);
                assert_eq!(decision.limited[joint].torque, wanted[joint].abs().0 > 100.0);
            }
        }
    }

    #[test]
    fn currents_have_the_drives_sign() {
        let mut monitor = enabled();
        let decision = monitor.decide(&STANDING, &request(15.0));
        // 1.5 N m/A; the knee turns against its drive. One rounding of the reciprocal.
        assert!((decision.command.currents[0].0 - 10.0).abs() < 1e-5);
        assert!((decision.command.currents[1].0 + 10.0).abs() < 1e-5);
    }

    #[test]
    fn overspeed_damps_in_the_same_tick_for_300_ms_and_then_releases() {
        let mut monitor = enabled();
        let fast = Observation { velocity: [RadianPerSecond::ZERO, RadianPerSecond(3.5)], ..STANDING };
        let decision = monitor.decide(&fast, &request(30.0));
        let fault = Fault { code: FaultCode::Overspeed, joint: 1 };
        assert_eq!(decision.fault, Some(fault));
        assert!(decision.command.enabled && decision.torque[1] == NewtonMetre(-100.0));
        assert_eq!(decision.torque[0], NewtonMetre::ZERO);
        let mut damped = 1;
        while monitor.decide(&STANDING, &request(30.0)).command.enabled {
            damped += 1;
        }
        assert_eq!(damped, RATE_HZ * 3 / 10);
        assert_eq!(monitor.state(), DriveState::Fault { fault });
    }

    #[test]
    fn leaving_the_range_by_half_a_degree_is_a_fault_and_less_is_not() {
        for (position, faulty) in [
            (HIP.high + Radian(0.0085), false),
            (HIP.low - Radian(0.0085), false),
            (HIP.high + Radian(0.0089), true),
            (HIP.low - Radian(0.0089), true),
        ] {
            let mut monitor = enabled();
            let outside = Observation { position: [position, MIDDLE[1]], ..STANDING };
            let fault = monitor.decide(&outside, &request(0.0)).fault;
            assert_eq!(fault.map(|fault| fault.code), faulty.then_some(FaultCode::PositionLimit));
        }
    }

    #[test]
    fn a_fault_is_latched_until_reset_and_enabling_starts_over() {
        let mut monitor = enabled();
        let broken = Observation { current: [Ampere(f32::NAN); 2], ..STANDING };
        let _ = monitor.decide(&broken, &request(0.0));
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            assert!(!monitor.decide(&STANDING, &ask(power)).command.enabled);
        }
        // Reset is not heard while the cause lasts.
        let _ = monitor.decide(&broken, &ask(PowerRequest::ResetFault));
        assert!(monitor.state().fault().is_some());
        let _ = monitor.decide(&STANDING, &ask(PowerRequest::ResetFault));
        assert_eq!(monitor.state(), DriveState::SwitchOnDisabled);
        assert!(!monitor.decide(&STANDING, &ask(PowerRequest::EnableOperation)).command.enabled);
        let _ = monitor.decide(&STANDING, &ask(PowerRequest::Shutdown));
        let _ = monitor.decide(&STANDING, &ask(PowerRequest::SwitchOn));
        assert!(monitor.decide(&STANDING, &ask(PowerRequest::EnableOperation)).command.enabled);
    }

    #[test]
    fn three_rejected_readings_in_ten_milliseconds_are_a_fault_and_sparser_ones_are_not() {
        let glitch = Observation { rejected: [true, false], ..STANDING };
        for (gap, faulty) in [(0, true), (18, true), (19, false), (100, false)] {
            let mut monitor = enabled();
            let mut fault = None;
            for _ in 0..3 {
                for _ in 0..gap {
                    fault = fault.or(monitor.decide(&STANDING, &request(0.0)).fault);
                }
                fault = fault.or(monitor.decide(&glitch, &request(0.0)).fault);
            }
            // Three readings with 18 good ones between span 39 of the 40 ticks.
            assert_eq!(fault.map(|fault| fault.code), faulty.then_some(FaultCode::EncoderStep), "gap {gap}");
        }
    }

    #[test]
    fn a_leg_out_of_range_or_moving_too_fast_is_not_enabled_and_told_why() {
        let cases = [
            (Observation { position: [MIDDLE[0], Radian(0.1)], ..STANDING }, RefusalReason::OutOfRange),
            (
                Observation { velocity: [RadianPerSecond::ZERO, RadianPerSecond(3.2)], ..STANDING },
                RefusalReason::Moving,
            ),
            (Observation { rejected: [false, true], ..STANDING }, RefusalReason::Encoder),
        ];
        for (observation, reason) in cases {
            let mut monitor = Monitor::new(Limits::new([HIP, KNEE]).expect("sensible"), RATE_HZ);
            let _ = monitor.decide(&STANDING, &ask(PowerRequest::Shutdown));
            let _ = monitor.decide(&STANDING, &ask(PowerRequest::SwitchOn));
            let decision = monitor.decide(&observation, &ask(PowerRequest::EnableOperation));
            assert_eq!(decision.refused, Some(Refusal { joint: 1, reason }));
            assert_eq!((decision.state, decision.command.enabled), (DriveState::SwitchedOn, false));
        }
    }

    #[test]
    fn a_quick_stop_damps_and_does_not_come_back_by_itself() {
        let mut monitor = enabled();
        let turning = Observation { velocity: [RadianPerSecond(0.01); 2], ..STANDING };
        let decision =
            monitor.decide(&turning, &Request { power: Some(PowerRequest::QuickStop), ..request(50.0) });
        assert!(decision.command.enabled && decision.torque[0].0 < 0.0);
        for _ in 0..RATE_HZ {
            let _ = monitor.decide(&STANDING, &request(50.0));
        }
        assert_eq!(monitor.state(), DriveState::SwitchOnDisabled);
    }
}
