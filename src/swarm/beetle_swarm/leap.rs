//! Leap of a stuck swarm: long whiskers read the slope of the cost's envelope, and all beetles follow it.
//!
//! Why: a converged swarm sits in one of many minima, and a scattered swarm falls into another one. From the
//! bottom of a ripple, ripples look alike to both sides. They cancel in f_r - f_l for whiskers of any length
//! and direction, and the slope of the envelope remains. They do not cancel in the whiskers' curvature. The
//! curvature of the envelope is that of its slopes at two standstills.
//!
//! One round:
//!   x_i  = G for all beetles; room_k = min(G_k, 1 - G_k), at least 0.002
//!   A    = diag(room): whiskers along random z_j, L / max_k |z_jk| long with L uniform in 0.3..0.8, end
//!          inside the box
//!   g    = sum_j g_j w_j; 0 along a coordinate with less room, whose whiskers are clipped
//!   H    = dx.dg / dx.dx between this standstill and the last one; half of the last H if the leap led back;
//!          if there is none, or it is negative, the least positive curvature of the whiskers
//!   x_i  = G - g / H, at most `step_limit` per coordinate, and up to 2 % of the box at random
//! No beetle retreats; personal bests restart where the beetles land; the whiskers are as long as the landing
//! is wide; all other learned values are discarded. A leap succeeds if the next standstill is better by 1e-3
//! of the difference to the first one. After more than `leaps` failures in a row the swarm is scattered.
//!
//! Source: own experiments; H is that of Barzilai, Borwein (1988), on slopes without ripples; hopping between
//! minima is from Wales, Doye (1997), the coarse scale from homotopy methods.
//! Cost: nothing until progress has stopped, then 2 min(N, D) + N evaluations: all beetles leap.
//! Known limits: one curvature for all directions; with D > N the slope is known along N directions. Ripples
//! that are not symmetric about their minima do not cancel.

use crate::real::{Real, abs, clamp, dot, max, min};

use super::super::particles::Particles;
use super::super::random::Random;
use super::super::rows::add_scaled;
use super::adaptive::AdaptiveRules;
use super::frame::Frame;

/// Shortest whisker of a leap and the range above it, share of the room to the walls.
const LEAP_WHISKER: f64 = 0.3;
const LEAP_WHISKER_RANGE: f64 = 0.5;
/// Least room to a wall, box coordinates.
const LEAST_ROOM: f64 = 0.002;
/// Random landing distance of a beetle from its target, box coordinates.
const LEAP_SPREAD: f64 = 0.02;
/// Least improvement of a standstill for a successful leap, share of that since the first standstill, and
/// roundings of the value.
const LEAP_PROGRESS: f64 = 1e-3;
const LEAP_ROUNDINGS: f64 = 8.0;
/// Least progress of the best value after a leap, share of the difference to the first standstill.
const PROGRESS: f64 = 1e-4;
/// Distance within which a leap led back, box coordinates, and curvature after it over that before.
const LED_BACK: f64 = 0.01;
const LONGER_LEAP: f64 = 0.5;

/// State of the leaps.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Leap<T, const D: usize> {
    /// True while the current round is a leap.
    pub(crate) under_way: bool,
    /// First and best standstill since the swarm was scattered.
    first: T,
    best: T,
    /// Failed leaps in a row.
    in_vain: u32,
    /// Place and slope of the last standstill, box coordinates, and curvature there; 0 before the first leap.
    from: [T; D],
    slope: [T; D],
    curvature: T,
    /// Step of the current leap, box coordinates.
    step: [T; D],
}

impl<T: Real, const D: usize> Leap<T, D> {
    pub(crate) fn none() -> Self {
        let zeros = [T::zero(); D];
        Self {
            under_way: false,
            first: T::LARGEST,
            best: T::LARGEST,
            in_vain: 0,
            from: zeros,
            slope: zeros,
            curvature: T::zero(),
            step: zeros,
        }
    }

    /// Least improvement of the best value that counts as progress; more after a first standstill.
    pub(super) fn least_progress(&self, best: T) -> T {
        let rounding = T::EPSILON * abs(best);
        if self.best == T::LARGEST {
            rounding
        } else {
            max(rounding, T::from_double(PROGRESS) * abs(self.first - best))
        }
    }

    /// Moves a beetle from the standstill to the landing place.
    pub(super) fn to(&self, position: &mut [T], random: &mut Random) {
        for (entry, &step) in position.iter_mut().zip(&self.step) {
            *entry = clamp(
                *entry + step + T::from_double(LEAP_SPREAD) * random.signed::<T>(),
                T::zero(),
                T::one(),
            );
        }
    }
}

