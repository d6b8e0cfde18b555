//! Current control of one motor in the rotor's frame.
//!
//! ```text
//! e = i_target - i                                                            d and q, A
//! u_d = kp_d e_d + s_d - w L_q i_q                                            cross-coupling fed forward
//! u_q = kp_q e_q + s_q + w (L_d i_d + flux)                                   and back-EMF
//! v = u within |v| <= V,  d first:  |v_d| <= 0.87 V,  |v_q| <= sqrt(V^2 - v_d^2)
//! s += (1 - exp(-R T / L)) (v - fed forward - s)                            integral of the realised voltage
//!
//! kp = 2 pi f T R / (1 - exp(-R T / L))                   2 pi f L for R T << L
//! ```
//!
//! Where the limit leaves v = u alone, the last line is s += ki e with ki = kp (1 - exp(-R T / L)). The
//! controller's zero then lies on the pole of the sampled motor. The open loop becomes
//! `2 pi f T / (z (z - 1))` for every R and L.
//!
//! `w` electrical speed, rad/s; `f` bandwidth (crossover of the open loop), Hz; `T` PWM period. The open loop
//! is `2 pi f / s exp(-1.5 T s)`: one period of computing and half of one of holding. So
//!
//! ```text
//! phase margin = 90 - 360 * 1.5 f T degrees          1000 Hz: 67.5,  2000 Hz: 45 at 24 kHz
//! ```
//!
//! Known limits: the flux is the nameplate's. Iron saturates, and with a smaller L the crossover
//! rises in proportion.
//!
//! **At the voltage limit** the field has priority: the direct current stays at its target of zero while the
//! quadrature current gives way. If both gave way in proportion, the direct voltage would be short first at
//! speed. A direct current of either sign would then grow with speed, taking current range and, where
//! positive, still more voltage. The share of 0.87 leaves half of the voltage to q, against the back-EMF,
//! even while d requests all of it.
//!
//! **Anti-windup** is back-calculation with the gain 1/kp (the conditioned form of Hanus, 1987), written
//! out. At the limit the integral converges to its value for a target that the voltage could realise, with
//! the motor's own time constant L/R. This needs no case distinction, and leaving the limit costs no more
//! than a step.
//!
//! Cross-coupling uses measured currents: they lag the motor's by 1.5 periods; targets would lead by
//! 1/(2 pi f).

use super::Rotating;
use crate::checksum::Checksum;
use crate::hal::CURRENT_RATE_HZ;
use crate::real::{clamp, exp, min, sqrt};
use crate::units::{Ampere, Henry, Hertz, Ohm, Volt, Weber};

/// Delay from a sample to the middle of the period in which its command acts, in PWM periods.
pub(crate) const DELAY_PERIODS: f32 = 1.5;

/// Share of the voltage limit available to the direct axis.
const DIRECT_SHARE: f32 = 0.866_025_4;

/// Motor constants that the current loop needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MotorConstants {
    /// Resistance of one phase.
    pub(crate) resistance: Ohm,
    /// Inductance along the flux.
    pub(crate) direct_inductance: Henry,
    /// Inductance across the flux.
    pub(crate) quadrature_inductance: Henry,
    /// Flux linkage of the magnets with one phase, peak.
    pub(crate) flux: Weber,
}

/// Constants of one loop; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CurrentGains {
    proportional_ohm: Rotating<f32>,
    resistance_ohm: f32,
    /// `1 - exp(-R T / L)`.
    renewal: Rotating<f32>,
    inductance_h: Rotating<f32>,
    flux_vs: f32,
    bandwidth: Hertz,
}

impl CurrentGains {
    /// Derives the gains for a bandwidth of 50..=2000 Hz. Returns `None` for other bandwidths and for
    /// implausible motor constants (allowed: 1 mOhm..10 Ohm, 1 uH..10 mH, flux to 1 V s). Without
    /// `feedforward` the integrals supply cross-coupling and back-EMF.
    pub fn new(motor: &MotorConstants, bandwidth: Hertz, feedforward: bool) -> Option<Self> {
        let inductance_h = Rotating { d: motor.direct_inductance.0, q: motor.quadrature_inductance.0 };
        let sensible = (50.0..=2000.0).contains(&bandwidth.0)
            && (1e-3..=10.0).contains(&motor.resistance.0)
            && (1e-6..=1e-2).contains(&inductance_h.d)
            && (1e-6..=1e-2).contains(&inductance_h.q)
            && (0.0..=1.0).contains(&motor.flux.0);
        let renewal =
            |inductance: f32| 1.0 - exp(-motor.resistance.0 / (inductance * CURRENT_RATE_HZ as f32));
        let forward = if feedforward { 1.0 } else { 0.0 };
        let renewal = Rotating { d: renewal(inductance_h.d), q: renewal(inductance_h.q) };
        sensible.then(|| Self {
            proportional_ohm: proportional_ohm(bandwidth, motor.resistance.0, renewal),
            resistance_ohm: motor.resistance.0,
            renewal,
            inductance_h: Rotating { d: forward * inductance_h.d, q: forward * inductance_h.q },
            flux_vs: forward * motor.flux.0,
            bandwidth,
        })
    }

