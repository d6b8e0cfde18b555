//! Exports a stored model as a robot description (URDF) for MuJoCo, Gazebo, Pinocchio and others.
//!
//! Why: an identified leg is simulated and planned for in other software. A robot description needs complete
//! bodies, but torque determines only sums of their parameters. Each link therefore states in a comment which
//! numbers were identified, which only in sums, and which come from the prior. Inconsistent bodies are
//! refused, not repaired.
//!
//! ```text
//! parent to joint: xyz = (a, -d sin alpha, d cos alpha), R = Rx(alpha) Rz(zero offset)   D-H at flexion 0
//! axis = (0, 0, direction)                                                 angles are anatomical
//! link frame = D-H frame of the joint;  inertial origin = h / m, axes along the link's
//! ixx ixy ixz iyy iyz izz = elements of the tensor about the centre of mass, ixy = - integral of x y dm
//! ```
//!
//! The root is `world` with gravity along -z, as usual in these programs; a fixed joint rotates it to the
//! leg's base. Values that the format lacks are written as comments: rotor inertia at the joint (MuJoCo: the
//! joint's `armature`; Pinocchio: `model.armature`; Drake: its reflected inertia) and the torque offset. A
//! friction coefficient identified below zero, within its sigma, is written as 0.
//!
//! Limits: no geometry, transmission or contact. Each program applies its own meaning of `friction` to
//! Coulomb friction.

use std::borrow::Cow;
use std::io;

use nalgebra::{Rotation3, Vector3};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use scarab::model::inertia::inertial;
use scarab::model::{JointParameters, Parameter, RigidBody, is_physically_consistent};
use scarab_base::error::ToolError;

use crate::formats::model_file::{ModelFile, StoredJoint};

/// Largest distance between the full parameters and an identified sum, in sigma.
const LARGEST_DEVIATION: f64 = 1.0;
/// Name of the root link, in which gravity is along -z.
const ROOT: &str = "world";
/// Name of the leg's base frame.
const BASE: &str = "base";

/// Robot description of a model; `file` is its name in error messages.
///
/// # Errors
/// [`ToolError::Refused`] if a link's parameters are unknown, inconsistent, or contradict the
/// identified sums.
pub fn text(model: &ModelFile, file: &str) -> Result<String, ToolError> {
    let refused = |reason: String| ToolError::Refused(format!("{file}: not exported: {reason}"));
    let mut links = Vec::new();
    for (number, joint) in model.leg.joints.iter().enumerate() {
        links.push(Link::new(model, number, joint).map_err(refused)?);
    }
    full_set_gives_the_base_set(model).map_err(refused)?;
    write(model, &links)
        .map_err(|error| ToolError::input(format!("{file}: no robot description can be written: {error}")))
}

/// One joint and the body beyond it.
struct Link<'a> {
    joint: &'a StoredJoint,
    parameters: JointParameters<f64>,
    body: RigidBody<f64>,
    /// Whether the constant column is a difference of friction between the directions.
    is_asymmetric: bool,
    /// Springs and friction by load, which a robot description cannot state.
    additional: String,
    /// Names of parameters by their status.
    standing: String,
}

impl<'a> Link<'a> {
    fn new(model: &ModelFile, number: usize, joint: &'a StoredJoint) -> Result<Self, String> {
        let name = &joint.name;
        let parameters = model.joint_parameters(number).ok_or_else(|| {
            format!(
                "a parameter of joint `{name}` is unknown: without a prior torque determines only sums, not bodies"
            )
        })?;
        let ten = inertial(&parameters);
        let body = RigidBody::from_parameters(&ten).filter(|_| is_physically_consistent(&ten));
        let body = body.ok_or_else(|| {
            format!(
                "no body can have the ten inertial parameters of joint `{name}` (mass {} kg): where torque determines only \
                 sums, the prior's share does not fit",
                parameters[Parameter::M.index()]
            )
        })?;
        let of = |status: &[&str]| -> String {
            let names: Vec<_> = model
                .full_set
                .parameters
                .iter()
                .filter(|parameter| model.parameter(&parameter.name).is_some_and(|(own, _)| own == number))
                .filter(|parameter| status.contains(&parameter.status.as_str()))
                .map(|parameter| parameter.name.as_str())
                .collect();
            if names.is_empty() { "none".to_owned() } else { names.join(" ") }
        };
        let standing = format!(
            "measured: {}; measured weakly: {}; measured in sums only, split by the prior: {}; the prior's, without effect \
             on torque: {}",
            of(&["identified"]),
            of(&["weak"]),
            of(&["grouped"]),
            of(&["prior"])
        );
        let is_asymmetric = model.full_set.parameters.iter().any(|parameter| {
            ModelFile::is_asymmetry(&parameter.name)
                && model.parameter(&parameter.name).is_some_and(|(own, _)| own == number)
        });
        let torques = model.base_set.additional_torque.iter().filter(|torque| torque.joint == number + 1);
        let words = torques
            .map(|torque| format!(", and for {}: {}", torque.kind.name().replace('_', " "), torque.words()));
        let additional = words.collect();
        Ok(Self { joint, parameters, body, is_asymmetric, additional, standing })
    }

