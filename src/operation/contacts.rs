//! Operation by two contacts in the operator's hand; without a bus they are the board's only controls.
//!
//! The enabling switch must be held, as on a robot's teach pendant: opening it turns the drive off in any
//! state. The start button selects the next step. Closing the switch alone starts nothing but holding the
//! pose.
//!
//! ```text
//! both open once after the start               required first: a stuck contact enables nothing
//! held + start, not calibrated                 calibrate both axes, one after the other
//! open + start, calibrated, no reference       the joints stand at their zero: take the reference
//! held, calibrated and referenced              shutdown, switch on, enable; once for each closing
//! held + start, enabled                        identify; or begin and end assistance, as configured
//! let go                                       quick stop of an enabled drive, else voltage off; ends a
//!                                             calibration
//! open + start for two seconds                 reset of a fault
//! ```
//!
//! A host on the bus may ask for calibration, reference and reset too ([`Operator::refusal`]): the rules are
//! those of the button, and the switch stays with the operator.
//!
//! A closed switch enables nothing if, since it closed, the drive damped, a host had or stopped the drive, or
//! the leg was blocked, not calibrated or without reference: it must be opened again, for 20 ms or more.
//! Otherwise the end of such a reason would enable the leg, and a host's stop would not last.
//!
//! A contact counts after 20 ms without change; an opened enabling switch counts at once. With the switch
//! open the button counts only after it was open too. So a button that is welded closed neither resets nor
//! takes a reference each time the operator lets go. Ticked at [`RATE_HZ`]. A request may be refused and is
//! repeated only by the operator.

use crate::bus::commissioning::{CommissioningStep, StepResult};
use crate::leg::{DriveState, Permission, PowerRequest};

/// Ticks per second.
pub const RATE_HZ: u32 = 500;
const STEADY_TICKS: u32 = RATE_HZ / 50;
const RESET_TICKS: u32 = 2 * RATE_HZ;
const VOID: u8 = u8::MAX;

/// Inputs of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Situation {
    /// The enabling switch is held.
    pub(crate) enabling: bool,
    /// The start button is pressed.
    pub(crate) start: bool,
    /// An inhibit reason is active.
    pub(crate) blocked: bool,
    /// A host has the drive, or had or stopped it since the last tick.
    pub(crate) host_acts: bool,
    /// Both axes have a calibration.
    pub(crate) calibrated: bool,
    /// A calibration is under way.
    pub(crate) calibrating: bool,
    /// The joints have a reference.
    pub(crate) referenced: bool,
    /// State of the drive; `None` before the servo runs.
    pub(crate) drive: Option<DriveState>,
}

/// Request of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OperatorRequest {
    /// A step of the drive's power states.
    Power(PowerRequest),
    /// Calibrate both axes. The motors turn, unless stored values can be checked at standstill.
    Calibrate,
    /// Turn the bridges off and end the calibration.
    EndCalibration,
    /// Take the reference: the joints stand at their zero.
    Reference,
    /// Begin what the leg is configured for: an identification or assistance.
    Begin,
    /// Clear faults and inhibit reasons.
    Reset,
}

impl From<CommissioningStep> for OperatorRequest {
    fn from(step: CommissioningStep) -> Self {
        match step {
            CommissioningStep::Calibrate => Self::Calibrate,
            CommissioningStep::Reference => Self::Reference,
            CommissioningStep::Reset => Self::Reset,
        }
    }
}

impl OperatorRequest {
    /// Word used in records.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Power(PowerRequest::Shutdown) => "shutdown",
            Self::Power(PowerRequest::SwitchOn) => "switch_on",
            Self::Power(PowerRequest::EnableOperation) => "enable_operation",
            Self::Power(PowerRequest::DisableOperation) => "disable_operation",
            Self::Power(PowerRequest::DisableVoltage) => "disable_voltage",
            Self::Power(PowerRequest::QuickStop) => "quick_stop",
            Self::Power(PowerRequest::ResetFault) => "reset_fault",
            Self::Calibrate => "calibrate",
            Self::EndCalibration => "end_calibration",
            Self::Reference => "reference",
            Self::Begin => "begin",
            Self::Reset => "reset",
        }
    }
}

/// A debounced contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Contact {
    closed: bool,
    /// Ticks for which the input has differed from `closed`.
    other: u32,
}

impl Contact {
    fn tick(&mut self, closed: bool) {
        self.other = if closed == self.closed { 0 } else { self.other + 1 };
        if self.other >= STEADY_TICKS {
            (self.closed, self.other) = (closed, 0);
        }
    }
}

