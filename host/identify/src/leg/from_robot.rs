//! Leg file from a robot description: geometry, gravity, limits and prior.
//!
//! The conversion keeps torque, not frames: the anatomical angle is the joint's angle in the description, its
//! torque the joint's torque. What a description does not know is left out of the file, as a comment.
//! Rounding of the conversion is removed where a short number lies within it ([`scarab_base::rounding`]).
//!
//! | leg file | robot description |
//! | --- | --- |
//! | `dh`, `direction`, `zero_offset_deg` | axes at position 0 (`crate::leg::axes`) |
//! | `gravity` | gravity in the root's frame, turned into the base frame |
//! | `range_deg`, `speed_limit_deg_s`, `torque_limit_nm` | `limit`: `lower`, `upper`, `velocity`, `effort` |
//! | `prior` | bodies of the chain (`crate::leg::robot_chain`), `dynamics`: `friction`, `damping` |

use nalgebra::Vector3;
use scarab_base::error::FileError;
use scarab_base::rounding::{without_noise, without_noise_rad};

use crate::formats::leg_file::check::{LARGEST_SPEED, LARGEST_TORQUE, LENGTH, SMALLEST_RANGE_DEG};
use crate::formats::leg_file::draft::{Draft, DraftJoint, DraftPrior};
use crate::formats::leg_file::{
    DEFAULT_RANGE_DEG, DEFAULT_SPEED_LIMIT, DEFAULT_TORQUE_LIMIT, DhFile, LegFile,
};
use crate::formats::robot::{Joint, Kind, Robot};
use crate::leg::axes::{Axis, DhChain, DhJoint, ROUNDING_RAD};
use crate::leg::robot_chain::{ChainJoint, LumpedBody, chain};

/// Range above which a limit may be in degrees, rad.
const LARGEST_PLAUSIBLE_RAD: f64 = 30.0;
/// Largest angle at which axes may count as parallel, rad.
pub const LARGEST_PARALLEL_RAD: f64 = 0.01;
/// Axes nearer to parallel than this are probably meant parallel, rad.
const SUSPICIOUS_RAD: f64 = 1e-3;

/// Ends of a range that the firmware takes, anatomical and as D-H angle, degrees.
const TURN_DEG: f64 = 360.0;

/// Narrowing of a range that needs no remark, degrees.
const ROUNDED_DEG: f64 = 1e-4;

/// Choices that a robot description leaves open.
#[derive(Clone, Debug)]
pub struct RobotOptions {
    /// Names of the leg's joints, proximal first; empty for all that turn.
    pub joints: Vec<String>,
    /// Positions of joints that are held, rad or m.
    pub locked: Vec<(String, f64)>,
    /// Gravity's acceleration in the root's frame, m/s^2.
    pub gravity: Vector3<f64>,
    /// Axes within this angle of parallel count as parallel, rad.
    pub parallel_rad: f64,
    /// Whether bodies become the prior.
    pub with_prior: bool,
}

/// Leg file and remarks for its user.
#[derive(Clone, Debug)]
pub struct FromRobot {
    /// Text of the leg file.
    pub text: String,
    pub leg: LegFile,
    /// Values of the description that the leg file does not hold, and why.
    pub remarks: Vec<String>,
}

/// Leg of a robot's joints.
///
/// # Errors
/// Names joint, value and limit where the joints are not a leg, D-H numbers exceed the format, or a
/// body is impossible.
pub fn leg(robot: &Robot, options: &RobotOptions) -> Result<FromRobot, FileError> {
    let chosen = chain(robot, &options.joints, &options.locked)?;
    let axes: Vec<_> =
        chosen.iter().map(|one| Axis { along: one.axis.into_inner(), point: one.point }).collect();
    let dh = DhChain::from_axes(&axes, &options.gravity, options.parallel_rad);
    let mut remarks = Vec::new();
    let mut joints = Vec::new();
    for (number, (one, frame)) in chosen.iter().zip(&dh.joints).enumerate() {
        let mut own = Vec::new();
        if let Some(before) = number.checked_sub(1) {
            let before = Framed { one: &chosen[before], dh: &dh.joints[before] };
            expressible(robot, before, Framed { one, dh: frame }, options.parallel_rad)?;
            own.extend(almost_parallel(before.one.joint, frame, options.parallel_rad));
        }
        joints.push(joint(robot, one, frame, options.with_prior, &mut own)?);
        remarks.extend(own.into_iter().map(|remark| format!("joint `{}`: {remark}", one.joint.name)));
    }
    let [x, y, z]: [f64; 3] = options.gravity.into();
    let draft = Draft {
        name: robot.name.clone(),
        gravity: dh.gravity.map(|part| without_noise(part, dh.gravity.norm())).into(),
        remarks: vec![
            format!("Leg of the robot `{}`; gravity is ({x}, {y}, {z}) m/s2 in the frame of its root.", robot.name),
            "Anatomical angles and torques are those of the robot description. Words in capitals are unknown:".into(),
            "replace them and remove the `#`. `leg --check FILE` says which use needs which.".into(),
        ],
        joints,
    };
    let text = draft.to_toml();
    let leg = LegFile::parse(&text, &robot.file).map_err(|fault| {
        let hint = if fault.reason.contains("prior") {
            ": the bodies of the description cannot exist; correct its `inertial`, or leave bodies out (--no-prior)"
        } else {
            ""
        };
        robot.error(format!("no leg file can be written: {}{hint}", fault.reason))
    })?;
    Ok(FromRobot { text, leg, remarks })
}

