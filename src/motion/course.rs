//! Course of one joint, tick by tick, towards a target that may change at any time.
//!
//! Why beside [`Motion`](super::Motion): a host that commands every tick gives no motion that could
//! be proven in advance. Each tick therefore extends the course from its present state, with
//! bounded speed and acceleration.
//!
//! ```text
//! to a position   v' = v moved towards +-min(speed, s(d), |d| / T), by at most acceleration T,
//!                 or deceleration T while slowing down
//!                 s(d) = sqrt((b/2)^2 + 2 deceleration |d|) - b/2,   b = deceleration T
//! to a velocity   v' = v moved towards the target likewise; near an end of the range at most s(its distance)
//! interpolated    v' = (target - q) / (n T), n ticks of the period left, at most speed
//! always          q' = q + T v'
//! ```
//!
//! Here `d` is the distance to the target, rad, and `T` a tick. The speed `s` is the largest from which whole
//! ticks of braking end at the target. A target that braking can reach is therefore overshot by at most one
//! tick of braking. The sum over the ticks is compensated (W. Kahan, "Further remarks on reducing truncation
//! errors", CACM 8, 1965): at 0.001 rad/s a tick moves by two units in the last place of 1 rad.
//!
//! Cost: a square root and some 20 operations; two square roots to a velocity.

use crate::real::{abs, clamp, max, min, sqrt};

/// Limits of a course's speed, rad/s, and acceleration, rad/s^2; all positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rates {
    /// Largest speed.
    pub(crate) speed: f32,
    /// Acceleration while speeding up.
    pub(crate) acceleration: f32,
    /// Acceleration while slowing down.
    pub(crate) deceleration: f32,
}

/// Commanded position and motion of one joint; rad and s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Course {
    position: f32,
    /// Rounding error of the sum over the ticks.
    lost: f32,
    velocity: f32,
    acceleration: f32,
}

impl Course {
    /// Course at rest.
    pub const fn at_rest(position: f32) -> Self {
        Self::moving(position, 0.0)
    }

    /// Course in motion.
    pub(crate) const fn moving(position: f32, velocity: f32) -> Self {
        Self { position, lost: 0.0, velocity, acceleration: 0.0 }
    }

    /// Joint angle, rad.
    pub(crate) const fn position(&self) -> f32 {
        self.position
    }

    /// Joint velocity, rad/s.
    pub(crate) const fn velocity(&self) -> f32 {
        self.velocity
    }

    /// Joint acceleration, rad/s^2.
    pub(crate) const fn acceleration(&self) -> f32 {
        self.acceleration
    }