    /// Sets another bandwidth, which was checked before.
    pub(super) fn set_bandwidth(&mut self, bandwidth: Hertz) {
        self.bandwidth = bandwidth;
        self.proportional_ohm = proportional_ohm(bandwidth, self.resistance_ohm, self.renewal);
    }

    /// Smaller of both proportional gains, ohm.
    pub(super) fn least_ohm(&self) -> f32 {
        min(self.proportional_ohm.d, self.proportional_ohm.q)
    }

    /// Quadrature gain, for injecting a bit flip.
    #[cfg(not(target_os = "none"))]
    pub(super) const fn proportional_mut(&mut self) -> &mut f32 {
        &mut self.proportional_ohm.q
    }

    /// Adds all constants to a checksum.
    pub(super) fn add_to(&self, sum: Checksum) -> Checksum {
        let Self { proportional_ohm, resistance_ohm, renewal, inductance_h, flux_vs, bandwidth } = *self;
        let pairs = [proportional_ohm, renewal, inductance_h];
        sum.numbers(pairs.map(|pair| pair.d)).numbers(pairs.map(|pair| pair.q)).numbers([
            resistance_ohm,
            flux_vs,
            bandwidth.0,
        ])
    }
}

/// Proportional gains, `2 pi f T R / (1 - exp(-R T / L))`; `renewal` is the denominator.
fn proportional_ohm(bandwidth: Hertz, resistance_ohm: f32, renewal: Rotating<f32>) -> Rotating<f32> {
    let period_s = 1.0 / CURRENT_RATE_HZ as f32;
    let volt_per_ampere = core::f32::consts::TAU * bandwidth.0 * period_s * resistance_ohm;
    Rotating { d: volt_per_ampere / renewal.d, q: volt_per_ampere / renewal.q }
}

/// State of the loop: the integrals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct CurrentLoop {
    integral_v: Rotating<f32>,
}

impl CurrentLoop {
    /// A loop that takes over from a voltage that held a current at rest.
    pub(super) fn holding(voltage: Rotating<Volt>) -> Self {
        Self { integral_v: Rotating { d: voltage.d.0, q: voltage.q.0 } }
    }

    /// Computes the voltage for a current `target`, no longer than `limit`; `speed_rad_per_s` is electrical.
    #[inline(always)]
    pub(super) fn voltage(
        &mut self,
        gains: &CurrentGains,
        target: Rotating<Ampere>,
        measured: Rotating<Ampere>,
        speed_rad_per_s: f32,
        limit: Volt,
    ) -> Rotating<Volt> {
        let forward = Rotating {
            d: -speed_rad_per_s * gains.inductance_h.q * measured.q.0,
            q: speed_rad_per_s * (gains.inductance_h.d * measured.d.0 + gains.flux_vs),
        };
        let wanted = Rotating {
            d: gains.proportional_ohm.d * (target.d.0 - measured.d.0) + self.integral_v.d + forward.d,
            q: gains.proportional_ohm.q * (target.q.0 - measured.q.0) + self.integral_v.q + forward.q,
        };
        let given = limited(wanted, limit.0);
        self.integral_v.d += gains.renewal.d * (given.d - forward.d - self.integral_v.d);
        self.integral_v.q += gains.renewal.q * (given.q - forward.q - self.integral_v.q);
        Rotating { d: Volt(given.d), q: Volt(given.q) }
    }

    /// Integrals: the realised voltages less feedforward, filtered as resistance times current.
    pub(super) fn integral_v(&self) -> Rotating<f32> {
        self.integral_v
    }

    /// Electrical power into the motor, W: `1.5 (s_d i_d + (s_q + w flux) i_q)`. The integral takes the place
    /// of the realised voltage, so the energy in the inductances, zero in the mean, is left out. So is the
    /// power of saliency, because the direct current is zero in the mean.
    #[inline(always)]
    pub(super) fn power_w(
        &self,
        gains: &CurrentGains,
        current: Rotating<Ampere>,
        speed_rad_per_s: f32,
    ) -> f32 {
        let quadrature_v = self.integral_v.q + speed_rad_per_s * gains.flux_vs;
        1.5 * (self.integral_v.d * current.d.0 + quadrature_v * current.q.0)
    }

    /// Sets the integrals to zero.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }
}

/// Applies the voltage limit; a shorter vector stays unchanged.
#[inline(always)]
fn limited(wanted: Rotating<f32>, limit: f32) -> Rotating<f32> {
    let square = limit * limit;
    if wanted.d * wanted.d + wanted.q * wanted.q <= square { wanted } else { shortened(wanted, limit) }
}

/// Limits the direct voltage first, then the quadrature voltage to the rest of the circle. A separate
/// function, so that a tick within the limit does not save its registers.
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
