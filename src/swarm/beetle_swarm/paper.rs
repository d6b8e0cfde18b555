//! Rules of the paper's beetle swarm: whiskers along the velocity, steps of fixed decay.
//!
//! Implemented to show the abilities and limits of the paper's rules; the default mode is the adaptive one.
//!   x_r = x + v l,  x_l = x - v l                               (Eq. 27)
//!   psi = -delta v sgn(f(x_r) - f(x_l))                         (Eq. 28)
//!   v   = w v + c1 r1 (P - x) + c2 r2 (G - x)                   (Eq. 19, w by Eq. 20)
//!   x   = x + lambda v + (1 - lambda) psi                       (Eq. 29, corrected)
//!   delta = e1 delta + e0                                       (Eq. 25)
//!   l   = delta / e2                                            (Eq. 26)
//! As printed, Eq. (29) has v in place of psi, which is the plain particle swarm; the original
//! beetle swarm (Wang, Yang, Liu, 2018) has psi. The order is that of the paper's Table II: psi uses
//! the velocity before Eq. (19).
//!
//! Source: the paper, section 3.3.2. Cost: 3 N evaluations and 20 N D operations per iteration.
//! Known limits: velocities collapse into the span of P - x and G - x, and the whiskers with them: no success
//! in 30 dimensions.

use crate::real::{Real, sign};

use super::super::particles::{Particles, VelocityRule};
use super::super::random::Random;
use super::super::rows::{add_scaled, clip_to_box, live, live_mut};
use super::rules::{Opening, Rules, Side};
use super::settings::PaperSettings;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct PaperRules<T, const N: usize> {
    settings: PaperSettings<T>,
    /// Step delta.
    step: T,
    /// Sign sgn(f(x_r) - f(x_l)) of each beetle.
    smell: [T; N],
    iteration: u32,
}

impl<T: Real, const N: usize> PaperRules<T, N> {
    pub fn new(settings: PaperSettings<T>) -> Self {
        Self { settings, step: settings.first_step, smell: [T::zero(); N], iteration: 0 }
    }
}

impl<T: Real, const N: usize, const D: usize> Rules<T, N, D> for PaperRules<T, N> {
    fn open(&mut self, _beetles: &mut Particles<T, N, D>) -> Opening {
        Opening::Search
    }

    fn whiskered(&self) -> usize {
        N
    }

    fn moved(&self) -> usize {
        N
    }

    fn aim(&mut self, _beetle: usize, _beetles: &Particles<T, N, D>, _random: &mut Random) {}

    fn tip(&self, beetle: usize, side: Side, beetles: &Particles<T, N, D>) -> [T; D] {
        let beetle = beetle.min(N - 1);
        let length = self.step / self.settings.step_per_whisker;
        let signed = if side == Side::Right { length } else { -length };
        let mut tip = beetles.position[beetle];
        let velocity = live(&beetles.velocity[beetle], beetles.dimension());
        add_scaled(live_mut(&mut tip, beetles.dimension()), signed, velocity);
        tip
    }

    fn smell(&mut self, beetle: usize, _beetles: &Particles<T, N, D>, right: T, left: T) {
        self.smell[beetle.min(N - 1)] = sign(right - left);
    }

    fn displace(&mut self, beetle: usize, beetles: &mut Particles<T, N, D>, random: &mut Random) {
        let beetle = beetle.min(N - 1);
        let dimension = beetles.dimension();
        let share = self.settings.velocity_share;
        let psi = -self.step * self.smell[beetle] * (T::one() - share);
        let before = beetles.velocity[beetle];
        let rule = VelocityRule {
            inertia_weight: self.settings.inertia_weight.at(self.iteration),
            individual_learning: self.settings.individual_learning,
            global_learning: self.settings.global_learning,
            limit: self.settings.velocity_limit,
            per_coordinate: true,
        };
        beetles.steer(beetle, &rule, random);
        let position = live_mut(&mut beetles.position[beetle], dimension);
        add_scaled(position, psi, live(&before, dimension));
        add_scaled(position, share, live(&beetles.velocity[beetle], dimension));
        for entry in position {
            *entry = clip_to_box(*entry);
        }
    }

    fn close(&mut self, beetles: &mut Particles<T, N, D>, found: &[T]) {
        for (beetle, &value) in found.iter().enumerate() {
            beetles.record(beetle, value);
        }
        self.step = self.settings.step_decay * self.step + self.settings.step_offset;
        self.iteration = self.iteration.saturating_add(1);
    }

    fn closes_iteration(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::particles::InertiaWeight;
    use super::*;
    use crate::real::abs;

    #[test]
    fn whiskers_moves_and_decay_follow_their_equations() {
        // Without pulls and with w = 0.5 the velocity is known.
        let settings = PaperSettings {
            inertia_weight: InertiaWeight::constant(0.5),
            individual_learning: 0.0,
            global_learning: 0.0,
            ..PaperSettings::default()
        };
        let mut rules = PaperRules::<f64, 2>::new(settings);
        let mut beetles = Particles::<f64, 2, 1>::new(1);
        beetles.position = [[0.4], [0.6]];
        let mut random = Random::new(1);
        let (mut velocity, mut step, mut at) = (0.08, 1.0, 0.4);
        beetles.velocity = [[velocity]; 2];
        for smell in [1.0, -1.0, 0.0, 1.0] {
            let tip = |side| Rules::<f64, 2, 1>::tip(&rules, 0, side, &beetles)[0];
            // Sums of a few numbers below 1.
            let close = |one: f64, other: f64| abs(one - other) < 1e-15;
            assert!(close(tip(Side::Right), at + velocity * step / 10.0), "Eqs (26), (27)");
            assert!(close(tip(Side::Left), at - velocity * step / 10.0), "Eqs (26), (27)");
            rules.smell(0, &beetles, smell, 0.0);
            rules.displace(0, &mut beetles, &mut random);
            let psi = -step * velocity * smell;
            velocity *= 0.5;
            at += 0.4 * velocity + 0.6 * psi;
            assert!(close(beetles.velocity[0][0], velocity), "Eq. (19)");
            assert!(close(beetles.position[0][0], at), "Eqs (28), (29)");
            rules.close(&mut beetles, &[1.0, 2.0]);
            step = 0.95 * step + 0.005;
        }
    }
}
