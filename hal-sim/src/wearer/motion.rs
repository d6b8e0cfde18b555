//! Motions that a wearer intends: gait in the air, strokes, reaching, rest.
//!
//! ```text
//! s(x) = 10 x^3 - 15 x^4 + 6 x^5,  0 <= x <= 1        minimum jerk from 0 to 1
//! gait      g_j = offset_j + scale_j (mean_j + sum_k A_jk cos(k p + B_jk)),   p' = 2 pi cadence(t)
//!           a change of cadence:  cadence = before + (after - before) s((t - at) / within)
//! strokes   out, stay, back, stay between two postures, each way by s
//! reaching  from target to target by s; targets uniform in a box, durations uniform in a range
//! start     a = a_0 + s(t / START_S) (g(t) - a_0)     from the wearer's posture a_0
//! ```
//!
//! Velocity and acceleration are the analytic derivatives, and all are continuous. Angles are anatomical, hip
//! and knee, rad. Time counts from the start of the motion, s.
//!
//! Sources: Flash and Hogan (1985) for minimum jerk. Gait: first four of seven harmonics of a published fit
//! to hip and knee at a natural cadence, 0.987 s per stride (M. F. Dogan,
//! Microprocessor-Controlled-Prosthetic-Knee, 2022), rounded to 0.1 degrees and 0.01 rad; its extremes differ
//! by at most 0.9 degrees. The fitted angles seem to be those of Winter (2009), appendix A; this was not
//! compared with the book. Toe-off is at p = 0.
//! Known limits: one pattern for all cadences, although swing shortens and angles grow with speed; no stance.

use super::description::{WearerError, check_ranges};
use super::plane::Pair;
use crate::maths::sin_cos;
use core::f64::consts::TAU;
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Duration in which a motion fades in, s.
pub(crate) const START_S: f64 = 1.0;

/// Motion that a wearer intends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IntendedMotion {
    /// Stay at a posture: hip and knee, rad.
    Rest([f64; 2]),
    /// Walk in the air.
    Gait(Gait),
    /// Move between two postures again and again.
    Strokes(Strokes),
    /// Reach random postures.
    Reaching(Reaching),
}

/// Walking in the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gait {
    /// Strides per second.
    pub cadence_hz: f64,
    /// Factor of the angles of hip and knee; 1 is the published pattern: hip -7 to 25 degrees, knee -2 to 67.
    pub scale: [f64; 2],
    /// Angles added to hip and knee, rad.
    pub offset: [f64; 2],
    /// Change of the cadence, if any.
    pub change: Option<CadenceChange>,
}

/// Change of a gait's cadence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CadenceChange {
    /// Its start, s after that of the motion.
    pub at: f64,
    /// Strides per second afterwards.
    pub cadence_hz: f64,
    /// Its duration, s.
    pub within: f64,
}

/// Strokes between two postures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strokes {
    /// Postures of hip and knee, rad.
    pub postures: [[f64; 2]; 2],
    /// Durations of the way to the second posture, the stay there, the way back, and the stay at the first
    /// one, s.
    pub durations: [f64; 4],
}

impl Strokes {
    /// Kicks with the knee, one per second, at an angle of the hip (rad).
    pub const fn kicking(hip: f64) -> Self {
        Self { postures: [[hip, 1.4], [hip, 0.35]], durations: [0.3, 0.05, 0.45, 0.2] }
    }

    /// Slow extensions of the knee while seated, one in five seconds, at an angle of the hip (rad).
    pub const fn leg_extension(hip: f64) -> Self {
        Self { postures: [[hip, 1.5], [hip, 0.25]], durations: [1.5, 0.5, 2.0, 1.0] }
    }
}

/// Irregular reaching.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaching {
    /// Smallest target angles of hip and knee, rad.
    pub low: [f64; 2],
    /// Largest target angles of hip and knee, rad.
    pub high: [f64; 2],
    /// Shortest and longest movement, s.
    pub durations: [f64; 2],
    /// Seed of targets and durations.
    pub seed: u64,
}

