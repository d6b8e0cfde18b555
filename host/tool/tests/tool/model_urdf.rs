//! Robot descriptions from models: read by another library, and moved by other equations.
#![expect(clippy::disallowed_methods, reason = "runs on the host only and may use std's mathematics")]

use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::formats::robot::Robot;
use scarab_identify::formats::urdf::text;
use scarab_identify::leg::from_robot;
use scarab_identify::leg::setup::{links, row_model};
use scarab_identify::run::predict::Predictor;

use crate::command::{Folder, assert_contains};
use crate::robots::{self, State};
use hal_sim::description::{BodyDescription, DenavitHartenberg, LegDescription};
use hal_sim::mechanism::Mechanism;
use nalgebra::{Matrix3, Rotation3, Vector3};
use scarab::ident::prior_parameters;
use scarab::model::{JointState, Parameter};

/// Leg with one link outside the plane and one joint zero offset.
fn skewed(name: &str) -> LegFile {
    let mut leg = LegFile::load(name).expect("shipped");
    for joint in &mut leg.joints {
        joint.prior = joint.truth;
    }
    // Away from its reference pose, with a link outside the plane.
    let last = leg.joints.last_mut().expect("joints");
    last.zero_offset_deg = 10.0;
    if let Some(truth) = &mut last.truth {
        truth.com[2] = 0.03;
        truth.inertia_com[2] = 0.002;
        truth.inertia_com[4] = -0.001;
    }
    last.prior = last.truth;
    leg
}

/// Model of an identification of this leg.
fn identified(folder: &Folder, leg: &LegFile) -> ModelFile {
    folder.write("leg.toml", leg.to_toml());
    folder.scarab("identify --leg @leg.toml --save-model @model.toml").ends_with(0);
    ModelFile::load(&folder.path("model.toml")).expect("just written")
}

/// Model of that leg with its true bodies, independent of any identification.
fn true_model<const N: usize, const B: usize>(folder: &Folder, name: &str) -> ModelFile {
    let leg = skewed(name);
    let mut model = identified(folder, &leg);
    let truth = prior_parameters(&links::<N>(&leg, |joint| joint.truth.as_ref()).expect("simulated"));
    for (parameter, value) in model.full_set.parameters.iter_mut().zip(truth.as_flattened()) {
        parameter.value = Some(*value);
    }
    let rows = row_model::<N, B>(&leg).expect("a base set");
    for (base, value) in model.base_set.parameters.iter_mut().zip(rows.base.project(&truth)) {
        base.value = value;
    }
    model
}

/// Leg identified with its truth as prior, so that every body is physically consistent; model and
/// robot description.
fn exported(folder: &Folder, name: &str) -> (ModelFile, String) {
    let model = identified(folder, &skewed(name));
    let run = folder.scarab("export --model @model.toml --urdf @leg.urdf").ends_with(0);
    assert_eq!(run.printed, format!("robot description: {}\n", folder.path("leg.urdf").display()));
    (model, folder.read("leg.urdf"))
}

fn turn(rpy: &[f64; 3]) -> Matrix3<f64> {
    // Definition of the format: rotations about the fixed axes x, y, z in this order.
    let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle).into_inner();
    about(Vector3::z_axis(), rpy[2]) * about(Vector3::y_axis(), rpy[1]) * about(Vector3::x_axis(), rpy[0])
}

/// Ten parameters about the joint's axis from a link's inertial element, each by its definition.
fn about_joint(inertial: &urdf_rs::Inertial) -> [f64; 10] {
    let (mass, c, inertia) = (inertial.mass.value, inertial.origin.xyz.0, &inertial.inertia);
    [
        inertia.ixx + mass * (c[1] * c[1] + c[2] * c[2]),
        inertia.ixy - mass * c[0] * c[1],
        inertia.ixz - mass * c[0] * c[2],
        inertia.iyy + mass * (c[0] * c[0] + c[2] * c[2]),
        inertia.iyz - mass * c[1] * c[2],
        inertia.izz + mass * (c[0] * c[0] + c[1] * c[1]),
        mass * c[0],
        mass * c[1],
        mass * c[2],
        mass,
    ]
}

/// Bodies for the plant's equations with the description's numbers, without rotors and friction.
fn described<const N: usize>(robot: &urdf_rs::Robot, leg: &LegFile) -> LegDescription<N> {
    let mount = turn(&robot.joints[0].origin.rpy.0);
    let mut described = leg.description::<N>().expect("simulated");
    described.gravity = (mount.transpose() * Vector3::new(0.0, 0.0, -9.81)).into();
    for (target, joint) in described.joints.iter_mut().zip(&robot.joints[1..]) {
        let link = robot.links.iter().find(|link| link.name == joint.child.link).expect("the child");
        let [x, y, z] = joint.origin.xyz.0;
        // R = Rx(alpha) Rz(zero): its third column is (0, -sin alpha, cos alpha), its first row
        // (cos zero, -sin zero, 0).
        let turn = turn(&joint.origin.rpy.0);
        let (sine, cosine) = (-turn[(1, 2)], turn[(2, 2)]);
        target.frame = DenavitHartenberg { alpha: sine.atan2(cosine), a: x, d: cosine * z - sine * y };
        target.direction = joint.axis.xyz.0[2];
        target.zero_offset = (-turn[(0, 1)]).atan2(turn[(0, 0)]);
        let inertia = &link.inertial.inertia;
        target.body = BodyDescription {
            mass: link.inertial.mass.value,
            com: link.inertial.origin.xyz.0,
            inertia_com: [inertia.ixx, inertia.ixy, inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz],
        };
        target.rotor_inertia = 0.0;
    }
    described
}

