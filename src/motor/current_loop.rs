//! Current control of one motor in the frame of its rotor.
//!
//! ```text
//! e = i_target - i                                                            d and q, A
//! u_d = kp_d e_d + s_d - w L_q i_q                                            cross-coupling fed forward
//! u_q = kp_q e_q + s_q + w (L_d i_d + flux)                                   and back-EMF
//! v = u within |v| <= V,  d first:  |v_d| <= 0.87 V,  |v_q| <= sqrt(V^2 - v_d^2)
//! s += (1 - exp(-R T / L)) (v - fed forward - s)                              integral of what was realised
//!
//! kp = 2 pi f T R / (1 - exp(-R T / L))                   2 pi f L for R T << L
//! ```
//!
//! Where the limit leaves v = u alone the last line is s += ki e with ki = kp (1 - exp(-R T / L)), so the controller's
//! zero lies on the pole of the motor as it is sampled, and what is left is `2 pi f T / (z (z - 1))` whatever R and L are.
//!
//! `w` electrical speed, rad/s; `f` bandwidth (crossover of the open loop), Hz; `T` PWM period. Open loop:
//! `2 pi f / s exp(-1.5 T s)`, one period of computing and half of one of holding, so
//!
//! ```text
//! phase margin = 90 - 360 * 1.5 f T degrees          1000 Hz: 67.5,  2000 Hz: 45 at 24 kHz
//! ```
//!
//! Known limits: the flux is the nameplate's; iron saturates, and with a smaller L the crossover rises in proportion.
//!
//! **At the voltage limit** the field has priority: the direct current stays at its target of zero while the quadrature
//! current gives way. If both gave way in proportion, the direct voltage would be short first at speed, and a direct
//! current of either sign would grow with it, taking current range and, where positive, still more voltage. The share of
//! 0.87 leaves half of the voltage to q, against the back-EMF, even while d asks for all of it.
//!
//! **Anti-windup** is back-calculation with the gain 1/kp (the conditioned form of Hanus, 1987), written out: at the limit
//! the integral becomes what it would be if the target had been one that the voltage could realise, with the motor's own
//! time constant L/R. It needs no case distinction, and leaving the limit costs no more than a step.
//!
//! Cross-coupling from the measured currents: they lag the motor's by 1.5 periods, the targets would lead by 1/(2 pi f).

use super::Rotating;
use crate::checksum::Checksum;
use crate::hal::CURRENT_RATE_HZ;
use crate::real::{clamp, exp, min, sqrt};
use crate::units::{Ampere, Henry, Hertz, Ohm, Volt, Weber};

/// From a sample to the middle of the period in which its answer acts, in periods.
pub const DELAY_PERIODS: f32 = 1.5;

/// Share of the voltage limit that the direct axis may take.
const DIRECT_SHARE: f32 = 0.866_025_4;

/// What the loop has to know of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorConstants {
    /// Of one phase.
    pub resistance: Ohm,
    /// Along the flux.
    pub direct_inductance: Henry,
    /// Across the flux.
    pub quadrature_inductance: Henry,
    /// Of the magnets with one phase, peak.
    pub flux: Weber,
}

/// The constants of one loop; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentGains {
    proportional_ohm: Rotating<f32>,
    /// `1 - exp(-R T / L)`.
    renewal: Rotating<f32>,
    inductance_h: Rotating<f32>,
    flux_vs: f32,
    bandwidth: Hertz,
}

impl CurrentGains {
    /// Gains of a motor for a bandwidth of 50..=2000 Hz; `None` for another one and for constants that no motor of
    /// this class has (1 mOhm..10 Ohm, 1 uH..10 mH, flux to 1 V s).
    /// Without `feedforward` the integrals do what cross-coupling and back-EMF ask for.
    #[must_use]
    pub fn new(motor: &MotorConstants, bandwidth: Hertz, feedforward: bool) -> Option<Self> {
        let inductance_h = Rotating { d: motor.direct_inductance.0, q: motor.quadrature_inductance.0 };
        let sensible = (50.0..=2000.0).contains(&bandwidth.0)
            && (1e-3..=10.0).contains(&motor.resistance.0)
            && (1e-6..=1e-2).contains(&inductance_h.d)
            && (1e-6..=1e-2).contains(&inductance_h.q)
            && (0.0..=1.0).contains(&motor.flux.0);
        let period_s = 1.0 / CURRENT_RATE_HZ as f32;
        let volt_per_ampere = core::f32::consts::TAU * bandwidth.0 * period_s * motor.resistance.0;
        let renewal =
            |inductance: f32| 1.0 - exp(-motor.resistance.0 / (inductance * CURRENT_RATE_HZ as f32));
        let forward = if feedforward { 1.0 } else { 0.0 };
        let renewal = Rotating { d: renewal(inductance_h.d), q: renewal(inductance_h.q) };
        sensible.then(|| Self {
            proportional_ohm: Rotating { d: volt_per_ampere / renewal.d, q: volt_per_ampere / renewal.q },
            renewal,
            inductance_h: Rotating { d: forward * inductance_h.d, q: forward * inductance_h.q },
            flux_vs: forward * motor.flux.0,
            bandwidth,
        })
    }