/// Checks that the numbers between two joints fit the format.
fn expressible(
    robot: &Robot,
    before: Framed<'_>,
    own: Framed<'_>,
    parallel_rad: f64,
) -> Result<(), FileError> {
    let [low, high] = LENGTH;
    let is_outside = |value: f64| !(low..=high).contains(&value);
    let (angle, joint) = (own.dh.angle_to_parallel, own.one.joint);
    let other = &before.one.joint.name;
    let is_almost_parallel = angle > parallel_rad.max(ROUNDING_RAD) && angle < SUSPICIOUS_RAD;
    if is_almost_parallel {
        let away = [before, own].iter().map(Framed::away).fold(own.dh.d.abs(), f64::max);
        if is_outside(away) || is_outside(own.dh.a) {
            let reason = format!(
                "its axis is {angle:.1e} rad from parallel to that of `{other}`: their common normal, and with it the D-H \
                 frame, is {away:.1e} m away, more than {high} m; write `rpy` with all digits, or take the axes as parallel \
                 (--parallel {:.0e})",
                2.0 * angle
            );
            return Err(robot.joint_error(joint, &reason));
        }
    }
    for (key, value) in [("a", own.dh.a), ("d", own.dh.d)] {
        if is_outside(value) {
            let reason = format!(
                "D-H `{key}` from joint `{other}` is {value:.4e} m, a leg file takes {low}..{high}: is `xyz` in metres?"
            );
            return Err(robot.joint_error(joint, &reason));
        }
    }
    Ok(())
}

/// Joint and its D-H frame.
#[derive(Clone, Copy)]
struct Framed<'a> {
    one: &'a ChainJoint<'a>,
    dh: &'a DhJoint,
}

impl Framed<'_> {
    /// Distance of the D-H frame from the joint's own frame, m.
    fn away(&self) -> f64 {
        (self.dh.origin - self.one.point).norm()
    }
}

/// Remark on an axis that is nearly parallel to the one before.
fn almost_parallel(before: &Joint, dh: &DhJoint, parallel_rad: f64) -> Option<String> {
    let angle = dh.angle_to_parallel;
    if angle <= ROUNDING_RAD || angle > SUSPICIOUS_RAD.max(parallel_rad) {
        return None;
    }
    let words = format!("its axis is {angle:.1e} rad from parallel to that of `{}`", before.name);
    Some(if angle <= parallel_rad {
        format!("{words} and taken as parallel (--parallel)")
    } else {
        format!("{words}: if its `rpy` is rounded, --parallel {:.0e} takes it as parallel", 2.0 * angle)
    })
}

fn joint(
    robot: &Robot,
    one: &ChainJoint<'_>,
    dh: &DhJoint,
    with_prior: bool,
    remarks: &mut Vec<String>,
) -> Result<DraftJoint, FileError> {
    let joint = one.joint;
    let limit = joint.limit.unwrap_or_default();
    // Bounds of a leg file, in the units of the description.
    let within = |key: &str, value: Option<f64>, most: f64, usual: &str, remarks: &mut Vec<String>| {
        let value = value?;
        let fits = value > 0.0 && value <= most;
        if !fits {
            remarks.push(format!(
                "`limit` has {key} = {value}, a leg file takes above 0, to {most}: left out; simulation and `excite` use \
                 {usual}"
            ));
        }
        fits.then_some(value)
    };
    let usual_speed = format!("{DEFAULT_SPEED_LIMIT} degrees per second");
    let usual_torque = format!("{DEFAULT_TORQUE_LIMIT} N m");
    let speed = within("velocity", limit.velocity, LARGEST_SPEED.to_radians(), &usual_speed, remarks);
    let torque = within("effort", limit.effort, LARGEST_TORQUE, &usual_torque, remarks);
    // Lengths carry the rounding of the positions from which they follow.
    let size = dh.origin.norm().max(one.point.norm());
    let zero_offset_deg = without_noise(dh.zero.to_degrees(), TURN_DEG);
    Ok(DraftJoint {
        name: joint.name.clone(),
        dh: DhFile {
            alpha: without_noise_rad(dh.alpha),
            a: without_noise(dh.a, size),
            d: without_noise(dh.d, size),
        },
        direction: dh.direction,
        zero_offset_deg,
        range_deg: range(joint, dh.direction as f64, zero_offset_deg, remarks),
        speed_limit_deg_s: speed.map(|speed| without_noise(speed.to_degrees(), 0.0)),
        torque_limit_nm: torque,
        prior: if with_prior { Some(prior(robot, joint, &one.body, dh)?) } else { None },
        remarks: remarks.clone(),
    })
}