/// Intended motion at one instant: rad, rad/s, rad/s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Intended {
    /// Angles of hip and knee.
    pub position: [f64; 2],
    /// Their rates.
    pub velocity: [f64; 2],
    /// Their accelerations.
    pub(crate) acceleration: [f64; 2],
}

/// Angle of a gait: mean, amplitudes and phases of the harmonics, degrees and rad.
struct JointPattern {
    mean_deg: f64,
    harmonics: [[f64; 2]; 4],
}

const PATTERNS: [JointPattern; 2] = [
    JointPattern { mean_deg: 7.5, harmonics: [[12.9, -1.86], [4.8, -2.21], [2.5, -3.01], [0.1, -2.95]] },
    JointPattern { mean_deg: 22.7, harmonics: [[23.7, -0.55], [18.5, -1.16], [4.2, -2.57], [1.1, 0.16]] },
];

impl JointPattern {
    /// Angle and its first two derivatives by the phase, rad.
    fn at(&self, phase: f64) -> [f64; 3] {
        let mut sums = [self.mean_deg, 0.0, 0.0];
        for (number, [amplitude, start]) in (1..).zip(self.harmonics) {
            let order = f64::from(number);
            let (sine, cosine) = sin_cos(order * phase + start);
            sums[0] += amplitude * cosine;
            sums[1] -= amplitude * order * sine;
            sums[2] -= amplitude * order * order * cosine;
        }
        sums.map(f64::to_radians)
    }
}

/// Minimum jerk from 0 to 1 with its two derivatives; constant outside of 0..1.
fn minimum_jerk(share: f64) -> [f64; 3] {
    let x = share.clamp(0.0, 1.0);
    let rest = 1.0 - x;
    [
        x * x * x * (10.0 - 15.0 * x + 6.0 * x * x),
        30.0 * x * x * rest * rest,
        60.0 * x * rest * (1.0 - 2.0 * x),
    ]
}

/// Movement between two postures of which a share of `duration` s has passed.
fn movement(from: Pair, to: Pair, passed: f64, duration: f64) -> Intended {
    let [share, rate, change] = minimum_jerk(passed / duration);
    let scaled = |factor: f64| [0, 1].map(|joint| factor * (to[joint] - from[joint]));
    let way = scaled(share);
    Intended {
        position: [from[0] + way[0], from[1] + way[1]],
        velocity: scaled(rate / duration),
        acceleration: scaled(change / (duration * duration)),
    }
}

impl Gait {
    /// Walking in the air at strides per second with the published angles.
    pub const fn at_cadence(cadence_hz: f64) -> Self {
        Self { cadence_hz, scale: [1.0; 2], offset: [0.0; 2], change: None }
    }

    /// Strides since the start, with two derivatives by time.
    fn strides(&self, time: f64) -> [f64; 3] {
        let steady = [self.cadence_hz * time, self.cadence_hz, 0.0];
        let Some(change) = self.change.filter(|change| time > change.at) else { return steady };
        let since = time - change.at;
        let more = change.cadence_hz - self.cadence_hz;
        let x = (since / change.within).min(1.0);
        let [share, rate, _] = minimum_jerk(x);
        // Integral of s: 5/2 x^4 - 3 x^5 + x^6, and 1 s per s beyond the change.
        let passed =
            change.within * x * x * x * x * (2.5 - 3.0 * x + x * x) + (since - change.within).max(0.0);
        [steady[0] + more * passed, steady[1] + more * share, more * rate / change.within]
    }

    fn at(&self, time: f64) -> Intended {
        let [phase, speed, change] = self.strides(time).map(|strides| TAU * strides);
        let mut intended = Intended::default();
        for joint in 0..2 {
            let [angle, slope, bend] = PATTERNS[joint].at(phase).map(|value| self.scale[joint] * value);
            intended.position[joint] = self.offset[joint] + angle;
            intended.velocity[joint] = slope * speed;
            intended.acceleration[joint] = bend * speed * speed + slope * change;
        }
        intended
    }
}