/// Whisker length of a leap, share of the room to the walls.
pub(super) fn leap_whisker<T: Real>(random: &mut Random) -> T {
    T::from_double(LEAP_WHISKER) + T::from_double(LEAP_WHISKER_RANGE) * random.uniform()
}

impl<T: Real, const N: usize, const D: usize> AdaptiveRules<T, N, D> {
    /// Decides at a standstill with this best value: true for a leap, else the leaps are forgotten.
    pub(super) fn leaps_from(&mut self, best: T) -> bool {
        let leap = &mut self.leap;
        let is_first = leap.best == T::LARGEST;
        leap.first = if is_first { best } else { leap.first };
        let least = T::from_double(LEAP_PROGRESS) * (leap.first - best)
            + T::from_double(LEAP_ROUNDINGS) * T::EPSILON * abs(best);
        leap.in_vain = if is_first || leap.best - best > least { 0 } else { leap.in_vain + 1 };
        leap.best = min(best, leap.best);
        leap.under_way = best < T::LARGEST && leap.in_vain <= self.settings.leaps && self.settings.leaps > 0;
        if !leap.under_way {
            *leap = Leap::none();
        }
        self.leap.under_way
    }

    /// Brings all beetles to the best one, and scales the metric to the room around it.
    pub(super) fn gather(&mut self, beetles: &mut Particles<T, N, D>) {
        let leader = beetles.leader().min(N - 1);
        let (best, value) = (beetles.personal_best[leader], beetles.personal_best_value[leader]);
        beetles.position = [best; N];
        beetles.velocity = [[T::zero(); D]; N];
        beetles.value = [value; N];
        self.metric.scale(&best.map(room));
    }

    /// Computes the step of a leap from the slope at a standstill.
    pub(super) fn aim_leap(&mut self, at: &[T; D]) {
        let mut slope = self.gradient.unwrap_or([T::zero(); D]);
        for (slope, &at) in slope.iter_mut().zip(at) {
            // A whisker across a wall is clipped.
            if room(at) <= T::from_double(LEAST_ROOM) {
                *slope = T::zero();
            }
        }
        let mut moved = *at;
        add_scaled(&mut moved, -T::one(), &self.leap.from);
        let mut change = slope;
        add_scaled(&mut change, -T::one(), &self.leap.slope);
        let (square, product) = (dot(&moved, &moved), dot(&moved, &change));
        let leap = &mut self.leap;
        leap.curvature = if leap.curvature > T::zero() && square < T::from_double(LED_BACK * LED_BACK) {
            T::from_double(LONGER_LEAP) * leap.curvature
        } else if leap.curvature > T::zero() && product > T::zero() {
            product / square
        } else {
            least_curvature(&self.frame)
        };
        (leap.from, leap.slope) = (*at, slope);
        let longest = self.settings.step_limit;
        leap.step = slope.map(|slope| {
            if leap.curvature > T::zero() {
                clamp(-slope / leap.curvature, -longest, longest)
            } else {
                T::zero()
            }
        });
    }

    /// Ends a leap: the landing positions replace everything that the beetles learned.
    pub(super) fn land(&mut self, beetles: &mut Particles<T, N, D>, found: &[T]) {
        self.forget();
        self.whisker = T::from_double(LEAP_SPREAD);
        self.leap.under_way = false;
        beetles.personal_best = beetles.position;
        beetles.personal_best_value = [T::LARGEST; N];
        for (beetle, &value) in found.iter().enumerate() {
            beetles.record(beetle, value);
        }
    }
}

/// Distance to the nearer wall, box coordinates; at least [`LEAST_ROOM`].
fn room<T: Real>(at: T) -> T {
    max(min(at, T::one() - at), T::from_double(LEAST_ROOM))
}

