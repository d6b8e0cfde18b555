//! Whole cycles of a periodic curve, with blends from and to rest.
//!
//! Why: a Fourier curve moves at every instant. A window on its amplitude would change its path. Instead the
//! speed of its phase is ramped: the joints follow the identical path, slower. Between the two blends the
//! phase runs at speed 1 for whole cycles, which identification uses ([`Periodic::is_steady`]).
//!
//! ```text
//! v(x) = 3 x^2 - 2 x^3                    speed of the phase, x = t / B in 0..=1, B the blend
//! turn(x) = (B / P) (x^3 - x^4/2 - 1/2)   arrives at turn 0 when the blend is over; P the period
//! |qd|  <= max |q'| w                     as in the steady part, since v <= 1
//! |qdd| <= max |q''| w^2 + max |q'| w 3/2 / B
//! ```
//!
//! The end mirrors the start in time: the motion starts at the curve's turn -B/2P and ends at +B/2P, two
//! different poses. Position, velocity and acceleration are continuous throughout; velocity and
//! acceleration are zero at both ends. Period and blend are rounded to whole ticks, so the phase is
//! exact after any number of cycles.
//! Cost: some 10 multiplications and one integer division beside the curve's evaluation.

use super::{Fourier, HARMONICS, JointEnvelope, MotionError, MotionState, whole_ticks};
use crate::units::{RadianPerSecondSquared, Second};
use core::num::NonZeroU32;

/// Phase of a motion on its curve, and the phase's speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// Phase in turns (periods); any number, most precise if small.
    pub(crate) turn: f32,
    /// Speed of the phase relative to the steady one, 0..=1.
    pub(crate) speed: f32,
    /// Change of `speed`, 1/s.
    pub(crate) speed_slope_per_s: f32,
}

impl Phase {
    /// Phase at full speed.
    pub const fn steady(turn: f32) -> Self {
        Self { turn, speed: 1.0, speed_slope_per_s: 0.0 }
    }
}

/// Cycles of a curve between two blends; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Periodic<const N: usize, const H: usize = HARMONICS> {
    curve: Fourier<N, H>,
    period_ticks: NonZeroU32,
    blend_ticks: u32,
    steady_end: u32,
    end: u32,
    turn_per_tick: f32,
    blend_turns: f32,
    per_blend_tick: f32,
    per_blend_second: f32,
}

impl<const N: usize, const H: usize> Periodic<N, H> {
    /// Builds a motion of `cycles` whole cycles at full speed with a blend before and after, at `rate_hz`
    /// ticks per second.
    pub fn new(curve: Fourier<N, H>, blend: Second, cycles: u32, rate_hz: u32) -> Result<Self, MotionError> {
        let period_ticks = whole_ticks(curve.period(), rate_hz).ok_or(MotionError::Period)?;
        if period_ticks.get() < 2 {
            return Err(MotionError::Period);
        }
        let blend_ticks = whole_ticks(blend, rate_hz).ok_or(MotionError::Blend)?.get();
        let (steady_end, end) = period_ticks
            .get()
            .checked_mul(cycles)
            .filter(|ticks| *ticks > 0)
            .and_then(|ticks| ticks.checked_add(blend_ticks))
            .and_then(|steady_end| Some((steady_end, steady_end.checked_add(blend_ticks)?)))
            .ok_or(MotionError::Cycles)?;
        let turn_per_tick = 1.0 / period_ticks.get() as f32;
        let per_blend_tick = 1.0 / blend_ticks as f32;
        Ok(Self {
            curve: curve.with_period(Second(period_ticks.get() as f32 / rate_hz as f32))?,
            period_ticks,
            blend_ticks,
            steady_end,
            end,
            turn_per_tick,
            blend_turns: blend_ticks as f32 * turn_per_tick,
            per_blend_tick,
            per_blend_second: per_blend_tick * rate_hz as f32,
        })
    }

    /// Curve with its period rounded to whole ticks.
    pub fn curve(&self) -> &Fourier<N, H> {
        &self.curve
    }

    /// Ticks of one cycle.
    pub fn period_ticks(&self) -> u32 {
        self.period_ticks.get()
    }

    /// Ticks of one blend; the steady cycles begin at this tick.
    pub fn blend_ticks(&self) -> u32 {
        self.blend_ticks
    }

    /// Ticks until the joints are at rest again.
    pub fn duration_ticks(&self) -> u32 {
        self.end
    }

    /// True if the phase runs at full speed at this tick.
    pub(crate) fn is_steady(&self, tick: u32) -> bool {
        tick >= self.blend_ticks && tick < self.steady_end
    }

    /// Phase `tick` ticks after the start; at rest before and after the motion.
    pub(crate) fn phase_at(&self, tick: u32) -> Phase {
        if self.is_steady(tick) {
            return Phase::steady(
                ((tick - self.blend_ticks) % self.period_ticks) as f32 * self.turn_per_tick,
            );
        }
        // The first blend counts ticks from the start, the last one back from the end.
        let (ticks_from_rest, sign) =
            if tick < self.blend_ticks { (tick, 1.0) } else { (self.end.saturating_sub(tick), -1.0) };
        let x = ticks_from_rest as f32 * self.per_blend_tick;
        Phase {
            turn: sign * self.blend_turns * (x * x * x * (1.0 - 0.5 * x) - 0.5),
            speed: x * x * (3.0 - 2.0 * x),
            speed_slope_per_s: sign * 6.0 * x * (1.0 - x) * self.per_blend_second,
        }
    }

    /// State `tick` ticks after the start; at rest before and after the motion.
    pub fn state_at(&self, tick: u32) -> MotionState<N> {
        self.curve.state_at(&self.phase_at(tick))
    }

