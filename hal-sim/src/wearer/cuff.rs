//! A cuff: spring and damper with play between a point of the wearer and the exoskeleton's segment.
//!
//! ```text
//! d  = [e, n]' (w - x)                     deflection of the wearer's point w from the cuff's centre x
//! d' = [e, n]' (w' - x'),   x' that of the exoskeleton's material point at w
//! f  = K (d -+ play) + C d'   beyond the play, with the sign of (d -+ play) or 0; without play K d + C d'
//! force on the wearer = -(f_along e + f_across n) at w, on the exoskeleton the opposite at the same point
//! ```
//!
//! The directions e, n are those of the exoskeleton's segment, along and forward. Both forces act at the same
//! point, so they cancel as force and as moment, and the elastic part is the derivative of
//! `1/2 K (d -+ play)^2` by both bodies' angles.
//!
//! Why a force along the segment: bodies with offset axes, or a bent knee with a deflected thigh cuff, slide
//! along each other. Skin and straps resist, several times softer than pads. N, m, s.
//! Source: Kelvin-Voigt with play (Moore and Wilhelms 1988 for contacts that only push).
//! Known limits: one point a cuff, no moment, linear tissue.

use super::body::LimbState;
use super::description::{CuffDescription, CuffSpring};
use super::plane::{LimbSegment, Pair, TwoLinkChain, combined, directions, dot};

/// Cuff fitted to both bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cuff {
    segment: LimbSegment,
    distance: f64,
    /// The wearer's point on its own segment, m.
    on_wearer: Pair,
    /// Along and across.
    couplings: [CuffSpring; 2],
}

/// Action of a cuff at one state; pairs of forces are along and across.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CuffLoad {
    /// Generalised forces on the wearer's and the exoskeleton's segments, N m.
    pub(crate) on_wearer: Pair,
    pub(crate) on_exoskeleton: Pair,
    /// Deflection of the wearer, m.
    pub(crate) deflection: Pair,
    /// Force on the wearer, N.
    pub(crate) force: Pair,
    /// Power of that force, W.
    pub(crate) received: f64,
    /// Power lost in the dampers, W.
    pub(crate) dissipated: f64,
    /// Energy in the springs, J.
    pub(crate) stored: f64,
}

impl CuffSpring {
    /// Deflection beyond the play.
    fn beyond(&self, deflection: f64) -> f64 {
        deflection - deflection.clamp(-self.play, self.play)
    }

    /// Force against a deflection (m) that changes at a rate (m/s), N, and the share of the spring.
    fn force(&self, deflection: f64, rate: f64) -> (f64, f64) {
        let beyond = self.beyond(deflection);
        let spring = self.stiffness * beyond;
        let whole = spring + self.damping * rate;
        let pushing = if self.play == 0.0 {
            whole
        } else if beyond > 0.0 {
            whole.max(0.0)
        } else if beyond < 0.0 {
            whole.min(0.0)
        } else {
            0.0
        };
        (pushing, spring)
    }
}

impl Cuff {
    /// Cuff at which both chains are relaxed when straight.
    pub(super) fn fitted(
        segment: LimbSegment,
        described: &CuffDescription,
        exoskeleton: &TwoLinkChain,
        wearer: &TwoLinkChain,
    ) -> Self {
        let straight = [0.0; 2];
        let centre = exoskeleton.point(segment, [described.distance, 0.0], straight).position;
        let joint = wearer.point(segment, [0.0; 2], straight).position;
        Self {
            segment,
            distance: described.distance,
            on_wearer: [centre[0] - joint[0], centre[1] - joint[1]],
            couplings: [described.along, described.across],
        }
    }

    /// Whether some damper acts.
    pub(super) fn is_damped(&self) -> bool {
        self.couplings.iter().any(|coupling| coupling.damping > 0.0)
    }

    /// Larger stiffness (N/m) and damping (N s/m) of the two directions.
    pub(super) fn strongest(&self) -> (f64, f64) {
        let [along, across] = self.couplings;
        (along.stiffness.max(across.stiffness), along.damping.max(across.damping))
    }

    /// Inverse mass between the two bodies at the cuff, 1/kg; inertia matrices in kg m^2.
    pub(super) fn mobility(&self, angles: Pair, bodies: [(&TwoLinkChain, &[Pair; 2]); 2]) -> f64 {
        let at = [[self.distance, 0.0], self.on_wearer];
        (0..2)
            .map(|body| {
                let (chain, inertia) = bodies[body];
                chain.point(self.segment, at[body], angles).mobility(inertia)
            })
            .sum()
    }

