//! Motions of the wearer within a leg's ranges and speed limits.
//!
//! ```text
//! gait       g_j = low_j + A w_j + scale_j (pattern_j - least_j),   w = high - low of the range
//!            scale_j = min(1, 0.7 w_j / span_j, SPEED limit_j / (peak_j cadence))
//! strokes    knee between 0.85 and 0.25 of the range, hip in its middle
//! reaching   targets within 0.12 to 0.88 of the range
//! durations  of a way: at least 15/8 way / (SPEED limit), the peak speed of minimum jerk
//! ```
//!
//! Why scaled: the exoskeleton must not reach its speed limit, which would stop it. On the cuffs it
//! overshoots the wearer's speed, so the wearer moves at `SPEED` of the limit at most. For the default leg
//! gait has 81 % of the published knee angles at 0.5 Hz, 50 % at 0.8 Hz and 34 % at 1.2 Hz.

use hal_sim::wearer::motion::{Gait, IntendedMotion, Reaching, Strokes};

use crate::formats::leg_file::{JointFile, LegFile};

/// Largest speed of the wearer's joints as a share of the leg's limit.
pub(crate) const SPEED: f64 = 0.65;
/// Distance of the gait's least angles from the range's lower end, as a share of the range.
const ABOVE: f64 = 0.15;
/// Share of the range that gait uses at most.
const USED: f64 = 0.7;
/// Published gait of hip and knee: least angle and span, degrees, and peak speed, degrees per stride.
const GAIT: [[f64; 3]; 2] = [[-6.93, 31.41, 188.4], [-1.88, 68.89, 416.0]];

/// Motion of the wearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exercise {
    /// Walking in the air, strides per second.
    Gait(f64),
    /// Kicks with the knee.
    Kicking,
    /// Slow extensions of the knee, seated.
    Extension,
    /// Irregular reaching.
    Reaching,
}

/// Range of a joint, rad.
fn range(joint: &JointFile) -> [f64; 2] {
    joint.range_deg.map(f64::to_radians)
}

impl Exercise {
    /// Name in the report.
    pub fn name(self) -> String {
        match self {
            Self::Gait(cadence_hz) => format!("gait {cadence_hz} Hz"),
            Self::Kicking => "kicking".into(),
            Self::Extension => "extension".into(),
            Self::Reaching => "reaching".into(),
        }
    }

    /// Strides per second of gait.
    pub fn cadence_hz(self) -> Option<f64> {
        match self {
            Self::Gait(cadence_hz) => Some(cadence_hz),
            _ => None,
        }
    }

    /// Intended motion of hip and knee on a leg; the seed draws the targets of reaching.
    pub fn intended(self, [hip, knee]: [&JointFile; 2], seed: u64) -> IntendedMotion {
        let within = |joint: &JointFile, share: f64| {
            let [low, high] = range(joint);
            low + share * (high - low)
        };
        let peak = |joint: &JointFile| SPEED * joint.speed_limit_deg_s.to_radians();
        // Shortest time of a minimum-jerk movement over a share of both ranges.
        let shortest = |share: f64| {
            let time = |joint: &JointFile| 1.875 * (within(joint, share) - within(joint, 0.0)) / peak(joint);
            time(hip).max(time(knee))
        };
        match self {
            Self::Gait(cadence_hz) => {
                let mut gait = Gait::at_cadence(cadence_hz);
                for (number, (joint, [least, span, speed])) in [hip, knee].into_iter().zip(GAIT).enumerate() {
                    let [low, high] = joint.range_deg;
                    let permitted = SPEED * joint.speed_limit_deg_s / (speed * cadence_hz);
                    let scale = permitted.min(USED * (high - low) / span).min(1.0);
                    gait.scale[number] = scale;
                    gait.offset[number] = within(joint, ABOVE) - scale * least.to_radians();
                }
                IntendedMotion::Gait(gait)
            }
            Self::Kicking | Self::Extension => {
                let middle = within(hip, 0.5);
                let postures = [[middle, within(knee, 0.85)], [middle, within(knee, 0.25)]];
                let slow = shortest(0.6);
                let durations = if self == Self::Kicking {
                    [slow, 0.05, 1.5 * slow, 0.2]
                } else {
                    [1.5_f64.max(slow), 0.5, 2.0_f64.max(slow), 1.0]
                };
                IntendedMotion::Strokes(Strokes { postures, durations })
            }
            Self::Reaching => IntendedMotion::Reaching(Reaching {
                low: [within(hip, 0.12), within(knee, 0.12)],
                high: [within(hip, 0.88), within(knee, 0.88)],
                durations: [shortest(0.76), 2.0 * shortest(0.76)],
                seed,
            }),
        }
    }
}

/// Joints of hip and knee of a leg that has both.
pub fn hip_and_knee(leg: &LegFile) -> Option<[&JointFile; 2]> {
    match leg.joints.as_slice() {
        [hip, knee] => Some([hip, knee]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use hal_sim::wearer::muscles::Intention;
    use hal_sim::world::World;

    use super::*;
    use crate::formats::leg_file::DEFAULT_LEG;
    use crate::leg::two_bodies::{MuscleTone, TwoBodies};

    #[test]
    fn every_motion_stays_within_ranges_and_speeds() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let bodies = TwoBodies::from_leg(&leg).expect("a worn leg");
        let joints = hip_and_knee(&leg).expect("two joints");
        for exercise in [
            Exercise::Gait(0.5),
            Exercise::Gait(0.8),
            Exercise::Gait(1.2),
            Exercise::Kicking,
            Exercise::Extension,
            Exercise::Reaching,
        ] {
            let mut world = World::<2>::new(&bodies.exoskeleton.description().expect("simulated"), 1);
            world.move_to(&[0.4, 0.8]);
            world.wear(&bodies.wearer(MuscleTone::Insisting)).expect("a hip and a knee");
            world.intend(Intention::Follow(exercise.intended(joints, 3))).expect("permitted");
            let (mut low, mut high, mut fastest) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], [0.0_f64; 2]);
            for tick in 0..60_000 {
                world.advance();
                // The start from another posture may be faster.
                if tick < 4000 {
                    continue;
                }
                let intended = world.wearer_truth().and_then(|truth| truth.intended).expect("follows");
                for joint in 0..2 {
                    low[joint] = low[joint].min(intended.position[joint].to_degrees());
                    high[joint] = high[joint].max(intended.position[joint].to_degrees());
                    fastest[joint] = fastest[joint].max(intended.velocity[joint].abs().to_degrees());
                }
            }
            println!("{}: {low:.1?} to {high:.1?} degrees, {fastest:.0?} degrees/s", exercise.name());
            for (joint, file) in joints.iter().enumerate() {
                let [least, most] = file.range_deg;
                assert!(least + 3.0 < low[joint] && high[joint] < most - 3.0, "{exercise:?}");
                assert!(fastest[joint] <= 1.01 * SPEED * file.speed_limit_deg_s, "{exercise:?}");
            }
            assert!(high[1] - low[1] > 15.0, "{exercise:?}: the knee must move");
        }
    }
}