impl Strokes {
    fn at(&self, time: f64) -> Intended {
        let [out, stay, back, rest] = self.durations;
        let cycle = out + stay + back + rest;
        let passed = time - cycle * crate::maths::floor(time / cycle) as f64;
        let [first, second] = self.postures;
        if passed < out + stay {
            movement(first, second, passed, out)
        } else {
            movement(second, first, passed - out - stay, back)
        }
    }
}

/// One movement of a reaching wearer.
#[derive(Clone, Debug, PartialEq)]
struct ReachingMovement {
    from: Pair,
    to: Pair,
    start: f64,
    duration: f64,
    generator: Xoshiro256PlusPlus,
}

impl ReachingMovement {
    /// First movement, from a posture.
    fn begin(reaching: &Reaching, from: Pair) -> Self {
        let generator = Xoshiro256PlusPlus::seed_from_u64(reaching.seed);
        let mut reach = Self { from, to: from, start: 0.0, duration: 0.0, generator };
        reach.plan(reaching);
        reach
    }

    /// Plans the next movement from the end of the present one.
    fn plan(&mut self, reaching: &Reaching) {
        let [shortest, longest] = reaching.durations;
        let shares: [f64; 3] = core::array::from_fn(|_| StandardUniform.sample(&mut self.generator));
        self.from = self.to;
        self.start += self.duration;
        self.duration = shortest + shares[2] * (longest - shortest);
        self.to = [0, 1]
            .map(|joint| reaching.low[joint] + shares[joint] * (reaching.high[joint] - reaching.low[joint]));
    }

    fn at(&mut self, reaching: &Reaching, time: f64) -> Intended {
        while time >= self.start + self.duration {
            self.plan(reaching);
        }
        movement(self.from, self.to, time - self.start, self.duration)
    }
}

impl IntendedMotion {
    /// Checks every number.
    ///
    /// # Errors
    /// [`WearerError::OutOfRange`] with the first wrong one.
    pub fn check(&self) -> Result<(), WearerError> {
        const ANGLE: [f64; 2] = [-4.0, 4.0];
        const DURATION: [f64; 2] = [0.05, 1000.0];
        const CADENCE: [f64; 2] = [0.05, 3.0];
        let angles = |part, [hip, knee]: Pair| {
            check_ranges(
                part,
                &[("angle of the hip, rad,", hip, ANGLE), ("angle of the knee, rad,", knee, ANGLE)],
            )
        };
        match *self {
            Self::Rest(posture) => angles("rest", posture),
            Self::Gait(gait) => {
                angles("gait", gait.offset)?;
                check_ranges(
                    "gait",
                    &[
                        ("cadence, Hz,", gait.cadence_hz, CADENCE),
                        ("scale of the angles", gait.scale[0], [0.0, 3.0]),
                        ("scale of the angles", gait.scale[1], [0.0, 3.0]),
                    ],
                )?;
                let Some(change) = gait.change else { return Ok(()) };
                check_ranges(
                    "change of cadence",
                    &[
                        ("cadence, Hz,", change.cadence_hz, CADENCE),
                        ("start, s,", change.at, [0.0, 1e6]),
                        ("duration, s,", change.within, DURATION),
                    ],
                )
            }
            Self::Strokes(Strokes { postures: [first, second], durations: [out, stay, back, rest] }) => {
                angles("strokes", first)?;
                angles("strokes", second)?;
                check_ranges(
                    "strokes",
                    &[
                        ("duration of a way, s,", out, DURATION),
                        ("duration of a way, s,", back, DURATION),
                        ("duration of a stay, s,", stay, [0.0, DURATION[1]]),
                        ("duration of a stay, s,", rest, [0.0, DURATION[1]]),
                    ],
                )
            }
            Self::Reaching(Reaching { low, high, durations: [shortest, longest], .. }) => {
                angles("reaching", low)?;
                check_ranges(
                    "reaching",
                    &[
                        ("largest angle of the hip, rad,", high[0], [low[0], ANGLE[1]]),
                        ("largest angle of the knee, rad,", high[1], [low[1], ANGLE[1]]),
                        ("shortest movement, s,", shortest, DURATION),
                        ("longest movement, s,", longest, [shortest, DURATION[1]]),
                    ],
                )
            }
        }
    }
}

