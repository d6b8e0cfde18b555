//! Chosen joints of a robot as a chain of one to three axes, each with the body that it moves.
//!
//! Why: a leg file describes a serial chain on a fixed base. Links on fixed or locked joints belong to the
//! body of the chosen joint before them; links before the first chosen joint belong to the base, which
//! has no effect on torque.
//!
//! ```text
//! all in the root's frame, chosen joints at 0:
//! T_child = T_parent T_origin [Rot(axis, locked angle) or Trans(axis locked distance)]
//! m = sum m_k,   c = sum m_k c_k / m,   I = sum R_k I_k R_k' + m_k ((r'r) 1 - r r'),   r = c_k - c
//! ```
//!
//! Source: parallel-axis theorem, Featherstone, *Rigid Body Dynamics Algorithms* (2008), 2.13.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::base::error::FileError;
use crate::formats::robot::{Inertial, Joint, Kind, Robot};

/// Most joints of a leg.
const MOST_JOINTS: usize = 3;
/// Names in a message.
const MOST_NAMES: usize = 20;

/// Body in the root's frame while every chosen joint is at 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LumpedBody {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub centre: Vector3<f64>,
    /// Tensor about the centre of mass, kg m^2.
    pub tensor: Matrix3<f64>,
}

/// Chosen joint with all that it moves up to the next one.
#[derive(Clone, Debug)]
pub struct ChainJoint<'a> {
    pub joint: &'a Joint,
    /// Axis in the root's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Point on the axis in the root's frame, m.
    pub point: Vector3<f64>,
    pub body: LumpedBody,
}

/// Owner of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    /// Does not move.
    Base,
    /// Body of a chosen joint.
    Chosen(usize),
    /// Moved by a joint before the chain that is neither chosen nor locked.
    Loose(usize),
}

/// Chain of the joints with these names, proximal first; without names, of all joints that turn. `locked`
/// holds joints at a position, rad or m.
///
/// # Errors
/// Unknown joints, joints that do not turn or are not one chain, joints that move the chain's bodies or its
/// base and are neither chosen nor locked.
pub fn chain<'a>(
    robot: &'a Robot,
    names: &[String],
    locked: &[(String, f64)],
) -> Result<Vec<ChainJoint<'a>>, FileError> {
    let positions = locked_positions(robot, locked)?;
    let chosen = chosen(robot, names, &positions)?;
    in_one_chain(robot, &chosen)?;
    let place_in_chain: HashMap<usize, usize> =
        chosen.iter().enumerate().map(|(place, joint)| (*joint, place)).collect();

    let mut pose = vec![Isometry3::identity(); robot.links.len()];
    let mut owner = vec![Owner::Base; robot.links.len()];
    let mut found: Vec<ChainJoint<'a>> = Vec::new();
    let mut parts: Vec<Vec<LumpedBody>> = vec![Vec::new(); chosen.len()];
    let mut movers = Vec::new();
    for (number, joint) in robot.joints.iter().enumerate() {
        let (before, frame) = (owner[joint.parent], pose[joint.parent] * joint.place);
        let at = positions.get(&number).copied();
        pose[joint.child] = frame * at.map_or_else(Isometry3::identity, |at| moved(joint, at));
        owner[joint.child] = match (place_in_chain.get(&number), before) {
            (Some(_), Owner::Loose(mover)) => {
                let mover = &robot.joints[mover];
                let reason = format!(
                    "moves the chain of `{}`, but is neither chosen nor held: choose it too (--joints), or hold it \
                     (--lock \"{}=0\")",
                    joint.name, mover.name
                );
                return Err(robot.joint_error(mover, &reason));
            }
            (Some(place), _) => {
                found.push(ChainJoint {
                    joint,
                    axis: Unit::new_normalize(frame * joint.axis.into_inner()),
                    point: frame.translation.vector,
                    body: LumpedBody::default(),
                });
                Owner::Chosen(*place)
            }
            (None, before) if joint.kind == Kind::Fixed || at.is_some() => before,
            (None, Owner::Chosen(_)) => {
                movers.push(joint);
                before
            }
            (None, _) => Owner::Loose(number),
        };
        if let (Owner::Chosen(place), Some(inertial)) =
            (owner[joint.child], &robot.links[joint.child].inertial)
        {
            parts[place].push(in_root(&pose[joint.child], inertial));
        }
    }
    if let Some(first) = movers.first() {
        let locks: Vec<_> =
            movers.iter().take(MOST_NAMES).map(|joint| format!("--lock \"{}=0\"", joint.name)).collect();
        let reason = format!(
            "hangs on the chosen joints and moves: choose it (--joints), or hold it at a position in rad or m ({})",
            locks.join(" ")
        );
        return Err(robot.joint_error(first, &reason));
    }
    for (joint, parts) in found.iter_mut().zip(&parts) {
        joint.body = lumped(parts);
    }
    Ok(found)
}

