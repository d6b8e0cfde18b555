//! Assistance in the 4 kHz tick: interpolation between two torques of the law, friction, fading.
//!
//! ```text
//! tau = l (tau_law + S q'' + s_f friction(q') - b q') + (1 - l) (tau_0 - D q')
//! ```
//!
//! `l` moves between 0 and 1 within `FADE_S`. D is the damping of the position controller. tau_0 is the
//! torque that held the leg when the session began; while the session ends it moves to the torque that
//! carries the leg's weight, by at most a tenth of the cap in each sample time. At l = 0 the torque is that
//! of the controller without a position error: both ends are free of steps.
//!
//! S is the compensated mass matrix. A delay T of the compensated inertia acts as the negative damping
//! -S w^2 T, which makes a cuff's resonance grow. So the acceleration is that of this tick and led
//! ([`LedAcceleration`]): from the motion to the torque it takes 3 ms, of which the drive takes 1 ms.
//!
//! Torques of the law arrive every eighth tick, and each is reached on a ramp of eight ticks. One that fails
//! to come for `LATEST_TICKS` ends the session. Cost: some 20 operations for each joint.

use super::differentiator::LedAcceleration;
use super::law::AssistTorque;
use super::model::Assured;
use crate::listed::listed;
use crate::real::{clamp, is_finite};
use crate::servo::{SERVO_RATE_HZ, TICKS_PER_LOG};

/// Time in which assistance fades in or out, s.
pub(crate) const FADE_S: f32 = 1.0;
const FADE_PER_TICK: f32 = 1.0 / (FADE_S * SERVO_RATE_HZ as f32);
/// Ticks without a new torque after which the session ends: 10 ms.
pub(crate) const LATEST_TICKS: u32 = 40;
/// Largest change of torque from one sample to the next as a share of the cap.
const LARGEST_STEP: f32 = 0.1;

/// Largest change of the torque that holds the leg, from one tick to the next, as a share of the cap.
const HOLD_STEP: f32 = LARGEST_STEP / TICKS_PER_LOG as f32;

listed! {
    /// Reason why a session ends.
    pub enum AssistEnd {
        /// All reasons, in the order of the enum.
        ALL,
        /// Word used in records.
        name;
        /// The operator or a host asked for it.
        Requested, "requested";
        /// The energy budget is used up.
        Energy, "energy";
        /// A torque of the law is not finite.
        NotFinite, "not_finite";
        /// The law is silent.
        Late, "late";
        /// The model monitor reports a change.
        Changed, "changed";
    }
}

/// Torque of one tick, joint (D-H) sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AssistDemand<const N: usize> {
    /// Torque, N m.
    pub(crate) torque_nm: [f32; N],
    /// Share of the controller's damping that acts beside it, 0..1.
    pub(crate) damping_share: f32,
}

/// State of a session between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AssistTick<const N: usize> {
    share: f32,
    /// Number of the session.
    session: u32,
    /// Reason of a session that is ending.
    end: Option<AssistEnd>,
    friction_share: f32,
    assured: Assured<N>,
    cap_nm: [f32; N],
    /// Torque that holds the leg without the law.
    hold_nm: [f32; N],
    /// Ramp of the law's torque.
    torque_nm: [f32; N],
    slope_nm: [f32; N],
    support_nm: [f32; N],
    inertia: [[f32; N]; N],
    accelerations: [LedAcceleration; N],
    damping: f32,
    /// Ticks since the newest torque of the law; `None` before the first.
    age: Option<u32>,
    waited: u32,
}

impl<const N: usize> AssistTick<N> {
    /// Begins a session at rest at these angles (rad), with the torque that holds the leg (N m), a share of
    /// the friction and its bounds. `cap_nm` are the joints' torque caps.
    pub(crate) fn begin(
        number: u32,
        (friction_share, assured): (f32, Assured<N>),
        angles: [f32; N],
        hold_nm: [f32; N],
        cap_nm: [f32; N],
    ) -> Self {
        Self {
            share: 0.0,
            session: number,
            end: None,
            friction_share,
            assured,
            cap_nm,
            hold_nm,
            torque_nm: hold_nm,
            slope_nm: [0.0; N],
            support_nm: hold_nm,
            inertia: [[0.0; N]; N],
            accelerations: angles.map(LedAcceleration::at),
            damping: 0.0,
            age: None,
            waited: 0,
        }
    }

