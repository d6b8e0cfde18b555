//! Torque of a whole motion including its approach and blends, computed before anything moves.
//!
//! Angle, speed and acceleration are proved from the coefficients (`scarab::motion`). Torque
//! depends on a leg that is not yet measured. It is computed for the assumed leg at **every** servo
//! tick of the commanded motion. All base parameters are off by the margin in the worst sense at
//! once. The approach may begin wherever the leg can hold its weight: it is computed from every such corner
//! of the range and from its middle, along the firmware's path.
//!
//! The firmware's monitor also reduces the torque of a joint that runs towards an end of its range
//! faster than it could stop (`scarab::safety::Barrier`). That would change the designed motion, so
//! no tick may be affected.
//!
//! Known limits: friction at rest and the position loop's torque at a reversal are not included;
//! the margin covers them too.

use scarab::leg::LegConfiguration;
use scarab::motion::{MotionState, Periodic, Ramp};
use scarab::servo::SERVO_RATE_HZ;

use crate::excite::obstacle::{Limit, Obstacle};
use crate::excite::score::{Cut, Scorer};

/// Torque of one joint, N m, model's sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Demand {
    /// Smallest torque of the assumed leg.
    pub(crate) low_nm: f64,
    /// Largest torque of the assumed leg.
    pub(crate) high_nm: f64,
    /// Largest magnitude with the margin.
    pub(crate) bound_nm: f64,
    /// Largest magnitude with the margin during the approach.
    pub(crate) approach_nm: f64,
    /// Largest torque, margin included, that would hold the weight in a corner of the range from which no
    /// approach begins, because it exceeds the limit; zero without such a corner.
    pub(crate) unheld_nm: f64,
    /// Largest reduction of torque by the monitor, margin included: it must be able to stop a joint
    /// before its range ends.
    pub(crate) cut: Cut,
}

impl Demand {
    /// Largest magnitude of motion and approach, N m.
    pub(crate) fn largest(&self) -> f64 {
        self.bound_nm.max(self.approach_nm)
    }

    /// The limit that is exceeded most, if any; `joint` counts from 0.
    pub(crate) fn obstacle(&self, joint: usize, limit_nm: f64) -> Option<Obstacle> {
        let torque = |limit: Limit, value: f64| Obstacle { joint, limit, value, allowed: limit_nm };
        let cut = Obstacle {
            joint,
            limit: Limit::Stop(self.cut.point),
            value: self.cut.wanted_nm,
            allowed: self.cut.granted_nm,
        };
        let torques = [torque(Limit::Torque, self.bound_nm), torque(Limit::Approach, self.approach_nm)];
        let exceeded = torques.into_iter().filter(|one| one.value > limit_nm);
        let worst = exceeded.max_by(|one, other| one.value.total_cmp(&other.value));
        worst.or_else(|| (self.cut.by_nm > 0.0).then_some(cut))
    }

    /// Whether the torque is below a limit, N m and never reduced by the monitor.
    pub(crate) fn is_within(&self, limit_nm: f64) -> bool {
        self.largest() <= limit_nm && self.cut.by_nm <= 0.0
    }
}

/// Torque at every tick of the motion, and on its approaches.
pub(crate) fn demand<const N: usize, const B: usize>(
    scorer: &Scorer<N, B>,
    configuration: &LegConfiguration<N, B>,
    motion: &Periodic<N>,
) -> [Demand; N] {
    let mut demand = [Demand { low_nm: f64::INFINITY, high_nm: f64::NEG_INFINITY, ..Demand::default() }; N];
    let period = motion.blend_ticks() + motion.period_ticks();
    // All cycles are alike; only the final blend differs.
    let leaving = motion.duration_ticks() - motion.blend_ticks();
    for tick in (0..=period).chain(leaving..=motion.duration_ticks()) {
        let state = motion.state_at(tick);
        for (joint, (torque, uncertainty)) in torques(scorer, &state).into_iter().enumerate() {
            let (position, velocity) = (state.position_rad[joint], state.velocity_rad_per_s[joint]);
            let cut = scorer.cut(joint, position, velocity, torque, uncertainty);
            if cut.by_nm > demand[joint].cut.by_nm {
                demand[joint].cut = cut;
            }
            demand[joint].low_nm = demand[joint].low_nm.min(torque);
            demand[joint].high_nm = demand[joint].high_nm.max(torque);
            demand[joint].bound_nm = demand[joint].bound_nm.max(torque.abs() + uncertainty);
        }
    }
    add_approaches(scorer, configuration, motion.state_at(0).position_rad, &mut demand);
    demand
}

/// Adds the torque of the approaches to a goal, from every corner of the range and from its middle.
fn add_approaches<const N: usize, const B: usize>(
    scorer: &Scorer<N, B>,
    configuration: &LegConfiguration<N, B>,
    goal: [f32; N],
    demand: &mut [Demand; N],
) {
    let (speed, acceleration) = configuration.approach();
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
        // A leg does not stand where it cannot hold its weight.
        let standing = torques(scorer, &at_rest(corner(from)));
        let mut holds = true;
        for (joint, (torque, uncertainty)) in standing.into_iter().enumerate() {
            let (needed, cap) =
                (torque.abs() + uncertainty, configuration.joints[joint].limits().torque_cap());
            if needed > f64::from(cap.0) {
                holds = false;
                demand[joint].unheld_nm = demand[joint].unheld_nm.max(needed);
            }
        }
        if !holds {
            continue;
        }
        let Ok(ramp) = Ramp::between(corner(from), goal, speed, acceleration, SERVO_RATE_HZ) else {
            continue;
        };
        for tick in (0..=ramp.duration_ticks()).step_by(APPROACH_STEP) {
            for (joint, (torque, uncertainty)) in
                torques(scorer, &ramp.state_at(tick)).into_iter().enumerate()
            {
                demand[joint].approach_nm = demand[joint].approach_nm.max(torque.abs() + uncertainty);
            }
        }
    }
}

fn at_rest<const N: usize>(position_rad: [f32; N]) -> MotionState<N> {
    MotionState { position_rad, velocity_rad_per_s: [0.0; N], acceleration_rad_per_s2: [0.0; N] }
}

/// Ticks between two instants of a ramp: a polynomial of at least a second, whose torque hardly
/// changes in 2 ms.
const APPROACH_STEP: usize = 8;

fn torques<const N: usize, const B: usize>(scorer: &Scorer<N, B>, state: &MotionState<N>) -> [(f64, f64); N] {
    scorer.rows(state).map(|row| scorer.torque(&row))
}