/// Least positive curvature of the cost along the whiskers, box coordinates: ripples add to it. 0 if none is.
fn least_curvature<T: Real, const N: usize, const D: usize>(frame: &Frame<T, N, D>) -> T {
    let mut least = T::zero();
    for whisker in frame.whisker.iter().take(frame.count()) {
        let Some(reading) = whisker.reading else { continue };
        let curvature = reading.curvature / (whisker.box_length * whisker.box_length);
        if curvature > T::zero() && (curvature < least || least == T::zero()) {
            least = curvature;
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::super::rules::{Rules as _, Side};
    use super::super::settings::AdaptiveSettings;
    use super::*;
    use crate::real::sin_cos;

    const N: usize = 4;
    const D: usize = 3;
    type Rules = AdaptiveRules<f64, N, D>;

    #[test]
    fn so_many_leaps_in_vain_are_made_and_no_more_until_one_led_somewhere() {
        let settings = AdaptiveSettings { leaps: 2, ..AdaptiveSettings::default() };
        // A constant that is added to the cost changes nothing.
        for constant in [0.0, 1e6, -1e6] {
            let mut rules = Rules::new(settings, D);
            let standstills = [10.0, 10.0, 9.0, 9.0, 8.9995, 9.5];
            let leaps = standstills.map(|best| rules.leaps_from(constant + best));
            // 10.0 fails once, 9.0 succeeds, then two failures; the third one ends the leaps.
            assert_eq!(leaps, [true, true, true, true, true, false]);
            assert!(rules.leaps_from(constant + 9.5), "scattered: counted from zero again");
        }
        let mut never = Rules::new(AdaptiveSettings { leaps: 0, ..settings }, D);
        assert!(!never.leaps_from(10.0));
    }

    #[test]
    fn whoever_has_landed_knows_only_where_it_is() {
        let mut rules = Rules::new(AdaptiveSettings::default(), D);
        let mut random = Random::new(2);
        let mut beetles = Particles::<f64, N, D>::new(D);
        beetles.scatter(&mut random);
        for beetle in 0..N {
            beetles.record(beetle, 1.0);
        }
        beetles.position[2] = [0.25, 1.5, 0.5];
        rules.leap.under_way = true;
        rules.land(&mut beetles, &[3.0, 4.0, 5.0, 6.0]);
        assert_eq!(beetles.personal_best_value, [3.0, 4.0, 5.0, 6.0]);
        assert_eq!(beetles.personal_best[2], [0.25, 1.0, 0.5], "inside the box");
        assert!(!rules.leap.under_way && rules.gradient.is_none());
    }

    /// Bowl around 0.7, 0.4, 0.5 with deep ripples, ten to the box.
    fn rippled(point: &[f64; D]) -> f64 {
        let part = |(&at, bottom): (&f64, f64)| {
            let offset = at.clamp(0.0, 1.0) - bottom;
            100.0 * offset * offset + 10.0 * (1.0 - sin_cos(core::f64::consts::TAU * 10.0 * offset).1)
        };
        point.iter().zip([0.7, 0.4, 0.5]).map(part).sum()
    }

    /// Makes one leap of all beetles from a minimum; returns the mean landing place.
    fn leap(rules: &mut Rules, from: [f64; D], random: &mut Random) -> [f64; D] {
        let mut beetles = Particles::<f64, N, D>::new(D);
        beetles.position[1] = from;
        beetles.record(1, rippled(&from));
        rules.leap.under_way = true;
        rules.gather(&mut beetles);
        for beetle in 0..rules.whiskered() {
            rules.aim(beetle, &beetles, random);
            let [right, left] = [Side::Right, Side::Left].map(|side| {
                let tip = rules.tip(beetle, side, &beetles);
                assert!(tip.iter().all(|at| (-LEAST_ROOM..=1.0 + LEAST_ROOM).contains(at)), "{tip:?}");
                rippled(&tip)
            });
            rules.smell(beetle, &beetles, right, left);
        }
        let mut mean = [0.0; D];
        for beetle in 0..N {
            rules.displace(beetle, &mut beetles, random);
            add_scaled(&mut mean, 1.0 / N as f64, &beetles.position[beetle]);
        }
        mean
    }

    #[test]
    fn leaps_from_ripple_to_ripple_end_at_the_bottom() {
        let reaches = |seed: &u64| {
            let (mut rules, mut random) = (Rules::new(AdaptiveSettings::default(), D), Random::new(*seed));
            // The minimum of a ripple is 0.995 ripples from the next; the bottom is one of them.
            let nearest = |at: [f64; D]| {
                core::array::from_fn(|k| {
                    let bottom = [0.7, 0.4, 0.5][k];
                    bottom + 0.0995 * ((at[k] - bottom) / 0.0995).round()
                })
            };
            let mut place = nearest([0.85, 0.1, 0.7]);
            let mut leaps = 0;
            while rippled(&place) > 1e-9 && leaps < 8 {
                place = nearest(leap(&mut rules, place, &mut random));
                leaps += 1;
            }
            rippled(&place) < 1e-9
        };
        let count = (1..=50).filter(reaches).count();
        assert!(count >= 40, "{count}");
    }

    #[test]
    fn progress_after_a_standstill_is_a_share_of_the_difference_to_it() {
        let mut rules = Rules::new(AdaptiveSettings::default(), D);
        assert!(rules.leap.least_progress(5.0) < 1e-14);
        for best in [10.0, 5.0] {
            assert!(rules.leaps_from(best));
        }
        assert!((rules.leap.least_progress(5.0) - 5e-4).abs() < 1e-12);
        assert!(!rules.leaps_from(f64::MAX), "nothing is known of the cost: scattered");
        assert!(rules.leap.least_progress(5.0) < 1e-14, "forgotten");
    }
}
