//! Runs without a broken part: pushes, in which the limits must hold, and noise, which must have no effect.

use hal_sim::faults::Injector;

use crate::faults::run::{Outcome, Watched};
use crate::faulty_board::PERIOD_MS;

/// Factor of the cap from which a torque counts as above it: offsets and gains of the shunts, and ripple.
const BEYOND: f64 = 1.05;

impl<const B: usize> Watched<'_, B> {
    /// Runs a push to its end and checks the limits. In a row with a deadline, the time is the longest
    /// uninterrupted one in which a motor made more than 1.05 times its cap.
    pub(super) fn keep(mut self) -> Outcome {
        let limit = self.begun + self.scenario.patience;
        let (mut limited, mut damped) = (false, false);
        let (mut beyond, mut longest) = (0_u64, 0);
        while self.rig.period < limit {
            self.step();
            let output = self.rig.output.as_ref();
            limited |= output
                .is_some_and(|output| output.servo.decision.limited.iter().any(|limited| limited.any()));
            damped |= self.rig.alarm().is_some();
            beyond = if self.is_beyond_cap() { beyond + 1 } else { 0 };
            longest = longest.max(beyond);
        }
        let alarm = self.rig.alarm();
        let known = alarm.is_none_or(|code| self.row.fault.codes.contains(&code));
        let state = if damped { Some("Damp") } else { limited.then_some("Limit") };
        let timed = self.row.fault.deadline_ms.is_finite() && state.is_some();
        let after_ms = timed.then_some(longest as f64 * PERIOD_MS);
        let in_time = after_ms.is_none_or(|after| after <= self.deadline_ms());
        let intermittent_ms = self.intermittent_ms();
        let found = self.ended(alarm);
        let is_whole = found.broken.is_empty();
        Outcome {
            detected: state.is_some() && is_whole && known && in_time,
            // The limits were not reached.
            undetectable: state.is_none() && is_whole,
            false_alarm: !known,
            after_ms,
            intermittent_ms,
            state,
            ..found
        }
    }

    /// Runs noise and compares with an identical run without it, bit for bit. Any difference is a false
    /// alarm.
    pub(super) fn ignore(mut self) -> Outcome {
        let mut twin = self.rig.clone();
        twin.injector = Injector::new(self.seed);
        let limit = self.begun + self.scenario.patience;
        while self.rig.period < limit && !self.has_turned() {
            self.step();
            twin.advance();
        }
        let alarm = self.rig.alarm();
        let ignored = alarm.is_none() && self.rig.hash == twin.hash && self.rig.counts() == twin.counts();
        Outcome { undetectable: ignored, false_alarm: !ignored, ..self.ended(alarm) }
    }

    /// Returns whether a motor's torque is above its joint's cap.
    fn is_beyond_cap(&self) -> bool {
        let torque = self.rig.world.motor_torque();
        let limits = self.rig.leg.control().limits().joints();
        let beyond = |(torque, cap): (&f64, f32)| torque.abs() > BEYOND * f64::from(cap);
        self.rig.is_switching() && torque.iter().zip(limits.map(|joint| joint.torque_cap().0)).any(beyond)
    }
}