    /// Proven bounds of the motion, including its blends.
    pub fn envelope(&self) -> [JointEnvelope; N] {
        self.curve.envelope().map(|mut joint| {
            joint.acceleration += RadianPerSecondSquared(joint.speed.0 * 1.5 * self.per_blend_second);
            joint
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::fourier::tests::{position_in_double, random_curve};
    use super::*;

    const RATE_HZ: u32 = 4000;

    fn motion() -> Periodic<2> {
        Periodic::new(random_curve(1), Second(1.5), 2, RATE_HZ).expect("positive times")
    }

    #[test]
    fn a_periodic_motion_rests_at_both_ends() {
        let motion = motion();
        for tick in [0, motion.duration_ticks(), motion.duration_ticks() + 1, u32::MAX] {
            let state = motion.state_at(tick);
            assert_eq!(state.velocity_rad_per_s, [0.0; 2], "tick {tick}");
            assert_eq!(state.acceleration_rad_per_s2, [0.0; 2], "tick {tick}");
        }
    }

    #[test]
    fn position_velocity_and_acceleration_are_continuous_and_belong_together() {
        let motion = motion();
        let dt = 1.0 / RATE_HZ as f32;
        let mut before = motion.state_at(0);
        let envelope = motion.envelope();
        for tick in 1..=motion.duration_ticks() {
            let state = motion.state_at(tick);
            for joint in 0..2 {
                let acceleration = |state: &MotionState<2>| state.acceleration_rad_per_s2[joint];
                let mean = 0.5 * (acceleration(&before) + acceleration(&state));
                let step = state.velocity_rad_per_s[joint] - before.velocity_rad_per_s[joint];
                // Trapezoid: dt^3/12 of the third derivative of velocity and single precision of 1 rad/s.
                assert!((step - mean * dt).abs() < 2e-6, "tick {tick}");
                // The jerk of blend and curve stays below 60 rad/s^3 here: 0.25 ms hide no jump.
                assert!((acceleration(&state) - acceleration(&before)).abs() < 60.0 * dt);
                let mean = 0.5 * (before.velocity_rad_per_s[joint] + state.velocity_rad_per_s[joint]);
                let step = state.position_rad[joint] - before.position_rad[joint];
                assert!((step - mean * dt).abs() < 2e-6, "tick {tick}");
                assert!(state.velocity_rad_per_s[joint].abs() <= envelope[joint].speed.0);
                assert!(acceleration(&state).abs() <= envelope[joint].acceleration.0);
            }
            before = state;
        }
    }

    #[test]
    fn the_bound_of_acceleration_covers_a_quick_blend_and_is_tight_there() {
        // A sine is fastest where the blend ends, and a blend of 0.2 s in a period of
        // 10 s outweighs its curvature.
        let sine = Fourier::<1, 1>::new(Second(10.0), [0.0], [[0.5]], [[0.0]]).expect("finite");
        let motion = Periodic::new(sine, Second(0.2), 1, RATE_HZ).expect("positive times");
        let states = (0..motion.duration_ticks()).map(|tick| motion.state_at(tick));
        let peak = states.map(|state| state.acceleration_rad_per_s2[0].abs()).fold(0.0, f32::max);
        let bound = motion.envelope()[0].acceleration.0;
        // The bound adds the curvature w^2 A (0.2) to the blend's 1.5 w A / 0.2 s (2.36).
        assert!(peak <= bound && peak > 0.9 * bound, "{peak} {bound}");
    }

    #[test]
    fn hours_of_cycles_do_not_move_the_phase() {
        let curve = random_curve(2).with_period(Second(6.5)).expect("positive");
        let cycles = 6 * 3600 * 2 / 13;
        let motion = Periodic::new(curve, Second(1.0), cycles, RATE_HZ).expect("12 h of ticks fit 32 bits");
        let early = motion.state_at(4000 + 777);
        let late = motion.state_at(4000 + 777 + (cycles - 1) * 26_000);
        assert_eq!(early, late);
        let exact = position_in_double(motion.curve(), 0, 777.0 / 26_000.0);
        // Single precision of a sum of 13 terms.
        assert!((f64::from(late.position_rad[0]) - exact).abs() < 1e-6);
    }

    #[test]
    fn the_steady_part_is_whole_cycles() {
        let motion = motion();
        let steady = (0..motion.duration_ticks()).filter(|tick| motion.is_steady(*tick)).count() as u32;
        assert_eq!(steady, 2 * motion.period_ticks());
        assert!(!motion.is_steady(0) && motion.is_steady(motion.blend_ticks()));
        for tick in 0..motion.duration_ticks() {
            assert!(!motion.is_steady(tick) || motion.phase_at(tick).speed == 1.0);
        }
    }

    #[test]
    fn absurd_times_are_refused() {
        let curve = random_curve(1);
        let make = |blend, cycles, rate| Periodic::new(curve, Second(blend), cycles, rate);
        assert_eq!(make(0.0, 1, RATE_HZ), Err(MotionError::Blend));
        assert_eq!(make(f32::NAN, 1, RATE_HZ), Err(MotionError::Blend));
        assert_eq!(make(1.0, 0, RATE_HZ), Err(MotionError::Cycles));
        assert_eq!(make(1.0, u32::MAX, RATE_HZ), Err(MotionError::Cycles));
        assert_eq!(make(1.0, 1, 0), Err(MotionError::Period));
        let endless = curve.with_period(Second(1e6)).expect("finite");
        assert_eq!(Periodic::new(endless, Second(1.0), 1, RATE_HZ), Err(MotionError::Period));
    }
}