    /// Describes the constant column.
    fn constant(&self) -> String {
        let (level, half) = (self.parameter(Parameter::FC), self.parameter(Parameter::OFF));
        if self.is_asymmetric {
            let (forward, backward) = (level + half, level - half);
            format!(
                "Coulomb friction that differs between the directions: {forward} N m while the D-H angle grows, {backward} N m \
                 while it falls; friction is their mean"
            )
        } else {
            format!("the torque offset along the D-H angle, {half} N m")
        }
    }

    fn parameter(&self, parameter: Parameter) -> f64 {
        self.parameters[parameter.index()]
    }
}

/// Checks that the bodies reproduce the identified base set; otherwise they belong to another leg.
fn full_set_gives_the_base_set(model: &ModelFile) -> Result<(), String> {
    for base in &model.base_set.parameters {
        let known = |name: &str| {
            // The offset of the full set contains it.
            if model.is_rest(name) {
                return Some(0.0);
            }
            let (joint, parameter) = model.parameter(name)?;
            Some(model.joint_parameters(joint)?[parameter.index()])
        };
        let sum: Option<f64> =
            base.terms.iter().map(|(name, factor)| known(name).map(|value| factor * value)).sum();
        let deviation = sum.map_or(f64::NAN, |sum| (sum - base.value) / base.sigma);
        if !(deviation.abs() <= LARGEST_DEVIATION) {
            return Err(format!(
                "the bodies' {} is {deviation:+.1} sigma from the identified value: the file contradicts itself",
                base.name
            ));
        }
    }
    Ok(())
}

type Xml = Writer<Vec<u8>>;

fn write(model: &ModelFile, links: &[Link<'_>]) -> io::Result<String> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("utf-8"), None)))?;
    let mut robot = BytesStart::new("robot");
    robot.push_attribute(("name", model.leg.name.as_str()));
    xml.write_event(Event::Start(robot))?;
    comment(
        &mut xml,
        &format!(
            "identified {} by Scarab {}, fingerprint {}; SI units; angles are anatomical, flexion positive; inertias are \
             tensor elements about the centre of mass (ixy is minus the integral of x y dm)",
            model.created, model.scarab, model.fingerprint
        ),
    )?;
    base(&mut xml, &Vector3::from(model.leg.gravity))?;
    let mut parent = BASE.to_owned();
    for link in links {
        let child = format!("{}_link", link.joint.name);
        joint(&mut xml, link, &parent, &child)?;
        body(&mut xml, link, &child)?;
        parent = child;
    }
    xml.write_event(Event::End(BytesEnd::new("robot")))?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    String::from_utf8(bytes).map_err(io::Error::other)
}

/// Writes the root, and the leg's base rotated so that gravity points along -z of the root.
fn base(xml: &mut Xml, gravity: &Vector3<f64>) -> io::Result<()> {
    let turn = Rotation3::rotation_between(gravity, &-Vector3::z())
        // Opposite directions: any half turn about a horizontal axis.
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), core::f64::consts::PI));
    empty(xml, "link", &[("name", ROOT.into())])?;
    inside(xml, "joint", &[("name", "scarab_mount".into()), ("type", "fixed".into())], |xml| {
        empty(xml, "parent", &[("link", ROOT.into())])?;
        empty(xml, "child", &[("link", BASE.into())])?;
        origin(xml, &Vector3::zeros(), &turn)
    })?;
    empty(xml, "link", &[("name", BASE.into())])
}

