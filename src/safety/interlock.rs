//! Why nothing may be enabled, and what every current tick looks at before an axis is asked.
//!
//! Why here: a board holds the reasons in one word that every level raises into (`operation::Inhibit`), but what raises them is
//! decided by values only, so the same code is tested against every fault on the host.
//!
//! A reason is raised once and stays until the operator resets; one that still holds is raised again in the next tick. While
//! there is one, both bridges are released in every tick and the servo keeps its drive off.
//!
//! | seen by | reason | after |
//! | --- | --- | --- |
//! | [`TickWatch`] | emergency stop, gate driver's fault, a shunt without conversion | the tick itself |
//! | [`TickWatch`] | current ticks missed, at once or with none in time between | three: the servo is told and damps; 24 (1 ms): Off |
//! | [`ServoWatch`] | a servo that did not tick since it was last called | three calls in a row |
//!
//! **How often a line is read.** Off drops the leg's hold, so a spike on a wire must not lead there. A line is believed where
//! [`READS`] reads in a row agree, 1 us on the board ([`stays_active`]); a single read would believe any spike that it meets.
//!
//! | line | reads | why |
//! | --- | --- | --- |
//! | emergency stop | 16, 1 us | The input has no filter on the board, and the bridges' edges ring for less. A contact that opens stays open for milliseconds, so no stop is lost; each comes 1 us later. The poll and the interrupt (EXTI4) use this one rule. |
//! | gate drivers' nFAULT | 16, 1 us | An open drain with a weak pull-up beside the gate lines. No fault is that short: overcurrent is latched until the enable pin is cycled, a lost supply holds the line for 8 ms, and the driver has shut its gates by then. Warnings are pulses on another pin (nOCTW), which no input of the board reads. Reads within one tick keep the deadline of one period. |
//! | missing conversion | 1 | A flag of the converter, no wire. |
//! | encoder's index | 2 pulses | One wrong pulse is noise: `motor::axis`. At rest the interrupt reads the pin again. |
//!
//! Cost: some 12 instructions per axis and tick, and the reads of an active line.

use super::fault::FaultCode;

/// Reads of a line that have to agree, of some 60 ns each on the board.
pub const READS: u32 = 16;

/// Whether a line is active in [`READS`] reads in a row; the first read that is not ends them.
#[inline(always)]
pub fn stays_active(mut is_active: impl FnMut() -> bool) -> bool {
    (0..READS).all(|_| is_active())
}

/// Missed ticks, or unanswered ones of the servo, in a row that are too many.
const PATIENCE: u8 = 3;
/// Missed ticks after which there is no damping any more either: a millisecond.
const HOPELESS: u8 = 24;

/// Why the drive is kept off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Cause {
    /// The emergency stop's contact is open.
    EmergencyStop,
    /// A gate driver reports a fault.
    GateFault,
    /// A gate driver does not hold its configuration.
    GateConfiguration,
    /// The first axis released itself.
    Axis1,
    /// The second axis did.
    Axis2,
    /// An axis found its counter frozen: both brake.
    EncoderFrozen,
    /// An axis that was switching lost its place, and with it the rotor's angle, without which nothing can be damped: both brake.
    EncoderPlace,
    /// Current ticks went on being missed: 24 with none in time between.
    CurrentTicks,
    /// The servo did not answer three times in a row.
    ServoTicks,
    /// One shunt's conversion ended without the other's.
    Conversion,
    /// The image before this one crashed.
    Crash,
    /// The watchdog bit.
    Watchdog,
    /// The bridges' timers are not in phase.
    Timers,
    /// The factory's version does not tell the divider of the bus voltage.
    BoardVersion,
    /// The constants of an axis or of the leg make no sense.
    Configuration,
    /// The flash is being written, and everything may stand still meanwhile.
    Storing,
}

impl Cause {
    /// All of them, in the order of their bits.
    pub const ALL: [Self; 16] = [
        Self::EmergencyStop,
        Self::GateFault,
        Self::GateConfiguration,
        Self::Axis1,
        Self::Axis2,
        Self::EncoderFrozen,
        Self::EncoderPlace,
        Self::CurrentTicks,
        Self::ServoTicks,
        Self::Conversion,
        Self::Crash,
        Self::Watchdog,
        Self::Timers,
        Self::BoardVersion,
        Self::Configuration,
        Self::Storing,
    ];

