//! Known mass at a known position of a leg, as stated on the command line: `KG@JOINT:X_M` or
//! `KG@JOINT:X_M:Y_M`.
//!
//! JOINT is a joint's name or its number from 1; X and Y are in that joint's D-H frame, X along the
//! link. A wrong mass is worse than none, so implausible values are rejected. These are a mass of
//! 0, below, or above `LARGEST_KG`, and a position beyond the link.

use core::str::FromStr;

use nalgebra::Vector3;
use scarab::model::Payload;
use scarab_base::error::ToolError;

use crate::formats::leg_file::LegFile;

/// Largest mass that a drive of this class moves, kg.
pub(crate) const LARGEST_KG: f64 = 50.0;

/// Mass as stated, not yet checked against a leg.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedMass {
    mass: f64,
    joint: String,
    x: f64,
    y: f64,
}

impl FromStr for PlacedMass {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("`{text}` is not KG@JOINT:X_M or KG@JOINT:X_M:Y_M, for example 5@knee:0.2");
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let (mass, position) = text.split_once('@').ok_or_else(form)?;
        let mut parts = position.split(':');
        let (joint, x, y) = (parts.next().unwrap_or(""), parts.next(), parts.next());
        let mass = number(mass).ok_or_else(form)?;
        let x = x.and_then(number).ok_or_else(form)?;
        let y = y.map_or(Some(0.0), number).ok_or_else(form)?;
        if joint.trim().is_empty() || parts.next().is_some() {
            return Err(form());
        }
        if !(mass > 0.0 && mass <= LARGEST_KG) {
            return Err(format!("a mass of {mass} kg; it must be above 0 and at most {LARGEST_KG}"));
        }
        Ok(Self { mass, joint: joint.trim().to_owned(), x, y })
    }
}

impl PlacedMass {
    /// Places the mass on this leg; `option` is named in error messages.
    pub fn on(&self, leg: &LegFile, option: &str) -> Result<Payload<f64>, ToolError> {
        let refused = |reason: String| ToolError::input(format!("{option}: {reason}"));
        let joint = leg.joint_index(&self.joint).map_err(refused)?;
        let length = leg.link_length(joint);
        if !(0.0..=length).contains(&self.x) || self.y.abs() > length {
            return Err(refused(format!(
                "x {} m, y {} m lies outside the link of `{}`, which is {length:.3} m long (x 0 to {length:.3}, y within \
                 +-{length:.3})",
                self.x, self.y, leg.joints[joint].name
            )));
        }
        Ok(Payload { joint, mass: self.mass, position: Vector3::new(self.x, self.y, 0.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::leg_file::DEFAULT_LEG;

    fn on_the_default_leg(text: &str) -> Result<Payload<f64>, String> {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let mass: PlacedMass = text.parse()?;
        mass.on(&leg, "--payload").map_err(|error| error.to_string())
    }

    #[test]
    fn a_mass_is_placed_by_name_or_number() {
        let expected = Payload { joint: 1, mass: 5.0, position: Vector3::new(0.2, 0.0, 0.0) };
        assert_eq!(on_the_default_leg("5@knee:0.2"), Ok(expected));
        assert_eq!(on_the_default_leg("5@2:0.2:0"), Ok(expected));
        let forward = Payload { joint: 0, mass: 0.5, position: Vector3::new(0.39, 0.1, 0.0) };
        assert_eq!(on_the_default_leg("0.5@hip:0.39:0.1"), Ok(forward));
    }

    #[test]
    fn implausible_masses_and_positions_are_refused_with_their_reason() {
        for (text, reason) in [
            ("0@knee:0.2", "a mass of 0 kg; it must be above 0 and at most 50"),
            ("-5@knee:0.2", "a mass of -5 kg"),
            ("500@knee:0.2", "a mass of 500 kg"),
            ("nan@knee:0.2", "is not KG@JOINT:X_M"),
            ("5@knee", "is not KG@JOINT:X_M"),
            ("5@knee:0.2:0:1", "is not KG@JOINT:X_M"),
            ("5 knee 0.2", "is not KG@JOINT:X_M"),
            ("5@:0.2", "is not KG@JOINT:X_M"),
            ("5@ankle:0.2", "--payload: `ankle` is not a joint of `x2-wearer-75kg`: hip, knee or 1 to 2"),
            ("5@3:0.2", "`3` is not a joint"),
            ("5@0:0.2", "`0` is not a joint"),
            ("5@hip:0.4", "--payload: x 0.4 m, y 0 m lies outside the link of `hip`, which is 0.390 m long"),
            ("5@knee:-0.1", "lies outside the link of `knee`"),
            ("5@knee:0.2:-0.6", "lies outside the link of `knee`"),
        ] {
            let refusal = on_the_default_leg(text).expect_err(text);
            assert!(refusal.contains(reason), "{text}: {refusal}");
        }
    }
}
