//! Robot descriptions (URDF) of others: links and joints as one tree, checked.
//!
//! Why an own tree: `urdf-rs` replaces a missing `inertial` or `limit` by zeros and names no line. Here a
//! value is either stated or absent, and every error names file, line, element and what to do.
//!
//! ```text
//! <joint> origin: xyz, rpy; axis (1, 0, 0) unless stated; R = Rz(yaw) Ry(pitch) Rx(roll)
//! <link> inertial: origin (centre of mass, axes of the tensor), mass, ixx ixy ixz iyy iyz izz
//! ```
//!
//! Source: wiki.ros.org/urdf/XML. Geometry, colours, transmissions and unknown elements are ignored.
//! Document types, and thus entities, are refused. Cost: linear in the size of the text.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use scarab_base::error::FileError;

/// Largest accepted text, bytes.
const LARGEST_TEXT: usize = 16 << 20;
/// Most elements, comments and texts.
const MOST_NODES: u32 = 1_000_000;
/// Largest magnitude of a number, in any unit of the format.
const LARGEST_NUMBER: f64 = 1e6;
/// Kinds of joints in the format.
const KINDS: [(&str, Kind); 6] = [
    ("revolute", Kind::Revolute),
    ("continuous", Kind::Continuous),
    ("prismatic", Kind::Prismatic),
    ("fixed", Kind::Fixed),
    ("floating", Kind::Floating),
    ("planar", Kind::Planar),
];

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Turns between limits.
    Revolute,
    /// Turns without limits.
    Continuous,
    /// Slides.
    Prismatic,
    /// Does not move.
    Fixed,
    /// Moves freely.
    Floating,
    /// Moves in a plane.
    Planar,
}

impl Kind {
    /// Word of the format.
    pub(crate) fn word(self) -> &'static str {
        KINDS.iter().find(|(_, kind)| *kind == self).map_or("unknown", |(word, _)| word)
    }

    /// Whether the joint turns about an axis.
    pub(crate) fn turns(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous)
    }
}

/// Mass of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Inertial {
    /// Centre of mass and axes of the tensor in the link's frame, m.
    pub(crate) origin: Isometry3<f64>,
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Tensor elements about the centre of mass, kg m^2.
    pub(crate) tensor: Matrix3<f64>,
}

/// Link of a robot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) inertial: Option<Inertial>,
}

/// Stated limits of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Limit {
    /// Range, rad or m; 0 if not stated.
    pub(crate) range: [f64; 2],
    /// Largest torque or force, N m or N.
    pub(crate) effort: Option<f64>,
    /// Largest speed, rad/s or m/s.
    pub(crate) velocity: Option<f64>,
}

/// Joint of a robot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    /// Number of the link before it.
    pub(crate) parent: usize,
    /// Number of the link that it moves.
    pub(crate) child: usize,
    /// Child's frame in the parent's at position 0, m.
    pub(crate) origin: Isometry3<f64>,
    /// Axis in the child's frame.
    pub(crate) axis: Unit<Vector3<f64>>,
    pub(crate) limit: Option<Limit>,
    /// Viscous friction, N m s/rad, if stated.
    pub(crate) damping: Option<f64>,
    /// Coulomb friction, N m, if stated.
    pub(crate) friction: Option<f64>,
    /// Whether the joint follows another one.
    pub(crate) is_mimic: bool,
    /// Line of its element.
    pub(crate) line: usize,
}

/// Tree of links and joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Path in error messages.
    pub(crate) file: String,
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    /// Joints, each after the joints before it in the tree.
    pub(crate) joints: Vec<Joint>,
    /// Number of the link that no joint moves.
    pub(crate) root: usize,
}

impl Robot {
    /// Parses a description; `file` is its name in error messages.
    ///
    /// # Errors
    /// Broken XML, a document type, an unexpanded xacro file, a missing or impossible value, links that are
    /// not one tree.
    pub fn parse(text: &str, file: &str) -> Result<Self, FileError> {
        if text.len() > LARGEST_TEXT {
            let reason = format!("has {} bytes, at most {LARGEST_TEXT} are read", text.len());
            return Err(FileError::new(file, reason));
        }
        let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options).map_err(|error| broken(file, &error))?;
        let newlines =
            text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at).collect();
        Reader { file, document: &document, newlines }.robot()
    }

    /// Error about a joint.
    pub(crate) fn joint_error(&self, joint: &Joint, reason: &str) -> FileError {
        let reason = format!("joint `{}`: {reason}", joint.name);
        FileError { file: self.file.clone(), line: Some(joint.line), reason }
    }

    /// Error about the whole file.
    pub fn error(&self, reason: impl std::fmt::Display) -> FileError {
        FileError::new(&self.file, reason)
    }
}

