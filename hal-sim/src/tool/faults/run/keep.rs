//! Runs in which nothing is broken: somebody pushes, and the limits have to hold; noise, and nothing may come of it.

use scarab::safety::FaultCode;

use super::{Outcome, Watched};
use crate::faults::Injector;
use crate::tool::faults::rig::PERIOD_MS;

/// What zeros and gains of the shunts and the ripple leave at the cap: more than that is beyond it.
const BEYOND: f64 = 1.05;

impl<const B: usize> Watched<'_, B> {
    /// The limits are held to the end. Where the row has a deadline, the time is the longest in which a motor made more torque than its
    /// cap and a twentieth without a break.
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
        let known = alarm.is_none_or(|code| self.row.codes.contains(&code));
        let state = if damped { Some("Damp") } else { limited.then_some("Limit") };
        let timed = self.row.deadline_ms.is_finite() && state.is_some();
        let after_ms = timed.then_some(longest as f64 * PERIOD_MS);
        let in_time = after_ms.is_none_or(|after| after <= self.deadline_ms());
        let intermittent_ms = self.intermittent_ms();
        let broken = self.invariants.into_broken();
        Outcome {
            fault: self.row.id,
            seed: self.seed,
            period: self.begun,
            detected: state.is_some() && broken.is_empty() && known && in_time,
            // The limits were not come to.
            undetectable: state.is_none() && broken.is_empty(),
            false_alarm: !known,
            after_ms,
            intermittent_ms,
            state,
            alarm: alarm.map(FaultCode::name),
            magnitude: self.scenario.magnitude,
            broken,
            hash: format!("{:016x}", self.rig.hash),
            recording: self.recording,
        }
    }

    /// The machine goes on to the bit like its twin without the noise: there is nothing to see, and all else is a false alarm.
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
        Outcome {
            fault: self.row.id,
            seed: self.seed,
            period: self.begun,
            detected: false,
            undetectable: ignored,
            false_alarm: !ignored,
            after_ms: None,
            intermittent_ms: None,
            state: None,
            alarm: alarm.map(FaultCode::name),
            magnitude: self.scenario.magnitude,
            broken: self.invariants.into_broken(),
            hash: format!("{:016x}", self.rig.hash),
            recording: self.recording,
        }
    }

    /// Some motor makes more torque than its joint's cap.
    fn is_beyond_cap(&self) -> bool {
        let torque = self.rig.world.motor_torque();
        let limits = self.rig.leg.control().limits().joints();
        let beyond = |(torque, cap): (&f64, f32)| torque.abs() > BEYOND * f64::from(cap);
        self.rig.is_switching() && torque.iter().zip(limits.map(|joint| joint.torque_cap().0)).any(beyond)
    }
}
