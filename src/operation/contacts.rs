//! Two contacts in the operator's hand, and what they ask for: the board's whole operation as long as there is no bus.
//!
//! The enabling switch is held to run, as on a robot's teach pendant: open, it takes the drive off, whatever it was doing. The start button
//! says what comes next. Nothing begins by closing the switch alone but holding the pose.
//!
//! ```text
//! both open once after the start               only then anything is accepted: a contact that is stuck enables nothing
//! held + start, not calibrated                 calibrate both axes, one after the other
//! open + start, calibrated, no reference       the joints stand at their zero: take it
//! held, calibrated and referenced              shutdown, switch on, enable; asked once for each closing
//! held + start, enabled                        identify
//! let go                                       quick stop of an enabled drive, else voltage off; ends a calibration
//! open + start for two seconds                 reset of a fault
//! ```
//!
//! A contact counts once it has been steady for 20 ms; opening the enabling switch counts at once, bounce or not. With the switch open the
//! button counts once it was seen open meanwhile: one that is welded closed neither resets nor takes a reference each time the operator
//! lets go.
//! Ticked at [`RATE_HZ`]; what is asked may be refused, and is asked again only by the hand.

use crate::leg::{DriveState, PowerRequest};

/// Ticks per second.
pub const RATE_HZ: u32 = 500;
const STEADY_TICKS: u32 = RATE_HZ / 50;
const RESET_TICKS: u32 = 2 * RATE_HZ;

/// What is known at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// The enabling switch is held.
    pub enabling: bool,
    /// The start button is pressed.
    pub start: bool,
    /// Something forbids to enable.
    pub blocked: bool,
    /// Both axes have a calibration.
    pub calibrated: bool,
    /// A calibration is under way.
    pub calibrating: bool,
    /// The joints' zeros are known.
    pub referenced: bool,
    /// Where the drive stands; `None` before the servo runs.
    pub drive: Option<DriveState>,
}

/// What the operator asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// A step of the drive's power states.
    Power(PowerRequest),
    /// Measure both axes: the motors turn.
    Calibrate,
    /// Bridges off, no calibration.
    EndCalibration,
    /// The joints stand at their zero.
    Reference,
    /// Find the leg's parameters.
    Identify,
    /// Forget what blocks.
    Reset,
}

impl Ask {
    /// The word in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
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
            Self::Identify => "identify",
            Self::Reset => "reset",
        }
    }
}

/// A contact with its bounce taken off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Contact {
    closed: bool,
    /// Ticks for which it has differed from that.
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

/// What the contacts were; see the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Operator {
    enabling: Contact,
    start: Contact,
    /// Ticks for which both have been open; the start waits for some of them.
    open: u32,
    trusted: bool,
    /// The button was open since the switch is.
    ready: bool,
    /// Ticks for which the button has been pressed since then.
    pressed: u32,
    /// The way to enabled was begun by this closing of the switch, so many of its steps were asked.
    steps: u8,
}

impl Operator {
    /// The switch is held, was closed since it was seen open, and does not bounce.
    #[must_use]
    pub const fn holds(&self) -> bool {
        self.trusted && self.enabling.closed
    }

    /// One tick.
    pub fn tick(&mut self, now: &Situation) -> Option<Ask> {
        let before = (self.enabling.closed, self.start.closed);
        self.enabling.tick(now.enabling);
        self.start.tick(now.start);
        // Letting go counts at once.
        self.enabling.closed &= now.enabling;
        if !self.trusted {
            let open = !now.enabling && !now.start;
            self.open = if open { self.open + 1 } else { 0 };
            self.trusted = self.open >= STEADY_TICKS;
            // To stop is no matter of trust.
            return if now.enabling { None } else { stop(now) };
        }
        if !self.enabling.closed {
            self.steps = 0;
            return self.without_the_switch(now, before);
        }
        (self.ready, self.pressed) = (false, 0);
        let pressed = self.start.closed && !before.1;
        match now.drive {
            Some(DriveState::OperationEnabled) => return pressed.then_some(Ask::Identify),
            _ if pressed && !now.calibrated && !now.calibrating && !now.blocked => {
                return Some(Ask::Calibrate);
            }
            _ => {}
        }
        if now.blocked {
            // What forbids may go by itself: this closing has been answered all the same.
            self.steps = u8::MAX;
        }
        if now.blocked || !now.calibrated || !now.referenced {
            return None;
        }
        self.next_step(now.drive?)
    }