    /// Sum of two courses.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        Self {
            position: self.position + other.position,
            lost: self.lost + other.lost,
            velocity: self.velocity + other.velocity,
            acceleration: self.acceleration + other.acceleration,
        }
    }

    /// Limits the position to at most `window` from `centre`.
    pub(crate) fn keep_within(&mut self, window: f32, centre: f32) {
        self.position = clamp(self.position, centre - window, centre + window);
    }

    /// Limits the position to a range.
    pub(crate) fn keep_between(&mut self, low: f32, high: f32) {
        self.position = clamp(self.position, low, high);
    }

    /// Moves one tick towards a position.
    pub(crate) fn approach(&mut self, target: f32, rates: &Rates, tick_s: f32) {
        // Near the target the lost part of the sum is as large as the last steps.
        let distance = (target - self.position) + self.lost;
        let size = abs(distance);
        // Within one tick of braking the course lands; whole ticks end up to that far beyond.
        let brake = rates.deceleration * tick_s;
        let speed = abs(self.velocity);
        if speed <= 1.001 * brake && size <= 1.2 * max(speed, brake) * tick_s {
            *self = Self::at_rest(target);
            return;
        }
        let speed = min(min(stopping_speed(size, rates, tick_s), rates.speed), size / tick_s);
        self.change(if distance < 0.0 { -speed } else { speed }, rates, tick_s);
    }

    /// Moves one tick towards a velocity; stops at the ends of a range.
    pub(crate) fn accelerate(&mut self, target: f32, rates: &Rates, range: [f32; 2], tick_s: f32) {
        let wanted = self.within(clamp(target, -rates.speed, rates.speed), rates, range, tick_s);
        self.change(wanted, rates, tick_s);
    }

    /// Moves one tick of the `left` ticks that lead to a position.
    pub(crate) fn interpolate_position(&mut self, target: f32, left: u32, speed: f32, tick_s: f32) {
        let before = self.velocity;
        let ticks = left.max(1) as f32;
        let velocity = clamp((target - self.position) / (ticks * tick_s), -speed, speed);
        // A constant velocity per period is a staircase; its acceleration is that of the whole period.
        self.acceleration =
            if velocity == before { self.acceleration } else { (velocity - before) / (ticks * tick_s) };
        if left == 0 {
            self.acceleration = 0.0;
        }
        self.advance(velocity, tick_s);
    }

    /// Moves one tick of the `left` ticks that lead to a velocity, with an acceleration of `most` at most;
    /// stops at the ends of a range by the rates.
    pub(crate) fn interpolate_velocity(
        &mut self,
        target: f32,
        left: u32,
        most: f32,
        rates: &Rates,
        range: [f32; 2],
        tick_s: f32,
    ) {
        let before = self.velocity;
        let next = before + (target - before) / left.max(1) as f32;
        let wanted = self.within(clamp(next, -rates.speed, rates.speed), rates, range, tick_s);
        let velocity = before + clamp(wanted - before, -most * tick_s, most * tick_s);
        self.acceleration = (velocity - before) / tick_s;
        self.advance(velocity, tick_s);
    }

    /// Limits a velocity so that the course can still stop in the range.
    fn within(&self, velocity: f32, rates: &Rates, [low, high]: [f32; 2], tick_s: f32) -> f32 {
        let up = stopping_speed(max(high - self.position, 0.0), rates, tick_s);
        let down = stopping_speed(max(self.position - low, 0.0), rates, tick_s);
        max(min(velocity, up), -down)
    }

    fn change(&mut self, wanted: f32, rates: &Rates, tick_s: f32) {
        let slows = abs(wanted) < abs(self.velocity) || wanted * self.velocity < 0.0;
        let most = tick_s * if slows { rates.deceleration } else { rates.acceleration };
        let change = clamp(wanted - self.velocity, -most, most);
        self.acceleration = change / tick_s;
        self.advance(self.velocity + change, tick_s);
    }

    fn advance(&mut self, velocity: f32, tick_s: f32) {
        self.velocity = velocity;
        let step = velocity * tick_s - self.lost;
        let next = self.position + step;
        self.lost = (next - self.position) - step;
        self.position = next;
    }
}

