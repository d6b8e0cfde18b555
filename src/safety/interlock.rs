//! Interlock: inhibit reasons, and the checks of every current tick before an axis runs.
//!
//! Why here: a board stores the reasons in one word that every priority level can set (`operation::Inhibit`).
//! The decision depends on values only, so the same code is tested against every fault on the host.
//!
//! A reason stays set until the operator resets. One that still holds is set again in the next tick. While
//! any reason is set, both bridges are off in every tick and the servo keeps its drive off.
//!
//! | detected by | reason | after |
//! | --- | --- | --- |
//! | [`TickWatch`] | emergency stop, gate driver's fault, a shunt without conversion | same tick |
//! | [`TickWatch`] | current ticks missed, without one in time between | 3: the servo damps; 24 (1 ms): Off |
//! | [`ServoWatch`] | servo without a tick since its last request | three requests in a row |
//!
//! **Number of reads.** Off drops the leg, so a spike on a wire must not lead there. A line counts as active
//! where 16 reads in a row agree, 0.3 to 0.5 us on the board ([`stays_active`]).
//!
//! | line | reads |
//! | --- | --- |
//! | emergency stop | 16, 0.3 to 0.5 us |
//! | gate drivers' nFAULT | 16, 0.3 to 0.5 us |
//! | missing conversion | 1: a flag of the converter, no wire |
//! | encoder's index | 2 pulses (`motor::axis`); at rest the interrupt reads the pin again |
//!
//! Emergency stop: the board has no filter at this input, and ringing of the bridges' edges should last less
//! than 0.25 us. An opened contact stays open for milliseconds, so no stop is lost; each is seen that
//! much later. The poll and the interrupt (EXTI4) use this one rule.
//!
//! nFAULT: an open drain with a weak pull-up beside the gate lines. No fault is that short. Overcurrent is
//! latched until the enable pin is cycled, and a lost supply holds the line for 8 ms. By then the driver has
//! turned its gates off. Warnings are pulses on another pin (nOCTW), which no input of the board reads. Reads
//! within one tick keep the deadline of one period.
//!
//! Cost: about 12 instructions per axis and tick, and the reads of an active line.

use super::fault::FaultCode;
use crate::listed::listed;

/// Returns whether a line is active in 16 reads in a row; the first inactive read ends the check. The board's
/// image spends 45 instructions between the first and the last: 0.27, 0.36, 0.54 us at 1.0, 1.34, 2.0 cycles
/// per instruction of 168 MHz.
#[inline(always)]
pub fn stays_active(mut is_active: impl FnMut() -> bool) -> bool {
    // Written out: a loop around each of the sixteen reads doubles the time to an open contact.
    let mut four = || is_active() && is_active() && is_active() && is_active();
    four() && four() && four() && four()
}

/// Missed ticks, or unanswered requests to the servo, in a row that are a fault.
const PATIENCE: u8 = 3;
/// Missed ticks after which damping ends too: one millisecond.
const DAMPING_ENDS_AFTER_TICKS: u8 = 24;

listed! {
    /// Inhibit reason: keeps the drive off.
    #[repr(u8)]
    pub enum InhibitReason {
        /// All reasons, in the order of their bits.
        ALL;
        /// The emergency stop's contact is open.
        EmergencyStop;
        /// A gate driver reports a fault.
        GateFault;
        /// A gate driver does not hold its configuration.
        GateConfiguration;
        /// The first axis turned its outputs off.
        Axis1;
        /// The second axis turned its outputs off.
        Axis2;
        /// An axis detected a frozen counter: both axes brake.
        EncoderFrozen;
        /// A switching axis lost its rotor angle, so damping is impossible: both axes brake.
        EncoderPosition;
        /// 24 current ticks were missed without one in time between them.
        CurrentTicks;
        /// The servo did not answer three times in a row.
        ServoTicks;
        /// One shunt's conversion ended without the other's.
        Conversion;
        /// The firmware crashed before this start.
        Crash;
        /// The watchdog reset the board.
        Watchdog;
        /// The bridges' timers are not in phase.
        Timers;
        /// The board version does not determine the divider of the bus voltage.
        BoardVersion;
        /// The constants of an axis or of the leg are invalid.
        Configuration;
        /// The flash is being written, which may stall the processor.
        Storing;
        /// Too much current into the supply: both axes brake.
        ChargeCurrent;
        /// The processor's supply was too low for a flash write.
        ProcessorSupply;
        /// The operator's reset restarts the gate drivers.
        Resetting;
    }
}

