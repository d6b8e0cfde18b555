//! Torque bounds that stop a joint before its range ends and keep it below its speed.
//!
//! The joint may approach an end of its range only as fast as it can still stop. The torque towards that end
//! is bounded by the value that brings it down to that speed:
//!
//! ```text
//! v(d) = sqrt((a T)^2 + 2 a d) - a T      d >= 0, distance to the end: speed from which a joint that brakes
//!                                         after T with deceleration a stops at the end
//! v(d) = d / T, at least -speed/4         d < 0: beyond the end, back inwards
//! torque <= D (min(v(d_high), speed) - qd),    torque >= -D (min(v(d_low), speed) + qd),    |torque| <= cap
//!
//! returning   a joint that was enabled beyond an end: v = 0 towards that end, 0.2 rad/s back, a quarter of
//!             the cap
//! ```
//!
//! `a` is the assumed deceleration, half of the torque cap over the inertia. `D` is 100/s times the inertia,
//! N m s/rad. `T` is 40 ms, four time constants of D, so the end itself is approached without overshoot
//! (double pole at 50/s). Gravity that pulls outwards with G moves a joint at rest G T / D beyond the end:
//! 0.2 degrees for 50 N m on the default hip. The stop holds while the true inertia is 0.5 to 1 times the
//! stated one, and the velocity estimate is late by at most about 5 ms.
//!
//! A motion is unaffected if its acceleration stays below a/2 and it ends a T^2 / 2 before the range does
//! (0.4 degrees on the default hip). Cost: two square roots, about 20 multiplications and comparisons per
//! joint.

use super::limits::JointLimits;
use crate::checksum::Checksum;
use crate::real::{max, min, sqrt};
use crate::units::{NewtonMetre, Radian, RadianPerSecond};

/// Damping per inertia, 1/s.
const DAMPING_PER_INERTIA: f32 = 100.0;
/// Time between the need to brake and braking, s.
const REACTION_S: f32 = 0.04;
/// Largest share of the speed limit at which a joint beyond its range is brought back.
const RETURN_SHARE: f32 = 0.25;
/// Commanded return speed of a joint that was enabled outside its range, rad/s.
pub(crate) const RETURN_SPEED: f32 = 0.1;
/// Share of the torque cap available to a returning joint.
pub(crate) const RETURN_TORQUE: f32 = 0.25;
/// Speed above which the returning joint is braked, rad/s: twice the commanded speed, so that torque remains
/// at that speed.
const RETURN_BOUND: f32 = 2.0 * RETURN_SPEED;

/// Limits that reduced the request for one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limited {
    /// The joint would not have stopped within its range.
    pub range: bool,
    /// The joint would have exceeded its speed limit.
    pub speed: bool,
    /// The torque or its current was above the cap.
    pub(crate) torque: bool,
    /// The torque exceeded the derated cap.
    pub(crate) derated: bool,
}

impl Limited {
    /// Returns whether any limit was active.
    pub const fn any(self) -> bool {
        self.range || self.speed || self.torque || self.derated
    }
}

/// The bounds of one joint; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Barrier {
    low_rad: f32,
    high_rad: f32,
    speed_rad_per_s: f32,
    damping_nm_s_per_rad: f32,
    twice_braking_rad_per_s2: f32,
    /// a T and its square.
    lead_rad_per_s: f32,
    lead_square: f32,
    cap_nm: f32,
    /// Derated cap: for a torque that drives the joint, and for one that the joint drives.
    left_nm: [f32; 2],
}

impl Barrier {
    /// Derives the bounds from a joint's limits.
    pub fn new(limits: &JointLimits) -> Self {
        let (braking, cap) = (limits.braking_acceleration().0, limits.torque_cap().0);
        let lead = braking * REACTION_S;
        Self {
            low_rad: limits.low.0,
            high_rad: limits.high.0,
            speed_rad_per_s: limits.speed.0,
            damping_nm_s_per_rad: DAMPING_PER_INERTIA * limits.inertia.0,
            twice_braking_rad_per_s2: 2.0 * braking,
            lead_rad_per_s: lead,
            lead_square: lead * lead,
            cap_nm: cap,
            left_nm: [cap; 2],
        }
    }

