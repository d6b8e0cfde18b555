//! Corrections of the samples that are tried after a refusal: units, signs, and columns.

use scarab::model::AnatomicalJoint;

use crate::report::doubt::ReadAs;
use crate::run::logging_errors::rows::{Equations, Motion};
use crate::run::logging_errors::{Question, joint_words};

/// Change of the angles and torques of one instant.
type Change = Box<dyn Fn(&mut [f64], &mut [f64])>;

/// A correction of the samples: angles and torques of one instant, anatomical.
pub(super) struct Correction {
    pub(super) name: &'static str,
    pub(super) joint: Option<usize>,
    pub(super) words: String,
    pub(super) reads: Vec<ReadAs>,
    apply: Change,
}

/// Equations with all angles in one other unit, for each unit that is possible.
pub(crate) fn with_other_angles(question: &Question) -> Vec<(ReadAs, Equations)> {
    let of_all = angle_units(question).into_iter().filter(|correction| correction.joint.is_none());
    of_all
        .filter_map(|correction| {
            let motions: Vec<Motion> =
                question.motions.iter().map(|motion| corrected(question, motion, &correction)).collect();
            Some((*correction.reads.first()?, question.equations(&motions).ok().flatten()?))
        })
        .collect()
}

/// Whether the angle of a joint, or of each, spans more than this, rad.
pub(super) fn spans(question: &Question, joint: Option<usize>, least: f64) -> bool {
    (0..question.joints()).filter(|at| joint.is_none_or(|joint| joint == *at)).all(|at| {
        let angles = || question.motions.iter().flat_map(|motion| motion.position.column(at));
        angles().fold(f64::MIN, f64::max) - angles().fold(f64::MAX, f64::min) > least
    })
}

pub(super) fn corrected(question: &Question, motion: &Motion, correction: &Correction) -> Motion {
    let anatomy = &question.anatomy;
    let mut motion = motion.clone();
    let each = |values: &mut [f64], of: fn(&AnatomicalJoint<f64>, f64) -> f64| {
        values.iter_mut().zip(anatomy).for_each(|(value, joint)| *value = of(joint, *value));
    };
    for (angles, torques) in motion.position.rows_mut().zip(motion.torque.rows_mut()) {
        each(angles, |joint, angle| joint.angle_from_chain(angle));
        each(torques, |joint, torque| joint.from_chain(torque));
        (correction.apply)(angles, torques);
        each(angles, |joint, angle| joint.angle_to_chain(angle));
        each(torques, |joint, torque| joint.to_chain(torque));
    }
    motion
}

/// All joints, then each where there are several.
fn subjects(joints: usize) -> impl Iterator<Item = Option<usize>> {
    std::iter::once(None).chain((0..joints).filter(move |_| joints > 1).map(Some))
}

/// Torque in mN m.
pub(super) fn millinewton_metres() -> Correction {
    Correction {
        name: "torque_unit",
        joint: None,
        words: "torque divided by 1000: is it in mN m?".into(),
        reads: vec![ReadAs::MillinewtonMetres],
        apply: Box::new(|_, torques| torques.iter_mut().for_each(|torque| *torque /= 1000.0)),
    }
}

/// Corrections of the angles' unit: degrees that span more than a turn in rad, turns of the joint that span
/// less, and angles of the motor where its gear ratio is stated.
pub(super) fn angle_units(question: &Question) -> Vec<Correction> {
    use std::f64::consts::TAU;
    let mut all = Vec::new();
    let joints = question.joints();
    let mut add = |joint: Option<usize>, reads: ReadAs, unit: &str, mut factors: Vec<f64>| {
        let others = factors.iter_mut().enumerate().filter(|(at, _)| joint.is_some_and(|joint| joint != *at));
        others.for_each(|(_, factor)| *factor = 1.0);
        all.push(Correction {
            name: "angle_unit",
            joint,
            words: format!("angle of {} read as {unit}", joint_words(joint)),
            reads: vec![reads],
            apply: Box::new(move |angles, _| {
                angles.iter_mut().zip(&factors).for_each(|(angle, factor)| *angle *= factor);
            }),
        });
    };
    let degree = TAU / 360.0;
    for joint in subjects(joints).filter(|joint| spans(question, *joint, TAU)) {
        add(joint, ReadAs::Degrees, "degrees", vec![degree; joints]);
    }
    if !spans(question, None, TAU) {
        add(None, ReadAs::Turns, "turns", vec![TAU; joints]);
    }
    let ratios: Option<Vec<f64>> = question.motor_ratio.iter().copied().collect();
    if let Some(ratios) = ratios {
        let of_motor = |unit: f64| ratios.iter().map(|ratio| unit / ratio).collect();
        add(None, ReadAs::MotorRadians, "angle of the motor in rad", of_motor(1.0));
        add(None, ReadAs::MotorDegrees, "angle of the motor in degrees", of_motor(degree));
        add(None, ReadAs::MotorTurns, "turns of the motor", of_motor(TAU));
    }
    all
}

/// Corrections of angle and torque at once.
pub(super) fn unit_pairs(question: &Question) -> Vec<Correction> {
    let pair = |angle: Correction| {
        let torque = millinewton_metres();
        Correction {
            name: "units",
            joint: angle.joint,
            words: format!("{}, and {}", angle.words, torque.words),
            reads: [angle.reads, torque.reads].concat(),
            apply: Box::new(move |angles: &mut [f64], torques: &mut [f64]| {
                (angle.apply)(angles, torques);
                (torque.apply)(angles, torques);
            }) as Change,
        }
    };
    angle_units(question).into_iter().map(pair).collect()
}

/// All single corrections of units, signs and columns; the simpler first.
pub(super) fn corrections(question: &Question) -> Vec<Correction> {
    let chosen = |joint: Option<usize>, at: usize| joint.is_none_or(|joint| joint == at);
    let joints = question.joints();
    let mut all = vec![millinewton_metres()];
    for joint in subjects(joints) {
        all.push(Correction {
            name: "torque_sign",
            joint,
            words: format!("torque of {} negated", joint_words(joint)),
            reads: Vec::new(),
            apply: Box::new(move |_, torques| {
                let each = torques.iter_mut().enumerate();
                each.filter(|(at, _)| chosen(joint, *at)).for_each(|(_, torque)| *torque = -*torque);
            }),
        });
    }
    all.extend(angle_units(question));
    for one in 0..joints {
        for other in one + 1..joints {
            for (what, of_angles, of_torques) in [
                ("torques of joints", false, true),
                ("angles of joints", true, false),
                ("joints", true, true),
            ] {
                all.push(Correction {
                    name: "joints_swapped",
                    joint: None,
                    words: format!("{what} {} and {} exchanged", one + 1, other + 1),
                    reads: Vec::new(),
                    apply: Box::new(move |angles, torques| {
                        if of_angles {
                            angles.swap(one, other);
                        }
                        if of_torques {
                            torques.swap(one, other);
                        }
                    }),
                });
            }
        }
    }
    for joint in (0..joints).filter(|_| joints > 1) {
        all.push(Correction {
            name: "angle_sign",
            joint: Some(joint),
            words: format!("angle of joint {} negated", joint + 1),
            reads: Vec::new(),
            apply: Box::new(move |angles, _| angles[joint] = -angles[joint]),
        });
        all.push(Correction {
            name: "direction",
            joint: Some(joint),
            words: format!("angle and torque of joint {} with the other sign", joint + 1),
            reads: Vec::new(),
            apply: Box::new(move |angles, torques| {
                angles[joint] = -angles[joint];
                torques[joint] = -torques[joint];
            }),
        });
    }
    all
}
