//! Reason why a motion cannot be run or designed: joint, limit, value, key of the leg file, and what to do.

use scarab::motion::{LimitViolation, Quantity};

use scarab_identify::formats::leg_file::{JointFile, LegFile};

/// Torque over its limit above which the position loop has lost the command, and its value says nothing.
const DIVERGED: f64 = 3.0;

/// Limit that a motion exceeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Limit {
    /// Angle, speed or acceleration of the commanded motion; the values are in rad and s.
    Motion(Quantity),
    /// Torque of the motion by the assumed leg, margin included.
    Torque,
    /// Torque on the way to the motion, margin included.
    Approach,
    /// Torque that the monitor grants towards an end of the range.
    Stop(OperatingPoint),
    /// Torque that the monitor grants near the speed limit.
    Speed(OperatingPoint),
    /// Torque limit, exceeded by the position loop of the simulated leg.
    Loop(OperatingPoint),
}

/// Where a joint is, and how fast, in D-H angles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct OperatingPoint {
    pub(crate) position_rad: f64,
    pub(crate) velocity_rad_s: f64,
}

/// Exceeded limit of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Obstacle {
    /// Joint, counted from 0.
    pub(crate) joint: usize,
    pub(crate) limit: Limit,
    /// Value that the motion needs.
    pub(crate) value: f64,
    /// Value that is allowed, in the same unit.
    pub(crate) allowed: f64,
}

impl Obstacle {
    /// Obstacle of a motion that is not within its envelope.
    pub(crate) fn from_motion(violation: &LimitViolation) -> Self {
        Self {
            joint: violation.joint,
            limit: Limit::Motion(violation.quantity),
            value: f64::from(violation.bound),
            allowed: f64::from(violation.limit),
        }
    }

    /// Value over what is allowed, above 1.
    pub(crate) fn excess(&self) -> f64 {
        let (value, allowed) = (self.value.abs(), self.allowed.abs());
        match self.limit {
            Limit::Motion(_) | Limit::Torque | Limit::Approach | Limit::Loop(_) => value / allowed.max(1e-9),
            // What is granted may have the other sign.
            Limit::Stop(_) | Limit::Speed(_) => {
                1.0 + (self.value - self.allowed).abs() / value.max(allowed).max(1e-9)
            }
        }
    }

    /// Sentence: joint, value, limit, key, and what to do. `inertia` is the largest that the joint moves,
    /// kg m2, and `margin` the share that is added to the torque.
    pub fn words(&self, leg: &LegFile, inertia: f64, margin: f64) -> String {
        let Some(joint) = leg.joints.get(self.joint) else { return String::new() };
        let (value, allowed) = (self.value, self.allowed);
        let key = torque_key(joint);
        let less = format!(
            "raise it, narrow `range_deg` to postures that hold less weight, correct `prior`, or lower --torque-margin \
             (now {:.0} %)",
            100.0 * margin
        );
        let words = match self.limit {
            Limit::Motion(quantity) => motion_words(quantity, value, allowed),
            Limit::Torque => {
                format!(
                    "even the motion with the least torque needs {value:.3} N m, limit {allowed:.3} N m ({key}): {less}"
                )
            }
            Limit::Approach => format!(
                "the way to the motion needs {value:.3} N m, limit {allowed:.3} N m ({key}), because it may begin anywhere in \
                 `range_deg`: {less}"
            ),
            Limit::Stop(point) => {
                let (left, end) = to_end(joint, &point);
                format!(
                    "{left:.1} degrees before the {end} end of `range_deg`, at {:.0} degrees/s, it needs {value:.3} N m and the \
                     monitor grants {allowed:.3} N m: half of {:.3} N m ({key}) must stop the inertia of {inertia:.4} kg m2 before \
                     the end. Lower `speed_limit_deg_s` (now {:.0}) or `acceleration_limit_deg_s2` (now {:.0}), widen \
                     `range_deg`, or raise the torque limit",
                    point.velocity_rad_s.abs().to_degrees(),
                    joint.torque_cap(),
                    joint.speed_limit_deg_s,
                    joint.acceleration_limit_deg_s2
                )
            }
            Limit::Speed(point) => format!(
                "at {:.0} degrees/s it needs {value:.3} N m and the monitor grants {allowed:.3} N m, because \
                 `speed_limit_deg_s` is {:.0}: raise it, or lower `acceleration_limit_deg_s2` (now {:.0})",
                point.velocity_rad_s.abs().to_degrees(),
                joint.speed_limit_deg_s,
                joint.acceleration_limit_deg_s2
            ),
            Limit::Loop(point) if value.abs() > DIVERGED * allowed.abs() => format!(
                "the simulated leg does not follow its command at {:.0} degrees/s with {:.3} N m ({key}): raise it, lower \
                 `speed_limit_deg_s` (now {:.0}), or correct friction and `rotor_inertia` in `prior`",
                point.velocity_rad_s.abs().to_degrees(),
                allowed.abs(),
                joint.speed_limit_deg_s
            ),
            Limit::Loop(point) => format!(
                "with the position loop it needs {value:.3} N m at {:.0} degrees/s, limit {allowed:.3} N m ({key}): raise it, \
                 lower `speed_limit_deg_s` (now {:.0}), or correct friction and `rotor_inertia` in `prior`",
                point.velocity_rad_s.abs().to_degrees(),
                joint.speed_limit_deg_s
            ),
        };
        format!("joint `{}`: {words}", joint.name)
    }
}