    /// Sets the derating: shares of the cap for a torque that drives the joint and for one that the joint
    /// drives.
    pub(crate) fn derate(&mut self, shares: [f32; 2]) {
        self.left_nm = shares.map(|share| share * self.cap_nm);
    }

    /// Limits the requested torque so that the joint can still stop within its range, and returns the active
    /// limits. A joint that `returns` is outside its range: no torque drives it farther out, and a reduced
    /// one drives it back.
    pub fn bound(
        &self,
        position: Radian,
        velocity: RadianPerSecond,
        wanted: NewtonMetre,
        returns: bool,
    ) -> (NewtonMetre, Limited) {
        let mut limited = Limited::default();
        let cap = if returns { RETURN_TORQUE * self.cap_nm } else { self.cap_nm };
        let [driving, driven] = self.left_nm;
        let left = if wanted.0 * velocity.0 < 0.0 { driven } else { driving };
        let mut torque = wanted.0;
        // Only the request is derated; the braking below keeps the whole cap.
        if wanted.abs().0 > min(left, cap) {
            torque = wanted.limited(NewtonMetre(min(left, cap))).0;
            limited.derated = left < cap;
            limited.torque = !limited.derated;
        }
        let approach_speed = |distance: f32| match returns {
            false => self.approach_speed(distance),
            true => (if distance > 0.0 { RETURN_BOUND } else { 0.0 }, true),
        };
        let (up, up_is_range) = approach_speed(self.high_rad - position.0);
        let highest = self.damping_nm_s_per_rad * (up - velocity.0);
        if torque > highest {
            torque = highest;
            (limited.range, limited.speed) = (up_is_range, !up_is_range);
        }
        let (down, down_is_range) = approach_speed(position.0 - self.low_rad);
        let lowest = -self.damping_nm_s_per_rad * (down + velocity.0);
        if torque < lowest {
            torque = lowest;
            (limited.range, limited.speed) = (down_is_range, !down_is_range);
        }
        (NewtonMetre(torque).limited(NewtonMetre(cap)), limited)
    }

    /// Whether a joint stops before a fault of its range: `margin` beyond its ends, at its present velocity.
    pub(crate) fn stops_in_range(&self, position: Radian, velocity: RadianPerSecond, margin: Radian) -> bool {
        let most = |end_is_at: f32| self.approach_speed(end_is_at + margin.0).0;
        velocity.0 <= most(self.high_rad - position.0) && -velocity.0 <= most(position.0 - self.low_rad)
    }

    /// Adds all values to a checksum, except those that derating changes.
    pub(crate) fn add_to(&self, sum: Checksum) -> Checksum {
        let Self { low_rad, high_rad, speed_rad_per_s, damping_nm_s_per_rad, .. } = *self;
        sum.numbers([low_rad, high_rad, speed_rad_per_s, damping_nm_s_per_rad]).numbers([
            self.twice_braking_rad_per_s2,
            self.lead_rad_per_s,
            self.lead_square,
            self.cap_nm,
        ])
    }

    /// The torque that opposes the joint's velocity, under the cap.
    pub(crate) fn damp(&self, velocity: RadianPerSecond) -> NewtonMetre {
        NewtonMetre(-self.damping_nm_s_per_rad * velocity.0).limited(NewtonMetre(self.cap_nm))
    }

