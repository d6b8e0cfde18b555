//! Links as segments of a body: lengths, wearer and side.

use serde::{Deserialize, Serialize};

use crate::formats::anthropometry::Wearer;
use crate::formats::leg_file::LegFile;

/// Segments of the last two links: a thigh and a shank with its foot, as an exoskeleton on a wearer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentsFile {
    /// Length from knee to ankle, m. The thigh extends to the last joint.
    pub(crate) shank_m: f64,
    /// Length of the wearer's foot, m.
    pub(crate) foot_m: f64,
    /// Body mass of the wearer in `truth`, kg.
    pub(crate) wearer_kg: f64,
    /// Body mass of the wearer that `prior` assumes, kg.
    pub(crate) prior_wearer_kg: f64,
}

impl SegmentsFile {
    /// Wearer of this mass (kg) with these segments and this length of the thigh (m).
    pub fn wearer(&self, thigh: f64, mass: f64) -> Wearer {
        Wearer { mass, thigh, shank: self.shank_m, foot: self.foot_m }
    }
}

/// Side of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BodySide {
    /// Side for which the drives are described.
    #[default]
    Right,
    /// Side with mirrored drives.
    Left,
}

impl BodySide {
    /// Sign of motors and encoders relative to the anatomical direction.
    pub fn mounting(self) -> f64 {
        match self {
            Self::Right => 1.0,
            Self::Left => -1.0,
        }
    }
}

/// Shortest length of a link, m.
const SHORTEST_LINK_M: f64 = 0.05;

impl LegFile {
    /// Length of the link beyond a joint, m, up to the next joint's axis. The last link has the
    /// shank's length if stated, else twice the distance of its centre of mass, if known.
    pub(crate) fn link_length(&self, joint: usize) -> f64 {
        if let Some(next) = self.joints.get(joint + 1) {
            return next.dh.a.hypot(next.dh.d);
        }
        if let Some(segments) = &self.segments {
            return segments.shank_m;
        }
        let link = self.joints.get(joint).and_then(|joint| joint.prior.as_ref().or(joint.truth.as_ref()));
        let reach = link
            .map_or(0.0, |link| link.com.iter().map(|component| component * component).sum::<f64>().sqrt());
        (2.0 * reach).max(SHORTEST_LINK_M)
    }
}