    /// Takes a torque of the law.
    pub(crate) fn receive(&mut self, torque: &AssistTorque<N>) {
        if torque.session != self.session {
            return;
        }
        if !torque.inertia.iter().flatten().copied().all(is_finite) || !is_finite(torque.damping) {
            return self.leave(AssistEnd::NotFinite);
        }
        for joint in 0..N {
            let wanted = torque.torque_nm[joint];
            if !is_finite(wanted) {
                return self.leave(AssistEnd::NotFinite);
            }
            let step = LARGEST_STEP * self.cap_nm[joint];
            let change = match self.age {
                Some(_) => clamp(wanted - self.torque_nm[joint], -step, step),
                // The share is zero at the first torque.
                None => {
                    self.torque_nm[joint] = wanted;
                    0.0
                }
            };
            self.slope_nm[joint] = change * (1.0 / TICKS_PER_LOG as f32);
        }
        (self.support_nm, self.damping, self.age) = (torque.support_nm, torque.damping, Some(0));
        self.inertia = torque.inertia;
        if torque.is_exhausted {
            self.leave(AssistEnd::Energy);
        }
    }

    /// Ends the session; the torque fades out. The first reason stays.
    pub(crate) fn leave(&mut self, why: AssistEnd) {
        self.end = self.end.or(Some(why));
    }

    /// Reason of a session that is ending.
    pub(crate) const fn end(&self) -> Option<AssistEnd> {
        self.end
    }

    /// Whether the session has faded out.
    pub(crate) fn has_ended(&self) -> bool {
        self.end.is_some() && !(self.share > 0.0)
    }

    /// Whether the whole assistance acts.
    pub(crate) fn is_complete(&self) -> bool {
        self.share >= 1.0
    }