    /// Largest speed towards an end at `distance`, and whether the range, not the speed limit, determines it.
    fn approach_speed(&self, distance: f32) -> (f32, bool) {
        let stopping = if distance > 0.0 {
            sqrt(self.lead_square + self.twice_braking_rad_per_s2 * distance) - self.lead_rad_per_s
        } else {
            max(distance * (1.0 / REACTION_S), -RETURN_SHARE * self.speed_rad_per_s)
        };
        (min(stopping, self.speed_rad_per_s), stopping < self.speed_rad_per_s)
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::tests::{HIP, KNEE};
    use super::*;
    use std::collections::VecDeque;

    /// An inertia with gravity, pushed by a requested torque through the barrier, with delayed velocity and
    /// delayed drive torque. Semi-implicit Euler at 16 kHz, double precision. Returns the largest excursion
    /// beyond either end (negative inside), the largest speed, and the largest speed in the last of four
    /// seconds.
    fn push(
        limits: &JointLimits,
        inertia: f64,
        gravity_nm: f64,
        wanted_nm: f32,
        start: (f64, f64),
    ) -> (f64, f64, f64) {
        // The joint stops with the full cap and with the derated one.
        let shares = if wanted_nm == 30.0 { [0.5, 0.0] } else { [1.0; 2] };
        let mut barrier = Barrier::new(limits);
        barrier.derate(shares);
        let (mut position, mut velocity) = start;
        let mut drive_torque = 0.0;
        // 3.25 ms of velocity delay.
        let mut sensed: VecDeque<f64> = [velocity; 14].into_iter().collect();
        let (mut excursion, mut fastest, mut late_fastest) = (f64::NEG_INFINITY, 0.0_f64, 0.0_f64);
        for tick in 0..16_000 {
            sensed.push_back(velocity);
            let late = sensed.pop_front().expect("fourteen values remain");
            let (angle, speed) = (Radian(position as f32), RadianPerSecond(late as f32));
            let (torque, _) = barrier.bound(angle, speed, NewtonMetre(wanted_nm), false);
            assert!(torque.abs() <= limits.torque_cap());
            for _ in 0..4 {
                let dt = 1.0 / 16_000.0;
                drive_torque += (f64::from(torque.0) - drive_torque) * dt / 0.001;
                velocity += (drive_torque + gravity_nm) / inertia * dt;
                position += velocity * dt;
            }
            excursion =
                excursion.max(position - f64::from(limits.high.0)).max(f64::from(limits.low.0) - position);
            fastest = fastest.max(velocity.abs());
            if tick >= 12_000 {
                late_fastest = late_fastest.max(velocity.abs());
            }
        }
        (excursion, fastest, late_fastest)
    }

    #[test]
    fn a_joint_pushed_beyond_its_range_stops_within_half_a_degree() {
        for limits in [HIP, KNEE] {
            let (low, high) = (f64::from(limits.low.0), f64::from(limits.high.0));
            let speed = f64::from(limits.speed.0);
            let deceleration = f64::from(limits.braking_acceleration().0);
            for inertia_share in [0.5, 0.75, 1.0] {
                let inertia = f64::from(limits.inertia.0) * inertia_share;
                for wanted in [1.0_f32, 30.0, 1e6] {
                    for gravity in [-40.0, 0.0, 40.0] {
                        for initial_speed in [0.0, 0.3 * speed, 0.7 * speed, speed] {
                            for sign in [-1.0, 1.0] {
                                // Starts where a joint at that speed can just stop.
                                let stopping = initial_speed * initial_speed / (2.0 * deceleration)
                                    + initial_speed * f64::from(REACTION_S);
                                let start = if sign > 0.0 { high - stopping } else { low + stopping };
                                if start < low || start > high {
                                    continue;
                                }
                                let start = (start, sign * initial_speed);
                                let (excursion, fastest, _) =
                                    push(&limits, inertia, gravity, wanted * sign as f32, start);
                                let case = [inertia, f64::from(wanted), gravity, initial_speed, sign];
                                let beyond = excursion.to_degrees();
                                assert!(beyond < 0.5, "{beyond} degrees beyond: {case:?}");
                                // The overspeed fault is at 1.1 times the limit, with gravity in either
                                // direction.
                                assert!(fastest < 1.1 * speed, "{fastest}");
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_joint_pressed_against_its_end_comes_to_rest_there() {
        for limits in [HIP, KNEE] {
            for inertia_share in [0.5, 0.75, 1.0] {
                let inertia = f64::from(limits.inertia.0) * inertia_share;
                let middle = 0.5 * f64::from(limits.low.0 + limits.high.0);
                let (excursion, _, late_fastest) = push(&limits, inertia, 0.0, 60.0, (middle, 0.0));
                // Without gravity the joint rests at the end itself, without bouncing or oscillation.
                assert!(excursion.abs() < 0.05_f64.to_radians(), "{excursion}");
                assert!(late_fastest < 1e-3, "{inertia_share}: {late_fastest} rad/s");
            }
        }
    }

    #[test]
    fn a_motion_that_keeps_its_distance_is_not_limited() {
        let barrier = Barrier::new(&HIP);
        let braking = HIP.braking_acceleration().0;
        let margin = 0.5 * braking * REACTION_S * REACTION_S;
        for step in 1..1000 {
            let speed = HIP.speed.0 * step as f32 / 1000.0;
            let distance = speed * speed / braking + margin;
            let torque = NewtonMetre(-0.5 * braking * HIP.inertia.0);
            let position = Radian(HIP.high.0 - distance);
            let (bounded, limited) = barrier.bound(position, RadianPerSecond(speed), torque, false);
            assert_eq!((bounded, limited), (torque, Limited::default()), "speed {speed}");
        }
    }

    #[test]
    fn torque_range_and_speed_limits_are_distinguished() {
        let barrier = Barrier::new(&HIP);
        let (middle, still) = (Radian(0.45), RadianPerSecond::ZERO);
        let (torque, limited) = barrier.bound(middle, still, NewtonMetre(500.0), false);
        assert_eq!((torque, limited), (NewtonMetre(100.0), Limited { torque: true, ..Limited::default() }));
        let (torque, limited) = barrier.bound(Radian(0.7), RadianPerSecond(2.5), NewtonMetre(10.0), false);
        assert!(torque.0 < 0.0 && limited.range, "{torque:?}");
        let wide = JointLimits { high: Radian(6.0), low: Radian(-6.0), ..HIP };
        let (torque, limited) =
            Barrier::new(&wide).bound(Radian::ZERO, RadianPerSecond(3.3), NewtonMetre(10.0), false);
        assert!(torque.0 < 0.0 && limited.speed && !limited.range, "{torque:?}");
    }

    #[test]
    fn only_a_torque_beyond_its_bound_is_limited() {
        let wide = JointLimits { high: Radian(6.0), low: Radian(-6.0), ..HIP };
        let barrier = Barrier::new(&wide);
        for sign in [1.0, -1.0] {
            let velocity = sign * (HIP.speed.0 - 0.125);
            let bound = sign * barrier.damping_nm_s_per_rad * (barrier.speed_rad_per_s - velocity.abs());
            assert!(bound.abs() < barrier.cap_nm, "{bound}");
            let at =
                |wanted| barrier.bound(Radian::ZERO, RadianPerSecond(velocity), NewtonMetre(wanted), false);
            assert_eq!(at(bound), (NewtonMetre(bound), Limited::default()));
            let (torque, limited) = at(bound * 1.001);
            assert_eq!((torque.0, limited), (bound, Limited { speed: true, ..Limited::default() }));
            // A request equal to the cap is not limited.
            let cap = NewtonMetre(sign * barrier.cap_nm);
            let (torque, limited) = barrier.bound(Radian::ZERO, RadianPerSecond::ZERO, cap, false);
            assert_eq!((torque, limited), (cap, Limited::default()));
        }
    }

    #[test]
    fn derating_reduces_the_request_and_not_the_braking() {
        let mut barrier = Barrier::new(&HIP);
        barrier.derate([0.5, 0.2]);
        let at = |velocity, wanted| {
            let (torque, limited) =
                barrier.bound(Radian(0.45), RadianPerSecond(velocity), NewtonMetre(wanted), false);
            (torque.0, limited.derated, limited.torque)
        };
        assert_eq!(at(0.0, 80.0), (50.0, true, false));
        assert_eq!(at(-0.1, 40.0), (20.0, true, false));
        assert_eq!(at(0.1, 40.0), (40.0, false, false));
        barrier.derate([0.0; 2]);
        let (torque, limited) = barrier.bound(Radian(0.87), RadianPerSecond(1.0), NewtonMetre(40.0), false);
        assert!(torque.0 < -90.0 && limited.range, "{torque:?}");
        assert!(barrier.damp(RadianPerSecond(-10.0)).0 > 90.0);
    }

    #[test]
    fn damping_opposes_velocity_under_the_cap() {
        let barrier = Barrier::new(&KNEE);
        assert_eq!(barrier.damp(RadianPerSecond(10.0)), NewtonMetre(-100.0));
        let gentle = barrier.damp(RadianPerSecond(-0.1)).0;
        assert!((gentle - 25.3).abs() < 1e-4, "{gentle}");
    }
}