/// Checks the description's bodies, friction and limits against those of the model.
fn has_bodies_friction_and_limits(robot: &urdf_rs::Robot, model: &ModelFile) {
    let name = &robot.name;
    for (number, stored) in model.leg.joints.iter().enumerate() {
        let parameters = model.joint_parameters(number).expect("with a prior");
        let joint = &robot.joints[number + 1];
        let link = robot.links.iter().find(|link| link.name == joint.child.link).expect("the child");
        for (found, expected) in about_joint(&link.inertial).iter().zip(&parameters) {
            // Converted by the parallel-axis theorem and back: rounding of numbers up to 10.
            assert!((found - expected).abs() < 1e-13, "{name} joint {number}: {found} against {expected}");
        }
        let dynamics = joint.dynamics.as_ref().expect("friction");
        assert_eq!(dynamics.damping, parameters[Parameter::FV.index()]);
        assert_eq!(dynamics.friction, parameters[Parameter::FC.index()]);
        assert_eq!(
            [joint.limit.lower, joint.limit.upper].map(f64::to_degrees).map(f64::round),
            stored.range_deg.map(f64::round)
        );
        assert_eq!(joint.limit.effort, stored.torque_limit_nm);
    }
}

fn checks<const N: usize, const B: usize>(name: &str) {
    let folder = Folder::new();
    let model = true_model::<N, B>(&folder, name);
    let text = text(&model, "model.toml").expect("physically consistent bodies");
    let robot = urdf_rs::read_from_string(&text).expect("another library reads it");
    assert_eq!((robot.name.as_str(), robot.joints.len(), robot.links.len()), (name, N + 1, N + 2));
    has_bodies_friction_and_limits(&robot, &model);

    // The plant's Lagrange equations with the description's numbers give the model's torque.
    let description = described::<N>(&robot, &skewed(name));
    for (joint, stored) in description.joints.iter().zip(&model.leg.joints) {
        assert_eq!(joint.direction, stored.direction as f64);
        // Ten degrees, converted to three angles and back.
        assert!((joint.zero_offset.to_degrees() - stored.zero_offset_deg).abs() < 1e-12);
    }
    let mechanism = Mechanism::new(&description);
    let predictor = Predictor::<N>::new(&model).expect("joints");
    let read = Robot::parse(&text, "leg.urdf").expect("a robot");
    let again = from_robot::leg(&read, &robots::plain()).expect("the leg that was exported").leg;
    for step in 0..20 {
        let wave = |joint: usize, rate: f64| (0.7 * f64::from(step) * rate + joint as f64).sin();
        let state = JointState {
            q: core::array::from_fn(|joint| 1.4 * wave(joint, 1.0)),
            qd: core::array::from_fn(|joint| 3.0 * wave(joint, 1.7)),
            qdd: core::array::from_fn(|joint| 9.0 * wave(joint, 2.3)),
        };
        let torque = mechanism.inverse_dynamics(&state.q, &state.qd, &state.qdd);
        // `leg --urdf` reads what `export` writes, in anatomical angles; the description holds no rotor.
        let joints = || description.joints.iter();
        let turned =
            |values: [f64; N]| joints().zip(values).map(|(joint, value)| joint.direction * value).collect();
        let q = joints().zip(state.q).map(|(joint, q)| joint.direction * (q - joint.zero_offset)).collect();
        let anatomical = State { q, qd: turned(state.qd), qdd: turned(state.qdd), torque: Vec::new() };
        let read = robots::torques::<N>(&again, &anatomical);
        for ((joint, read), torque) in joints().zip(&read).zip(&torque) {
            assert!((joint.direction * read - torque).abs() < 1e-9, "{name}: {read} against {torque}");
        }
        for (joint, predicted) in predictor.torques(&state).iter().enumerate() {
            let rotor = model.joint_parameters(joint).expect("with a prior")[Parameter::IA.index()];
            let whole = torque[joint] + rotor * state.qdd[joint];
            // Rounding of torques up to 300 N m, and of the base set's factors.
            assert!(
                (whole - predicted.rigid).abs() < 1e-9,
                "{name} joint {joint}: {whole} against {predicted:?}"
            );
        }
    }
}

#[test]
fn exported_bodies_of_a_planar_leg_give_the_identified_torque() {
    checks::<2, 13>("x2-wearer-75kg");
}

