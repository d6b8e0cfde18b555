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

use std::collections::{HashMap, HashSet};

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use scarab_base::error::FileError;
use scarab_base::shell::quoted;

use crate::formats::robot::{Inertial, Joint, Kind, Robot};

/// Most joints of a leg.
const MOST_JOINTS: usize = 3;
/// Joints in a message.
const MOST_NAMES: usize = 200;

/// Body in the root's frame while every chosen joint is at 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LumpedBody {
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Centre of mass, m.
    pub(crate) centre: Vector3<f64>,
    /// Tensor about the centre of mass, kg m^2.
    pub(crate) tensor: Matrix3<f64>,
}

/// Chosen joint with all that it moves up to the next one.
#[derive(Clone, Debug)]
pub(crate) struct ChainJoint<'a> {
    pub(crate) joint: &'a Joint,
    /// Axis in the root's frame.
    pub(crate) axis: Unit<Vector3<f64>>,
    /// Point on the axis in the root's frame, m.
    pub(crate) point: Vector3<f64>,
    pub(crate) body: LumpedBody,
}

/// Owner of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    /// Does not move.
    Base,
    /// Body of a chosen joint.
    Chosen(usize),
    /// Moved by a joint that is no part of the leg.
    Aside,
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
    nothing_loose(robot, &chosen, &positions)?;
    let index_in_chain: HashMap<usize, usize> =
        chosen.iter().enumerate().map(|(index, joint)| (*joint, index)).collect();

    let mut pose = vec![Isometry3::identity(); robot.links.len()];
    let mut owner = vec![Owner::Base; robot.links.len()];
    let mut found: Vec<ChainJoint<'a>> = Vec::new();
    let mut parts: Vec<Vec<LumpedBody>> = vec![Vec::new(); chosen.len()];
    for (number, joint) in robot.joints.iter().enumerate() {
        let (before, frame) = (owner[joint.parent], pose[joint.parent] * joint.origin);
        let at = positions.get(&number).copied();
        pose[joint.child] = frame * at.map_or_else(Isometry3::identity, |at| moved(joint, at));
        owner[joint.child] = match index_in_chain.get(&number) {
            Some(index) => {
                found.push(ChainJoint {
                    joint,
                    axis: Unit::new_normalize(frame * joint.axis.into_inner()),
                    point: frame.translation.vector,
                    body: LumpedBody::default(),
                });
                Owner::Chosen(*index)
            }
            None if joint.kind == Kind::Fixed || at.is_some() => before,
            None => Owner::Aside,
        };
        if let (Owner::Chosen(index), Some(inertial)) =
            (owner[joint.child], &robot.links[joint.child].inertial)
        {
            parts[index].push(in_root(&pose[joint.child], inertial));
        }
    }
    for (joint, parts) in found.iter_mut().zip(&parts) {
        joint.body = lumped(parts);
    }
    Ok(found)
}

/// Checks that every joint which moves the leg's bodies or its base is chosen or held.
fn nothing_loose(robot: &Robot, chosen: &[usize], locked: &HashMap<usize, f64>) -> Result<(), FileError> {
    let (Some(first), Some(last)) = (chosen.first(), chosen.last()) else { return Ok(()) };
    let before_leg: HashSet<usize> = before(robot, &movers(robot), *last).collect();
    // Every joint stands after those before it in the tree.
    let mut is_beyond = vec![false; robot.links.len()];
    let mut loose: Vec<&Joint> = Vec::new();
    for (number, joint) in robot.joints.iter().enumerate() {
        is_beyond[joint.child] = is_beyond[joint.parent] || number == *first;
        let moves_leg = is_beyond[joint.child] || before_leg.contains(&number);
        let is_free = joint.kind != Kind::Fixed && !chosen.contains(&number) && !locked.contains_key(&number);
        if moves_leg && is_free {
            loose.push(joint);
        }
    }
    let Some(one) = loose.first() else { return Ok(()) };
    if let Some(free) = loose.iter().find(|joint| !(joint.kind.turns() || joint.kind == Kind::Prismatic)) {
        let reason = format!(
            "is {} and moves the leg, and cannot be held (--lock): choose joints beyond or before it, or make it `fixed`",
            free.kind.word()
        );
        return Err(robot.joint_error(free, &reason));
    }
    let locks: Vec<_> = loose.iter().take(MOST_NAMES).map(|joint| lock_words(joint)).collect();
    let more = loose.len() - locks.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let subject = if loose.len() == 1 {
        "moves the leg and is neither chosen nor held: choose it".to_owned()
    } else {
        let names: Vec<_> =
            loose[1..].iter().take(MOST_NAMES).map(|joint| format!("`{}`", joint.name)).collect();
        format!("moves the leg and is neither chosen nor held, and so are {}: choose them", names.join(", "))
    };
    let reason = format!(
        "{subject} (--joints), or hold at a position in rad or m, for example\n  {}{more}",
        locks.join(" ")
    );
    Err(robot.joint_error(one, &reason))
}

