//! Keys that a leg file must state for an image. Errors in these numbers can hurt a person, so none may be a
//! default.
//!
//! Keys that only choose estimates (`bandwidth_hz`, `offset`, `rotor`, `stribeck_model`,
//! `asymmetric_coulomb`) keep their defaults. `current_limit_a` follows from the torque limit.

use scarab_base::error::FileError;
use scarab_base::toml_file::{Fault, Step};
use toml::{Table, Value};

use crate::formats::leg_file::check::joint_steps;
use crate::formats::leg_file::keys::{IN_PRIOR, JOINT, KeyLine, SIDE};
use crate::formats::leg_file::{LegFile, Side};

/// Keys that an image needs and a leg file lacks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissingForImage {
    /// `side`.
    pub top: Vec<&'static KeyLine>,
    /// Joints that lack something.
    pub joints: Vec<MissingOfJoint>,
}

/// Keys that an image needs and a joint lacks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingOfJoint {
    /// Number of the joint, from 0.
    pub joint: usize,
    pub keys: Vec<&'static KeyLine>,
    /// Keys of its `prior`.
    pub in_prior: Vec<&'static KeyLine>,
    /// Whether its encoder is at the joint, where the board cannot commutate by it.
    pub encoder_is_at_the_joint: bool,
}

impl LegFile {
    /// Loads a shipped leg by name, or the file at a path, for an image. `side_is_given`: the command line
    /// states the side.
    ///
    /// # Errors
    /// Names the missing keys, besides the errors of [`LegFile::load`].
    pub fn load_for_image(name_or_path: &str, side_is_given: bool) -> Result<Self, FileError> {
        let (leg, missing, text, file) = Self::read_for_image(name_or_path, side_is_given)?;
        match first_fault(&leg, &missing) {
            Some(fault) => Err(fault.in_file(&file, &text)),
            None => Ok(leg),
        }
    }

    /// Loads a leg, with the keys that an image would need besides.
    ///
    /// # Errors
    /// Those of [`LegFile::load`].
    pub fn load_with_missing(name_or_path: &str) -> Result<(Self, MissingForImage), FileError> {
        Self::read_for_image(name_or_path, false).map(|(leg, missing, ..)| (leg, missing))
    }

    fn read_for_image(
        name_or_path: &str,
        side_is_given: bool,
    ) -> Result<(Self, MissingForImage, String, String), FileError> {
        let (text, file) = Self::text(name_or_path)?;
        let leg = Self::parse(&text, &file)?;
        let missing = missing_keys(&leg, &text, side_is_given);
        Ok((leg, missing, text, file))
    }
}

/// Keys missing in a checked leg file.
fn missing_keys(leg: &LegFile, text: &str, side_is_given: bool) -> MissingForImage {
    // The text of a checked leg is a table with its joints.
    let table = text.parse::<Table>().unwrap_or_default();
    let mut missing = MissingForImage::default();
    if !side_is_given && !table.contains_key("side") {
        missing.top.push(&SIDE);
    }
    let stated = table.get("joint").and_then(Value::as_array);
    for (number, joint) in leg.joints.iter().enumerate() {
        let stated = stated.and_then(|stated| stated.get(number));
        let keys = keys_without(stated, &JOINT);
        let prior = stated.and_then(|stated| stated.get("prior"));
        let in_prior = if joint.prior.is_some() { keys_without(prior, &IN_PRIOR) } else { Vec::new() };
        let encoder_is_at_the_joint = joint.encoder.side != Side::Motor;
        if encoder_is_at_the_joint || !keys.is_empty() || !in_prior.is_empty() {
            missing.joints.push(MissingOfJoint { joint: number, keys, in_prior, encoder_is_at_the_joint });
        }
    }
    missing
}

/// Fault of the first place that lacks keys.
fn first_fault(leg: &LegFile, missing: &MissingForImage) -> Option<Fault> {
    if !missing.top.is_empty() {
        let reason =
            "`side` is missing: state whether the drives are mounted mirrored, \"right\" or \"left\"";
        return Some(Fault { steps: vec![Step::Key("side")], reason: reason.to_owned() });
    }
    let lacking = missing.joints.first()?;
    let mut faults = Vec::new();
    if lacking.encoder_is_at_the_joint {
        faults.push(
            "`encoder.side` is \"joint\": the board commutates the motor by this encoder, which must be at the motor"
                .to_owned(),
        );
    }
    let keys = lacking.keys.iter().map(|key| format!("`{}`", key.key));
    let names: Vec<String> =
        keys.chain(lacking.in_prior.iter().map(|key| format!("`prior.{}`", key.key))).collect();
    if !names.is_empty() {
        let (verb, list) = (if names.len() == 1 { "is" } else { "are" }, names.join(", "));
        faults.push(format!(
            "{list} {verb} missing: an image has no defaults for values that affect a person's safety"
        ));
    }
    let reason = format!("joint `{}`: {}", leg.joints[lacking.joint].name, faults.join("; "));
    Some(Fault { steps: joint_steps(lacking.joint), reason })
}

/// Keys missing in a table.
fn keys_without(table: Option<&Value>, keys: &'static [KeyLine]) -> Vec<&'static KeyLine> {
    keys.iter().filter(|key| table.is_none_or(|table| table.get(key.key).is_none())).collect()
}