#[test]
fn exported_bodies_of_crossed_axes_give_the_identified_torque() {
    checks::<3, 28>("paper-chain");
}

#[test]
fn the_exported_default_leg_gives_the_identified_torque() {
    let folder = Folder::new();
    let leg = LegFile::load("x2-wearer-75kg").expect("shipped");
    let model = identified(&folder, &leg);
    folder.scarab("export --model @model.toml --urdf @leg.urdf").ends_with(0);
    let robot = urdf_rs::read_from_string(&folder.read("leg.urdf")).expect("another library reads it");
    let mechanism = Mechanism::new(&described::<2>(&robot, &leg));
    let predictor = Predictor::<2>::new(&model).expect("two joints");
    let state = JointState { q: [0.3, -0.9], qd: [0.7, -1.1], qdd: [4.0, -6.0] };
    let torque = mechanism.inverse_dynamics(&state.q, &state.qd, &state.qdd);
    for (joint, predicted) in predictor.torques(&state).iter().enumerate() {
        let rotor = model.joint_parameters(joint).expect("with a prior")[Parameter::IA.index()];
        // The completion reproduces the identified sums to the rounding of single precision.
        let whole = torque[joint] + rotor * state.qdd[joint];
        assert!((whole - predicted.rigid).abs() < 1e-4, "joint {joint}: {whole} against {predicted:?}");
    }
}

#[test]
fn the_description_is_well_formed_and_lists_unobservable_parameters() {
    let folder = Folder::new();
    let (model, text) = exported(&folder, "x2-wearer-75kg");
    let document = roxmltree::Document::parse(&text).expect("XML");
    let comments: Vec<&str> =
        document.descendants().filter(|node| node.is_comment()).filter_map(|node| node.text()).collect();
    let of = |status: &str, joint: char| -> Vec<&str> {
        let parameters = &model.full_set.parameters;
        let chosen = parameters.iter().filter(|one| one.status == status && one.name.ends_with(joint));
        chosen.map(|one| one.name.as_str()).collect()
    };
    for joint in ['1', '2'] {
        let unseen = format!("the prior's, without effect on torque: {}", of("prior", joint).join(" "));
        let grouped =
            format!("measured in sums only, split by the prior: {};", of("grouped", joint).join(" "));
        assert!(
            comments.iter().any(|text| text.contains(&unseen) && text.contains(&grouped)),
            "{comments:?}"
        );
    }
    assert_eq!(of("grouped", '2'), ["M2"]);
    let rotor = model.joint_parameters(1).expect("with a prior")[Parameter::IA.index()];
    assert!(comments.iter().any(|text| text.contains(&format!("rotor inertia at the joint, {rotor} kg m2"))));
    let names: Vec<_> = document
        .descendants()
        .filter(|node| node.has_tag_name("joint"))
        .filter_map(|node| node.attribute("name"))
        .collect();
    assert_eq!(names, ["scarab_mount", "hip", "knee"]);
}

#[test]
fn names_that_would_break_the_format_are_escaped() {
    let folder = Folder::new();
    let (mut model, _) = exported(&folder, "x2-wearer-75kg");
    model.leg.name = "a <leg> & \"more\" --> x".into();
    model.leg.joints[0].name = "h'ip\" <b>".into();
    let described = text(&model, "model.toml").expect("bodies that can exist");
    let document = roxmltree::Document::parse(&described).expect("XML");
    assert_eq!(document.root_element().attribute("name"), Some(model.leg.name.as_str()));
    assert!(document.descendants().any(|node| node.attribute("name") == Some("h'ip\" <b>")));
}

#[test]
fn impossible_or_unknown_bodies_are_not_exported() {
    let folder = Folder::new();
    let (model, _) = exported(&folder, "x2-wearer-75kg");
    let refusal = |change: &dyn Fn(&mut ModelFile)| {
        let mut changed = model.clone();
        change(&mut changed);
        text(&changed, "model.toml").expect_err("no body").to_string()
    };
    let index = |joint: usize, parameter: Parameter| 14 * joint + parameter.index();
    let no_body = refusal(&|model| model.full_set.parameters[index(1, Parameter::XX)].value = Some(-0.1));
    assert!(no_body.starts_with("model.toml: not exported: no body can have the ten inertial"), "{no_body}");
    let unknown = refusal(&|model| model.full_set.parameters[index(0, Parameter::M)].value = None);
    assert_contains(&unknown, "a parameter of joint `hip` is unknown");
    let contradiction = refusal(&|model| {
        let value = &mut model.full_set.parameters[index(1, Parameter::HX)].value;
        *value = value.map(|value| value + 0.01);
    });
    assert_contains(&contradiction, "the bodies' HX2 is +");

    // From the command line: without a prior no mass is known.
    folder.scarab("identify --prior none --save-model @bare.toml").ends_with(0);
    let run = folder.scarab("export --urdf @none.urdf --model @bare.toml").ends_with(3);
    run.warns("without a prior torque determines only sums");
    assert!(!folder.path("none.urdf").exists());
}