    /// The fault behind it; none of an axis, which tells its own, nor of what is no fault.
    #[must_use]
    pub const fn code(self) -> Option<FaultCode> {
        Some(match self {
            Self::EmergencyStop => FaultCode::EmergencyStop,
            Self::GateFault => FaultCode::GateFault,
            Self::GateConfiguration => FaultCode::GateConfiguration,
            Self::Axis1 | Self::Axis2 | Self::Storing => return None,
            Self::EncoderFrozen => FaultCode::EncoderFrozen,
            Self::EncoderPlace => FaultCode::EncoderPlace,
            Self::CurrentTicks => FaultCode::CurrentTicks,
            Self::ServoTicks => FaultCode::ServoTicks,
            Self::Conversion => FaultCode::Conversion,
            Self::Crash => FaultCode::Crash,
            Self::Watchdog => FaultCode::Watchdog,
            Self::Timers => FaultCode::Timers,
            Self::BoardVersion => FaultCode::BoardVersion,
            Self::Configuration => FaultCode::Configuration,
        })
    }

    /// The word in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match (self, self.code()) {
            (Self::Axis1, _) => "axis_1",
            (Self::Axis2, _) => "axis_2",
            (Self::Storing, _) => "storing",
            (_, Some(code)) => code.name(),
            (_, None) => "-",
        }
    }

    /// Its bit.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }

    /// What an axis (from 0) that found a fault of its own raises; only one that was switching leads to a brake.
    #[must_use]
    pub const fn of_axis(axis: usize, code: FaultCode, switching: bool) -> Self {
        match (code, axis) {
            (FaultCode::EncoderFrozen, _) if switching => Self::EncoderFrozen,
            (FaultCode::EncoderPlace, _) if switching => Self::EncoderPlace,
            (_, 0) => Self::Axis1,
            _ => Self::Axis2,
        }
    }

    /// Nothing the operator does makes this good: only another board, other constants or another start.
    #[must_use]
    pub const fn is_for_ever(self) -> bool {
        matches!(self, Self::Timers | Self::BoardVersion | Self::Configuration)
    }

    /// Bits of what a reset does not forget.
    #[must_use]
    pub const fn for_ever() -> u32 {
        Self::Timers.bit() | Self::BoardVersion.bit() | Self::Configuration.bit()
    }
}

/// What both bridges do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bridges {
    /// What the servo asks for.
    Follow,
    /// Low sides on: the motors brake themselves. Needs a healthy gate driver, and an axis that keeps its currents below the
    /// bound, or releases.
    Brake,
    /// Nothing.
    Release,
}

impl Bridges {
    /// What follows from the bits of all causes: to brake where nothing speaks against it but what led there.
    #[inline(always)]
    #[must_use]
    pub const fn of(causes: u32) -> Self {
        const BRAKE: u32 = Cause::EncoderFrozen.bit() | Cause::EncoderPlace.bit();
        match (causes, causes & !BRAKE) {
            (0, _) => Self::Follow,
            (_, 0) => Self::Brake,
            _ => Self::Release,
        }
    }
}

/// What the board shows at one tick of an axis, beside the axis' own sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickState {
    /// The emergency stop's contact is open.
    pub emergency_stop: bool,
    /// A gate driver reports a fault.
    pub gate_fault: bool,
    /// Both of the axis' shunts were converted.
    pub complete: bool,
    /// Ticks of the axis that were missed since its last one.
    pub missed: u8,
}

/// Looks before each tick of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickWatch {
    missed: u8,
}

impl TickWatch {
    /// Bits of what forbids to enable from this tick on, and whether so many ticks are missing now that the servo has to damp.
    #[inline(always)]
    pub fn look(&mut self, now: &TickState) -> (u32, bool) {
        if now.missed == 0 && now.complete && !now.emergency_stop && !now.gate_fault {
            self.missed = 0;
            return (0, false);
        }
        self.look_closer(*now)
    }

    /// The tick of which something is wrong.
    #[cold]
    #[inline(never)]
    fn look_closer(&mut self, now: TickState) -> (u32, bool) {
        let before = self.missed;
        self.missed = if now.missed > 0 { self.missed.saturating_add(now.missed) } else { 0 };
        let bit = |holds: bool, cause: Cause| if holds { cause.bit() } else { 0 };
        let forbids = bit(now.emergency_stop, Cause::EmergencyStop)
            | bit(now.gate_fault, Cause::GateFault)
            | bit(!now.complete, Cause::Conversion)
            | bit(self.missed >= HOPELESS, Cause::CurrentTicks);
        (forbids, before < PATIENCE && self.missed >= PATIENCE)
    }
}

/// Checks that the servo answers each request for a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoWatch {
    /// Ticks of the servo at the last request; `None` before the first.
    ticks: Option<u32>,
    unanswered: u8,
}

