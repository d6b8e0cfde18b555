//! Text of a new leg file: what is known, and what is not as comments.
//!
//! Why not [`LegFile::to_toml`](super::LegFile::to_toml): it writes defaults as if they were known, and an
//! image trusts what a file states.

use scarab_base::toml_file::quoted;
use std::fmt::Write;

use super::keys::{IN_PRIOR, JOINT, KeyLine, SIDE, TRUTH};
use super::{DhFile, LinkParameters};

/// What is known of a leg.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    pub name: String,
    /// Gravity's acceleration in the base frame, m/s^2.
    pub gravity: [f64; 3],
    /// Comments at the beginning of the file.
    pub remarks: Vec<String>,
    /// Joints, proximal first.
    pub joints: Vec<DraftJoint>,
}

/// What is known of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct DraftJoint {
    pub name: String,
    pub dh: DhFile,
    pub direction: i64,
    pub zero_offset_deg: f64,
    pub range_deg: Option<[f64; 2]>,
    pub speed_limit_deg_s: Option<f64>,
    pub torque_limit_nm: Option<f64>,
    pub prior: Option<DraftPrior>,
    /// Comments above the joint.
    pub remarks: Vec<String>,
}

/// Body of a joint without its rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DraftPrior {
    pub(crate) mass: f64,
    pub(crate) com: [f64; 3],
    pub(crate) inertia_com: [f64; 6],
    /// Coulomb friction, N m, if known.
    pub(crate) coulomb: Option<f64>,
    /// Viscous friction, N m s/rad, if known.
    pub(crate) viscous: Option<f64>,
}

impl Draft {
    /// TOML text.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        self.remarks.iter().for_each(|remark| comment(&mut text, remark));
        line(&mut text, "name", &quoted(&self.name), "");
        line(&mut text, "gravity", &list(&self.gravity), "acceleration in the base frame, m/s2");
        unknown(&mut text, &SIDE);
        for joint in &self.joints {
            text.push_str("\n[[joint]]\n");
            joint.write(&mut text);
        }
        text
    }
}

impl DraftJoint {
    fn write(&self, text: &mut String) {
        self.remarks.iter().for_each(|remark| comment(text, remark));
        line(text, "name", &quoted(&self.name), "");
        let DhFile { alpha, a, d } = self.dh;
        let dh = format!("{{ alpha = {alpha:?}, a = {a:?}, d = {d:?} }}");
        line(text, "dh", &dh, "modified D-H, rad and m; a is the distance from the joint before");
        for key in &JOINT {
            let known = match key.key {
                "direction" => Some(self.direction.to_string()),
                "zero_offset_deg" => Some(format!("{:?}", self.zero_offset_deg)),
                "range_deg" => self.range_deg.map(|range| list(&range)),
                "speed_limit_deg_s" => self.speed_limit_deg_s.map(|limit| format!("{limit:?}")),
                "torque_limit_nm" => self.torque_limit_nm.map(|limit| format!("{limit:?}")),
                "prior" => self.prior.map(|prior| prior.text()),
                _ => None,
            };
            match known {
                Some(value) if key.key == "prior" => {
                    for missing in self.prior.iter().flat_map(DraftPrior::missing) {
                        comment(text, &format!("`prior` lacks {}  # {}", missing.line, missing.meaning));
                    }
                    line(text, key.key, &value, "");
                }
                Some(value) => line(text, key.key, &value, key.meaning),
                None => {
                    // A table ends the joint's own keys, so all others stand before it.
                    if key.key == "motor" {
                        unknown(text, &TRUTH);
                    }
                    unknown(text, key);
                }
            }
        }
    }
}

impl DraftPrior {
    fn text(&self) -> String {
        let mut text = format!(
            "{{ mass = {:?}, com = {}, inertia_com = {}",
            self.mass,
            list(&self.com),
            list(&self.inertia_com)
        );
        for (key, value) in [("coulomb", self.coulomb), ("viscous", self.viscous)] {
            // Formatting into a String cannot fail.
            let _ = value.map(|value| write!(text, ", {key} = {value:?}"));
        }
        text + " }"
    }

    fn missing(&self) -> impl Iterator<Item = &'static KeyLine> {
        let (coulomb, viscous) = (self.coulomb.is_some(), self.viscous.is_some());
        IN_PRIOR.iter().filter(move |key| match key.key {
            "coulomb" => !coulomb,
            "viscous" => !viscous,
            _ => true,
        })
    }
}

/// A prior as `truth`, an inline table. What a drive always has and the prior does not state is a word in
/// capitals.
pub fn truth_text(link: &LinkParameters) -> String {
    let LinkParameters { mass, com, inertia_com, rotor_inertia, coulomb, viscous, offset, asymmetry } = link;
    let or_word =
        |value: &f64, word: &str| if *value == 0.0 { word.to_owned() } else { format!("{value:?}") };
    format!(
        "{{ mass = {mass:?}, com = {}, inertia_com = {}, rotor_inertia = {}, coulomb = {}, viscous = {}, \
         offset = {offset:?}, asymmetry = {asymmetry:?} }}",
        list(com),
        list(inertia_com),
        or_word(rotor_inertia, "KG_M2"),
        or_word(coulomb, "NM"),
        or_word(viscous, "NM_S_RAD")
    )
}

fn list(numbers: &[f64]) -> String {
    let numbers: Vec<_> = numbers.iter().map(|number| format!("{number:?}")).collect();
    format!("[{}]", numbers.join(", "))
}

fn line(text: &mut String, key: &str, value: &str, meaning: &str) {
    let note = if meaning.is_empty() { String::new() } else { format!("  # {meaning}") };
    let _ = writeln!(text, "{key} = {value}{note}");
}

fn unknown(text: &mut String, key: &KeyLine) {
    for (number, line) in key.line.lines().enumerate() {
        let note = if number == 0 { format!("  # {}", key.meaning) } else { String::new() };
        let _ = writeln!(text, "# {line}{note}");
    }
}

/// Writes a comment; a control character, as the name of a robot may have, would end it.
fn comment(text: &mut String, words: &str) {
    let words = words.replace(char::is_control, " ");
    let _ = writeln!(text, "# {words}");
}