/// Speed `s` of the module's equations.
fn stopping_speed(distance: f32, rates: &Rates, tick_s: f32) -> f32 {
    let half = 0.5 * rates.deceleration * tick_s;
    sqrt(half * half + 2.0 * rates.deceleration * distance) - half
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f32 = 1.0 / 4000.0;
    const RATES: Rates = Rates { speed: 1.0, acceleration: 4.0, deceleration: 8.0 };

    #[test]
    fn a_trapezoid_takes_the_time_of_its_formula_and_overshoots_nothing() {
        for target in [0.7_f32, -0.7, 0.01, 3e-5, 2.5] {
            let mut course = Course::at_rest(0.0);
            let (mut ticks, mut fastest, mut farthest) = (0_u32, 0.0_f32, 0.0_f32);
            while course != Course::at_rest(target) {
                let before = course.velocity();
                course.approach(target, &RATES, TICK_S);
                let change = (course.velocity().abs() - before.abs()) / TICK_S;
                // The last step covers the remaining distance.
                let lands = course == Course::at_rest(target);
                assert!(lands || (-8.01..=4.001).contains(&change), "{change}");
                (ticks, fastest) = (ticks + 1, fastest.max(course.velocity().abs()));
                farthest = farthest.max((course.position() - target) * target.signum());
                assert!(ticks < 40_000);
            }
            // Up to v with 4, down with 8: d = v^2/8 + v^2/16, at most 1 rad/s.
            let distance = target.abs();
            let peak = sqrt(distance * 16.0 / 3.0).min(1.0);
            let time = peak / 4.0 + peak / 8.0 + (distance - peak * peak * 3.0 / 16.0).max(0.0) / peak;
            let error = (ticks as f32 * TICK_S - time).abs();
            assert!(error < 4.0 * TICK_S + 0.01 * time, "{target}: {ticks} {time}");
            assert!(fastest <= 1.0 && fastest > 0.9 * peak - 8.0 * TICK_S, "{fastest} {peak}");
            // One tick of braking: 8 T^2.
            assert!(farthest <= 6e-7, "{farthest}");
        }
    }

    #[test]
    fn a_target_that_moves_away_or_back_is_followed_without_a_step() {
        let mut course = Course::at_rest(0.0);
        let mut before = 0.0;
        for tick in 0..20_000 {
            let target = match tick {
                0..2000 => 1.0,
                2000..2500 => 0.1,
                _ => -0.4,
            };
            course.approach(target, &RATES, TICK_S);
            assert!((course.position() - before).abs() <= 1.0001 * TICK_S);
            before = course.position();
        }
        assert_eq!(course, Course::at_rest(-0.4));
    }

    #[test]
    fn a_velocity_is_reached_by_its_ramp_and_stops_at_the_end_of_the_range() {
        let mut course = Course::at_rest(0.0);
        for _ in 0..500 {
            course.accelerate(0.5, &RATES, [-1.0, 1.0], TICK_S);
        }
        // 0.5 / 4 = 0.125 s = 500 ticks; f32 adds 500 small steps.
        assert!((course.velocity() - 0.5).abs() < 1e-4 && (course.acceleration() - 4.0).abs() < 0.1);
        for _ in 0..20_000 {
            course.accelerate(0.5, &RATES, [-1.0, 1.0], TICK_S);
            assert!(course.position() <= 1.000_1);
        }
        assert!(course.velocity().abs() < 1e-3 && (course.position() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn slow_velocities_arrive_where_they_should() {
        let mut course = Course::moving(1.0, 0.001);
        for _ in 0..40_000 {
            course.accelerate(0.001, &RATES, [-2.0, 2.0], TICK_S);
        }
        // 10 s of 0.001 rad/s; without compensation 19 % are lost.
        assert!((course.position() - 1.01).abs() < 1e-6, "{}", course.position());
    }

    #[test]
    fn an_interpolated_position_is_met_at_the_end_of_each_period() {
        let mut course = Course::at_rest(0.0);
        for period in 1..100 {
            let target = 0.001 * period as f32;
            for left in (1..=8).rev() {
                course.interpolate_position(target, left, 3.0, TICK_S);
            }
            assert!((course.position() - target).abs() < 2e-7);
            assert!((course.velocity() - 0.5).abs() < 1e-3);
        }
        // A jump is followed at the largest speed, and all motion ends once the host is silent.
        for _ in 0..8 {
            course.interpolate_position(1.0, 0, 3.0, TICK_S);
        }
        assert!((course.velocity() - 3.0).abs() < 1e-6);
        for _ in 0..8000 {
            course.interpolate_position(1.0, 0, 3.0, TICK_S);
        }
        assert_eq!((course.position(), course.velocity(), course.acceleration()), (1.0, 0.0, 0.0));
    }

    #[test]
    fn an_interpolated_velocity_is_met_at_the_end_of_its_period() {
        let mut course = Course::at_rest(0.0);
        for left in (1..=8).rev() {
            course.interpolate_velocity(0.4, left, 250.0, &RATES, [-1.0, 1.0], TICK_S);
        }
        assert!((course.velocity() - 0.4).abs() < 1e-6 && (course.acceleration() - 200.0).abs() < 0.1);
        // A target that jumps farther is met later.
        for left in (0..16).rev() {
            course.interpolate_velocity(-0.4, left.max(8) - 8, 200.0, &RATES, [-1.0, 1.0], TICK_S);
            assert!(course.acceleration() >= -200.1);
        }
        assert!((course.velocity() + 0.4).abs() < 1e-6);
        // So is an end of the range that the host moves to the joint.
        course.interpolate_velocity(-0.4, 1, 200.0, &RATES, [course.position(), 1.0], TICK_S);
        assert!((course.velocity() + 0.35).abs() < 1e-6, "{}", course.velocity());
    }
}