/// Option that holds a joint at 0, or in the middle of a range without 0.
fn lock_words(joint: &Joint) -> String {
    let range = joint.limit.map(|limit| limit.range).filter(|[low, high]| low < high);
    let middle = range.filter(|[low, high]| joint.kind != Kind::Continuous && !(*low..=*high).contains(&0.0));
    let at = middle.map_or(0.0, |[low, high]| (500.0 * (low + high)).round() / 1000.0);
    format!("--lock {}", quoted(&format!("{}={at}", joint.name)))
}

/// Joint that moves each link.
fn movers(robot: &Robot) -> HashMap<usize, usize> {
    robot.joints.iter().enumerate().map(|(number, joint)| (joint.child, number)).collect()
}

/// Joints on which a joint hangs, the nearest first.
fn before<'a>(
    robot: &'a Robot,
    movers: &'a HashMap<usize, usize>,
    joint: usize,
) -> impl Iterator<Item = usize> + 'a {
    let mover = |number: usize| movers.get(&robot.joints[number].parent).copied();
    std::iter::successors(mover(joint), move |number| mover(*number))
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
                "{} joints turn, a leg has 1 to {MOST_JOINTS}: choose some by --joints, proximal first.{}",
                chosen.len(),
                listed(robot)
            )
        } else {
            format!("--joints names {} joints; a leg has 1 to {MOST_JOINTS}.{}", chosen.len(), listed(robot))
        };
        return Err(robot.error(reason));
    }
    for (index, number) in chosen.iter().enumerate() {
        let joint = &robot.joints[*number];
        if !joint.kind.turns() {
            let reason = format!(
                "is {}; a leg's joints are revolute or continuous.{}",
                joint.kind.word(),
                listed(robot)
            );
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
        if chosen[..index].contains(number) {
            return Err(robot.joint_error(joint, "is named twice by --joints"));
        }
    }
    Ok(chosen)
}

fn number_of(robot: &Robot, name: &str, option: &str) -> Result<usize, FileError> {
    robot
        .joints
        .iter()
        .position(|joint| joint.name == name)
        .ok_or_else(|| robot.error(format!("{option}: no joint is called `{name}`.{}", listed(robot))))
}

/// Joints that move, each with its kind and the one before it that moves.
fn listed(robot: &Robot) -> String {
    let movers = movers(robot);
    let moving: Vec<usize> =
        (0..robot.joints.len()).filter(|number| robot.joints[*number].kind != Kind::Fixed).collect();
    let line = |number: &usize| {
        let joint = &robot.joints[*number];
        let mimic = if joint.is_mimic { ", follows another joint" } else { "" };
        let on = before(robot, &movers, *number).find(|other| robot.joints[*other].kind != Kind::Fixed);
        let on = on.map_or(String::new(), |on| format!(", on {}", robot.joints[on].name));
        format!("\n  {} ({}{on}{mimic})", joint.name, joint.kind.word())
    };
    match moving.len() {
        0 => " No joint of the file moves".to_owned(),
        count => {
            let lines: String = moving.iter().take(MOST_NAMES).map(line).collect();
            let more = count.saturating_sub(MOST_NAMES);
            let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
            format!(" Joints that move, from the root on:{lines}{more}")
        }
    }
}

/// Checks that each chosen joint hangs on the one before.
fn in_one_chain(robot: &Robot, chosen: &[usize]) -> Result<(), FileError> {
    let movers = movers(robot);
    let hangs_on = |distal: usize, proximal: usize| before(robot, &movers, distal).any(|one| one == proximal);
    for pair in chosen.windows(2) {
        let [first, second] = [pair[0], pair[1]].map(|number| &robot.joints[number]);
        if hangs_on(pair[0], pair[1]) {
            let reason = format!("hangs on `{}`: name the joints proximal first", second.name);
            return Err(robot.joint_error(first, &reason));
        }
        if !hangs_on(pair[1], pair[0]) {
            let reason = format!(
                "does not hang on `{}`: the joints of a leg are one chain, chosen by --joints.{}",
                first.name,
                listed(robot)
            );
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
    let frame = pose * inertial.origin;
    let turn = frame.rotation.to_rotation_matrix();
    LumpedBody {
        mass: inertial.mass,
        centre: (frame * Point3::origin()).coords,
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