impl InhibitReason {
    /// Fault that corresponds to the reason. `None` for an axis, which reports its own fault, and for
    /// storing and resetting, which were requested.
    pub const fn code(self) -> Option<FaultCode> {
        Some(match self {
            Self::EmergencyStop => FaultCode::EmergencyStop,
            Self::GateFault => FaultCode::GateFault,
            Self::GateConfiguration => FaultCode::GateConfiguration,
            Self::Axis1 | Self::Axis2 | Self::Storing | Self::Resetting => return None,
            Self::EncoderFrozen => FaultCode::EncoderFrozen,
            Self::EncoderPosition => FaultCode::EncoderPosition,
            Self::CurrentTicks => FaultCode::CurrentTicks,
            Self::ServoTicks => FaultCode::ServoTicks,
            Self::Conversion => FaultCode::Conversion,
            Self::Crash => FaultCode::Crash,
            Self::Watchdog => FaultCode::Watchdog,
            Self::Timers => FaultCode::Timers,
            Self::BoardVersion => FaultCode::BoardVersion,
            Self::Configuration => FaultCode::Configuration,
            Self::ChargeCurrent => FaultCode::ChargeCurrent,
            Self::ProcessorSupply => FaultCode::ProcessorSupply,
        })
    }

    /// Word used in records.
    pub const fn name(self) -> &'static str {
        match (self, self.code()) {
            (Self::Axis1, _) => "axis_1",
            (Self::Axis2, _) => "axis_2",
            (Self::Storing, _) => "storing",
            (Self::Resetting, _) => "resetting",
            (_, Some(code)) => code.name(),
            (_, None) => "-",
        }
    }

    /// Bit in the inhibit word.
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }

    /// Reason that an axis (from 0) sets for its own fault. Only a switching axis leads to braking.
    pub(crate) const fn from_axis_fault(axis: usize, code: FaultCode, switching: bool) -> Self {
        match (code, axis) {
            (FaultCode::EncoderFrozen, _) if switching => Self::EncoderFrozen,
            (FaultCode::EncoderPosition, _) if switching => Self::EncoderPosition,
            (_, 0) => Self::Axis1,
            _ => Self::Axis2,
        }
    }

    /// Bits of the reasons that no reset clears: another board, other constants or a new start are needed.
    pub const fn for_ever() -> u32 {
        Self::Timers.bit() | Self::BoardVersion.bit() | Self::Configuration.bit()
    }
}

/// Operation of both bridges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bridges {
    /// Follow the servo's request.
    Follow,
    /// Active short circuit by the low sides: the motors brake. Requires a healthy gate driver, and an axis
    /// that turns off when its current exceeds the bound.
    Brake,
    /// Outputs off.
    Off,
}

impl Bridges {
    /// Derives the operation from the inhibit word. The bridges brake only where no other reason is set.
    #[inline(always)]
    pub const fn from_causes(causes: u32) -> Self {
        if causes == 0 { Self::Follow } else { Self::while_inhibited(causes) }
    }

    /// Operation while a reason is set. A separate function: in most ticks none is.
    #[cold]
    #[inline(never)]
    const fn while_inhibited(causes: u32) -> Self {
        const BRAKE: u32 = InhibitReason::EncoderFrozen.bit()
            | InhibitReason::EncoderPosition.bit()
            | InhibitReason::ChargeCurrent.bit();
        if causes & !BRAKE == 0 { Self::Brake } else { Self::Off }
    }
}

/// Board state at one tick of an axis, besides the axis' own sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickState {
    /// The emergency stop's contact is open.
    pub emergency_stop: bool,
    /// A gate driver reports a fault.
    pub gate_fault: bool,
    /// Both of the axis' shunts were converted.
    pub complete: bool,
    /// Ticks of the axis missed since its last one.
    pub missed: u8,
}

/// Checks the board before each tick of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickWatch {
    missed: u8,
}

impl TickWatch {
    /// Returns the inhibit bits from this tick on, and whether enough ticks are missing that the servo must
    /// damp.
    #[inline(always)]
    pub fn check(&mut self, now: &TickState) -> (u32, bool) {
        if now.missed == 0 && now.complete && !now.emergency_stop && !now.gate_fault {
            self.missed = 0;
            return (0, false);
        }
        self.handle_fault(*now)
    }

    /// Handles a tick with a fault.
    #[cold]
    #[inline(never)]
    fn handle_fault(&mut self, now: TickState) -> (u32, bool) {
        let before = self.missed;
        self.missed = if now.missed > 0 { self.missed.saturating_add(now.missed) } else { 0 };
        let bit = |holds: bool, cause: InhibitReason| if holds { cause.bit() } else { 0 };
        let forbids = bit(now.emergency_stop, InhibitReason::EmergencyStop)
            | bit(now.gate_fault, InhibitReason::GateFault)
            | bit(!now.complete, InhibitReason::Conversion)
            | bit(self.missed >= DAMPING_ENDS_AFTER_TICKS, InhibitReason::CurrentTicks);
        (forbids, before < PATIENCE && self.missed >= PATIENCE)
    }
}