impl ServoWatch {
    /// Call before each request, with the ticks that the servo has done so far. Returns whether the last request was not answered, and
    /// the bit of the cause that then forbids to enable.
    pub fn look(&mut self, ticks: u32) -> (bool, u32) {
        let missed = self.ticks == Some(ticks);
        self.unanswered = if missed { self.unanswered.saturating_add(1) } else { 0 };
        self.ticks = Some(ticks);
        (missed, if self.unanswered >= PATIENCE { Cause::ServoTicks.bit() } else { 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: TickState = TickState { emergency_stop: false, gate_fault: false, complete: true, missed: 0 };

    #[test]
    fn every_contact_forbids_in_its_own_tick() {
        let cases = [
            (TickState { emergency_stop: true, ..GOOD }, Cause::EmergencyStop),
            (TickState { gate_fault: true, ..GOOD }, Cause::GateFault),
            (TickState { complete: false, ..GOOD }, Cause::Conversion),
        ];
        for (state, cause) in cases {
            let mut watch = TickWatch::default();
            assert_eq!((watch.look(&GOOD), watch.look(&state)), ((0, false), (cause.bit(), false)));
        }
    }

    #[test]
    fn a_spike_is_no_stop_and_a_line_that_stays_active_is_one() {
        // The line is active for so many reads from the first on.
        let read = |active: u32| {
            let mut reads = 0;
            let believed = stays_active(|| {
                reads += 1;
                reads <= active
            });
            (believed, reads)
        };
        assert_eq!(read(0), (false, 1), "an inactive line costs one read");
        assert_eq!([read(1), read(READS - 1)], [(false, 2), (false, READS)]);
        assert_eq!([read(READS), read(u32::MAX)], [(true, READS); 2]);
    }

    #[test]
    fn three_missed_ticks_are_too_many_and_sparser_ones_are_not() {
        let mut watch = TickWatch::default();
        let late = TickState { missed: 1, ..GOOD };
        let seen = [late, late, GOOD, late, late, late].map(|state| watch.look(&state));
        assert_eq!(seen.map(|(_, damp)| damp), [false, false, false, false, false, true]);
        assert!(seen.iter().all(|(forbids, _)| *forbids == 0));
        let gap = |missed| TickWatch::default().look(&TickState { missed, ..GOOD });
        assert_eq!([gap(2), gap(3)], [(0, false), (0, true)]);
        // Told once, and given up where it goes on.
        assert_eq!(
            [1, 17, 1].map(|missed| watch.look(&TickState { missed, ..GOOD })).map(|(_, damp)| damp),
            [false; 3]
        );
        assert_eq!(gap(24), (Cause::CurrentTicks.bit(), true));
    }

    #[test]
    fn a_servo_that_does_not_answer_three_requests_is_given_up() {
        let mut watch = ServoWatch::default();
        let seen = [1, 2, 2, 2, 3, 3, 3, 3].map(|ticks| watch.look(ticks));
        let given_up = Cause::ServoTicks.bit();
        let expected = [false, false, true, true, false, true, true, true];
        assert_eq!(seen.map(|(missed, _)| missed), expected);
        assert_eq!(seen.map(|(_, bits)| bits), [0, 0, 0, 0, 0, 0, 0, given_up]);
    }

    #[test]
    fn the_first_request_after_the_start_is_not_missed() {
        let mut watch = ServoWatch::default();
        assert_eq!([0, 0].map(|ticks| watch.look(ticks).0), [false, true]);
    }

    #[test]
    fn bridges_brake_only_while_nothing_else_speaks_against_it() {
        let (frozen, place) = (Cause::EncoderFrozen.bit(), Cause::EncoderPlace.bit());
        assert_eq!(Bridges::of(0), Bridges::Follow);
        assert_eq!([frozen, place, frozen | place].map(Bridges::of), [Bridges::Brake; 3]);
        for cause in Cause::ALL.into_iter().filter(|cause| cause.bit() & (frozen | place) == 0) {
            assert_eq!(
                [cause.bit(), cause.bit() | frozen].map(Bridges::of),
                [Bridges::Release; 2],
                "{cause:?}"
            );
        }
    }

    #[test]
    fn every_cause_has_a_bit_and_a_word_of_its_own() {
        let all = Cause::ALL.iter().fold(0, |bits, cause| bits | cause.bit());
        assert_eq!(all.count_ones() as usize, Cause::ALL.len());
        assert!(Cause::ALL.iter().all(|cause| cause.name() != "-"));
        let for_ever = Cause::ALL.iter().filter(|cause| cause.is_for_ever());
        assert_eq!(for_ever.fold(0, |bits, cause| bits | cause.bit()), Cause::for_ever());
    }
}
