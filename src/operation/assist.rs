//! Level 5: the law of the assistance, 500 Hz, triggered by the servo with every logged sample of a session.
//!
//! The level shares its priority with the bus: neither interrupts the other. Below the reception of frames,
//! because three of the shortest frames arrive within the time of one run.

use super::queues::AssistEnds;
use crate::leg::AssistLaw;

/// State between two runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AssistLevel<const N: usize> {
    law: AssistLaw<N>,
}

impl<const N: usize> AssistLevel<N> {
    /// Level without a session.
    pub const fn new() -> Self {
        Self { law: AssistLaw::new() }
    }

    /// Answers the samples that wait.
    #[inline(never)]
    pub fn run(&mut self, ends: &mut AssistEnds<'_, N>) {
        while let Some(session) = ends.sessions.dequeue() {
            self.law.begin(session);
        }
        // At most a queue's worth.
        for _ in 0..super::queues::SAMPLES {
            let Some(sample) = ends.samples.dequeue() else { return };
            if let Some(torque) = self.law.step(&sample) {
                // Full only while the servo does not tick, and then the session ends.
                let _ = ends.torques.enqueue(torque);
            }
        }
    }

    /// The law, with its energy observer and oscillators.
    pub const fn law(&self) -> &AssistLaw<N> {
        &self.law
    }
}
