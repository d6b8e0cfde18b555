//! Assistance of a periodic motion: a share of the wearer's predicted torque, behind a gate.
//!
//! ```text
//! assist = s e tau_n(q*, q*', q*'')            predicted for the time at which the torque acts
//! tau_n  = tau_w + (1 - s_i k) inertia - s_w G_w     torque that the wearer of the leg gives without it
//! own    = <tau_h tau_n> / <tau_n tau_n>       share that the wearer gives, means over about a cycle
//! tau_h  = inertia + weight + friction of both legs - measured torque
//! gate   = clamp((predicted - 0.8) / 0.1, 0, 1) clamp((own / (1 - s) - 0.25) / 0.25, 0, 1)
//! e      follows the gate, from 0 to 1 in a cycle, from 1 to 0 in half a cycle
//! ```
//!
//! The gate has two parts. The motion must be periodic: the oscillators predict it. And the wearer must give
//! torque for it: a leg that swings limply, or against its wearer, may be periodic too. `own` is 1 - s for a
//! wearer who gives the rest.
//!
//! The assistance ends within 50 ms, until the next cycle, once its work on the measured motion exceeds its
//! share of the positive work that the prediction needed in the cycle before.

use super::law::DT;
use super::model::CompensationModel;
use super::oscillator::Oscillator;
use crate::real::{abs, clamp, max};

/// Predicted share of the motion at which the gate begins to open, and is open.
const PERIODIC: [f32; 2] = [0.8, 0.9];
/// Likewise for the wearer's own share, relative to the expected one.
const OWN: [f32; 2] = [0.25, 0.5];
/// Closing of the gate in a sample once the energy of a cycle is given: 50 ms in all.
const SPENT_PER_SAMPLE: f32 = DT / 0.05;
/// Torque below which a motion needs no assistance, N m; also keeps the quotient finite.
const SMALLEST_NM: f32 = 1.0;

fn ramp([from, to]: [f32; 2], value: f32) -> f32 {
    clamp((value - from) / (to - from), 0.0, 1.0)
}

/// Oscillators, gate and ledger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicAssist<const N: usize> {
    oscillator: Oscillator<N>,
    gate: f32,
    /// Means over about a cycle of own times predicted torque, and of predicted torque squared, (N m)^2.
    own: f32,
    expected: f32,
    /// Energy given in this cycle, and the predicted positive work of this and the last cycle, J.
    given_j: f32,
    needed_j: f32,
    allowed_j: f32,
    /// Assistance and angles of the last sample.
    last_assist: [f32; N],
    last_angle: [f32; N],
}

impl<const N: usize> PeriodicAssist<N> {
    /// Assistance before the first sample.
    pub fn new() -> Self {
        Self {
            oscillator: Oscillator::new(),
            gate: 0.0,
            own: 0.0,
            expected: 0.0,
            given_j: 0.0,
            needed_j: 0.0,
            allowed_j: 0.0,
            last_assist: [0.0; N],
            last_angle: [0.0; N],
        }
    }

    /// Oscillators.
    pub fn oscillator(&self) -> &Oscillator<N> {
        &self.oscillator
    }

    /// Opening of the gate, 0..1.
    pub fn gate(&self) -> f32 {
        self.gate
    }

    /// Takes the angles (rad) of a sample and the torque that the wearer gives and needs (N m) at one
    /// earlier time, and returns the assistance for `ahead` s after the sample, N m. The shares are those of
    /// the assistance, of the empty leg's inertia that the wearer moves, and of the wearer's weight that is
    /// carried.
    pub(crate) fn step(
        &mut self,
        model: &CompensationModel<N>,
        [share, inertia_share, carried_share]: [f32; 3],
        angles: &[f32; N],
        [own, needed]: [&[f32; N]; 2],
        ahead: f32,
    ) -> [f32; N] {
        // Measured work of the last assistance.
        for joint in 0..N {
            self.given_j += self.last_assist[joint] * (angles[joint] - self.last_angle[joint]);
        }
        let before = self.oscillator.phase();
        self.oscillator.push(angles);
        let cycles = self.oscillator.hertz() * DT;
        let (mut product, mut square) = (0.0, 0.0);
        for (own, needed) in own.iter().zip(needed) {
            product += own * needed;
            square += needed * needed;
        }
        self.own += cycles * (product - self.own);
        self.expected += cycles * (square - self.expected);
        let own_share = self.own / max(self.expected, SMALLEST_NM * SMALLEST_NM);
        let state = self.oscillator.predict(ahead);
        let torque = model.wearer_needs(&state, inertia_share, carried_share);
        if self.oscillator.phase() < before {
            (self.allowed_j, self.needed_j, self.given_j) = (self.needed_j, 0.0, 0.0);
        }
        if self.given_j > abs(share) * self.allowed_j {
            self.gate = max(self.gate - SPENT_PER_SAMPLE, 0.0);
        } else {
            let gate =
                ramp(PERIODIC, self.oscillator.predicted_share()) * ramp(OWN, own_share / (1.0 - share));
            self.gate += clamp(gate - self.gate, -2.0 * cycles, cycles);
        }
        for (torque, qd) in torque.iter().zip(&state.qd) {
            self.needed_j += max(torque * qd, 0.0) * DT;
        }
        let assist = torque.map(|torque| share * self.gate * torque);
        (self.last_assist, self.last_angle) = (assist, *angles);
        assist
    }
}