    /// Forces between the two bodies.
    pub(super) fn load(
        &self,
        chains: [&TwoLinkChain; 2],
        exoskeleton: &LimbState,
        wearer: &LimbState,
    ) -> CuffLoad {
        let direction = match self.segment {
            LimbSegment::Thigh => exoskeleton.angles[0],
            LimbSegment::Shank => exoskeleton.angles[1],
        };
        let axes = directions(direction);
        let own = chains[1].point(self.segment, self.on_wearer, wearer.angles);
        let centre = chains[0].point(self.segment, [self.distance, 0.0], exoskeleton.angles).position;
        let apart = [own.position[0] - centre[0], own.position[1] - centre[1]];
        let deflection = axes.map(|axis| dot(axis, apart));
        let held = [self.distance + deflection[0], deflection[1]];
        let opposite = chains[0].point(self.segment, held, exoskeleton.angles);
        let (velocity, carried) = (own.velocity(wearer.rates), opposite.velocity(exoskeleton.rates));
        let relative = [velocity[0] - carried[0], velocity[1] - carried[1]];
        let mut load = CuffLoad { deflection, ..CuffLoad::default() };
        for axis in 0..2 {
            let (coupling, rate) = (&self.couplings[axis], dot(axes[axis], relative));
            let (force, spring) = coupling.force(deflection[axis], rate);
            load.force[axis] = -force;
            load.dissipated += (force - spring) * rate;
            load.stored += 0.5 * spring * coupling.beyond(deflection[axis]);
        }
        let force = combined(axes, load.force);
        load.received = dot(force, velocity);
        load.on_wearer = own.torques(force);
        load.on_exoskeleton = opposite.torques(force.map(|component| -component));
        load
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cuff_with_play_pushes_and_never_pulls() {
        let coupling = CuffSpring { stiffness: 1000.0, damping: 50.0, play: 0.01 };
        for (deflection, rate, expected) in [
            (0.009, 5.0, 0.0),
            (-0.009, -5.0, 0.0),
            (0.02, 0.0, 10.0),
            (0.02, 0.1, 15.0),
            (0.02, -1.0, 0.0),
            (-0.02, 0.1, -5.0),
            (-0.02, 1.0, 0.0),
        ] {
            let (force, _) = coupling.force(deflection, rate);
            assert!((force - expected).abs() < 1e-9, "{deflection} {rate}: {force}");
        }
        let tight = CuffSpring { play: 0.0, ..coupling };
        assert!((tight.force(0.001, -0.1).0 + 4.0).abs() < 1e-9);
    }

    #[test]
    fn forces_on_both_bodies_are_the_slopes_of_the_stored_energy() {
        let chains =
            [TwoLinkChain { hip: [0.0; 2], thigh: 0.4 }, TwoLinkChain { hip: [0.02, -0.03], thigh: 0.43 }];
        let coupling = CuffSpring { stiffness: 3000.0, damping: 0.0, play: 0.002 };
        let described = CuffDescription {
            distance: 0.2,
            along: CuffSpring { stiffness: 700.0, ..coupling },
            across: coupling,
        };
        let bodies = [[0.5, -0.3], [0.44, -0.1]].map(|angles| LimbState { angles, rates: [0.0; 2] });
        for segment in [LimbSegment::Thigh, LimbSegment::Shank] {
            let cuff = Cuff::fitted(segment, &described, &chains[0], &chains[1]);
            let load = |bodies: &[LimbState; 2]| cuff.load([&chains[0], &chains[1]], &bodies[0], &bodies[1]);
            let now = load(&bodies);
            assert!(now.force.iter().all(|force| force.abs() > 1.0), "{now:?}");
            for (body, torques) in [now.on_exoskeleton, now.on_wearer].into_iter().enumerate() {
                for angle in 0..2 {
                    let step = 1e-6;
                    let stored = |sign: f64| {
                        let mut moved = bodies;
                        moved[body].angles[angle] += sign * step;
                        load(&moved).stored
                    };
                    let slope = (stored(1.0) - stored(-1.0)) / (2.0 * step);
                    // Third derivatives times the step squared, and rounding of energies below 10 J.
                    assert!((torques[angle] + slope).abs() < 1e-7, "{segment:?} {body} {angle}");
                }
            }
        }
    }
}
