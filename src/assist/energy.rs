//! Energy that the leg gives to its wearer, and the damping that bounds it.
//!
//! ```text
//! E += sum_j (tau_j - support_j - assist_j) dq_j - (FC_low |dq_j| + FV_low q'_j dq_j) - s_i k dT
//! E  = max(E, 0),   T = q'' M q' / 2
//! b  = B_MAX clamp((4 E / BUDGET - 1) / 3, 0, 1)
//! ```
//!
//! Energy of the motors that went neither into the weight's potential, nor into friction, nor into the
//! kinetic energy that the compensation of inertia lends, stays with the leg's own motion and its wearer.
//! What passes to the wearer is E less the rise of (1 - s_i k) T, so from rest it is at most E. Torque is the
//! measured one: the balance holds whatever computed it. The lower bound of friction makes it an upper bound.
//! Weight and inertia return what they took; the assistance of a periodic motion has a bound of its own.
//!
//! E starts again from zero whenever the wearer has given energy: a wearer who worked for an hour has not
//! earned an hour's push. So the energy given since any instant stays below [`BUDGET_J`], which the damping
//! enforces from a quarter of it on; at the budget the assistance ends.
//!
//! Source: passivity observer and controller of Hannaford and Ryu, 2002, without a measured force.
//! Cost: one mass matrix (210 instructions) and some 30 operations.

use super::model::CompensationModel;
use crate::real::{abs, clamp};

/// Most energy given from any instant on, J: a shank of 4 kg lifted by 10 cm.
pub const BUDGET_J: f32 = 4.0;
/// Damping at the budget, N m s/rad.
const STRONGEST: f32 = 60.0;

/// Values of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Instant<const N: usize> {
    angle: [f32; N],
    torque: [f32; N],
    kinetic_j: f32,
}

/// Energy observer of one leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyObserver<const N: usize> {
    given_j: f32,
    last: Option<Instant<N>>,
}

impl<const N: usize> EnergyObserver<N> {
    /// Observer before the first sample.
    pub const fn new() -> Self {
        Self { given_j: 0.0, last: None }
    }

    /// Takes a sample: angles (rad), measured torques (N m), and velocities (rad/s) of the angles' time.
    /// `excepted` are the torques (N m) whose energy does not count; `inertia_share` is the compensated share
    /// of the mass matrix.
    pub fn push(
        &mut self,
        model: &CompensationModel<N>,
        [angle, torque, velocity]: [&[f32; N]; 3],
        excepted: &[f32; N],
        inertia_share: f32,
    ) {
        let kinetic_j = inertia_share * model.kinetic_energy(angle, velocity);
        if let Some(last) = &self.last {
            let mut work = last.kinetic_j - kinetic_j;
            for joint in 0..N {
                let way = angle[joint] - last.angle[joint];
                let mean = 0.5 * (torque[joint] + last.torque[joint]) - excepted[joint];
                let friction = model.assured.coulomb_nm[joint] * abs(way)
                    + model.assured.viscous[joint] * velocity[joint] * way;
                work += mean * way - friction;
            }
            let given_j = self.given_j + work;
            // Not a number stays so and ends the session.
            self.given_j = if given_j < 0.0 { 0.0 } else { given_j };
        }
        self.last = Some(Instant { angle: *angle, torque: *torque, kinetic_j });
    }

    /// Energy given since the wearer last gave some, J.
    pub fn given_j(&self) -> f32 {
        self.given_j
    }

    /// Damping that the energy requires, N m s/rad.
    pub(crate) fn damping(&self) -> f32 {
        STRONGEST * clamp((4.0 / BUDGET_J * self.given_j - 1.0) * (1.0 / 3.0), 0.0, 1.0)
    }

    /// Whether the budget is used up, or the energy is not a number.
    pub(crate) fn is_exhausted(&self) -> bool {
        !(self.given_j < BUDGET_J)
    }
}
