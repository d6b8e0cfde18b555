//! The wearer's muscles: learned feedforward, intrinsic impedance, delayed reflexes; or limp, or resisting.
//!
//! ```text
//! follow   T = clamp(F(a*, a*', a*'') + E_intrinsic(t) + E_reflex(t - delay))
//! resist   T = clamp(F(a_0, 0, 0)     + E_resisting(t) + E_reflex(t - delay)),    a* = a_0, the posture held
//! limp     T = 0
//! E(t)     = K (a*(t) - a(t)) + D (a*'(t) - a'(t))
//! ```
//!
//! a is the wearer's joint angle and a* the intended one. F is the inverse dynamics of the wearer's own body:
//! a person knows it and needs no feedback to move alone. F knows nothing of the exoskeleton, and the
//! impedance yields to it. The reflex is sampled every millisecond and reaches the muscle after the neural
//! delay, so no reflex opposes a disturbance earlier. Torques are constant during a servo tick. N m, rad, s.
//!
//! Sources: feedforward with impedance about an equilibrium trajectory after Hogan (1985) and Kawato (1999);
//! delays of 50-100 ms are those of long-latency and voluntary reactions of the leg.
//! Known limits: one torque per joint, no muscle across both, no activation dynamics besides the delay.

use super::body::Body;
use super::description::{Impedance, MuscleDescription, WearerDescription};
use super::motion::{Intended, IntendedCourse, IntendedMotion};
use super::plane::Pair;
use crate::maths::nearest;

/// Longest neural delay, s.
pub(crate) const LONGEST_DELAY_S: f64 = 0.1;

/// Servo ticks per sample of the reflexes: 1 ms.
const TICKS_PER_SAMPLE: u64 = 4;
/// Samples within the longest delay.
const LONGEST_DELAY: usize = 100;

/// What a wearer wants to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intention {
    /// No muscle acts.
    Limp,
    /// Hold the present posture.
    Resist,
    /// Follow a motion, which begins at the present posture.
    Follow(IntendedMotion),
}

/// Values on their way through the nerves.
#[derive(Clone, Debug, PartialEq)]
struct DelayLine {
    values: [Pair; LONGEST_DELAY],
    length: usize,
    next: usize,
}

impl DelayLine {
    fn new(samples: usize) -> Self {
        Self { values: [[0.0; 2]; LONGEST_DELAY], length: samples.min(LONGEST_DELAY), next: 0 }
    }

    /// Takes the newest value and returns that of `length` calls before.
    fn pass(&mut self, newest: Pair) -> Pair {
        if self.length == 0 {
            return newest;
        }
        let oldest = core::mem::replace(&mut self.values[self.next], newest);
        self.next = (self.next + 1) % self.length;
        oldest
    }
}

/// Present activity.
#[derive(Clone, Debug, PartialEq)]
enum MuscleActivity {
    Limp,
    Resist(Pair),
    Follow(IntendedCourse),
}

/// Muscles of hip and knee with their nerves.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Muscles {
    described: [MuscleDescription; 2],
    activity: MuscleActivity,
    nerves: DelayLine,
    /// Reflex torque that has arrived, N m.
    reflex: Pair,
    intended: Option<Intended>,
    torque: Pair,
}

impl Muscles {
    /// Limp muscles.
    pub(super) fn new(wearer: &WearerDescription) -> Self {
        let samples = usize::try_from(nearest(wearer.neural_delay * 1e3)).unwrap_or(0);
        Self {
            described: wearer.muscles,
            activity: MuscleActivity::Limp,
            nerves: DelayLine::new(samples),
            reflex: [0.0; 2],
            intended: None,
            torque: [0.0; 2],
        }
    }

    /// Begins an intention at a posture (rad) and time (s).
    pub(super) fn intend(&mut self, intention: Intention, posture: Pair, now: f64) {
        self.activity = match intention {
            Intention::Limp => MuscleActivity::Limp,
            Intention::Resist => MuscleActivity::Resist(posture),
            Intention::Follow(motion) => MuscleActivity::Follow(IntendedCourse::begin(motion, posture, now)),
        };
    }

    /// Begins the present intention again at another posture, without signals in the nerves.
    pub(super) fn restart(&mut self, posture: Pair, now: f64) {
        self.nerves = DelayLine::new(self.nerves.length);
        (self.reflex, self.torque) = ([0.0; 2], [0.0; 2]);
        match &mut self.activity {
            MuscleActivity::Limp => {}
            MuscleActivity::Resist(held) => *held = posture,
            MuscleActivity::Follow(course) => *course = course.restarted(posture, now),
        }
    }

    /// Torque of the present servo tick, N m.
    pub(super) fn torque(&self) -> Pair {
        self.torque
    }

    /// Intended motion of the present servo tick; `None` while limp.
    pub(super) fn intended(&self) -> Option<Intended> {
        self.intended
    }

    /// Decides the torque of a servo tick that begins at a time (s), with the limb at these joint angles and
    /// rates.
    pub(super) fn decide(&mut self, body: &Body, tick: u64, time: f64, position: Pair, velocity: Pair) {
        let is_resisting = matches!(self.activity, MuscleActivity::Resist(_));
        self.intended = match &mut self.activity {
            MuscleActivity::Limp => None,
            MuscleActivity::Resist(held) => Some(Intended { position: *held, ..Intended::default() }),
            MuscleActivity::Follow(course) => Some(course.at(time)),
        };
        let error = |impedance: fn(&MuscleDescription) -> Impedance| -> Pair {
            self.intended.map_or([0.0; 2], |intended| {
                [0, 1].map(|joint| {
                    let Impedance { stiffness, damping } = impedance(&self.described[joint]);
                    stiffness * (intended.position[joint] - position[joint])
                        + damping * (intended.velocity[joint] - velocity[joint])
                })
            })
        };
        let intrinsic = error(|muscle| muscle.intrinsic);
        let (resisting, reflex) = (error(|muscle| muscle.resisting), error(|muscle| muscle.reflex));
        if tick.is_multiple_of(TICKS_PER_SAMPLE) {
            self.reflex = self.nerves.pass(reflex);
        }
        self.torque = self.intended.map_or([0.0; 2], |intended| {
            let Intended { position, velocity, acceleration } = intended;
            let learned = body.inverse_dynamics(position, velocity, acceleration);
            let direct = if is_resisting { resisting } else { intrinsic };
            [0, 1].map(|joint| {
                let limit = self.described[joint].torque_limit;
                (learned[joint] + direct[joint] + self.reflex[joint]).clamp(-limit, limit)
            })
        });
    }
}