    /// Shutdown, switch on, enable: each once.
    fn next_step(&mut self, drive: DriveState) -> Option<Ask> {
        let (place, request) = match drive {
            DriveState::SwitchOnDisabled => (0, PowerRequest::Shutdown),
            DriveState::ReadyToSwitchOn => (1, PowerRequest::SwitchOn),
            DriveState::SwitchedOn => (2, PowerRequest::EnableOperation),
            _ => return None,
        };
        (self.steps == place).then(|| {
            self.steps += 1;
            Ask::Power(request)
        })
    }

    fn without_the_switch(&mut self, now: &Situation, before: (bool, bool)) -> Option<Ask> {
        if let Some(stop) = stop(now) {
            return Some(stop);
        }
        if self.start.closed {
            self.pressed = self.pressed.saturating_add(u32::from(self.ready));
            return (self.pressed == RESET_TICKS).then_some(Ask::Reset);
        }
        self.ready = true;
        let short = before.1 && self.pressed > 0 && self.pressed < RESET_TICKS;
        self.pressed = 0;
        (short && now.calibrated && !now.referenced).then_some(Ask::Reference)
    }
}

/// What an open switch asks for.
fn stop(now: &Situation) -> Option<Ask> {
    match now.drive {
        _ if now.calibrating => Some(Ask::EndCalibration),
        Some(DriveState::OperationEnabled) => Some(Ask::Power(PowerRequest::QuickStop)),
        Some(DriveState::ReadyToSwitchOn | DriveState::SwitchedOn) => {
            Some(Ask::Power(PowerRequest::DisableVoltage))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REST: Situation = Situation {
        enabling: false,
        start: false,
        blocked: false,
        calibrated: false,
        calibrating: false,
        referenced: false,
        drive: None,
    };
    const READY: Situation =
        Situation { calibrated: true, referenced: true, drive: Some(DriveState::SwitchOnDisabled), ..REST };

    /// What is asked within so many ticks of one situation.
    fn asked(operator: &mut Operator, now: Situation, ticks: u32) -> impl Iterator<Item = Ask> {
        let mut all = [None; 8];
        let mut count = 0;
        for _ in 0..ticks {
            if let Some(ask) = operator.tick(&now) {
                all[count] = Some(ask);
                count += 1;
            }
        }
        all.into_iter().flatten()
    }

    /// Trusted, with the switch held.
    fn holding() -> Operator {
        let mut operator = trusted();
        assert_eq!(asked(&mut operator, Situation { enabling: true, ..REST }, RATE_HZ).count(), 0);
        operator
    }

    fn trusted() -> Operator {
        let mut operator = Operator::default();
        assert_eq!(asked(&mut operator, REST, 2 * STEADY_TICKS).count(), 0);
        operator
    }

    #[test]
    fn a_contact_that_is_stuck_closed_at_the_start_asks_for_nothing() {
        for stuck in [Situation { enabling: true, ..READY }, Situation { start: true, ..READY }] {
            let mut operator = Operator::default();
            assert_eq!(asked(&mut operator, stuck, 10 * RESET_TICKS).count(), 0);
            // Once it has been open it counts.
            assert_eq!(asked(&mut operator, READY, 2 * STEADY_TICKS).count(), 0);
            let ask = asked(&mut operator, Situation { enabling: true, ..READY }, RATE_HZ).next();
            assert_eq!(ask, Some(Ask::Power(PowerRequest::Shutdown)));
        }
    }

    #[test]
    fn the_way_to_enabled_is_asked_step_by_step_and_once_for_each_closing() {
        let mut operator = trusted();
        let held = Situation { enabling: true, ..READY };
        let mut drive = DriveState::SwitchOnDisabled;
        let mut steps = 0;
        for _ in 0..RATE_HZ {
            if let Some(Ask::Power(request)) = operator.tick(&Situation { drive: Some(drive), ..held }) {
                drive = drive.after(crate::leg::DriveEvent::Asked(request), 1);
                steps += 1;
            }
        }
        assert_eq!((drive, steps), (DriveState::OperationEnabled, 3));
        // A fault that is reset while the switch is held does not enable again.
        assert_eq!(asked(&mut operator, held, RATE_HZ).count(), 0);
        // A drive that was refused is not asked again either, until the switch was open.
        let refused = Situation { drive: Some(DriveState::SwitchedOn), ..held };
        assert_eq!(asked(&mut operator, refused, RATE_HZ).count(), 0);
        let open = Situation { enabling: false, drive: Some(DriveState::SwitchOnDisabled), ..READY };
        assert_eq!(asked(&mut operator, open, STEADY_TICKS).count(), 0);
        assert_eq!(asked(&mut operator, held, RATE_HZ).next(), Some(Ask::Power(PowerRequest::Shutdown)));
    }

    #[test]
    fn letting_go_stops_in_the_same_tick_whatever_the_drive_does() {
        let cases = [
            (Some(DriveState::OperationEnabled), false, Ask::Power(PowerRequest::QuickStop)),
            (Some(DriveState::SwitchedOn), false, Ask::Power(PowerRequest::DisableVoltage)),
            (Some(DriveState::ReadyToSwitchOn), false, Ask::Power(PowerRequest::DisableVoltage)),
            (None, true, Ask::EndCalibration),
        ];
        for (drive, calibrating, expected) in cases {
            let mut operator = holding();
            let held = Situation { enabling: true, drive, calibrating, ..READY };
            assert_eq!(operator.tick(&Situation { enabling: false, ..held }), Some(expected));
        }
    }

    #[test]
    fn who_is_not_trusted_yet_can_still_stop() {
        let mut operator = Operator::default();
        let enabled =
            Situation { enabling: true, start: true, drive: Some(DriveState::OperationEnabled), ..READY };
        assert_eq!(asked(&mut operator, enabled, RATE_HZ).count(), 0);
        let stop = Some(Ask::Power(PowerRequest::QuickStop));
        assert_eq!(operator.tick(&Situation { enabling: false, ..enabled }), stop);
        assert!(!operator.holds());
    }

    #[test]
    fn a_closing_while_something_forbids_enables_nothing_once_it_is_gone() {
        let mut operator = trusted();
        let held = Situation { enabling: true, ..READY };
        assert_eq!(asked(&mut operator, Situation { blocked: true, ..held }, RATE_HZ).count(), 0);
        assert_eq!(asked(&mut operator, held, RATE_HZ).count(), 0);
        assert_eq!(asked(&mut operator, READY, STEADY_TICKS).count(), 0);
        assert_eq!(asked(&mut operator, held, RATE_HZ).next(), Some(Ask::Power(PowerRequest::Shutdown)));
    }

    #[test]
    fn nothing_moves_that_is_blocked_uncalibrated_or_without_reference() {
        let held = Situation { enabling: true, ..READY };
        for now in [
            Situation { blocked: true, ..held },
            Situation { calibrated: false, ..held },
            Situation { referenced: false, ..held },
            Situation { blocked: true, calibrated: false, start: true, ..held },
        ] {
            assert_eq!(asked(&mut trusted(), now, RATE_HZ).count(), 0, "{now:?}");
        }
    }

    #[test]
    fn the_button_asks_for_what_comes_next() {
        let with = |now: Situation| asked(&mut holding(), Situation { start: true, ..now }, RATE_HZ).next();
        assert_eq!(with(Situation { enabling: true, ..REST }), Some(Ask::Calibrate));
        let enabled = Situation { enabling: true, drive: Some(DriveState::OperationEnabled), ..READY };
        assert_eq!(with(enabled), Some(Ask::Identify));

        let mut operator = trusted();
        let stands = Situation { calibrated: true, ..REST };
        assert_eq!(asked(&mut operator, Situation { start: true, ..stands }, RATE_HZ / 2).count(), 0);
        assert_eq!(asked(&mut operator, stands, RATE_HZ).next(), Some(Ask::Reference));
        // Held for long it is a reset, and no reference when it is let go.
        assert!(asked(&mut operator, Situation { start: true, ..stands }, 2 * RESET_TICKS).eq([Ask::Reset]));
        assert_eq!(asked(&mut operator, stands, RATE_HZ).count(), 0);
    }

    #[test]
    fn a_button_that_is_welded_closed_asks_for_nothing_when_the_switch_opens() {
        let stands = Situation { calibrated: true, ..REST };
        for now in [REST, stands, READY, Situation { blocked: true, ..READY }] {
            let mut operator = holding();
            let welded = Situation { start: true, ..now };
            for _ in 0..3 {
                let held = Situation { enabling: true, blocked: true, ..welded };
                assert_eq!(asked(&mut operator, held, RATE_HZ).count(), 0);
                assert_eq!(asked(&mut operator, welded, 2 * RESET_TICKS).count(), 0, "{now:?}");
            }
            // Let go it asks for nothing either, and once it was open it counts again.
            assert_eq!(asked(&mut operator, now, RATE_HZ).count(), 0, "{now:?}");
            assert!(asked(&mut operator, welded, 2 * RESET_TICKS).eq([Ask::Reset]), "{now:?}");
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