/// Range in degrees, if the description states one; narrowed to what the firmware takes.
fn range(joint: &Joint, direction: f64, zero_deg: f64, remarks: &mut Vec<String>) -> Option<[f64; 2]> {
    let [usual_low, usual_high] = DEFAULT_RANGE_DEG;
    let usual = format!(
        "simulation and `excite` use {usual_low} to {usual_high} degrees until `range_deg` is stated"
    );
    if joint.kind == Kind::Continuous {
        remarks.push(format!("is continuous: it has no range; {usual}"));
        return None;
    }
    let [low, high] = joint.limit?.range.map(|end| without_noise(end.to_degrees(), 0.0));
    if !(high - low >= SMALLEST_RANGE_DEG) {
        remarks.push(format!(
            "`limit` is {low} to {high} degrees, a leg file takes {SMALLEST_RANGE_DEG} degrees and more: left out; {usual}"
        ));
        return None;
    }
    // The firmware's angle is direction * angle + zero, and each of both lies within a turn.
    let ends = [-TURN_DEG, TURN_DEG].map(|end| without_noise((end - zero_deg) * direction, TURN_DEG));
    let narrowed =
        [low.max(-TURN_DEG).max(ends[0].min(ends[1])), high.min(TURN_DEG).min(ends[0].max(ends[1]))];
    // A turn of a few digits is a turn.
    if (narrowed[0] - low).max(high - narrowed[1]) < ROUNDED_DEG {
        return Some(narrowed);
    }
    let [least, most] = narrowed;
    if !(most - least >= SMALLEST_RANGE_DEG) {
        remarks.push(format!(
            "`limit` is {low} to {high} degrees, of which D-H angles within {TURN_DEG} degrees leave none: left out; {usual}"
        ));
        return None;
    }
    // A URDF states rad; a person's joint in degrees is a number of 20 to 180.
    let is_doubtful = (high - low).to_radians() > LARGEST_PLAUSIBLE_RAD;
    let doubt = if is_doubtful { ". Are its numbers degrees? A URDF states rad" } else { "" };
    remarks.push(format!(
        "`limit` is {low:.1} to {high:.1} degrees, narrowed to {least:.1} to {most:.1}: simulation and `excite` take angles, and D-H \
         angles (zero offset {zero_deg:.1} degrees), within {TURN_DEG} degrees{doubt}"
    ));
    Some(narrowed)
}

/// Body in the joint's D-H frame.
fn prior(robot: &Robot, joint: &Joint, body: &LumpedBody, dh: &DhJoint) -> Result<DraftPrior, FileError> {
    if !(body.mass > 0.0) {
        let reason =
            "the links that it moves have no mass: state `inertial`, or leave bodies out (--no-prior)";
        return Err(robot.joint_error(joint, reason));
    }
    let turn = dh.frame.transpose();
    let com = turn * (body.centre - dh.origin);
    let size = body.centre.norm().max(dh.origin.norm());
    let com = com.map(|part| without_noise(part, size));
    let tensor = turn * body.tensor * dh.frame;
    let tensor = tensor.map(|element| without_noise(element, tensor.amax()));
    let positive = |key: &str, value: Option<f64>| match value {
        Some(value) if value < 0.0 => {
            let reason = format!("`{key}` of `dynamics` is {value}; it must not be negative");
            Err(robot.joint_error(joint, &reason))
        }
        value => Ok(value),
    };
    Ok(DraftPrior {
        mass: without_noise(body.mass, 0.0),
        com: com.into(),
        inertia_com: [tensor.m11, tensor.m12, tensor.m13, tensor.m22, tensor.m23, tensor.m33],
        coulomb: positive("friction", joint.friction)?,
        viscous: positive("damping", joint.damping)?,
    })
}