/// Position of each locked joint, by its number.
fn locked_positions(robot: &Robot, locked: &[(String, f64)]) -> Result<HashMap<usize, f64>, FileError> {
    let mut positions = HashMap::new();
    for (name, at) in locked {
        let number = number_of(robot, name, "--lock")?;
        let joint = &robot.joints[number];
        if joint.kind == Kind::Fixed || !(joint.kind.turns() || joint.kind == Kind::Prismatic) {
            let reason = format!("is {}: --lock holds joints that turn or slide", joint.kind.word());
            return Err(robot.joint_error(joint, &reason));
        }
        if let Some([low, high]) = joint.limit.map(|limit| limit.range).filter(|[low, high]| low < high)
            && joint.kind != Kind::Continuous
            && !(low..=high).contains(at)
        {
            let reason = format!("--lock holds it at {at}, outside its limits {low}..{high}");
            return Err(robot.joint_error(joint, &reason));
        }
        if positions.insert(number, *at).is_some() {
            return Err(robot.joint_error(joint, "is locked twice"));
        }
    }
    Ok(positions)
}

/// Numbers of the chosen joints.
fn chosen(robot: &Robot, names: &[String], locked: &HashMap<usize, f64>) -> Result<Vec<usize>, FileError> {
    let chosen: Vec<usize> = if names.is_empty() {
        let free = |number: &usize| robot.joints[*number].kind.turns() && !locked.contains_key(number);
        (0..robot.joints.len()).filter(free).collect()
    } else {
        names.iter().map(|name| number_of(robot, name, "--joints")).collect::<Result<_, _>>()?
    };
    if !(1..=MOST_JOINTS).contains(&chosen.len()) {
        let reason = if names.is_empty() {
            format!(
                "{} joints turn, a leg has 1 to {MOST_JOINTS}: choose some by --joints, proximal first ({})",
                chosen.len(),
                names_of(robot, |joint| joint.kind.turns())
            )
        } else {
            format!("--joints names {} joints; a leg has 1 to {MOST_JOINTS}", chosen.len())
        };
        return Err(robot.error(reason));
    }
    for (place, number) in chosen.iter().enumerate() {
        let joint = &robot.joints[*number];
        if !joint.kind.turns() {
            let reason = format!("is {}; a leg's joints are revolute or continuous", joint.kind.word());
            return Err(robot.joint_error(joint, &reason));
        }
        if joint.is_mimic {
            let reason =
                "follows another joint (`mimic`): its torque is not its own; a leg's joints are independent";
            return Err(robot.joint_error(joint, reason));
        }
        if locked.contains_key(number) {
            return Err(robot.joint_error(joint, "is both chosen (--joints) and held (--lock)"));
        }
        if chosen[..place].contains(number) {
            return Err(robot.joint_error(joint, "is named twice by --joints"));
        }
    }
    Ok(chosen)
}

fn number_of(robot: &Robot, name: &str, option: &str) -> Result<usize, FileError> {
    robot.joints.iter().position(|joint| joint.name == name).ok_or_else(|| {
        let known = names_of(robot, |joint| joint.kind != Kind::Fixed);
        robot.error(format!("{option}: no joint is called `{name}`; joints that move: {known}"))
    })
}

fn names_of(robot: &Robot, of: impl Fn(&Joint) -> bool) -> String {
    let names: Vec<_> =
        robot.joints.iter().filter(|joint| of(joint)).map(|joint| joint.name.as_str()).collect();
    let shown = names.iter().take(MOST_NAMES).copied().collect::<Vec<_>>().join(", ");
    match names.len() {
        0 => "none".to_owned(),
        count if count > MOST_NAMES => format!("{shown}, and {} more", count - MOST_NAMES),
        _ => shown,
    }
}

/// Checks that each chosen joint hangs on the one before.
fn in_one_chain(robot: &Robot, chosen: &[usize]) -> Result<(), FileError> {
    let mover: HashMap<usize, usize> =
        robot.joints.iter().enumerate().map(|(number, joint)| (joint.child, number)).collect();
    let hangs_on = |distal: usize, proximal: usize| {
        let mut link = robot.joints[distal].parent;
        while let Some(joint) = mover.get(&link) {
            if *joint == proximal {
                return true;
            }
            link = robot.joints[*joint].parent;
        }
        false
    };
    for pair in chosen.windows(2) {
        let [first, second] = [pair[0], pair[1]].map(|number| &robot.joints[number]);
        if hangs_on(pair[0], pair[1]) {
            let reason = format!("hangs on `{}`: name the joints proximal first", second.name);
            return Err(robot.joint_error(first, &reason));
        }
        if !hangs_on(pair[1], pair[0]) {
            let reason = format!("does not hang on `{}`: the joints of a leg are one chain", first.name);
            return Err(robot.joint_error(second, &reason));
        }
    }
    Ok(())
}

fn moved(joint: &Joint, at: f64) -> Isometry3<f64> {
    if joint.kind == Kind::Prismatic {
        Translation3::from(joint.axis.into_inner() * at).into()
    } else {
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&joint.axis, at))
    }
}

fn in_root(pose: &Isometry3<f64>, inertial: &Inertial) -> LumpedBody {
    let place = pose * inertial.place;
    let turn = place.rotation.to_rotation_matrix();
    LumpedBody {
        mass: inertial.mass,
        centre: (place * Point3::origin()).coords,
        tensor: turn.matrix() * inertial.tensor * turn.matrix().transpose(),
    }
}

/// One body of several.
fn lumped(parts: &[LumpedBody]) -> LumpedBody {
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    let moment: Vector3<f64> = parts.iter().map(|part| part.centre * part.mass).sum();
    let centre = if mass > 0.0 { moment / mass } else { Vector3::zeros() };
    let tensor = parts.iter().map(|part| {
        let arm = part.centre - centre;
        part.tensor + (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * part.mass
    });
    LumpedBody { mass, centre, tensor: tensor.sum() }
}
