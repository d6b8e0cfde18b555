//! A leg file for other lengths and another wearer.
//!
//! Why: an exoskeleton is adjusted to its wearer's lengths, and the prior should match. One rule
//! applies to truth and prior alike; `[segments]` of the leg file describes the original link:
//!
//! ```text
//! link     = exoskeleton's part + wearer's segment (anthropometry)
//! wearer   : segment of the new mass and length; the prior's mass scales as the truth's does, so a prior
//!            that was 7 % off stays so
//! exoskeleton, and a wearer with new lengths only : the mass stays, its positions along the link stretch,
//!            x -> s x:  c -> S c,   C -> S C S,   I = tr(C) E - C,   S = diag(s, 1, 1)
//! ```
//!
//! s is the new over the old length, c the centre of mass, C the second moment of mass about it, I
//! the inertia tensor. A stretched body is physically consistent for every s. A telescope that
//! moves its lower part as a whole differs little from even stretching:
//! `stretching_is_close_to_a_telescope` measures it. Rotor inertia, friction and limits stay.
//!
//! Ranges: the lengths that the paper gives for its exoskeleton, thigh 0.402-0.505 m, shank 0.397-0.506 m.
//! The default leg's own 0.39 and 0.40 m come from its source and stay unless other lengths are requested.

use core::str::FromStr;

use nalgebra::{Matrix3, Vector3};
use scarab::model::RigidBody;
use scarab_base::error::ToolError;

use crate::formats::anthropometry::Wearer;
use crate::formats::leg_file::{LegFile, LinkParameters, SegmentsFile};
use crate::leg::link_body::{body, joined_with, linked, without};

/// Shortest and longest thigh, m.
pub(crate) const THIGH_RANGE_M: [f64; 2] = [0.402, 0.505];
/// Shortest and longest shank, m.
pub(crate) const SHANK_RANGE_M: [f64; 2] = [0.397, 0.506];

/// Wearer as `KG,M` on the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Body mass, kg.
    pub mass: f64,
    /// Height, m.
    pub height: f64,
}

impl FromStr for Person {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (mass, height) = text
            .split_once(',')
            .and_then(|(mass, height)| {
                Some((mass.trim().parse::<f64>().ok()?, height.trim().parse::<f64>().ok()?))
            })
            .ok_or_else(|| format!("`{text}` is not KG,M, for example 80,1.80"))?;
        if !(20.0..=200.0).contains(&mass) {
            return Err(format!("a body mass of {mass} kg; it must be 20 to 200"));
        }
        if !(1.0..=2.3).contains(&height) {
            return Err(format!("a height of {height} m; it must be 1.0 to 2.3"));
        }
        Ok(Self { mass, height })
    }
}

/// Requested size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Size {
    /// Hip to knee, m.
    pub thigh: Option<f64>,
    /// Knee to ankle, m.
    pub shank: Option<f64>,
    /// Wearer whose height determines the lengths not given.
    pub wearer: Option<Person>,
}

impl Size {
    /// Leg of this size.
    pub fn apply_to(&self, leg: &LegFile) -> Result<LegFile, ToolError> {
        if *self == Self::default() {
            return Ok(leg.clone());
        }
        let old = leg.segments.ok_or_else(|| {
            ToolError::input(format!(
                "{}: --thigh, --shank and --wearer need the key `segments` in the leg file",
                leg.name
            ))
        })?;
        // The reader of leg files has verified that there are two joints.
        let knee = leg.joints.len().saturating_sub(1);
        let before = old.wearer(leg.link_length(knee.saturating_sub(1)), old.wearer_kg);
        let tall = self.wearer.map(|person| Wearer::from_height(person.mass, person.height));
        let thigh =
            self.length("thigh", self.thigh, tall.map(|wearer| wearer.thigh), before.thigh, THIGH_RANGE_M)?;
        let shank =
            self.length("shank", self.shank, tall.map(|wearer| wearer.shank), before.shank, SHANK_RANGE_M)?;
        let after = Wearer { thigh, shank, ..tall.unwrap_or(before) };

        let mut sized = leg.clone();
        let weight = after.mass / before.mass;
        let stretches = [thigh / before.thigh, shank / before.shank];
        for (index, joint) in sized.joints.iter_mut().skip(knee.saturating_sub(1)).enumerate() {
            for (link, mass) in [(&mut joint.truth, old.wearer_kg), (&mut joint.prior, old.prior_wearer_kg)] {
                if let Some(link) = link {
                    let another = self.wearer.map(|_| Wearer { mass: weight * mass, ..after });
                    *link = changed(link, index, stretches[index], Wearer { mass, ..before }, another)
                        .map_err(|reason| {
                            ToolError::input(format!("{}: joint `{}`: {reason}", leg.name, joint.name))
                        })?;
                }
            }
        }
        if let Some(joint) = sized.joints.get_mut(knee) {
            joint.dh.a = thigh;
        }
        sized.segments = Some(SegmentsFile {
            shank_m: shank,
            wearer_kg: weight * old.wearer_kg,
            prior_wearer_kg: weight * old.prior_wearer_kg,
            foot_m: after.foot,
        });
        Ok(sized)
    }

    /// New length of a link: the given one, that of a wearer as tall as this, or the old one.
    fn length(
        &self,
        option: &str,
        given: Option<f64>,
        tall: Option<f64>,
        old: f64,
        [low, high]: [f64; 2],
    ) -> Result<f64, ToolError> {
        let (cause, new) = match (given, tall, self.wearer) {
            (Some(given), ..) => (format!("--{option} {given}"), given),
            (None, Some(tall), Some(person)) => {
                (format!("--wearer {},{}: a {option} of {tall:.3} m", person.mass, person.height), tall)
            }
            _ => return Ok(old),
        };
        if (low..=high).contains(&new) {
            Ok(new)
        } else {
            Err(ToolError::input(format!(
                "{cause} is outside {low}..{high} m, to which the {option} can be set"
            )))
        }
    }
}

/// Link of the thigh (0) or shank at its new length, with the segments of `another` wearer for those of
/// `before`, if there is one.
fn changed(
    link: &LinkParameters,
    index: usize,
    stretch: f64,
    before: Wearer,
    another: Option<Wearer>,
) -> Result<LinkParameters, String> {
    let Some(another) = another else {
        let whole = body(link.mass, link.com, link.inertia_com);
        return Ok(linked(link, &stretched(&whole, stretch)));
    };
    let machine = without(link, &before.links()[index]).ok_or_else(|| {
        format!(
            "its link is lighter than the {} of a wearer of {} kg, which it contains by `segments`",
            ["thigh", "shank"][index],
            before.mass
        )
    })?;
    let sum = joined_with(&stretched(&machine, stretch), &another.links()[index]);
    sum.map(|sum| linked(link, &sum)).ok_or_else(|| "has no mass".into())
}

fn stretched(body: &RigidBody<f64>, stretch: f64) -> RigidBody<f64> {
    let along = Matrix3::from_diagonal(&Vector3::new(stretch, 1.0, 1.0));
    let spread = Matrix3::identity() * (0.5 * body.inertia.trace()) - body.inertia;
    let spread = along * spread * along;
    RigidBody {
        mass: body.mass,
        centre_of_mass: along * body.centre_of_mass,
        inertia: Matrix3::identity() * spread.trace() - spread,
    }
}

#[cfg(test)]
mod tests;
