//! Links as segments of a body: how long they are.

use super::LegFile;

/// A link is at least so long, m.
const SHORTEST_LINK_M: f64 = 0.05;

impl LegFile {
    /// Length of the link beyond a joint, m: to the next joint's axis; of the last link twice the distance of its centre of
    /// mass, as far as that is known.
    #[must_use]
    pub fn link_length(&self, joint: usize) -> f64 {
        if let Some(next) = self.joints.get(joint + 1) {
            return next.dh.a.hypot(next.dh.d);
        }
        let link = self.joints.get(joint).and_then(|joint| joint.prior.as_ref().or(joint.truth.as_ref()));
        let reach = link.map_or(0.0, |link| link.com.iter().map(|place| place * place).sum::<f64>().sqrt());
        (2.0 * reach).max(SHORTEST_LINK_M)
    }
}