    /// Runs one tick at these angles (rad) and velocities (rad/s).
    pub fn advance(&mut self, angles: &[f32; N], velocity: &[f32; N]) -> AssistDemand<N> {
        let mut acceleration = [0.0; N];
        for joint in 0..N {
            acceleration[joint] = self.accelerations[joint].push(angles[joint]);
        }
        self.waited = match self.age {
            Some(_) => 0,
            None => self.waited + 1,
        };
        if self.age.unwrap_or(self.waited) > LATEST_TICKS {
            self.leave(AssistEnd::Late);
        }
        let step = match (self.end.is_some(), self.age) {
            (true, _) => -FADE_PER_TICK,
            (false, Some(_)) => FADE_PER_TICK,
            (false, None) => 0.0,
        };
        self.share = clamp(self.share + step, 0.0, 1.0);
        let moves = self.age.is_some_and(|age| age < TICKS_PER_LOG);
        self.age = self.age.map(|age| age.saturating_add(1));
        let friction = self.assured.friction(velocity);
        let mut demand = AssistDemand { torque_nm: [0.0; N], damping_share: 1.0 - self.share };
        for joint in 0..N {
            if moves {
                self.torque_nm[joint] += self.slope_nm[joint];
            }
            let compensated = self.friction_share * friction[joint] - self.damping * velocity[joint];
            let mut law = self.torque_nm[joint] + compensated;
            for (inertia, acceleration) in self.inertia[joint].iter().zip(&acceleration) {
                law += inertia * acceleration;
            }
            if self.end.is_some() {
                let step = HOLD_STEP * self.cap_nm[joint];
                self.hold_nm[joint] += clamp(self.support_nm[joint] - self.hold_nm[joint], -step, step);
            }
            demand.torque_nm[joint] = self.share * law + (1.0 - self.share) * self.hold_nm[joint];
        }
        demand
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun(hold_nm: f32) -> AssistTick<2> {
        let assured = Assured { coulomb_nm: [4.0; 2], viscous: [3.0; 2], inertia_share: 1.0 };
        AssistTick::begin(7, (1.0, assured), [0.0; 2], [hold_nm; 2], [85.0; 2])
    }

    fn torque(torque_nm: f32) -> AssistTorque<2> {
        AssistTorque {
            session: 7,
            torque_nm: [torque_nm; 2],
            inertia: [[0.0; 2]; 2],
            support_nm: [5.0; 2],
            damping: 0.0,
            is_exhausted: false,
        }
    }

    /// Appends the torques of so many ticks at rest, with a law of `law` N m. Returns the last one.
    fn run(tick: &mut AssistTick<2>, ticks: u32, law: f32, torques: &mut Vec<f32>) -> f32 {
        torques.extend((0..ticks).map(|number| {
            if number % TICKS_PER_LOG == 0 {
                tick.receive(&torque(law));
            }
            tick.advance(&[0.0; 2], &[0.0; 2]).torque_nm[0]
        }));
        torques[torques.len() - 1]
    }

    /// Largest change from one tick to the next.
    fn largest_step(torques: &[f32]) -> f32 {
        torques.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn torque_moves_from_hold_to_law_and_back_without_a_step() {
        let (mut tick, mut torques) = (begun(20.0), vec![20.0]);
        assert!((run(&mut tick, 4001, -30.0, &mut torques) + 30.0).abs() < 1e-3);
        assert!(tick.is_complete());
        tick.leave(AssistEnd::Requested);
        assert!((run(&mut tick, 4001, -30.0, &mut torques) - 5.0).abs() < 1e-3);
        assert!(tick.has_ended());
        // 50 N m in a second.
        assert!(largest_step(&torques) < 0.025, "{}", largest_step(&torques));
    }

    #[test]
    fn leaving_early_moves_the_hold_torque_without_a_step() {
        let (mut tick, mut torques) = (begun(60.0), vec![60.0]);
        run(&mut tick, 400, 5.0, &mut torques);
        tick.leave(AssistEnd::Requested);
        assert!((run(&mut tick, 3600, 5.0, &mut torques) - 5.0).abs() < 1e-3 && tick.has_ended());
        // A tenth of the cap in eight ticks.
        assert!(largest_step(&torques) < 1.1, "{}", largest_step(&torques));
    }

    #[test]
    fn torques_of_another_session_are_ignored() {
        let mut tick = begun(20.0);
        for _ in 0..=LATEST_TICKS + 1 {
            tick.receive(&AssistTorque { session: 6, ..torque(80.0) });
            let _ = tick.advance(&[0.0; 2], &[0.0; 2]);
        }
        assert_eq!(tick.end(), Some(AssistEnd::Late));
    }

    #[test]
    fn a_jump_of_the_law_is_limited_to_a_tenth_of_the_cap_per_sample() {
        let mut tick = begun(0.0);
        run(&mut tick, 4800, 0.0, &mut Vec::new());
        tick.receive(&torque(80.0));
        let ramp: [f32; 8] = core::array::from_fn(|_| tick.advance(&[0.0; 2], &[0.0; 2]).torque_nm[0]);
        assert!((ramp[7] - 8.5).abs() < 1e-3 && (ramp[3] - 4.25).abs() < 1e-3, "{ramp:?}");
    }

    #[test]
    fn friction_fades_to_zero_at_rest() {
        let mut tick = begun(0.0);
        run(&mut tick, 4800, 0.0, &mut Vec::new());
        let found = [0.0, 0.025, 1.0, -1.0].map(|speed| tick.advance(&[0.0; 2], &[speed, 0.0]).torque_nm[0]);
        for (found, expected) in found.into_iter().zip([0.0, 2.075, 7.0, -7.0]) {
            assert!((found - expected).abs() < 1e-3, "{found} against {expected}");
        }
    }

    #[test]
    fn a_silent_or_broken_law_ends_the_session() {
        let mut silent = begun(0.0);
        for _ in 0..=LATEST_TICKS + 1 {
            let _ = silent.advance(&[0.0; 2], &[0.0; 2]);
        }
        assert_eq!(silent.end(), Some(AssistEnd::Late));
        let mut broken = begun(0.0);
        broken.receive(&torque(f32::NAN));
        assert_eq!(broken.end(), Some(AssistEnd::NotFinite));
        assert_eq!(broken.advance(&[0.0; 2], &[0.0; 2]).torque_nm, [0.0; 2]);
        let mut exhausted = begun(0.0);
        exhausted.receive(&AssistTorque { is_exhausted: true, ..torque(1.0) });
        assert_eq!(exhausted.end(), Some(AssistEnd::Energy));
    }
}