/// Commanded angle, speed or acceleration beyond its limit; rad and s.
fn motion_words(quantity: Quantity, value: f64, allowed: f64) -> String {
    let (word, key, unit) = match quantity {
        Quantity::Low | Quantity::High => ("angle", "range_deg", "degrees (D-H)"),
        Quantity::Speed => ("speed", "speed_limit_deg_s", "degrees/s"),
        Quantity::Acceleration => ("acceleration", "acceleration_limit_deg_s2", "degrees/s2"),
    };
    let [value, allowed] = [value, allowed].map(f64::to_degrees);
    format!("its {word} reaches {value:.1}, limit {allowed:.1} {unit}: widen `{key}`")
}

/// Key that limits the torque.
fn torque_key(joint: &JointFile) -> &'static str {
    if joint.torque_cap() < joint.torque_limit_nm {
        "`current_limit_a` times `torque_per_ampere`"
    } else {
        "`torque_limit_nm`"
    }
}

/// Distance to the end of the range towards which a joint moves, degrees, and its anatomical name.
fn to_end(joint: &JointFile, point: &OperatingPoint) -> (f64, &'static str) {
    let direction = joint.direction as f64;
    let angle = direction * (point.position_rad.to_degrees() - joint.zero_offset_deg);
    let [low, high] = joint.range_deg;
    let grows = if point.velocity_rad_s == 0.0 {
        high - angle < angle - low
    } else {
        direction * point.velocity_rad_s > 0.0
    };
    if grows { (high - angle, "upper") } else { (angle - low, "lower") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_obstacle_names_joint_value_limit_and_key() {
        let mut leg = LegFile::load("x2-wearer-75kg").expect("shipped");
        leg.joints[1].torque_limit_nm = 20.0;
        let point = OperatingPoint { position_rad: (-90.0_f64).to_radians(), velocity_rad_s: -1.0 };
        for (limit, value, allowed, words) in [
            (Limit::Torque, 31.25, 20.0, "needs 31.250 N m, limit 20.000 N m (`torque_limit_nm`)"),
            (Limit::Approach, 31.25, 20.0, "may begin anywhere in `range_deg`"),
            (
                Limit::Motion(Quantity::Speed),
                2.0_f64.to_radians(),
                1.0_f64.to_radians(),
                "its speed reaches 2.0, limit 1.0 degrees/s: widen `speed_limit_deg_s`",
            ),
            (
                Limit::Stop(point),
                5.0,
                -2.0,
                "5.5 degrees before the upper end of `range_deg`, at 57 degrees/s, it needs 5.000 N m",
            ),
            (Limit::Speed(point), 5.0, 2.0, "because `speed_limit_deg_s` is 258: raise it"),
            (Limit::Loop(point), 25.0, 20.0, "with the position loop it needs 25.000 N m"),
        ] {
            let found = Obstacle { joint: 1, limit, value, allowed }.words(&leg, 2.5, 0.2);
            assert!(found.starts_with("joint `knee`: ") && found.contains(words), "{words}: {found}");
        }
    }
}