/// Error of a text that is not XML, or that carries more than XML elements.
fn broken(file: &str, error: &roxmltree::Error) -> FileError {
    let reason = match error {
        roxmltree::Error::DtdDetected => {
            "has a document type (`<!DOCTYPE`): entities are not expanded; remove it, \
                                          a robot description needs none"
                .to_owned()
        }
        roxmltree::Error::NodesLimitReached => format!("has more than {MOST_NODES} elements"),
        roxmltree::Error::NoRootNode => {
            "is empty: a robot description begins with `<robot name=\"..\">`".to_owned()
        }
        _ => format!("is not XML: {error}"),
    };
    let line = error.pos().row as usize;
    // These errors have no position of their own.
    let has_line = !matches!(
        error,
        roxmltree::Error::DtdDetected
            | roxmltree::Error::NodesLimitReached
            | roxmltree::Error::NoRootNode
            | roxmltree::Error::UnclosedRootNode
            | roxmltree::Error::UnexpectedEndOfStream
    );
    FileError { file: file.to_owned(), line: has_line.then_some(line), reason }
}

/// Element with its name in error messages: "joint `knee`".
#[derive(Clone, Copy)]
struct Named<'a, 'i> {
    node: Node<'a, 'i>,
    kind: &'static str,
    name: &'a str,
}

struct Reader<'a, 'i> {
    file: &'a str,
    document: &'a Document<'i>,
    /// Bytes at which lines end. The document would count them again for each element.
    newlines: Vec<usize>,
}

impl<'a, 'i> Reader<'a, 'i> {
    fn line(&self, node: Node<'_, '_>) -> usize {
        1 + self.newlines.partition_point(|end| *end < node.range().start)
    }

    fn at(&self, node: Node<'_, '_>, reason: String) -> FileError {
        FileError { file: self.file.to_owned(), line: Some(self.line(node)), reason }
    }

    fn wrong(&self, of: Named<'_, '_>, node: Node<'_, '_>, reason: &str) -> FileError {
        self.at(node, format!("{} `{}`: {reason}", of.kind, of.name))
    }

    fn robot(&self) -> Result<Robot, FileError> {
        let root = self.document.root_element();
        if root.tag_name().name() != "robot" {
            let reason = format!(
                "the first element is `{}`; a robot description (URDF) has `robot`",
                root.tag_name().name()
            );
            return Err(self.at(root, reason));
        }
        let of_xacro = |node: &Node<'_, '_>| {
            node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
                || node.attributes().any(|attribute| attribute.value().contains("${"))
        };
        if let Some(node) = root.descendants().find(of_xacro) {
            let reason = format!(
                "`{}` is a macro of xacro: expand the file first (`xacro FILE > robot.urdf`)",
                node.tag_name().name()
            );
            return Err(self.at(node, reason));
        }
        let mut links = Vec::new();
        let mut numbers = HashMap::new();
        for node in root.children().filter(|node| node.has_tag_name("link")) {
            let link = self.named(node, "link")?;
            if numbers.insert(link.name, links.len()).is_some() {
                return Err(self.wrong(link, node, "is the name of an earlier link: names must differ"));
            }
            links.push(Link { name: link.name.to_owned(), inertial: self.inertial(link)? });
        }
        let mut joints: Vec<Joint> = Vec::new();
        let mut names = HashMap::new();
        let mut mover: Vec<Option<usize>> = vec![None; links.len()];
        for node in root.children().filter(|node| node.has_tag_name("joint")) {
            let named = self.named(node, "joint")?;
            if names.insert(named.name, joints.len()).is_some() {
                return Err(self.wrong(named, node, "is the name of an earlier joint: names must differ"));
            }
            let joint = self.joint(named, &numbers)?;
            if let Some(other) = mover[joint.child] {
                let reason = format!(
                    "moves link `{}`, which joint `{}` moves already: closed chains are not supported, one of the joints \
                     must go",
                    links[joint.child].name, joints[other].name
                );
                return Err(self.wrong(named, node, &reason));
            }
            mover[joint.child] = Some(joints.len());
            joints.push(joint);
        }
        let (root, joints) = self.tree(&links, joints, &mover)?;
        let name = self.document.root_element().attribute("name").unwrap_or("robot");
        Ok(Robot { file: self.file.to_owned(), name: name.to_owned(), links, joints, root })
    }