/// State of the contacts; see the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Operator {
    enabling: Contact,
    start: Contact,
    /// Ticks for which both have been open; nothing is accepted before [`STEADY_TICKS`].
    open: u32,
    trusted: bool,
    /// The button has been open since the switch opened.
    ready: bool,
    /// Ticks for which the button has been pressed since then.
    pressed: u32,
    /// Ticks for which the switch has been open, debounced.
    opened: u32,
    /// Ticks for which its contact has been open.
    released: u32,
    /// Steps towards enabled requested during this closing of the switch; [`VOID`] if it must enable nothing.
    steps: u8,
}

impl Operator {
    /// Returns whether the switch is held, debounced, and was open before.
    pub(crate) const fn holds(&self) -> bool {
        self.trusted && self.enabling.closed
    }

    /// Returns why a step of commissioning is refused now, or `None`. The reasons are those for which the
    /// start button requests nothing.
    pub(crate) fn refusal(&self, step: CommissioningStep, now: &Situation) -> Option<StepResult> {
        use CommissioningStep::{Calibrate, Reference, Reset};
        use StepResult::{
            AlreadyDone, Calibrating, ContactsNotOpened, DriveOn, Inhibited, NotCalibrated, SwitchClosed,
            SwitchOpen,
        };
        let closed = self.enabling.closed;
        // A drive that damps must not lose its gate drivers.
        let acts = now.drive.is_some_and(|drive| drive.permission() != Permission::Off);
        // As long as the button is pressed for a reset.
        let is_fresh = step == Reset && self.opened < RESET_TICKS;
        let reasons = [
            (!self.trusted, ContactsNotOpened),
            (step == Calibrate && !closed, SwitchOpen),
            (step != Calibrate && closed || is_fresh, SwitchClosed),
            (now.calibrating, Calibrating),
            (stop(now).is_some() || acts, DriveOn),
            (step == Calibrate && now.blocked, Inhibited),
            (step == Calibrate && now.calibrated, AlreadyDone),
            (step == Reference && !now.calibrated, NotCalibrated),
            (step == Reference && now.referenced, AlreadyDone),
        ];
        reasons.into_iter().find_map(|(applies, reason)| applies.then_some(reason))
    }

    /// Runs one tick.
    pub fn tick(&mut self, now: &Situation) -> Option<OperatorRequest> {
        let before = (self.enabling.closed, self.start.closed);
        self.enabling.tick(now.enabling);
        self.start.tick(now.start);
        // An opened switch counts at once.
        self.enabling.closed &= now.enabling;
        self.opened = if self.enabling.closed { 0 } else { self.opened.saturating_add(1) };
        self.released = if now.enabling { 0 } else { self.released.saturating_add(1) };
        if !self.trusted {
            let open = !now.enabling && !now.start;
            self.open = if open { self.open + 1 } else { 0 };
            self.trusted = self.open >= STEADY_TICKS;
            // A stop is accepted at any time.
            return if now.enabling { None } else { stop(now) };
        }
        let damps = now.drive.is_some_and(|drive| drive.permission() == Permission::Damp);
        if self.released >= STEADY_TICKS {
            self.steps = 0;
        } else if damps || now.host_acts || now.blocked || !now.calibrated || !now.referenced {
            self.steps = VOID;
        }
        if !self.enabling.closed {
            return self.without_the_switch(now, before);
        }
        (self.ready, self.pressed) = (false, 0);
        let pressed = self.start.closed && !before.1;
        match now.drive {
            Some(DriveState::OperationEnabled) => return pressed.then_some(OperatorRequest::Begin),
            _ if pressed && self.refusal(CommissioningStep::Calibrate, now).is_none() => {
                return Some(OperatorRequest::Calibrate);
            }
            _ => {}
        }
        self.next_step(now.drive?)
    }

    /// Next of the steps shutdown, switch on, enable; each once per closing.
    fn next_step(&mut self, drive: DriveState) -> Option<OperatorRequest> {
        let (step, request) = match drive {
            DriveState::SwitchOnDisabled => (0, PowerRequest::Shutdown),
            DriveState::ReadyToSwitchOn => (1, PowerRequest::SwitchOn),
            DriveState::SwitchedOn => (2, PowerRequest::EnableOperation),
            _ => return None,
        };
        (self.steps == step).then(|| {
            self.steps += 1;
            OperatorRequest::Power(request)
        })
    }

