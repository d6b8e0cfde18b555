//! The torque a whole motion takes, the way to it and its blends included, before anything moves.
//!
//! Angle, speed and acceleration are proved from the coefficients (`scarab::motion`). Torque depends on a leg nobody
//! has measured, so it is reckoned for the assumed leg at **every** servo tick of the commanded motion, with each base
//! parameter off by the margin in the worst sense at once. The way there may begin anywhere: it is reckoned from every
//! corner of the range and from its middle, as the firmware would go it. The firmware's monitor also takes torque from a
//! joint that runs towards an end of its range faster than it could stop (`scarab::safety::Barrier`): a motion it
//! touches is not the motion that was designed, so it must not touch any tick.
//!
//! Known limits: friction at rest and what the position loop adds at a reversal are not in it; the margin is for them
//! too.

use scarab::leg::LegConfiguration;
use scarab::motion::{MotionState, Periodic, Ramp};
use scarab::servo::SERVO_RATE_HZ;

use super::score::Scorer;

/// What one joint's torque comes to, N m, model's sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// Smallest of the assumed leg.
    pub low_nm: f64,
    /// Largest of the assumed leg.
    pub high_nm: f64,
    /// Largest magnitude with the margin.
    pub bound_nm: f64,
    /// Largest magnitude with the margin on the way there.
    pub approach_nm: f64,
    /// Largest torque that the monitor would take from the motion, margin included: it must be able to stop a joint
    /// before its range ends.
    pub cut_nm: f64,
}

impl Demand {
    /// The most of all, N m.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.bound_nm.max(self.approach_nm)
    }

    /// Below a limit, N m, and left alone by the monitor.
    #[must_use]
    pub fn is_within(&self, limit_nm: f64) -> bool {
        self.largest() <= limit_nm && self.cut_nm <= 0.0
    }
}

/// Every tick of the motion, and the ways to it.
#[must_use]
pub fn demand<const N: usize, const B: usize>(
    scorer: &Scorer<N, B>,
    configuration: &LegConfiguration<N, B>,
    motion: &Periodic<N>,
) -> [Demand; N] {
    let mut demand = [Demand { low_nm: f64::INFINITY, high_nm: f64::NEG_INFINITY, ..Demand::default() }; N];
    let period = motion.blend_ticks() + motion.period_ticks();
    // One cycle is like the others; then the blend that leaves.
    let leaving = motion.duration_ticks() - motion.blend_ticks();
    for tick in (0..=period).chain(leaving..=motion.duration_ticks()) {
        let state = motion.state_at(tick);
        for (joint, (torque, doubt)) in torques(scorer, &state).into_iter().enumerate() {
            let (position, velocity) = (state.position_rad[joint], state.velocity_rad_per_s[joint]);
            demand[joint].cut_nm =
                demand[joint].cut_nm.max(scorer.cut(joint, position, velocity, torque, doubt));
            demand[joint].low_nm = demand[joint].low_nm.min(torque);
            demand[joint].high_nm = demand[joint].high_nm.max(torque);
            demand[joint].bound_nm = demand[joint].bound_nm.max(torque.abs() + doubt);
        }
    }
    let (speed, acceleration) = configuration.approach();
    let goal = motion.state_at(0).position_rad;
    let corner = |which: u32| -> [f32; N] {
        core::array::from_fn(|joint| {
            let limits = &configuration.joints[joint];
            match which {
                0 => 0.5 * (limits.low.0 + limits.high.0),
                bits if (bits - 1) >> joint & 1 == 1 => limits.high.0,
                _ => limits.low.0,
            }
        })
    };
    for from in 0..=1 << N {
        let Ok(ramp) = Ramp::between(corner(from), goal, speed, acceleration, SERVO_RATE_HZ) else {
            continue;
        };
        for tick in (0..=ramp.duration_ticks()).step_by(APPROACH_STEP) {
            for (joint, (torque, doubt)) in torques(scorer, &ramp.state_at(tick)).into_iter().enumerate() {
                demand[joint].approach_nm = demand[joint].approach_nm.max(torque.abs() + doubt);
            }
        }
    }
    demand
}

/// A ramp is a polynomial of a second and more: its torque hardly changes in 2 ms.
const APPROACH_STEP: usize = 8;

fn torques<const N: usize, const B: usize>(scorer: &Scorer<N, B>, state: &MotionState<N>) -> [(f64, f64); N] {
    scorer
        .rows(
            state.position_rad.map(f64::from),
            state.velocity_rad_per_s.map(f64::from),
            state.acceleration_rad_per_s2.map(f64::from),
        )
        .map(|row| scorer.torque(&row))
}