    /// Root link, and the joints from the root outwards.
    fn tree(
        &self,
        links: &[Link],
        joints: Vec<Joint>,
        mover: &[Option<usize>],
    ) -> Result<(usize, Vec<Joint>), FileError> {
        let roots: Vec<usize> = (0..links.len()).filter(|link| mover[*link].is_none()).collect();
        let root = match roots[..] {
            [root] => root,
            [] if links.is_empty() => return Err(FileError::new(self.file, "has no `link`")),
            [] => {
                return Err(FileError::new(
                    self.file,
                    "every link is moved by a joint: the links form a circle; one link must be the root",
                ));
            }
            _ => {
                let names: Vec<_> =
                    roots.iter().take(5).map(|link| format!("`{}`", links[*link].name)).collect();
                let reason = format!(
                    "{} links are moved by no joint ({}): only the root may be; name each other one as a joint's child",
                    roots.len(),
                    names.join(", ")
                );
                return Err(FileError::new(self.file, reason));
            }
        };
        let mut behind: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
        for (number, joint) in joints.iter().enumerate() {
            behind[joint.parent].push(number);
        }
        let mut order = Vec::with_capacity(joints.len());
        let mut open = vec![root];
        while let Some(link) = open.pop() {
            for joint in &behind[link] {
                order.push(*joint);
                open.push(joints[*joint].child);
            }
        }
        let mut is_reached = vec![false; joints.len()];
        order.iter().for_each(|number| is_reached[*number] = true);
        if let Some(lost) = is_reached.iter().position(|reached| !reached) {
            let joint = &joints[lost];
            let reason =
                format!("joint `{}`: no chain leads to it from the root `{}`", joint.name, links[root].name);
            return Err(FileError { file: self.file.to_owned(), line: Some(joint.line), reason });
        }
        let mut joints: Vec<Option<Joint>> = joints.into_iter().map(Some).collect();
        let sorted = order.into_iter().filter_map(|number| joints[number].take()).collect();
        Ok((root, sorted))
    }

    /// Element with its own name.
    fn named(&self, node: Node<'a, 'i>, kind: &'static str) -> Result<Named<'a, 'i>, FileError> {
        match node.attribute("name") {
            Some(name) if !name.trim().is_empty() => Ok(Named { node, kind, name }),
            _ => Err(self.at(node, format!("a `{kind}` has no `name`"))),
        }
    }

    /// Child element, at most one of its name.
    fn child(&self, of: Named<'a, 'i>, name: &'static str) -> Result<Option<Node<'a, 'i>>, FileError> {
        let mut found = of.node.children().filter(|node| node.has_tag_name(name));
        let first = found.next();
        match found.next() {
            Some(second) => Err(self.wrong(of, second, &format!("has two `{name}`: remove one"))),
            None => Ok(first),
        }
    }

    fn attribute(&self, of: Named<'_, '_>, node: Node<'a, 'i>, key: &str) -> Result<Option<f64>, FileError> {
        let Some(text) = node.attribute(key) else { return Ok(None) };
        let [value] = self.numbers(of, node, key, text)?;
        Ok(Some(value))
    }

    fn required(&self, of: Named<'_, '_>, node: Node<'a, 'i>, key: &str) -> Result<f64, FileError> {
        self.attribute(of, node, key)?.ok_or_else(|| {
            self.wrong(of, node, &format!("`{}` has no `{key}`: state it", node.tag_name().name()))
        })
    }

    fn numbers<const N: usize>(
        &self,
        of: Named<'_, '_>,
        node: Node<'_, '_>,
        key: &str,
        text: &str,
    ) -> Result<[f64; N], FileError> {
        let element = node.tag_name().name();
        let mut values = [0.0; N];
        let mut words = text.split_whitespace();
        for slot in &mut values {
            let word = words.next().unwrap_or("");
            *slot = match word.parse::<f64>() {
                Ok(value) if value.abs() <= LARGEST_NUMBER => value,
                Ok(value) => {
                    let reason = format!("`{key}` of `{element}` is {value}, outside -1e6..1e6");
                    return Err(self.wrong(of, node, &reason));
                }
                Err(_) => return Err(self.wrong(of, node, &not_numbers(key, element, text, N))),
            };
        }
        if words.next().is_some() {
            return Err(self.wrong(of, node, &not_numbers(key, element, text, N)));
        }
        Ok(values)
    }