/// Motion on its way from a posture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct IntendedCourse {
    motion: IntendedMotion,
    from: Pair,
    begun: f64,
    reach: Option<ReachingMovement>,
}

impl IntendedCourse {
    /// Motion that begins at a time (s), at a posture (rad).
    pub(super) fn begin(motion: IntendedMotion, from: Pair, begun: f64) -> Self {
        let reach = match &motion {
            IntendedMotion::Reaching(reaching) => Some(ReachingMovement::begin(reaching, from)),
            _ => None,
        };
        Self { motion, from, begun, reach }
    }

    /// The motion from its beginning, at another posture and time.
    pub(super) fn restarted(&self, from: Pair, now: f64) -> Self {
        Self::begin(self.motion, from, now)
    }

    /// Intended motion at a time (s) that never decreases from call to call.
    pub(super) fn at(&mut self, time: f64) -> Intended {
        let since = (time - self.begun).max(0.0);
        let goal = match (&self.motion, &mut self.reach) {
            (IntendedMotion::Rest(posture), _) => Intended { position: *posture, ..Intended::default() },
            (IntendedMotion::Gait(gait), _) => gait.at(since),
            (IntendedMotion::Strokes(strokes), _) => strokes.at(since),
            (IntendedMotion::Reaching(reaching), Some(reach)) => reach.at(reaching, since),
            (IntendedMotion::Reaching(_), None) => Intended { position: self.from, ..Intended::default() },
        };
        if since >= START_S {
            return goal;
        }
        let [share, rate, change] = minimum_jerk(since / START_S);
        let (rate, change) = (rate / START_S, change / (START_S * START_S));
        let mut faded = Intended::default();
        for joint in 0..2 {
            let away = goal.position[joint] - self.from[joint];
            let (velocity, acceleration) = (goal.velocity[joint], goal.acceleration[joint]);
            faded.position[joint] = self.from[joint] + share * away;
            faded.velocity[joint] = rate * away + share * velocity;
            faded.acceleration[joint] = change * away + 2.0 * rate * velocity + share * acceleration;
        }
        faded
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn motions() -> [IntendedMotion; 5] {
        let change = CadenceChange { at: 2.0, cadence_hz: 1.0, within: 0.7 };
        [
            IntendedMotion::Rest([0.5, 1.0]),
            IntendedMotion::Gait(Gait { change: Some(change), ..Gait::at_cadence(0.8) }),
            IntendedMotion::Strokes(Strokes::kicking(0.5)),
            IntendedMotion::Strokes(Strokes::leg_extension(0.8)),
            IntendedMotion::Reaching(Reaching {
                low: [0.1, 0.2],
                high: [0.8, 1.5],
                durations: [0.4, 1.2],
                seed: 3,
            }),
        ]
    }

    #[test]
    fn velocity_and_acceleration_are_derivatives_of_the_position() {
        let step = 1e-4;
        for motion in motions() {
            assert_eq!(motion.check(), Ok(()));
            let mut course = IntendedCourse::begin(motion, [0.2, 0.4], 0.5);
            let path: Vec<Intended> = (0..70_000).map(|tick| course.at(f64::from(tick) * step)).collect();
            assert_eq!(path[0].position, [0.2, 0.4]);
            assert_eq!(path[0].velocity, [0.0; 2]);
            for three in path.windows(3) {
                for joint in 0..2 {
                    let slope = |value: fn(&Intended) -> Pair| {
                        (value(&three[2])[joint] - value(&three[0])[joint]) / (2.0 * step)
                    };
                    // Jerk reaches 2e3 rad/s^3 and its jumps at the ends of movements 1e3 rad/s^3: half a
                    // step of it is 0.1 rad/s^2.
                    let velocity = slope(|intended| intended.position) - three[1].velocity[joint];
                    let acceleration = slope(|intended| intended.velocity) - three[1].acceleration[joint];
                    assert!(velocity.abs() < 1e-5, "{motion:?}: {velocity:e}");
                    assert!(acceleration.abs() < 0.1, "{motion:?}: {acceleration:e}");
                }
            }
        }
    }

    #[test]
    fn a_gait_has_its_cadence_before_and_after_a_change() {
        let change = CadenceChange { at: 10.0, cadence_hz: 1.0, within: 0.5 };
        let gait = Gait { change: Some(change), ..Gait::at_cadence(0.8) };
        for (time, period) in [(3.0, 1.25), (20.0, 1.0)] {
            let (now, later) = (gait.at(time), gait.at(time + period));
            for joint in 0..2 {
                assert!((now.position[joint] - later.position[joint]).abs() < 1e-12);
            }
        }
        assert_eq!(gait.strides(10.5)[0], 8.0 + 0.8 * 0.5 + 0.2 * 0.25);
    }

    #[test]
    fn the_gait_has_the_extremes_of_its_source() {
        let gait = Gait::at_cadence(1.0);
        for (joint, [low, high]) in [[-6.2, 24.1], [-2.2, 67.5]].into_iter().enumerate() {
            let angles =
                || (0..1000).map(|tick| gait.at(f64::from(tick) * 1e-3).position[joint].to_degrees());
            let found = [angles().fold(f64::INFINITY, f64::min), angles().fold(f64::NEG_INFINITY, f64::max)];
            // Harmonics above the fourth are omitted.
            assert!((found[0] - low).abs() < 0.9 && (found[1] - high).abs() < 0.9, "{found:?}");
        }
    }

    #[test]
    fn reaching_visits_its_box_and_depends_on_its_seed() {
        let reaching = Reaching { low: [0.1, 0.2], high: [0.8, 1.5], durations: [0.4, 1.2], seed: 3 };
        let path = |seed: u64| -> Vec<Pair> {
            let mut course = IntendedCourse::begin(
                IntendedMotion::Reaching(Reaching { seed, ..reaching }),
                [0.3, 0.3],
                0.0,
            );
            (0..10_000).map(|tick| course.at(f64::from(tick) * 0.01).position).collect()
        };
        let one = path(3);
        assert_eq!(one, path(3));
        assert_ne!(one, path(4));
        for joint in 0..2 {
            let low = one.iter().map(|angles| angles[joint]).fold(f64::INFINITY, f64::min);
            let high = one.iter().map(|angles| angles[joint]).fold(f64::NEG_INFINITY, f64::max);
            let width = reaching.high[joint] - reaching.low[joint];
            assert!((0.0..0.1 * width).contains(&(low - reaching.low[joint])), "{low}");
            assert!((0.0..0.1 * width).contains(&(reaching.high[joint] - high)), "{high}");
        }
    }

    #[test]
    fn motions_with_wrong_numbers_are_refused() {
        let kicking = Strokes::kicking(0.5);
        let wrong = [
            IntendedMotion::Rest([f64::NAN, 0.0]),
            IntendedMotion::Gait(Gait::at_cadence(0.0)),
            IntendedMotion::Strokes(Strokes { durations: [0.0, 0.1, 0.4, 0.2], ..kicking }),
            IntendedMotion::Reaching(Reaching {
                low: [0.5; 2],
                high: [0.4, 1.0],
                durations: [0.4, 1.0],
                seed: 1,
            }),
        ];
        for motion in wrong {
            assert!(matches!(motion.check(), Err(WearerError::OutOfRange { .. })), "{motion:?}");
        }
    }
}