    fn without_the_switch(&mut self, now: &Situation, before: (bool, bool)) -> Option<OperatorRequest> {
        if let Some(stop) = stop(now) {
            return Some(stop);
        }
        if self.start.closed {
            self.pressed = self.pressed.saturating_add(u32::from(self.ready));
            let permitted = self.refusal(CommissioningStep::Reset, now).is_none();
            return (self.pressed == RESET_TICKS && permitted).then_some(OperatorRequest::Reset);
        }
        self.ready = true;
        let short = before.1 && self.pressed > 0 && self.pressed < RESET_TICKS;
        self.pressed = 0;
        let permitted = self.refusal(CommissioningStep::Reference, now).is_none();
        (short && permitted).then_some(OperatorRequest::Reference)
    }
}

/// Stop request of an open switch.
fn stop(now: &Situation) -> Option<OperatorRequest> {
    match now.drive {
        _ if now.calibrating => Some(OperatorRequest::EndCalibration),
        Some(DriveState::OperationEnabled) => Some(OperatorRequest::Power(PowerRequest::QuickStop)),
        Some(DriveState::ReadyToSwitchOn | DriveState::SwitchedOn) => {
            Some(OperatorRequest::Power(PowerRequest::DisableVoltage))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::IntoIter;

    const REST: Situation = Situation {
        enabling: false,
        start: false,
        blocked: false,
        host_acts: false,
        calibrated: false,
        calibrating: false,
        referenced: false,
        drive: None,
    };
    const READY: Situation =
        Situation { calibrated: true, referenced: true, drive: Some(DriveState::SwitchOnDisabled), ..REST };

    /// Requests within some ticks of one situation.
    fn requested(operator: &mut Operator, now: Situation, ticks: u32) -> IntoIter<OperatorRequest> {
        let all: Vec<_> = (0..ticks).filter_map(|_| operator.tick(&now)).collect();
        all.into_iter()
    }

    /// An operator that has seen both contacts open and then the switch held.
    fn holding() -> Operator {
        let mut operator = trusted();
        assert_eq!(requested(&mut operator, Situation { enabling: true, ..REST }, RATE_HZ).count(), 0);
        operator
    }

    fn trusted() -> Operator {
        let mut operator = Operator::default();
        assert_eq!(requested(&mut operator, REST, 2 * STEADY_TICKS).count(), 0);
        operator
    }

    #[test]
    fn a_contact_stuck_closed_at_the_start_requests_nothing() {
        for stuck in [Situation { enabling: true, ..READY }, Situation { start: true, ..READY }] {
            let mut operator = Operator::default();
            assert_eq!(requested(&mut operator, stuck, 10 * RESET_TICKS).count(), 0);
            // After it has been open it counts.
            assert_eq!(requested(&mut operator, READY, 2 * STEADY_TICKS).count(), 0);
            let request = requested(&mut operator, Situation { enabling: true, ..READY }, RATE_HZ).next();
            assert_eq!(request, Some(OperatorRequest::Power(PowerRequest::Shutdown)));
        }
    }

    #[test]
    fn each_enabling_step_is_requested_once_per_closing() {
        let mut operator = trusted();
        let held = Situation { enabling: true, ..READY };
        let mut drive = DriveState::SwitchOnDisabled;
        let mut steps = 0;
        for _ in 0..RATE_HZ {
            if let Some(OperatorRequest::Power(request)) =
                operator.tick(&Situation { drive: Some(drive), ..held })
            {
                drive = drive.after(crate::leg::DriveEvent::Requested(request), 1);
                steps += 1;
            }
        }
        assert_eq!((drive, steps), (DriveState::OperationEnabled, 3));
        // After a fault reset with the switch held, the drive is not enabled again.
        assert_eq!(requested(&mut operator, held, RATE_HZ).count(), 0);
        // A refused step is not repeated before the switch was open.
        let refused = Situation { drive: Some(DriveState::SwitchedOn), ..held };
        assert_eq!(requested(&mut operator, refused, RATE_HZ).count(), 0);
        let open = Situation { enabling: false, drive: Some(DriveState::SwitchOnDisabled), ..READY };
        assert_eq!(requested(&mut operator, open, STEADY_TICKS).count(), 0);
        let request = requested(&mut operator, held, RATE_HZ).next();
        assert_eq!(request, Some(OperatorRequest::Power(PowerRequest::Shutdown)));
    }

    #[test]
    fn opening_the_switch_stops_in_the_same_tick_in_any_state() {
        let cases = [
            (Some(DriveState::OperationEnabled), false, OperatorRequest::Power(PowerRequest::QuickStop)),
            (Some(DriveState::SwitchedOn), false, OperatorRequest::Power(PowerRequest::DisableVoltage)),
            (Some(DriveState::ReadyToSwitchOn), false, OperatorRequest::Power(PowerRequest::DisableVoltage)),
            (None, true, OperatorRequest::EndCalibration),
        ];
        for (drive, calibrating, expected) in cases {
            let mut operator = holding();
            let held = Situation { enabling: true, drive, calibrating, ..READY };
            assert_eq!(operator.tick(&Situation { enabling: false, ..held }), Some(expected));
        }
    }

    #[test]
    fn a_host_that_acts_voids_the_present_closing_of_the_switch() {
        // During the debouncing, and after each of the steps; then the reset of the nodes ends its control.
        let states = [DriveState::SwitchOnDisabled, DriveState::ReadyToSwitchOn, DriveState::SwitchedOn];
        for (ticks, drive) in (0..).step_by(STEADY_TICKS as usize).zip(states) {
            let mut operator = trusted();
            let held = Situation { enabling: true, ..READY };
            assert!(requested(&mut operator, held, ticks).count() <= 1);
            let acts = Situation { host_acts: true, drive: Some(drive), ..held };
            assert_eq!(operator.tick(&acts), None);
            for drive in states {
                let now = Situation { drive: Some(drive), ..held };
                assert_eq!(requested(&mut operator, now, RATE_HZ).count(), 0, "{drive:?}");
            }
            // What it did while the switch was open does not matter.
            let open = Situation { enabling: false, host_acts: true, ..READY };
            assert_eq!(requested(&mut operator, open, STEADY_TICKS).count(), 0);
            let request = requested(&mut operator, held, RATE_HZ).next();
            assert_eq!(request, Some(OperatorRequest::Power(PowerRequest::Shutdown)));
        }
    }

    #[test]
    fn a_switch_that_closes_while_the_drive_damps_enables_nothing() {
        let off = Situation { enabling: true, ..READY };
        // Ticks for which the switch is closed before the damping ends: half of the debouncing, and more.
        for ticks in [STEADY_TICKS / 2, RATE_HZ] {
            let mut operator = holding();
            let damps =
                Situation { drive: Some(DriveState::QuickStopActive { remaining_ticks: 1 }), ..READY };
            assert_eq!(requested(&mut operator, damps, STEADY_TICKS).count(), 0);
            let held = Situation { enabling: true, ..damps };
            assert_eq!(requested(&mut operator, held, ticks).count(), 0);
            assert_eq!(requested(&mut operator, off, RATE_HZ).count(), 0, "{ticks}");
            // A bounce does not open it.
            assert_eq!(requested(&mut operator, READY, STEADY_TICKS - 1).count(), 0);
            assert_eq!(requested(&mut operator, off, RATE_HZ).count(), 0, "{ticks}");
            assert_eq!(requested(&mut operator, READY, STEADY_TICKS).count(), 0);
            let request = requested(&mut operator, off, RATE_HZ).next();
            assert_eq!(request, Some(OperatorRequest::Power(PowerRequest::Shutdown)));
        }
    }

    #[test]
    fn a_stop_needs_no_previously_open_contacts() {
        let mut operator = Operator::default();
        let enabled =
            Situation { enabling: true, start: true, drive: Some(DriveState::OperationEnabled), ..READY };
        assert_eq!(requested(&mut operator, enabled, RATE_HZ).count(), 0);
        let stop = Some(OperatorRequest::Power(PowerRequest::QuickStop));
        assert_eq!(operator.tick(&Situation { enabling: false, ..enabled }), stop);
        assert!(!operator.holds());
    }

    #[test]
    fn a_blocked_uncalibrated_or_unreferenced_leg_is_not_enabled() {
        let held = Situation { enabling: true, ..READY };
        for now in [
            Situation { blocked: true, ..held },
            Situation { calibrated: false, ..held },
            Situation { referenced: false, ..held },
            Situation { blocked: true, calibrated: false, start: true, ..held },
        ] {
            let mut operator = trusted();
            assert_eq!(requested(&mut operator, now, RATE_HZ).count(), 0, "{now:?}");
            // A reason that ends while the switch is held.
            assert_eq!(requested(&mut operator, held, RATE_HZ).count(), 0, "{now:?}");
        }
    }

    #[test]
    fn the_button_requests_the_next_step() {
        let with =
            |now: Situation| requested(&mut holding(), Situation { start: true, ..now }, RATE_HZ).next();
        assert_eq!(with(Situation { enabling: true, ..REST }), Some(OperatorRequest::Calibrate));
        let enabled = Situation { enabling: true, drive: Some(DriveState::OperationEnabled), ..READY };
        assert_eq!(with(enabled), Some(OperatorRequest::Begin));

        let mut operator = trusted();
        let stands = Situation { calibrated: true, ..REST };
        assert_eq!(requested(&mut operator, Situation { start: true, ..stands }, RATE_HZ / 2).count(), 0);
        assert_eq!(requested(&mut operator, stands, RATE_HZ).next(), Some(OperatorRequest::Reference));
        // A long press is a reset, without a reference when it is released.
        let long = requested(&mut operator, Situation { start: true, ..stands }, 2 * RESET_TICKS);
        assert!(long.eq([OperatorRequest::Reset]));
        assert_eq!(requested(&mut operator, stands, RATE_HZ).count(), 0);
        // A drive that damps keeps its gate drivers.
        let damps = DriveState::QuickStopActive { remaining_ticks: 1 };
        let damping = Situation { start: true, drive: Some(damps), ..READY };
        assert_eq!(requested(&mut operator, damping, 2 * RESET_TICKS).count(), 0);
    }

    #[test]
    fn a_welded_button_requests_nothing_when_the_switch_opens() {
        let stands = Situation { calibrated: true, ..REST };
        for now in [REST, stands, READY, Situation { blocked: true, ..READY }] {
            let mut operator = holding();
            let welded = Situation { start: true, ..now };
            for _ in 0..3 {
                let held = Situation { enabling: true, blocked: true, ..welded };
                assert_eq!(requested(&mut operator, held, RATE_HZ).count(), 0);
                assert_eq!(requested(&mut operator, welded, 2 * RESET_TICKS).count(), 0, "{now:?}");
            }
            // Releasing it requests nothing; after it was open it counts again.
            assert_eq!(requested(&mut operator, now, RATE_HZ).count(), 0, "{now:?}");
            let long = requested(&mut operator, welded, 2 * RESET_TICKS);
            assert!(long.eq([OperatorRequest::Reset]), "{now:?}");
        }
    }

    #[test]
    fn a_host_may_ask_for_what_the_button_would_request() {
        use CommissioningStep::{Calibrate, Reference, Reset};
        let held = Situation { enabling: true, ..REST };
        let stands = Situation { calibrated: true, ..REST };
        let enabled = Situation { enabling: true, drive: Some(DriveState::OperationEnabled), ..READY };
        let (open, closed) = (Some(StepResult::SwitchOpen), Some(StepResult::SwitchClosed));
        for (now, expected) in [
            (held, [None, closed, closed]),
            (REST, [open, Some(StepResult::NotCalibrated), None]),
            (stands, [open, None, None]),
            (READY, [open, Some(StepResult::AlreadyDone), None]),
            (Situation { blocked: true, ..held }, [Some(StepResult::Inhibited), closed, closed]),
            (Situation { calibrating: true, ..held }, [Some(StepResult::Calibrating), closed, closed]),
            (enabled, [Some(StepResult::DriveOn), closed, closed]),
        ] {
            let mut operator = trusted();
            for _ in 0..RESET_TICKS {
                let _ = operator.tick(&now);
            }
            let refusals = [Calibrate, Reference, Reset].map(|step| operator.refusal(step, &now));
            assert_eq!(refusals, expected, "{now:?}");
        }
        let stuck = Operator::default();
        assert_eq!(stuck.refusal(Reset, &REST), Some(StepResult::ContactsNotOpened));
        // The switch has just opened.
        let mut operator = trusted();
        assert_eq!(operator.refusal(Reset, &REST), closed);
        for _ in 0..RESET_TICKS {
            let _ = operator.tick(&REST);
        }
        // The drive is on, or damps.
        for drive in [DriveState::OperationEnabled, DriveState::QuickStopActive { remaining_ticks: 1 }] {
            let now = Situation { drive: Some(drive), ..READY };
            assert_eq!(operator.refusal(Reset, &now), Some(StepResult::DriveOn));
        }
    }

    #[test]
    fn a_bouncing_button_presses_once() {
        let mut operator = holding();
        let held = Situation { enabling: true, drive: Some(DriveState::OperationEnabled), ..READY };
        let mut count = 0;
        for tick in 0..RATE_HZ {
            let start = if tick < 40 { tick % 3 == 0 } else { tick < 200 };
            count += u32::from(operator.tick(&Situation { start, ..held }).is_some());
        }
        assert_eq!(count, 1);
    }
}