    /// Pose of an `origin`; without one the identity.
    fn origin(&self, of: Named<'a, 'i>, inside: Named<'a, 'i>) -> Result<Isometry3<f64>, FileError> {
        let inner = Named { kind: of.kind, name: of.name, ..inside };
        let Some(node) = self.child(inner, "origin")? else { return Ok(Isometry3::identity()) };
        let three = |key| match node.attribute(key) {
            Some(text) => self.numbers(of, node, key, text),
            None => Ok([0.0; 3]),
        };
        let ([x, y, z], [roll, pitch, yaw]) = (three("xyz")?, three("rpy")?);
        Ok(Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }

    fn inertial(&self, link: Named<'a, 'i>) -> Result<Option<Inertial>, FileError> {
        let Some(node) = self.child(link, "inertial")? else { return Ok(None) };
        let inside = Named { node, ..link };
        let origin = self.origin(link, inside)?;
        let needed = |name| {
            self.child(inside, name)?.ok_or_else(|| {
                self.wrong(link, node, &format!("`inertial` has no `{name}`: state it, or remove `inertial`"))
            })
        };
        let (weight, inertia) = (needed("mass")?, needed("inertia")?);
        let mass = self.required(link, weight, "value")?;
        if mass < 0.0 {
            return Err(self.wrong(link, weight, &format!("`mass` is {mass} kg; it must not be negative")));
        }
        let element = |key| self.required(link, inertia, key);
        let (xx, xy, xz) = (element("ixx")?, element("ixy")?, element("ixz")?);
        let (yy, yz, zz) = (element("iyy")?, element("iyz")?, element("izz")?);
        Ok(Some(Inertial { origin, mass, tensor: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) }))
    }

    fn joint(&self, of: Named<'a, 'i>, links: &HashMap<&str, usize>) -> Result<Joint, FileError> {
        let word = of.node.attribute("type").unwrap_or("");
        let Some((_, kind)) = KINDS.iter().find(|(known, _)| *known == word) else {
            let known = KINDS.map(|(word, _)| word).join(", ");
            return Err(self.wrong(of, of.node, &format!("`type` is `{word}`, not one of {known}")));
        };
        let link = |key: &'static str| {
            let Some(node) = self.child(of, key)? else {
                return Err(self.wrong(of, of.node, &format!("has no `{key}`: name a link")));
            };
            let name = node.attribute("link").unwrap_or("");
            let number = links.get(name).copied();
            number.ok_or_else(|| {
                self.wrong(of, node, &format!("`{key}` is `{name}`, which is no link of this file"))
            })
        };
        let (parent, child) = (link("parent")?, link("child")?);
        if parent == child {
            return Err(self.wrong(of, of.node, "parent and child are the same link"));
        }
        // Many robots state an axis of length 0 where it has no meaning.
        let has_axis = !matches!(kind, Kind::Fixed | Kind::Floating);
        let axis = match self.child(of, "axis")? {
            Some(node) if has_axis => {
                let text = node.attribute("xyz").unwrap_or("");
                let axis = Vector3::from(self.numbers::<3>(of, node, "xyz", text)?);
                // Shorter, its direction would be rounding.
                Unit::try_new(axis, 1e-6)
                    .ok_or_else(|| self.wrong(of, node, "`axis` has no direction: its length is 0"))?
            }
            _ => Vector3::x_axis(),
        };
        let limit = match self.child(of, "limit")? {
            Some(node) => {
                let number = |key| self.attribute(of, node, key);
                let range = [number("lower")?.unwrap_or(0.0), number("upper")?.unwrap_or(0.0)];
                Some(Limit { range, effort: number("effort")?, velocity: number("velocity")? })
            }
            None => None,
        };
        let (damping, friction) = match self.child(of, "dynamics")? {
            Some(node) => (self.attribute(of, node, "damping")?, self.attribute(of, node, "friction")?),
            None => (None, None),
        };
        Ok(Joint {
            name: of.name.to_owned(),
            kind: *kind,
            parent,
            child,
            origin: self.origin(of, of)?,
            axis,
            limit,
            damping,
            friction,
            is_mimic: self.child(of, "mimic")?.is_some(),
            line: self.line(of.node),
        })
    }
}

fn not_numbers(key: &str, element: &str, text: &str, count: usize) -> String {
    let shown: String = text.chars().take(60).collect();
    let needed = if count == 1 { "one number".to_owned() } else { format!("{count} numbers") };
    format!("`{key}` of `{element}` is `{shown}`, not {needed}")
}