    /// The smaller of both proportional gains, ohm.
    pub(super) fn least_ohm(&self) -> f32 {
        min(self.proportional_ohm.d, self.proportional_ohm.q)
    }

    /// The gain across the flux, for a bit that flips in it.
    #[cfg(not(target_os = "none"))]
    pub(super) const fn proportional_mut(&mut self) -> &mut f32 {
        &mut self.proportional_ohm.q
    }

    /// With what the tick computes with.
    #[must_use]
    pub(super) fn add_to(&self, sum: Checksum) -> Checksum {
        let Self { proportional_ohm, renewal, inductance_h, flux_vs, bandwidth: _ } = *self;
        sum.numbers([proportional_ohm, renewal, inductance_h].map(|pair| pair.d))
            .numbers([proportional_ohm, renewal, inductance_h].map(|pair| pair.q))
            .number(flux_vs)
    }

    /// Phase margin of the open loop, degrees.
    #[must_use]
    pub fn phase_margin_deg(&self) -> f32 {
        90.0 - 360.0 * DELAY_PERIODS * self.bandwidth.0 / CURRENT_RATE_HZ as f32
    }
}

/// What the loop remembers: the integrals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentLoop {
    integral_v: Rotating<f32>,
}

impl CurrentLoop {
    /// A loop that takes over from something that held a current at rest with a voltage.
    #[must_use]
    pub(super) fn holding(voltage: Rotating<Volt>) -> Self {
        Self { integral_v: Rotating { d: voltage.d.0, q: voltage.q.0 } }
    }

    /// The voltage for a quadrature current `target`, with a direct one of zero, no longer than `limit`;
    /// `speed` electrical, rad/s.
    #[inline(always)]
    pub fn voltage(
        &mut self,
        gains: &CurrentGains,
        target: Ampere,
        measured: Rotating<Ampere>,
        speed_rad_per_s: f32,
        limit: Volt,
    ) -> Rotating<Volt> {
        let forward = Rotating {
            d: -speed_rad_per_s * gains.inductance_h.q * measured.q.0,
            q: speed_rad_per_s * (gains.inductance_h.d * measured.d.0 + gains.flux_vs),
        };
        let wanted = Rotating {
            d: gains.proportional_ohm.d * -measured.d.0 + self.integral_v.d + forward.d,
            q: gains.proportional_ohm.q * (target.0 - measured.q.0) + self.integral_v.q + forward.q,
        };
        let given = limited(wanted, limit.0);
        self.integral_v.d += gains.renewal.d * (given.d - forward.d - self.integral_v.d);
        self.integral_v.q += gains.renewal.q * (given.q - forward.q - self.integral_v.q);
        Rotating { d: Volt(given.d), q: Volt(given.q) }
    }

    /// The integrals: what the voltages given so far, less what is fed forward, make of the current, times the resistance.
    #[must_use]
    pub(super) fn integral_v(&self) -> Rotating<f32> {
        self.integral_v
    }

    /// Empties the integrals.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

/// The wanted voltage where it is no longer than the limit.
#[inline(always)]
fn limited(wanted: Rotating<f32>, limit: f32) -> Rotating<f32> {
    let square = limit * limit;
    if wanted.d * wanted.d + wanted.q * wanted.q <= square { wanted } else { shortened(wanted, limit) }
}

/// Direct voltage first, the quadrature voltage in what is left of the circle. A function of its own, so that a tick within the limit does not
/// carry its registers.
#[inline(never)]
fn shortened(wanted: Rotating<f32>, limit: f32) -> Rotating<f32> {
    let square = limit * limit;
    let most = DIRECT_SHARE * limit;
    let d = clamp(wanted.d, -most, most);
    let left = sqrt(square - d * d);
    Rotating { d, q: clamp(wanted.q, -left, left) }
}

#[cfg(test)]
mod tests;
