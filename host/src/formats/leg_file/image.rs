//! Keys that a leg file must state for an image. Errors in these numbers can hurt a person, so none may be a
//! default.
//!
//! Keys that only choose estimates (`bandwidth_hz`, `offset`, `rotor`, `stribeck_model`,
//! `asymmetric_coulomb`) keep their defaults. `current_limit_a` follows from the torque limit.

use toml::{Table, Value};

use crate::base::error::FileError;
use crate::base::toml_file::{Fault, Step};
use crate::formats::leg_file::check::joint_steps;
use crate::formats::leg_file::{LegFile, Side};

/// Required keys of each joint.
const JOINT: [&str; 10] = [
    "direction",
    "zero_offset_deg",
    "range_deg",
    "speed_limit_deg_s",
    "acceleration_limit_deg_s2",
    "torque_limit_nm",
    "torque_per_ampere",
    "encoder",
    "prior",
    "motor",
];
/// Required keys of each joint's `prior`, which determines the servo's gains.
const PRIOR: [&str; 3] = ["rotor_inertia", "coulomb", "viscous"];

impl LegFile {
    /// Loads a shipped leg by name, or the file at a path, for an image. `side_is_given`: the command line
    /// states the side.
    ///
    /// # Errors
    /// Names the missing keys, besides the errors of [`LegFile::load`].
    pub fn load_for_image(name_or_path: &str, side_is_given: bool) -> Result<Self, FileError> {
        let (text, file) = Self::text(name_or_path)?;
        let leg = Self::parse(&text, &file)?;
        match missing_keys(&leg, &text, side_is_given) {
            Some(fault) => Err(fault.in_file(&file, &text)),
            None => Ok(leg),
        }
    }
}

/// Keys missing in a checked leg file.
fn missing_keys(leg: &LegFile, text: &str, side_is_given: bool) -> Option<Fault> {
    let table = text.parse::<Table>().ok()?;
    if !side_is_given && !table.contains_key("side") {
        let reason =
            "`side` is missing: state whether the drives are mounted mirrored, \"right\" or \"left\"";
        return Some(Fault { steps: vec![Step::Key("side")], reason: reason.to_owned() });
    }
    let stated = table.get("joint").and_then(Value::as_array)?;
    leg.joints.iter().zip(stated).enumerate().find_map(|(number, (joint, stated))| {
        let mut missing: Vec<String> = keys_without(Some(stated), &JOINT).map(|key| format!("`{key}`")).collect();
        if joint.prior.is_some() {
            missing.extend(keys_without(stated.get("prior"), &PRIOR).map(|key| format!("`prior.{key}`")));
        }
        let mut faults = Vec::new();
        if joint.encoder.side != Side::Motor {
            faults.push(
                "`encoder.side` is \"joint\": the board commutates the motor by this encoder, which must be at the motor"
                    .to_owned(),
            );
        }
        if !missing.is_empty() {
            let (verb, list) = (if missing.len() == 1 { "is" } else { "are" }, missing.join(", "));
            faults.push(format!("{list} {verb} missing: an image has no defaults for values that affect a person's safety"));
        }
        let reason = format!("joint `{}`: {}", joint.name, faults.join("; "));
        (!faults.is_empty()).then_some(Fault { steps: joint_steps(number), reason })
    })
}

/// Keys missing in a table.
fn keys_without<'a>(table: Option<&'a Value>, keys: &'a [&str]) -> impl Iterator<Item = &'a &'a str> {
    keys.iter().filter(move |key| table.is_none_or(|table| table.get(**key).is_none()))
}