/// Checks that the servo answers each request for a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ServoWatch {
    /// The servo's tick count at the last request; `None` before the first.
    ticks: Option<u32>,
    unanswered: u8,
}

impl ServoWatch {
    /// Call before each request with the servo's tick count. Returns whether the last request was not
    /// answered, and the inhibit bit that follows.
    pub fn check(&mut self, ticks: u32) -> (bool, u32) {
        let missed = self.ticks == Some(ticks);
        self.unanswered = if missed { self.unanswered.saturating_add(1) } else { 0 };
        self.ticks = Some(ticks);
        (missed, if self.unanswered >= PATIENCE { InhibitReason::ServoTicks.bit() } else { 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: TickState = TickState { emergency_stop: false, gate_fault: false, complete: true, missed: 0 };

    #[test]
    fn every_contact_inhibits_in_its_own_tick() {
        let cases = [
            (TickState { emergency_stop: true, ..GOOD }, InhibitReason::EmergencyStop),
            (TickState { gate_fault: true, ..GOOD }, InhibitReason::GateFault),
            (TickState { complete: false, ..GOOD }, InhibitReason::Conversion),
        ];
        for (state, cause) in cases {
            let mut watch = TickWatch::default();
            assert_eq!((watch.check(&GOOD), watch.check(&state)), ((0, false), (cause.bit(), false)));
        }
    }

    #[test]
    fn only_a_line_that_stays_active_stops_the_drive() {
        // The line is active in the first `active` reads.
        let read = |active: u32| {
            let mut reads = 0;
            let believed = stays_active(|| {
                reads += 1;
                reads <= active
            });
            (believed, reads)
        };
        assert_eq!(read(0), (false, 1), "an inactive line costs one read");
        assert_eq!([read(1), read(15)], [(false, 2), (false, 16)]);
        assert_eq!([read(16), read(u32::MAX)], [(true, 16); 2]);
    }

    #[test]
    fn three_missed_ticks_are_a_fault_and_sparser_ones_are_not() {
        let mut watch = TickWatch::default();
        let late = TickState { missed: 1, ..GOOD };
        let seen = [late, late, GOOD, late, late, late].map(|state| watch.check(&state));
        assert_eq!(seen.map(|(_, damp)| damp), [false, false, false, false, false, true]);
        assert!(seen.iter().all(|(forbids, _)| *forbids == 0));
        let gap = |missed| TickWatch::default().check(&TickState { missed, ..GOOD });
        assert_eq!([gap(2), gap(3)], [(0, false), (0, true)]);
        // Reported once, then off if the misses continue.
        let damps = [1, 17, 1].map(|missed| watch.check(&TickState { missed, ..GOOD }).1);
        assert_eq!(damps, [false; 3]);
        assert_eq!(gap(24), (InhibitReason::CurrentTicks.bit(), true));
    }

    #[test]
    fn a_servo_that_misses_three_requests_inhibits() {
        let mut watch = ServoWatch::default();
        let seen = [1, 2, 2, 2, 3, 3, 3, 3].map(|ticks| watch.check(ticks));
        let given_up = InhibitReason::ServoTicks.bit();
        let expected = [false, false, true, true, false, true, true, true];
        assert_eq!(seen.map(|(missed, _)| missed), expected);
        assert_eq!(seen.map(|(_, bits)| bits), [0, 0, 0, 0, 0, 0, 0, given_up]);
    }

    #[test]
    fn bridges_brake_only_without_another_reason() {
        let brakes =
            [InhibitReason::EncoderFrozen, InhibitReason::EncoderPosition, InhibitReason::ChargeCurrent]
                .map(InhibitReason::bit);
        let all = brakes.iter().fold(0, |bits, bit| bits | bit);
        assert_eq!(Bridges::from_causes(0), Bridges::Follow);
        assert_eq!(brakes.map(Bridges::from_causes), [Bridges::Brake; 3]);
        assert_eq!(Bridges::from_causes(all), Bridges::Brake);
        for cause in InhibitReason::ALL.into_iter().filter(|cause| cause.bit() & all == 0) {
            let with_each = brakes.map(|brake| Bridges::from_causes(cause.bit() | brake));
            assert_eq!(Bridges::from_causes(cause.bit()), Bridges::Off, "{cause:?}");
            assert_eq!(with_each, [Bridges::Off; 3], "{cause:?}");
        }
    }

    #[test]
    fn every_cause_has_a_unique_bit_and_a_word() {
        let all = InhibitReason::ALL.iter().fold(0, |bits, cause| bits | cause.bit());
        assert_eq!(all.count_ones() as usize, InhibitReason::ALL.len());
        assert!(InhibitReason::ALL.iter().all(|cause| cause.name() != "-"));
    }
}