fn joint(xml: &mut Xml, link: &Link<'_>, parent: &str, child: &str) -> io::Result<()> {
    let stored = link.joint;
    let (sine, cosine) = stored.dh.twist().sin_cos();
    let position = Vector3::new(stored.dh.a, -stored.dh.d * sine, stored.dh.d * cosine);
    let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), stored.dh.twist())
        * Rotation3::from_axis_angle(&Vector3::z_axis(), stored.zero_offset_deg.to_radians());
    comment(
        xml,
        &format!(
            "no place in this format for the rotor inertia at the joint, {} kg m2 (MuJoCo, Pinocchio: armature), and for \
             {}{}",
            link.parameter(Parameter::IA),
            link.constant(),
            link.additional
        ),
    )?;
    inside(xml, "joint", &[("name", stored.name.as_str().into()), ("type", "revolute".into())], |xml| {
        empty(xml, "parent", &[("link", parent.into())])?;
        empty(xml, "child", &[("link", child.into())])?;
        origin(xml, &position, &turn)?;
        empty(xml, "axis", &[("xyz", format!("0 0 {}", stored.direction).into())])?;
        let [lower, upper] = stored.range_deg.map(|end| number(end.to_radians()));
        empty(
            xml,
            "limit",
            &[
                ("lower", lower),
                ("upper", upper),
                ("effort", number(stored.torque_limit_nm)),
                ("velocity", number(stored.speed_limit_deg_s.to_radians())),
            ],
        )?;
        let friction = |parameter| number(link.parameter(parameter).max(0.0));
        empty(xml, "dynamics", &[("damping", friction(Parameter::FV)), ("friction", friction(Parameter::FC))])
    })
}

fn body(xml: &mut Xml, link: &Link<'_>, name: &str) -> io::Result<()> {
    inside(xml, "link", &[("name", name.into())], |xml| {
        comment(xml, &link.standing)?;
        inside(xml, "inertial", &[], |xml| {
            origin(xml, &link.body.centre_of_mass, &Rotation3::identity())?;
            empty(xml, "mass", &[("value", number(link.body.mass))])?;
            let tensor = &link.body.inertia;
            empty(
                xml,
                "inertia",
                &[
                    ("ixx", number(tensor.m11)),
                    ("ixy", number(tensor.m12)),
                    ("ixz", number(tensor.m13)),
                    ("iyy", number(tensor.m22)),
                    ("iyz", number(tensor.m23)),
                    ("izz", number(tensor.m33)),
                ],
            )
        })
    })
}

fn origin(xml: &mut Xml, position: &Vector3<f64>, turn: &Rotation3<f64>) -> io::Result<()> {
    let (roll, pitch, yaw) = turn.euler_angles();
    let triple = |numbers: [f64; 3]| numbers.map(number).join(" ").into();
    empty(
        xml,
        "origin",
        &[("xyz", triple([position.x, position.y, position.z])), ("rpy", triple([roll, pitch, yaw]))],
    )
}

type Attribute<'a> = (&'a str, Cow<'a, str>);

/// Formats with the digits that restore the f64 exactly; adding 0 turns -0 into 0.
fn number(number: f64) -> Cow<'static, str> {
    (number + 0.0).to_string().into()
}

fn element<'a>(name: &'a str, attributes: &[Attribute<'_>]) -> BytesStart<'a> {
    let mut element = BytesStart::new(name);
    for (key, value) in attributes {
        element.push_attribute((*key, value.as_ref()));
    }
    element
}

fn empty(xml: &mut Xml, name: &str, attributes: &[Attribute<'_>]) -> io::Result<()> {
    xml.write_event(Event::Empty(element(name, attributes)))
}

fn inside(
    xml: &mut Xml,
    name: &str,
    attributes: &[Attribute<'_>],
    content: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    xml.write_event(Event::Start(element(name, attributes)))?;
    content(xml)?;
    xml.write_event(Event::End(BytesEnd::new(name)))
}

/// Writes a comment of words, numbers and parameter names; user text, which might end the comment,
/// must not occur.
fn comment(xml: &mut Xml, text: &str) -> io::Result<()> {
    xml.write_event(Event::Comment(BytesText::from_escaped(format!(" {text} "))))
}
